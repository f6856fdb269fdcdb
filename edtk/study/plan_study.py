"""The exact plan and the relaxation that a study asks for."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from time import monotonic

import numpy as np

from edtk.design.candidate_source import CandidateSource, EmptyFeasibleSetError
from edtk.design.design_space import DesignSpace
from edtk.design.exact.exact_plan import ExactPlan, TooFewExperimentsError, require_enough
from edtk.design.exact.find_plan import STARTS, SearchOptions, find_plan
from edtk.design.plan import Plan
from edtk.design.problem import RankDeficientError
from edtk.design.relaxation.relax_poses import (
    DEFAULT_MB,
    MemoryLimitError,
    RelaxOptions,
    relax_poses,
    relaxed_in_time,
)
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.design.relaxation.restricted_master import RelaxationError
from edtk.study.evaluate import plan_accuracy
from edtk.study.plausibility import plan_plausibility
from edtk.study.study import Study
from edtk.system.errors import ArgumentError, UserError
from edtk.system.time_limit import time_limit
from edtk.system.workers import Workers, WorkersLostError

TOLERANCE = 1e-5  # relative gap, beyond which a bound would not change how a plan is judged
CANDIDATES = 0  # the stream of random numbers that candidates come from
# Descents hold matrices whose order grows with the number of distinct poses.
MOST_DISTINCT = 200
# Time [s] of a search after which it is worth while to start further processes, each of which takes
# a second to load what it needs.
ALONE = 2.0


@contextmanager
def study_errors(study: "Study") -> Iterator[None]:
    """Turn errors of relaxations and searches into one line that says what to change.

    Args:
        study: The study that is being answered.

    Raises:
        UserError: Names the key of the study, or is an `ArgumentError` that names the argument of
            the call.
    """
    try:
        yield
    except EmptyFeasibleSetError as error:
        raise study.error("workspace", str(error)) from error
    except RankDeficientError as error:
        key = "interest" if error.of_interest else study.kind.key
        raise study.error(key, str(error)) from error
    except MemoryLimitError as error:
        raise ArgumentError(str(error), argument="memory_mb") from error
    except (NotImplementedError, RelaxationError) as error:
        raise UserError(str(error), where=study.where) from error
    except WorkersLostError as error:
        raise UserError(str(error)) from error


Progress = Callable[[str, float], object]
THIS_PROCESS = Workers()


def no_progress(label: str, number: float) -> None:
    """Report to nobody."""


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """How a long computation is carried out; the question itself is the study.

    Attributes:
        seed: Takes the place of the study's seed; None for the study's own.
        workers: The processes that do the work; answers do not depend on them. Defaults to this
            one.
        progress: Called with a label of what is done, and a number: a relaxation reports its
            relative gap, the search for a plan its best cost so far, and a whole run the share of
            its steps that are done.
    """

    seed: int | None = None
    workers: Workers = THIS_PROCESS
    progress: Progress = no_progress


DEFAULTS = RunOptions()


def planning_space(study: Study, new: int | None = None, kept: Plan | None = None) -> DesignSpace:
    """The study's design space, with all that is known beside the experiments to be designed.

    Args:
        study: The study.
        new: Number of experiments to be designed, which share what is known; only needed where
            something is.
        kept: Experiments that have been carried out already.

    Returns:
        The space, whose prior is that of the study, if it counts, and of the kept experiments.
    """
    known = study.prior_information
    if kept is not None:
        of_kept = study.space.information(kept)
        known = of_kept if known is None else known + of_kept
    if known is None:
        return study.space
    assert new is not None
    return study.space.with_kept(known, new)


def source_of(
    study: Study, seed: int | None = None, space: DesignSpace | None = None
) -> CandidateSource:
    """Where the candidates of a study come from.

    Args:
        study: The study.
        seed: Seed; defaults to the study's.
        space: Design space; defaults to the study's.
    """
    return CandidateSource(
        space or study.space,
        (study.specification.seed if seed is None else seed, CANDIDATES),
        study.specification.sampling,
    )


def relax_study(
    study: Study,
    criterion: str | None = None,
    *,
    candidates: int | None = None,
    continuous: bool = False,
    size: int | None = None,
    tolerance: float = TOLERANCE,
    memory_mb: float = DEFAULT_MB,
    options: RunOptions = DEFAULTS,
) -> RelaxedPlan:
    """Find the best weights over feasible poses, with a bound on every plan.

    Args:
        study: The study.
        criterion: Name of a criterion; defaults to the one that the study is about.
        candidates: Number of candidate poses; defaults to the study's.
        continuous: Whether to search over all feasible poses, beyond the candidates.
        size: Number of experiments that share a prior which counts in designs; defaults to the
            first of the study's sizes.
        tolerance: Relative gap at which that search ends.
        memory_mb: Limit on memory [MB].
        options: Seed and progress; the work is done by threads of this process.

    Raises:
        UserError: One line that says what cannot be done, and where.
        PlanInterrupted: Ctrl-C after a first certified plan, which it carries.
    """
    study = study.designed_for(criterion)
    if size is not None and not study.specification.prior.in_design:
        message = "has no effect without a prior in the design; expected none"
        raise ArgumentError(message, argument="size", given=size)
    with study_errors(study):
        space = planning_space(study, size or study.specification.sizes[0])
        return relax_poses(
            source_of(study, options.seed, space),
            study.specification.candidates if candidates is None else candidates,
            study.criterion(criterion),
            continuous,
            RelaxOptions(tolerance=tolerance, memory_mb=memory_mb, progress=options.progress),
        )


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
    design = study.designed_for(criterion)
    asked = design.criterion(criterion)
    with study_errors(study), _enough(study, new, kept):
        space = planning_space(design, new, kept)
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
    expected = plan_accuracy(design, found.whole)
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
