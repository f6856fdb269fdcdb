"""Limits on the weights of a relaxation."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from criteria.linalg.inverse import EPS
from edtk.design.linear_constraints import LinearConstraints
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class WeightLimits:
    """What counts n of candidates, whole or not, must obey.

    ``least <= n <= most`` and ``low <= C n <= high``, and their sum is the size. Without a size the
    constraints alone, such as budgets, limit it.

    Attributes:
        rows: The constraints on sums of counts.
        least: Least counts (n,).
        most: Largest counts (n,), all finite.
        size: The sum of the counts; None where it is free.
    """

    rows: LinearConstraints
    least: Array
    most: Array
    size: float | None

    @property
    def unit(self) -> float:
        """Of how many experiments the information is told: one, or all where these are free."""
        return 1.0 if self.size is None else self.size

    @property
    def program(self) -> LinearConstraints:
        """The constraints on sums with that on the size, for a linear program."""
        if self.size is None:
            return self.rows
        return self.rows.and_also(np.ones((1, len(self.least))), self.size, self.size, "size")

    def largest(self, gains: Array) -> tuple[float, Array, Array]:
        """The largest ``gains @ n`` (n,), not below the truth by any rounding.

        By the multipliers y of a linear program, whatever its solver says:

            s'n = (s - C'y)'n + y'C n <= max_n (s - C'y)'n + sum_k max(y_k low_k, y_k high_k) ,

        the maximum over counts that obey least, most and size alone.

        Returns:
            The value, the multipliers (k,), and counts (n,) that come near it.
        """
        if not len(self.rows):
            counts = self._best(gains)
            return self._bound(gains, np.zeros(0), counts), np.zeros(0), counts
        scale = float(np.abs(gains).max()) or 1.0
        y, counts_found = self.program.priced(gains / scale, self.least, self.most)
        y = scale * y[: len(self.rows)]
        nearly = self._best(gains - y @ self.rows.C)
        value = self._bound(gains, y, nearly)
        return value, y, nearly if counts_found is None else counts_found

    def largest_of(self, sensitivities: Array) -> Array:
        """The largest sums (r,) of sensitivities (r, n), for one unit of experiments."""
        return np.array([self.largest(gains)[0] for gains in sensitivities]) / self.unit

    def _best(self, gains: Array) -> Array:
        """The counts (n,) of the largest sum of gains among those of least, most and size alone."""
        if self.size is None:
            return np.where(gains > 0, self.most, self.least)
        order = np.argsort(-gains, kind="stable")
        room = (self.most - self.least)[order]
        left = self.size - self.least.sum()
        counts = self.least.copy()
        counts[order] += np.clip(left - (np.cumsum(room) - room), 0.0, room)
        return counts

    def _bound(self, gains: Array, y: Array, counts: Array) -> float:
        """The bound of multipliers y (k,), with the counts (n,) that are best for them."""
        value = float((gains - y @ self.rows.C) @ counts) + self.rows.at_most(y)
        sizes = (np.abs(gains) + np.abs(y) @ np.abs(self.rows.C)) @ counts
        return value + 2 * EPS * (len(gains) + len(y)) * float(sizes)

    def to_dict(self) -> dict[str, Any]:
        """The limits as plain data for JSON."""
        return {
            "size": self.size,
            "least": self.least.tolist(),
            "most": self.most.tolist(),
            "constraints": [
                {"coefficients": row.tolist(), "least": _finite(low), "largest": _finite(high)}
                for row, low, high in zip(self.rows.C, self.rows.low, self.rows.high, strict=True)
            ],
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "WeightLimits":
        """Restore what `to_dict` has written."""
        least = np.array(data["least"], dtype=float)
        rows = LinearConstraints.none(len(least))
        for number, one in enumerate(data["constraints"]):
            low = -np.inf if one["least"] is None else float(one["least"])
            high = np.inf if one["largest"] is None else float(one["largest"])
            row = np.array(one["coefficients"], dtype=float)
            rows = rows.and_also(row[None], low, high, f"constraints[{number}]")
        size = None if data["size"] is None else float(data["size"])
        return cls(rows, least, np.array(data["most"], dtype=float), size)


def _finite(limit: float) -> float | None:
    """A limit; None for an infinite one."""
    return float(limit) if np.isfinite(limit) else None
