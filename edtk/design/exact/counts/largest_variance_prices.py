"""Prices for criteria that are the largest of several variances, of one row each."""

import numpy as np

from edtk.design.exact.counts.determinant_prices import DeterminantPrices, DeterminantPricing
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.linear_prices import LEAST_RATIO
from edtk.design.exact.counts.prices import first_of_largest
from edtk.system.typing import Array, Indices, Mask

VARIANCES_AT_ONCE = 300_000  # variances


class LargestVariancePricing(DeterminantPricing):
    """``max_j trace(A_j C A_j')`` after every exchange of o for x, for criteria such as G.

    With D the ratio of determinants, d and g as in `DeterminantPricing`, u = C o and v = C x, a
    variance ``a'C a`` falls by

        [(1 - d(o)) (a'v)^2 + 2 g(x) (a'u)(a'v) - (1 + d(x)) (a'u)^2] / D.

    Args:
        rows: Rows (n, p) of the candidates, in parameters that whiten their mean.
        limits: Number of places, and the information of every plan.
        targets: A_j (j, r, p), in the same parameters.
    """

    def __init__(self, rows: Array, limits: Limits, targets: Array) -> None:
        super().__init__(rows, limits)
        self.targets = targets
        self.flat = targets.reshape(-1, targets.shape[-1])
        self.batch = int(np.clip(VARIANCES_AT_ONCE // (len(self.flat) * len(rows)), 1, self.batch))

    def effort(self, limits: Limits) -> float:
        """As many products as rows of targets for each of a determinant."""
        return super().effort(limits) * (1 + len(self.flat) / self.rows.shape[1])

    def scores(self, places: Indices, ridge: float) -> Array:
        """The largest variances."""
        return self.largest(self.covariance(places, ridge))

    def largest(self, cov: Array) -> Array:
        """The largest variances (b,) of covariances (b, p, p)."""
        return self.summed(((self.flat @ cov) * self.flat).sum(axis=-1)).max(axis=1)

    def summed(self, squares: Array) -> Array:
        """Sums (b, j, ...) over the rows of each target of numbers (b, j r, ...)."""
        j, r, _ = self.targets.shape
        if r == 1:
            return squares
        return np.asarray(squares.reshape(len(squares), j, r, *squares.shape[2:]).sum(axis=2))

    def prices(self, places: Indices, ridge: float, size: int) -> "LargestVariancePrices":
        """Prices of plans (b, m); there is one round only, of all candidates."""
        return LargestVariancePrices(self, places.copy(), self.covariance(places, ridge))


class LargestVariancePrices(DeterminantPrices):
    """Prices of plans on their way, see `LargestVariancePricing`."""

    pricing: LargestVariancePricing

    def best(self, place: int, allowed: Mask | None) -> tuple[Indices, Array]:
        """The candidate of the least largest variance, and the relative decrease."""
        ratio = self.look(place)
        pricing = self.pricing
        is_regular = ratio > LEAST_RATIO
        divisor = np.where(is_regular, ratio, 1.0)
        told = pricing.flat @ self.cov
        own = (self.along[:, 0] @ pricing.flat.T)[:, :, None]
        side = told @ pricing.turned
        fall = side * side * self.rest[:, None, None]
        fall += (2 * own) * side * self.joint
        fall -= (own * own) * self.squares
        fall /= divisor[:, None]
        present = (told * pricing.flat).sum(axis=-1)
        reached = pricing.summed(present[:, :, None] - fall).max(axis=1)
        usable = is_regular if allowed is None else is_regular & allowed
        reached = np.where(usable, reached, np.inf)
        now = pricing.summed(present).max(axis=1)
        new = first_of_largest(-reached, now, self.part)
        each = np.arange(len(new))
        self.ratio = ratio[each, new]
        return new, 1.0 - reached[each, new] / now
