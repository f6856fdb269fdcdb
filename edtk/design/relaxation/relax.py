"""The convex relaxation over candidates: weights instead of whole numbers of experiments."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from criteria import Criterion, Relaxable
from criteria.require_homogeneous import require_homogeneous
from edtk.design.absorb_prior import absorb_prior
from edtk.design.problem import Problem
from edtk.design.relaxation.improve import improve
from edtk.design.relaxation.incumbent import Incumbent
from edtk.design.relaxation.normalised import normalised
from edtk.design.relaxation.order_one import OrderOne
from edtk.design.relaxation.relaxation import Relaxation
from edtk.design.relaxation.setting import Setting
from edtk.design.relaxation.solver_options import SolverOptions
from edtk.design.relaxation.without_open_directions import proved_on, without_open_directions
from edtk.system.typing import Array

Progress = Callable[[int, float], object]


class RelaxationInterrupted(KeyboardInterrupt):
    """The user has interrupted the relaxation; `best` is the best certified result so far."""

    def __init__(self, best: Relaxation) -> None:
        super().__init__("interrupted")
        self.best = best


def ignore_progress(iterations: int, gap: float) -> None:
    """Show nothing."""


def relax(
    problem: Problem,
    criterion: Criterion,
    gap: float = 1e-6,
    options: SolverOptions = SolverOptions(),  # noqa: B008, frozen
    progress: Progress = ignore_progress,
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
        return sized.outward(_relax(sized.problem, criterion, gap, options, progress, multipliers))
    except RelaxationInterrupted as interrupt:
        raise RelaxationInterrupted(sized.outward(interrupt.best)) from interrupt


def _relax(
    problem: Problem,
    criterion: Relaxable,
    gap: float,
    options: SolverOptions,
    progress: Progress,
    multipliers: Array | None,
) -> Relaxation:
    """`relax` of candidates whose information is of order one, and with no Bayesian prior."""
    problem.require_identifiable(criterion)
    setting = Setting.of(problem, criterion)
    of_cost, _ = setting.errors(None, np.empty((0, problem.p, problem.p)))
    require_homogeneous(setting.criterion, setting.problem.mean, of_cost)
    closed = setting.problem
    if not criterion.needs_all:
        closed = without_open_directions(closed)
    incumbent = Incumbent(
        normalised(closed, setting.criterion), setting.criterion, setting.inward(multipliers)
    )
    try:
        improve(incumbent, gap, options, progress)
    except KeyboardInterrupt as interrupt:
        if not incumbent.iterations:
            raise
        raise RelaxationInterrupted(_result(incumbent, setting, closed, gap)) from interrupt
    return _result(incumbent, setting, closed, gap)


def _result(incumbent: Incumbent, setting: Setting, closed: Problem, gap: float) -> Relaxation:
    """The relaxation of the candidates as they were given."""
    found = incumbent.relaxation(setting.problem, gap)
    if closed is not setting.problem:
        found = proved_on(setting.problem, found)
    return setting.outward(found)


def require_relaxable(criterion: Criterion) -> Relaxable:
    """The criterion, if the relaxation can minimise it.

    Raises:
        NotImplementedError: The criterion has no convex form.
    """
    if not isinstance(criterion, Relaxable):
        raise NotImplementedError(f"criterion {criterion.name} has no convex form to relax")
    return criterion
