"""Prices for criteria of the determinant, of candidates with one row each."""

import numpy as np

from criteria.linalg.inverse import EPS
from edtk.design.exact.counts.counts_bound import Scatter
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.prices import GAIN, ROUNDINGS, Prices, Pricing, first_of_largest
from edtk.system.typing import Array, Indices, Mask

PRICES_AT_ONCE = 60_000  # prices: a few such arrays stay in a core's cache
DETERMINANTS_AT_ONCE = 256  # plans


class DeterminantPricing(Pricing):
    """``det(M + x x' - o o') / det M`` for every candidate x in place of o (Fedorov 1972).

    With ``C = M^-1``, ``d(x) = x'C x`` and ``g(x) = o'C x`` it is

        (1 + d(x)) (1 - d(o)) + g(x)^2.

    The vector d of all candidates is kept, and changes by two products of an exchange. So a look at
    all n candidates costs one product of n times p, and no matrix is inverted.

    In a block a candidate u joins as ``x = r (u - c)``, see `Scatter.joining`, and
    ``d(x) = r^2 (d(u) - 2 c'C u + c'C c)``, so that a look costs one product more.

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
        self.scatter = Scatter(rows[:, None], limits)
        self.candidates = len(rows) if limits.sized else len(rows) - 1
        self.batch = int(min(DETERMINANTS_AT_ONCE, max(1, PRICES_AT_ONCE // len(rows))))

    def effort(self, limits: Limits) -> float:
        """Some thirty sweeps with one product of n times p, and as many updates, a place."""
        return 60.0 * limits.m * self.rows.size

    def covariance(self, places: Indices, ridge: float) -> Array:
        """Inverse information (b, p, p) of plans (b, m)."""
        return np.asarray(np.linalg.inv(self.information(places, ridge)))

    def information(self, places: Indices, ridge: float) -> Array:
        """Information (b, p, p) of plans (b, m)."""
        alike = ridge * self.limits.m * np.eye(self.rows.shape[1])
        if self.limits.blocks:
            return self.scatter.information(places) + alike
        X = self.rows[places]
        return np.asarray(np.swapaxes(X, 1, 2) @ X + (self.limits.base + alike))

    def scores(self, places: Indices, ridge: float) -> Array:
        """Minus the logarithms of determinants."""
        return np.asarray(-np.linalg.slogdet(self.information(places, ridge)).logabsdet)

    def prices(self, places: Indices, ridge: float, size: int) -> "DeterminantPrices":
        """Prices of plans (b, m); there is one round only, of all candidates."""
        return DeterminantPrices(self, places.copy(), self.covariance(places, ridge))


class DeterminantPrices(Prices):
    """Prices of plans on their way, see `DeterminantPricing`.

    Attributes:
        cov: C (b, p, p).
        squares: ``1 + d(u)`` of all candidates, and what else a criterion keeps (b, s, n).
        met: The same of what joins with each of them, after a look.
    """

    def __init__(self, pricing: DeterminantPricing, places: Indices, cov: Array) -> None:
        self.pricing = pricing
        self.places = places
        self.cov = cov
        self.squares = self._squares(pricing.rows @ cov)
        # 1 - d(o) is known to roundings of the largest d, and is a factor of d(x).
        self.part = np.maximum(GAIN, ROUNDINGS * EPS * self.squares[:, 0].max(axis=1) ** 2)

    def _squares(self, along: Array) -> Array:
        """The squares (b, s, n), of ``C x`` of all candidates (b, n, p)."""
        return 1.0 + (along * self.pricing.rows).sum(axis=-1)[:, None]

    def _sides(self, cov: Array, along: Array) -> Array:
        """Vectors (b, s, p) whose products with candidates count, of ``C x`` (b, p): itself."""
        return along[:, None]

    def best(self, place: int, allowed: Mask | None) -> tuple[Indices, Array]:
        """The candidate of the largest determinant, and by how much it exceeds the present one."""
        ratio = self.look(place)
        if allowed is not None:
            ratio[~allowed] = -np.inf
        new = first_of_largest(ratio, np.maximum(1.0, ratio.max(axis=1)), self.part)
        self.ratio = ratio[np.arange(len(new)), new]
        return new, self.ratio - 1.0

    def look(self, place: int) -> Array:
        """Ratios of determinants (b, n) with each candidate at a place.

        What an exchange needs is kept: the `_sides` of C o as `along`, their products with all
        candidates as `reached`, with what joins as `joint`, and with o as `own`; and ``1 - d(o)``
        as `rest`.
        """
        o = self.pricing.rows[self.places[:, place]]
        self.center = None
        if self.pricing.limits.blocks:
            center, scale = self.pricing.scatter.joining(self.places, place)
            self.center = center[:, 0]
            self.root = float(np.sqrt(scale))
            o = self.root * (o - self.center)
        o = o[:, :, None]
        self.along = self._sides(self.cov, (self.cov @ o)[:, :, 0])
        self.own = (self.along @ o)[:, :, 0]
        self.reached = self.along @ self.pricing.turned
        self.joint = self.reached
        self.met = self.squares
        if self.center is not None:
            self._meet(self.center[:, :, None])
        self.rest = 1.0 - self.own[:, 0]
        g = self.joint[:, 0]
        ratio = self.met[:, 0] * self.rest[:, None]
        ratio += g * g
        return ratio

    def _meet(self, c: Array) -> None:
        """What an exchange needs of all ``r (u - c)``, with centers c (b, p, 1) of the blocks."""
        self.joint = self.root * (self.reached - self.along @ c)
        sides = self._sides(self.cov, (self.cov @ c)[:, :, 0])
        self.met = self.squares - 2.0 * (sides @ self.pricing.turned)
        self.met += sides @ c
        self.met *= self.root**2
        self.met[:, 0] += 1.0 - self.root**2

    def replace(self, which: Indices, place: int, new: Indices) -> None:
        """Update C and the squares by the lemma of Sherman, Morrison and Woodbury.

        With ``v = C x``, ``u = C o``, ``B = (v u)`` and the ratio D of determinants the new inverse
        is ``C - B K B'``, where K is

            (1 - d(o)   g(x)       )
            (g(x)       -(1 + d(x))) / D.
        """
        cov = self.cov[which]
        x = self.pricing.rows[new]
        if self.center is not None:
            x = self.root * (x - self.center[which])
        joining = (cov @ x[:, :, None])[:, :, 0]
        sides = np.stack([self._sides(cov, joining), self.along[which]], axis=2)
        reached = np.empty((*sides.shape[:3], len(self.pricing.rows)))
        reached[:, :, 0] = sides[:, :, 0] @ self.pricing.turned
        reached[:, :, 1] = self.reached[which]
        K = np.empty((len(which), 2, 2))
        K[:, 0, 0] = self.rest[which]
        K[:, 0, 1] = K[:, 1, 0] = self.joint[which, 0, new]
        K[:, 1, 1] = -self.met[which, 0, new]
        K /= self.ratio[which, None, None]
        B = sides[:, 0]
        self.cov[which] -= np.swapaxes(B, 1, 2) @ (K @ B)
        self._follow(which, new, K @ reached[:, 0], reached)
        self.places[which, place] = new

    def _follow(self, which: Indices, new: Indices, turned: Array, reached: Array) -> None:
        """Update the squares of some plans.

        Args:
            which: Plans (k,).
            new: The candidates (k,) that join.
            turned: ``K B'y`` of all candidates y (k, 2, n).
            reached: Products of the sides of x, and of o, with all candidates (k, s, 2, n).
        """
        self.squares[which, 0] -= (reached[:, 0] * turned).sum(axis=1)
