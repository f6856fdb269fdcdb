"""Prices for criteria that are linear in the covariance, of candidates with one row each."""

import numpy as np

from edtk.design.exact.counts.determinant_prices import DeterminantPrices, DeterminantPricing
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.prices import first_of_largest
from edtk.system.typing import Array, Indices, Mask

LEAST_RATIO = 1e-10  # of determinants: below it a plan is singular, and its trace is noise


class LinearPricing(DeterminantPricing):
    """``tr(W C)`` after every exchange of o for x, for criteria such as A, I and c.

    With D the ratio of determinants, d and g as in `DeterminantPricing`, and ``e(x) = x'C W C x``,
    ``f(x) = o'C W C x``, the trace falls by

        [(1 - d(o)) e(x) + 2 g(x) f(x) - (1 + d(x)) e(o)] / D.

    Args:
        rows: Rows (n, p) of the candidates, in parameters that whiten their mean.
        limits: Number of places, and the information of every plan.
        slope: W (p, p), positive semidefinite, in the same parameters.
    """

    def __init__(self, rows: Array, limits: Limits, slope: Array) -> None:
        super().__init__(rows, limits)
        self.slope = slope

    def scores(self, places: Indices, ridge: float) -> Array:
        """The traces."""
        return np.einsum("ij,bji->b", self.slope, self.covariance(places, ridge))

    def prices(self, places: Indices, ridge: float, size: int) -> "LinearPrices":
        """Prices of plans (b, m); there is one round only, of all candidates."""
        return LinearPrices(self, places.copy(), self.covariance(places, ridge))


class LinearPrices(DeterminantPrices):
    """Prices of plans on their way, see `LinearPricing`."""

    pricing: LinearPricing

    def __init__(self, pricing: LinearPricing, places: Indices, cov: Array) -> None:
        super().__init__(pricing, places, cov)
        self.trace = np.einsum("ij,bji->b", pricing.slope, cov)

    def _squares(self, along: Array) -> Array:
        """``1 + d(x)`` and e(x)."""
        e = ((along @ self.pricing.slope) * along).sum(axis=-1)
        return np.concatenate([super()._squares(along), e[:, None]], axis=1)

    def _sides(self, cov: Array, along: Array) -> Array:
        """``C x`` and ``C W C x``, which loses digits beside a ridge if C W C is formed first."""
        return np.stack([along, ((along @ self.pricing.slope)[:, None] @ cov)[:, 0]], axis=1)

    def best(self, place: int, allowed: Mask | None) -> tuple[Indices, Array]:
        """The candidate of the least trace, and the relative decrease."""
        ratio = self.look(place)
        fall = self.met[:, 1] * self.rest[:, None]
        fall -= self.met[:, 0] * self.own[:, 1, None]
        fall += 2 * self.joint[:, 0] * self.joint[:, 1]
        fall = np.divide(fall, ratio, out=np.full_like(fall, -np.inf), where=ratio > LEAST_RATIO)
        if allowed is not None:
            fall[~allowed] = -np.inf
        new = first_of_largest(fall, self.trace, self.part)
        each = np.arange(len(new))
        self.ratio = ratio[each, new]
        self.fall = fall[each, new]
        # A trace that has fallen to nothing is rounding until the next sweep.
        told = self.trace > 0
        return new, np.divide(self.fall, self.trace, out=np.zeros_like(self.fall), where=told)

    def _follow(self, which: Indices, new: Indices, turned: Array, reached: Array) -> None:
        """Update ``e(y)``, where the new ``C W C`` is ``(I - B K P') C W C (I - P K B')``.

        Here P holds x and o as columns. With ``k = K B'y`` it is
        ``e(y) - 2 k' P'C W C y + k' (P'C W C P) k``.
        """
        inner = np.empty((len(which), 2, 2))
        inner[:, 0, 0] = self.met[which, 1, new]
        inner[:, 0, 1] = inner[:, 1, 0] = self.joint[which, 1, new]
        inner[:, 1, 1] = self.own[which, 1]
        fall = inner @ turned
        fall -= 2 * reached[:, 1]
        fall *= turned
        self.squares[which, 1] += fall.sum(axis=1)
        self.trace[which] -= self.fall[which]
        super()._follow(which, new, turned, reached)
