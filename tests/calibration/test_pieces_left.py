"""What springs leave out of readings under loads: the same pieces for any instrument."""

from dataclasses import replace

import numpy as np
import pytest
from mixed_sheets import LOAD, MIXED, SPRINGS, TOOL, K, readings, sheet, study_of, truth_of

import edtk
from edtk.calibration.model_left import _as_read, _instruments
from edtk.fit.fitted_geometry import loading_of
from edtk.fit.pose_rows import PoseRows
from edtk.measure.missing_pieces import MissingPieces
from edtk.study.study_geometry import StudyGeometry

VISITS = 16
UNLOADED = {"reference": "unloaded"}
KNOWN = {"load_direction_deg": 0}
KINDS = {
    "positions": {},
    "any": MIXED | {"measurement": MIXED["measurement"] | UNLOADED},
}


def study(kind="positions", **keys):
    """A study of springs that reads differences of all visits."""
    changes = {"measurement": UNLOADED, "uncertainty": KNOWN} | KINDS[kind] | keys
    return study_of(SPRINGS, **changes)


def data_of(one, sigma=0.02, across=0.0, visits=VISITS, differs=True):
    """What is read of it; springs across all joints are of a share of these.

    Of absolute readings each second one is under the load.
    """
    loaded = (np.arange(visits) % 2 == 0) | differs
    every = np.full(visits, differs)
    data = readings(one, truth_of(one, 0.0), visits, every, loaded, sigma_mm=sigma, seed=3)
    setting = StudyGeometry.of(one)
    columns = pieces_of(setting, data)[1].across[..., :12] @ np.full(12, across)
    moved = _as_read(setting.model, columns[..., None]).reshape(*data.seen.shape, -1)
    return replace(data, measured=data.measured + moved[..., :3])


def pieces_of(setting, data):
    """The pieces of a sheet, and their columns as instruments show them in the world."""
    model = replace(setting.loads.by_wrench, sensors=_instruments(setting.model))
    k = np.zeros(6)
    k[[1, 2, 4]] = list(K.values())
    pieces = MissingPieces.of(model.robot, k, model.torque_of(model.frames(data.q), data.wrench).T)
    return pieces, pieces.columns(model, data.q, data.wrench)


@pytest.mark.parametrize("kind", KINDS)
def test_pieces_are_read_as_springs_are(kind):
    """Springs that turn once more move each reading as the model's joints do, in its own rows.

    Positions and orientations are in the axes of the instrument, and distances in none.
    """
    one = study(kind)
    data = data_of(one)
    setting = StudyGeometry.of(one)
    start = np.eye(4)
    start[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    model = replace(setting.model, start=start)
    pieces, columns = pieces_of(setting, data)
    theta = np.zeros(model.p)
    torque = loading_of(model.bending(theta), data, setting.loads)
    motion = PoseRows.of(model, theta, data, torque).motion
    bent = pieces.k * columns.torque
    found = _as_read(model, columns.turns)
    assert found.shape == motion.shape
    np.testing.assert_allclose(found, motion * bent[:, None], atol=2e-5 * np.abs(found).max())


@pytest.mark.parametrize("kind", KINDS)
def test_any_difference_tells_pieces(kind):
    """Positions, orientations and distances tell springs across the joints, and ideal springs."""
    one = study(kind)
    bent = edtk.identify(one, sheet(data_of(one, across=0.2)))
    ideal = edtk.identify(one, sheet(data_of(one)))
    assert 5 < bent.to_dict()["model_error"]["across_percent"] < 40
    assert ideal.to_dict()["model_error"]["across_percent"] < 2


def test_what_is_known_of_a_spring_is_a_row_of_no_pose():
    """Knowledge that says nothing changes nothing; what says all leaves a spring as it is known."""
    one = study()
    data = sheet(data_of(one, across=0.1))
    alone = edtk.identify(one, data).pieces
    for std, same in ((1e-2, True), (1e-12, False)):
        q2 = {"kind": "normal", "mean_rad_per_Nm": K["q2"], "std_rad_per_Nm": std}
        told = edtk.identify(one.replace(prior={"joints": {"q2": q2}}), data).pieces
        i = told.names.index("k_q2") - len(told.names)
        errors = np.sqrt(told.possible.covariance[:, i, i])
        if same:
            np.testing.assert_allclose(told.possible.mean, alone.possible.mean, rtol=1e-4)
            np.testing.assert_allclose(told.possible.weights, alone.possible.weights, atol=1e-4)
        else:
            unit = StudyGeometry.of(one).model.scales[i]
            np.testing.assert_allclose(unit * errors, std, rtol=1e-6)


@pytest.mark.parametrize("drawing_mm", [0.0, 0.3])
def test_absolute_readings_tell_pieces_from_the_drawing(drawing_mm):
    """What springs lack grows with the load, and errors of the drawing do not; one error is said.

    The budget of the calibration and the compensation of the test pose name the same size.
    """
    asked = SPRINGS | {"base": True, "tool": True}
    goal = {"q_deg": [10, -50, 60, 20, 40, 0], "tool": TOOL, "load": {"F_N": LOAD}}
    one = study_of(asked, uncertainty=KNOWN, test_pose=goal)
    across = 0.2 if drawing_mm == 0 else 0.0
    data = data_of(one, across=across, visits=2 * VISITS, differs=False)
    rng = np.random.default_rng(4)
    data = replace(data, measured=data.measured + 1e-3 * drawing_mm * _shifts(rng, data))
    found = edtk.identify(one, sheet(data))
    shares = found.to_dict()["model_error"]
    if across:
        assert found.pieces.drawing == 0
        assert 10 < shares["across_percent"] < 40
    else:
        assert found.pieces.drawing >= 0.5
        assert not any(shares.values())
    left = edtk.compensate(one, found).remaining
    np.testing.assert_allclose(left[0], found.budget.total, rtol=1e-2)


def _shifts(rng, data):
    """Errors (m, k, 3) of a pose that its markers share, of size one."""
    return np.repeat(rng.normal(size=(len(data), 1, 3)), data.seen.shape[1], axis=1)
