"""Designs of full poses: rows of positions and orientations, and what a plan of them promises."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from geometry_sheets import NAMES, run
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from small_arm import ROBOT

import edtk
from edtk.calibration.calibrated_geometry import MarkerGoal
from edtk.calibration.geometry_question import GeometryQuestion
from edtk.calibration.geometry_space import PositionRows
from edtk.calibration.result_file import geometry_of_dict
from edtk.fit.fitted_geometry import FittedGeometry
from edtk.fit.geometry_posterior import GeometryDensity
from edtk.fit.marker_positions import MarkerPositions, read_positions
from edtk.fit.pose_rows import PoseRows, least_squares_fit
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.parameters import identifiable
from edtk.measure.whitening import Scatter
from edtk.robots.rotations import transform
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry

Array = NDArray[np.float64]

STUDY = Study(
    robot=ROBOT,
    measurement={"sigma_mm": 0.02, "rows": "pose", "sigma_deg": 0.005},
    noise={"repeatability_deg": 0.004},
    parameters={"geometry": "all"},
    marker=[{"name": "A", "position_mm": [90, 10, 50]}],
    test_pose={
        "q_deg": [10, 20, -30, 40, 50, 60],
        "load": {"F_N": [0, 0, 0]},
    },
    candidates=300,
)
NO_LOAD = np.zeros(6)


def poses(number: int, seed: int = 0) -> Array:
    """Poses anywhere between the limits [rad]."""
    return np.random.default_rng(seed).uniform(-2.2, 2.2, (number, 6))


def plan_of(q: Array, repeats: int = 1) -> edtk.Plan:
    """Visits of poses without a load."""
    return edtk.Plan(q, np.zeros((len(q), 6)), np.full(len(q), repeats))


@pytest.fixture(scope="module")
def question() -> GeometryQuestion:
    """The question of the study."""
    return GeometryQuestion.of(STUDY)


def test_poses_tell_thirty_parameters(question: GeometryQuestion) -> None:
    """Position and orientation of one tool tell 30 of a 6R arm, which position alone does not."""
    assert question.model.p == question.structural.p == 30
    found = edtk.evaluate(STUDY, plan_of(poses(10)))
    assert found.rank == 30
    alone = STUDY.replace(measurement={"sigma_mm": 0.02})
    assert GeometryQuestion.of(alone).model.p == 27


def test_rows_are_differences_of_the_predicted_pose(question: GeometryQuestion) -> None:
    """A unit of each parameter moves the position by its rows, and turns the tool by the others."""
    model = question.model
    q = poses(4)
    rows = question.rows(q, np.tile(NO_LOAD, (4, 1)))
    step = 1e-3
    for i in range(model.p):
        theta = np.zeros(model.p)
        theta[i] = step * model.scales[i]
        ahead = model.see(theta, q, derivatives=False)
        behind = model.see(-theta, q, derivatives=False)
        moved = 1e3 * (ahead.points - behind.points)[:, 0]
        apart = Rotation.from_matrix((ahead.turns @ np.swapaxes(behind.turns, -1, -2))[:, 0])
        expected = np.hstack([moved, 1e3 * apart.as_rotvec()]) / (2 * step)
        np.testing.assert_allclose(rows[..., i], expected, atol=1e-8)


def simulated(
    model: MeasuredModel, q: Array, theta: Array, rng: np.random.Generator
) -> MarkerPositions:
    """One measurement of some poses, with the noise that the study states."""
    noise = StudyGeometry.of(STUDY).noise
    repeated = q + 1e-3 * noise.joints * rng.standard_normal(q.shape)
    there = model.see(theta, repeated, derivatives=False)
    x = there.points + 2e-5 * rng.standard_normal(there.points.shape)
    small = Rotation.from_rotvec(0.005 * rng.standard_normal((len(q), 3)), degrees=True)
    turns = small.as_matrix()[:, None] @ there.turns
    row = np.zeros((len(q), 1), dtype=int)
    return MarkerPositions(q, np.zeros((len(q), 6)), x, row, ("A",), turns)


@pytest.mark.cell("`[noise]` of joints that do not come back, stated", "parameters")
def test_fits_err_as_the_plan_promised(question: GeometryQuestion) -> None:
    """Chi-square of 40 fits of simulated days, under the covariance of the design."""
    q = poses(14)
    promised = edtk.evaluate(STUDY, plan_of(q)).covariance
    model = question.model
    noise = question.setting.noise
    at = model.see(np.zeros(model.p), q)
    assert at.by_joints is not None
    V = noise.of_reading(at.by_joints.reshape(len(q), 6, 6), at.places)
    weights = Scatter.of(V).inverse
    rng = np.random.default_rng(3)
    theta = rng.normal(0, 0.1, model.p) * model.scales
    squares = []
    for _ in range(40):
        data = simulated(model, q, theta, rng)
        found = least_squares_fit(model, theta, data, weights=weights, most=6).theta
        apart = (found - theta) / model.scales
        squares.append(apart @ np.linalg.solve(promised, apart))
    # The mean of 1200 squares is one, within four of its standard deviations.
    assert np.sum(squares) / 1200 == pytest.approx(1, abs=4 * np.sqrt(2 / 1200))


def test_no_choice_of_parameters_changes_what_is_promised(question: GeometryQuestion) -> None:
    """Another minimal set predicts all poses, and rho0, as well as the one that was chosen."""
    setting = question.setting
    q = poses(12)
    tasks = poses(5, seed=2)
    every = setting.model
    wrench = np.tile(NO_LOAD, (len(q), 1))
    scaled = PositionRows(every, None)(q, wrench).reshape(-1, every.p)
    backwards = [[i] for i in range(every.p)][::-1]
    other = identifiable(scaled, every.parameters, backwards)
    chosen = tuple(every.parameters[i] for i in other.kept)
    assert set(chosen) != set(question.model.parameters)
    bands = []
    for model in (question.model, every.with_parameters(chosen)):
        A = PositionRows(model, None, question.space.noise)(q, wrench).reshape(-1, 30)
        rows = PositionRows(model, None)(tasks, np.zeros((5, 6))).reshape(-1, 30)
        bands.append(np.linalg.norm(np.linalg.solve(np.linalg.qr(A, "r").T, rows.T), axis=0))
    np.testing.assert_allclose(*bands, rtol=1e-7)


def test_orientations_that_say_nothing_leave_positions(question: GeometryQuestion) -> None:
    """With a noise of orientations without end, information is that of the positions."""
    q = poses(12)
    model = question.model
    noise = question.setting.noise
    loose = replace(noise, turn=1e9).of_visits(6, 1)
    A = PositionRows(model, None, loose)(q, np.zeros((12, 6)))
    rows = PositionRows(model, None)(q, np.zeros((12, 6)))[:, :3]
    seen = model.see(np.zeros(model.p), q)
    assert seen.by_joints is not None
    V = replace(noise, turn=None).of_reading(seen.by_joints[:, 0, :3], seen.places)
    M = np.einsum("mrp,mrs,msq->pq", rows, np.linalg.inv(V), rows)
    np.testing.assert_allclose(np.einsum("mrp,mrq->pq", A, A), M, atol=1e-8 * np.abs(M).max())


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the study, the sheet of a plan filled in, and what the sheet tells."""
    folder = tmp_path_factory.mktemp("day")
    STUDY.to_toml(folder / "study.toml")
    table = edtk.template(STUDY, plan_of(poses(16)), out=folder / "day.csv")
    model, theta = erring()
    q = np.deg2rad(table[NAMES].to_numpy())
    seen = simulated(model, q, theta, np.random.default_rng(7))
    assert seen.turns is not None
    table[["x_mm", "y_mm", "z_mm"]] = 1e3 * seen.measured[:, 0]
    vectors = Rotation.from_matrix(seen.turns[:, 0]).as_rotvec(degrees=True)
    table[["rx_deg", "ry_deg", "rz_deg"]] = vectors
    table.to_csv(folder / "day.csv", index=False)
    found = edtk.identify(STUDY, folder / "day.csv")
    (folder / "k.json").write_text(json.dumps(found.to_dict()))
    return folder


def erring() -> tuple[MeasuredModel, Array]:
    """A robot that stands elsewhere, with errors, and a marker turned about on its tool."""
    model = StudyGeometry.of(STUDY).model
    theta = np.random.default_rng(5).normal(0, 0.7, model.p) * model.scales
    theta[[one.place == "tool" and one.turns for one in model.parameters]] = [0.4, -0.9, 0.7]
    return replace(model, start=transform((1.5, -0.7, 0.2), (0.2, 0.1, 1.0))), theta


def test_identify_reads_the_sheet(day: Path) -> None:
    """Thirty parameters, and unseen poses are predicted as they are."""
    found = json.loads((day / "k.json").read_text())
    assert found["rank"] == 30
    assert found["turn_rms_deg"] < 0.01
    model, theta = erring()
    q = poses(10, seed=9)
    np.savetxt(day / "other.csv", np.rad2deg(q), delimiter=",", header=",".join(NAMES), comments="")
    predicted = edtk.predict(day / "study.toml", day / "k.json", day / "other.csv").values
    seen = model.see(theta, q, derivatives=False)
    turns = Rotation.from_rotvec(predicted[:, 3:]).as_matrix()
    assert np.abs(predicted[:, :3] - seen.points[:, 0]).max() < 3e-4
    assert np.abs(turns - seen.turns[:, 0]).max() < 1e-3


def test_a_joint_may_be_called_as_a_turn(tmp_path: Path) -> None:
    """Orientations have the marker's name before them then, and are read from there."""
    joints = [dict(one) for one in ROBOT["joints"]]
    joints[2]["name"] = "rx"
    odd = STUDY.replace(robot=ROBOT | {"joints": joints})
    table = edtk.template(odd, plan_of(poses(3)))
    own = ["A_rx_deg", "A_ry_deg", "A_rz_deg"]
    assert list(table.columns[-3:]) == own
    table[["x_mm", "y_mm", "z_mm", *own]] = [1.0, 2.0, 3.0, 0.0, 0.0, 30.0]
    table.to_csv(tmp_path / "day.csv", index=False)
    found = read_positions(tmp_path / "day.csv", odd.robot, {}, {"A": "pose"})
    assert found.turns is not None
    assert found.turns[0, 0, 0, 0] == pytest.approx(np.cos(np.pi / 6))


def test_commands_bring_the_tool_to_its_pose(day: Path) -> None:
    """Position and orientation of the tool are then those of the drawing's robot, told apart."""
    q = poses(6, seed=11)[[0, 1, 2, 3, 5]]
    tasks = day / "tasks.csv"
    np.savetxt(tasks, np.rad2deg(q), delimiter=",", header=",".join(NAMES), comments="")
    words = ("compensate", day / "study.toml", day / "k.json", tasks, "--out", day / "out.csv")
    assert run(*words)[0] == 0
    told = edtk.compensate(day / "study.toml", day / "k.json", tasks)
    assert told.rotation_left is not None
    assert told.left.max() < 1e-9
    assert told.rotation_left.max() < 1e-9
    fitted, _ = geometry_of_dict(
        json.loads((day / "k.json").read_text())["geometry"], StudyGeometry.of(STUDY)
    )
    goal = MarkerGoal.of(fitted, q)
    model, theta = erring()
    before, after = (model.see(theta, at, derivatives=False) for at in (q, told.command))
    assert goal.turns is not None
    assert (goal.distance(after) < 0.3 * goal.distance(before)).all()
    angles = goal.angle(before), goal.angle(after)
    assert (angles[1] < 0.3 * angles[0]).all()
    assert (goal.distance(after) < 4 * told.remaining).all()
    assert (angles[1] < 4 * told.rotation).all()
    header = (day / "out.csv").read_text().splitlines()[0].split(",")
    assert header[-2:] == ["uncompensated_rotation_deg", "remaining_rotation_rms_deg"]
    assert "rotation before [deg]  rotation after, rms [deg]" in told.summary()


def test_a_stretched_arm_reaches_no_pose_near(day: Path) -> None:
    """The steps for a pose a little out of reach settle nowhere, and its row is named."""
    cells = np.rad2deg(poses(6, seed=11))[[0, 4]]
    np.savetxt(day / "far.csv", cells, delimiter=",", header=",".join(NAMES), comments="")
    code, out, err = run("compensate", day / "study.toml", day / "k.json", day / "far.csv")
    number, reason = err.splitlines()
    assert code == 1
    assert out.count("\n") == 4
    assert "the noise alone makes" in out
    assert number.endswith("far.csv: 1 row left out")
    assert "far.csv: row 2: no command near the pose brings the markers there" in reason


def test_commands_ask_for_a_result_that_has_the_turns(day: Path) -> None:
    """An older result of full poses is refused in one line: its markers may be turned anyhow."""
    older = json.loads((day / "k.json").read_text())
    del older["geometry"]["placed_turns_rad"]
    (day / "older.json").write_text(json.dumps(older))
    (day / "one.csv").write_text(",".join(NAMES) + "\n0,0,0,0,30,0\n")
    code, out, err = run("compensate", day / "study.toml", day / "older.json", day / "one.csv")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "identify the sheet anew" in err


def test_few_joints_pay_no_position_for_an_orientation() -> None:
    """Five joints bring the position all the way, and then the orientation as near as they can."""
    task = STUDY.to_dict()["test_pose"] | {"q_deg": [10, 20, -30, 40, 50]}
    arm = STUDY.replace(robot=ROBOT | {"joints": ROBOT["joints"][:5]}, test_pose=task)
    model = StudyGeometry.of(arm).model
    theta = np.random.default_rng(6).normal(0, 0.7, model.p) * model.scales
    nothing = np.zeros((model.p, 0))
    noise = StudyGeometry.of(arm).noise
    fitted = FittedGeometry(
        model, theta, nothing @ nothing.T, (), nothing, noise, model.offsets, np.zeros((1, 3))
    )
    q = poses(5, seed=2)[:, :5]
    goal = MarkerGoal.of(fitted, q)
    seen = model.see(theta, goal.commands(fitted, q, np.zeros((5, 6)), None))
    assert goal.distance(seen).max() < 1e-8
    assert goal.turns is not None
    assert seen.by_joints is not None
    left = Rotation.from_matrix((goal.turns @ np.swapaxes(seen.turns, -1, -2))[:, 0]).as_rotvec()
    assert np.abs(left).max() > 1e-4
    for D, vector in zip(seen.by_joints[:, 0], left, strict=True):
        free = np.linalg.svd(D[:3])[2][3:].T
        np.testing.assert_allclose(vector @ D[3:] @ free, 0, atol=1e-6)


def test_the_posterior_counts_orientations(day: Path) -> None:
    """Its density is the nonlinear chi-square of positions and turns, and the check agrees."""
    found = edtk.identify(STUDY, day / "day.csv", bayes=True)
    assert found.check is not None
    assert found.check.posterior.trusted
    assert found.check.posterior.effective_share > 0.95
    density = GeometryDensity.of(found.fit, None, robust=False)
    x = np.random.default_rng(1).normal(size=(2, 30))
    fit = found.fit
    expected = []
    for theta in density.parameters(x) * density.model.scales:
        rows = PoseRows.of(density.model, theta, density.means, None)
        V = fit.fitted.noise.of_pose(rows.motion, rows.places, fit.data.counts).dense
        expected.append(
            -0.5 * np.einsum("mr,mrs,ms", rows.residual, np.linalg.inv(V), rows.residual)
        )
    np.testing.assert_allclose(np.diff(density.log_density(x)), np.diff(expected), rtol=1e-2)


def test_a_plan_of_poses_and_its_bound() -> None:
    """Value and bound of twelve visits fit each other, and fewer than five tell too little."""
    small = STUDY.replace(parameters={"geometry": ["zeros"]}, noise=None, candidates=100)
    found = edtk.plan(small, 5, budget=0.5)
    assert found.question.model.p == 18 - 2
    assert 0.5 < found.efficiency <= 1 + 1e-9
    assert found.value == pytest.approx(edtk.evaluate(small, found.whole).rho0, rel=1e-9)
    with pytest.raises(edtk.UserError, match="expected 3 or more, each of full poses of 1 marker"):
        edtk.plan(small, 2, budget=0.5)
