"""The search for the best plan of runs whose errors have a structure, and its bound."""

from collections.abc import Callable
from dataclasses import replace
from itertools import chain, combinations
from time import monotonic

import numpy as np

from criteria import Criterion, Relaxable
from criteria.linalg.inverse import root
from edtk.design.errors import Errors, RunErrors, hard_names
from edtk.design.exact.arranged.arranged_bound import ArrangedBound
from edtk.design.exact.arranged.arranged_plan import ArrangedPlan
from edtk.design.exact.arranged.arranged_search import ArrangedSearch
from edtk.design.exact.arranged.settings import NO_RUNS, Settings
from edtk.design.exact.counts.counts_bound import RelaxedCounts
from edtk.design.exact.counts.find_counts import told_bound
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.pricing_for import working_parameters
from edtk.design.information import Rows
from edtk.design.problem import Problem, RankDeficientError, missing_of
from edtk.design.relaxation.setting import OrderOne, Setting
from edtk.system.errors import ArgumentError, UserError
from edtk.system.typing import Array, Indices

LEFT_OF_SQUARES = 1e-12  # part of the squares of a column that a root of rounding leaves
RANDOM_PLANS = 24  # random plans whose sum tells what no plan of this structure can tell


def find_arranged(
    problem: Problem,
    criterion: Criterion,
    errors: Errors,
    size: int,
    seed: int = 0,
    starts: int | None = None,
    progress: Callable[[str, float], object] = lambda step, cost: None,
    first: Indices = NO_RUNS,
    most: Indices | None = None,
) -> ArrangedPlan:
    """Search for the best order of runs whose errors have a structure, and bound how good any is.

    From random settings, and from the best plan with some of its settings drawn anew, plans are
    improved by exchanges of runs and of the settings of whole groups (`ArrangedSearch`). The same
    seed gives the same plan. Ctrl-C ends the search with the best plan so far.

    Args:
        problem: The candidates, with their rows as measured.
        criterion: The criterion to minimise.
        errors: The structure of the errors.
        size: Number of runs.
        seed: Seed.
        starts: Number of starts; None to go on until nothing better is found.
        progress: Called with a line about the current step, and the best cost.
        first: The candidates (k,) of the first runs, which are made already.
        most: How often each candidate may be used (n,); None for no limit.

    Raises:
        ArgumentError: So many runs have no such structure, or there is no such factor.
        UserError: No plan of so few runs was found that identifies all parameters.
        RankDeficientError: No plan of this structure identifies all parameters.
    """
    since = monotonic()
    runs = errors.of_runs(size)
    settings = Settings.of(problem, runs)
    odd = settings.at_odds(first)
    if odd is not None:
        message = f"runs {odd[0] + 1} and {odd[1] + 1} are of one group with different settings"
        raise ArgumentError(message, argument="keep")
    plain = criterion.without_prior
    sized = _of_order_one(problem, criterion, size)
    sized.problem.require_identifiable(plain)
    search, setting = _search(sized.problem, plain, settings, runs.precision)
    search = replace(search, first=first, most=most)
    _require_told(search, sized.problem, plain)
    if plain.needs_all:
        _require_enough(search, errors)
    found = search.run(seed, starts, lambda n, cost: progress(f"start {n}", cost))
    cost = search.criterion.cost_from_plan_criterion(found.cost)
    if not np.isfinite(cost):
        needed = f"the {problem.p} parameters" if plain.needs_all else f"what {plain.label} needs"
        raise UserError(
            f"no plan of {size} runs in {errors.headline()} was found that identifies {needed}; "
            "more are needed"
        )
    counts = np.bincount(found.places, minlength=problem.n)
    of_cost = _accuracy(setting, search, found.places, counts / size)
    relaxed, reason = _bound(search, runs, found.places, cost, found.ended)
    return ArrangedPlan(
        problem=problem,
        criterion=criterion,
        counts=counts,
        cost=sized.cost(cost, criterion),
        lower_bound=told_bound(criterion, relaxed, sized, cost, of_cost, of_cost),
        basis=f"no bound: {reason}" if relaxed is None else relaxed.basis,
        starts=found.starts,
        found=found.found,
        ended=found.ended,
        seconds=monotonic() - since,
        accuracy=of_cost,
        kept=np.bincount(first, minlength=problem.n),
        most=most,
        places=found.places,
        structure=runs,
    )


def _of_order_one(problem: Problem, criterion: Criterion, size: int) -> OrderOne:
    """The candidates in a good unit, beside what every plan of so many runs has in equal parts."""
    base = np.zeros((problem.p, problem.p))
    if criterion.precision is not None:
        base = base + criterion.precision
    if problem.prior is not None:
        base = base + size * problem.prior
    return OrderOne.of(problem.with_prior(base / size if base.any() else None))


def _search(
    problem: Problem, criterion: Criterion, settings: Settings, W: Array
) -> tuple[ArrangedSearch, Setting | None]:
    """The search, in parameters of order one, and what rounding they cost."""
    setting = None
    if isinstance(criterion, Relaxable):
        setting = Setting.of(problem, criterion, as_rows=True)
        problem, criterion = setting.problem, setting.criterion
    m = len(W)
    base = np.zeros((problem.p, problem.p)) if problem.prior is None else m * problem.prior
    rows = problem.factors()
    T = working_parameters(criterion.plan_criterion, rows, Limits(m, base))
    transformed = criterion.transformed(T)
    if transformed is None:
        T = np.eye(problem.p)
        transformed = criterion
    return ArrangedSearch(rows @ T, W, T.T @ base @ T, transformed, settings), setting


def _require_enough(search: ArrangedSearch, errors: Errors) -> None:
    """Check that there are enough runs, and enough groups of each stratum.

    Let U be all that runs of one setting of some factors differ by, and what is known. Modulo U
    all runs of a setting tell the same, so that g settings tell g directions of the others.

    Raises:
        UserError: There are too few, whatever the runs.
    """
    settings = search.settings
    p = len(search.base)
    known = root(search.base)
    if search.m * search.rows.shape[1] + int(known.any(axis=1).sum()) < p:
        raise UserError(f"{search.m} runs do not tell {p} parameters; more are needed")
    strata = [s for s, hard in enumerate(settings.hard) if len(hard)]
    together = [combinations(strata, size) for size in range(1, len(strata) + 1)]
    for some in chain.from_iterable(together):
        columns = np.concatenate([settings.hard[s] for s in some])
        groups = len(np.unique([settings.labels[s] for s in some], axis=1).T)
        slices = settings.slices(columns)
        deviations = [search.rows[same] - search.rows[same[:1]] for same in slices]
        U = np.concatenate([known, *(one.reshape(-1, p) for one in deviations)])
        alike = p - int(np.linalg.matrix_rank(U))
        told = groups * search.rows.shape[1]
        if told >= alike:
            continue
        hard = [errors.levels[s].hard for s in some]
        names = [name for one in hard if one is not None for name in hard_names(one)]
        settings_of = f"setting{'s' if groups > 1 else ''} of {' and '.join(names)}"
        raise UserError(
            f"in {errors.headline()}, runs have {groups} {settings_of} at most: enough for "
            f"{told} of {alike} parameters, or combinations of them, that depend on "
            "nothing else; more are needed"
        )


def _require_told(search: ArrangedSearch, problem: Problem, criterion: Criterion) -> None:
    """Check that what is nuisance leaves what the criterion needs to be told.

    What the sum of many random plans leaves open is open in all of them.

    Raises:
        RankDeficientError: It does not; the message names what.
    """
    drawn = search.drawn(np.random.default_rng(0), RANDOM_PLANS)
    X = problem.factors()[drawn]
    turned = np.einsum("st,btri->bsri", root(search.W), X).reshape(-1, problem.p)
    # What is left of a column that is all nuisance is rounding.
    whole = np.square(X).sum(axis=(0, 1, 2)) * np.abs(search.W).max()
    turned[:, np.square(turned).sum(axis=0) <= LEFT_OF_SQUARES * whole] = 0.0
    plans = Rows(turned.reshape(RANDOM_PLANS, -1, problem.p))
    prior = None if problem.prior is None else len(search.W) * problem.prior
    missing = missing_of(Problem.of_kept(plans, problem.parameters, prior), criterion)
    if missing:
        raise RankDeficientError(
            f"beside effects of which nothing is known, nothing tells {' or '.join(missing)}: "
            "leave such parameters out of the model, name the others as interest, or give the "
            "effects a variance"
        )


def _accuracy(
    setting: Setting | None, search: ArrangedSearch, places: Indices, weights: Array
) -> float:
    """Relative error that rounding may have made in the cost of a plan (m,)."""
    if setting is None:
        return 0.0
    p = setting.problem.p
    m = len(search.W)
    X = setting.problem.factors()[places]
    M = np.einsum("st,sri,trj->ij", search.W, X, X, optimize=True) / m
    if setting.problem.prior is not None:
        M = M + setting.problem.prior
    return setting.errors(weights, np.zeros((0, p, p)), M)[0]


def _bound(
    search: ArrangedSearch, runs: RunErrors, places: Indices, cost: float, ended: str
) -> tuple[RelaxedCounts | None, str]:
    """The sharpest bound, or why there is none."""
    criterion = search.criterion
    if not isinstance(criterion, Relaxable):
        return None, f"{criterion.label} has no convex form"
    if criterion.degree == 0:
        return None, f"{criterion.label} does not depend on how much a plan tells"
    if ended == "interrupted":
        return None, "interrupted before one was found"
    bound = ArrangedBound(search.rows, runs, search.base, criterion, search.settings, places, cost)
    try:
        found = bound.sharpest()
    except KeyboardInterrupt:
        return None, "interrupted before one was found"
    if found is None:
        return None, f"none is known of {criterion.label} under such errors"
    kept = ["kept runs"] if len(search.first) else []
    aside = kept if search.most is None else [*kept, "largest counts"]
    if aside:
        found = replace(found, basis=f"{found.basis}; {' and '.join(aside)} set aside")
    return found, ""
