"""Where the tracker is to stand and how reflectors are mounted, chosen together with the poses."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from math import prod
from typing import Any, NamedTuple

import numpy as np

from edtk.design.exact.exact_plan import ExactPlan, Placement, TriedPlace
from edtk.design.plan import Plan
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.robots.frames import MILLIMETRE
from edtk.study.study import Study
from edtk.study.study_model import marker_names
from edtk.system.errors import ArgumentError, UserError
from edtk.system.fields import Table
from edtk.system.time_limit import Progress, no_progress, out_of_time, time_left, time_limit
from edtk.system.typing import Array

KEY = "noise.tracker_position_mm"
KEY_OF_LIST = "noise.tracker_places_mm"
KEY_OF_MOUNTS = "marker"
NO_PLAN = "no place of the box from which the search began has a plan"
KEY_OF_BOX = "noise.tracker_box_mm"


@dataclass(frozen=True)
class SearchOfPlaces:
    """How places of a tracker are searched."""

    ranked_poses: int = 1000  # poses whose best weights say how good a place is
    # The logarithm to the base 2 of places that are drawn in a box, beside its corners.
    drawn: int = 5
    descents: int = 2  # from the best of these
    rounds: int = 4  # of a descent: the place for the design, the design for the place
    tried_places: int = 40  # places that are tried for a design
    # Of the box: how near they are in the end, where they differ by less than a gain.
    near: float = 0.01
    gain: float = 1e-4  # relative: what a round must gain for another one
    first_step: float = 0.2  # of the box
    for_ranking: float = 0.3  # of the time in a box: which of its places promise most
    for_descents: float = 0.5  # of the rest: where these lead to
    most_setups: int = 200  # places times mounts, each of which has a plan of its own


SEARCH = SearchOfPlaces()


class Setup(NamedTuple):
    """Where a tracker stands, and how reflectors are mounted.

    Attributes:
        position: The place (3,) [m]; None where there is no tracker.
        normals: Where each reflector looks (3,) whose mount is chosen, by its marker's name.
    """

    position: Array | None
    normals: Mapping[str, Array]

    def of(self, study: Study) -> Study:
        """The study that is set up so.

        Raises:
            UserError: No tracker can stand there, or it sees no marker.
        """
        keys: dict[str, Any] = {}
        if self.position is not None:
            noise = study.specification.noise
            assert noise is not None
            position = np.round(1e3 * self.position, 6) + 0.0
            keys["noise"] = _as_given(noise) | {"tracker_position_mm": position.tolist()}
        if self.normals:
            every = zip(study.specification.marker, marker_names(study), strict=True)
            looks = {name: {"normal": normal.tolist()} for name, normal in self.normals.items()}
            keys["marker"] = [_as_given(one) | looks.get(name, {}) for one, name in every]
        return study.replace(**keys)


SetUpPlan = tuple[ExactPlan, Setup]


def _as_given(table: Table) -> dict[str, Any]:
    """The keys of a table that a study gives."""
    return table.model_dump(mode="json", exclude_none=True, exclude_defaults=True)


@dataclass(frozen=True, eq=False)
class Places:
    """Where a tracker may stand, and how reflectors may be mounted.

    Attributes:
        listed: Places [m], each with each mount.
        mounts: Where reflectors look, by marker: each combination that is listed.
        box: Lower and upper corner (2, 3) of a box [m]; None for none.
        key: The key of the study that lists them, for messages.
    """

    listed: tuple[Setup, ...]
    mounts: tuple[Mapping[str, Array], ...]
    box: Array | None
    key: str = KEY_OF_LIST

    @staticmethod
    def of(study: Study) -> "Places":
        """The places and mounts of a study.

        Where it lists mounts alone, the tracker stays where it stands.

        Raises:
            ArgumentError: It has neither places of a tracker nor mounts, or too many.
        """
        names = marker_names(study)
        tables = zip(names, study.specification.marker, strict=True)
        listed = {name: one.normals for name, one in tables if one.normals is not None}
        table = study.specification.noise
        today = None if table is None else table.tracker_position_mm
        places = (None if table is None else table.tracker_places_mm) or ()
        box = None if table is None else table.tracker_box_mm
        if not (listed or places or box):
            message = "the study has no tracker in [noise], whose errors depend on its place"
            if today is not None:
                message = (
                    "expected places in noise.tracker_places_mm, a box in noise.tracker_box_mm, or "
                    "normals of a [[marker]]"
                )
            raise ArgumentError(message, argument="place_tracker", where=study.where)
        stands = places if places or box else (today,)
        count = prod(map(len, listed.values())) * max(1, len(stands))
        if count > SEARCH.most_setups:
            message = f"{count} places and mounts together; expected {SEARCH.most_setups} at most"
            raise ArgumentError(message, argument="place_tracker", where=study.where)
        directions = [map(np.array, one) for one in product(*listed.values())]
        mounts = tuple(dict(zip(listed, one, strict=True)) for one in directions)
        positions = [None if one is None else np.array(one) / 1e3 for one in stands]
        every = tuple(Setup(place, mount) for place in positions for mount in mounts)
        corners = None if box is None else np.array(box) / 1e3
        return Places(every, mounts, corners, KEY_OF_LIST if places else KEY_OF_MOUNTS)


@dataclass(frozen=True, eq=False)
class PlaceSearch:
    """The search for a place and a plan.

    Attributes:
        study: The study, whose tracker stands somewhere.
        planned: The best plan of a study, in the time that is left.
        relaxed: The best weights of a study on few candidates.
        cost: Cost of weights, or of a plan, in a study.
        progress: Called with a label of what is done.
        mount: Where reflectors look (3,) while a box is searched, by marker.
    """

    study: Study
    planned: Callable[[Study], ExactPlan]
    relaxed: Callable[[Study], RelaxedPlan]
    cost: Callable[[Study, RelaxedPlan | Plan], float]
    progress: Progress = no_progress
    mount: Mapping[str, Array] = field(default_factory=dict)

    def run(self, places: Places) -> ExactPlan:
        """The best plan, with its place and mounts.

        Where the time is limited (`time_limit`) each listed place with its mounts and the box with
        each of them have a share.

        Raises:
            UserError: A listed place is none, or no place has a plan.
        """
        best: SetUpPlan | None = None
        tried: list[TriedPlace] = []
        studies = [self._listed(places, i) for i in range(len(places.listed))]
        searches = 0 if places.box is None else len(places.mounts)
        for i, (setup, study) in enumerate(zip(places.listed, studies, strict=True)):
            self.progress(f"place {i + 1} of {len(studies)}", i)
            with time_limit(time_left() / (len(studies) - i + searches)):
                one, found = self._tried(setup, study, best)
            tried.append(one)
            if found is not None and (best is None or found.cost < best[0].cost):
                best = (found, setup)
        listed = None if best is None else best[1]
        best, looked = self._searched(places, best)
        if best is None:
            key, why = (places.key, tried[0].why) if tried else (KEY_OF_BOX, NO_PLAN)
            raise self.study.error(key, why)
        found, setup = best
        source = "listed" if setup is listed else "box"
        placement = Placement(setup.position, source, tuple(tried), looked, setup.normals)
        return replace(found, placement=placement)

    def _searched(self, places: Places, best: SetUpPlan | None) -> tuple[SetUpPlan | None, int]:
        """The best plan in the box or before, and the number of places that were looked at."""
        looked = 0
        for i, mount in enumerate(places.mounts):
            if places.box is None or (best is not None and _is_over(best[0])):
                break
            try:
                with time_limit(time_left() / (len(places.mounts) - i)):
                    inside, count = replace(self, mount=mount)._in_box(places.box)
            except KeyboardInterrupt:
                if best is None:
                    raise
                return (replace(best[0], ended="interrupted"), best[1]), looked
            looked += count
            if inside is not None and (best is None or inside[0].cost < best[0].cost):
                best = (inside[0], Setup(inside[1], mount))
        return best, looked

    def _tried(
        self, setup: Setup, study: Study | str, best: SetUpPlan | None
    ) -> tuple[TriedPlace, ExactPlan | None]:
        """What comes of a listed place, and its plan; None without one."""
        without = TriedPlace(setup.position, None, None, normals=setup.normals)
        if isinstance(study, str):
            return replace(without, why=study), None
        if best is not None and best[0].ended == "interrupted":
            return replace(without, why="the search was ended before", left_out=True), None
        try:
            found = self.planned(study)
        except UserError as error:
            return replace(without, why=error.message), None
        return replace(without, cost=found.cost, bound=found.told_bound), found

    def _listed(self, places: Places, i: int) -> Study | str:
        """The study at a listed place, or why there is no plan: it may see no marker.

        Raises:
            UserError: No tracker can stand there; names the place.
        """
        try:
            return places.listed[i].of(self.study)
        except UserError as error:
            if error.key == KEY:
                number = i // len(places.mounts)
                raise self.study.error(f"{KEY_OF_LIST}.{number}", error.message) from error
            return error.message

    def _at(self, place: Array) -> Study:
        """The study whose tracker stands somewhere (3,) [m], with the mounts of this search.

        Raises:
            UserError: No tracker can stand there, or it sees no marker.
        """
        return Setup(place, self.mount).of(self.study)

    def _in_box(self, box: Array) -> tuple[tuple[ExactPlan, Array] | None, int]:
        """The best plan in a box with its place, and the number of places that were looked at.

        Weights on few candidates tell where to look: from the best of some places a design and its
        place are made the best for each other in turn, each of which lowers the cost. A plan of
        whole experiments is searched where that ends, and its place once more.
        """
        drawn = _drawn(box, self.study.specification.seed)
        ranked: list[tuple[float, int, Array, RelaxedPlan]] = []
        interrupted = False
        try:
            with time_limit(SEARCH.for_ranking * time_left()):
                self._rank(drawn, ranked)
            ranked.sort(key=lambda one: one[:2])
            with time_limit(SEARCH.for_descents * time_left()):
                best = ranked[: SEARCH.descents]
                ends = [self._descended(place, design, box) for _, _, place, design in best]
        except KeyboardInterrupt:
            if not ranked:
                raise
            interrupted = True
            ends = [(cost, place) for cost, _, place, _ in ranked]
        if not ends:
            return None, len(drawn)
        _, place = min(ends, key=lambda one: one[0])
        with time_limit(0.0 if interrupted else np.inf):
            found, place = self._settled(place, box)
        ended = "interrupted" if interrupted else found.ended
        return (replace(found, ended=ended), place), len(drawn)

    def _rank(self, drawn: Array, ranked: list[tuple[float, int, Array, RelaxedPlan]]) -> None:
        """Append the best weights at each place, with their cost: at one at least."""
        for i, place in enumerate(drawn):
            if ranked and out_of_time():
                return
            self.progress(f"place {i + 1} of {len(drawn)} in the box", i)
            design = self._weights(place)
            if design is not None:
                ranked.append((design.cost, i, place, design))

    def _weights(self, place: Array) -> RelaxedPlan | None:
        """The best weights at a place; None where no tracker can stand, or nothing is told."""
        try:
            return self.relaxed(self._at(place))
        except UserError:
            return None

    def _descended(self, place: Array, design: RelaxedPlan, box: Array) -> tuple[float, Array]:
        """Cost and place at which neither a place nor weights lower the cost any more."""
        for turn in range(SEARCH.rounds):
            if out_of_time():
                break
            self.progress(f"place and poses in turn, {turn + 1}", turn)
            there, _ = self._best_place(place, design, box)
            better = self._weights(there)
            if better is None or not better.cost < design.cost * (1 - SEARCH.gain):
                break
            place, design = there, better
        return float(design.cost), place

    def _settled(self, place: Array, box: Array) -> tuple[ExactPlan, Array]:
        """The best plan near a place of the box, and its place."""
        found = self.planned(self._at(place))
        try:
            for _ in range(SEARCH.rounds):
                if _is_over(found):
                    break
                there, cost = self._best_place(place, found.whole, box)
                if not cost < found.cost * (1 - SEARCH.gain):
                    break
                again = self.planned(self._at(there))
                if again.cost >= found.cost:
                    break
                place, found = there, again
        except KeyboardInterrupt:
            found = replace(found, ended="interrupted")
        return found, place

    def _best_place(
        self, place: Array, design: RelaxedPlan | Plan, box: Array
    ) -> tuple[Array, float]:
        """The best place for a design, and its cost there, by the simplex of Nelder and Mead."""
        from scipy.optimize import minimize

        size = np.ptp(box, axis=0)
        moved = size > 0

        def cost(x: Array) -> float:
            there = place.copy()
            there[moved] = x
            try:
                return self.cost(self._at(_to_the_millimetre(there, box)), design)
            except UserError:
                return np.inf

        def stop(_: Array) -> None:
            if out_of_time():
                raise StopIteration

        start = place[moved]
        now = cost(start)
        if not len(start):
            return place, now
        step = SEARCH.first_step * size[moved]
        inwards = np.where(start + step > box[1][moved], -step, step)
        found = minimize(
            cost,
            start,
            method="Nelder-Mead",
            callback=stop,
            bounds=list(zip(*box[:, moved], strict=True)),
            options={
                "initial_simplex": np.vstack([start, start + np.diag(inwards)]),
                "maxfev": SEARCH.tried_places,
                "xatol": max(MILLIMETRE, SEARCH.near * size.max()),
                "fatol": SEARCH.gain * now,
            },
        )
        there = place.copy()
        there[moved] = found.x
        return _to_the_millimetre(there, box), float(found.fun)


def _is_over(found: ExactPlan) -> bool:
    """Whether nothing is to be begun after a plan."""
    return found.ended == "interrupted" or out_of_time()


def _drawn(box: Array, seed: int) -> Array:
    """Corners and middle of a box, and places (k, 3) that are spread over it."""
    from scipy.stats import qmc

    lower, upper = box
    corners = np.array(list(product(*zip(lower, upper, strict=True))))
    spread = qmc.Sobol(3, seed=seed).random_base2(SEARCH.drawn)
    inside = lower + (upper - lower) * spread
    every = np.concatenate([box.mean(axis=0)[None], corners, inside])
    every = np.array([_to_the_millimetre(place, box) for place in every])
    return every[np.sort(np.unique(every, axis=0, return_index=True)[1])]


def _to_the_millimetre(place: Array, box: Array) -> Array:
    """The place as one can measure it, within the box."""
    rounded = MILLIMETRE * np.round(place / MILLIMETRE)
    return np.asarray(np.clip(rounded, box[0], box[1]))
