"""Prices of very many candidates of several rows, of which a bound leaves few to look at."""

from dataclasses import dataclass

import numpy as np

from criteria.determinant_criterion import DeterminantCriterion
from criteria.linalg.inverse import guarded_inverse
from edtk.design.exact.counts.any_prices import AnyPrices, AnyPricing
from edtk.design.exact.exchange_costs import ACCURATE
from edtk.system.typing import Array, Indices, Mask

SHORTLIST = 256  # candidates that are tried at every place before all are
PART = 512  # candidates that are priced together
ROWS_AT_ONCE = 100_000  # of a product with all candidates: some megabytes


@dataclass(frozen=True, eq=False)
class SeveralRowsPricing(AnyPricing):
    """Costs of exchanges under a criterion of the determinant, or of ``tr(W C)``.

    Attributes:
        root: B (p, q) with ``B B' = W``; None for a criterion of the determinant.
    """

    root: Array | None = None
    kicks = 1
    patience = 2  # starts are long, and come within a thousandth of each other

    @property
    def rounds(self) -> tuple[int, ...]:  # type: ignore[override]
        """The length of a shortlist, and all candidates."""
        n = len(self.scatter.rows)
        return (SHORTLIST, n) if n > SHORTLIST else (n,)

    def prices(self, places: Indices, ridge: float, size: int) -> "SeveralRowsPrices":
        """Prices of plans (b, m)."""
        return SeveralRowsPrices(self, places.copy(), ridge, size)


class SeveralRowsPrices(AnyPrices):
    """Prices of plans on their way, see `SeveralRowsPricing`.

    A cost f is convex. With ``Z = -f'(M)``, the exchange of a place i for a candidate x thus lowers
    it by at most ``g(x) - g(i)``, where ``g = <Z, U'U>`` is the sensitivity. So candidates that
    promise less than the best one so far need no look, and in a plan that is nearly the best those
    are almost all.
    """

    pricing: SeveralRowsPricing

    def __init__(
        self, pricing: SeveralRowsPricing, places: Indices, ridge: float, size: int
    ) -> None:
        super().__init__(pricing, places, ridge, size)
        self.sensitivity: dict[int, Array] = {}
        self.order: dict[int, Indices] = {}

    def best(self, place: int, allowed: Mask | None) -> tuple[Indices, Array]:
        """The candidate of the least cost, and the relative decrease."""
        rows = self.pricing.scatter.rows
        if self.ridge and self.size >= len(rows):
            # A plan that is still to be kicked, and improved without a ridge, can do without.
            return self.places[:, place].copy(), np.zeros(len(self.places))
        own = rows[self.places[:, place]]
        rest = self.M - np.swapaxes(own, -1, -2) @ own
        _, cov, regular = guarded_inverse(rest, ACCURATE)
        if not (regular.all() and np.isfinite(self.costs).all()):
            return super().best(place, allowed)
        found = [
            self._best_of(b, place, cov[b], None if allowed is None else allowed[b])
            for b in range(len(rest))
        ]
        new = np.array([which for which, _ in found])
        return new, 1.0 - np.array([cost for _, cost in found]) / self.costs

    def _best_of(
        self, plan: int, place: int, cov: Array, allowed: Mask | None
    ) -> tuple[int, float]:
        """The candidate of the least cost for a place of one plan, and the cost."""
        g = self._sensitivities(plan)
        cost = float(self.costs[plan])
        taken = int(self.places[plan, place])
        best = taken
        least = cost
        everything = self.size >= len(g)
        order = self.order[plan]
        for first in range(0, len(order), PART):
            part = order[first : first + PART]
            if everything and cost - (g[part[0]] - g[taken]) >= least:
                break
            if allowed is not None:
                part = part[allowed[part]]
            if len(part):
                costs = self._costs_of(plan, cov, part)
                lowest = int(np.argmin(costs))
                if costs[lowest] < least:
                    best = int(part[lowest])
                    least = float(costs[lowest])
        return best, least

    def _costs_of(self, plan: int, cov: Array, part: Indices) -> Array:
        """Costs (k,) of the rest with covariance (p, p), joined by some candidates (k,)."""
        U = self.pricing.scatter.rows[part]
        k, r, p = U.shape
        UC = (U.reshape(-1, p) @ cov).reshape(k, r, p)
        D = UC @ np.swapaxes(U, 1, 2) + np.eye(r)
        criterion = self.pricing.criterion
        root = self.pricing.root
        if root is None:
            assert isinstance(criterion, DeterminantCriterion)
            log_det = np.linalg.slogdet(D).logabsdet - np.linalg.slogdet(cov).logabsdet
            return criterion.cost_of_log_determinant(log_det, p)
        V = (UC.reshape(-1, p) @ root).reshape(k, r, -1)
        fall = (np.linalg.solve(D, V) * V).sum(axis=(1, 2))
        left = float(np.sum((cov @ root) * root)) - fall
        return np.where(left > 0, left, np.inf) ** criterion.degree

    def _sensitivities(self, plan: int) -> Array:
        """Sensitivities (n,) of the candidates for a plan, kept for a sweep.

        A shortlist needs no better ones after an exchange; a bound does.
        """
        if plan not in self.sensitivity:
            Z = -self.pricing.criterion.gradient(self.M[plan])
            values, vectors = np.linalg.eigh(0.5 * (Z + Z.T))
            keep = values > values[-1] * np.finfo(float).eps
            root = vectors[:, keep] * np.sqrt(values[keep])
            rows = self.pricing.scatter.rows
            g = np.empty(len(rows))
            step = max(1, ROWS_AT_ONCE // rows.shape[1])
            for first in range(0, len(rows), step):
                U = rows[first : first + step]
                product = U.reshape(-1, U.shape[2]) @ root
                g[first : first + step] = np.square(product).reshape(len(U), -1).sum(axis=1)
            self.sensitivity[plan] = g
            if self.size < len(g):
                some = np.argpartition(-g, self.size)[: self.size]
            else:
                # None of less sensitivity than the least of the plan improves it.
                some = np.flatnonzero(g >= g[self.places[plan]].min())
            self.order[plan] = some[np.argsort(-g[some], kind="stable")]
        return self.sensitivity[plan]

    def replace(self, which: Indices, place: int, new: Indices) -> None:
        """Take over an exchange."""
        super().replace(which, place, new)
        if self.size >= len(self.pricing.scatter.rows):
            for plan in which.tolist():
                self.sensitivity.pop(plan, None)
