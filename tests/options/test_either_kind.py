"""Options of sheets and plans that a study of one kind had before the other."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from kr270 import REQUIRED, TEST_POSE
from loaded_arm import STUDY as ARM

import edtk
from edtk.calibration.calibrate import InputError
from edtk.fit.least_squares import estimate
from edtk.measure.noise import joint_distance
from edtk.study.study import Study
from edtk.system.errors import UserError

K = np.array([3e-7, 4e-7, 2.8e-6, 2.8e-6, 2.1e-6])
MOVED = ["dx_mm", "dy_mm", "dz_mm"]


@pytest.fixture
def springs() -> tuple[Study, pd.DataFrame]:
    """A study of springs, and a sheet of eight random poses."""
    study = Study(**REQUIRED | {"test_pose": TEST_POSE})
    rng = np.random.default_rng(4)
    q = study.space.draw(rng.random((8, 6)))[:, :6]
    plan = edtk.Plan(q, np.tile(study.space.load.always, (8, 1)), np.ones(8, dtype=int))
    sheet = edtk.template(study, plan)
    rows = study.model.regressor(np.deg2rad(sheet.iloc[:, :6].to_numpy()), plan.wrench) @ K
    sheet[MOVED] = 1e3 * (rows + rng.normal(0, 3e-5, rows.shape))
    return study, sheet


@pytest.mark.cell("`identify --as-is`", "springs")
def test_a_misread_sheet_is_an_alarm_as_it_is(springs: tuple[Study, pd.DataFrame]) -> None:
    """Exchanged columns are refused; taken as they are, they are an alarm beside the result."""
    study, sheet = springs
    sheet[["dx_mm", "dz_mm"]] = sheet[["dz_mm", "dx_mm"]].to_numpy()
    with pytest.raises(InputError, match=r"columns dx_mm and dz_mm .* look swapped"):
        edtk.identify(study, sheet)
    found = edtk.identify(study, sheet, as_is=True)
    assert found.verdict == "bad"
    assert any("look swapped" in one.words for one in found.findings)


@pytest.mark.cell("`identify --linear`", "springs")
def test_the_linear_model_is_least_squares(springs: tuple[Study, pd.DataFrame]) -> None:
    """Eq. (6) and (9) on the rows of the sheet, whatever the equilibrium would add."""
    study, sheet = springs
    found = edtk.identify(study, sheet, linear=True)
    q = np.deg2rad(sheet.iloc[:, :6].to_numpy())
    A = study.model.regressor(q, np.tile(study.space.load.always, (8, 1)))
    expected = estimate(A, sheet[MOVED].to_numpy() / 1e3, study.sigma, study.model.parameters)
    assert found.fit.k == pytest.approx(expected.k, rel=1e-9)


@pytest.mark.cell("`identify --linear`", "parameters")
def test_no_linear_model_of_positions(tmp_path: Path) -> None:
    """The option is refused with the reason that the page of options has."""
    plan = edtk.Plan(np.zeros((1, ARM.robot.n)), np.zeros((1, 6)), np.ones(1, dtype=int))
    with pytest.raises(UserError, match="errors of geometry beyond the first order"):
        edtk.identify(ARM, edtk.template(ARM, plan), linear=True)


@pytest.mark.cell("positions and displacements in one sheet", "springs")
def test_a_position_alone_is_no_displacement(springs: tuple[Study, pd.DataFrame]) -> None:
    """A row without its unloaded position is refused, with its row and column."""
    study, sheet = springs
    q = np.deg2rad(sheet.iloc[:, :6].to_numpy())
    at = 1e3 * study.robot.forward(q)[:, :3, 3]
    sheet = sheet.drop(columns=MOVED)
    sheet[["x0_mm", "y0_mm", "z0_mm"]] = at
    sheet[["x_mm", "y_mm", "z_mm"]] = at + 1.0
    sheet.loc[3, ["x0_mm", "y0_mm", "z0_mm"]] = np.nan
    with pytest.raises(UserError, match="row 4, column x0_mm"):
        edtk.identify(study, sheet)


@pytest.mark.cell("`plan --exclude`", "parameters")
def test_visits_keep_away_from_excluded_poses(tmp_path: Path) -> None:
    """No visit is near one of the first plan, and none beats the bound of all poses."""
    path = tmp_path / "excluded.csv"
    first = edtk.plan(ARM, size=6, seed=1, workers=1, out=path)
    found = edtk.plan(ARM, size=6, seed=1, workers=1, exclude=path)
    slides = np.zeros(ARM.robot.n, dtype=bool)
    away = [joint_distance(q, first.plan.q, slides).min() for q in found.plan.q]
    assert np.rad2deg(min(away)) >= 5 - 1e-3
    assert found.value >= first.bound * (1 - 1e-6)
