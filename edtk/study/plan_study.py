"""The exact plan and the relaxation that a study asks for, and what is proved of all plans."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from time import monotonic
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

import criteria
from edtk.design.candidate_source import CandidateSource, EmptyFeasibleSetError
from edtk.design.design_space import DesignSpace
from edtk.design.enclosure.polynomial import NotEnclosedError
from edtk.design.enclosure.prove_continuum import prove_poses
from edtk.design.exact.day import MOST_LOADS, DayCosts
from edtk.design.exact.exact_plan import (
    ExactPlan,
    NoPlanError,
    OnCandidates,
    TooFewExperimentsError,
    require_enough,
)
from edtk.design.exact.find_plan import STARTS, SearchOptions, search_plan
from edtk.design.plan import Plan
from edtk.design.problem import RankDeficientError
from edtk.design.relaxation.relax import require_relaxable
from edtk.design.relaxation.relax_poses import (
    DEFAULT_MB,
    MemoryLimitError,
    RelaxOptions,
    relax_poses,
)
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.design.relaxation.restricted_master import RelaxationError
from edtk.robots.loads.bounded_load import BoundedLoad
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.loads.listed_load import ListedLoad
from edtk.study.study import Study
from edtk.system.errors import ArgumentError, UserError
from edtk.system.time_limit import Progress, no_progress, time_limit
from edtk.system.typing import Array

if TYPE_CHECKING:
    from edtk.design.exact.day_search import DaySearch
from edtk.system.workers import THIS_PROCESS, Workers, WorkersLostError

PLAN_TOLERANCE = 1e-5  # relative gap, beyond which a bound would not change how a plan is judged
CANDIDATE_STREAM = 0  # the stream of random numbers that candidates come from
# Descents hold matrices whose order grows with the number of distinct poses.
MOST_DISTINCT = 200
# Time [s] of the processor that a search has taken, and has left to take, from which on it is worth
# while to start further processes, each of which takes a second to load what it needs.
ALONE = 2.0
ROUNDING = 1e-9  # relative difference that two ways to compute a cost may make


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
        raise study.error(error.key, str(error)) from error
    except RankDeficientError as error:
        key = "interest" if error.of_interest else study.kind.key
        raise study.error(key, str(error)) from error
    except MemoryLimitError as error:
        raise ArgumentError(str(error), argument="memory_mb") from error
    except (NotImplementedError, NotEnclosedError, RelaxationError) as error:
        raise UserError(str(error), where=study.where) from error
    except WorkersLostError as error:
        raise UserError(str(error)) from error


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """How a long computation is carried out; the question itself is the study.

    Attributes:
        seed: Takes the place of the study's seed; None for the study's own.
        workers: The processes that do the work; answers do not depend on them. Defaults to this
            one.
        threads: Threads that draw candidates; None for one a core.
        progress: Called with a label of what is done, and a number: a relaxation reports its
            relative gap, the search for a plan its best cost so far, and a whole run the share of
            its steps that are done.
    """

    seed: int | None = None
    workers: Workers = THIS_PROCESS
    threads: int | None = None
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
    known = known_beside(study, kept)
    if known is None:
        return study.space
    assert new is not None
    return study.space.with_kept(known, new)


def known_beside(study: Study, kept: Plan | None) -> Array | None:
    """Information (p, p) of a study's prior, if it counts, and of kept experiments."""
    known = study.prior_information
    if kept is None:
        return known
    of_kept = study.space.information(kept)
    return of_kept if known is None else known + of_kept


def source_of(
    study: Study,
    seed: int | None = None,
    space: DesignSpace | None = None,
    threads: int | None = None,
) -> CandidateSource:
    """Where the candidates of a study come from.

    Args:
        study: The study.
        seed: Seed; defaults to the study's.
        space: Design space; defaults to the study's.
        threads: Number of threads that draw them; defaults to one a core.
    """
    return CandidateSource(
        space or study.space,
        (study.specification.seed if seed is None else seed, CANDIDATE_STREAM),
        study.specification.sampling,
        threads,
    )


@dataclass(frozen=True, eq=False)
class Sought:
    """What a search asks of a study of compliances; other kinds of study override what is theirs.

    Where a criterion is named, what is asked is about plans for it; the main one by default.

    Attributes:
        study: The study.
        unit: Unit of a criterion's values that names none.
        of_visits: Whether plans are of visits, which tell geometry.
        what: What experiments are called.
        most: New experiments of a plan, at most; None for any number.
        tolerance: Relative gap at which a search over all poses ends.
    """

    study: Study
    unit: ClassVar[str] = "SI"
    of_visits: ClassVar[bool] = False
    what: ClassVar[str] = "experiments"
    most: ClassVar[int | None] = None
    tolerance: ClassVar[float] = PLAN_TOLERANCE

    @classmethod
    def of(cls, study: Study) -> Self:
        """That of a study.

        Raises:
            UserError: It is no question of a plan.
        """
        return cls(study)

    def designed(self, name: str | None = None) -> Study:
        """The study by whose parameters plans are designed."""
        return self.study.designed_for(name)

    def base(self, name: str | None = None) -> DesignSpace:
        """Where experiments may lie, with nothing that is known besides."""
        return self.designed(name).space

    def space(self, size: int | None = None, name: str | None = None) -> DesignSpace:
        """The same of plans of so many experiments, with what is known besides.

        Args:
            size: Number of experiments; defaults to the first of the study's sizes.
            name: Name of the criterion that plans are for.
        """
        size = size or self.study.specification.sizes[0]
        return planning_space(self.designed(name), size)

    def criterion(self, name: str | None = None) -> criteria.Criterion:
        """A criterion."""
        return self.designed(name).criterion(name)

    def named(self, name: str | None = None) -> criteria.Criterion:
        """The same, which knows what parameters are called."""
        return self.criterion(name).named(self.base(name).parameters)

    def information(self, plan: Plan, name: str | None = None) -> Array:
        """Information matrix (p, p) of a plan, and of a prior that counts."""
        return self.designed(name).information(plan)

    def cost(self, plan: Plan, name: str | None = None) -> float:
        """A criterion's cost of a plan, and of a prior that counts, by the plan's rows."""
        return self.designed(name).cost(self.criterion(name), plan)

    def has_prior(self, name: str | None = None) -> bool:
        """Whether a prior counts beside the experiments."""
        return self.designed(name).prior_information is not None

    def known_beside(self, kept: Plan | None, name: str | None = None) -> Array | None:
        """Information (p, p) of a prior, if it counts, and of kept experiments."""
        return known_beside(self.designed(name), kept)

    def wrenches(self, costs: DayCosts | None) -> Array | None:
        """The loads (s, 6) of which a day chooses some; None where each experiment does."""
        return wrenches_of(self.study, costs)

    def ways(self, kept: Plan | None, options: RunOptions) -> dict[str, Any]:
        """How a `DaySearch` relaxes, and searches from a relaxation."""
        limits = SearchOptions(
            seed=self.study.specification.seed if options.seed is None else options.seed,
            starts=STARTS,
            workers=options.workers,
            alone=ALONE,
            progress=lambda starts, cost: options.progress(f"{starts} starts", cost),
        )
        return {
            "relax": RelaxOptions(workers=options.workers),
            "of_size": lambda relaxed, m, places: search_plan(relaxed, m, places, kept, limits),
        }

    def require_enough(self, search: "DaySearch", most: int) -> None:
        """Check that so many experiments are enough, before any search.

        Raises:
            TooFewExperimentsError: They are not enough.
        """
        if search.criterion.needs_all:  # else only the relaxation knows how few are enough
            space = search.beside_known(search.space, most)
            require_enough(space, most, search.distinct or most, search.criterion)

    def too_few(self, search: "DaySearch", error: NoPlanError) -> ArgumentError:
        """The error of too few experiments or poses, about the arguments."""
        most = search.budget.most()
        least = error.least if isinstance(error, TooFewExperimentsError) else most + 1
        argument = "distinct" if most >= least else "size" if search.new else "cost_budget"
        message = str(error)
        kept = search.kept
        if kept is not None and argument == "size":
            message += f"; with the {kept.experiments} kept ones: {kept.experiments + least}"
        return ArgumentError(message, argument=argument, where=self.study.where)

    def finished(self, found: ExactPlan) -> ExactPlan:
        """A plan that was found, with what is said of the study."""
        with_prior = self.study.prior_information is not None
        return replace(found, with_prior=with_prior, warnings=self.study.warnings)


def relax_study(
    study: Study,
    criterion: str | None = None,
    *,
    candidates: int | None = None,
    continuous: bool = False,
    prove: float | None = None,
    size: int | None = None,
    tolerance: float | None = None,
    near: Array | None = None,
    memory_mb: float = DEFAULT_MB,
    options: RunOptions = DEFAULTS,
    sought: type[Sought] = Sought,
) -> RelaxedPlan:
    """Find the best weights over feasible poses, with a bound on every plan.

    Args:
        study: The study.
        criterion: Name of a criterion; defaults to the one that the study is about.
        candidates: Number of candidate poses; defaults to the study's.
        continuous: Whether to search over all feasible poses, beyond the candidates.
        prove: Relative gap up to which the bound is proved for all feasible poses; None for none.
        size: Number of experiments that share a prior which counts in designs; defaults to the
            first of the study's sizes.
        tolerance: Relative gap at which that search ends; defaults to that of its kind of study.
        near: Feasible experiments (k, v) with which that search begins besides.
        memory_mb: Limit on memory [MB].
        options: Seed, progress, and what does the work: the result does not depend on that.
        sought: What is sought, by the kind of study.

    Raises:
        UserError: One line that says what cannot be done, and where.
        PlanInterrupted: Ctrl-C after a first certified plan, which it carries.
    """
    with study_errors(study):
        own = sought.of(study)
        if size is not None and not own.has_prior(criterion):
            message = "has no effect without a prior in the design; expected none"
            raise ArgumentError(message, argument="size", given=size)
        how = RelaxOptions(
            tolerance=own.tolerance if tolerance is None else tolerance,
            memory_mb=memory_mb,
            workers=options.workers,
            progress=options.progress,
        )
        source = source_of(study, options.seed, own.space(size, criterion), options.threads)
        number = study.specification.candidates if candidates is None else candidates
        asked = own.criterion(criterion)
        if prove is not None:
            return prove_poses(source, number, asked, prove, how)
        return relax_poses(source, number, asked, continuous, how, near)


def plan_study(
    study: Study,
    size: int | None = None,
    criterion: str | None = None,
    *,
    distinct: int | None = None,
    kept: Plan | None = None,
    budget: float | None = None,
    cost_budget: float | None = None,
    options: RunOptions = DEFAULTS,
    sought: type[Sought] = Sought,
) -> ExactPlan:
    """Search for the best plan of `size` experiments in all, with a bound on every such plan.

    Args:
        study: The study.
        size: Number of experiments, kept ones counted; None where a budget of costs decides.
        criterion: Name of a criterion; defaults to the one that the study is about.
        distinct: Number of distinct new poses, at most; defaults to p(p+1)/2 + 1, since the best
            weights need no more. Of visits, a pose without a load and under it are two.
        kept: Experiments that have been carried out already; their information counts as known,
            and they cost nothing more.
        budget: Seconds after which the best plan so far is returned; defaults to no limit. A
            first design on the candidates and a first plan, of each set of loads, are always
            completed.
        cost_budget: What the new experiments may cost; defaults to the study's, see `DaySearch`.
        options: Seed, processes and progress.
        sought: What is sought, by the kind of study.

    Ctrl-C leaves the best plan so far as soon as there is a first design on the candidates.

    Raises:
        UserError: One line that says what cannot be done, and where.
    """
    since = monotonic()
    with study_errors(study), time_limit(np.inf if budget is None else budget):
        own = sought.of(study)
        search = _day_search(own, size, criterion, distinct, kept, cost_budget, options)
        try:
            own.require_enough(search, search.budget.most())
            found = search.run()
        except NoPlanError as error:
            raise error_of_costs(study, own.too_few(search, error), cost_budget) from error
        except ArgumentError as error:
            raise error_of_costs(study, error, cost_budget) from error
    return replace(own.finished(found), seconds=monotonic() - since)


def _day_search(
    own: Sought,
    size: int | None,
    criterion: str | None,
    distinct: int | None,
    kept: Plan | None,
    cost_budget: float | None,
    options: RunOptions,
) -> "DaySearch":
    """The search for a plan of a study, whose costs may decide its size.

    Raises:
        UserError: One of the arguments is impossible.
    """
    from edtk.design.exact.day_search import DaySearch  # it takes long to load; relax needs none

    study = own.study
    costs = day_costs(study, cost_budget)
    wrenches = own.wrenches(costs)
    require_few_loads(study, costs, wrenches)
    new = new_experiments(size, distinct, kept, costs, own.what)
    if new is not None and own.most is not None and new > own.most:
        message = f"plans of more than {own.most} new {own.what} are not searched for"
        raise ArgumentError(message, argument="size", given=size)
    return DaySearch(
        source=source_of(study, options.seed, own.base(criterion)),
        candidates=study.specification.candidates,
        wrenches=wrenches,
        criterion=require_relaxable(own.criterion(criterion)),
        known=own.known_beside(kept, criterion),
        kept=kept,
        new=new,
        costs=costs,
        distinct=distinct,
        seed=study.specification.seed if options.seed is None else options.seed,
        progress=options.progress,
        **own.ways(kept, options),
    )


def wrenches_of(study: Study, costs: DayCosts | None) -> Array | None:
    """The loads (s, 6) of which a day within a budget of costs chooses some.

    Of forces along a direction the largest one tells most, as a displacement grows with its load.

    Returns:
        The loads; None where every experiment chooses its own and nothing depends on how many
        there are: without a budget, or where forces of any direction cost no load changes.
    """
    if costs is None or costs.budget is None:
        return None
    load = study.specification.build_load()
    if isinstance(load, FixedLoad):
        return load.always[None]
    if isinstance(load, ListedLoad):
        return load.wrenches
    if isinstance(load, BoundedLoad) and costs.paired:
        return load.largest[None]
    return None


def day_costs(study: Study, budget: float | None = None) -> DayCosts | None:
    """What visits and load changes cost; None where neither the study nor the call says any.

    Args:
        study: The study.
        budget: What a plan may cost, in place of the study's own.
    """
    given = study.specification.costs
    paired = study.kind.is_paired(study)
    if given is None or not given.is_priced:
        return None if budget is None else DayCosts(budget=budget, paired=paired)
    return DayCosts(
        given.visit,
        given.visit if given.loaded_visit is None else given.loaded_visit,
        given.load_change,
        given.load_changes,
        given.budget if budget is None else budget,
        given.unit,
        paired,
    )


def require_few_loads(study: Study, costs: DayCosts | None, wrenches: Array | None) -> None:
    """Check that the sets of loads within a budget can all be searched.

    Args:
        study: The study.
        costs: What visits cost; None where nobody said.
        wrenches: The loads (s, 6); None where each experiment chooses its own.

    Raises:
        UserError: They are too many, or there are as many as experiments.
    """
    if costs is None or costs.budget is None:
        return
    if wrenches is None:
        if costs.change or (costs.visit != costs.loaded_visit and not costs.paired):
            raise study.error(
                "load.F_max_N",
                "poses that choose their forces freely have as many loads as there are poses, and "
                "no set of loads whose changes a budget could count; list forces in list_F_N",
            )
        return
    if int(wrenches.any(axis=1).sum()) > MOST_LOADS:
        message = f"plans within a budget choose among {MOST_LOADS} loads at most; list fewer"
        raise study.error("load.list_F_N", message)


def error_of_costs(study: Study, error: ArgumentError, budget: float | None) -> UserError:
    """An error about a budget, of the study's key where nobody gave an argument."""
    if error.argument != "cost_budget" or budget is not None:
        return error
    given = "" if error.given is None else f" (got {error.given})"
    return study.error("costs.budget", f"{error.message}{given}")


def new_experiments(
    size: int | None,
    distinct: int | None,
    kept: Plan | None,
    costs: DayCosts | None,
    what: str = "experiments",
) -> int | None:
    """Number of new experiments; None where a budget of costs decides.

    Args:
        size: Number of experiments in all; None where the budget decides.
        distinct: Number of distinct new poses, at most; None for any.
        kept: Experiments that were made already.
        costs: What experiments cost; None where nobody said.
        what: What they are called.

    Raises:
        ArgumentError: There is nothing to plan, or the poses are too many.
    """
    if size is None:
        if costs is None or costs.budget is None:
            message = f"expected the number of {what}, unless a budget of costs decides"
            raise ArgumentError(message, argument="size")
        return None
    count = 0 if kept is None else kept.experiments
    new = size - count
    if new < 1:
        message = f"{count} experiments are kept; expected more than that"
        raise ArgumentError(message, argument="size", given=size)
    if distinct is not None and distinct > new:
        message = f"expected at most {new}, the number of new {what}"
        raise ArgumentError(message, argument="distinct", given=distinct)
    if distinct is not None and distinct > MOST_DISTINCT:
        message = f"expected at most {MOST_DISTINCT}"
        raise ArgumentError(message, argument="distinct", given=distinct)
    return new


def prove_on_candidates(
    found: ExactPlan, seconds: float, candidates: int | None, options: RunOptions
) -> ExactPlan:
    """Prove the best plan of as many experiments on candidates, or a bound, beside a found plan.

    Visits of a pose that share errors of the model tell less together than the proof takes them to
    tell: its bound holds for them, but its best plan need not be the best where it repeats a pose.

    The found plan may be off the candidates, and then above or below what is proved of these. What
    is known beforehand, and kept experiments, count in both.

    Args:
        found: A plan of a study.
        seconds: Time to spend; candidates, and a first plan of them, are waited for.
        candidates: Number of candidates; defaults to those of the relaxation.
        options: Where progress goes.

    Raises:
        UserError: Nothing can be proved for this criterion, or no weights were found.
    """
    from edtk.design.exact.counts.find_counts import find_counts
    from edtk.design.exact.counts.limits import Limits

    relaxed = found.relaxed
    number = relaxed.candidates if candidates is None else candidates
    m = found.plan.experiments
    space = relaxed.space
    base = np.zeros((space.p, space.p)) if space.prior is None else m * space.prior
    poses = relaxed.source.take(number)
    best = find_counts(
        poses.problem,
        relaxed.criterion,
        Limits(m, base),
        np.zeros(number, dtype=int),
        progress=options.progress,
        prove=seconds,
    )
    if best.proof is None or best.exact_bound is None:
        raise UserError(f"no weights of the {number:,} candidates were found: {best.basis}")
    plan = space.plan(poses.x[best.support], best.counts[best.support])
    cost = best.cost
    if space.shares_errors:
        cost = space.cost(relaxed.criterion, plan, found.kept)
    on_them = OnCandidates(
        candidates=number,
        bound=best.exact_bound,
        best=cost,
        plan=plan,
        counts=best.counts,
        tree=best.proof.tree,
        proved=best.proved_exact and cost <= best.cost * (1 + ROUNDING),
        seconds=best.seconds,
        ended=best.ended,
    )
    return replace(found, on_candidates=on_them)
