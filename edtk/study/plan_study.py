"""The exact plan that a study asks for."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from time import monotonic

import numpy as np

from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.exact.find_plan import STARTS, SearchOptions, find_plan
from edtk.design.exact.require_enough import TooFewExperimentsError, require_enough
from edtk.design.plan import Plan
from edtk.design.relaxation.relax_options import RelaxOptions
from edtk.design.relaxation.relax_poses import relaxed_in_time
from edtk.study.plan_accuracy import plan_accuracy
from edtk.study.plan_plausibility import plan_plausibility
from edtk.study.planning_space import planning_space
from edtk.study.relax_study import source_of
from edtk.study.run_options import DEFAULTS, RunOptions
from edtk.study.study import Study
from edtk.study.study_errors import study_errors
from edtk.system.errors import ArgumentError
from edtk.system.time_limit import time_limit

# Descents hold matrices whose order grows with the number of distinct poses.
MOST_DISTINCT = 200
# Time [s] of a search after which it is worth while to start further processes, each of which takes
# a second to load what it needs.
ALONE = 2.0


def plan_study(
    study: Study,
    size: int,
    criterion: str | None = None,
    *,
    distinct: int | None = None,
    kept: Plan | None = None,
    budget: float | None = None,
    options: RunOptions = DEFAULTS,
) -> ExactPlan:
    """Search for the best plan of `size` experiments in all, with a bound on every such plan.

    Args:
        study: The study.
        size: Number of experiments, kept ones counted.
        criterion: Name of a criterion; defaults to the one that the study is about.
        distinct: Number of distinct new poses, at most; defaults to p(p+1)/2 + 1, since the best
            weights need no more.
        kept: Experiments that have been carried out already; their information counts as known.
        budget: Seconds after which the best plan so far is returned; defaults to no limit. A
            first design on the candidates and a first plan are always completed.
        options: Seed, processes and progress.

    Ctrl-C leaves the best plan so far as soon as there is a first design on the candidates.

    Raises:
        UserError: One line that says what cannot be done, and where.
    """
    since = monotonic()
    seconds = np.inf if budget is None else budget
    new = _new_experiments(size, distinct, kept)
    asked = study.criterion(criterion)
    with study_errors(study), _enough(study, new, kept):
        space = planning_space(study, new, kept)
        if asked.needs_all:  # else only the relaxation knows how few the right poses are
            require_enough(space, new, new if distinct is None else distinct, asked)
        with time_limit(seconds):
            relaxed, interrupted = relaxed_in_time(
                source_of(study, options.seed, space),
                study.specification.candidates,
                asked,
                RelaxOptions(progress=_bounding(options)),
            )
            left = 0.0 if interrupted else np.inf
            found = find_plan(relaxed, new, distinct, kept, _search_options(study, options, left))
    if interrupted:
        found = replace(found, ended="interrupted")
    expected = plan_accuracy(study, found.whole)
    return replace(
        found,
        expected=expected,
        with_prior=study.prior_information is not None,
        warnings=study.warnings + plan_plausibility(study, found.whole, expected),
        seconds=monotonic() - since,
    )


def _bounding(options: RunOptions) -> Callable[[str, float], object]:
    """The progress of the relaxation, by the names that people read."""

    def progress(stage: str, gap: float) -> None:
        options.progress(f"bound: {stage}", gap)

    return progress


def _search_options(study: Study, options: RunOptions, seconds: float) -> SearchOptions:
    """Options of the search for the plan, for which so many seconds are left."""

    def progress(starts: int, cost: float) -> None:
        options.progress(f"{starts} starts", cost)

    return SearchOptions(
        seed=study.specification.seed if options.seed is None else options.seed,
        starts=STARTS,
        seconds=seconds,
        workers=options.workers,
        alone=ALONE,
        progress=progress,
    )


def _new_experiments(size: int, distinct: int | None, kept: Plan | None) -> int:
    """Number of new experiments.

    Raises:
        ArgumentError: There is nothing to plan, or the poses are too many.
    """
    count = 0 if kept is None else kept.experiments
    new = size - count
    if new < 1:
        message = f"{count} experiments are kept; expected more than that"
        raise ArgumentError(message, argument="size", given=size)
    if distinct is not None and distinct > new:
        message = f"expected at most {new}, the number of new experiments"
        raise ArgumentError(message, argument="distinct", given=distinct)
    if distinct is not None and distinct > MOST_DISTINCT:
        message = f"expected at most {MOST_DISTINCT}"
        raise ArgumentError(message, argument="distinct", given=distinct)
    return new


@contextmanager
def _enough(study: Study, new: int, kept: Plan | None) -> Iterator[None]:
    """Turn the error of too few experiments or poses into one about the arguments.

    Raises:
        ArgumentError: They are too few; says how many are enough.
    """
    try:
        yield
    except TooFewExperimentsError as error:
        argument = "size" if new < error.least else "distinct"
        message = str(error)
        if kept is not None and argument == "size":
            message += f"; with the {kept.experiments} kept ones: {kept.experiments + error.least}"
        raise ArgumentError(message, argument=argument, where=study.where) from error
