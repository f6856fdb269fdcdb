"""How much the plans within limits can have of a number that every experiment adds to."""

from dataclasses import dataclass

import numpy as np

from edtk.design.exact.counts.limits import Limits
from edtk.system.typing import Array

HALVINGS = 200  # of the interval of a multiplier, at most
NARROW = 1e-12  # relative width of that interval at which to end


@dataclass(frozen=True, eq=False)
class Reachable:
    """Counts n of candidates within limits, whole or not: ``0 <= n <= most``, their sum, and costs.

    Attributes:
        limits: The limits.
        n: Number of candidates.
    """

    limits: Limits
    n: int

    def largest(self, gains: Array) -> tuple[float, Array]:
        """The largest sum of gains (n,), and counts (n,) that come near it.

        With funds and a size together, ``sum s_i n_i <= q f + max_n sum (s_i - q c_i) n_i`` for the
        multiplier q of the funds: whatever q is, the bound holds, and the best q is searched for.
        """
        limits = self.limits
        if limits.costs is None:
            return self._of_size(gains)
        if not limits.sized:
            return self._of_funds(gains)
        total, counts = self._of_size(gains)
        if counts @ limits.costs <= limits.funds:
            return total, counts
        return self._of_both(gains)

    def _most(self) -> Array:
        """How often each candidate may be chosen (n,)."""
        if self.limits.most is None:
            return np.full(self.n, float(self.limits.m))
        return np.minimum(self.limits.most, self.limits.m).astype(float)

    def _of_size(self, gains: Array) -> tuple[float, Array]:
        """The candidates of the largest gains, m in all."""
        limits = self.limits
        counts = np.zeros(self.n)
        if limits.most is None:
            best = int(gains.argmax())
            counts[best] = limits.m
            return float(limits.m * gains[best]), counts
        order = np.argsort(-gains, kind="stable")
        most = self._most()[order]
        counts[order] = np.clip(limits.m - (np.cumsum(most) - most), 0.0, most)
        return float(gains @ counts), counts

    def _of_funds(self, gains: Array) -> tuple[float, Array]:
        """The candidates of the largest gains for their costs, until the funds are spent."""
        costs = self.limits.costs
        assert costs is not None
        # A candidate without a limit of its own is limited by the funds alone.
        most = np.inf if self.limits.most is None else self.limits.most
        most = np.minimum(most, self.limits.funds / costs)
        order = np.argsort(-gains / costs, kind="stable")
        price = (costs * most)[order]
        spent = np.clip(self.limits.funds - (np.cumsum(price) - price), 0.0, price)
        counts = np.zeros(self.n)
        counts[order] = spent / costs[order]
        counts = np.where(gains > 0, counts, 0.0)
        return float(gains @ counts), counts

    def _of_both(self, gains: Array) -> tuple[float, Array]:
        """The best multiplier of the funds by bisection, and a mixture of plans on both sides."""
        costs = self.limits.costs
        funds = self.limits.funds
        assert costs is not None
        low, high = 0.0, 1.0
        while self._of_size(gains - high * costs)[1] @ costs > funds and high < 1e300:
            low, high = high, 4 * high * max(1.0, float(np.ptp(gains)))
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if self._of_size(gains - middle * costs)[1] @ costs > funds:
                low = middle
            else:
                high = middle
            if high - low <= NARROW * high:
                break
        dear = self._of_size(gains - low * costs)[1]
        value, cheap = self._of_size(gains - high * costs)
        above = dear @ costs - funds
        below = funds - cheap @ costs
        share = below / (above + below) if above + below > 0 else 0.0
        return value + high * funds, share * dear + (1 - share) * cheap
