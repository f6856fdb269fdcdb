"""The multipliers of a bound with all their digits."""

from dataclasses import dataclass

import numpy as np

from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class InnerProof:
    """Multipliers Z' of the information about parameters k' with ``k = T k'``.

    As multipliers of k they are ``T Z' T'``. Where parameters are nearly dependent, these entries
    cancel in every sensitivity, and only T and Z' apart keep the digits.

    Attributes:
        T: Regular matrix (p, p).
        Z: Symmetric multipliers (r, p, p).
    """

    T: Array
    Z: Array

    def outward(self) -> Array:
        """The multipliers (r, p, p) of k."""
        found = self.T @ self.Z @ self.T.T
        return np.asarray(0.5 * (found + np.swapaxes(found, 1, 2)))
