"""Certificates whose every number is right, and which would be read as more than they prove."""

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from loaded_arm import LOAD, STUDY

import edtk
from edtk.certificate import proof as largest_sensitivities
from edtk.design.relaxation import search_continuum

Content = dict[str, Any]


@pytest.fixture(scope="module", autouse=True)
def small_searches() -> Iterator[None]:
    """Two joints need neither thousands of fresh poses nor many climbs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search_continuum, "SCREEN", 3000)
        patch.setattr(largest_sensitivities, "OWN_DRAWS", 256)
        patch.setattr(largest_sensitivities, "STARTS", 4)
        yield


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
