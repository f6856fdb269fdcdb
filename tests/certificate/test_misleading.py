"""Certificates whose every number is right, and which would be read as more than they prove."""

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arm import arm
from click.testing import CliRunner
from loaded_arm import LOAD, STUDY

import edtk
from edtk.cli import main

pytestmark = pytest.mark.usefixtures("shortest_searches")

Content = dict[str, Any]
SPRINGS = arm()
KNOWN = {"joints": {"q1": {"kind": "normal", "mean_rad_per_Nm": 3e-6, "std_rad_per_Nm": 1e-6}}}


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> Content:
    """The certificate of a plan of six visits."""
    path = tmp_path_factory.mktemp("misleading") / "c.json"
    edtk.plan(STUDY, 6, certificate=path)
    return json.loads(path.read_text())  # type: ignore[no-any-return]


def consistent(content: Content) -> Content:
    """The same certificate, with all its claims as they are recomputed."""
    for claim in edtk.verify(content).claims:
        if claim.claim in content["claims"] and claim.recomputed is not None:
            content["claims"][claim.claim] = claim.recomputed
    return content


def test_what_is_proved_on_what_is_in_the_first_line(honest: Content, tmp_path: Path) -> None:
    """The line tells searched from proved, counts candidates, and says whose the setting is."""
    first = edtk.verify(honest, STUDY).summary().splitlines()[0]
    assert first.endswith(
        "valid for this study; its efficiency beside all plans of 6 new experiments is searched "
        "over all poses, not proved"
    )
    assert "in a setting that is the file's own word" in edtk.verify(honest).summary()
    path = tmp_path / "c.json"
    edtk.relax(STUDY, certificate=path)
    first = edtk.verify(path, STUDY).summary().splitlines()[0]
    assert first.endswith(
        "valid for this study; the bound is proved on 100 random candidate poses alone: other "
        "poses may be better"
    )


def test_few_candidates_that_the_plan_chooses(honest: Content) -> None:
    """An efficiency beside one candidate and the plan's own poses is none, whatever is stated."""
    content = copy.deepcopy(honest)
    content["proof"]["candidates"] = 1
    content["proof"]["searched"] = []
    content["claims"]["bound"] = content["claims"].pop("bound_searched")
    assert "bound_searched" in edtk.verify(consistent(content)).failed
    del content["claims"]["efficiency"]
    del content["claims"]["bound"]
    content["claims"]["bound"] = 0.0
    found = edtk.verify(consistent(content), STUDY)
    assert "question" in found.failed
    assert "the study has 100 candidates, and the certificate 1" in found.summary()
    assert found.proved == "nothing is proved"


def test_candidates_of_another_kind(honest: Content) -> None:
    """They are drawn as the study says."""
    content = copy.deepcopy(honest)
    content["proof"]["sampling"] = "sobol"
    found = edtk.verify(consistent(content), STUDY)
    assert "the study's candidates are random" in found.summary()


def test_candidates_of_another_seed_are_said(tmp_path: Path) -> None:
    """`--seed` may ask for them; of many seeds one has the poorest, with the best bound."""
    other = "poses alone, drawn with another seed than the study's"
    for seed, words in ((0, "poses alone"), (7, other)):
        edtk.relax(STUDY, certificate=tmp_path / "c.json", seed=seed)
        found = edtk.verify(tmp_path / "c.json", STUDY)
        assert found.valid
        assert f"the bound is proved on 100 random candidate {words}: other" in found.proved
        # Without the study nobody knows its seed.
        assert "seed" not in edtk.verify(tmp_path / "c.json").proved


def test_a_plan_that_beats_its_bound_is_a_contradiction(honest: Content) -> None:
    """A few poor candidates give a poor bound: an efficiency above one is no praise."""
    content = copy.deepcopy(honest)
    content["proof"].update(candidates=1, searched=[], support=[])
    claims = {claim.claim: claim for claim in edtk.verify(consistent(content)).claims}
    for name in ("bound_searched", "efficiency"):
        assert claims[name].reason == "the design beats the bound"
    assert (claims["efficiency"].recomputed or 0.0) > 1
    assert not claims["search"].holds


def test_a_bound_over_all_poses_that_is_dropped(honest: Content) -> None:
    """A plan has its efficiency beside all poses, or none."""
    content = copy.deepcopy(honest)
    content["claims"]["bound"] = content["claims"].pop("bound_searched")
    assert "bound_searched" in edtk.verify(consistent(content), STUDY).failed
    del content["claims"]["efficiency"]
    found = edtk.verify(consistent(content), STUDY)
    assert found.valid, found.summary()
    # The plan's own poses count, so that it cannot beat the bound.
    assert content["claims"]["bound"] <= content["claims"]["value"] * (1 + 1e-9)
    assert "the bound on all plans of 6 new experiments is proved on 100 random" in found.proved


def test_a_day_that_is_dropped(honest: Content) -> None:
    """A plan beyond the budget of its study fails, although its file says nothing of budgets."""
    priced = STUDY.replace(costs={"visit": 10, "budget": 60})
    assert edtk.verify(honest, priced).valid
    content = copy.deepcopy(honest)
    content["experiments"][0]["repeats"] = 2000
    found = edtk.verify(consistent(content), priced)
    assert "question" in found.failed
    assert "the study has a budget of 60, and the plan costs 200" in found.summary()


def test_experiments_that_nobody_has_made(honest: Content) -> None:
    """One under a load of 1e6 N would tell all; beside the study it needs its plan."""
    content = copy.deepcopy(honest)
    wrench = [1e4 * part for part in LOAD]
    content["kept"] = [{"q": content["experiments"][0]["q"], "wrench": wrench, "repeats": 1}]
    found = edtk.verify(consistent(content), STUDY)
    assert "experiments are taken as made before" in found.summary()
    assert "question" in found.failed


@pytest.mark.cell("`verify --size`", "springs", "parameters")
@pytest.mark.parametrize("study", [SPRINGS, STUDY], ids=["springs", "parameters"])
def test_a_plan_of_another_size(study: edtk.Study, tmp_path: Path) -> None:
    """It is the answer to another question; without a size the first line says its number."""
    edtk.plan(study, 6, certificate=tmp_path / "c.json")
    content = json.loads((tmp_path / "c.json").read_text())
    assert edtk.verify(content, study, size=6).valid
    content["experiments"][0]["repeats"] += 1
    more = consistent(content)
    assert "all plans of 7 new experiments" in edtk.verify(more, study).proved
    found = edtk.verify(more, study, size=6)
    assert found.failed == ("question",)
    assert "the plan has 7 experiments, kept ones counted, and 6 are asked for" in found.summary()
    study.to_toml(tmp_path / "study.toml")
    (tmp_path / "more.json").write_text(json.dumps(more))
    command = ["verify", str(tmp_path / "more.json"), "--study", str(tmp_path / "study.toml")]
    codes = [CliRunner().invoke(main, [*command, "--size", size]).exit_code for size in "76"]
    assert codes == [0, 1]
    run = CliRunner().invoke(main, [*command[:2], "--size", "6"])
    assert (run.exit_code, "goes with a study" in run.stderr) == (2, True), run.output


def test_a_size_counts_kept_experiments(tmp_path: Path) -> None:
    """As that of `edtk plan` does."""
    kept = edtk.Plan(np.array([[0.5, 0.7]]), np.array([LOAD], dtype=float), np.array([2]))
    edtk.plan(STUDY, 6, keep=kept, certificate=tmp_path / "c.json")
    assert edtk.verify(tmp_path / "c.json", STUDY, size=6, keep=kept).valid
    found = edtk.verify(tmp_path / "c.json", STUDY, size=4, keep=kept)
    assert found.failed == ("question",)


@pytest.mark.parametrize("study", [SPRINGS, STUDY], ids=["springs", "parameters"])
def test_a_prior_that_too_few_experiments_share(study: edtk.Study, tmp_path: Path) -> None:
    """Weights look the better, the fewer share what is known; their number is the study's."""
    known = study.replace(prior=KNOWN | {"in_design": True}, sizes=[4, 9])
    edtk.relax(known, certificate=tmp_path / "c.json")
    content = json.loads((tmp_path / "c.json").read_text())
    assert edtk.verify(content, known).valid
    assert edtk.verify(content, known, size=9).failed == ("question",)
    content["sharing"] = 1
    forged = consistent(content)
    assert edtk.verify(forged).valid
    found = edtk.verify(forged, known)
    assert found.failed == ("question",)
    assert "1 experiments share what is known beforehand; expected 4 or 9" in found.summary()
    edtk.relax(study, certificate=tmp_path / "bare.json")
    with pytest.raises(edtk.UserError, match="weights have no size without a prior"):
        edtk.verify(tmp_path / "bare.json", study, size=4)


def test_a_budget_beside_a_size_is_said(tmp_path: Path) -> None:
    """A plan of few visits is judged beside plans as small, not beside all that are paid for."""
    priced = STUDY.replace(costs={"visit": 1, "budget": 8})
    edtk.plan(priced, 6, certificate=tmp_path / "c.json")
    found = edtk.verify(tmp_path / "c.json", priced)
    assert "beside all plans of 6 new experiments within a budget of 8 is searched" in found.proved
    edtk.plan(priced, certificate=tmp_path / "c.json")
    found = edtk.verify(tmp_path / "c.json", priced)
    assert "beside all plans within a budget of 8 is searched" in found.proved
