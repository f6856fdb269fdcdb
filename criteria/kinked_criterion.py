"""Criteria that are a maximum, and the smooth criteria that approach them from above."""

from typing import Self

import numpy as np

from criteria.criterion import Criterion


class KinkedCriterion(Criterion):
    """A criterion that takes a largest eigenvalue or variance, so that its cost has kinks.

    A descent needs a smooth cost. It minimises `smoothed` criteria, one sharper than the other,
    that replace the maximum by a `soft_maximum`.

    Args:
        sharpness: Exponent of the soft maximum, above one; inf for the maximum itself.
    """

    smooth = False

    def __init__(self, sharpness: float = np.inf) -> None:
        self.sharpness = sharpness
        self.smooth = bool(np.isfinite(sharpness))

    def smoothed(self, sharpness: float) -> Self:
        """The same criterion with a soft maximum in place of the maximum."""
        return type(self)(sharpness)
