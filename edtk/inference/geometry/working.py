"""The covariance by which a fit weights the coordinates of a pose."""

import numpy as np

from edtk.inference.geometry.position_noise import white_kinds
from edtk.system.typing import Array

WHITE_SHARE = 0.5  # of the size of a pose's errors that weights count as white


def working(V: Array, rows: int = 3) -> Array:
    """The covariances (m, r, r) that weight the coordinates of a pose: V and half its size, white.

    Weights by V alone would trust what markers of a pose have in common as little as V says, and
    their shape as much. That is best where V is true. Real robots err in other ways too: of poses
    of two of them that were held out, weights by V alone predict up to a tenth worse from many
    poses, and equal weights up to a twentieth worse from few. Covariances of parameters are those
    of the estimate with these weights under V, so that they are right for any weights.

    Args:
        V: Covariances of the poses.
        rows: Coordinates of a marker: three, or six with its orientation, whose size is its own.
    """
    own = np.einsum("mrr->mr", V)
    white = np.zeros_like(own)
    for kind in white_kinds(rows, V.shape[1]):
        white += kind * (own @ kind / kind.sum())[:, None]
    return V + WHITE_SHARE * white[:, None] * np.eye(V.shape[1])
