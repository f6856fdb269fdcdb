"""Prices of a sum of variances of several models, such as A or I over a sample of parameters."""

import numpy as np

from criteria.linalg.models import taken
from criteria.linalg.typing import triangle
from edtk.design.exact.counts.any_prices import PLANS_AT_ONCE
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.linear_prices import LEAST_RATIO
from edtk.design.exact.counts.models_prices import ModelScatter
from edtk.design.exact.counts.prices import Prices, Pricing, first_of_largest, least_gain
from edtk.system.typing import Array, Indices, Mask

# Prices of all models: some ten such arrays stay in a core's larger cache.
MODEL_PRICES_AT_ONCE = 150_000


class MeanVariancePricing(Pricing):
    """``sum_j tr(W_j C_j)`` after every exchange, of models whose candidates have one row each.

    In each model it is what `LinearPricing` computes. Models are small, so that what candidates
    tell of them is computed anew for each place, from their squares.

    Args:
        scatter: The candidates, about models with as many parameters each.
        slope: The blocks W_j of a block diagonal (p, p), positive semidefinite.
        mean: Mean information (p, p) of a place.
    """

    rounds = (0,)
    kicks = 5
    patience = 64

    def __init__(self, scatter: ModelScatter, slope: Array, mean: Array) -> None:
        ((at, rows),) = scatter.alike
        self.scatter = scatter
        self.rows = rows[:, :, 0]
        self.turned = np.ascontiguousarray(np.swapaxes(self.rows, 1, 2))
        self.slope = taken(slope, at)
        self.base = taken(scatter.limits.base, at)
        self.mean = taken(mean, at)
        self.limits = scatter.limits
        n = scatter.n
        self.candidates = n if self.limits.sized else n - 1
        self.batch = int(np.clip(MODEL_PRICES_AT_ONCE // (len(at) * n), 1, PLANS_AT_ONCE))
        i, j = triangle(self.rows.shape[-1])
        # Entries beside the diagonal stand twice in a sum over all.
        self.times = np.where(i == j, 1.0, 2.0)
        self.squares = self.turned[:, i] * self.turned[:, j]

    @classmethod
    def of(cls, scatter: ModelScatter, slope: Array, mean: Array) -> "MeanVariancePricing | None":
        """The prices where the models are alike and the slope mixes none; None elsewhere."""
        one_row = all(own.shape[1] == 1 for own in scatter.each)
        apart = scatter.models.are_apart(slope) and scatter.models.are_apart(mean)
        fits = one_row and apart and len(scatter.alike) == 1
        return cls(scatter, slope, mean) if fits else None

    def effort(self, limits: Limits) -> float:
        """As of one model with as many rows as all together."""
        return 60.0 * limits.m * self.rows.size

    def information(self, places: Indices, ridge: float) -> Array:
        """Information (b, k, s, s) of plans (b, m) about each model."""
        X = np.moveaxis(self.rows[:, places], 0, 1)
        return np.asarray(
            np.swapaxes(X, -1, -2) @ X + self.base + ridge * self.limits.m * self.mean
        )

    def scores(self, places: Indices, ridge: float) -> Array:
        """The sums of variances."""
        cov = np.linalg.inv(self.information(places, ridge))
        return np.asarray(np.einsum("kij,bkij->b", self.slope, cov))

    def over_candidates(self, A: Array) -> Array:
        """``x'A x`` (b, k, n) of all candidates for symmetric A (b, k, s, s)."""
        i, j = triangle(A.shape[-1])
        return np.asarray(((self.times * A[..., i, j])[:, :, None] @ self.squares)[:, :, 0])

    def prices(self, places: Indices, ridge: float, size: int) -> "MeanVariancePrices":
        """Prices of plans (b, m); there is one round only, of all candidates."""
        return MeanVariancePrices(self, places.copy(), ridge)


class MeanVariancePrices(Prices):
    """Prices of plans on their way, see `MeanVariancePricing`."""

    def __init__(self, pricing: MeanVariancePricing, places: Indices, ridge: float) -> None:
        self.pricing = pricing
        self.places = places
        self.part = least_gain(ridge)
        self.M = pricing.information(places, ridge)
        self.cov = np.asarray(np.linalg.inv(self.M), dtype=float)

    def best(self, place: int, allowed: Mask | None) -> tuple[Indices, Array]:
        """The candidate of the least sum of variances, and the relative decrease."""
        pricing = self.pricing
        own = np.swapaxes(pricing.rows[:, self.places[:, place]], 0, 1)
        along = (self.cov @ own[..., None])[..., 0]
        bent = (along[:, :, None] @ pricing.slope)[:, :, 0]
        rest = 1.0 - (own * along).sum(axis=-1)[..., None]
        joint = (along[:, :, None] @ pricing.turned)[:, :, 0]
        side = ((bent[:, :, None] @ self.cov) @ pricing.turned)[:, :, 0]
        one = 1.0 + pricing.over_candidates(self.cov)
        spread = np.asarray(self.cov @ pricing.slope @ self.cov)
        fall = rest * pricing.over_candidates(spread)
        fall += 2.0 * joint * side
        fall -= one * (bent * along).sum(axis=-1)[..., None]
        joint *= joint
        one *= rest
        one += joint
        fall = np.divide(fall, one, out=np.full_like(fall, -np.inf), where=one > LEAST_RATIO)
        whole = fall.sum(axis=1)
        if allowed is not None:
            whole[~allowed] = -np.inf
        trace = np.einsum("kij,bkij->b", pricing.slope, self.cov)
        new = first_of_largest(whole, trace, self.part)
        return new, whole[np.arange(len(new)), new] / trace

    def replace(self, which: Indices, place: int, new: Indices) -> None:
        """Take over an exchange; covariances are computed anew, without a drift."""
        rows = self.pricing.rows
        out = np.swapaxes(rows[:, self.places[which, place]], 0, 1)
        into = np.swapaxes(rows[:, new], 0, 1)
        self.M[which] += into[..., None] * into[..., None, :] - out[..., None] * out[..., None, :]
        self.cov[which] = np.linalg.inv(self.M[which])
        self.places[which, place] = new
