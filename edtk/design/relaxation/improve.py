"""From a first design to one whose gap is proved: one convex program, or a family of them."""

from collections.abc import Callable

import numpy as np

from edtk.design.problem import RankDeficientError
from edtk.design.relaxation.column_generation import ColumnGeneration
from edtk.design.relaxation.incumbent import Incumbent
from edtk.design.relaxation.restricted_master import RelaxationError
from edtk.design.relaxation.solver_options import NEWTON, SolverOptions
from edtk.system.typing import Array, Indices

Progress = Callable[[int, float], object]
# The bounds of a family's members only hold together, so that each must be sharper than the whole.
MEMBER_GAP = 0.25
# Candidates from which on most programs look at every fiftieth of them only.
LONG = 200_000
EVERY = 50
# Gap over the first of such parts, which are evenly spaced; over the most sensitive ones, in parts
# of what is asked for.
FIRST_GAP = 0.02
PART_GAP = 0.5
PARTS = 6
SAMPLE = 10_000  # sensitivities that tell which are among the largest
MOST = 4  # a part of more than a quarter of the candidates saves nothing


def improve(incumbent: Incumbent, gap: float, options: SolverOptions, progress: Progress) -> None:
    """Improve design and proof until the gap is proved, or stays.

    Args:
        incumbent: The best so far, which changes.
        gap: Relative gap at which to stop.
        options: Limits and solvers.
        progress: Called with the number of restricted master problems so far and the gap.
    """
    is_long = incumbent.problem.n >= LONG and options.solvers[0] == NEWTON
    if not (is_long and _improve_on_parts(incumbent, gap, options, progress)):
        _improve(incumbent, gap, options, progress)


def _improve_on_parts(
    incumbent: Incumbent, gap: float, options: SolverOptions, progress: Progress
) -> bool:
    """Solve over a part of many candidates, price all of them, and again over the most sensitive.

    Returns:
        Whether the gap is proved.
    """
    problem = incumbent.problem
    part = np.arange(0, problem.n, EVERY)
    last = part[:0]
    part_gap = FIRST_GAP
    for _ in range(PARTS):
        inner = Incumbent(problem[part], incumbent.criterion, incumbent.multipliers)
        inner.candidates = np.searchsorted(part, last)
        try:
            inner.problem.require_identifiable(incumbent.criterion)
            _improve(inner, part_gap, options, _ignore_progress)
        except (RankDeficientError, RelaxationError):
            return False
        sensitivities = incumbent.update_from(inner, part, part_gap)
        progress(incumbent.iterations, incumbent.gap)
        if incumbent.gap <= gap:
            return True
        last = np.unique(part[inner.candidates])
        incumbent.candidates = last
        part = _most_sensitive(sensitivities, last)
        if MOST * len(part) > problem.n:
            return False
        part_gap = PART_GAP * gap
    return False


def _most_sensitive(sensitivities: Array, last: Indices) -> Indices:
    """About every fiftieth candidate, those of the largest sensitivities (r, n), and some more."""
    sample = sensitivities[:, :: max(1, sensitivities.shape[1] // SAMPLE)]
    rank = sample.shape[1] - max(1, sample.shape[1] // (EVERY * len(sensitivities)))
    least = np.partition(sample, rank, axis=1)[:, rank]
    near = [np.flatnonzero(own >= low) for own, low in zip(sensitivities, least, strict=True)]
    return np.unique(np.concatenate([last, *near]))


def _improve(incumbent: Incumbent, gap: float, options: SolverOptions, progress: Progress) -> None:
    """Solve the criterion's subproblems, one or several, over all candidates."""
    criterion = incumbent.criterion
    is_family = criterion.most_subproblems > 1
    for _ in range(criterion.most_subproblems):
        Z = incumbent.multipliers
        t = incumbent.largest
        bound_before = incumbent.lower_bound
        subproblem = criterion.subproblem(Z, t, incumbent.M)
        subproblem_gap = MEMBER_GAP * gap if is_family else gap
        generation = ColumnGeneration(incumbent.problem, subproblem, subproblem_gap, options)
        if not is_family:
            # The proof of a convex criterion stands by itself.
            Z = Z[:0]
            t = t[:0]
        for step in generation.steps(incumbent.candidates):
            incumbent.update(step, Z, t)
            progress(incumbent.iterations, incumbent.gap)
        stuck = 0 < incumbent.lower_bound <= bound_before
        if incumbent.gap <= gap or stuck:
            return


def _ignore_progress(iterations: int, gap: float) -> None:
    """Show nothing."""
