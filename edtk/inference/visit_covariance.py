"""The covariance of a sheet's measurements: tracker, joints that move a visit, discrepancy."""

import numpy as np

from edtk.inference.correlated_noise import CorrelatedNoise, NoiseBlocks
from edtk.inference.groups_by_size import groups_by_size
from edtk.inference.measurements import Measurements
from edtk.inference.whiten import RowNoise
from edtk.system.typing import Array

# Coordinates of one group. Its matrix is factored some dozen times in a calibration, each in a time
# that grows with the cube: on one core 0.04 s for these, 0.5 s for 1500.
MOST_COORDINATES = 600


class TooManyVisitsError(ValueError):
    """A group of measurements that hang together is too large.

    Attributes:
        row: One of its measurements, counted from 0.
        count: Number of them.
        most: How many there may be.
    """

    def __init__(self, row: int, count: int, most: int) -> None:
        super().__init__(row, count, most)
        self.row = row
        self.count = count
        self.most = most

    def __str__(self) -> str:
        return (
            f"row {self.row + 1}: {self.count} measurements share an error; "
            f"expected {self.most} at most"
        )


def visit_covariance(
    data: Measurements, tracker: RowNoise, motion: Array, discrepancy: Array
) -> CorrelatedNoise:
    """Covariances ``T + M M'`` within a visit, and ``d d'`` among all visits of a pose.

    Each measurement has tracker noise T of its own, or shares it with the other coordinates that
    its instrument shows in a visit. The motions M, of joints with their standard
    deviations, are common to all measurements of a visit; the discrepancy d of a marker in a pose,
    under a load, is common to all visits, each coordinate by itself.

    Args:
        data: Poses, loads, markers and visits; measured values are not used.
        tracker: Noise of each measurement by itself, or of those of a visit that one instrument
            makes.
        motion: Motions (m, rows, c) by independent errors of size one [m, rad].
        discrepancy: Standard deviations (m, rows) of the model's errors [m, rad].

    Raises:
        NotPositiveDefiniteError: Without tracker noise in some direction.
        TooManyVisitsError: A pose is visited more often than a computer likes.
    """
    m, rows = data.sigma.shape
    own = CorrelatedNoise.of_any(tracker, (m, rows))
    group = data.pose if discrepancy.any() else data.visits
    blocks = []
    for members in groups_by_size(group):
        G, s = members.shape
        if s * rows > MOST_COORDINATES:
            raise TooManyVisitsError(int(members[0, 0]), s, MOST_COORDINATES // rows)
        whole = own.among(members)
        M = motion[members]
        together = data.visits[members][:, :, None] == data.visits[members][:, None]
        moved = np.einsum("gsrc,gtqc->gsrtq", M, M)
        whole += moved * together[:, :, None, :, None]
        d = discrepancy[members]
        shared = data.places[members][:, :, None] == data.places[members][:, None]
        common = np.einsum("gsr,gtr,gst->gstr", d, d, shared)
        axis = np.arange(rows)
        whole[:, :, axis, :, axis] += np.moveaxis(common, -1, 0)
        blocks.append(NoiseBlocks(members, whole.reshape(G, s * rows, s * rows)))
    return CorrelatedNoise.of(blocks, (m, rows))


def own_covariance(noise: RowNoise, shape: tuple[int, int]) -> Array:
    """Covariances (m, rows, rows) of measurements by themselves [m, rad]^2."""
    m, rows = shape
    if not isinstance(noise, CorrelatedNoise):
        return noise[:, :, None] ** 2 * np.eye(rows)
    found = np.empty((m, rows, rows))
    for block in noise.blocks:
        G, s = block.members.shape
        by_row = block.covariance.reshape(G, s, rows, s, rows)
        found[block.members] = np.moveaxis(np.diagonal(by_row, axis1=1, axis2=3), -1, 1)
    return found
