"""What a sheet tells of a doubt counts, where the study doubts more."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from small_arm import ROBOT

import edtk
from edtk.calibration.propagation import _as_told
from edtk.calibration.spring_calibration import SpringCalibration

POSES = 16
MASS = {"mass_kg": 8, "center_m": [0.02, 0, 0.05]}
TOOL = {"position_mm": [90, 20, 100]}
FORCE = [300.0, -200.0, -800.0]
K = np.array([4e-6, 8e-6, 3e-5])
SIGMA = 0.02
COLUMNS = [f"q{i}_deg" for i in range(1, 7)]


def identified(path: Path, seed: int, tool_mm: float, lever_mm: float = 0.0) -> SpringCalibration:
    """What is found of a sound day, whose positions are counted from the rigid robot."""
    study = edtk.Study(
        robot=ROBOT | {"joints": [{**one, **MASS} for one in ROBOT["joints"]]},
        tool=TOOL,
        load={"F_N": FORCE},
        joints={"unknown": ["q2", "q3", "q5"]},
        measurement={"sigma_mm": SIGMA, "reference": "nominal"},
        uncertainty={"tool_mm": tool_mm},
        test_pose={
            "q_deg": [10, -60, 50, 20, 40, 0],
            "tool": TOOL,
            "load": {"F_N": FORCE},
            **({"lever_mm": lever_mm} if lever_mm else {}),
        },
    )
    rng = np.random.default_rng(seed)
    q = np.deg2rad(np.round(rng.uniform(-100, 100, (POSES, 6)), 3))
    A = study.model.regressor(q, np.tile([*FORCE, 0.0, 0.0, 0.0], (POSES, 1)))
    seen = 1e3 * A @ K + rng.normal(0, SIGMA, (POSES, 3))
    sheet = pd.DataFrame(
        np.hstack([np.rad2deg(q), seen]), columns=[*COLUMNS, "dx_mm", "dy_mm", "dz_mm"]
    )
    sheet.to_csv(path / "day.csv", index=False)
    found = edtk.identify(study, path / "day.csv")
    assert isinstance(found, SpringCalibration)
    return found


@pytest.mark.parametrize("seed", range(2))
def test_a_tool_that_the_sheet_tells_is_doubted_no_more(seed: int, tmp_path: Path) -> None:
    """Residuals of 0.02 mm rule out a tool that is 1 mm off, and one that is 10 mm off alike."""
    few, many = (identified(tmp_path, seed, tool_mm) for tool_mm in (1.0, 10.0))
    assert few.verdict == many.verdict == "good"
    assert few.budget is not None
    assert many.budget is not None
    assert 1e3 * few.budget.tool < SIGMA
    assert many.budget.tool == pytest.approx(few.budget.tool, rel=0.01)


def test_commands_promise_what_the_budget_does(tmp_path: Path) -> None:
    """Both count what the sheet leaves, once: they differ by what is nonlinear."""
    found = identified(tmp_path, 0, 1.0)
    expected = edtk.compensate(found.study, found)
    assert found.budget is not None
    assert expected.remaining[0] == pytest.approx(found.budget.total, rel=0.01)


def test_rotations_count_what_the_sheet_leaves_as_positions_do(tmp_path: Path) -> None:
    """A doubt of the tool that residuals rule out turns nothing; and both are what is expected."""
    each = [identified(tmp_path, 0, tool_mm, 500.0) for tool_mm in (1.0, 10.0)]
    few, many = (edtk.compensate(one.study, one) for one in each)
    assert few.rotation is not None
    assert many.rotation is not None
    assert many.rotation[0] == pytest.approx(few.rotation[0], rel=0.02)
    assert each[0].budget is not None
    both = np.hypot(few.remaining[0], 0.5 * few.rotation[0])
    assert both == pytest.approx(each[0].budget.total, rel=0.02)


def test_a_doubt_that_no_sheet_tells_stays_as_stated() -> None:
    """Where the sheet leaves more than doubts and noise make, all parts stay; the rest is model."""
    parts = {"noise": 3.0, "load": 5.0, "tool": 2.0, "drift": 1.0, "repeatability": 2.0}
    parts |= {"rigid_joints": 0.0, "known_joints": 1.0}
    untold = 16.0 + 4.0 + 1.0  # of the load's size, of repeatability and of known joints
    found = parts | _as_told(parts, 9.0 + 9.0 + 4.0 + 1.0 + 36.0, untold)
    assert found == pytest.approx(parts | {"model": 6.0})
    less = parts | _as_told(parts, 9.0 + 3.5, untold)
    assert less["tool"] == pytest.approx(2.0 * 0.5)
    assert less["load"] == pytest.approx(np.hypot(4.0, 3.0 * 0.5))
    assert less["model"] == 0.0
    assert sum(part**2 for part in less.values()) == pytest.approx(12.5 + untold)
    least = parts | _as_told(parts, 4.0, untold)
    assert sum(part**2 for part in least.values()) == pytest.approx(4.0 + untold)
