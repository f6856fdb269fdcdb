"""Geometry from simulated positions: what is put in comes out, with the spread that is stated."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from edtk.fit import fit_geometry as module
from edtk.fit import pose_rows
from edtk.fit.fit_geometry import TooFewPosesError, fit_geometry
from edtk.fit.fitted_geometry import GeometricFit
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.place_robot import linear_start
from edtk.measure.equilibrium import torque_and_derivative
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.parameters import all_parameters
from edtk.measure.position_noise import PositionNoise
from edtk.robots.joint import Joint
from edtk.robots.robot import Robot
from edtk.robots.rotations import rotation, transform

Array = NDArray[np.float64]
AXES = dict(zip("xyz", np.eye(3), strict=True))
PLACE = transform((2.5, -1.0, 0.4), (0.5, 0.3, 2.0))
OFFSETS = np.array([[0.08, 0.01, 0.05], [-0.03, 0.07, 0.04], [0.0, -0.06, 0.09]])


def arm(origins: list[tuple[float, ...]], axes: str, slides: str = "") -> Robot:
    """A chain along parallel frames; `slides` names the joints that are prismatic by number."""
    joints = []
    for i, (origin, axis) in enumerate(zip(origins, axes, strict=True), start=1):
        kind = "prismatic" if str(i) in slides else "revolute"
        limits = (-0.2, 0.2) if kind == "prismatic" else (-2.2, 2.2)
        joints.append(Joint(f"q{i}", transform(origin), AXES[axis], limits, kind))
    return Robot(f"{len(joints)} joints", tuple(joints))


SIX = arm([(0, 0, 0.29), (0, 0, 0), (0, 0, 0.27), (0, 0, 0.07), (0.302, 0, 0), (0, 0, 0)], "zyyxyx")
SCARA = arm([(0, 0, 0.3), (0.3, 0, 0), (0.25, 0, 0), (0, 0, 0)], "zzzz", slides="3")
SEVEN = arm(
    [(0, 0, 0.34), (0, 0, 0), (0, 0, 0.4), (0, 0, 0), (0, 0, 0.4), (0, 0, 0), (0, 0, 0.126)],
    "zyzyzyz",
)


class AtTool:
    """Loads of the joints by a wrench at the tool."""

    def __call__(self, q: Array, wrench: Array) -> Array:
        """``J' W``."""
        return np.einsum("mij,mi->mj", SIX.jacobian(q), wrench)

    def with_derivative(self, q: Array, wrench: Array) -> tuple[Array, Array]:
        """The same, and derivatives by the joints."""
        return torque_and_derivative(SIX, q, wrench)


class OnLastJoint:
    """A tenth of the force, in newton metres, on the last joint, wherever the joints are."""

    def __call__(self, q: Array, wrench: Array) -> Array:
        """The loads."""
        return np.outer(0.1 * wrench[:, 2], np.eye(6)[5])

    def with_derivative(self, q: Array, wrench: Array) -> tuple[Array, Array]:
        """The same, and derivatives by the joints, which are zero."""
        return self(q, wrench), np.zeros((len(q), 6, 6))


def model_of(robot: Robot, markers: int = 3, **chosen: object) -> MeasuredModel:
    """All parameters of a robot with markers whose places are not known."""
    names = tuple("ABC"[:markers])
    parameters = all_parameters(robot, names, **chosen)
    return MeasuredModel(robot, np.zeros((markers, 3)), names, parameters)


def simulate(
    model: MeasuredModel,
    poses: int,
    sigma_mm: float = 0.03,
    size: float = 0.5,
    joints_mrad: float = 0.0,
    repeats: int = 1,
    seed: int = 0,
) -> tuple[MarkerPositions, MeasuredModel, Array]:
    """Positions of an erring robot somewhere in a room; the true model and its parameters."""
    rng = np.random.default_rng(seed)
    q = np.repeat(rng.uniform(*model.robot.limits, (poses, model.robot.n)), repeats, axis=0)
    true = replace(model, offsets=OFFSETS[: len(model.markers)], start=PLACE)
    theta = rng.normal(0, size, model.p) * model.scales
    err = joints_mrad * 1e-3 * rng.standard_normal(q.shape)
    x = true.see(theta, q + err, derivatives=False).points
    x = x + rng.normal(0, sigma_mm * 1e-3, x.shape)
    row = np.arange(x.shape[0] * x.shape[1]).reshape(x.shape[:2])
    data = MarkerPositions(q, np.zeros((len(q), 6)), x, row, model.markers)
    return data, true, theta


def white(robot: Robot, sigma_mm: float) -> PositionNoise:
    """White noise of readings alone."""
    return PositionNoise(sigma_mm, np.zeros(robot.n))


def fitted(model: MeasuredModel, poses: int, **options: object) -> tuple[GeometricFit, tuple]:
    """A fit of simulated positions, and the truth."""
    data, true, theta = simulate(model, poses, **options)
    stated = white(model.robot, options.get("sigma_mm", 0.03))
    return fit_geometry(model, data, stated), (true, theta)


def test_linear_start_is_exact() -> None:
    """Without geometric errors the linear problem finds robot and markers, and metres for mm."""
    model = model_of(SIX)
    data, true, _ = simulate(model, 12, sigma_mm=0.0, size=0.0)
    found = linear_start(SIX.forward(data.q), data.measured, data.seen)
    assert (found.whole, found.mirrored) == (True, False)
    np.testing.assert_allclose(found.base, PLACE, atol=1e-10)
    np.testing.assert_allclose(found.tools, true.offsets, atol=1e-10)
    in_mm = linear_start(SIX.forward(data.q), 1e3 * data.measured, data.seen)
    assert in_mm.scale == pytest.approx(1e3, rel=1e-9)
    mirrored = data.measured * [1, 1, -1]
    assert linear_start(SIX.forward(data.q), mirrored, data.seen).mirrored


@pytest.mark.parametrize(
    ("robot", "rank", "poses"), [(SIX, 33, 25), (SCARA, 23, 25), (SEVEN, 37, 30)]
)
def test_exact_positions_are_fitted_exactly(robot: Robot, rank: int, poses: int) -> None:
    """Without noise the fit is exact, and predicts poses that it never saw."""
    model = model_of(robot)
    fit, (true, theta) = fitted(model, poses, sigma_mm=0.0, size=2.0)
    assert fit.rank == fit.structural == rank
    assert fit.rms < 1e-9
    q = np.random.default_rng(9).uniform(*robot.limits, (20, robot.n))
    expected = true.see(theta, q, derivatives=False).points
    np.testing.assert_allclose(fit.fitted.predict(q).points, expected, atol=1e-8)


@pytest.mark.parametrize("half_turn", [3.14159265, 3.14159, 3.1416])
@pytest.mark.slow
def test_axes_that_a_file_has_parallel_to_five_digits_tell_no_height(half_turn: float) -> None:
    """Base and markers of a SCARA would stand a hundred metres up, which fits tilts of its axes."""
    joints = list(SCARA.joints)
    for j in (2, 3):
        origin = joints[j].origin.copy()
        origin[:3, :3] = rotation(np.array([half_turn if j == 2 else np.pi, 0.0, 0.0]))
        joints[j] = replace(joints[j], origin=origin)
    model = model_of(replace(SCARA, joints=tuple(joints)))
    for seed in range(2):
        fit, _ = fitted(model, 30, size=0.3, seed=seed)
        assert fit.rank == fit.structural == 23
        assert np.abs(fit.fitted.placed - OFFSETS).max() < 0.2
        assert 1e3 * fit.rms < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("robot", [SIX, SCARA, SEVEN], ids=["6R", "SCARA", "7R"])
def test_predictions_err_as_is_stated(robot: Robot) -> None:
    """Errors of predicted positions over simulations have the stated covariance: their mean square
    over it is one, within what so few simulations allow.
    """
    model = model_of(robot, 2)
    q = np.random.default_rng(3).uniform(*robot.limits, (1, robot.n))
    squares = []
    for seed in range(6):
        fit, (true, theta) = fitted(model, 20, seed=seed)
        predicted = fit.fitted.predict(q)
        error = (true.see(theta, q, derivatives=False).points - predicted.points).reshape(-1)
        J = 1e3 * fit.fitted.model.see(fit.fitted.theta, q).jacobian * fit.fitted.model.scales
        J = J.reshape(len(error), -1)
        covariance = J @ fit.fitted.covariance @ J.T
        squares.append(1e6 * error @ np.linalg.solve(covariance, error) / len(error))
    # 36 degrees of freedom: 0.4 .. 1.9 fails one time in two thousand.
    assert 0.4 < np.mean(squares) < 1.9


@pytest.mark.slow
def test_predictions_do_not_depend_on_the_minimal_set(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other parameters are kept where others come first, and every prediction stays."""
    model = model_of(SIX, 2)
    fit, _ = fitted(model, 20)
    monkeypatch.setattr(module, "stages", lambda model: [list(range(model.p))[::-1][:40]])
    other, _ = fitted(model, 20)
    names = [{one.name for one in each.fitted.model.parameters} for each in (fit, other)]
    assert names[0] != names[1]
    assert len(names[0]) == len(names[1]) == 30
    q = np.random.default_rng(4).uniform(*SIX.limits, (10, 6))
    mine = fit.fitted.predict(q)
    theirs = other.fitted.predict(q)
    # The gauge of the second order moves nothing; what is left is the end of the search.
    np.testing.assert_allclose(mine.points, theirs.points, atol=1e-8)
    np.testing.assert_allclose(mine.half, theirs.half, rtol=1e-3)


@pytest.mark.cell("poses left out one by one", "parameters")
@pytest.mark.slow
def test_left_out_residuals_are_those_of_refits(monkeypatch: pytest.MonkeyPatch) -> None:
    """The shortcut agrees with fits without the pose, to the second order of geometric errors."""
    model = model_of(SIX, 3)
    data, _, _ = simulate(model, 14, sigma_mm=0.05)
    fit = fit_geometry(model, data, white(SIX, 0.05))
    same = lambda noise, *rest, **_: fit.fitted.noise  # noqa: E731
    monkeypatch.setattr(pose_rows, "fit_model_error", same)
    for pose in (0, 5, 13):
        kept = np.arange(len(data)) != pose
        without = fit_geometry(model, data[kept], white(SIX, 0.05))
        left = data.measured[pose] - without.fitted.predict(data.q[[pose]]).points[0]
        np.testing.assert_allclose(fit.left_out[pose], left, atol=2e-3 * np.abs(left).max())


@pytest.mark.cell("the same joints, estimated", "parameters")
@pytest.mark.slow
def test_joint_errors_are_told_from_white_ones() -> None:
    """Repeats tell how joints return, and poses what the model leaves out, in milliradians."""
    model = model_of(SIX, 3)
    fit, _ = fitted(model, 30, sigma_mm=0.01, joints_mrad=0.2, seed=2)
    noise = fit.fitted.noise
    assert noise.model_joints[0] == pytest.approx(0.2, rel=0.25)
    assert noise.repeats == 0
    data, _, _ = simulate(model, 12, sigma_mm=0.01, repeats=1)
    rng = np.random.default_rng(1)
    q = np.repeat(data.q, 6, axis=0)
    true = replace(model, offsets=OFFSETS, start=PLACE)
    x = true.see(np.zeros(model.p), q + 2e-4 * rng.standard_normal(q.shape)).points
    x = x + rng.normal(0, 1e-5, x.shape)
    again = MarkerPositions(q, np.zeros((72, 6)), x, np.zeros(x.shape[:2], dtype=int), "ABC")
    told = fit_geometry(model, again, white(SIX, 0.01)).fitted.noise
    assert told.repeats == 60 * 9
    assert told.reading == pytest.approx(0.01, rel=0.2)
    assert np.sqrt((told.joints**2).mean()) == pytest.approx(0.2, rel=0.25)


@pytest.mark.slow
def test_bands_hold_what_they_promise() -> None:
    """95 % bands of poses that were not fitted hold nearly so many of their coordinates."""
    model = model_of(SIX, 3)
    data, _, _ = simulate(model, 150, sigma_mm=0.02, joints_mrad=0.3)
    fit = fit_geometry(model, data[:40], white(SIX, 0.02))
    rest = data[40:]
    share = fit.fitted.predict(rest.q).inside(rest.measured).mean()
    assert 0.92 < share < 0.98
    assert 0.92 < fit.share_inside < 0.98


@pytest.mark.cell("what cannot be told apart, in words", "parameters")
def test_what_poses_leave_open_is_named_and_widens_bands() -> None:
    """A joint that never moves leaves directions open; elsewhere bands say so."""
    model = model_of(SIX, 3)
    data, _, _ = simulate(model, 20)
    q = data.q.copy()
    q[:, 0] = 0.3
    true = replace(model, offsets=OFFSETS, start=PLACE)
    still = replace(data, q=q, measured=true.see(np.zeros(model.p), q).points)
    fit = fit_geometry(model, still, white(SIX, 0.03))
    assert (fit.rank, fit.structural, len(fit.open)) == (29, 33, 4)
    near = fit.fitted.predict(q[:3])
    far = fit.fitted.predict(q[:3] + np.eye(6)[0])
    assert near.open.max() < 1e-6 < 1e-3 < far.open.min()
    assert far.half.min() > 5 * near.half.max()


def test_too_few_poses_are_counted() -> None:
    """A sheet with fewer coordinates than parameters says how many poses are missing."""
    model = model_of(SIX, 3)
    data, _, _ = simulate(model, 3)
    with pytest.raises(TooFewPosesError, match=r"27 measured coordinates for 33.* 1 more pose$"):
        fit_geometry(model, data, white(SIX, 0.03))


@pytest.mark.slow
def test_springs_are_identified_with_the_geometry() -> None:
    """Loaded and unloaded poses tell springs and geometry at once."""
    model = model_of(SIX, 3, compliance=("q2", "q3"))
    data, true, theta = simulate(model, 40, sigma_mm=0.005)
    k = np.array([0.0, 3e-6, 5e-6, 0.0, 0.0, 0.0])
    theta[-2:] = k[1:3]
    wrench = np.zeros((40, 6))
    wrench[::2, 2] = -300.0
    loads = AtTool()
    theta_full = theta
    torque = loads(data.q, wrench)
    for _ in range(20):
        torque = loads(data.q + k * torque, wrench)
    x = true.see(theta_full, data.q, torque).points
    x = x + np.random.default_rng(8).normal(0, 5e-6, x.shape)
    fit = fit_geometry(model, replace(data, wrench=wrench, measured=x), white(SIX, 0.005), loads)
    assert fit.rank == 35
    error = fit.fitted.compliances - k
    std = fit.fitted.std[-2:] * 1e-6
    assert (std < 1e-7).all()
    assert (np.abs(error[1:3]) < 4 * std).all()


def test_missing_markers_do_not_count() -> None:
    """A marker that was not seen in some poses changes nothing but the number of rows."""
    model = model_of(SIX, 3)
    data, _, _ = simulate(model, 20, sigma_mm=0.0)
    measured = data.measured.copy()
    measured[3, 1] = np.nan
    measured[7] = np.nan
    fit = fit_geometry(model, replace(data, measured=measured), white(SIX, 0.03))
    assert fit.rms < 1e-9
    assert np.isnan(fit.residual[7]).all()
    assert np.isnan(fit.residual[3, 1]).all()


def test_a_place_of_parallel_axes_is_found() -> None:
    """A SCARA leaves heights of base and markers open together, and tells orientation and scale."""
    model = model_of(SCARA)
    data, _, _ = simulate(model, 12, sigma_mm=0.0, size=0.0)
    found = linear_start(SCARA.forward(data.q), data.measured, data.seen)
    assert found.whole
    assert found.rms < 1e-9
    np.testing.assert_allclose(found.base[:3, :3], PLACE[:3, :3], atol=1e-9)
    guess = OFFSETS + np.array([0, 0, 0.01])
    near = linear_start(SCARA.forward(data.q), data.measured, data.seen, guess)
    np.testing.assert_allclose(near.tools, guess, atol=1e-9)
    still = np.array(data.q)
    still[:, 2] = 0.1
    flat = SCARA.forward(still)
    planar = linear_start(flat, flat[:, None, :3, 3] + OFFSETS, data.seen)
    assert not planar.whole


def test_markers_of_parallel_axes_stay_near_where_the_study_has_them() -> None:
    """No height of base and markers that moves no position wanders off in the fit."""
    model = replace(model_of(SCARA), offsets=OFFSETS)
    fit, _ = fitted(model, 25)
    geometry = fit.fitted
    assert fit.rank == 23
    place = geometry.model.start[:3, 3]
    np.testing.assert_allclose(place, PLACE[:3, 3], atol=0.01)
    assert np.abs(geometry.values).max() < 10


@pytest.mark.cell("the model's error, estimated", "parameters")
@pytest.mark.slow
def test_bands_hold_where_a_load_that_nobody_told_bends_two_joints() -> None:
    """Sizes of the model's error are one a joint where the residuals say so, and bands hold."""
    model = model_of(SIX, 3)
    sag = np.array([0, 6e-4, 4e-4, 0, 0, 0])
    true = replace(model, offsets=OFFSETS, start=PLACE)
    rng = np.random.default_rng(4)
    q = rng.uniform(*SIX.limits, (130, 6))
    # What a weight at the wrist would do: by the cosine of the angle from the upright.
    bent = q + sag * np.cos(np.stack([q[:, 0], q[:, 1], q[:, 1] + q[:, 2], *q.T[3:]], axis=1))
    x = true.see(np.zeros(model.p), bent, derivatives=False).points
    x = x + rng.normal(0, 1e-5, x.shape)
    data = MarkerPositions(q, np.zeros((130, 6)), x, np.zeros((130, 3), dtype=int), model.markers)
    fit = fit_geometry(model, data[:30], white(SIX, 0.01))
    sizes = fit.fitted.noise.model_joints
    assert sizes[1:3].min() > 3 * sizes[3:].max()
    inside = fit.fitted.predict(q[30:]).inside(x[30:]).mean()
    assert 0.9 < inside < 0.99
    assert 0.9 < fit.share_inside < 0.99


def pose_day(
    robot: Robot, poses: int, seed: int = 0, repeats: int = 1
) -> tuple[GeometricFit, MeasuredModel, Array]:
    """A fit of measured poses, 0.03 mm and 0.1 mrad of noise, and the truth."""
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(seed)
    parameters = all_parameters(robot, ("A",), pose=True)
    model = MeasuredModel(robot, np.zeros((1, 3)), ("A",), parameters, rows="pose")
    true = replace(model, offsets=OFFSETS[:1], start=PLACE)
    theta = rng.normal(0, 0.5, model.p) * model.scales
    tool = [one.place == "tool" and one.turns for one in model.parameters]
    theta[tool] = [0.4, -0.9, 0.7]
    q = np.repeat(rng.uniform(*robot.limits, (poses, robot.n)), repeats, axis=0)
    seen = true.see(theta, q, derivatives=False)
    x = seen.points + rng.normal(0, 3e-5, seen.points.shape)
    turned = Rotation.from_rotvec(rng.normal(0, 1e-4, (len(q), 3))).as_matrix()
    rows = np.arange(len(q))[:, None]
    data = MarkerPositions(q, np.zeros((len(q), 6)), x, rows, ("A",), turned[:, None] @ seen.turns)
    stated = PositionNoise(0.03, np.zeros(robot.n), turn=0.1)
    return fit_geometry(model, data, stated), true, theta


def test_full_poses_tell_thirty_parameters() -> None:
    """Position and orientation of one tool tell 30 of a 6R arm, and errors are as is stated."""
    fit, true, theta = pose_day(SIX, 24)
    assert fit.rank == fit.structural == 30
    assert fit.fitted.noise.model_fit is None
    q = np.random.default_rng(8).uniform(*SIX.limits, (60, 6))
    predicted = fit.fitted.predict(q)
    seen = true.see(theta, q, derivatives=False)
    apart = (seen.points - predicted.points) / predicted.std
    assert 0.1 < np.sqrt((apart**2).mean()) < 1.0
    turned = np.einsum("mkij,mklj->mkil", seen.turns, predicted.turns)
    angle = np.arccos(np.clip((np.trace(turned, axis1=-2, axis2=-1) - 1) / 2, -1, 1))
    assert angle.max() < 3e-4
    assert fit.turns is not None
    assert 0.9 < fit.share_inside < 0.99
    assert np.sqrt((fit.turns.residual**2).mean()) == pytest.approx(0.8e-4, rel=0.3)


@pytest.mark.slow
def test_repeated_poses_tell_both_kinds_of_noise() -> None:
    """Repeats tell the scatter of positions, and of orientations, each in its unit."""
    fit, _, _ = pose_day(SIX, 12, repeats=4)
    noise = fit.fitted.noise
    assert noise.reading == pytest.approx(0.03, rel=0.2)
    assert noise.turn == pytest.approx(0.1, rel=0.2)


@pytest.mark.slow
def test_a_soft_spring_under_a_small_load_is_told() -> None:
    """The wrist of a light arm, 1e-4 rad/(N m) under 2 N m: told if it is likely to be so soft."""
    model = model_of(SIX, compliance=("q6",), likely={"q6": 5e-5})
    data, true, theta = simulate(model, 30, sigma_mm=0.005, seed=3)
    wrench = np.zeros((30, 6))
    wrench[:15, 2] = -20.0
    theta[-1] = 1e-4
    loads = OnLastJoint()
    shift = true.see(theta, data.q, loads(data.q, wrench), derivatives=False).points
    shift = shift - true.see(theta, data.q, derivatives=False).points
    bent = replace(data, wrench=wrench, measured=data.measured + shift)
    fit = fit_geometry(model, bent, white(SIX, 0.005), loads)
    assert fit.open == ()
    names = [one.name for one in fit.fitted.model.parameters]
    own = names.index("k_q6")
    assert fit.fitted.std[own] < 10.0  # of 100
    assert abs(fit.fitted.values[own] - 100.0) < 4 * fit.fitted.std[own]
    stiff = model_of(SIX, compliance=("q6",), likely={"q6": 1e-7})
    said = fit_geometry(stiff, bent, white(SIX, 0.005), loads)
    assert "the compliance of joint q6" in said.open[0]
    # Where it is left open, predictions under the load are as unsure as it is likely to be large.
    at = (bent.q[:1], wrench[:1], loads)
    assert 0 < said.fitted.predict(*at).open.max() < 1e-5
