"""The day of a plan: which pose is visited when, over which free legs, and how long it takes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal
from weakref import WeakKeyDictionary

import numpy as np

from edtk.cell.ways import DrivenWay, Leg, Roadmap, Speeds, Way
from edtk.design.plan import Plan
from edtk.design.tours import EXCHANGES_UP_TO, short_tour, shortest_legs, tour_seconds
from edtk.measure.pose_table import rounded, wrench_columns, wrench_in_file_units
from edtk.robots.robot import Robot
from edtk.study.study import Study
from edtk.study.tables_of_measurement import CostsTable
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices, Mask

if TYPE_CHECKING:
    import pandas as pd

NO_WAY = 1e6  # [s]: longer than any day, so that a tour takes such a leg only where it must
# Of joint variables [rad or m]: poses that are equal but for rounding are one place.
PLACE_DIGITS = 9

What = Literal["warm-up", "visit", "load change", "home"]


@dataclass(frozen=True, eq=False)
class Step:
    """Something that takes time in a day.

    Attributes:
        what: A visit, a change of the load, the way home, or the warm-up before all.
        start: When the arm sets out for it [s].
        end: When it is over [s].
        q: Where the arm is then (n,) [rad or m].
        way: How it gets there; None where it is there already, or where no free way was found.
        row: Index of the plan's row that is visited; None for other steps.
        visit: Number of the visit in the sheet, from 1; None for other steps.
        load: Forces and torques (6,) that are on, or (9,) with their place [N, N m, m].
        direct: The direct leg to it; None where the arm is there already.
        touches: Whether something touches in the pose itself, to which no way leads.
    """

    what: What
    start: float
    end: float
    q: Array
    way: Way | None
    row: int | None
    visit: int | None
    load: Array
    direct: Leg | None = None
    touches: bool = False

    @property
    def blocked(self) -> Leg | None:
        """The leg to it where no free way was found; else None."""
        return self.direct if self.way is None else None

    @property
    def nearest(self) -> Leg | None:
        """The leg to it on which bodies are nearest; None where there are none, or no leg."""
        leg = self.blocked if self.way is None else self.way.nearest
        return None if leg is None or leg.pair is None else leg

    @property
    def via(self) -> int:
        """Number of via poses."""
        return 0 if self.way is None else len(self.way.via)

    @property
    def driving(self) -> float:
        """How long the arm drives to it [s]."""
        return 0.0 if self.way is None else self.way.seconds


@dataclass(frozen=True, eq=False)
class Day(Presented):
    """A plan's visits in order, with the time they take.

    Attributes:
        plan: The plan.
        robot: The robot.
        steps: What is done, in order.
        order: The plan's rows in the order of the sheet, repetitions included (m,).
        in_a_cell: Whether legs are proved free of what stands around the robot.
        is_timed: Whether the study says how long things take.
    """

    plan: Plan
    robot: Robot
    steps: tuple[Step, ...]
    order: Indices
    in_a_cell: bool
    is_timed: bool

    def headline(self) -> str:
        """Number of visits, and how long the day is."""
        visits = sum(step.what == "visit" for step in self.steps)
        return f"{visits} visits in {self.seconds / 60:.1f} min"

    @property
    def seconds(self) -> float:
        """How long the day is [s]."""
        return self.steps[-1].end

    @property
    def driving(self) -> float:
        """How long the arm drives in it [s]."""
        return sum(step.driving for step in self.steps)

    @cached_property
    def blocked(self) -> tuple[Step, ...]:
        """The steps to which no free way was found."""
        return tuple(step for step in self.steps if step.blocked is not None)

    @cached_property
    def ways(self) -> tuple[DrivenWay, ...]:
        """The ways between rows of the plan and home, each once."""
        found: dict[tuple[int | None, int | None], DrivenWay] = {}
        at: int | None = None  # home, or nowhere yet
        for step in self.steps:
            rows = (at, step.row)
            if step.direct is not None and rows[::-1] not in found:
                found[rows] = DrivenWay(rows, step.direct, step.way)
            # A load is changed where the arm is, unless it drives home for it.
            if step.what == "visit" or step.direct is not None:
                at = step.row
        return tuple(found.values())

    def to_frame(self) -> "pd.DataFrame":
        """A table with a row for each step; poses are those of the plan's rows."""
        import pandas as pd

        rows = []
        for step in self.steps:
            leg = step.nearest
            rows.append(
                {
                    "step": step.what,
                    "start_s": round(step.start, 1),
                    "end_s": round(step.end, 1),
                    "visit": step.visit,
                    "plan_row": None if step.row is None else step.row + 1,
                    "driving_s": round(step.driving, 1),
                    "via_poses": step.via,
                    "free": step.blocked is None if self.in_a_cell else None,
                    "clearance_mm": None if leg is None else round(1e3 * leg.clearance, 1),
                    "nearest": None if leg is None else " - ".join(leg.pair or ()),
                }
            )
        frame = pd.DataFrame(rows).astype({"visit": "Int64", "plan_row": "Int64"})
        loads = wrench_in_file_units(np.array([step.load for step in self.steps]))
        frame[list(wrench_columns(loads))] = loads
        return frame

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers in SI units."""
        return {
            "seconds": self.seconds,
            "driving_s": self.driving,
            "load_changes": sum(step.what == "load change" for step in self.steps),
            "free": not self.blocked if self.in_a_cell else None,
            "steps": [
                {
                    "what": step.what,
                    "start_s": step.start,
                    "end_s": step.end,
                    "row": None if step.row is None else step.row + 1,
                    "visit": step.visit,
                    "q": step.q.tolist(),
                    "via": [] if step.way is None else step.way.via.tolist(),
                    "driving_s": step.driving,
                    "load": step.load.tolist(),
                    **self._nearest(step),
                }
                for step in self.steps
            ],
        }

    def _nearest(self, step: Step) -> dict[str, Any]:
        """Whether the way to a step is free, and how near bodies come; nothing without a cell."""
        if not self.in_a_cell:
            return {}
        leg = step.nearest
        return {
            "free": step.blocked is None,
            "clearance_mm": None if leg is None else 1e3 * leg.clearance,
            "pair": None if leg is None else list(leg.pair or ()),
        }


@dataclass(frozen=True, eq=False)
class _Pass:
    """Visits that follow each other under one load.

    Attributes:
        load: The load (6,) or (9,).
        rows: The plan's rows (v,) in order.
        visits: Their numbers (v,) in the sheet, from 0.
    """

    load: Array
    rows: Indices
    visits: Indices


def has_day(study: Study) -> bool:
    """Whether the order of visits is found by time: times are given, or a cell is."""
    costs = study.specification.costs
    return study.cell is not None or (costs is not None and costs.is_timed)


def speeds_of(study: Study) -> Speeds:
    """How fast the joints of a study's robot are [rad/s or m/s]."""
    costs = study.specification.costs or CostsTable()
    return Speeds(np.array([costs.speed_of(joint) for joint in study.robot.joints]))


def day_of(study: Study, plan: Plan) -> Day:
    """Order the visits of a plan by time, over free legs.

    A tour of the poses of a load is short in time. Where a leg of it turns out not to be free, its
    way by other poses takes its place, and the tour is found again, until all ways are known.
    Repetitions of a pose are spread over several rounds, every other one backwards, as long as that
    costs little: readings that drift evenly then move all poses alike. With a home pose the day
    begins and ends there, and loads are changed there. A pose in which no marker is read is not
    visited, as the sheet has no row of it.

    Args:
        study: The study.
        plan: The plan; angles have the digits that a controller takes.
    """
    plan = Plan(rounded(study.robot, plan.q), plan.wrench, plan.repeats)
    arrays = (plan.q, plan.wrench, plan.repeats)
    key = b"".join(np.ascontiguousarray(one).tobytes() for one in arrays)
    known = _days.setdefault(study, {})
    if key not in known:
        known[key] = _DayPlanner(study, plan).day()
    return known[key]


# Days of studies that are in use: sheet, program and timetable of a plan ask for the same one.
_days: WeakKeyDictionary[Study, dict[bytes, Day]] = WeakKeyDictionary()


class _DayPlanner:
    """What a day is made of while it is planned: places, times of ways, and the order so far."""

    def __init__(self, study: Study, plan: Plan) -> None:
        self.study = study
        self.plan = plan
        self.costs = study.specification.costs or CostsTable()
        self.read = _read(study, plan)
        keys = np.round(plan.q, PLACE_DIGITS) + 0.0
        _, first, place = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        self.place = place.reshape(-1)
        poses = plan.q[first]
        home = study.home
        self.home = None if home is None else len(poses)
        if home is not None:
            poses = np.concatenate([poses, home[None]])
        self.map = Roadmap(
            study.cell, poses, speeds_of(study), _via_limits(study), study.specification.seed
        )
        self.places = len(poses)
        self.seconds = self.map.seconds.copy()
        self.known = np.eye(self.places, dtype=bool)

    def day(self) -> Day:
        """The whole day."""
        while True:
            passes = self._passes()
            legs = self._unknown_legs(passes)
            if not len(legs):
                break
            self._find_ways(legs)
        order = np.empty(sum(len(one.rows) for one in passes), dtype=int)
        for one in passes:
            order[one.visits] = one.rows
        return Day(
            self.plan,
            self.study.robot,
            tuple(self._steps(passes)),
            order[: self.plan.repeats[self.read].sum()],
            self.study.cell is not None,
            self.study.specification.costs is not None and self.costs.is_timed,
        )

    def _unknown_legs(self, passes: Sequence[_Pass]) -> Indices:
        """Legs (k, 2) between places that the day needs, and whose ways are not yet known."""
        at = np.array(list(self._stations(passes)))
        legs = np.unique(np.sort(np.stack([at[:-1], at[1:]], axis=1), axis=1), axis=0)
        return np.asarray(legs[~self.known[legs[:, 0], legs[:, 1]]])

    def _stations(self, passes: Sequence[_Pass]) -> Iterator[int]:
        """All places in the order in which the arm comes to them."""
        for one in passes:
            yield from () if self.home is None else (self.home,)
            yield from self.place[one.rows].tolist()
        yield from () if self.home is None else (self.home,)

    def _find_ways(self, legs: Indices) -> None:
        """Find the ways that take the place of legs (k, 2), and how long they take."""
        self.map.prove(legs[:, 0], legs[:, 1])
        for a, b in legs.tolist():
            way = self.map.way(a, b)
            self.known[a, b] = self.known[b, a] = True
            self.seconds[a, b] = self.seconds[b, a] = NO_WAY if way is None else way.seconds

    def _passes(self) -> list[_Pass]:
        """The visits in order, by load."""
        loads = np.unique(self.plan.wrench[self.read], axis=0)
        loads = loads[np.argsort(loads.any(axis=1), kind="stable")]
        paired = self.study.kind.is_paired(self.study)
        stretches = self._stretches(loads, paired)
        rounds = []
        for load in loads:
            own = (self.plan.wrench == load).all(axis=1) & self.read
            visits = self._visits(np.flatnonzero(own))
            rounds.append(np.array_split(visits, stretches))
        blocks = [(i, own[k]) for k in range(stretches) for i, own in enumerate(rounds)]
        number = np.cumsum([0, *(len(rows) for _, rows in blocks)])
        passes = []
        for k in range(0, len(blocks), len(loads)):
            cycle = range(k, k + len(loads))
            if paired:
                # First all of the cycle without a load, which is also the visit under none.
                rows = np.concatenate([blocks[j][1] for j in cycle])
                visits = np.arange(number[k], number[k + len(loads)])
                passes.append(_Pass(np.zeros_like(loads[0]), rows, visits))
            for j in cycle:
                load = loads[blocks[j][0]]
                if not paired or load.any():
                    visits = np.arange(number[j], number[j + 1])
                    passes.append(_Pass(load, blocks[j][1], visits))
        return [one for one in passes if len(one.rows)]

    def _stretches(self, loads: Array, paired: bool) -> int:
        """In how many stretches of the day each load is on, by the study's `load_changes`."""
        on = int(loads.any(axis=1).sum()) + 1 if paired else len(loads)
        asked = self.costs.load_changes
        return 1 if asked is None or on < 2 else max(1, (asked + 1) // on)

    def _visits(self, rows: Indices) -> Indices:
        """Visits of rows of one load in order, repetitions spread where that is cheap."""
        tour = self._tour(rows)
        repeats = self.plan.repeats[tour]
        allowed = 1 + self.costs.spread_percent / 100
        plain = np.repeat(tour, repeats)
        most = allowed * self._length(plain)
        for rounds in range(int(repeats.max()), 1, -1):
            spread = _in_rounds(tour, repeats, rounds)
            if self._length(spread) <= most:
                return spread
        return plain

    def _length(self, rows: Indices) -> float:
        """Time of visits in order [s]."""
        ends = self._ends(np.arange(self.places))
        driving = tour_seconds(self.seconds, *ends, self.place[rows])
        return driving + len(rows) * self.costs.dwell_s

    def _tour(self, rows: Indices) -> Indices:
        """Rows in the order of a short tour; those of one place follow each other."""
        places, first, which = np.unique(self.place[rows], return_index=True, return_inverse=True)
        order = np.argsort(first, kind="stable")  # so that ties are decided by the plan's order
        places = places[order]
        if len(places) > EXCHANGES_UP_TO:
            tour = shortest_legs(self.map.q[places] / self.map.speeds.of)
        else:
            tour = short_tour(self.seconds[np.ix_(places, places)], *self._ends(places))
        rank = np.empty(len(places), dtype=int)
        rank[order[tour]] = np.arange(len(places))
        return np.asarray(rows[np.argsort(rank[which.reshape(-1)], kind="stable")])

    def _ends(self, places: Indices) -> tuple[Array, Array]:
        """Time from home to each place, and back [s]; nothing without a home pose."""
        if self.home is None:
            return np.zeros(len(places)), np.zeros(len(places))
        return self.seconds[self.home, places], self.seconds[places, self.home]

    def _steps(self, passes: Sequence[_Pass]) -> Iterator[Step]:
        """All that takes time, with the clock."""
        clock = 0.0
        load = np.zeros_like(passes[0].load)
        at = int(self.place[passes[0].rows[0]]) if self.home is None else self.home

        def step(
            what: What, to: int, stay: float, row: int | None = None, visit: int | None = None
        ) -> Step:
            """Drive to a place, and stay there."""
            nonlocal clock, at
            way = None if at == to else self.map.way(at, to)
            start = clock
            clock += stay + (0.0 if way is None else way.seconds)
            direct = None if at == to else self.map.leg(at, to)
            at = to
            touches = bool(self.map.shut[to])
            return Step(what, start, clock, self.map.q[to], way, row, visit, load, direct, touches)

        if self.costs.warm_up_s:
            yield step("warm-up", at, self.costs.warm_up_s)
        for k, one in enumerate(passes):
            # What the day begins with is mounted beforehand.
            if k and (one.load != load).any():
                load = one.load
                where = at if self.home is None else self.home
                yield step("load change", where, self.costs.load_change_s)
            load = one.load
            for row, visit in zip(one.rows.tolist(), one.visits.tolist(), strict=True):
                yield step("visit", int(self.place[row]), self.costs.dwell_s, row, visit + 1)
        if self.home is not None:
            yield step("home", self.home, 0.0)


def _read(study: Study, plan: Plan) -> Mask:
    """In which rows of a plan (k,) something is read; all where nothing is anywhere."""
    if study.sight is None:
        return np.ones(len(plan.q), dtype=bool)
    read = study.sight.rows(plan.q).any(axis=1)
    return np.asarray(read if read.any() else ~read)


def _in_rounds(tour: Indices, repeats: Indices, rounds: int) -> Indices:
    """Visits in several rounds, every other one backwards.

    The j-th of r visits of a pose is in round ``floor((j + 1/2) rounds / r)``.
    """
    shares = [np.floor((np.arange(times) + 0.5) * rounds / times).astype(int) for times in repeats]
    parts = []
    for number in range(rounds):
        own = np.repeat(tour, [(share == number).sum() for share in shares])
        parts.append(own if number % 2 == 0 else own[::-1])
    return np.concatenate(parts)


def _via_limits(study: Study) -> list[Array]:
    """Limits (2, n) of via poses: first with fixed joints where they are, then those of the robot.

    A joint that poses do not turn, as a load does not excite it, may well turn between them.
    """
    every = study.robot.limits
    if not study.fixed:
        return [every]
    still = every.copy()
    for j, value in study.fixed.items():
        still[:, j] = value
    return [still, every]
