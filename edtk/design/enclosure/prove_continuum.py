"""A relaxation over poses whose bound is proved for all poses, between the candidates too.

With U at least the sensitivity ``<Z, M(x)>`` of every feasible pose x, the bound of the criterion's
multiplier Z follows as that over candidates does from their largest sensitivity. `cover` finds U.
Where it finds a pose that is more sensitive than the search has found, the design is made anew with
that pose, and the boxes are kept for the next multiplier.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from criteria import Criterion, Relaxable
from edtk.design.bound import Bound, BoundKind
from edtk.design.candidate_source import CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.design.enclosure.cover import Covering, CoveringInterrupted, cover
from edtk.design.enclosure.objective import Enclosed, Objective
from edtk.design.enclosure.polynomial import NotEnclosedError
from edtk.design.enclosure.robot_polynomials import polynomials_of
from edtk.design.enclosure.space_polynomials import SpacePolynomials
from edtk.design.relaxation.certify import semidefinite
from edtk.design.relaxation.proof import errors, is_normalised, normalised, trace_matrix
from edtk.design.relaxation.relax import require_relaxable
from edtk.design.relaxation.relax_poses import (
    PlanInterrupted,
    RelaxOptions,
    relax_poses,
)
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.system.time_limit import no_progress, out_of_time, time_left, time_limit
from edtk.system.typing import Array

# Of the gap that is asked for: what the search over all poses may leave, and what boxes may take.
SEARCHED = 0.2
COVERED = 0.95
UNTIL_COVERED = 0.5  # of the time that is left: the search before boxes
MOST_DESIGNS = 8  # designs that are made anew, at most
BISECTIONS = 30
# A pose is new to a design where it is more sensitive than all known ones by this part of the gap.
NEW = 0.1
SPECTRAL = 1e-9  # of an eigenvalue, far above its rounding
SAME_SENSITIVITY = 1e-6  # relative difference of a sensitivity and a polynomial that stands for it


@dataclass(frozen=True, eq=False, kw_only=True)
class ProvedPlan(RelaxedPlan):
    """A relaxed design over poses, with a bound that no design over any feasible poses beats.

    Attributes:
        continuum_bound: The bound.
        continuum_multipliers: The multipliers (r, p, p) that prove it.
        coverings: For each of them boxes that cover all poses, with the largest sensitivity.
    """

    continuum_bound: Bound
    continuum_multipliers: Array
    coverings: tuple[Covering, ...]

    @property
    def bounds(self) -> dict[str, Bound]:
        """The others, and that over all poses."""
        return super().bounds | {"continuum": self.continuum_bound}

    @property
    def best_bound(self) -> Bound:
        """The bound that is proved for all poses."""
        return self.continuum_bound

    @property
    def bound_proved(self) -> float:
        """The same as the criterion's formula prints it."""
        return self.continuum_bound.value

    @property
    def boxes(self) -> int:
        """Number of boxes that were looked at."""
        return sum(covering.boxes for covering in self.coverings)

    def to_dict(self) -> dict[str, Any]:
        """Those of a relaxed design, and the printed value that is proved for all poses."""
        proved = self.continuum_bound.value
        return {
            **super().to_dict(),
            "bound_proved": proved if np.isfinite(proved) else None,
            "gap_proved": self.continuum_bound.gap,
            "boxes": self.boxes,
        }


def prove_poses(
    source: CandidateSource,
    n: int,
    criterion: Criterion,
    accuracy: float,
    options: RelaxOptions = RelaxOptions(),  # noqa: B008, frozen
) -> RelaxedPlan:
    """Find the best weights over all poses, and a bound on every design over all poses.

    With a cell the weights are on free poses; what is proved is their relaxation without the cell.

    Args:
        source: Where candidates come from, with model and feasible set.
        n: Number of candidates.
        criterion: A criterion that can be relaxed.
        accuracy: Relative gap between the bound and the design, at most. Where time is up the bound
            is the best that was proved.
        options: Those of the relaxation.

    Raises:
        NotEnclosedError: The sensitivities of the space are no polynomials; says why.
        PlanInterrupted: Ctrl-C; with what was proved, if anything was.
        MemoryLimitError, EmptyFeasibleSetError, RankDeficientError, RelaxationError,
        NotImplementedError: See `relax_poses`.
    """
    relaxable = require_relaxable(criterion)
    require_enclosed(source.without_cell.space, relaxable)
    try:
        proved = _prove_poses(source.without_cell, n, relaxable, accuracy, options)
    except PlanInterrupted as interrupt:
        if source.space.clear is None:
            raise
        with time_limit(0.0):
            free = relax_poses(source, n, relaxable, True, options, beyond=interrupt.best)
        raise PlanInterrupted(free) from None
    if source.space.clear is None:
        return proved
    return relax_poses(source, n, relaxable, True, options, beyond=proved)


def _prove_poses(
    source: CandidateSource, n: int, relaxable: Relaxable, accuracy: float, options: RelaxOptions
) -> ProvedPlan:
    """`prove_poses` without a cell."""
    polynomials = polynomials_of(source.space)
    sharp = replace(
        options,
        gap=min(options.gap, SEARCHED * accuracy),
        tolerance=min(options.tolerance, SEARCHED * accuracy),
    )
    best: ProvedPlan | None = None
    known: Array | None = None
    is_last = False
    for turn in range(MOST_DESIGNS):
        with time_limit(UNTIL_COVERED * time_left()):
            plan = relax_poses(source, n, relaxable, True, sharp, known)
        earlier = () if best is None else best.coverings
        is_last = is_last or turn == MOST_DESIGNS - 1
        attempt = _Attempt(plan, polynomials, accuracy, is_last, options.progress)
        try:
            found = attempt.proved(earlier)
        except CoveringInterrupted as interrupt:
            raise PlanInterrupted(_better(best, attempt.rest(earlier, interrupt.best))) from None
        best = _better(best, found)
        if best.continuum_bound.gap <= accuracy or out_of_time():
            break
        columns = attempt.columns(found.coverings)
        if not len(columns):
            if is_last:
                break
            # What ended a covering was no better pose: the next one goes on to its end.
            is_last = True
            continue
        known = columns if known is None else np.concatenate([known, columns])
    assert best is not None
    return best


def require_enclosed(space: DesignSpace, criterion: Relaxable) -> None:
    """Check, before a long search, that sensitivities of all poses have an enclosure.

    Raises:
        NotEnclosedError: They have none; says why.
    """
    enclosed(polynomials_of(space), criterion, np.eye(space.p))


def prove_plan(
    plan: RelaxedPlan,
    accuracy: float,
    progress: Callable[[str, float], object] = no_progress,
) -> ProvedPlan:
    """A relaxed design as it is, with the bound that its own multipliers prove over all poses.

    Args:
        plan: The design, of a search over all poses.
        accuracy: Relative gap between the bound and the design, at most, as far as the multipliers
            allow. Where time is up, or after Ctrl-C, the bound is the best that was proved.
        progress: Called with the part of the poses that is closed, and the gap.

    Raises:
        NotEnclosedError: The sensitivities of the space are no polynomials; says why.
    """
    attempt = _Attempt(plan, polynomials_of(plan.space), accuracy, True, progress)
    try:
        found = attempt.proved(())
    except CoveringInterrupted as interrupt:
        return replace(attempt.rest((), interrupt.best), ended="interrupted")
    return replace(found, ended="budget") if out_of_time() else found


def _better(first: ProvedPlan | None, second: ProvedPlan) -> ProvedPlan:
    """The design of less cost, with the sharper bound: each bound holds for every design."""
    if first is None:
        return second
    design = first if first.cost < second.cost else second
    proof = first if first.continuum_bound.cost > second.continuum_bound.cost else second
    cost = proof.continuum_bound.cost
    bound = Bound.of(design.criterion, cost, design.cost, BoundKind.PROVED)
    return replace(
        design,
        continuum_bound=bound,
        continuum_multipliers=proof.continuum_multipliers,
        coverings=proof.coverings,
    )


def enclosed(polynomials: SpacePolynomials, criterion: Criterion, Z: Array) -> Enclosed:
    """The sensitivity to a multiplier Z (p, p), with the prior, per trace for a degree of zero."""
    question = polynomials.enclosed(Z)
    prior = polynomials.space.prior
    M0 = np.zeros_like(Z) if prior is None else prior
    above = [f.plus(float(np.sum(Z * M0))) for f in question.objectives]
    if not is_normalised(criterion):
        return replace(question, objectives=tuple(above))
    if not polynomials.is_exact:
        raise NotEnclosedError(
            f"{criterion.label} compares the parts of what a pose tells; where errors depend on "
            "the pose, or distances are measured, there is no more than a bound of these"
        )
    traced = trace_matrix(criterion, len(Z))
    constant = float(np.sum(traced * M0))
    below = [f.plus(constant) for f in polynomials.enclosed(traced).objectives]
    return replace(
        question,
        objectives=tuple(
            Objective(f.numerator, g.numerator) for f, g in zip(above, below, strict=True)
        ),
    )


class _Attempt:
    """What the multipliers of a relaxed design prove over all poses.

    Args:
        plan: The design.
        polynomials: Those of its space.
        accuracy: The gap that is asked for.
        is_last: Whether coverings go on where a pose of larger sensitivity is found.
        progress: Called with the part of the poses that is closed, and the gap.
    """

    def __init__(
        self,
        plan: RelaxedPlan,
        polynomials: SpacePolynomials,
        accuracy: float,
        is_last: bool,
        progress: Callable[[str, float], object],
    ) -> None:
        criterion = plan.criterion
        self.plan = plan
        self.criterion = criterion
        self.accuracy = accuracy
        self.is_last = is_last
        self.progress = progress
        self.polynomials = polynomials
        Z = np.asarray(0.5 * (plan.multipliers + np.swapaxes(plan.multipliers, 1, 2)))
        self.Z = semidefinite(Z) if criterion.monotone else Z
        self.M = plan.information
        self.x = _known(plan)
        problem = plan.space.problem(self.x)
        self.t = normalised(problem, criterion).sensitivities(self.Z).max(axis=1)
        self.error = errors(problem, criterion, None, self.Z)[1]
        self.units = [_unit(criterion, z, t) for z, t in zip(self.Z, self.t.tolist(), strict=True)]
        self.coverings: list[Covering] = []
        self._gaps: dict[float, float] = {}

    def bound(self, t: Array) -> Bound:
        """The bound of largest sensitivities t (r,)."""
        cost = self.criterion.lower_bound(self.Z, t, self.M) if np.isfinite(t).all() else 0.0
        return Bound.of(self.criterion, cost, self.plan.cost, BoundKind.PROVED, self.error)

    def tolerance(self) -> float:
        """How far boxes may be above the largest sensitivities, in parts of their units.

        It is found by bisection of its logarithm. Where the gap is too large without boxes, it is
        the accuracy itself, until poses are found that make the gap smaller.
        """
        units = np.array(self.units)
        wanted = COVERED * self.accuracy
        if self.bound(self.t).gap > wanted:
            return self.accuracy
        low, high = self.accuracy * 1e-4, 1.0
        if self.bound(self.t + low * units).gap > wanted:
            return low
        for _ in range(BISECTIONS):
            middle = (low * high) ** 0.5
            if self.bound(self.t + middle * units).gap > wanted:
                high = middle
            else:
                low = middle
        return low

    def proved(self, earlier: tuple[Covering, ...]) -> ProvedPlan:
        """Cover all poses for each multiplier.

        Raises:
            CoveringInterrupted: Ctrl-C.
        """
        tolerance = self.tolerance()
        for j in range(len(self.Z)):
            self.coverings.append(self._covering(j, tolerance, earlier))
        return self._plan()

    def rest(self, earlier: tuple[Covering, ...], last: Covering) -> ProvedPlan:
        """What is proved where an interruption has ended one of the coverings."""
        self.coverings.append(last)
        with time_limit(0.0):
            for j in range(len(self.coverings), len(self.Z)):
                self.coverings.append(self._covering(j, self.accuracy, earlier))
        return self._plan()

    def _plan(self) -> ProvedPlan:
        """The design with the bound of the coverings."""
        U = np.array([covering.upper for covering in self.coverings])
        own = {name: value for name, value in vars(self.plan).items() if not name.startswith("_")}
        seconds = dict(self.plan.seconds) | {"proof": sum(c.seconds for c in self.coverings)}
        return ProvedPlan(
            **own | {"seconds": seconds},
            continuum_bound=self.bound(U),
            continuum_multipliers=self.Z,
            coverings=tuple(self.coverings),
        )

    def _covering(self, j: int, tolerance: float, earlier: tuple[Covering, ...]) -> Covering:
        """Cover all poses for the j-th multiplier."""
        question = enclosed(self.polynomials, self.criterion, self.Z[j])
        places = self._places(question, self.x)
        values = np.max([f(places) for f in question.objectives], axis=0)
        # Where a polynomial is above a sensitivity, no pose tells that the design is to be another.
        is_exact = values.max() <= self.t[j] + SAME_SENSITIVITY * self.units[j]
        new = self.t[j] + (tolerance + NEW * self.accuracy) * self.units[j]
        return cover(
            question,
            tolerance,
            known=places,
            earlier=earlier[j] if len(earlier) == len(self.Z) else None,
            unit=self.units[j],
            ceiling=_ceiling(self.criterion, self.Z[j]),
            most=np.inf if self.is_last or not is_exact else new,
            progress=partial(self._report, j),
        )

    def _report(self, j: int, above: float, done: float) -> None:
        """Tell how far a covering is, and the gap of its level."""
        part = "" if len(self.Z) == 1 else f" {j + 1} of {len(self.Z)}"
        self.progress(f"all poses{part}, {done:.0%} done", self._gap_at(above))

    def _gap_at(self, above: float) -> float:
        """The gap of a level, of which there are few."""
        if above not in self._gaps:
            self._gaps[above] = self.bound(self.t + above * np.array(self.units)).gap
        return self._gaps[above]

    def _places(self, question: Enclosed, x: Array) -> Array:
        """Experiments x (m, v) as places of the part of the box that stands for all of it."""
        t = (x - question.base[0]) @ np.linalg.pinv(question.matrix).T
        return self.polynomials.halving.inside(t)

    def columns(self, coverings: tuple[Covering, ...]) -> Array:
        """Feasible experiments (k, v) that are more sensitive than those of the design."""
        found = []
        for j, covering in enumerate(coverings):
            place = covering.place[None]
            question = covering.enclosed
            best = int(np.argmax([f(place)[0] for f in question.objectives]))
            x = self.polynomials.folded(question.experiments(place, best))
            here = self.plan.space.at(x)
            if not here.feasible.all():
                continue
            problem = normalised(self.plan.space.problem(x), self.criterion)
            own = problem.sensitivities(self.Z[j : j + 1])[0, 0]
            if own > self.t[j] + NEW * self.accuracy * self.units[j]:
                found.append(x)
        return np.concatenate([np.empty((0, self.x.shape[1])), *found])


def _known(plan: RelaxedPlan) -> Array:
    """Experiments (k, v) of a design, and the most sensitive ones that a search has found."""
    searched = plan.searched_sensitivities
    return plan.x if searched is None else np.concatenate([plan.x, searched.x])


def _unit(criterion: Relaxable, Z: Array, t: float) -> float:
    """What a sensitivity is measured in: the largest one; per trace, what its size can be."""
    if not is_normalised(criterion):
        return float(t)
    return float(np.abs(_spectrum(criterion, Z)).max())


def _ceiling(criterion: Relaxable, Z: Array) -> float:
    """What no sensitivity per trace is above: the largest eigenvalue, less nothing by rounding."""
    if not is_normalised(criterion):
        return np.inf
    z = _spectrum(criterion, Z)
    return float(z.max() + SPECTRAL * np.abs(z).max())


def _spectrum(criterion: Relaxable, Z: Array) -> Array:
    """Eigenvalues (p,) of a multiplier Z (p, p) for designs of unit trace."""
    B = criterion.trace_root
    if B is not None:
        S = np.linalg.inv(B)
        Z = S @ Z @ S.T
    return np.asarray(np.linalg.eigvalsh(Z), dtype=float)
