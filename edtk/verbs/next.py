"""The experiments that tell most after those that were made already."""

from typing import TYPE_CHECKING, Any

from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.system.errors import ArgumentError, whole_number
from edtk.verbs.inputs import CriterionLike
from edtk.verbs.plan import plan

if TYPE_CHECKING:
    from edtk.design.exact.counts.problem_plan import ProblemPlan
    from edtk.design.exact.plan_region import RegionPlan


def next(
    problem: Any,
    keep: Any,
    k: int = 1,
    criterion: CriterionLike = "D",
    seed: int = 0,
) -> "ProblemPlan | RegionPlan":
    """Find the k experiments that are best beside those at hand.

    It is `edtk.plan` of k experiments more than were made. After each experiment ask again, of a
    nonlinear model at the parameters that all data together give.

    Args:
        problem: The candidates as a `Problem`, or a `Region`.
        keep: Experiments at hand: indices of candidates, each as often as it was measured, or a
            `Problem` whose every candidate was measured once.
        k: Number of new experiments.
        criterion: See `edtk.plan`.
        seed: Seed of the search.

    Returns:
        The plan of all experiments. Of a problem `.new` (k,) are the candidates to measure now,
        of a region `.experiments` (k, d) their points; `.efficiency` compares with every other
        choice of k experiments.

    Raises:
        UserError: One line that says what cannot be done.

    Example:
        >>> import numpy as np, edtk
        >>> x = np.linspace(-1.0, 1.0, 11)
        >>> parabola = edtk.Problem(np.vander(x, 3)[:, None, :])
        >>> edtk.next(parabola, keep=[0, 0, 5]).new
        array([10])
    """
    if not isinstance(problem, Problem | Region):
        message = "is about a Problem or a Region; of a study it is edtk.plan with keep"
        raise ArgumentError(message, argument="problem")
    try:
        made = keep.n if isinstance(keep, Problem) else len(keep)
    except TypeError as error:
        message = "expected indices of candidates, or a Problem"
        raise ArgumentError(message, argument="keep") from error
    size = made + whole_number(k, "k", 1)
    kept = keep if made else None
    if isinstance(problem, Region):
        return plan(problem, size=size, keep=kept, criterion=criterion, seed=seed)
    return plan(problem, size=size, keep=kept, criterion=criterion, seed=seed)
