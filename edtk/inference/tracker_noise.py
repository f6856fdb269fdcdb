"""The noise of what a tracker measures in a sheet, on top of white noise."""

import numpy as np

from edtk.inference.correlated_noise import CorrelatedNoise, NoiseBlocks
from edtk.inference.groups_by_size import groups_by_size
from edtk.inference.measurements import Measurements
from edtk.inference.occurrence import occurrence
from edtk.inference.row_numbers import row_numbers
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.noise.tracker import Tracker
from edtk.model.sensors.distance import Distance
from edtk.model.sensors.one_row import OneRow
from edtk.model.sensors.pose_marker import COORDINATES
from edtk.system.typing import Array, Indices


def tracker_noise(
    model: ElastostaticModel, data: Measurements, tracker: Tracker, readings: int
) -> CorrelatedNoise:
    """Add the errors of a tracker to the white noise of measurements.

    The three coordinates of a marker hang together. Where each is a row of its own, those of one
    visit are a group; a coordinate that is there twice belongs to another reading of the marker.

    Args:
        model: Says what is measured; a tracker sees no distances, and its rotations are white.
        data: Poses, markers, visits and white noise.
        tracker: The tracker.
        readings: Readings whose difference or value a displacement is.

    Raises:
        NotPositiveDefiniteError: A measurement has no noise in some direction.
    """
    frames = model.frames(data.q)
    T = np.zeros((len(data), COORDINATES, COORDINATES))
    row = np.full(len(data), -1)  # of a single coordinate, in its marker's position
    marker = -1 - np.arange(len(data))  # rows that no tracker sees have errors of their own
    for members, sensor in data.instruments(model):
        instrument = sensor.whole if isinstance(sensor, OneRow) else sensor
        if isinstance(instrument, Distance) or not sensor.lengths.any():
            continue
        points = instrument.place(frames[members])
        T[members] = readings * tracker.covariance(points[None])[0].transpose(2, 0, 1)
        if isinstance(sensor, OneRow):
            row[members] = sensor.row
            assert data.sensor is not None
            marker[members] = data.sensor[members] - sensor.row  # index of its first row
    if data.sigma.shape[1] > 1:
        return _of_rows(CorrelatedNoise.of_any(data.noise, data.sigma.shape), T)
    return _of_coordinates(data, T, row, marker)


def _of_rows(white: CorrelatedNoise, T: Array) -> CorrelatedNoise:
    """Each row is a position, or a pose whose first coordinates are one."""
    own = white.among(np.arange(len(T))[:, None])[:, 0, :, 0]
    own[:, :COORDINATES, :COORDINATES] += T
    return CorrelatedNoise.by_row(own)


def _of_coordinates(data: Measurements, T: Array, row: Indices, marker: Indices) -> CorrelatedNoise:
    """Each row is a single coordinate, beside the others of its marker in a visit."""
    visit = data.visits[:, None]
    reading = occurrence(row_numbers(visit, marker[:, None], row[:, None]))
    group = row_numbers(visit, marker[:, None], reading[:, None])
    blocks = []
    for members in groups_by_size(group):
        at = row[members]
        shared = T[members[:, :1, None], at[:, :, None], at[:, None]]
        white = data.sigma[members] ** 2 * np.eye(at.shape[1])
        blocks.append(NoiseBlocks(members, shared + white))
    m, rows = data.sigma.shape
    return CorrelatedNoise.of(blocks, (m, rows))
