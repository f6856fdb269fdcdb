"""The search over very many candidates of several rows, of which bounds leave few to look at."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from criteria.linalg.inverse import guarded_inverse
from edtk.design.exact.counts.any_prices import AnyPricing
from edtk.design.exact.counts.convex_loss import ConvexLoss
from edtk.design.exact.counts.draw_places import kicked
from edtk.design.exact.counts.full_look import FullLook
from edtk.design.exact.counts.prices import GAIN
from edtk.design.exact.counts.shortlist import Shortlist, place_tangent
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices, Mask

LISTED = 32  # candidates of a shortlist for each place
PART = 512  # candidates that are priced together
LOOKS = 100  # at all candidates, for one plan, at most: some five are usual
# Places that a kick draws anew. Of 40 places and 10^5 candidates, kicks of 2, 3 and 4 places come
# to plans of half the distance to the bound that kicks of 8 come to in the same time.
KICKED = 3
KICKS = 120  # of a plan, at most
QUICK = 2e6  # products of a look at all candidates that allow of so many starts
MOST_PATIENCE = 8
IDLE_KICKS = 40  # in a row without an improvement, after which there are no more
ACCURATE = 1e-8  # least eigenvalue at unit diagonal of a plan whose inverse has half its digits


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
        few = min(KICKED, max(1, len(places) - 1))  # of all places it would be a new start
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
                part = some[first : first + PART]
                costs = self.loss.joined_costs(rests[place], self.scatter.rows[part])
                lowest = int(np.argmin(costs))
                if costs[lowest] < now * (1 - GAIN):
                    better = places.copy()
                    better[place] = part[lowest]
                    return better
        return None
