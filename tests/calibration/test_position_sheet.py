"""The empty sheet of a plan of visits: loads in turn, and `edtk identify` reads it filled in."""

from pathlib import Path

import numpy as np
import pytest
from loaded_arm import LOAD, STUDY

import edtk
from edtk.measure.equilibrium import resting_load
from edtk.study.study_geometry import StudyGeometry
from edtk.system.errors import ArgumentError
from edtk.verbs.template import template

RNG = np.random.default_rng(2)
Q = RNG.uniform(-1.5, 1.5, (8, 2))
WRENCH = np.array(LOAD, dtype=float) * np.tile([1, 0], 4)[:, None]
PLAN = edtk.Plan(Q, WRENCH, np.array([1, 2, 1, 1, 1, 1, 2, 1]))
MARKERS = [
    {"name": "A", "position_mm": [0, 20, 0]},
    {"name": "floor", "joint": "base", "position_mm": [0, 0, 0]},
]


def test_all_poses_of_a_load_are_visited_together() -> None:
    """Unloaded visits come first, repeats one after another, a row a marker."""
    sheet = template(STUDY.replace(marker=MARKERS), PLAN)
    assert len(sheet) == 2 * PLAN.experiments
    assert sheet["marker"].tolist() == ["A", "floor"] * PLAN.experiments
    assert sheet["visit"].tolist() == np.repeat(np.arange(1, 11), 2).tolist()
    loaded = sheet["Fz_N"].to_numpy() != 0
    assert (np.diff(loaded.astype(int)) == 1).sum() == 1
    assert not loaded[0]
    poses = sheet[["q1_deg", "q2_deg", "Fz_N"]].value_counts()
    assert sorted(poses) == [2] * 6 + [4] * 2


def test_load_changes_that_a_study_asks_for() -> None:
    """Three changes divide the visits of each load in two, and none is lost."""
    asked = STUDY.replace(costs={"load_changes": 3})
    sheet = template(asked, PLAN)
    loaded = (sheet["Fz_N"].to_numpy() != 0).astype(int)
    assert np.abs(np.diff(loaded)).sum() == 3
    assert len(sheet) == PLAN.experiments


def test_identify_reads_the_sheet(tmp_path: Path) -> None:
    """Filled in with simulated positions, it gives the errors that were simulated."""
    study = STUDY.replace(marker=MARKERS[:1])
    path = tmp_path / "sheet.csv"
    sheet = edtk.template(study, PLAN, out=path)
    q = np.deg2rad(sheet[["q1_deg", "q2_deg"]].to_numpy())
    wrench = sheet[["Fx_N", "Fy_N", "Fz_N", "Tx_Nm", "Ty_Nm", "Tz_Nm"]].to_numpy(dtype=float)
    setting = StudyGeometry.of(study)
    model = setting.model
    theta = np.array([0.3, -0.2, 0.1, 2.0, 40.0, 30.0, 1.0][: model.p]) * model.scales
    torque = resting_load(model.bending(theta), q, wrench, setting.loads)
    x = 1e3 * model.see(theta, q, torque).points[:, 0]
    sheet[["x_mm", "y_mm", "z_mm"]] = x + RNG.normal(0, 1e-3, x.shape)
    sheet.to_csv(path, index=False)
    found = edtk.identify(study, path)
    assert found.rank == 6
    assert found.fit.rms < 2e-6


@pytest.mark.parametrize("option", [{"markers": 2}, {"positions": True}])
def test_options_of_other_sheets_are_refused(option: dict[str, int]) -> None:
    """The study says which markers there are, and a sheet of geometry has positions anyway."""
    with pytest.raises(ArgumentError, match="leave this out"):
        edtk.template(STUDY, PLAN, **option)
