"""Plans that serve a test pose alone are named, and others are not."""

from dataclasses import replace

import numpy as np
import pytest
from loaded_arm import LOAD, STUDY

import edtk
from edtk.calibration.evaluate_geometry import GeometryDesigns
from edtk.measure.expected_error import ExpectedError
from edtk.study import plausibility
from edtk.study.plausibility import poor_around

HERE = ExpectedError(test_pose=1e-4, mean=3.1e-4, largest=5e-4, within=np.deg2rad(30), lever=0.0)


def plan_about(size_deg: float) -> edtk.Plan:
    """Ten visits, half of them loaded, around the test pose."""
    rng = np.random.default_rng(0)
    q = np.deg2rad([10, -60]) + np.deg2rad(size_deg) * rng.uniform(-1, 1, (10, 2))
    wrench = np.array(LOAD) * (np.arange(10) % 2)[:, None]
    return edtk.Plan(q, wrench, np.ones(10, dtype=int))


def test_both_errors_are_said() -> None:
    """In one sentence with what helps, from three times the error on; of several poses, too."""
    (said,) = map(str, poor_around(HERE))
    assert said.startswith("errors are 3.1 times as large around the test pose as there: 0.31 mm")
    assert "within 30 deg on average, 0.1 mm in it; give more test poses" in said
    (said,) = map(str, poor_around(replace(HERE, poses=4)))
    assert "around the 4 test poses as there" in said
    assert poor_around(replace(HERE, mean=2.9e-4)) == ()
    assert poor_around(replace(HERE, test_pose=0.0)) == ()


def test_visits_near_the_test_pose_serve_it_alone() -> None:
    """Of two plans, the one around the test pose is named, with the numbers of the report."""
    designs = GeometryDesigns.of(STUDY)
    near = plan_about(3)
    told = designs.expected(near)
    assert told is not None
    assert told.mean > 3 * told.test_pose
    assert edtk.evaluate(STUDY, near).warnings == poor_around(told)
    assert designs.warnings(near, told) == poor_around(told)
    assert f"{1e3 * told.mean:.2g} mm" in poor_around(told)[0].words
    assert edtk.evaluate(STUDY, plan_about(60)).warnings == ()


def test_plans_for_all_parameters_are_not_blamed() -> None:
    """A study that is about D asked for no accuracy in the test pose."""
    study = STUDY.replace(optimise=["D"])
    designs = GeometryDesigns.of(study)
    assert designs.warnings(plan_about(3), designs.expected(plan_about(3))) == ()


@pytest.mark.parametrize("criterion", ["rho0", "D"])
def test_the_plan_says_so(criterion: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A plan for the test pose carries the sentence, where its numbers ask for it."""
    monkeypatch.setattr(
        plausibility, "PLAUSIBLE", replace(plausibility.PLAUSIBLE, poor_around=0.01)
    )
    found = edtk.plan(STUDY.replace(candidates=100), 6, criterion, budget=0.2)
    assert len([one for one in found.warnings if "around the test pose" in one.words]) == (
        criterion == "rho0"
    )
