"""A plan of whole experiments with its value, its bound, and the sizes that it may have."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from criteria import Criterion
from criteria.linalg.estimable import range_whitener
from criteria.linalg.inverse import whitener
from edtk.cell.plan_check import PlanCheck, Seen
from edtk.design.bound import (
    HEADLINE,
    Bound,
    BoundedDesign,
    BoundKind,
    printed_bounds,
    printed_form,
)
from edtk.design.candidate_source import CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.design.detection import Detection, Separation
from edtk.design.exact.exact_tree import ExactTree
from edtk.design.plan import Plan
from edtk.design.problem import Problem
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.findings.finding import Finding
from edtk.measure.expected_error import ErrorBudget, ExpectedError, TaskAccuracy
from edtk.measure.pose_table import in_file_units, wrench_columns
from edtk.robots.robot import Robot
from edtk.robots.workspace import joints_on_limits
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

DRAWN_POSES = 4000  # random poses; a direction that one in thirty excites is seen a hundred times
# Least eigenvalue that counts as identified, in parameters that whiten the mean of these poses. A
# direction that no chosen pose excites has SINGULAR. Of random pairs of poses of the paper's study
# even the worst of two thousand has 7e-7, and a pair that was chosen has one.
IDENTIFIED = 1e-7
UNEXCITED = 1e-9  # lets the determinant of too few poses tell which pose adds a direction


class NoPlanError(ValueError):
    """There is no such plan; the message is the reason."""


class TooFewExperimentsError(NoPlanError):
    """More experiments, or more distinct poses, are needed to identify all parameters.

    Attributes:
        what: "experiment" or "distinct pose".
        number: The number that was asked for.
        parameters: The number of parameters.
        least: The smallest number that can identify them.
        of: Label of a criterion that needs some of the parameters only; empty if all are needed.
    """

    def __init__(self, what: str, number: int, parameters: int, least: int, of: str = "") -> None:
        super().__init__(what, number, parameters, least, of)
        self.what = what
        self.number = number
        self.parameters = parameters
        self.least = least
        self.of = of

    def __str__(self) -> str:
        plural = "s" if self.number > 1 else ""
        needed = f"what {self.of} needs" if self.of else f"{self.parameters} parameters"
        return (
            f"{self.number} {self.what}{plural} cannot identify {needed}; "
            f"the smallest number is {self.least}"
        )


def require_enough(space: DesignSpace, m: int, places: int, criterion: Criterion) -> None:
    """Check that m experiments at so many distinct poses can identify all that a criterion needs.

    Raises:
        TooFewExperimentsError: They cannot; carries the smallest number that can.
        RankDeficientError: No number of experiments can.
    """
    least = smallest_size(space, criterion)
    for what, number in (("experiment", m), ("distinct pose", places)):
        if number < least:
            of = "" if criterion.needs_all else criterion.label
            raise TooFewExperimentsError(what, number, space.p, least, of)


def smallest_size(space: DesignSpace, criterion: Criterion | None = None) -> int:
    """Find the least number of experiments whose information is regular.

    Of random poses, the one with the largest determinant beside those chosen before (and the
    prior) is chosen next. A pose that adds a direction is thus preferred to one that adds none,
    and p poses have all p directions.

    A criterion that is not about all parameters needs less: there the pose is chosen that lowers
    its cost most, until the cost is finite.

    Args:
        space: Model, feasible set and prior.
        criterion: Tells what has to be identified; defaults to all parameters.

    Raises:
        RankDeficientError: No number of experiments identifies all that has to be.
    """
    problem = CandidateSource(space, 0, workers=1).take(DRAWN_POSES).problem
    problem.require_identifiable(criterion)
    if criterion is not None and not criterion.needs_all:
        return _smallest_size_for(criterion, problem)
    p = space.p
    T = whitener(problem.mean)
    blocks = T.T @ problem.blocks() @ T
    M = UNEXCITED * np.eye(p)
    if problem.prior is not None:
        M = M + T.T @ problem.prior @ T
    for size in range(1, p + 1):
        M = M + blocks[int(np.linalg.slogdet(M + blocks).logabsdet.argmax())]
        if np.linalg.eigvalsh(M)[0] > IDENTIFIED:
            return size
    return p


def _smallest_size_for(criterion: Criterion, problem: Problem) -> int:
    """The same for a criterion that is finite at some singular matrices."""
    T = range_whitener(problem.mean)
    whitened = criterion.in_units(T)
    blocks = T.T @ problem.blocks() @ T
    r = T.shape[1]
    M = np.zeros((r, r)) if problem.prior is None else T.T @ problem.prior @ T
    for size in range(1, r + 1):
        best = int(np.argmin(whitened.cost(M + blocks + UNEXCITED * np.eye(r))))
        M = M + blocks[best]
        if np.isfinite(whitened.cost(M)):
            return size
    return r


@dataclass(frozen=True, eq=False)
class FoundPlan:
    """The best plan of a search, before anybody says what it is worth.

    Attributes:
        x: Design variables (k, v) of its experiments.
        repeats: How often each is made (k,).
        cost: Its cost, of what is known besides too.
        starts: Number of starts.
        found: How many of the refined plans came out as this one.
        optima: How many different plans they came out as.
        ended: Why the search ended: "stagnation", "starts", "budget" or "interrupted".
    """

    x: Array
    repeats: Indices
    cost: float
    starts: int
    found: int
    optima: int
    ended: str


@dataclass(frozen=True)
class OffGuess:
    """How good a plan is where the springs, at a guess of which it was designed, are others.

    Attributes:
        factor: Compliances over those that were guessed, or pulls of compensators over theirs.
        efficiency: Bound on all plans for such a robot over the cost of this one; zero where there
            is no such robot.
        of: What was guessed: "springs" or "compensators".
        why: Why there is no such robot; empty where there is one.
    """

    factor: float
    efficiency: float
    of: str = "springs"
    why: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        efficiency = None if self.why else self.efficiency
        return {"factor": self.factor, "efficiency": efficiency, "of": self.of}


@dataclass(frozen=True)
class Compromise:
    """What a plan gives up of its criterion for a second one, and what that brings.

    Attributes:
        second: The second criterion, in words.
        weight: Its weight in the compound criterion that was searched.
        allowed: The share of the first criterion that may be given up.
        given_up: The share that is: 1 - (cost of the plan for the first alone) / (cost).
        value_alone: Value of the first criterion in the plan for it alone.
        second_alone: Value of the second criterion in that plan.
        second_value: Value of the second criterion in this plan.
        times: How many times as many experiments the plan for the first alone would need to be as
            good for the second.
        shown: Factor and unit in which values of the second criterion are shown.
    """

    second: str
    weight: float
    allowed: float
    given_up: float
    value_alone: float
    second_alone: float
    second_value: float
    times: float
    shown: tuple[float, str]

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "for": self.second,
            "weight": self.weight,
            "give_up_percent": 100 * self.allowed,
            "given_up_percent": 100 * self.given_up,
            "value_alone": self.value_alone,
            "second_alone": self.second_alone,
            "second_value": self.second_value,
            "times": self.times,
        }


@dataclass(frozen=True, eq=False)
class TriedPlace:
    """A listed place of the tracker, with mounts of the reflectors where these are listed.

    Attributes:
        position: The place (3,), in the world frame [m]; None where there is no tracker.
        cost: Cost of the best plan there; None without one.
        bound: No plan there costs less; None without a plan.
        why: Why there is none; empty where there is one.
        left_out: Whether the search was ended before it came there.
        normals: Where each reflector looks (3,) whose mount is chosen, by its marker's name.
    """

    position: Array | None
    cost: float | None
    bound: Bound | None
    why: str = ""
    left_out: bool = False
    normals: Mapping[str, Array] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON [m]."""
        value = None
        if self.bound is not None and self.cost is not None:
            value = printed_form(self.cost, self.bound.sense)
        return {
            **_set_up(self),
            "value": value,
            "bound": _shown_bound(self.bound),
            **({"why": self.why} if self.why else {}),
        }


@dataclass(frozen=True, eq=False)
class Placement:
    """Where the tracker is to stand and reflectors are to look, chosen together with the poses.

    Attributes:
        position: The place (3,), in the world frame [m]; None where there is no tracker.
        source: "listed", or "box" where it was searched.
        tried: The listed places, each with each of the listed mounts.
        looked: Places of the box from which the search began; zero without a box.
        normals: Where each reflector looks (3,) whose mount is chosen, by its marker's name.
    """

    position: Array | None
    source: str
    tried: tuple[TriedPlace, ...]
    looked: int
    normals: Mapping[str, Array] = field(default_factory=dict)

    @property
    def bound(self) -> Bound | None:
        """The best of the bounds of the listed places: no plan at any of them costs less.

        A place that has no plan, as it sees no marker, has nothing to bound. None where the search
        was ended before it came to each of them, or the chosen place is not listed.
        """
        bounds = [one.bound for one in self.tried if one.bound is not None]
        if self.source != "listed" or any(one.left_out for one in self.tried):
            return None
        return min(bounds, key=lambda bound: bound.cost)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON [m]."""
        return {
            **_set_up(self),
            "source": self.source,
            "bound_over_places": _shown_bound(self.bound),
            "places": [one.to_dict() for one in self.tried],
        }


def _set_up(one: TriedPlace | Placement) -> dict[str, Any]:
    """Place and mounts for JSON."""
    place = None if one.position is None else one.position.tolist()
    normals = {name: normal.tolist() for name, normal in one.normals.items()}
    return {"position": place, **({"normals": normals} if normals else {})}


def _shown_bound(bound: Bound | None) -> float | None:
    """A bound as JSON has it, which knows no infinity."""
    return None if bound is None or not np.isfinite(bound.value) else bound.value


@dataclass(frozen=True, eq=False)
class OnCandidates:
    """What is proved about all plans of as many experiments on some candidate poses.

    Attributes:
        candidates: Number of candidates.
        bound: No plan on them costs less.
        best: Cost of the best plan on them that is known.
        plan: That plan.
        counts: How often each candidate is measured in it (n,).
        tree: Why no plan costs less than the bound.
        proved: Whether it is the best of all.
        seconds: Duration [s].
        ended: Why the proof ended: "proved", "budget", "interrupted" or "rounding".
    """

    candidates: int
    bound: Bound
    best: float
    plan: Plan
    counts: Indices
    tree: ExactTree
    proved: bool
    seconds: float
    ended: str

    @property
    def value(self) -> float:
        """The best plan's criterion as its formula prints it."""
        return printed_form(self.best, self.bound.sense)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON; the plan's in SI units."""
        return {
            "proved_exact": self.proved,
            "bound_exact": self.bound.value,
            "on_candidates": {
                "candidates": self.candidates,
                "value": self.value,
                "nodes": self.tree.nodes,
                "seconds": self.seconds,
                "ended": self.ended,
                "plan": self.plan.to_dict(),
            },
        }


@dataclass(frozen=True, eq=False)
class ExactPlan(BoundedDesign):
    """The best plan of m experiments that a search has found.

    Attributes:
        relaxed: The relaxation that the search started from, with its bound.
        plan: Poses, wrenches and repetitions of the new experiments.
        kept: Experiments that exist already; None if there are none.
        cost: The criterion's cost of all experiments together.
        starts: Number of descents.
        found: How many of the plans that were refined to the end came out as this one.
        optima: How many different plans they came out as.
        seconds: Duration of the search [s].
        ended: Why the search ended: "stagnation", "starts", "budget", "interrupted", or "failed"
            where a solver found no answer beyond the first plans.
        expected: Errors to expect in the test pose and around it; None without a test pose, or
            where nobody asked.
        warnings: What is hard to believe in the study or in this plan, a line each.
        error_budget: The error to expect in the task, in parts; None where nobody asked, or
            where no compliances are assumed.
        detections: The chances that faults would be noticed which somebody asked for.
        separations: The chances that each two of these faults would be told apart.
        with_prior: Whether the study's prior counts beside the experiments.
        tasks: Errors to expect in each of several test poses; None for one, or where nobody asked.
        compromise: What the plan gives up for a second criterion; None where nobody asked.
        off_guess: How good the plan is where springs are others than it was designed for.
        on_candidates: What is proved about all plans on candidates; None where nobody asked.
        timetable: When the new experiments are made, see `edtk.calibration.timetable`; None where
            the study says neither how long things take nor what stands around the robot.
        placement: Where the tracker stands and reflectors look, chosen together with the poses;
            None where nobody asked.
    """

    relaxed: RelaxedPlan
    plan: Plan
    kept: Plan | None
    cost: float
    starts: int
    found: int
    optima: int
    seconds: float
    ended: str
    expected: ExpectedError | None = None
    warnings: tuple[Finding, ...] = ()
    error_budget: ErrorBudget | None = None
    detections: tuple[Detection, ...] = ()
    separations: tuple[Separation, ...] = ()
    with_prior: bool = False
    tasks: TaskAccuracy | None = None
    compromise: Compromise | None = None
    off_guess: tuple[OffGuess, ...] = ()
    on_candidates: OnCandidates | None = None
    timetable: Any = None
    placement: Placement | None = None

    @classmethod
    def of(cls, relaxed: RelaxedPlan, found: FoundPlan, kept: Plan | None = None) -> "ExactPlan":
        """The plan that a search has found from a relaxation, whose bound holds for it too."""
        return cls(
            relaxed=relaxed,
            plan=relaxed.space.plan(found.x, found.repeats),
            kept=kept,
            cost=found.cost,
            starts=found.starts,
            found=found.found,
            optima=found.optima,
            seconds=0.0,
            ended=found.ended,
        )

    @property
    def certified(self) -> "ExactPlan":
        """The plan with the bound over all poses, free or not, which certificates are about.

        The plan itself where there is no cell.
        """
        if self.relaxed.without_cell is None:
            return self
        return replace(self, relaxed=self.relaxed.certified, on_candidates=None)

    @property
    def in_cell(self) -> PlanCheck | None:
        """How free its poses are; None without a cell."""
        clear = self.relaxed.space.clear
        return None if clear is None else PlanCheck(clear.cell, self.whole.q)

    @property
    def seen(self) -> Seen | None:
        """What is read in the poses as they are `listed`; None where nothing may be hidden."""
        sight = self.relaxed.space.sight
        return None if sight is None else Seen(sight, self.listed)

    def beside(self, relaxed: RelaxedPlan) -> "ExactPlan":
        """The same plan, with another relaxation of the same question and its bound."""
        return replace(self, relaxed=relaxed)

    @property
    def robot(self) -> Robot:
        """The robot, with the calibration tool."""
        return self.relaxed.space.workspace.robot

    @property
    def on_limits(self) -> dict[str, list[int]]:
        """Rows of `listed` by the joints that stand on their limits there, counted from 0."""
        space = self.relaxed.space
        fixed = frozenset(range(len(space.fixed))) - frozenset(space.free)
        return joints_on_limits(space.model.robot, self.listed, fixed)

    @property
    def listed(self) -> Array:
        """The poses (k, n) in the order in which they are printed [rad or m]."""
        return self.whole.q

    def headline(self) -> str:
        """Criterion, value, size and efficiency."""
        value = self.relaxed.printed(self.value, HEADLINE)
        return (
            f"{self.relaxed.criterion.label} = {value} with {self.whole.experiments} experiments, "
            f"efficiency {100 * self.efficiency:.2f} %"
        )

    @property
    def whole(self) -> Plan:
        """All experiments, the kept ones first."""
        return self.plan if self.kept is None else self.kept + self.plan

    @property
    def lower_bound(self) -> Bound:
        """The bound on the cost of every plan of so many new experiments."""
        return self.relaxed.best_bound.scaled(self.plan.experiments)

    @property
    def told_bound(self) -> Bound:
        """That of every plan of so many experiments."""
        return self.lower_bound

    @property
    def bounds(self) -> dict[str, Bound]:
        """Those of weights, on so many new experiments, and that of whole plans on candidates."""
        m = self.plan.experiments
        found = {name: bound.scaled(m) for name, bound in self.relaxed.bounds.items()}
        exact = self.on_candidates
        return found | ({} if exact is None else {"whole_plans": exact.bound})

    @property
    def proof_ended(self) -> str:
        """Why the proof of the bound over all poses ended; "proved" where nobody asked for one."""
        return self.relaxed.ended

    @property
    def bound_gap(self) -> float:
        """Relative gap between the bound and the best weights.

        It is large only where the search for the bound was cut off.
        """
        return self.relaxed.best_bound.gap

    @property
    def violation(self) -> float:
        """Largest violation of a constraint by a new pose [m or rad]; zero if all are feasible."""
        return float(max(0.0, -self.relaxed.space.workspace.slack(self.plan.q).min()))

    def to_frame(self) -> "pd.DataFrame":
        """Make a table with a pose a row, the kept ones first.

        Its columns are `repeats`, the joint variables in degrees or millimetres, the wrenches in
        newtons and newton metres where they may differ, and, where experiments are kept, whether
        the pose is one of them (`kept`).
        """
        frame = self.whole.to_frame(self.robot)
        frame.insert(0, "repeats", frame.pop("repeats"))
        if self.kept is not None:
            return frame.assign(kept=np.arange(len(frame)) < len(self.kept.q))
        loads = list(wrench_columns(self.whole.wrench))
        return frame if self.shows_loads else frame.drop(columns=loads)

    @property
    def shows_loads(self) -> bool:
        """Whether experiments may differ in their loads."""
        # Kept experiments may have been made under other loads than the new ones.
        return self.kept is not None or bool(self.relaxed.space.load.limits.size)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON: as people read them, and exactly under the key `exact`.

        The rows of `plan` have angles in degrees and lengths in millimetres, the kept experiments
        first. The exact part has the cost, and the experiments in SI units.
        """
        # JSON has no infinity: a bound that says nothing is null.
        bound = self.bound
        gap = self.bound_gap
        return {
            "criterion": self.relaxed.criterion.name,
            "experiments": self.whole.experiments,
            "value": self.value,
            "bound": bound if np.isfinite(bound) else None,
            "bound_searched": self.lower_bound.kind is BoundKind.SEARCHED,
            "bound_proved": self.lower_bound.kind is BoundKind.PROVED,
            "bounds": printed_bounds(self.bounds),
            "bound_gap": gap if np.isfinite(gap) else None,
            "efficiency": self.efficiency,
            "starts": self.starts,
            "found": self.found,
            "optima": self.optima,
            "ended": self.ended,
            "seconds": self.seconds,
            "constraint_violation": self.violation,
            "expected_error": None if self.expected is None else self.expected.to_dict(),
            "warnings": [one.words for one in self.warnings],
            "on_limits": {name: [row + 1 for row in rows] for name, rows in self.on_limits.items()},
            "budget_mm": None if self.error_budget is None else self.error_budget.to_dict(),
            "detect": [detection.to_dict() for detection in self.detections],
            **self._told_apart(),
            **({"with_prior": True} if self.with_prior else {}),
            **self._cell(),
            **({} if self.on_candidates is None else self.on_candidates.to_dict()),
            **({} if self.tasks is None else {"tasks": self.tasks.to_dict()}),
            **({} if self.placement is None else {"tracker": self.placement.to_dict()}),
            **({} if self.compromise is None else {"compromise": self.compromise.to_dict()}),
            **({"off_guess": [one.to_dict() for one in self.off_guess]} if self.off_guess else {}),
            **({} if self.timetable is None else {"timetable": self.timetable.to_dict()}),
            "plan": ([] if self.kept is None else self._rows(self.kept, kept=True))
            + self._rows(self.plan, kept=False),
            "exact": {
                "cost": self.cost,
                "plan": self.plan.to_dict(),
                "kept": None if self.kept is None else self.kept.to_dict(),
            },
        }

    def _cell(self) -> dict[str, Any]:
        """How free the poses are, and the bound over all poses, where there is a cell."""
        if self.in_cell is None:
            return {}
        beyond = self.certified
        bound = beyond.bound if np.isfinite(beyond.bound) else None
        without = {"bound": bound, "efficiency": beyond.efficiency}
        return {"cell": self.in_cell.to_dict(), "without_cell": without}

    def _told_apart(self) -> dict[str, Any]:
        """The chances of right names, where somebody asked for several faults."""
        if not self.separations:
            return {}
        return {"told_apart": [separation.to_dict() for separation in self.separations]}

    def _rows(self, plan: Plan, kept: bool) -> list[dict[str, Any]]:
        """The poses of a plan, one dictionary each, with what is read where some is hidden."""
        q = in_file_units(self.robot, plan.q)
        sight = self.relaxed.space.sight
        seen = None if sight is None else Seen(sight, plan.q)
        return [
            {"q_deg": pose.tolist(), "repeats": int(r), "wrench": W.tolist(), "kept": kept}
            | ({} if seen is None else seen.to_dict(i))
            for i, (pose, r, W) in enumerate(zip(q, plan.repeats, plan.wrench, strict=True))
        ]

    @classmethod
    def from_dict(cls, relaxed: RelaxedPlan, data: Mapping[str, Any]) -> "ExactPlan":
        """Restore the plan that `to_dict` has written, bit by bit.

        Args:
            relaxed: The relaxation that the search started from; the dictionary has no robot.
            data: The dictionary; `seconds` may be missing.

        Raises:
            KeyError: An entry is missing.
        """
        exact = data["exact"]
        kept = exact["kept"]
        return cls(
            relaxed=relaxed,
            plan=Plan.from_dict(exact["plan"]),
            kept=None if kept is None else Plan.from_dict(kept),
            cost=exact["cost"],
            starts=data["starts"],
            found=data["found"],
            optima=data["optima"],
            seconds=data.get("seconds", 0.0),
            ended=data["ended"],
        )
