"""A fault that was tried on measurements."""

import math
from dataclasses import dataclass

from edtk.calibration.causes.cause import Cause
from edtk.calibration.causes.family import Family
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Tried:
    """A fault that was tried: its deviance, and what is to be said of it.

    Attributes:
        cause: The fault with its size; p is that of its own test.
        deviance: Twice the negative logarithm of the likelihood: the sum of squares that is left.
        dims: Number of its parameters.
        tries: How many faults of the same kind there are: one a joint, one a pose; less
            where this one is likelier than the others.
        rarity: What the parameters cost where their usual size is known, see `rarity`.
        family: The family that it is one of; None for faults of single rows and of noise.
        size: Size of the fault (dims,) in that family, SI; None without one.
    """

    cause: Cause
    deviance: float
    dims: int
    tries: float
    rarity: float | None = None
    family: Family | None = None
    size: Array | None = None

    def score(self, coordinates: int) -> float:
        """Deviance, with what the parameters and the alternatives of the same kind cost.

        Parameters without a usual size cost as in Bayes' information criterion.
        """
        rarity = self.dims * math.log(coordinates) if self.rarity is None else self.rarity
        return self.deviance + rarity + 2 * math.log(self.tries)
