"""Rows of positions: those of the geometric model, whitened, and their slopes by the joints."""

import numpy as np
import pytest
from loaded_arm import LOAD, STUDY

from edtk.calibration.geometry_space import PositionRows
from edtk.measure.measured_model import Load, LoadsOfReadings
from edtk.measure.noise import Tracker
from edtk.measure.position_noise import PositionNoise
from edtk.study.study_geometry import StudyGeometry, planned_noise
from edtk.system.typing import Array

RNG = np.random.default_rng(4)
MARKERS = [{"name": "A", "position_mm": [10, 30, 0]}, {"name": "B", "position_mm": [-40, 0, 60]}]
ARM = STUDY.to_dict()["robot"]
LINKS = [joint | {"mass_kg": 5.0, "center_m": [0.2, 0, 0.1]} for joint in ARM["joints"]]
HEAVY = STUDY.replace(
    robot=ARM | {"joints": LINKS},
    marker=MARKERS,
    parameters={"geometry": "all", "compliance": ["q1", "q2"]},
    payload={"mass_kg": 3.0, "center_mm": [10, 0, 40]},
)
# On a link and on the tool, and read loaded less unloaded where a load is on.
CHANGES = HEAVY.replace(
    marker=[*MARKERS, {"name": "link", "joint": "q1", "position_mm": [60, 20, 10]}],
    measurement={"sigma_mm": 0.05, "reference": "unloaded"},
)
FULL = HEAVY.replace(measurement={"sigma_mm": 0.05, "rows": "pose", "sigma_deg": 0.01})
TRACKER = Tracker(np.array([3.0, 1.0, 0.5]), (1e-5, 2e-5), (2e-5, 8e-5))
NOISES = {
    "white": PositionNoise(0.05, np.zeros(2)),
    "joints": PositionNoise(0.05, np.array([0.1, 0.2])),
    "model": PositionNoise(0.05, np.zeros(2), 0.03, np.array([0.2, 0.1])),
    "poses": PositionNoise(0.05, np.zeros(2), 0.03, turn=0.2, model_turn=0.1),
    "poses, joints": PositionNoise(0.05, np.array([0.1, 0.2]), turn=0.2),
    "changes": PositionNoise(0.05, np.zeros(2), 0.03, model_change=(0.02, 0.0)),
    "changes, joints": PositionNoise(0.05, np.array([0.1, 0.2]), 0.03, np.array([0.2, 0.1])),
    "tracker": PositionNoise(0.0, np.array([0.1, 0.2]), tracker=TRACKER),
    "poses, tracker": PositionNoise(0.05, np.zeros(2), turn=0.2, tracker=TRACKER),
    "changes, tracker": PositionNoise(0.02, np.array([0.1, 0.2]), 0.03, tracker=TRACKER),
}
Q = RNG.uniform(-1, 1, (5, 2))
VISITS = np.array([1.0, 3.0, 2.0, 1.0, 5.0])
WRENCH = np.array(LOAD, dtype=float) * np.array([1, 0, 1, 0, 1])[:, None]


def setting_of(name: str) -> StudyGeometry:
    """The arm with heavy links and a payload, whose positions or whose full poses are measured."""
    others = {"poses": FULL, "changes": CHANGES}
    return StudyGeometry.of(others.get(name.partition(",")[0], HEAVY))


def rows_with(name: str) -> PositionRows:
    """Rows with the noise of that name; plain ones without a noise."""
    setting = setting_of(name)
    markers = len(setting.model.markers)
    noise = NOISES[name].of_visits(setting.model.row_count * markers, markers)
    return PositionRows(setting.model, setting.loads, noise)


@pytest.mark.parametrize("name", ["white", "poses", "changes"])
def test_rows_are_those_of_the_model(name: str) -> None:
    """They are millimetres a unit; links bend the arm always, a payload where a load does."""
    setting = setting_of(name)
    assert setting.loads is not None
    model = setting.model
    torque = setting.loads(Q, WRENCH)
    differs = WRENCH.any(axis=1) & setting.reads_changes
    before = Load(setting.loads(Q[differs], 0 * WRENCH[differs]))
    seen = model.see(np.zeros(model.p), Q, LoadsOfReadings(Load(torque), differs, before))
    assert seen.jacobian is not None
    expected = 1e3 * (seen.jacobian * model.scales).reshape(5, -1, model.p)
    found = PositionRows(model, setting.loads)(Q, WRENCH)
    np.testing.assert_allclose(found, expected, atol=1e-11)


@pytest.mark.parametrize("name", NOISES)
def test_rows_are_whitened(name: str) -> None:
    """Their squares are those under the inverse covariance of a visit, one of several of a pose."""
    noise = NOISES[name]
    setting = setting_of(name)
    plain = PositionRows(setting.model, setting.loads)(Q, WRENCH)
    seen = setting.model.see(np.zeros(setting.model.p), Q)
    assert seen.by_joints is not None
    motion = seen.by_joints.reshape(5, -1, 2)
    worth = np.where(WRENCH.any(axis=1) & setting.reads_changes, 0.5, 1.0)
    k = len(setting.model.markers)
    V = noise.of_pose(motion, seen.places, np.repeat(worth[:, None], k, axis=1), worth < 1).dense
    expected = np.swapaxes(plain, 1, 2) @ np.linalg.solve(V, plain)
    A = rows_with(name)(Q, WRENCH)
    np.testing.assert_allclose(np.swapaxes(A, 1, 2) @ A, expected, rtol=1e-9, atol=1e-9)
    V = V + (VISITS - 1)[:, None, None] * noise.of_model(motion, worth < 1)
    expected = np.swapaxes(plain, 1, 2) @ np.linalg.solve(V, plain)
    A = rows_with(name)(Q, WRENCH, VISITS)
    np.testing.assert_allclose(np.swapaxes(A, 1, 2) @ A, expected, rtol=1e-9, atol=1e-9)


SHARE = {"model_error_percent": 20, "discrepancy_mm": 0.01, "repeatability_deg": 0.002}
GUESS = {"compliance_rad_per_Nm": {"q1": 4e-5, "q2": 9e-5}}


def rows_that_err(name: str) -> PositionRows:
    """Rows of a study that states a share of what springs do; of plain noises for other names."""
    if not name.startswith("share of "):
        return rows_with(name)
    study = {"positions": HEAVY, "poses": FULL, "changes": CHANGES}[name.removeprefix("share of ")]
    setting = StudyGeometry.of(study.replace(noise=SHARE, simulation=GUESS))
    return PositionRows(setting.model, setting.loads, planned_noise(setting))


@pytest.mark.parametrize("visits", [None, VISITS], ids=["one visit", "several"])
@pytest.mark.parametrize(
    "name", [*NOISES, "share of positions", "share of poses", "share of changes"]
)
def test_slopes_of_information(name: str, visits: Array | None) -> None:
    """Derivatives of <G, M> by the joints agree with differences, loads and noise included."""
    rows = rows_that_err(name)
    A = rows(Q, WRENCH, visits)
    G = RNG.normal(size=(A.shape[-1],) * 2)
    G = G + G.T
    found = rows.slopes(Q, WRENCH, 2 * A @ G, np.zeros((len(Q), 6, 0)), visits)
    for j in range(2):
        step = 1e-5 * np.eye(2)[j]
        higher, lower = (
            np.einsum("mrp,pq,mrq->m", own, G, own)
            for own in (rows(Q + step, WRENCH, visits), rows(Q - step, WRENCH, visits))
        )
        expected = (higher - lower) / 2e-5
        size = abs(expected).max()
        np.testing.assert_allclose(found[:, j], expected, atol=1e-6 * size)
