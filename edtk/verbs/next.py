"""The experiments that tell most after those that were made already."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from scipy.special import ndtri

import criteria
from criteria import Criterion
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError, UserError, whole_number
from edtk.verbs.asked_limits import kept_candidates
from edtk.verbs.inputs import CriterionLike, at_hand
from edtk.verbs.plan import plan
from edtk.verbs.plan_problem import MOST_PLACES
from edtk.verbs.relax import relax
from edtk.verbs.robust import criterion_of

if TYPE_CHECKING:
    from edtk.design.exact.counts.problem_plan import ProblemPlan
    from edtk.design.exact.plan_region import RegionPlan

BETWEEN = float(ndtri(0.975) - ndtri(0.025))  # width of a 95 % interval, by its deviation
REACHED = 1e-9  # part by which a cost may be above what was asked for
TRIES = 20  # numbers of experiments from the least that the bound allows


@overload
def next(
    problem: Any, keep: Any, k: int = 1, criterion: CriterionLike = "D", seed: int = 0
) -> "ProblemPlan | RegionPlan": ...
@overload
def next(
    problem: Any,
    keep: Any,
    k: int = 1,
    criterion: CriterionLike = "D",
    seed: int = 0,
    *,
    efficiency: float | None = None,
    until: Mapping[str, float] | None = None,
) -> "ProblemPlan | RegionPlan | None": ...
@checked
def next(
    problem: Any,
    keep: Any,
    k: int = 1,
    criterion: CriterionLike = "D",
    seed: int = 0,
    *,
    efficiency: float | None = None,
    until: "Mapping[str, float] | None" = None,  # read below, in words of its own
) -> "ProblemPlan | RegionPlan | None":
    """Find the k experiments that are best beside those at hand, or as many as are needed.

    It is `edtk.plan` of k experiments more than were made. After each experiment ask again, of a
    nonlinear model at the parameters that all data together give.

    With `efficiency` or `until` the number follows: the least that the bound allows, since of fewer
    it is proved that they do not reach it, is tried first, and then the next ones.

    Args:
        problem: The candidates as a `Problem`, or a `Region`.
        keep: Experiments at hand: indices of candidates, each as often as it was measured; a
            `Problem` whose every candidate was measured once; points (n, d) of a region; or a data
            frame with the columns of the candidates, or of the region's variables.
        k: Number of new experiments.
        criterion: See `edtk.plan`.
        seed: Seed of the search.
        efficiency: Instead of k: the efficiency that all experiments together shall have, against
            the bound of every design of as many experiments that keeps nothing.
        until: Instead of k: widths of the 95 % confidence intervals that parameters shall have, by
            their names, such as {"Km": 0.2}. The noise is that of the problem. The plan is the best
            for the widest interval, in parts of what it may be; `criterion` does not matter.

    Returns:
        The plan of all experiments. Of a problem `.new` (k,) are the candidates to measure now,
        of a region `.experiments` (k, d) their points; `.efficiency` compares with every other
        choice of k experiments. None where the experiments at hand are enough.

    Raises:
        UserError: One line that says what cannot be done.

    Example:
        >>> import numpy as np, edtk
        >>> x = np.linspace(-1.0, 1.0, 11)
        >>> parabola = edtk.Problem(np.vander(x, 3)[:, None, :])
        >>> edtk.next(parabola, keep=[0, 0, 5]).new
        array([10])
        >>> edtk.next(parabola, keep=[0, 0, 5], efficiency=0.95).new
        array([10, 10])
    """
    if not isinstance(problem, Problem | Region):
        message = "is about a Problem or a Region; of a study it is edtk.plan with keep"
        raise ArgumentError(message, argument="problem")
    keep = at_hand(problem, keep)
    try:
        made = keep.n if isinstance(keep, Problem) else len(() if keep is None else keep)
    except TypeError as error:
        message = "expected indices of candidates, or a Problem"
        raise ArgumentError(message, argument="keep") from error
    kept = keep if made else None

    def best(new: int, asked: CriterionLike, starts: int | None = None) -> Any:
        size = made + new
        return plan(problem, size=size, keep=kept, criterion=asked, seed=seed, starts=starts)

    if efficiency is None and until is None:
        return best(whole_number(k, "k", 1), criterion)
    if efficiency is not None and until is not None:
        raise ArgumentError("expected one of efficiency and until", argument="until")
    if until is not None:
        of_widths = _of_widths(problem, until)
        return _enough(problem, kept, made, of_widths, lambda size: 1.0, best)
    assert efficiency is not None
    return _enough(problem, kept, made, *_of_efficiency(problem, criterion, efficiency), best)


def _of_widths(problem: Problem | Region, until: Mapping[str, float]) -> Criterion:
    """The largest ``(width / asked width)^2`` of an interval, which has to be at most one.

    Raises:
        ArgumentError: There is no such parameter, or no such width.
    """
    if not isinstance(until, Mapping) or not until:
        message = "expected widths by names of parameters"
        raise ArgumentError(message, argument="until")
    rows = np.zeros((len(until), len(problem.parameters)))
    for i, (name, width) in enumerate(until.items()):
        if name not in problem.parameters:
            message = f"expected some of {', '.join(problem.parameters)}"
            raise ArgumentError(message, argument="until", given=name)
        if not np.isfinite(width) or width <= 0:
            message = f"expected a width above 0 of {name}"
            raise ArgumentError(message, argument="until", given=width)
        rows[i, problem.parameters.index(name)] = BETWEEN / width
    return criteria.create("prediction_G", points=rows)


def _of_efficiency(
    problem: Problem | Region, criterion: CriterionLike, efficiency: float
) -> tuple[Criterion, Callable[[int], float]]:
    """The criterion, and the cost that a design of so many experiments may have.

    Raises:
        ArgumentError: There is no such efficiency.
    """
    if not 0 < efficiency <= 1:
        raise ArgumentError("expected above 0, to 1", argument="efficiency", given=efficiency)
    asked = criterion_of(criterion, problem, lambda model, one: relax(model, one).value)

    def cost(size: int) -> float:
        found = relax(problem, asked, size=size)
        return float(found.told_bound.cost * size**-asked.degree / efficiency)

    return asked, cost


def _enough(
    problem: Problem | Region,
    keep: Any,
    made: int,
    criterion: Criterion,
    most: Callable[[int], float],
    best: Callable[..., Any],
) -> "ProblemPlan | RegionPlan | None":
    """The plan of fewest experiments that was found whose cost is at most that of its size.

    Raises:
        UserError: None was found.
    """
    if keep is not None and _cost_at_hand(problem, keep, criterion) <= most(made):
        return None

    def may(new: int) -> bool:
        """Whether the bound leaves room for so many new experiments."""
        for starts in (1, None):  # rounded weights alone may be singular where others are not
            try:
                found = best(new, criterion, starts)
            except ArgumentError:
                raise
            except UserError:  # so few do not tell what is asked for
                continue
            return bool(found.told_bound.cost <= most(made + new) * (1 + REACHED))
        return False

    high = 1
    while not may(high):
        high *= 2
        if high > MOST_PLACES:
            raise UserError(f"{MOST_PLACES} experiments more do not reach what is asked for")
    low = high // 2  # which is not enough
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if may(middle) else (middle, high)
    new = high
    for _ in range(TRIES):
        try:
            found = best(new, criterion)
        except ArgumentError:
            raise
        except UserError:
            new += 1
            continue
        if found.cost <= most(made + new) * (1 + REACHED):
            return found
        new += max(1, new // TRIES)
    raise UserError(
        f"no plan of {high} to {new} experiments more was found that reaches what is asked for"
    )


def _cost_at_hand(problem: Problem | Region, keep: Any, criterion: Criterion) -> float:
    """The criterion's cost of the experiments that were made."""
    if isinstance(keep, Problem):
        M = keep.kept.weighted(np.ones(keep.n))
        made = keep.n
    else:
        assert isinstance(problem, Problem)  # of a region they are a problem
        kept = problem.kept[kept_candidates(keep, problem.n)]
        M = kept.weighted(np.ones(kept.n))
        made = kept.n
    prior = problem.prior
    return float(criterion.cost(M if prior is None else M + made * prior))
