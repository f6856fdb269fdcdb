"""What a plan of whole experiments must obey, and how much plans within limits can have."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.design.linear_constraints import LinearConstraints
from edtk.system.typing import Array, Indices, Mask

# Part of the funds by which a sum of costs may exceed them: the rounding of such a sum.
ROUNDING_OF_FUNDS = 1e-12
MULTIPLIER_HALVINGS = 200  # of the interval of a multiplier, at most
NARROW = 1e-12  # relative width of that interval at which to end


@dataclass(frozen=True, eq=False)
class Limits:
    """The size of a plan, and what else restricts its new experiments.

    A plan chooses a candidate for each of m places. Without a given size a place may stay empty;
    the empty place then counts as one more candidate, number n, that tells and costs nothing.

    Attributes:
        m: Number of places for new experiments.
        base: Information (p, p) that every plan has: of kept experiments, and of the prior.
        most: How often each candidate may be chosen (n,); None for no limit.
        costs: Costs (n,) of one experiment each; None where they do not matter.
        funds: What the new experiments may cost together.
        sized: Whether all places must be filled.
        blocks: Sizes of the blocks that the places are divided into, in order; none for no blocks.
        block_variance: Variance of the blocks' effects, in units of the variance of the noise;
            infinite where nothing is known about them (fixed effects).
        linear: Further constraints on sums of the counts; None for none.
    """

    m: int
    base: Array
    most: Indices | None = None
    costs: Array | None = None
    funds: float = np.inf
    sized: bool = True
    blocks: tuple[int, ...] = ()
    block_variance: float = np.inf
    linear: LinearConstraints | None = None

    @property
    def restricts(self) -> bool:
        """Whether a candidate may be forbidden at a place by what the others hold."""
        return self.most is not None or self.costs is not None or self.linear is not None

    def rows(self, n: int) -> LinearConstraints:
        """All sums of n counts that are limited: given constraints, funds and size."""
        linear = LinearConstraints.none(n) if self.linear is None else self.linear
        if self.costs is not None:
            linear = linear.and_also(self.costs[None], -np.inf, self.funds, "cost_budget")
        least = self.m if self.sized else 0
        return linear.and_also(np.ones((1, n)), least, self.m, "size")

    def largest(self, n: int) -> Array:
        """How often each of n candidates may be chosen (n,)."""
        if self.most is None:
            return np.full(n, float(self.m))
        return np.minimum(self.most, self.m).astype(float)

    @cached_property
    def apart(self) -> "Limits":
        """The same without constraints on sums."""
        return replace(self, linear=None)

    @cached_property
    def prices(self) -> Array:
        """Costs (n + 1,) of the candidates and of the empty place."""
        assert self.costs is not None
        return np.append(self.costs, 0.0)

    @cached_property
    def block_of(self) -> Indices:
        """The block (m,) of each place."""
        return np.repeat(np.arange(len(self.blocks)), self.blocks)

    @cached_property
    def shares(self) -> Array:
        """What a block's own effect takes away (b,): a of ``X'X - a X'11'X``, see `Scatter`.

        The rows X of a block of n experiments have the covariance ``I + v 11'``, whose inverse is
        ``I - a 11'`` with ``a = v/(1 + n v)``; a is 1/n for an effect that nothing is known about.
        """
        sizes = np.array(self.blocks, dtype=float)
        return 1.0 / (1.0 / self.block_variance + sizes)

    def counts(self, places: Indices, n: int) -> Indices:
        """How often each of n candidates is chosen (b, n) at places (b, m)."""
        width = n + 1
        offsets = width * np.arange(len(places))[:, None]
        counted = np.bincount((places + offsets).ravel(), minlength=width * len(places))
        return counted.reshape(len(places), width)[:, :n]

    def spent(self, places: Indices) -> Array:
        """Costs (b,) of plans at places (b, m)."""
        return np.asarray(self.prices[places].sum(axis=1))

    def allowed(self, places: Indices, place: int | Indices, n: int) -> Mask | None:
        """Which candidates (b, n) may take a place of plans (b, m); None for all.

        The place is the same in all plans, or another one (b,) in each. Where a place may stay
        empty, its number n has the last column.
        """
        if not self.restricts:
            return None
        each = np.arange(len(places))
        old = places[each, place]
        mask = np.ones((len(places), n if self.sized else n + 1), dtype=bool)
        if self.most is not None:
            rest = places.copy()
            rest[each, place] = n
            mask[:, :n] &= self.counts(rest, n) < self.most
        if self.costs is not None:
            room = self.funds - self.spent(places) + self.prices[old]
            mask[:, :n] &= self.costs <= room[:, None] + ROUNDING_OF_FUNDS * abs(self.funds)
        if self.linear is not None:
            mask &= self._fitting(places, old)[:, : mask.shape[1]]
        return mask

    def beyond(self, places: Indices) -> Mask:
        """Which of the constraints on sums of counts plans (b, m) do not obey (k, b)."""
        assert self.linear is not None
        sums = self.kinds.columns[:, self.kinds.of[places]].sum(axis=-1)
        return ~self._within(sums)

    @cached_property
    def kinds(self) -> "Kinds":
        """Candidates told apart by the constraints on sums alone."""
        assert self.linear is not None
        return Kinds.of_columns(self.linear.C)

    def _fitting(self, places: Indices, old: Indices) -> Mask:
        """Which candidates (b, n + 1) keep sums of plans (b, m) within, in place of old (b,)."""
        kinds = self.kinds
        sums = kinds.columns[:, kinds.of[places]].sum(axis=-1) - kinds.columns[:, kinds.of[old]]
        fits: Mask = np.all(self._within(sums[:, :, None] + kinds.columns[:, None, :]), axis=0)
        return np.asarray(fits[:, kinds.of])

    def _within(self, sums: Array) -> Mask:
        """Whether sums (k, ...) of counts are within their limits, but for rounding."""
        linear = self.linear
        assert linear is not None
        shape = (-1, *[1] * (sums.ndim - 1))
        error = ROUNDING_OF_FUNDS * self.m * np.abs(linear.C).max(axis=1, initial=1e-300)
        low = (linear.low - error).reshape(shape)
        high = (linear.high + error).reshape(shape)
        return np.asarray((sums >= low) & (sums <= high))


@dataclass(frozen=True, eq=False)
class Kinds:
    """Candidates in kinds, of which each has one column of the constraints.

    Attributes:
        columns: Columns (k, s) of the kinds.
        of: The kind (n + 1,) of each candidate, and of the empty place, whose column is zero.
    """

    columns: Array
    of: Indices

    @classmethod
    def of_columns(cls, C: Array) -> "Kinds":
        """The kinds of candidates with columns C (k, n)."""
        every = np.column_stack([C, np.zeros(len(C))])
        columns, of = np.unique(every, axis=1, return_inverse=True)
        return cls(columns, of.ravel())


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
        if limits.linear is not None:
            return self._of_linear(gains, limits.linear)
        if limits.costs is None:
            return self._of_size(gains)
        if not limits.sized:
            return self._of_funds(gains)
        total, counts = self._of_size(gains)
        if counts @ limits.costs <= limits.funds:
            return total, counts
        return self._of_both(gains)

    def _of_linear(self, gains: Array, linear: LinearConstraints) -> tuple[float, Array]:
        """The bound of multipliers y of the constraints, which a linear program tells.

        ``s'n = (s - C'y)'n + y'C n``, and y'C n is at most the sum of y high where y is positive
        and of y low elsewhere. So whatever the program's solver says, the bound holds.
        """
        scale = float(np.abs(gains).max()) or 1.0
        rows = self.limits.rows(self.n)
        most = self.limits.largest(self.n)
        y, counts = rows.priced(gains / scale, np.zeros(self.n), most)
        y = scale * y[: len(linear)]
        free = Reachable(replace(self.limits, linear=None), self.n)
        value, nearly = free.largest(gains - y @ linear.C)
        return value + linear.at_most(y), nearly if counts is None else counts

    def _of_size(self, gains: Array) -> tuple[float, Array]:
        """The candidates of the largest gains, m in all."""
        limits = self.limits
        counts = np.zeros(self.n)
        if limits.most is None:
            best = int(gains.argmax())
            counts[best] = limits.m
            return float(limits.m * gains[best]), counts
        order = np.argsort(-gains, kind="stable")
        most = limits.largest(self.n)[order]
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
        for _ in range(MULTIPLIER_HALVINGS):
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
