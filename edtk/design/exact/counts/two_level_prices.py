"""Prices of candidates that are all corners of a cube, without a look at each of them."""

import numpy as np

from edtk.design.exact.counts.determinant_prices import DeterminantPrices, DeterminantPricing
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.prices import least_gain
from edtk.system.typing import Array, Indices, Mask

ASCENTS = 12  # steps from corner to corner; two or three are usual
BATCH = 256  # plans


class TwoLevelPricing(DeterminantPricing):
    """Coordinate exchange for criteria of the determinant over the corners of a cube.

    In place of o, a corner x has the price ``x'Q x + const`` with
    ``Q = (1 - d(o)) C + C o o'C``, which is convex. From any x the corner ``sign(Q x)`` is no worse
    (its linear part is largest there), and steps to it end where no coordinate helps. They begin
    from o and from the two corners along ``C o``, which are the best of all where n = p.

    Args:
        rows: The candidates (2^k, p): k columns of two values each, the others constant.
        limits: Number of places, and the information of every plan.
        order: For each corner, as a number in binary digits, its index among the candidates.
        movable: The k columns that have two values.
    """

    together = BATCH
    # On Hadamard's matrices of order 20 one of some thousand descents ends in the optimum.
    kicks = 100
    patience = 512

    def __init__(self, rows: Array, limits: Limits, order: Indices, movable: Indices) -> None:
        self.rows = rows
        self.limits = limits
        self.order = order
        self.movable = movable
        self.low = rows[:, movable].min(axis=0)
        self.high = rows[:, movable].max(axis=0)
        self.fixed = rows[0].copy()
        self.candidates = len(rows)
        self.batch = BATCH

    def effort(self, limits: Limits) -> float:
        """Some three hundred sweeps with nine products of p times p a place."""
        return 3000.0 * limits.m * self.rows.shape[1] ** 2

    def prices(self, places: Indices, ridge: float, size: int) -> "TwoLevelPrices":
        """Prices of plans (b, m)."""
        return TwoLevelPrices(self, places.copy(), ridge)

    def corner(self, slope: Array, own: Array) -> Array:
        """The corner (b, p) with the largest product with slopes (b, p); own (b, p) where equal."""
        x = np.broadcast_to(self.fixed, own.shape).copy()
        along = slope[:, self.movable]
        chosen = np.where(along > 0, self.high, self.low)
        x[:, self.movable] = np.where(along == 0, own[:, self.movable], chosen)
        return x

    def index(self, x: Array) -> Indices:
        """Indices (b,) of corners (b, p) among the candidates."""
        return np.asarray(self.order[corner_numbers(x[:, self.movable], self.low, self.high)])


class TwoLevelPrices(DeterminantPrices):
    """Prices of plans on their way, see `TwoLevelPricing`."""

    pricing: TwoLevelPricing

    def __init__(self, pricing: TwoLevelPricing, places: Indices, ridge: float) -> None:
        self.pricing = pricing
        self.places = places
        self.part = least_gain(ridge)
        self.cov = pricing.covariance(places, ridge)

    def best(self, place: int, allowed: Mask | None) -> tuple[Indices, Array]:
        """A corner from which no coordinate improves the determinant, and its ratio less one."""
        own = self.pricing.rows[self.places[:, place]]
        self.along = (self.cov @ own[:, :, None])[:, :, 0]
        self.rest = np.maximum(1.0 - (own * self.along).sum(axis=1), 0.0)
        trials = [own, self.pricing.corner(self.along, own), self.pricing.corner(-self.along, own)]
        reached = [self._ascended(x) for x in trials]
        prices = np.array([price for _, price in reached])
        best = prices.argmax(axis=0)
        each = np.arange(len(own))
        x = np.array([x for x, _ in reached])[best, each]
        self.ratio = prices[best, each] + self.rest
        return self.pricing.index(x), self.ratio - 1.0

    def _ascended(self, x: Array) -> tuple[Array, Array]:
        """Corners (b, p) where no step helps, and ``x'Q x`` (b,) there."""
        slope = self._slope(x)
        price = (slope * x).sum(axis=1)
        for _ in range(ASCENTS):
            y = self.pricing.corner(slope, x)
            slope_there = self._slope(y)
            reached = (slope_there * y).sum(axis=1)
            better = reached > price * (1 + 1e-12)
            if not better.any():
                break
            x = np.where(better[:, None], y, x)
            slope = np.where(better[:, None], slope_there, slope)
            price = np.where(better, reached, price)
        return x, price

    def _slope(self, x: Array) -> Array:
        """``Q x`` (b, p)."""
        own = (self.cov @ x[:, :, None])[:, :, 0] * self.rest[:, None]
        return np.asarray(own + self.along * (self.along * x).sum(axis=1)[:, None])

    def replace(self, which: Indices, place: int, new: Indices) -> None:
        """Update the covariance, see `DeterminantPrices.replace`."""
        x = self.pricing.rows[new]
        u = self.along[which]
        v = (self.cov[which] @ x[:, :, None])[:, :, 0]
        ratio = self.ratio[which][:, None]
        mixed = (u * x).sum(axis=1)[:, None] / ratio
        into = self.rest[which][:, None] / ratio
        out = -(1.0 + (v * x).sum(axis=1)[:, None]) / ratio
        a = into * v + mixed * u
        b = mixed * v + out * u
        self.cov[which] -= a[:, :, None] * v[:, None] + b[:, :, None] * u[:, None]
        self.places[which, place] = new


def two_levels(rows: Array) -> tuple[Indices, Indices] | None:
    """Whether rows (n, p) are all corners of a cube, each once.

    Returns:
        For each corner, as a number in binary digits, its index (n,), and the columns (k,) with two
        values; None for other rows.
    """
    n = len(rows)
    low = rows.min(axis=0)
    high = rows.max(axis=0)
    movable = np.flatnonzero(high > low)
    if n != 2 ** len(movable) or not len(movable):
        return None
    if not all(np.isin(rows[:, c], (low[c], high[c])).all() for c in movable):
        return None
    numbers = corner_numbers(rows[:, movable], low[movable], high[movable])
    order = np.full(n, -1)
    order[numbers] = np.arange(n)
    return None if (order < 0).any() else (order, movable)


def corner_numbers(x: Array, low: Array, high: Array) -> Indices:
    """Corners (n, k) as numbers in binary digits."""
    upper = x > 0.5 * (low + high)
    return np.asarray(upper @ (1 << np.arange(x.shape[1])))
