"""The sheet to fill in."""

from pathlib import Path

import numpy as np
import pytest

from edtk.calibration.template import require_empty
from edtk.design.plan import Plan
from edtk.study.study import load_study
from edtk.system.errors import UserError
from edtk.verbs.template import template

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")
PLAN = STUDY.published_plans()["table_4_6"]


def test_a_row_per_repetition_in_an_order_of_little_travel():
    """Every pose comes as often as planned, and the joints travel less than in the plan."""
    plan = Plan(PLAN.q, PLAN.wrench, np.array([1, 2, 3, 1, 2, 3]))
    table = template(STUDY, plan)
    assert len(table) == plan.experiments
    q = np.deg2rad(table.iloc[:, :6].to_numpy())
    change = np.flatnonzero(np.diff(q, axis=0).any(axis=1))
    assert len(change) == 5
    counted = {
        tuple(pose.round(9)): (np.abs(q - pose).max(axis=1) < 1e-12).sum() for pose in plan.q
    }
    assert list(counted.values()) == plan.repeats.tolist()
    span = np.ptp(STUDY.robot.limits, axis=0)
    travel = [np.linalg.norm(np.diff(x, axis=0) / span, axis=1).sum() for x in (q, plan.q)]
    assert travel[0] <= travel[1]


def test_columns():
    """Poses and wrenches are filled in, displacements or positions are empty."""
    wrench = ["Fx_N", "Fy_N", "Fz_N", "Tx_Nm", "Ty_Nm", "Tz_Nm"]
    table = template(STUDY, PLAN)
    assert list(table) == [f"q{i}_deg" for i in range(1, 7)] + wrench + ["dx_mm", "dy_mm", "dz_mm"]
    assert table.iloc[:, -3:].isna().all(axis=None)
    assert not table.iloc[:, :-3].isna().any(axis=None)
    assert list(template(STUDY, PLAN, positions=True))[12:] == [
        "x0_mm",
        "y0_mm",
        "z0_mm",
        "x_mm",
        "y_mm",
        "z_mm",
    ]


def test_markers(tmp_path):
    """With three markers each repetition has three rows, and columns for their places."""
    one = template(STUDY, PLAN.repeated(2))
    three = template(STUDY, PLAN.repeated(2), markers=3)
    assert len(three) == 3 * len(one)
    np.testing.assert_array_equal(three.iloc[::3, :12], one.iloc[:, :12])
    assert three[["marker_x_mm", "marker_y_mm", "marker_z_mm", "dx_mm"]].isna().all(axis=None)
    path = tmp_path / "sheet.csv"
    three.to_csv(path, index=False)
    require_empty(path)
    three.assign(marker_x_mm=5.0).to_csv(path, index=False)
    with pytest.raises(UserError, match="has measurements in it"):
        require_empty(path)
