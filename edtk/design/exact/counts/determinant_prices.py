"""Prices for criteria of the determinant, of candidates with one row each."""

import numpy as np

from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.prices import Prices, Pricing, first_of_largest
from edtk.system.typing import Array, Indices, Mask

AT_ONCE = 60_000  # prices: a few such arrays stay in a core's cache
MOST_AT_ONCE = 256  # plans


class DeterminantPricing(Pricing):
    """``det(M + x x' - o o') / det M`` for every candidate x in place of o (Fedorov 1972).

    With ``C = M^-1``, ``d(x) = x'C x`` and ``g(x) = o'C x`` it is

        (1 + d(x)) (1 - d(o)) + g(x)^2.

    The vector d of all candidates is kept, and changes by two products of an exchange. So a look at
    all n candidates costs one product of n times p, and no matrix is inverted.

    Args:
        rows: Rows (n, p) of the candidates, in parameters that whiten their mean; a row of zeros at
            the end stands for an empty place.
        limits: Number of places, and the information of every plan in these parameters.
    """

    rounds = (0,)
    kicks = 5
    patience = 256

    def __init__(self, rows: Array, limits: Limits) -> None:
        self.rows = rows
        self.turned = np.ascontiguousarray(rows.T)
        self.limits = limits
        self.candidates = len(rows) if limits.sized else len(rows) - 1
        self.batch = int(min(MOST_AT_ONCE, max(1, AT_ONCE // len(rows))))

    def effort(self, limits: Limits) -> float:
        """Some thirty sweeps with one product of n times p, and as many updates, a place."""
        return 60.0 * limits.m * self.rows.size

    def covariance(self, places: Indices, ridge: float) -> Array:
        """Inverse information (b, p, p) of plans (b, m)."""
        return np.asarray(np.linalg.inv(self.information(places, ridge)))

    def information(self, places: Indices, ridge: float) -> Array:
        """Information (b, p, p) of plans (b, m)."""
        X = self.rows[places]
        own = self.limits.base + ridge * self.limits.m * np.eye(X.shape[-1])
        return np.asarray(np.swapaxes(X, 1, 2) @ X + own)

    def scores(self, places: Indices, ridge: float) -> Array:
        """Minus the logarithms of determinants."""
        return np.asarray(-np.linalg.slogdet(self.information(places, ridge)).logabsdet)

    def prices(self, places: Indices, ridge: float, size: int) -> "DeterminantPrices":
        """Prices of plans (b, m); there is one round only, of all candidates."""
        return DeterminantPrices(self, places.copy(), self.covariance(places, ridge))


class DeterminantPrices(Prices):
    """Prices of plans on their way, see `DeterminantPricing`."""

    def __init__(self, pricing: DeterminantPricing, places: Indices, cov: Array) -> None:
        self.pricing = pricing
        self.places = places
        self.cov = cov
        self.variance = ((pricing.rows @ cov) * pricing.rows).sum(axis=-1)

    def best(self, place: int, allowed: Mask | None) -> tuple[Indices, Array]:
        """The candidate of the largest determinant, and by how much it exceeds the present one."""
        ratio = self.look(place)
        if allowed is not None:
            ratio[~allowed] = -np.inf
        new = first_of_largest(ratio, np.ones(len(ratio)))
        self.ratio = ratio[np.arange(len(new)), new] + self.rest
        return new, self.ratio - 1.0

    def look(self, place: int) -> Array:
        """Ratios of determinants (b, n) with each candidate at a place, less ``1 - d(o)``.

        What an exchange needs is kept: C o, ``1 - d(o)`` as `rest`, and g of all candidates.
        """
        own = self.pricing.rows[self.places[:, place]]
        self.along = (self.cov @ own[:, :, None])[:, :, 0]
        self.rest = 1.0 - (own * self.along).sum(axis=1)
        self.joint = self.along @ self.pricing.turned
        ratio = self.joint * self.joint
        ratio += self.variance * self.rest[:, None]
        return ratio

    def replace(self, which: Indices, place: int, new: Indices) -> None:
        """Update covariance and variances by the lemma of Sherman, Morrison and Woodbury.

        With ``u = C o``, ``v = C x`` and the ratio D of determinants,
        ``C - [(1 - d_o) v v' + g (u v' + v u') - (1 + d_x) u u'] / D`` is the new inverse.
        """
        into, out = self._directions(which, new)
        v = (self.cov[which] @ self.pricing.rows[new][:, :, None])[:, :, 0]
        u = self.along[which]
        h = v @ self.pricing.turned
        g = self.joint[which]
        a = into[0] * v + into[1] * u
        b = out[0] * v + out[1] * u
        self.cov[which] -= a[:, :, None] * v[:, None] + b[:, :, None] * u[:, None]
        self.variance[which] -= (into[0] * h + (2 * into[1]) * g) * h + out[1] * (g * g)
        self.places[which, place] = new

    def _directions(
        self, which: Indices, new: Indices
    ) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """The symmetric (2, 2) matrix of the update, its entries (k, 1)."""
        ratio = self.ratio[which][:, None]
        mixed = self.joint[which, new][:, None] / ratio
        into = self.rest[which][:, None] / ratio
        out = -(1.0 + self.variance[which, new][:, None]) / ratio
        return (into, mixed), (mixed, out)
