"""What springs leave out of readings that are differences: the same pieces for any instrument."""

from dataclasses import replace

import numpy as np
import pytest
from mixed_sheets import MIXED, SPRINGS, K, readings, sheet, study_of, truth_of

import edtk
from edtk.calibration.model_left import _as_read, _instruments
from edtk.fit.fitted_geometry import loading_of
from edtk.fit.pose_rows import PoseRows
from edtk.measure.missing_pieces import MissingPieces
from edtk.study.study_geometry import StudyGeometry

VISITS = 16
EVERY = np.ones(VISITS, dtype=bool)
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


def data_of(one, sigma=0.02, across=0.0):
    """What is read of it; springs across all joints are of a share of these."""
    data = readings(one, truth_of(one, 0.0), VISITS, EVERY, EVERY, sigma_mm=sigma, seed=3)
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
