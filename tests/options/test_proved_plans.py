"""`plan --prove-bound`: the efficiency beside all plans in any poses, with its certificate."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from loaded_arm import STUDY as ARM
from short_search import short_search
from three_joints import THREE

import edtk
from edtk.cli import main
from edtk.design.bound import BoundKind
from edtk.design.enclosure import prove_continuum
from edtk.design.enclosure.cover import CoveringInterrupted, cover
from edtk.study.study import Study
from edtk.system.errors import UserError

TRACKER = {
    "tracker_position_mm": [1400, 600, 600],
    "along": [5, 30],
    "across": [5, 150],
    "given_as": "sigma",
}


@pytest.mark.cell("`plan --prove-bound`", "springs")
def test_a_plan_beside_all_poses_is_proved_and_verified(tmp_path: Path) -> None:
    """The bound is near the searched one and below; its certificate holds for this study."""
    study = Study(**THREE)
    path = tmp_path / "certificate.json"
    with short_search():
        searched = edtk.plan(study, 4, "D", seed=1, workers=1)
        found = edtk.plan(study, 4, "D", seed=1, workers=1, prove_bound=1e-3, certificate=path)
    assert found.kind is BoundKind.PROVED
    assert found.cost == searched.cost
    assert 0.998 * searched.efficiency < found.efficiency <= searched.efficiency * (1 + 1e-9)
    assert "proved for all poses" in found.summary()
    told = found.to_dict()
    assert told["bound_proved"]
    assert not told["bound_searched"]
    checked = edtk.verify(path, study)
    assert checked.valid, checked.claims
    assert "in any poses, is proved" in checked.proved
    content = json.loads(path.read_text(encoding="utf-8"))
    covering = content["proof"]["continuum"]["coverings"][0]
    covering["tree"] = covering["tree"][:-1]
    path.write_text(json.dumps(content), encoding="utf-8")
    assert edtk.verify(path).failed == ("bound_proved", "efficiency")


@pytest.mark.cell("`plan --prove-bound`", "parameters")
def test_a_plan_of_geometry_is_proved_beside_all_poses(tmp_path: Path) -> None:
    """The bound is proved, and its certificate holds."""
    path = tmp_path / "certificate.json"
    with short_search():
        found = edtk.plan(ARM, size=6, seed=1, workers=1, prove_bound=1e-3, certificate=path)
    assert found.kind is BoundKind.PROVED
    assert 0.9 < found.efficiency <= 1
    checked = edtk.verify(path)
    assert checked.valid, checked.claims
    assert "in any poses, is proved" in checked.proved


def test_a_budget_of_costs_has_no_bound_over_all_poses() -> None:
    """It is refused before the search."""
    study = Study(**THREE)
    with pytest.raises(UserError, match="plans within a budget of costs have no bound over all"):
        edtk.plan(study, criterion="D", cost_budget=5.0, prove_bound=1e-3)


def test_what_has_no_enclosure_is_refused_before_the_search() -> None:
    """No plan is searched whose bound over all poses could not be proved afterwards."""
    said: list[str] = []
    study = Study(**THREE | {"measurement": {}, "noise": TRACKER})
    with pytest.raises(UserError, match="compares the parts of what a pose tells"):
        edtk.plan(
            study, 3, "O2", prove_bound=1e-3, progress=lambda label, number: said.append(label)
        )
    assert not said


@pytest.mark.parametrize(("given", "words"), [(1e-300, "1e-12 or more"), (0.0, "between 0 and 1")])
def test_a_gap_below_rounding_is_refused(given: float, words: str) -> None:
    """Nobody waits for a proof that no double can hold."""
    study = Study(**THREE)
    with pytest.raises(UserError, match=words):
        edtk.plan(study, 3, "D", prove_bound=given)
    for asked in (study, edtk.Region(lambda x: x, 0, 1)):
        with pytest.raises(UserError, match=words):
            edtk.relax(asked, "D", prove=given)


def test_an_interrupted_proof_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C leaves the plan with the best bound so far, a line about it, and exit code 130."""

    def interrupted(*given: Any, **named: Any) -> None:
        covering = cover(*given, **named)
        (leaves,) = covering.leaves
        higher = replace(leaves, bound=1.5 * leaves.bound)
        raise CoveringInterrupted(replace(covering, leaves=(higher,)))

    monkeypatch.setattr(prove_continuum, "cover", interrupted)
    result = _planned(tmp_path, "--prove-bound")
    assert result.exit_code == 130, result.output
    assert "interrupted; the plan is whole" in result.stderr
    bounds = json.loads(result.stdout)["bounds"]
    # D has degree one, so that a sensitivity that is so much larger proves so much less.
    assert bounds["continuum"] == pytest.approx(1.5 * bounds["searched"], rel=1e-2)


def test_a_budget_ends_the_proof_too(tmp_path: Path) -> None:
    """Seconds are for the search and for the proof of its bound together."""
    result = _planned(tmp_path, "--prove-bound", "--budget", "1e-3")
    assert result.exit_code == 0, result.output
    assert "the budget ended the proof" in result.stderr


@pytest.mark.usefixtures("sharp_bounds")
def test_what_no_pose_can_exceed_needs_no_box(tmp_path: Path) -> None:
    """Where the best condition number is one, the check of O2 holds as its multiplier proves it."""
    path = tmp_path / "certificate.json"
    found = edtk.relax(Study(**THREE), "O2", prove=1e-2, certificate=path)
    assert found.value == pytest.approx(1.0, abs=1e-8)
    checked = edtk.verify(path, Study(**THREE))
    assert checked.valid, checked.claims


def test_too_few_candidates_of_a_proof() -> None:
    """One pose does not tell a geometry: a line says so."""
    with short_search(), pytest.raises(UserError, match="cannot identify all parameters"):
        edtk.plan(ARM, size=6, seed=1, workers=1, prove=1, candidates=1)


def test_too_many_candidates_of_a_proof() -> None:
    """What memory cannot hold is refused before the search."""
    with pytest.raises(UserError, match="at most, as a proof holds all in 1000 MB"):
        edtk.plan(Study(**THREE), 3, "D", prove=1, candidates=10**12)


def test_bounds_have_one_name_each() -> None:
    """Plans and weights, of studies, regions and problems, name bounds by what they are on."""
    study = Study(**THREE)
    with short_search():
        plan = edtk.plan(study, 3, "D", seed=1, workers=1, prove_bound=1e-2, prove=5, candidates=50)
    relaxed = edtk.relax(study, "D", prove=1e-2)
    region = edtk.Region(lambda x: np.concatenate([np.ones_like(x), x], axis=1), -1, 1, degree=1)
    problem = edtk.Problem(np.vander(np.linspace(-1, 1, 5), 2)[:, None, :])
    weights = {"candidates", "searched", "continuum"}
    assert set(plan.bounds) == set(plan.to_dict()["bounds"]) == weights | {"whole_plans"}
    assert set(relaxed.bounds) == set(relaxed.to_dict()["bounds"]) == weights
    assert set(edtk.relax(region, "D", prove=1e-3).bounds) == weights
    assert set(edtk.plan(region, 4, "D", prove_bound=1e-3, starts=1).bounds) == weights
    assert set(edtk.relax(problem, "D").bounds) == {"candidates"}
    assert set(edtk.plan(problem, 4, "D", prove=5).bounds) == {"candidates", "whole_plans"}
    assert plan.bounds["continuum"] == plan.told_bound
    assert relaxed.bounds["continuum"].value == relaxed.to_dict()["bound_proved"]


def _planned(tmp_path: Path, *options: str) -> Result:
    """What `edtk plan` answers about the arm of three joints."""
    path = tmp_path / "study.toml"
    lines = [f"{key} = {value}" for key, value in _flat(THREE).items()]
    path.write_text("\n".join(lines), encoding="utf-8")
    arguments = ["plan", str(path), "--size", "3", "--criterion", "D", "--workers", "1", "--json"]
    with short_search():
        return CliRunner().invoke(main, [*arguments, *options])


def test_the_command_tells_of_the_proof(tmp_path: Path) -> None:
    """`edtk plan --prove-bound --json` says that the bound is proved."""
    result = _planned(tmp_path, "--prove-bound")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["bound_proved"] is True


def _flat(tables: dict[str, object]) -> dict[str, str]:
    """Keys of TOML with dots, and values as JSON, but for tables in lists."""
    found: dict[str, str] = {}
    for key, value in tables.items():
        if isinstance(value, dict):
            found |= {f"{key}.{name}": one for name, one in _flat(value).items()}
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            inner = (", ".join(f"{k} = {v}" for k, v in _flat(one).items()) for one in value)
            found[key] = "[" + ", ".join(f"{{ {one} }}" for one in inner) + "]"
        else:
            found[key] = json.dumps(value)
    return found
