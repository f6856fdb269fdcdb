"""Limits on the counts of a relaxation as a certificate states them, and sums of sensitivities."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.plain_data import number, numbers, rows, table
from edtk.system.typing import Array

EPS = float(np.finfo(float).eps)
MOST_ROWS = 1000
WITHIN = 1e-6  # part of a limit, or of one experiment, by which rounding may exceed it


@dataclass(frozen=True, eq=False)
class WeightLimits:
    """Counts n with ``least <= n <= most``, ``low <= C n <= high``, and a sum or none.

    Attributes:
        C: Coefficients (k, n).
        low: Least sums (k,).
        high: Largest sums (k,).
        least: Least counts (n,).
        most: Largest counts (n,).
        size: Their sum; None for any.
        duals: Multipliers (r, k) of the sums, of any signs, where the largest sensitivity is one.
    """

    C: Array
    low: Array
    high: Array
    least: Array
    most: Array
    size: float | None
    duals: Array

    @classmethod
    def from_dict(cls, given: Any, duals: Any, n: int, multipliers: int) -> "WeightLimits":
        """Read the limits on n counts, of which nothing is believed.

        Raises:
            ValueError: They are not such limits; one line says where.
        """
        table(given, ("size", "least", "most", "constraints"), "limits")
        stated = rows(given["constraints"], MOST_ROWS, "limits.constraints")
        C = np.zeros((len(stated), n))
        low = np.full(len(stated), -math.inf)
        high = np.full(len(stated), math.inf)
        for k, one in enumerate(stated):
            where = f"limits.constraints[{k}]"
            table(one, ("coefficients", "least", "largest"), where)
            C[k] = numbers(one["coefficients"], (n,), f"{where}.coefficients")
            if one["least"] is not None:
                low[k] = number(one["least"], f"{where}.least")
            if one["largest"] is not None:
                high[k] = number(one["largest"], f"{where}.largest")
        least = numbers(given["least"], (n,), "limits.least")
        most = numbers(given["most"], (n,), "limits.most")
        size = None if given["size"] is None else number(given["size"], "limits.size")
        if not ((least >= 0) & (least <= most)).all() or (size is not None and not size > 0):
            raise ValueError("limits: expected 0 <= least <= most, and a size above 0")
        own = numbers(duals, (multipliers, len(C)), "limit_multipliers")
        return cls(C, low, high, least, most, size, own)

    @property
    def unit(self) -> float:
        """Of how many experiments the information is told."""
        return 1.0 if self.size is None else self.size

    def broken(self, counts: Array) -> str:
        """Which limit counts (n,) do not obey; empty if they obey all."""
        some = WITHIN * max(1.0, float(counts.sum()))
        if (counts < self.least - some).any() or (counts > self.most + some).any():
            return "a count is below its least or above its largest"
        if self.size is not None and abs(counts.sum() - self.size) > some:
            return f"expected {self.size:g} experiments"
        sums = self.C @ counts
        room = WITHIN * (np.abs(self.C) @ counts)
        outside = np.flatnonzero((sums < self.low - room) | (sums > self.high + room))
        return f"constraint {outside[0]} is not obeyed" if len(outside) else ""

    def largest(self, t: Array) -> Array:
        """What sums of sensitivities t (r, n), rounded up, are at most (r,), for one unit.

        For any multipliers y of the sums ``t'n <= (t - C'y)'n + sum_k max(y_k low_k, y_k high_k)``.
        """
        return np.array([self._sum(*one) for one in zip(t, self.duals, strict=True)]) / self.unit

    def _sum(self, t: Array, duals: Array) -> float:
        """The same for one multiplier."""
        y = duals * float(t.max())
        gains = t - y @ self.C
        counts = self.least.copy()
        if self.size is None:
            counts[gains > 0] = self.most[gains > 0]
        else:
            order = np.argsort(-gains)
            left = self.size - self.least.sum()
            for i in order:
                more = min(left, self.most[i] - self.least[i])
                counts[i] += more
                left -= more
                if left <= 0:
                    break
        ends = np.where(y > 0, self.high, np.where(y < 0, self.low, 0.0))
        told = y * np.where(y == 0, 0.0, ends)
        sizes = (np.abs(t) + np.abs(y) @ np.abs(self.C)) @ counts + np.abs(told).sum()
        return float(gains @ counts + told.sum() + 4 * EPS * (len(t) + len(y)) * sizes)
