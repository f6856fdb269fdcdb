"""Certificates of studies' plans that hold a proof on candidates: true ones, and forged files."""

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from arm import arm
from kr270 import REQUIRED, TEST_POSE
from loaded_arm import STUDY

import edtk
from edtk.study.study import Study
from edtk.system.errors import UserError

Content = dict[str, Any]
OTHER = TEST_POSE | {"q_deg": [0, -60, 90, 10, 45, 30], "load": {"F_N": [700, -600, 300]}}
IDLE = TEST_POSE | {"q_deg": [0, -80, 70, 10, 45, 30], "weight": 0}
TASKS = Study(**REQUIRED, starts=1, candidates=60, test_pose=[TEST_POSE, OTHER, IDLE])
KINDS = {"springs": arm(), "parameters": STUDY}


def written(study: Study, criterion: str, path: Path, seconds: float = 20, **given: Any) -> Content:
    """The certificate of a plan with a proof on some candidates, as a file holds it."""
    edtk.plan(study, criterion=criterion, workers=1, prove=seconds, certificate=path, **given)
    return json.loads(path.read_text())  # type: ignore[no-any-return]


@pytest.fixture(scope="module")
def true(tmp_path_factory: pytest.TempPathFactory) -> Content:
    """One of springs."""
    path = tmp_path_factory.mktemp("exact") / "c.json"
    return written(KINDS["springs"], "A", path, size=3, candidates=30)


def test_a_true_one_holds(true: Content) -> None:
    """The tree is replayed on candidates that were drawn anew, and the sentence says what holds."""
    found = edtk.verify(true, KINDS["springs"])
    assert found.valid, found.summary()
    assert "the best of all plans of 3 experiments on the first 30 candidates is proved" in (
        found.proved
    )
    claims = {claim.claim: claim for claim in found.claims}
    assert {"value_exact", "bound_exact", "proved_exact"} <= set(claims)
    assert claims["bound_exact"].candidates == 30
    assert "proved on 30 candidates: no plan of whole experiments" in str(found.summary())


@pytest.mark.slow
@pytest.mark.cell("`plan --prove` with `--certificate`")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("criterion", ["D", "G"])
def test_both_kinds_of_studies_and_criteria(kind: str, criterion: str, tmp_path: Path) -> None:
    """The second implementation confirms the proof of each."""
    study = KINDS[kind]
    content = written(study, criterion, tmp_path / "c.json", size=4, candidates=25)
    assert edtk.verify(content, study).valid
    assert content["on_candidates"]["proved_exact"]


@pytest.mark.slow
@pytest.mark.parametrize("criterion", ["rho0", "rho_max"])
def test_criteria_of_tasks(criterion: str, tmp_path: Path) -> None:
    """The harm of all tasks, and the worst of those that have weight."""
    content = written(TASKS, criterion, tmp_path / "c.json", size=3, candidates=60)
    found = edtk.verify(content, TASKS)
    assert found.valid, found.summary()


@pytest.mark.slow
def test_kept_experiments_and_what_is_known_count(tmp_path: Path) -> None:
    """They are beside every plan of the tree."""
    normal = {"kind": "normal", "mean_rad_per_Nm": 2e-6, "std_rad_per_Nm": 1e-6}
    study = KINDS["springs"].replace(prior={"all": normal, "in_design": True})
    kept = edtk.plan(study, 2, "D", workers=1).whole
    content = written(study, "D", tmp_path / "c.json", size=4, keep=kept, candidates=20)
    assert edtk.verify(content, study, keep=kept).valid
    content["kept"][0]["repeats"] += 1
    assert "value_exact" in edtk.verify(content, study).failed


def test_visits_that_share_errors_are_not_the_best_where_they_repeat(tmp_path: Path) -> None:
    """What a model leaves out comes with every visit of a pose: the bound holds, and no more."""
    study = KINDS["springs"].replace(noise={"discrepancy_mm": 0.2})
    content = written(study, "A", tmp_path / "c.json", size=6, candidates=6)
    one = content["on_candidates"]
    assert max(one["plan"]["count"]) > 1
    assert not one["proved_exact"]
    assert one["value"] > 1.5 * one["bound_exact"]
    assert edtk.verify(content, study).valid
    one["proved_exact"] = True
    assert edtk.verify(content, study).failed == ("proved_exact",)
    # The value that a sum of single visits would have.
    one |= {"value": one["bound_exact"]}
    assert edtk.verify(content, study).failed == ("value_exact", "proved_exact")


def test_a_proof_that_was_not_ended_proves_its_bound(tmp_path: Path) -> None:
    """No plan is said to be the best, and none may be."""
    study = KINDS["springs"]
    content = written(study, "A", tmp_path / "c.json", 0, size=7)
    assert not content["on_candidates"]["proved_exact"]
    found = edtk.verify(content, study)
    assert found.valid
    assert "a bound on all plans of 7 experiments on the first 100 candidates" in found.proved
    content["on_candidates"]["proved_exact"] = True
    assert edtk.verify(content, study).failed == ("proved_exact",)


def _drop_leaf(own: Content) -> None:
    for name in ("multiplier", "parent", "group", "first", "stop", "count"):
        own["tree"][name].pop()


def _set(**entries: Any) -> Callable[[Content], None]:
    return lambda own: own.update(entries)


FORGED = {
    "a leaf is taken out": _drop_leaf,
    "a better bound": lambda own: own.update(bound_exact=own["bound_exact"] * (1 + 1e-6)),
    "a better value": lambda own: own.update(value=own["value"] * (1 - 1e-6)),
    "a worse plan": _set(plan={"candidate": [0, 1], "count": [1, 2]}),
    "fewer experiments": _set(plan={"candidate": [0], "count": [1]}),
    "no experiment": _set(plan={"candidate": [], "count": []}),
    "more candidates": lambda own: own.update(candidates=own["candidates"] + 1),
    "fewer candidates": lambda own: own.update(candidates=own["candidates"] - 1),
    "too many candidates": _set(candidates=10**12),
    "a candidate is missing": lambda own: own["tree"]["order"].pop(),
    "the root is a part": lambda own: own["tree"]["stop"].__setitem__(0, 20),
    "multipliers of nothing": lambda own: own["tree"].update(
        multipliers=[[0.0] * 3] * len(own["tree"]["multipliers"])
    ),
    "a multiplier with a negative eigenvalue": lambda own: own["tree"]["multipliers"][
        0
    ].__setitem__(0, -1.0),
    "no word whether it is the best": lambda own: own.pop("proved_exact"),
    "a word too many": _set(more=1),
}


@pytest.mark.parametrize("name", FORGED)
def test_forged_files_are_found_out(true: Content, name: str) -> None:
    """No entry can be changed to another claim: it fails, or the file is none."""
    content = copy.deepcopy(true)
    FORGED[name](content["on_candidates"])
    try:
        failed = set(edtk.verify(content, KINDS["springs"]).failed)
    except UserError:
        return
    assert failed & {"value_exact", "bound_exact", "proved_exact"}


def test_candidates_of_another_seed_are_said(tmp_path: Path) -> None:
    """The study's own candidates may have a better plan."""
    content = written(KINDS["springs"], "A", tmp_path / "c.json", size=3, candidates=30, seed=7)
    said = "on the first 30 candidates, drawn with another seed than the study's, is proved"
    assert said in edtk.verify(content, KINDS["springs"]).proved


def test_other_candidates_are_found_out(true: Content) -> None:
    """Another seed draws other candidates, of which nothing is proved."""
    content = copy.deepcopy(true)
    content["proof"]["seed"] = [*content["proof"]["seed"], 7]
    assert "bound_exact" in edtk.verify(content).failed


def test_weights_have_no_such_part(true: Content, tmp_path: Path) -> None:
    """The proof is of plans alone."""
    edtk.relax(KINDS["springs"], "A", certificate=tmp_path / "c.json")
    content = json.loads((tmp_path / "c.json").read_text())
    content["on_candidates"] = true["on_candidates"]
    with pytest.raises(UserError, match="on_candidates"):
        edtk.verify(content)
