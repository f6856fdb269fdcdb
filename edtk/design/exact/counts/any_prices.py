"""Prices for every criterion, and for candidates of any number of rows."""

from dataclasses import dataclass, field, replace

import numpy as np

from criteria import Criterion
from edtk.design.exact.counts.counts_bound import Scatter
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.prices import (
    Prices,
    Pricing,
    first_few_largest,
    first_of_largest,
    least_gain,
)
from edtk.design.exact.exchange_costs import exchange_costs
from edtk.system.typing import Array, Indices, Mask

ENTRIES_UPDATED = 400_000  # entries of matrices that are updated together
PLANS_AT_ONCE = 64  # plans
SHORTLISTS = (16, 64)  # numbers of candidates that are tried first, then next
# Soft maximum whose gradient ranks the candidates for a criterion with kinks. A subgradient of the
# criterion itself would rank them by one of several equal eigenvalues alone.
GUIDE_SHARPNESS = 30.0


@dataclass(frozen=True, eq=False)
class AnyPricing(Pricing):
    """Costs of exchanges by low-rank updates of the covariance, see `exchange_costs`.

    Candidates of large sensitivity are tried first, all of them only when those no longer help.

    Attributes:
        criterion: The criterion to minimise.
        scatter: The candidates' rows; a candidate of zeros at the end stands for an empty place.
        mean: Mean information (p, p) of the candidates.
        thorough: Whether all candidates are tried at last.
    """

    criterion: Criterion
    scatter: Scatter
    mean: Array
    thorough: bool = field(default=True, kw_only=True)
    guide: Pricing | None = field(default=None, kw_only=True)
    kicks = 2
    patience = 32

    def effort(self, limits: Limits) -> float:
        """Some ten sweeps over short lists, and a few over all candidates, with p^2 for each."""
        n = self.scatter.n
        return 20.0 * limits.m * (SHORTLISTS[0] + n) * self.rows * self.entries

    @property
    def limits(self) -> Limits:
        """What a plan must obey."""
        return self.scatter.limits

    @property
    def candidates(self) -> int:  # type: ignore[override]
        """Number of candidates without the empty place."""
        n = self.scatter.n
        return n if self.limits.sized else n - 1

    @property
    def batch(self) -> int:  # type: ignore[override]
        """Number of plans whose shortlists are priced together."""
        return int(min(PLANS_AT_ONCE, max(1, ENTRIES_UPDATED // (SHORTLISTS[0] * self.entries))))

    @property
    def rows(self) -> int:
        """Number of rows of a candidate."""
        return self.scatter.rows.shape[1]

    @property
    def entries(self) -> int:
        """Number of entries of a plan's information that are not always zero."""
        return self.mean.size

    @property
    def rounds(self) -> tuple[int, ...]:  # type: ignore[override]
        """Lengths of the shortlists, the last one of all candidates."""
        n = self.scatter.n
        short = tuple(size for size in SHORTLISTS if size < n)
        return (*short, n) if self.thorough or not short else short

    def brief(self) -> "AnyPricing":
        """Prices that look at shortlists only."""
        return replace(self, thorough=False)

    def information(self, places: Indices, ridge: float) -> Array:
        """Information (b, p, p) of plans (b, m)."""
        M = self.scatter.information(places)
        return M + ridge * self.limits.m * self.mean if ridge else M

    def scores(self, places: Indices, ridge: float) -> Array:
        """The costs."""
        return np.asarray(self.criterion.cost(self.information(places, ridge))).reshape(-1)

    def prices(self, places: Indices, ridge: float, size: int) -> "AnyPrices":
        """Prices of plans (b, m) for the candidates of largest sensitivity."""
        return AnyPrices(self, places.copy(), ridge, size)


class AnyPrices(Prices):
    """Prices of plans on their way, see `AnyPricing`."""

    def __init__(self, pricing: AnyPricing, places: Indices, ridge: float, size: int) -> None:
        self.pricing = pricing
        self.places = places
        self.ridge = ridge
        self.part = least_gain(ridge)
        self.size = size
        self.guide = pricing.criterion.smoothed(GUIDE_SHARPNESS)
        self.M = pricing.information(places, ridge)
        self.costs = np.asarray(pricing.criterion.cost(self.M)).reshape(-1)
        self.slopes: Array | None = None  # of the guide (b, p, p), as long as they are asked for

    def best(self, place: int, allowed: Mask | None) -> tuple[Indices, Array]:
        """The candidate of the least cost, and the relative decrease."""
        scatter = self.pricing.scatter
        rest, center, scale = scatter.without(self.M, self.places, place)
        candidates = self._candidates(center, allowed)
        costs = self._costs_of(candidates, rest, center, scale, self.places[:, place])
        if allowed is not None:
            costs[~np.take_along_axis(allowed, candidates, axis=1)] = np.inf
        each = np.arange(len(rest))
        lowest = first_of_largest(-costs, costs.min(axis=1), self.part)
        least = costs[each, lowest]
        new = np.where(np.isfinite(least), candidates[each, lowest], self.places[:, place])
        with np.errstate(invalid="ignore"):
            gain = np.where(np.isinf(self.costs), np.where(np.isfinite(least), 1.0, 0.0), 0.0)
            finite = np.isfinite(self.costs)
            gain[finite] = 1.0 - least[finite] / self.costs[finite]
        return new, gain

    def _costs_of(
        self, candidates: Indices, rest: Array, center: Array, scale: float, old: Indices
    ) -> Array:
        """Costs (b, k) of candidates (b, k) in place of old ones (b,); inf where rounding has none.

        They are computed plan by plan where that is enough, as each plan's rest is inverted.
        """
        b, k = candidates.shape
        pieces = -(-self.pricing.entries * candidates.size // ENTRIES_UPDATED)
        costs = np.empty((b, k))
        for plans in np.array_split(np.arange(b), min(b, pieces)):
            chosen = candidates[plans]
            parts = np.array_split(np.arange(k), -(-pieces // b))
            own = rest[plans], center[plans], scale, old[plans]
            costs[plans] = np.hstack([self.joined_costs(*own, chosen[:, one]) for one in parts])
        return np.where(np.isnan(costs), np.inf, costs)

    def joined_costs(
        self, rest: Array, center: Array, scale: float, old: Indices, some: Indices
    ) -> Array:
        """Costs (b, k) where candidates (b, k) join what `Scatter.without` left of plans.

        There they take the place of old ones (b,).
        """
        rows = self.pricing.scatter.rows
        factors = np.sqrt(scale) * (rows[some] - center[:, None])
        leaving = np.sqrt(scale) * (rows[old] - center)
        return exchange_costs(self.pricing.criterion, rest, factors, np.ones(len(rest)), leaving)

    def sensitivities(self, G: Array, center: Array) -> Array:
        """``<G, (U - c)'(U - c)>`` (b, n) without the term that is the same for all candidates."""
        rows = self.pricing.scatter.rows
        flat = rows.reshape(len(rows), -1)
        squares = ((rows @ G[:, None]) * rows).sum(axis=(-2, -1))
        cross = (center @ G).reshape(len(G), -1) @ flat.T
        return np.asarray(squares - 2 * cross)

    def _candidates(self, center: Array, allowed: Mask | None) -> Indices:
        """Candidates (b, size) of largest sensitivity, or all of them."""
        n = self.pricing.scatter.n
        every = np.broadcast_to(np.arange(n), (len(center), n))
        # A singular plan has no gradient, and therefore no short list.
        if self.size >= n or not np.isfinite(self.costs).all():
            return every
        if self.slopes is None:
            self.slopes = self.guide.gradient(self.M)
        sensitivities = self.sensitivities(-self.slopes, center)
        if allowed is not None:
            sensitivities = np.where(allowed, sensitivities, -np.inf)
        return first_few_largest(sensitivities, self.size)

    def replace(self, which: Indices, place: int, new: Indices) -> None:
        """Take over an exchange; information and costs are computed anew, without a drift."""
        self.places[which, place] = new
        self.M[which] = self.pricing.information(self.places[which], self.ridge)
        self.costs[which] = np.asarray(self.pricing.criterion.cost(self.M[which])).reshape(-1)
        if self.slopes is not None:
            self.slopes[which] = self.guide.gradient(self.M[which])
