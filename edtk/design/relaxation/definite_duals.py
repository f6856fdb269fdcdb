"""The duals of two inequalities, from their difference."""

import numpy as np

from criteria.spectral_band import SpectralBand
from edtk.system.typing import Array


def definite_duals(band: SpectralBand, near: Array) -> Array:
    """Duals Y and Z (c, p, p) of the inequalities of a band, of a multiplier ``Y - R Z R'``.

    At an optimum ``R^-1 Y R^-T`` and Z have no direction in common where the floor is the identity
    too, so that they are the positive and the negative part of ``R^-1 near R^-T``. Z gets the trace
    a that its equation asks for; the length of Y is open.

    Args:
        band: The program.
        near: The multiplier (p, p).

    Returns:
        Y, and Z where there is an upper bound.
    """
    S = np.linalg.inv(band.cap)
    z, V = np.linalg.eigh(S @ near @ S.T)
    F = band.cap @ V
    above = (F * np.maximum(z, 0.0)) @ F.T
    if not band.a:
        return above[None]
    below = (V * np.maximum(-z, 0.0)) @ V.T
    length = float(np.trace(below))
    # A multiplier without negative part says nothing about the upper bound: all directions alike.
    if length <= 0:
        below = np.eye(len(V))
        length = float(len(V))
    return np.stack([above, below * (band.a / length)])
