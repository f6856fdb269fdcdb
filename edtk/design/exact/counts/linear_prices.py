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
        spread = cov @ pricing.slope @ cov
        self.effect = ((pricing.rows @ spread) * pricing.rows).sum(axis=-1)
        self.trace = np.einsum("ij,bji->b", pricing.slope, cov)

    def best(self, place: int, allowed: Mask | None) -> tuple[Indices, Array]:
        """The candidate of the least trace, and the relative decrease."""
        ratio = self.look(place)
        ratio += self.rest[:, None]
        turned = self.pricing.turned
        self.bent = (self.cov @ (self.along @ self.pricing.slope)[:, :, None])[:, :, 0]
        self.own = ((self.along @ self.pricing.slope) * self.along).sum(axis=1)
        self.side = self.bent @ turned
        fall = self.rest[:, None] * self.effect + 2 * self.joint * self.side
        fall -= (1.0 + self.variance) * self.own[:, None]
        fall = np.divide(fall, ratio, out=np.full_like(fall, -np.inf), where=ratio > LEAST_RATIO)
        if allowed is not None:
            fall[~allowed] = -np.inf
        new = first_of_largest(fall, self.trace)
        each = np.arange(len(new))
        self.ratio = ratio[each, new]
        self.fall = fall[each, new]
        return new, self.fall / self.trace

    def replace(self, which: Indices, place: int, new: Indices) -> None:
        """Update ``C W C`` by ``C' W C' = C W C - Q K B' - B K Q' + B K (B'W B) K B'``.

        B holds v and u as columns, ``Q = C W B``, and K is the (2, 2) matrix of the update of C.
        """
        slope = self.pricing.slope
        turned = self.pricing.turned
        (k_vv, k_vu), (_, k_uu) = self._directions(which, new)
        v = (self.cov[which] @ self.pricing.rows[new][:, :, None])[:, :, 0]
        u = self.along[which]
        bent_v = (self.cov[which] @ (v @ slope)[:, :, None])[:, :, 0]
        h, side_h = v @ turned, bent_v @ turned
        g, side_g = self.joint[which], self.side[which]
        B = np.stack([v, u], axis=1)
        K = np.stack([k_vv, k_vu, k_vu, k_uu], axis=-1).reshape(-1, 2, 2)
        inner = K @ (B @ slope @ np.swapaxes(B, 1, 2)) @ K
        quadratic = (inner[:, 0, 0, None] * h + 2 * inner[:, 0, 1, None] * g) * h
        quadratic += inner[:, 1, 1, None] * (g * g)
        mixed = (k_vv * h + k_vu * g) * side_h + (k_vu * h + k_uu * g) * side_g
        self.effect[which] += quadratic - 2 * mixed
        self.trace[which] -= self.fall[which]
        super().replace(which, place, new)
