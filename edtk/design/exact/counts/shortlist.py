"""Descents of plans over a few of very many candidates."""

from dataclasses import dataclass, replace

import numpy as np

from edtk.design.exact.counts.convex_loss import ConvexLoss
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.prices import GAIN
from edtk.design.packed import pack, sensitivity_rows
from edtk.system.typing import Array, Indices

SWEEPS = 100  # over all places, at most: some five are usual
TRIED = 32  # candidates whose costs are computed at a place


def place_tangent(
    loss: ConvexLoss, M: Array, own: Array, average: Array
) -> tuple[float, Array, Array]:
    """A lower bound on the loss of a plan with another experiment at one place.

    With R the information of the other places and N that of an average one, the tangent at
    ``R + N`` says ``f(R + U'U) >= f(R + N) + <Z, N> - <Z, U'U>``. Experiments of a good plan and
    their rivals lie around their average, closer than to the one that is to leave.

    Args:
        loss: The loss f.
        M: Information (p, p) of the plan.
        own: Rows (r, p) of the experiment at the place.
        average: N (p, p).

    Returns:
        ``f(R + N) + <Z, N>``, Z (p, p), and R (p, p).
    """
    rest = M - own.T @ own
    value, Z = loss.tangent(rest + average)
    return value + float(np.sum(Z * average)), Z, rest


@dataclass(frozen=True, eq=False)
class Shortlist:
    """Some candidates, among which a plan is improved.

    Attributes:
        loss: What is minimised.
        candidates: Their numbers (k,) among all, ascending.
        rows: Their rows (k, r, p).
        limits: What plans must obey, for these candidates alone.
        base: What the places of every plan are added to (p, p).
        packed: Information of each candidate, packed, in single precision (k, p(p+1)/2).
    """

    loss: ConvexLoss
    candidates: Indices
    rows: Array
    limits: Limits
    base: Array
    packed: Array

    @classmethod
    def of(
        cls, loss: ConvexLoss, rows: Array, limits: Limits, base: Array, chosen: Indices
    ) -> "Shortlist":
        """Take some candidates (k,), ascending, of rows (n, r, p) and their limits."""
        own = rows[chosen]
        real = chosen if limits.sized else chosen[:-1]
        most = None if limits.most is None else limits.most[real]
        costs = None if limits.costs is None else limits.costs[real]
        packed = pack(np.swapaxes(own, 1, 2) @ own).T.astype(np.float32)
        some = replace(limits, most=most, costs=costs)
        return cls(loss, chosen, own, some, base, np.ascontiguousarray(packed))

    @property
    def number(self) -> int:
        """How many candidates, without the empty place."""
        return len(self.candidates) if self.limits.sized else len(self.candidates) - 1

    def inside(self, places: Indices) -> Indices:
        """Positions (m,) in this list of candidates (m,) that it has."""
        return np.searchsorted(self.candidates, places)

    def information(self, places: Indices) -> Array:
        """Information (p, p) of a plan (m,)."""
        U = self.rows[places].reshape(-1, self.rows.shape[2])
        return np.asarray(U.T @ U + self.base)

    def value(self, places: Indices) -> float:
        """The loss of a plan (m,)."""
        return self.loss.tangent(self.information(places))[0]

    def descended(self, places: Indices) -> Indices:
        """A plan (m,) in which no place has a better candidate, as far as bounds tell the best."""
        places = places.copy()
        for _ in range(SWEEPS):
            M = self.information(places)
            value = self.loss.tangent(M)[0]
            moved = False
            for place in range(len(places)):
                new = self._best(places, place, M, value)
                if new is not None:
                    places[place] = new
                    M = self.information(places)
                    value = self.loss.tangent(M)[0]
                    moved = True
            if not moved:
                break
        return places

    def _best(self, places: Indices, place: int, M: Array, value: float) -> int | None:
        """The best candidate for a place of a plan; None where none is better than its own."""
        own = self.rows[places[place]]
        average = (M - self.base) / len(places)
        level, Z, rest = place_tangent(self.loss, M, own, average)
        slopes = sensitivity_rows(Z).astype(np.float32)
        bounds = level - self.packed @ slopes
        able = bounds < value
        allowed = self.limits.allowed(places[None], place, self.number)
        if allowed is not None:
            able &= allowed[0]
        some = np.flatnonzero(able)
        if not len(some):
            return None
        if len(some) > TRIED:
            some = some[np.argpartition(bounds[some], TRIED)[:TRIED]]
        costs = self.loss.joined_costs(rest, self.rows[some])
        lowest = int(np.argmin(costs))
        now = float(self.loss.cost(np.array([value]))[0])
        return int(some[lowest]) if costs[lowest] < now * (1 - GAIN) else None
