"""The multipliers of a certificate, and the sensitivities that they give to experiments."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from edtk.certificate.recompute.plain_data import numbers, rows
from edtk.system.typing import Array

INDEFINITE = ("O2", "O4")  # criteria whose multipliers may have negative eigenvalues
MOST_MULTIPLIERS = 100  # O4 has up to 60, every other criterion one
SYMMETRIC = 1e-9  # difference across the diagonal, beside the largest entry, that is rounding
NEGATIVE = 1e-9  # size of a negative eigenvalue, at unit diagonal, that is rounding
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Symmetric matrices Z (r, p, p), of which nothing is believed.

    A multiplier proves a bound whatever it is, but rounding could be exploited: in a sensitivity
    whose terms cancel, or by an eigenvalue just below zero. So sensitivities are rounded up, by
    more than any rounding error, and what the bounds take from Z is rounded down.

    Attributes:
        Z: The matrices; positive semidefinite but for rounding, unless the criterion allows others.
        indefinite: Whether it does.
    """

    Z: Array
    indefinite: bool

    @classmethod
    def from_list(cls, value: Any, name: str, p: int) -> "Multipliers":
        """Read the multipliers of a criterion with p parameters.

        Raises:
            ValueError: They are not finite, of another shape, not symmetric or not semidefinite.
        """
        rows(value, MOST_MULTIPLIERS, "proof.multipliers")
        Z = numbers(value, (None, p, p), "proof.multipliers")
        if not len(Z):
            raise ValueError("proof.multipliers: expected at least one")
        # Any length proves the same; a length of 1e-320 would round sensitivities to nothing. A
        # power of two changes no digit.
        _, exponent = np.frexp(np.abs(Z).max(axis=(1, 2), keepdims=True))
        Z = np.ldexp(Z, -exponent)
        transposed = np.swapaxes(Z, 1, 2)
        size = np.abs(Z).max(axis=(1, 2), keepdims=True)
        if not (np.abs(Z - transposed) <= SYMMETRIC * size).all():
            raise ValueError("a multiplier is not symmetric")
        # Eigenvalues are taken from one triangle only, so that both have to be the same.
        found = cls((Z + transposed) / 2, name in INDEFINITE)
        if not found.indefinite and not (found._lowest >= -NEGATIVE * p).all():
            raise ValueError("a multiplier is not positive semidefinite")
        return found

    @cached_property
    def scale(self) -> Array:
        """Numbers (r, p) so large that ``|Z_ab|`` is at most ``s_a s_b``."""
        if self.indefinite:
            norm = np.abs(np.linalg.eigvalsh(self.Z)).max(axis=1)
            return np.asarray(np.sqrt(norm)[:, None] * np.ones(self.Z.shape[-1]))
        return np.asarray(np.sqrt(np.maximum(np.diagonal(self.Z, axis1=1, axis2=2), 0.0)))

    @cached_property
    def _lowest(self) -> Array:
        """Least eigenvalue (r,) of each multiplier at unit diagonal."""
        scale = np.where(self.scale > 0, self.scale, 1.0)
        unit = self.Z / scale[:, :, None] / scale[:, None]
        return np.asarray(np.linalg.eigvalsh(unit)[:, 0], dtype=float)

    @cached_property
    def _allowance(self) -> Array:
        """What a sensitivity is rounded up by (r,), per square of the largest that it can be.

        Sixteen roundings, and the lift that makes a multiplier positive semidefinite.
        """
        lift = 0.0 if self.indefinite else np.maximum(-self._lowest, 0.0)
        return np.asarray(16 * EPS + lift) * np.ones(len(self.Z))

    def sensitivities(self, rows: Array, prior: Array, per_trace: bool) -> Array:
        """``<Z_j, M_i + M0>`` (r, k), rounded up.

        Args:
            rows: Whitened rows (k, measured, p) of the experiments i.
            prior: Prior information M0 (p, p).
            per_trace: Whether to divide by the trace of ``M_i + M0``.
        """
        k, measured, p = rows.shape
        flat = rows.reshape(-1, p)
        found = np.empty((len(self.Z), k))
        for j, Z in enumerate(self.Z):
            each = np.einsum("ia,ia->i", flat @ Z, flat)
            # |<Z, M>| is at most the square of this sum, whatever the signs of its terms.
            reach = (np.abs(flat) @ self.scale[j]) ** 2
            each += self._allowance[j] * reach
            own = (Z * prior).sum()
            most = float(self.scale[j] @ np.sqrt(np.diag(prior))) ** 2
            found[j] = each.reshape(k, measured).sum(axis=1) + own + self._allowance[j] * most
        if per_trace:
            found /= np.einsum("ia,ia->i", flat, flat).reshape(k, measured).sum(axis=1) + np.trace(
                prior
            )
        return found
