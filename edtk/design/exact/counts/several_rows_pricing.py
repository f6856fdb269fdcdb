"""The search over very many candidates of several rows, of which bounds leave few."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from criteria.linalg.inverse import guarded_inverse
from edtk.design.exact.counts.any_prices import AnyPricing
from edtk.design.exact.counts.convex_loss import ConvexLoss
from edtk.design.exact.counts.counts_search import ACCURATE, SWEEPS, kicked
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.prices import GAIN, first_few_largest, first_lowest
from edtk.design.information import pack, sensitivity_rows
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices, Mask

COSTED = 32  # candidates whose costs are computed at a place
MATRICES_AT_ONCE = 2000  # candidates whose matrices are formed together
BYTES_KEPT = 1_000_000_000  # bytes of packed matrices that are kept from one look to the next
PLACES_TOGETHER = 64  # of a plan, whose sensitivities are there together
UNIT = 2.0**-24  # rounding of a number of single precision
SINGLE = 16 * UNIT  # part of a sum of such numbers that may be rounding
LISTED = 32  # candidates of a shortlist for each place
PART = 512  # candidates that are priced together
LOOKS = 100  # at all candidates, for one plan, at most: some five are usual
# Places that a kick draws anew. Of 40 places and 10^5 candidates, kicks of 2, 3 and 4 places come
# to plans of half the distance to the bound that kicks of 8 come to in the same time.
KICKED_PLACES = 3
KICKS = 120  # of a plan, at most
QUICK = 2e6  # products of a look at all candidates that allow of so many starts
MOST_PATIENCE = 8
IDLE_KICKS = 40  # in a row without an improvement, after which there are no more


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
        if len(some) > COSTED:
            some = some[first_few_largest(-bounds[None, some], COSTED, SINGLE)[0]]
        costs = self.loss.joined_costs(rest, self.rows[some])
        lowest = first_lowest(costs)
        now = float(self.loss.cost(np.array([value]))[0])
        return int(some[lowest]) if costs[lowest] < now * (1 - GAIN) else None


SingleArray = NDArray[np.float32]


class FullLook:
    """Sensitivities ``<Z, U'U>`` of all candidates in single precision, with what that may cost.

    A product of matrices ``U'U``, packed, with many Z costs about as much as one pass over the rows
    for a single Z in doubles. Of K terms, each rounded twice before they are multiplied and summed
    in any order, it errs by at most ``g |U'U| |Z|`` (Frobenius) with ``g = (K + 2) u / (1 - (K + 2)
    u)`` (Higham, Accuracy and Stability of Numerical Algorithms, section 3.1).

    Args:
        rows: Rows (n, r, p) of the candidates.
    """

    def __init__(self, rows: Array) -> None:
        self.rows = rows
        n, _, p = rows.shape
        terms = p * (p + 1) // 2
        self.gamma = (terms + 2) * UNIT / (1.0 - (terms + 2) * UNIT)
        self.sizes = np.empty(n)
        self._kept: list[SingleArray] | None = [] if 4 * n * terms <= BYTES_KEPT else None
        for part, packed in self._formed():
            self.sizes[part] = np.sqrt(np.einsum("ij,ij->j", packed, packed, dtype=float))
            if self._kept is not None:
                self._kept.append(packed)

    def _formed(self) -> Iterator[tuple[slice, SingleArray]]:
        """Candidates, and their matrices ``U'U`` packed (p(p+1)/2, k) with norms as they were."""
        scale = self._scale
        for first in range(0, len(self.rows), MATRICES_AT_ONCE):
            part = slice(first, first + MATRICES_AT_ONCE)
            U = self.rows[part]
            packed = scale[:, None] * pack(np.swapaxes(U, 1, 2) @ U)
            yield part, packed.astype(np.float32)

    def _parts(self) -> Iterator[tuple[slice, SingleArray]]:
        """The same, kept or formed anew."""
        if self._kept is None:
            yield from self._formed()
            return
        for first, packed in zip(
            range(0, len(self.rows), MATRICES_AT_ONCE), self._kept, strict=True
        ):
            yield slice(first, first + MATRICES_AT_ONCE), packed

    @property
    def _scale(self) -> Array:
        """Factors of the entries, roots of two off the diagonal: products are then those of <,>."""
        return np.sqrt(sensitivity_rows(np.ones((self.rows.shape[2],) * 2)))

    def sensitivities(self, Z: Array) -> Iterator[tuple[int, SingleArray, float]]:
        """Sensitivities to symmetric Z (m, p, p), a few Z at a time.

        Yields:
            The number of a Z, the sensitivities (n,), and by how much one of a candidate with
            ``|U'U| = 1`` may be wrong: see `sizes`.
        """
        slopes = (sensitivity_rows(Z) / self._scale).astype(np.float32)
        for first in range(0, len(Z), PLACES_TOGETHER):
            some = slopes[first : first + PLACES_TOGETHER]
            found = np.empty((len(some), len(self.rows)), dtype=np.float32)
            for part, packed in self._parts():
                np.matmul(some, packed, out=found[:, part])
            for i, own in enumerate(found, start=first):
                yield i, own, self.gamma * float(np.linalg.norm(Z[i]))

    def largest(self, Z: Array, number: int, allowed: list[Mask] | None = None) -> Indices:
        """Candidates of the largest sensitivities to any of Z (m, p, p), so many for each of them.

        Args:
            Z: Multipliers.
            number: How many.
            allowed: Which candidates count (n,), for each Z; None for all.
        """
        chosen = []
        for i, found, _ in self.sensitivities(Z):
            if allowed is not None:
                found[~allowed[i]] = -np.inf
            few = number < len(found)
            doubles = found[None].astype(float)
            every = np.arange(len(found))
            chosen.append(first_few_largest(doubles, number, SINGLE)[0] if few else every)
        return np.unique(np.concatenate(chosen))


@dataclass(frozen=True, eq=False)
class SeveralRowsPricing(AnyPricing):
    """A search of its own: descents over shortlists, and looks at all candidates between them.

    At all places of a plan tangents of the loss bound from below what each candidate leads to
    (`place_tangent`), by one product for all of them (`FullLook`). The candidates of the least
    bounds are a shortlist; descents and kicks are done over it, and a new one is made wherever a
    plan has improved. At the end every candidate whose bound is below the plan's own loss is tried
    at its place: where none improves the plan, no exchange of all does.

    Attributes:
        loss: The criterion's loss.
    """

    loss: ConvexLoss
    wave = 1

    @property
    def patience(self) -> int:  # type: ignore[override]
        """As many starts as take little time; long ones come within a thousandth of each other."""
        return int(np.clip(QUICK / (self.scatter.rows.size * len(self.mean)), 1, MOST_PATIENCE))

    @cached_property
    def look(self) -> FullLook:
        """All candidates, packed."""
        return FullLook(self.scatter.rows)

    def search_from(self, rng: np.random.Generator, places: Indices, ridge: float) -> Indices:
        """The plan (m,) that kicks and exchanges make of a start (m,).

        Args:
            rng: Random numbers of the kicks.
            places: The start.
            ridge: Part of the mean information for each place that is added to every plan until
                the end: starts and kicks may be singular.
        """
        ridged = self.limits.base + ridge * self.limits.m * self.mean
        places = self._descended(places, ridged)
        places = self._kicked(rng, places, ridged)
        # A criterion of some combinations may be the best where a plan tells nothing else.
        return self._settled(places, self.limits.base if self._is_regular(places) else ridged)

    def _is_regular(self, places: Indices) -> bool:
        """Whether a plan (m,) has an accurate inverse."""
        M = self.scatter.information(places[None])
        return bool(guarded_inverse(M, ACCURATE)[2][0])

    def _kicked(self, rng: np.random.Generator, places: Indices, base: Array) -> Indices:
        """The best plan (m,) of those that kicks lead to, one after another."""
        some = self._shortlist(places, base)
        value = some.value(some.inside(places))
        idle = 0
        few = min(KICKED_PLACES, max(1, len(places) - 1))  # of all places it would be a new start
        for _ in range(KICKS):
            own = some.inside(places)[None]
            trial = kicked(rng, some.limits, own, some.number, few)[0]
            trial = some.descended(trial)
            idle += 1
            if self._is_better(some.value(trial), value):
                places = some.candidates[trial]
                some = self._shortlist(places, base)
                places = some.candidates[some.descended(some.inside(places))]
                value = some.value(some.inside(places))
                idle = 0
            if idle >= IDLE_KICKS or out_of_time():
                break
        return places

    def _is_better(self, value: float, than: float) -> bool:
        """Whether a value of the loss is a lower cost, by more than rounding."""
        new, old = self.loss.cost(np.array([value, than]))
        return bool(new < old * (1 - GAIN))

    def _descended(self, places: Indices, base: Array) -> Indices:
        """A plan (m,) that is the best of its own shortlist, place by place."""
        for _ in range(LOOKS):
            some = self._shortlist(places, base)
            new = some.candidates[some.descended(some.inside(places))]
            if (new == places).all():
                break
            places = new
            if out_of_time():
                break
        return places

    def _settled(self, places: Indices, base: Array) -> Indices:
        """A plan (m,) that no exchange of one place for any candidate improves."""
        for _ in range(LOOKS):
            places = self._descended(places, base)
            if out_of_time():
                break
            better = self._improved_once(places, base)
            if better is None:
                break
            places = better
        return places

    def _tangents(self, places: Indices, base: Array) -> tuple[Array, Array, Array, Array]:
        """Information (p, p) of a plan, and levels (m,), Z (m, p, p) and rests of its tangents."""
        rows = self.scatter.rows[places]
        flat = rows.reshape(-1, rows.shape[2])
        told = flat.T @ flat
        M = told + base
        average = told / len(places)
        found = [place_tangent(self.loss, M, own, average) for own in rows]
        levels, Z, rests = (np.array(each) for each in zip(*found, strict=True))
        return M, levels, Z, rests

    def _shortlist(self, places: Indices, base: Array) -> Shortlist:
        """The candidates that promise the most at any place of a plan (m,)."""
        _, _, Z, _ = self._tangents(places, base)
        chosen = self.look.largest(Z, LISTED, self._allowed(places))
        chosen = np.union1d(chosen, places)
        if not self.limits.sized:
            chosen = np.union1d(chosen, [self.candidates])
        return Shortlist.of(self.loss, self.scatter.rows, self.limits, base, chosen)

    def _allowed(self, places: Indices) -> list[Mask] | None:
        """Which candidates (n,) may take each place of a plan (m,); None for all."""
        if not self.limits.restricts:
            return None
        found = []
        for place in range(len(places)):
            mask = self.limits.allowed(places[None], place, self.candidates)
            assert mask is not None
            found.append(mask[0])
        return found

    def _improved_once(self, places: Indices, base: Array) -> Indices | None:
        """The plan (m,) after an exchange that improves it; None where there is none."""
        M, levels, Z, rests = self._tangents(places, base)
        value = self.loss.tangent(M)[0]
        now = float(self.loss.cost(np.array([value]))[0])
        allowed = self._allowed(places)
        for place, found, wrong in self.look.sensitivities(Z):
            bounds = levels[place] - found - wrong * self.look.sizes
            able = bounds < value
            if allowed is not None:
                able &= allowed[place]
            some = np.flatnonzero(able)
            some = some[np.argsort(bounds[some], kind="stable")]
            for first in range(0, len(some), PART):
                part = np.sort(some[first : first + PART])
                costs = self.loss.joined_costs(rests[place], self.scatter.rows[part])
                lowest = first_lowest(costs)
                if costs[lowest] < now * (1 - GAIN):
                    better = places.copy()
                    better[place] = part[lowest]
                    return better
        return None
