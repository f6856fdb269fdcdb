"""Sheets of markers, distances and poses, loads anywhere and links with weight, identified."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from edtk.calibration.calibrate import calibrate
from edtk.calibration.calibrated_springs import CalibratedSprings
from edtk.calibration.compensate import compensate
from edtk.calibration.planned import planned_measurements
from edtk.design.plan import Plan
from edtk.findings.fitted_data import HowFitted
from edtk.fit.correlated_noise import whiten_columns
from edtk.fit.posterior import SamplingOptions
from edtk.fit.run_chain import Demand
from edtk.measure.compliances import Compliances
from edtk.measure.pose_table import TURN_COLUMN
from edtk.report.calibration_report import calibration_report
from edtk.report.views.calibration import spring_calibration_text
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.robot_file import robot_to_dict
from edtk.robots.rotations import transform
from edtk.study.study import Study
from edtk.system.errors import Note, UserError
from edtk.verbs.template import template

G = 9.80665
K = np.array([0.2, 0.3, 0.4, 2.8, 2.9, 2.1]) * 1e-6
MASSES = np.array([400.0, 300.0, 220.0, 90.0, 60.0, 30.0])
CENTERS = np.array([[0.1, 0.02 * i, -0.05 + 0.03 * i] for i in range(6)])


def robot_with_links():
    content = robot_to_dict(load_robot("kuka_kr270"))
    for joint, mass, center in zip(content["joints"], MASSES, CENTERS, strict=True):
        joint |= {"mass_kg": mass, "center_m": center.tolist()}
    return content


PLAIN = {
    "robot": "kuka_kr270",
    "tool": {"position_mm": [611.5, 0, -460]},
    "load": {"F_N": [300, -200, -2500]},
    "measurement": {"sigma_mm": 0.03, "sigma_deg": 0.002},
    "joints": {"unknown": ["q1", "q2", "q3", "q4", "q5", "q6"]},
}
MARKERS = [
    {"position_mm": [0, 100, 50]},
    {"name": "side", "position_mm": [50, -100, 50]},
    {"name": "forearm", "joint": "q4", "position_mm": [-300, 50, 100]},
]
PAYLOAD = {"mass_kg": 250.0, "center_mm": [300.0, 40.0, -200.0]}
WIRE = {"anchor_mm": [1000, 500, 4000], "marker": "side", "sigma_mm": 0.01}
POSE = {"rows": "pose"}
NOISE = {
    "tracker_position_mm": [4000, -3000, 1200],
    "along": [10, 5],
    "across": [15, 6],
    "repeatability_deg": 0.001,
    "discrepancy_mm": 0.02,
}
VERTICAL = {"unknown": ["q2", "q3", "q4", "q5", "q6"]}  # no weight turns joint 1
CASES = {
    "markers": {"marker": MARKERS},
    "payload": {"load": None, "payload": PAYLOAD, "marker": MARKERS[:2], "joints": VERTICAL},
    "load and payload": {
        "load": {"F_N": [300, -200, -1000], "at_mm": [0, 50, 100]},
        "payload": PAYLOAD,
    },
    "poses": {"marker": [one | {"rows": "pose"} for one in MARKERS]},
    "distances": {
        "distance": [
            {"anchor_mm": [3000, 0, 0]},
            {"anchor_mm": [0, 3000, 500], "position_mm": [0, 100, 50]},
            {"anchor_mm": [1000, 500, 4000], "name": "wire"},
        ]
    },
    "markers and distances": {"marker": MARKERS, "distance": [WIRE]},
    "poses and positions": {"marker": [MARKERS[0] | POSE, *MARKERS[1:]]},
    "poses, positions and distances": {
        "marker": [MARKERS[0], MARKERS[1] | POSE, MARKERS[2]],
        "distance": [WIRE],
    },
    "a mix with visits": {
        "marker": [MARKERS[0] | POSE, *MARKERS[1:]],
        "distance": [WIRE],
        "noise": NOISE,
    },
    "markers and distances with visits": {"marker": MARKERS, "distance": [WIRE], "noise": NOISE},
    "differences with links": {"robot": robot_with_links(), "marker": MARKERS},
    "links alone": {
        "robot": robot_with_links(),
        "load": {"F_N": [0, 0, 0]},
        "measurement": {"sigma_mm": 0.03, "reference": "nominal"},
        "marker": MARKERS,
        "joints": VERTICAL,
    },
    "absolute": {
        "robot": robot_with_links(),
        "load": None,
        "payload": PAYLOAD,
        "measurement": {"sigma_mm": 0.03, "reference": "nominal"},
        "marker": MARKERS,
        "joints": VERTICAL,
    },
    "an absolute mix": {
        "robot": robot_with_links(),
        "load": None,
        "payload": PAYLOAD,
        "measurement": {"sigma_mm": 0.03, "sigma_deg": 0.002, "reference": "nominal"},
        "marker": [MARKERS[0] | POSE, MARKERS[1]],
        "joints": VERTICAL,
    },
}


class Bench:
    """An independent robot at rest: energies by products of transforms, slopes by differences."""

    def __init__(self, study):
        given = study.specification
        tool = np.array(given.tool.position_mm) / 1e3
        self.robot = load_robot("kuka_kr270").with_tool(transform(tool))
        self.payload = given.payload
        self.load = given.load
        self.links = bool(study.robot.links)
        self.absolute = given.measurement.reference == "nominal"
        self.k = K * np.isin(study.robot.joint_names, given.joints.unknown)

    def body(self, q, joint):
        """Transforms of the body of a joint; None for the tool."""
        if joint is None:
            return self.robot.forward(q)
        part = Robot("part", self.robot.joints[: joint + 1], self.robot.base)
        return part.forward(q[..., : joint + 1])

    def at(self, q, joint, offset_mm):
        """A point of a body in the world."""
        return (self.body(q, joint) @ np.append(np.array(offset_mm) / 1e3, 1))[..., :3]

    def energy(self, q, wrench, loaded):
        """Potential energies (...) of loads and weights in poses (..., 6)."""
        total = np.zeros(q.shape[:-1])
        for j in range(6 if self.links else 0):
            total += G * MASSES[j] * self.at(q, j, 1e3 * CENTERS[j])[..., 2]
        if loaded and self.payload is not None:
            weight = G * self.payload.mass_kg
            total += weight * self.at(q, 5, self.payload.center_mm)[..., 2]
        if loaded and self.load is not None:
            total -= self.at(q, None, self.load.at_mm) @ wrench[:3]
        return total

    def rest(self, q, wrench, loaded):
        """``theta = k tau(q + theta)`` by repetition, with tau from differences of the energy."""
        if not loaded and (self.absolute or not self.links):
            return q
        theta = np.zeros(6)
        step = 1e-3
        shifts = step * np.array([2.0, 1.0, -1.0, -2.0])[:, None, None] * np.eye(6)
        for _ in range(6):
            ends = self.energy(q + theta + shifts, wrench, loaded)
            theta = self.k * (np.array([1.0, -8.0, 8.0, -1.0]) @ ends) / (12 * step)
        return q + theta

    def rows(self, ends, sensor, joint):
        """Cells of one row of a sheet."""
        start, end = ends
        offset = np.array(sensor.get("position_mm", [0, 0, 0]))
        before = self.body(start, joint)
        after = self.body(end, joint)
        first = self.at(start, joint, offset)
        moved = self.at(end, joint, offset) - first
        if "anchor_mm" in sensor:
            if sensor.get("marker") == "side":
                offset = np.array(MARKERS[1]["position_mm"])
                first = self.at(start, None, offset)
                moved = self.at(end, None, offset) - first
            anchor = np.array(sensor["anchor_mm"]) / 1e3
            change = np.linalg.norm(first + moved - anchor) - np.linalg.norm(first - anchor)
            return {"change_mm": 1e3 * change}
        turn = Rotation.from_matrix(after[:3, :3] @ before[:3, :3].T).as_rotvec()
        if sensor.get("axis", 0) > 2:
            return {TURN_COLUMN: np.rad2deg(turn[sensor["axis"] - 3])}
        if "axis" in sensor:
            place = self.absolute * first + moved
            name = "after_mm" if self.absolute else "change_mm"
            return {name: 1e3 * place[sensor["axis"]]}
        if self.absolute:
            return dict(zip(["x_mm", "y_mm", "z_mm"], 1e3 * (first + moved), strict=True))
        cells = dict(zip(["dx_mm", "dy_mm", "dz_mm"], 1e3 * moved, strict=True))
        if sensor.get("rows") == "pose":
            cells |= dict(zip(["drx_deg", "dry_deg", "drz_deg"], np.rad2deg(turn), strict=True))
        return cells


def filled(keys, study, poses=6):
    """The template of a random plan, filled in by the bench."""
    rng = np.random.default_rng(1)
    x = study.space.draw(rng.random((poses, len(study.space.drawn))))
    once = np.ones(poses, dtype=int)
    plan = Plan(x[:, :6].round(3), study.space.plan(x, once).wrench, once)
    sheet = template(study, plan, positions=study.is_absolute)
    bench = Bench(study)
    sensors = keys.get("marker", []) + keys.get("distance", []) or [{}]
    if len({("anchor_mm" in one, one.get("rows")) for one in sensors}) > 1:  # a mix
        rows_of = {None: 3, "pose": 6}
        sensors = [
            one | {"axis": i} for one in keys["marker"] for i in range(rows_of[one.get("rows")])
        ] + keys.get("distance", [])
    rows = []
    for i, row in sheet.iterrows():
        sensor = sensors[i % len(sensors)]
        joint = None if "joint" not in sensor else int(sensor["joint"][1]) - 1
        if i % len(sensors) == 0:
            q = np.deg2rad([row[f"q{j}_deg"] for j in range(1, 7)])
            wrench = np.array([row[c] for c in ("Fx_N", "Fy_N", "Fz_N")])
            ends = [bench.rest(q, wrench, loaded) for loaded in (False, True)]
        rows.append(bench.rows(ends, sensor, joint))
    cells = pd.DataFrame(rows)
    assert set(cells) <= set(sheet)
    return sheet.assign(**{name: cells[name] for name in cells})


@pytest.mark.cell("markers on any body", "springs")
@pytest.mark.parametrize("keys", CASES.values(), ids=CASES)
def test_a_simulated_robot_is_identified(tmp_path, keys):
    """The compliances of an independently simulated robot come back, from a filled-in template."""
    study = Study(**(PLAIN | keys))
    path = tmp_path / "sheet.csv"
    filled(keys, study).to_csv(path, index=False, float_format="%.15g")
    found = calibrate(study, path)
    assert found.fitted.nonlinear
    true = K[list(study.model.joints)]
    np.testing.assert_allclose(found.fit.k, true, rtol=1e-4)
    assert np.abs(found.fit.residual[:, :3]).max() < 2e-9  # [m]


@pytest.mark.parametrize(
    ("keys", "change", "message"),
    [
        (
            CASES["markers"],
            {"marker": None},
            "column 'marker' is missing; expected which of",
        ),
        (CASES["markers"], {"marker": "nose"}, "no marker 'nose' in the study; expected one of"),
        (CASES["absolute"], {"x0_mm": 1.0}, "column 'x0_mm': the study counts from the nominal"),
        (CASES["absolute"], {"x_mm": 9e3}, "mm from the nominal robot; expected positions in the"),
        (CASES["distances"], {"change_mm": None}, "column 'change_mm' is missing"),
    ],
)
def test_wrong_sheets(tmp_path, keys, change, message):
    """A sheet that does not say which instrument a row is of, or of what, is one line."""
    study = Study(**(PLAIN | keys))
    sheet = filled(keys, study, poses=1).assign(**change)
    path = tmp_path / "sheet.csv"
    sheet.dropna(axis="columns", how="all").to_csv(path, index=False)
    with pytest.raises(UserError) as caught:
        calibrate(study, path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_positions_and_distances_have_rows_of_their_own(tmp_path):
    """A sheet of markers and a wire has a row a coordinate, and the information of the design."""
    keys = CASES["markers and distances"]
    study = Study(**(PLAIN | keys))
    sheet = filled(keys, study)
    names = ["marker 1 x", "marker 1 y", "marker 1 z", "side x"]
    assert sheet["marker"].tolist()[:4] == names
    assert sheet["marker"].tolist()[9] == "distance 1"
    sheet.to_csv(tmp_path / "sheet.csv", index=False)
    found = calibrate(study, tmp_path / "sheet.csv", HowFitted(linear=True))
    once = sheet.iloc[::10]
    q = np.deg2rad(once[[f"q{j}_deg" for j in range(1, 7)]].to_numpy())
    plan = Plan(q, np.tile([300, -200, -2500, 0, 0, 0], (6, 1)), np.ones(6, dtype=int))
    M = study.space.information(plan)
    A = found.data.regressor(study.model) / found.data.sigma[..., None]
    np.testing.assert_allclose(np.einsum("mri,mrj->ij", A, A), M, rtol=1e-9, atol=1e-12 * M.max())


MIX = CASES["a mix with visits"]


@pytest.mark.cell("positions and full poses in one sheet", "springs")
@pytest.mark.parametrize("discrepancy", [0.0, 0.02])
def test_a_mix_has_the_information_of_its_design(discrepancy):
    """Rows that share errors of tracker, joints and model tell as much as their design says."""
    study = Study(**(PLAIN | MIX | {"noise": NOISE | {"discrepancy_mm": discrepancy}}))
    rng = np.random.default_rng(1)
    x = study.space.draw(rng.random((5, len(study.space.drawn))))
    repeats = np.array([2, 1, 3, 1, 1])
    plan = Plan(x[:, :6], study.space.plan(x, repeats).wrench, repeats)
    data = planned_measurements(study, plan)
    A = whiten_columns(data.regressor(study.model), data.noise)
    M = study.space.information(plan)
    size = np.sqrt(M.diagonal())
    found = np.einsum("mri,mrj->ij", A, A)
    np.testing.assert_allclose(found / size / size[:, None], M / size / size[:, None], atol=1e-12)


def test_a_coordinate_that_was_not_measured(tmp_path):
    """Each row tells by itself: a sheet may lack some coordinates of a marker."""
    study = Study(**(PLAIN | MIX))
    sheet = filled(MIX, study)
    left = sheet.drop(index=[1, 5, 12, 20])
    left.to_csv(tmp_path / "sheet.csv", index=False, float_format="%.15g")
    found = calibrate(study, tmp_path / "sheet.csv")
    np.testing.assert_allclose(found.fit.k, K, rtol=1e-4)


@pytest.mark.slow
def test_report_of_a_mix(tmp_path):
    """Lengths and rotations have units, panels and columns of their own."""
    study = Study(**(PLAIN | MIX))
    sheet = filled(MIX, study)
    path = tmp_path / "sheet.csv"
    rng = np.random.default_rng(2)
    sheet["change_mm"] += 0.03 * rng.standard_normal(len(sheet))
    sheet[TURN_COLUMN] += 0.002 * rng.standard_normal(len(sheet))
    sheet.to_csv(path, index=False)
    found = calibrate(study, path)
    assert found.fit.p_value > 1e-3
    assert np.abs((found.fit.k - K) / found.fit.std).max() < 4
    table = found.residuals()
    turned = sheet["marker"].str.contains(" r")
    assert (table["coordinate"] == np.where(turned, TURN_COLUMN, "change_mm")).all()
    of_turns = np.rad2deg(found.fit.residual[turned.to_numpy(), 0])
    np.testing.assert_allclose(table["residual"][turned], of_turns)
    page = calibration_report(found)
    assert "change [mm]" in page
    assert "rotation [deg]" in page
    assert "deg for each rotation" in page
    assert len(found.plot()) == 3
    assert "largest leverage" in spring_calibration_text(found)


@pytest.mark.slow
def test_posterior_of_a_mix(tmp_path):
    """Standard deviations of the posterior are those of the fit, as both have the same rows."""
    study = Study(**(PLAIN | MIX))
    path = tmp_path / "sheet.csv"
    filled(MIX, study).to_csv(path, index=False, float_format="%.15g")
    rng = np.random.default_rng(0)
    found = calibrate(study, path).sampled(rng, SamplingOptions(Demand(0.1, length=10.0)))
    np.testing.assert_allclose(found.check.posterior.std, found.fit.std, rtol=0.3)


@pytest.mark.parametrize(
    ("row", "cells", "message"),
    [
        (
            0,
            {TURN_COLUMN: 0.1},
            "row 1, column rotation_change_deg: expected an empty cell",
        ),
        (3, {"change_mm": 0.1}, "row 4, column change_mm: expected an empty cell"),
        (3, {"sigma_mm": 0.1}, "row 4, column sigma_mm: expected an empty cell"),
        (0, {"sigma_mm": -0.1}, "row 1, column sigma_mm: -0.1 is not a positive"),
    ],
)
def test_cells_of_a_mix_stand_in_their_own_columns(tmp_path, row, cells, message):
    """A number in the column of the other kind is one line, which names row and column."""
    study = Study(**(PLAIN | MIX))
    sheet = filled(MIX, study, poses=1)
    if "sigma_mm" in cells:
        sheet["sigma_mm"] = sheet["change_mm"].where(sheet["change_mm"].isna(), 0.1)
    for column, cell in cells.items():
        sheet.loc[row, column] = cell
    sheet.to_csv(tmp_path / "sheet.csv", index=False)
    with pytest.raises(UserError) as caught:
        calibrate(study, tmp_path / "sheet.csv")
    assert message in str(caught.value)


def test_a_row_of_a_mix_without_its_reading_is_left_out(tmp_path):
    """It is not filled in yet: all other rows count, and their number is said."""
    study = Study(**(PLAIN | MIX))
    sheet = filled(MIX, study)
    sheet.to_csv(tmp_path / "sheet.csv", index=False)
    whole = calibrate(study, tmp_path / "sheet.csv")
    sheet.loc[3, TURN_COLUMN] = np.nan
    sheet.to_csv(tmp_path / "sheet.csv", index=False)
    with pytest.warns(Note, match=f"{len(sheet) - 1} of {len(sheet)} rows are filled in"):
        found = calibrate(study, tmp_path / "sheet.csv")
    assert found.fit.dof == whole.fit.dof - 1


@pytest.mark.cell("`payload` in a test pose", "springs")
@pytest.mark.parametrize("links", [False, True], ids=["payload", "payload and links"])
def test_commands_under_a_payload(links):
    """A command for a payload brings the independently loaded robot to the desired pose."""
    pose = {"q_deg": [10, -56.9, 60.3, 45.1, 76, 57.2], "payload": PAYLOAD}
    keys = {"load": None, "payload": PAYLOAD, "joints": VERTICAL, "test_pose": pose}
    if links:
        keys |= {"robot": robot_with_links(), "measurement": CASES["absolute"]["measurement"]}
    study = Study(**(PLAIN | keys))
    joints = study.specification.joints.unknown
    compliances = Compliances(joints, K[1:], K[1:], None)
    desired = study.tasks[0].q
    task = Plan(desired[None], np.zeros((1, 6)), np.ones(1, dtype=int))
    found = compensate(CalibratedSprings(study, compliances), task, "task")
    loaded = Bench(study).rest(found.command[0], np.zeros(3), True)
    np.testing.assert_allclose(loaded, desired, atol=1e-9)
    unhelped = Bench(study).rest(desired, np.zeros(3), True)
    ends = [study.robot.with_tool(transform()).forward(q)[:3, 3] for q in (unhelped, desired)]
    assert found.uncompensated[0] == pytest.approx(np.linalg.norm(ends[0] - ends[1]), rel=1e-6)
    assert (found.uncompensated[0] > 4e-3) == links


@pytest.mark.cell("`[[distance]]`", "springs")
def test_reports_of_distances(tmp_path):
    """A sheet of distances has a report with pictures, and one that is turned round is named."""
    study = Study(**(PLAIN | CASES["distances"]))
    path = tmp_path / "sheet.csv"
    sheet = filled(CASES["distances"], study)
    rng = np.random.default_rng(2)
    sheet["change_mm"] += 0.03 * rng.standard_normal(len(sheet))
    sheet.to_csv(path, index=False)
    found = calibrate(study, path)
    page = calibration_report(found)
    assert "3 distances: distance 1, distance 2, wire" in page
    assert "change [mm]" in page
    assert set(found.residuals()["coordinate"]) == {"change_mm"}
    sheet.assign(change_mm=-sheet["change_mm"]).to_csv(path, index=False)
    with pytest.raises(UserError, match="loaded and unloaded positions look swapped"):
        calibrate(study, path)
