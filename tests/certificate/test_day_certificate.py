"""Certificates of plans within a budget: valid, and found out if loads or costs are forged."""

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from loaded_arm import LOAD, STUDY

import edtk
from edtk.certificate.recompute.day import Day
from edtk.certificate.verify_certificate import verify_certificate
from edtk.cli import main

Content = dict[str, Any]
PRICED = STUDY.replace(costs={"visit": 2, "loaded_visit": 5, "load_change": 1}, candidates=60)
COSTS = {
    "visit": 2.0,
    "loaded_visit": 5.0,
    "load_change": 10.0,
    "load_changes": None,
    "budget": 31.0,
    "visits": None,
}
KEPT = edtk.Plan(np.deg2rad([[30.0, 40.0]]), np.array([LOAD], dtype=float), np.array([1]))


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The certificate of a plan of both loads, beside a visit that was made before."""
    path = tmp_path_factory.mktemp("day") / "c.json"
    edtk.plan(PRICED, cost_budget=31, keep=KEPT, certificate=path)
    return path


@pytest.fixture(scope="module")
def honest(file: Path) -> Content:
    """The same, read."""
    return json.loads(file.read_text())  # type: ignore[no-any-return]


def test_it_is_valid(honest: Content) -> None:
    """Costs, value and bound are found again, by a proof for each set of loads that is paid for."""
    found = edtk.verify(honest, PRICED, keep=KEPT, cost_budget=31)
    assert found.valid, found.summary()
    assert "its efficiency beside all plans within a budget of 31 is searched" in found.proved
    names = [claim.claim for claim in found.claims]
    assert {"costs", "kept", "bound_searched", "efficiency", "search"} <= set(names)
    # Beside the kept loaded visit, unloaded ones alone tell the springs, too.
    assert [one["loads"] for one in honest["proof"]] == [[0, 1], [0], [1]]
    costs = next(claim for claim in found.claims if claim.claim == "costs")
    assert costs.recomputed is not None
    assert costs.recomputed <= 31


def test_loads_that_tell_nothing_need_no_proof(tmp_path: Path) -> None:
    """Without a load springs stay open: that set has no proof, and none is asked for."""
    path = tmp_path / "c.json"
    study = PRICED.replace(costs={"load_change": 8, "budget": 10})
    found = edtk.plan(study, 8, "D", certificate=path)
    content = json.loads(path.read_text())
    assert [one["loads"] for one in content["proof"]] == [[1]]
    assert content["day"]["visits"] == 8
    proved = edtk.verify(content, study)
    assert proved.valid, proved.summary()
    bound = next(claim for claim in proved.claims if claim.claim == "bound_searched")
    assert bound.recomputed == pytest.approx(found.bound, rel=1e-9)


def _swap(content: Content) -> None:
    first, second = content["proof"][1:3]
    first["loads"], second["loads"] = second["loads"], first["loads"]


def _drop(content: Content) -> None:
    """The proof of the set whose bound is the least one."""
    del content["proof"][0]


def _more(content: Content) -> None:
    """One visit more."""
    content["experiments"][0]["repeats"] += 1


FORGERIES: dict[str, Callable[[Content], object]] = {
    "a proof is missing": _drop,
    "proofs of other loads": _swap,
    "more visits than are paid for": _more,
    "a larger budget": lambda c: c["day"].update(budget=32.0),
    "a smaller budget": lambda c: c["day"].update(budget=20.0),
    "cheaper visits": lambda c: c["day"].update(visit=1.0, loaded_visit=1.0),
    "a number of visits": lambda c: c["day"].update(visits=3),
    "a better bound": lambda c: c["claims"].update(
        bound_searched=1.01 * c["claims"]["bound_searched"]
    ),
    "a multiplier": lambda c: c["proof"][0]["multipliers"][0][0].__setitem__(0, 1e-3),
}


@pytest.mark.parametrize("forgery", FORGERIES)
def test_forgeries_are_rejected(forgery: str, honest: Content) -> None:
    """Each makes a claim fail, without the study at hand."""
    content = copy.deepcopy(honest)
    FORGERIES[forgery](content)
    assert content != honest
    assert not verify_certificate(content).valid


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda c: c.pop("day"), "proof: expected a table"),
        (lambda c: c.update(proof=[]), "proof: expected one for each set of loads"),
        (lambda c: c["proof"][0].update(loads=[1, 0]), r"proof\[0\].loads: expected other loads"),
        (lambda c: c["proof"][1].update(loads=[1]), r"proof\[2\].loads: expected other loads"),
        (lambda c: c["proof"][0].update(loads=[0, 7]), "whole number from 0 to 1"),
        (lambda c: c["day"].update(visit=0), "costs above zero"),
        (lambda c: c["day"].update(budget=float("inf")), "day.budget: expected finite"),
        (lambda c: c["day"].update(more=1), "day: unknown key"),
        (lambda c: c["setting"].update(load={"F_max_N": 100}), "expected loads that are listed"),
    ],
)
def test_what_is_no_certificate_is_said(
    change: Callable[[Content], object], said: str, honest: Content
) -> None:
    """One line, and no traceback."""
    content = copy.deepcopy(honest)
    change(content)
    with pytest.raises(edtk.UserError, match=said):
        edtk.verify(content)


def test_costs_are_those_of_the_study(file: Path, tmp_path: Path) -> None:
    """With the study beside it, other costs are named; the command ends with 1."""
    study = tmp_path / "study.toml"
    PRICED.to_toml(study)
    kept = tmp_path / "kept.csv"
    KEPT.to_csv(kept, PRICED.robot)
    beside = ["--study", str(study), "--keep", str(kept), "--cost-budget", "31"]
    run = CliRunner().invoke(main, ["verify", str(file), *beside])
    assert (run.exit_code, "valid: all" in run.stdout) == (0, True), run.output
    run = CliRunner().invoke(main, ["verify", str(file), *beside[2:]])
    assert (run.exit_code, "goes with a study" in run.stderr) == (2, True), run.output
    PRICED.replace(costs={"visit": 2, "loaded_visit": 5, "load_change": 3}).to_toml(study)
    run = CliRunner().invoke(main, ["verify", str(file), "--study", str(study)])
    assert run.exit_code == 1
    assert "the study has another cost load_change" in run.stdout


def test_the_budget_is_that_of_the_study(honest: Content) -> None:
    """A raised budget fails beside the study, as does one that the study does not have."""
    assert "expected the one of 31 beside it" in edtk.verify(honest, PRICED, keep=KEPT).summary()
    budget = {"visit": 2, "loaded_visit": 5, "load_change": 1, "budget": 30}
    found = edtk.verify(honest, PRICED.replace(costs=budget), keep=KEPT)
    assert found.failed == ("question",)
    assert "the study has a budget of 30, not of 31" in found.summary()
    other = edtk.Plan(KEPT.q + 1e-3, KEPT.wrench, KEPT.repeats)
    found = edtk.verify(honest, PRICED, keep=other, cost_budget=31)
    assert "the experiments taken as made before are not those beside it" in found.summary()


def test_a_criterion_of_no_size_has_none(tmp_path: Path) -> None:
    """The condition number of a plan is that of one with half of its visits."""
    with pytest.raises(edtk.UserError, match="certificate: plans within a budget of costs"):
        edtk.plan(PRICED, criterion="O2", cost_budget=31, certificate=tmp_path / "c.json")


def test_sets_that_a_day_pays_for() -> None:
    """All of them and no others, with what is left for visits; by hand."""
    day = Day.from_dict(COSTS)
    wrenches = np.array([np.zeros(6), LOAD, [0, 0, -50, 0, 0, 0]], dtype=float)
    assert dict(day.sets(wrenches)) == {
        (0,): 31.0,
        (1,): 31.0,
        (2,): 31.0,
        (0, 1): 21.0,
        (0, 2): 21.0,
        (1, 2): 21.0,
        (0, 1, 2): 11.0,
    }
    assert day.amount(np.array([5.0, 5.0]), 21.0) == (4.0, False)
    assert day.amount(np.array([2.0, 5.0]), 21.0) == (21.0, True)
    sized = Day.from_dict(COSTS | {"visits": 6})
    assert set(sized.sets(wrenches)) >= {((0,), 31.0), ((1,), 31.0), ((0, 1), 21.0)}
    assert not any(len(loads) == 3 for loads, _ in sized.sets(wrenches))
    assert sized.amount(np.array([2.0, 5.0]), 21.0) == (6.0, False)
    assert day.total(wrenches[[0, 1, 1]], np.array([2, 1, 1])) == 4 + 10 + 10
    assert Day.from_dict(COSTS | {"load_changes": 3}).total(wrenches[:2], np.ones(2)) == 37
