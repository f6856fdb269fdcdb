"""The convex relaxation over candidates: weights instead of whole numbers of experiments."""

from collections.abc import Callable
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from criteria import Criterion, Relaxable
from edtk.design.problem import Problem, RankDeficientError
from edtk.design.problems import absorb_prior
from edtk.design.relaxation.column_generation import ColumnGeneration
from edtk.design.relaxation.incumbent import Incumbent
from edtk.design.relaxation.proof import normalised
from edtk.design.relaxation.relaxation import Relaxation
from edtk.design.relaxation.restricted_master import NEWTON, RelaxationError, SolverOptions
from edtk.design.relaxation.setting import OrderOne, Setting, solvable
from edtk.system.time_limit import no_progress, out_of_time, time_limit
from edtk.system.typing import Array, Indices
from edtk.system.workers import one_thread

# The bounds of a family's members only hold together, so that each must be sharper than the whole.
MEMBER_GAP = 0.25
# A member has done its part where it has raised the bound on its own cost by all but this part.
LEFT_TO_MEMBER = 0.1
# Candidates from which on most programs look at every fiftieth of them only.
LONG_LIST = 200_000
EVERY = 50
# Gap over the first of such parts, which are evenly spaced; over the most sensitive ones, in parts
# of what is asked for.
FIRST_GAP = 0.05
PART_GAP = 0.5
PARTS = 6
SAMPLE = 10_000  # sensitivities that tell which are among the largest
FEWEST_PARTS = 4  # a part of more than a quarter of the candidates saves nothing


Progress = Callable[[int, float], object]


def improve(incumbent: Incumbent, gap: float, options: SolverOptions, progress: Progress) -> None:
    """Improve design and proof until the gap is proved, or stays.

    Args:
        incumbent: The best so far, which changes.
        gap: Relative gap at which to stop.
        options: Limits and solvers.
        progress: Called with the number of restricted master problems so far and the gap.
    """
    is_long = incumbent.problem.n >= LONG_LIST and options.solvers[0] == NEWTON
    if not (is_long and _improve_on_parts(incumbent, gap, options, progress)):
        _improve(incumbent, gap, options, progress)


def _improve_on_parts(
    incumbent: Incumbent, gap: float, options: SolverOptions, progress: Progress
) -> bool:
    """Solve over a part of many candidates, price all of them, and again over the most sensitive.

    Returns:
        Whether the gap is proved, or the time is over.
    """
    problem = incumbent.problem
    part = np.arange(0, problem.n, EVERY)
    candidates = _first_part(problem)
    part_gap = FIRST_GAP
    for _ in range(PARTS):
        inner = Incumbent(candidates, incumbent.criterion, incumbent.multipliers)
        inner.last = incumbent.last.inside(part)
        try:
            inner.problem.require_identifiable(incumbent.criterion)
            _improve(inner, part_gap, options, no_progress)
        except (RankDeficientError, RelaxationError):
            return False
        sensitivities = incumbent.update_from(inner, part, part_gap, part_gap <= gap)
        progress(incumbent.iterations, incumbent.gap)
        if incumbent.gap <= gap or out_of_time():
            return True
        incumbent.last = inner.last.outside(part)
        part = _most_sensitive(sensitivities(), incumbent.last.candidates)
        if FEWEST_PARTS * len(part) > problem.n:
            return False
        candidates = problem[part]
        part_gap = PART_GAP * gap
    return False


def _first_part(problem: Problem) -> Problem:
    """Every fiftieth candidate; criteria of the same candidates share it, and what it knows."""
    if problem not in _first_parts:
        _first_parts[problem] = problem[np.arange(0, problem.n, EVERY)]
    return _first_parts[problem]


# They are forgotten with the problem.
_first_parts: WeakKeyDictionary[Problem, Problem] = WeakKeyDictionary()


def _most_sensitive(sensitivities: Array, last: Indices) -> Indices:
    """About every fiftieth candidate, those of the largest sensitivities (r, n), and some more."""
    sample = sensitivities[:, :: max(1, sensitivities.shape[1] // SAMPLE)]
    rank = sample.shape[1] - max(1, sample.shape[1] // EVERY)
    least = np.partition(sample, rank, axis=1)[:, rank]
    near = np.asarray((sensitivities >= least[:, None]).any(axis=0))
    near[last] = True
    return np.flatnonzero(near)


def _improve(incumbent: Incumbent, gap: float, options: SolverOptions, progress: Progress) -> None:
    """Solve the criterion's subproblems, one or several, over all candidates."""
    for _ in range(incumbent.criterion.most_subproblems):
        bound_before = incumbent.lower_bound
        _improve_by_member(incumbent, gap, options, progress)
        stuck = 0 < incumbent.lower_bound <= bound_before
        if incumbent.gap <= gap or stuck or out_of_time():
            return


def _improve_by_member(
    incumbent: Incumbent, gap: float, options: SolverOptions, progress: Progress
) -> None:
    """Solve the criterion itself, or the next member of its family."""
    criterion = incumbent.criterion
    Z = incumbent.multipliers
    t = incumbent.largest
    subproblem = criterion.subproblem(Z, t, incumbent.M)
    is_family = criterion.most_subproblems > 1
    known = subproblem.lower_bound(Z, t, incumbent.M) if is_family and len(t) else 0.0
    subproblem_gap = MEMBER_GAP * gap if is_family else gap
    generation = ColumnGeneration(incumbent.problem, subproblem, subproblem_gap, options)
    if not is_family:
        # The proof of a convex criterion stands by itself.
        Z = Z[:0]
        t = t[:0]
    for step in generation.steps(incumbent.last):
        incumbent.update(step, Z, t)
        progress(incumbent.iterations, incumbent.gap)
        left = step.cost - step.proof.lower_bound
        if is_family and left <= LEFT_TO_MEMBER * (step.cost - known):
            return


class RelaxationInterrupted(KeyboardInterrupt):
    """The user has interrupted the relaxation; `best` is the best certified result so far."""

    def __init__(self, best: Relaxation) -> None:
        super().__init__("interrupted")
        self.best = best


def relax(
    problem: Problem,
    criterion: Criterion,
    gap: float = 1e-6,
    options: SolverOptions = SolverOptions(),  # noqa: B008, frozen
    progress: Progress = no_progress,
    multipliers: Array | None = None,
) -> Relaxation:
    """Find the weights of candidates that minimise a criterion's cost, and prove a bound.

    The program ``min cost(M), M = sum_i w_i M_i, sum_i w_i = 1, w >= 0`` is solved by
    `ColumnGeneration`. Every design obeys ``<Z, M> <= max_i <Z, M_i>`` for the multiplier Z of the
    equation, which bounds its cost (`Relaxable.lower_bound`). Cost and bound are computed anew from
    weights and multiplier, whatever a solver says. A criterion that is the least of a family of
    convex ones is solved member by member, and several multipliers prove its bound together.

    Args:
        problem: The candidates (n).
        criterion: A criterion that can be relaxed.
        gap: Relative gap at which to stop. The gap of the result may be larger.
        options: Limits and solvers.
        progress: Called with the number of restricted master problems so far and the gap.
        multipliers: Multipliers (r, p, p) of a like problem, from which a family starts.

    Raises:
        NotImplementedError: The criterion cannot be relaxed.
        CriterionError: The criterion is not homogeneous of the degree that it declares.
        RankDeficientError: The candidates cannot identify all parameters.
        RelaxationError: No solver found a design.
        RelaxationInterrupted: Ctrl-C after a first certified design, which it carries.
    """
    criterion = require_relaxable(criterion)
    if criterion.precision is not None:
        plain, base = absorb_prior(problem, criterion)
        found = relax(plain, base, gap, options, progress, multipliers)
        return replace(found, criterion=criterion)
    sized = OrderOne.of(problem)
    try:
        # Products with small matrices gain nothing by threads, which wait for each other, spinning.
        with one_thread():
            found = _relax(sized.problem, criterion, gap, options, progress, multipliers)
        return found.in_given_unit(sized)
    except np.linalg.LinAlgError as error:
        raise RankDeficientError(
            f"criterion {criterion.label}: the candidates do not tell what it needs to working "
            f"precision: their condition number is {problem.conditioning.number:.1e}; centre or "
            "scale the regressors"
        ) from error
    except RelaxationInterrupted as interrupt:
        raise RelaxationInterrupted(interrupt.best.in_given_unit(sized)) from interrupt


def _relax(
    problem: Problem,
    criterion: Relaxable,
    gap: float,
    options: SolverOptions,
    progress: Progress,
    multipliers: Array | None,
) -> Relaxation:
    """`relax` of candidates whose information is of order one, and with no Bayesian prior."""
    setting, closed = solvable(problem, criterion)
    incumbent = Incumbent(
        normalised(closed, setting.criterion), setting.criterion, setting.inward(multipliers)
    )
    try:
        improve(incumbent, gap, options, progress)
    except KeyboardInterrupt as interrupt:
        if not incumbent.iterations:
            raise
        # Whoever has interrupted it waits: weights on fewer candidates are worth no second.
        with time_limit(0.0):
            found = _result(incumbent, setting, closed, gap, options.few)
        raise RelaxationInterrupted(found) from interrupt
    return _result(incumbent, setting, closed, gap, options.few)


def _result(
    incumbent: Incumbent, setting: Setting, closed: Problem, gap: float, few: bool
) -> Relaxation:
    """The relaxation of the candidates as they were given."""
    found = incumbent.relaxation(setting.problem, gap, few)
    if closed is not setting.problem:
        found = found.opened(setting.problem)
    return found.outward(setting)


def require_relaxable(criterion: Criterion) -> Relaxable:
    """The criterion, if the relaxation can minimise it.

    Raises:
        NotImplementedError: The criterion has no convex form.
    """
    if not isinstance(criterion, Relaxable):
        raise NotImplementedError(f"criterion {criterion.name} has no convex form to relax")
    return criterion
