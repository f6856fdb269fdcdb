"""Plans beside sheets, causes and detection answer for springs and for geometry alike."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from geometry_sheets import NAMES, OFFSETS, PLACE, STUDY, run

import edtk
from edtk.study.study_geometry import StudyGeometry

LOADED = STUDY.replace(
    parameters={"compliance": ["q2", "q3"], "geometry": "all"}, load={"F_N": [0, 0, -50]}
)
K = np.array([0, 3e-6, 4e-6, 0, 0, 0])


def planned(count: int, loaded: int) -> edtk.Plan:
    """Poses of which the last are under a load."""
    rng = np.random.default_rng(3)
    q = np.deg2rad(np.round(rng.uniform(-100, 100, (count, 6)), 3))
    wrench = np.zeros((count, 6))
    wrench[count - loaded :, 2] = -50.0
    return edtk.Plan(q, wrench, np.ones(count, dtype=int))


def measured(plan: edtk.Plan) -> pd.DataFrame:
    """The sheet of a plan, as `edtk.template` makes it, filled in by an erring arm."""
    setting = StudyGeometry.of(LOADED)
    model = replace(setting.model, offsets=OFFSETS, start=PLACE)
    rng = np.random.default_rng(5)
    theta = rng.normal(0, 0.5, model.p) * model.scales
    sheet = edtk.template(LOADED, plan)
    q = np.deg2rad(sheet[NAMES].to_numpy())
    wrench = np.zeros((len(q), 6))
    wrench[:, 2] = sheet["Fz_N"]
    bent = q + K * setting.loads(q, wrench)
    x = model.see(theta, bent, derivatives=False).points
    marker = sheet["marker"].map("ABC".index).to_numpy()
    seen = x[np.arange(len(sheet)), marker] + rng.normal(0, 2e-5, (len(sheet), 3))
    return sheet.assign(**{f"{a}_mm": 1e3 * seen[:, i] for i, a in enumerate("xyz")})


def test_a_sheet_of_geometry_is_compared_with_its_plan(tmp_path: Path) -> None:
    """A day as planned has no finding of it; a visit left out is named by its row of the plan."""
    plan = planned(30, 10)
    sheet = measured(plan)
    kinds = {"not_measured", "other_pose", "other_load", "force_unit"}
    whole = edtk.identify(LOADED, sheet, plan=plan)
    assert not kinds & {one.kind for one in whole.findings}
    q = np.deg2rad(sheet[NAMES].to_numpy())
    gone = np.abs(q - plan.q[7]).max(axis=1) < 1e-6
    assert gone.sum() == 3  # a row for each marker
    said = edtk.identify(LOADED, sheet[~gone], plan=plan).findings
    assert [one.rows for one in said if one.kind in kinds] == [(7,)]
    assert any(one.words == "row 8 of the plan: not measured" for one in said)


def test_a_visit_that_is_not_planned_is_refused_or_named(tmp_path: Path) -> None:
    """Another pose is an error with its row and column; with --as-is it is an alarm."""
    plan = planned(30, 10)
    sheet = measured(plan)
    q = sheet[NAMES].to_numpy()
    place = np.flatnonzero(np.abs(np.deg2rad(q) - plan.q[4]).max(axis=1) < 1e-6)
    sheet.loc[place, "q3_deg"] += 0.05
    LOADED.to_toml(tmp_path / "study.toml")
    plan.to_frame(LOADED.robot).to_csv(tmp_path / "plan.csv", index=False)
    sheet.to_csv(tmp_path / "day.csv", index=False)
    words = ["identify", tmp_path / "study.toml", tmp_path / "day.csv"]
    code, out, error = run(*words, "--plan", tmp_path / "plan.csv")
    assert (code, out) == (2, "")
    assert f"row {place[0] + 1}, column q3_deg: the pose is not in the plan" in error
    assert "row 5, is 0.05 deg away" in error
    assert "2 more rows are not either" in error
    found = edtk.identify(LOADED, sheet, plan=plan, as_is=True)
    (other,) = (one for one in found.findings if one.kind == "other_pose")
    assert found.verdict == "bad"
    assert other.rows == (int(place[0]),)


def test_a_load_that_is_not_the_planned_one_is_named() -> None:
    """Of visits in the right pose, those whose load was left away are named by their rows."""
    plan = planned(30, 10)
    sheet = measured(plan)
    loaded = np.flatnonzero(sheet["Fz_N"].to_numpy() < 0)[:3]
    sheet.loc[loaded, "Fz_N"] = 0.0
    said = edtk.identify(LOADED, sheet, plan=plan).findings
    assert [one.rows for one in said if one.kind == "other_load"] == [tuple(loaded.tolist())]


def test_kilonewtons_beside_a_plan_are_told(tmp_path: Path) -> None:
    """Forces in another unit are told from those of the plan."""
    plan = planned(30, 10)
    sheet = measured(plan)
    sheet["Fz_N"] = sheet["Fz_N"] / 1e3
    (unit,) = (
        one for one in edtk.identify(LOADED, sheet, plan=plan).findings if one.kind == "force_unit"
    )
    assert unit.words == (
        "columns Fx_N to Fz_N: the forces are 0.001 times those of the plan: are they in "
        "kilonewtons? expected newtons"
    )
    assert pytest.approx(0.001) == unit.data["ratio"]
