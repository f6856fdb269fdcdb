"""How far apart two poses are the same."""

from pathlib import Path

import numpy as np
import pytest

from edtk.design.plan import Plan
from edtk.findings.match_plan import match_plan, pose_resolution
from edtk.fit.measurements import Measurements
from edtk.study.study import load_study

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")
STUDY = STUDY.replace(
    workspace=STUDY.specification.workspace.model_dump(exclude_none=True, exclude_defaults=True)
    | {"plan_resolution_deg": 0.0}
)
POSES = np.array([[0, -93.512, 124.987, -118.66, -62.449, 168.951]] * 3)
POSES[1:] += np.array([[1.234], [-2.345]]) * [0, 1, 1, 1, 1, 1]


def sheet(values):
    """Measurements at poses (m, 6) in degrees."""
    m = len(values)
    wrench = np.tile([0.0, 0, -2500, 0, 0, 0], (m, 1))
    zeros = np.zeros((m, 3))
    return Measurements(np.deg2rad(values), wrench, zeros, zeros + 1e-5, zeros)


@pytest.mark.parametrize("digits", [0, 1, 2, 3])
def test_the_digits_of_the_sheet(digits):
    """Poses that were typed with fewer digits than planned are those of the plan."""
    data = sheet(np.round(POSES, digits))
    assert pose_resolution(STUDY, data) == pytest.approx(10.0**-digits)
    plan = Plan(np.deg2rad(POSES), data.wrench, np.ones(3, dtype=int))
    match = match_plan(STUDY, data, plan)
    assert match.distance.max() <= match.within
    assert not len(match.missing)


def test_the_least_and_the_study():
    """More digits than a controller takes mean nothing; the study may allow more."""
    assert pose_resolution(STUDY, sheet(POSES + 1e-5 / 3)) == pytest.approx(1e-3)
    assert pose_resolution(STUDY) == pytest.approx(1e-3)
    keys = STUDY.specification.workspace.model_dump(exclude_none=True, exclude_defaults=True)
    coarse = STUDY.replace(workspace=keys | {"plan_resolution_deg": 0.5})
    assert pose_resolution(coarse, sheet(POSES)) == pytest.approx(0.5)
