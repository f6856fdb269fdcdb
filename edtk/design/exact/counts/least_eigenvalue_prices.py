"""Prices for criteria of the least eigenvalue, of candidates with one row each."""

import numpy as np

from criteria.linalg.inverse import EPS, eigenpairs
from edtk.design.exact.counts.determinant_prices import DETERMINANTS_AT_ONCE, PRICES_AT_ONCE
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.prices import GAIN, ROUNDINGS, Prices, Pricing
from edtk.system.typing import Array, Indices, Mask

EIGENVALUE_HALVINGS = 45  # of the interval of the best eigenvalue, at most
# Where it is divided: of symmetric candidates the middle may be the eigenvalue of several, and
# rounding would part them.
DIVISION = np.sqrt(2) - 1
AWAY = 1e-12  # part of an interval by which a trial stays away from its ends, which are poles


class LeastEigenvaluePricing(Pricing):
    """The least eigenvalue of ``R + x x'`` for every candidate x, R without the place's own row.

    With eigenvalues ``d_1 <= .. <= d_p`` of R and the candidate's parts c along its eigenvectors,
    the least eigenvalue is the root in ``(d_1, d_2)`` of the secular equation (Golub 1973)

        f(t) = 1 + sum_i c_i^2 / (d_i - t),

    which rises from minus to plus infinity there. So it is above t where ``f(t) < 0``, and the best
    candidate is found by halving the interval, with those that are left.

    Args:
        rows: Rows (n, p) of the candidates, p above one, in parameters in which the criterion is
            the least eigenvalue itself.
        limits: Number of places, and the information of every plan.
        mean: Mean information (p, p) of a place.
        guide: Prices of the sum of the inverse eigenvalues. Where two eigenvalues are the least, no
            single exchange improves both; plans that are good for their sum have none so small.
    """

    rounds = (0,)
    kicks = 5
    patience = 256

    def __init__(self, rows: Array, limits: Limits, mean: Array, guide: Pricing) -> None:
        self.rows = rows
        self.limits = limits
        self.mean = mean
        self.guide = guide
        self.candidates = len(rows) if limits.sized else len(rows) - 1
        self.batch = int(np.clip(PRICES_AT_ONCE // rows.size, 1, DETERMINANTS_AT_ONCE))

    def effort(self, limits: Limits) -> float:
        """Some sweeps of determinants, each with halvings for the plans that still improve."""
        return 300.0 * limits.m * self.rows.size

    def information(self, places: Indices, ridge: float) -> Array:
        """Information (b, p, p) of plans (b, m)."""
        X = self.rows[places]
        own = self.limits.base + ridge * self.limits.m * self.mean
        return np.asarray(np.swapaxes(X, 1, 2) @ X + own)

    def scores(self, places: Indices, ridge: float) -> Array:
        """Minus the least eigenvalues."""
        return np.asarray(-np.linalg.eigvalsh(self.information(places, ridge))[:, 0])

    def prices(self, places: Indices, ridge: float, size: int) -> "LeastEigenvaluePrices":
        """Prices of plans (b, m); there is one round only, of all candidates."""
        return LeastEigenvaluePrices(self, places.copy(), self.information(places, ridge))


class LeastEigenvaluePrices(Prices):
    """Prices of plans on their way, see `LeastEigenvaluePricing`."""

    def __init__(self, pricing: LeastEigenvaluePricing, places: Indices, M: Array) -> None:
        self.pricing = pricing
        self.places = places
        self.M = M
        spectrum = np.linalg.eigvalsh(M)
        self.least = spectrum[:, 0]
        # Eigenvalues have the rounding of the largest one.
        condition = spectrum[:, -1] / np.maximum(self.least, EPS * spectrum[:, -1])
        self.part: Array = np.maximum(GAIN, ROUNDINGS * EPS * condition)

    def best(self, place: int, allowed: Mask | None) -> tuple[Indices, Array]:
        """The candidate of the largest least eigenvalue, and the relative decrease of its inverse.

        Only an improvement is looked for; without one the place keeps what it has.
        """
        own = self.pricing.rows[self.places[:, place]]
        rest = self.M - own[:, :, None] * own[:, None]
        d, V = eigenpairs(rest)
        squares = np.square(self.pricing.rows @ V)
        low = np.maximum(self.least * (1 + self.part), d[:, 0])
        low += AWAY * (d[:, 1] - d[:, 0])
        left = _below(squares, d, low)
        left &= (low < d[:, 1])[:, None]
        if allowed is not None:
            left &= allowed
        new = self.places[:, place].copy()
        gain = np.zeros(len(new))
        some = np.flatnonzero(left.any(axis=1))
        if len(some):
            new[some] = _of_largest_root(
                squares[some], d[some], low[some], left[some], self.part[some]
            )
            x = self.pricing.rows[new[some]]
            reached = np.linalg.eigvalsh(rest[some] + x[:, :, None] * x[:, None])[:, 0]
            gain[some] = 1.0 - np.maximum(self.least[some], 0.0) / reached
        return new, gain

    def replace(self, which: Indices, place: int, new: Indices) -> None:
        """Take over an exchange; the information is a sum of few terms, without a drift."""
        own = self.pricing.rows[self.places[which, place]]
        x = self.pricing.rows[new]
        self.M[which] += x[:, :, None] * x[:, None] - own[:, :, None] * own[:, None]
        self.places[which, place] = new
        self.least[which] = np.linalg.eigvalsh(self.M[which])[:, 0]


def _below(squares: Array, d: Array, t: Array) -> Mask:
    """Where f(t) is negative (b, n), for one t (b,) of each plan."""
    with np.errstate(divide="ignore", invalid="ignore"):
        values = (squares @ (1.0 / (d - t[:, None]))[:, :, None])[:, :, 0]
    return np.asarray(values < -1.0)


def _of_largest_root(squares: Array, d: Array, low: Array, left: Mask, part: Array) -> Indices:
    """The first candidates (b,) of the largest roots but for rounding, of those left (b, n).

    Their roots are above low (b,), and a part (b,) of them may be rounding.
    """
    high = d[:, 1].copy()
    for _ in range(EIGENVALUE_HALVINGS):
        # What is left of the others differs by rounding.
        is_open = (high - low > part * high) & (left.sum(axis=1) > 1)
        if not is_open.any():
            break
        between = low + DIVISION * (high - low)
        above = np.logical_and(_below(squares, d, between), left)
        rises = np.any(above, axis=1)
        left = np.where((rises & is_open)[:, None], above, left)
        low = np.where(rises & is_open, between, low)
        high = np.where(is_open & ~rises, between, high)
    return np.asarray(left.argmax(axis=1))
