"""The duals of two inequalities, from their difference."""

import numpy as np

from criteria.spectral_band import SpectralBand
from edtk.system.typing import Array


def definite_duals(band: SpectralBand, C: Array, near: Array) -> Array:
    """Duals Y and Z (c, p, p) of the inequalities of a band, of which ``Y - Z`` is a multiplier.

    At an optimum they have no direction in common where the ceiling is the identity, so that they
    are the positive and the negative part of the multiplier. Z gets the length that the equation
    ``<Z, C> = a`` asks for; that of Y is open.

    Args:
        band: The program.
        C: Whitener (p, p) of its ceiling.
        near: The multiplier (p, p).

    Returns:
        Y, and Z where there is an upper bound.
    """
    S = np.linalg.inv(C)
    z, V = np.linalg.eigh(S @ near @ S.T)
    F = C @ V
    above = (F * np.maximum(z, 0.0)) @ F.T
    if not band.a:
        return above[None]
    below = (F * np.maximum(-z, 0.0)) @ F.T
    length = float(np.vdot(below, band.ceiling))
    # A multiplier without negative part says nothing about the upper bound: all directions alike.
    if length <= 0:
        below = C @ C.T
        length = float(len(C))
    return np.stack([above, below * (band.a / length)])
