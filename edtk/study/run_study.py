"""The answer to a whole study: bounds and plans for every criterion and size, compared."""

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

import criteria
from criteria import Relaxable
from edtk.design.bound import Bound
from edtk.design.candidate_source import CandidateSource, sample_feasible
from edtk.design.exact.exact_plan import ExactPlan, NoPlanError, smallest_size
from edtk.design.exact.round_poses import round_poses
from edtk.design.plan import Plan
from edtk.design.relaxation.relax import require_relaxable
from edtk.design.relaxation.relax_poses import relax_poses
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.study.checkpoint import checkpoint_of
from edtk.study.plan_study import DEFAULTS, RunOptions, source_of, study_errors
from edtk.study.study import Study
from edtk.study.study_run import (
    TABLE_TOLERANCE,
    Case,
    Designs,
    StudyRun,
    comparison_table,
    relaxation_key,
)
from edtk.system.errors import UserError
from edtk.system.time_limit import Progress, time_left
from edtk.system.workers import WorkersLostError

PLANS = 101  # of which the median is shown; odd, so that the median is one of them
STREAM = 2  # of random numbers, apart from those of the candidates
GAIN = 1e-6  # relative improvement that counts; plans that differ by less are one, but for rounding
HELD = "relaxed"  # in an answer, the relaxation whose bound holds for the plan
NOT_BEGUN = "the time was over before it was searched for"
SHARE_OF_BOUND = 0.5  # of a limited time, at most, for the first bound
# Fewer distinct poses are compared with more up to this number: beyond it nothing is gained.
MOST_COMPARED = 8


def random_case(study: Study, size: int, index: int, designs: Designs | None = None) -> Case:
    """Draw many plans of feasible poses at random, and take the one of median cost.

    Args:
        study: The study, whose main criterion orders the plans.
        size: Number of experiments of each.
        index: Number of the stream of random numbers, one for each size.
        designs: The designs of the study; default to those of compliances.

    Returns:
        The median plan, in poses that a controller takes, or the reason why it has no cost.
    """
    seed = (study.specification.seed, STREAM, index)
    designs = Designs(study) if designs is None else designs
    space = designs.space(size)
    x = sample_feasible(space, PLANS * size, seed).reshape(PLANS, size, -1)
    costs = designs.criterion().cost(space.at(x).information(np.ones((PLANS, size))))
    middle = int(np.argsort(costs, kind="stable")[PLANS // 2])
    if not np.isfinite(costs[middle]):
        return Case("random", "", size, reason="such a plan cannot identify all parameters")
    poses, repeats = round_poses(space, designs.criterion(), x[middle], np.ones(size))
    return Case("random", "", size, plan=space.plan(poses, repeats.astype(int)))


def none_worse(cases: Sequence[Case]) -> list[Case]:
    """Cases in the same order, each with the best plan of all that answer its question.

    A plan of at most k poses answers the question for one of at most k + 1, and for one of any
    number. Where poses of a search come close to each other, the search for fewer of them may find
    the better plan.
    """
    return [_with_best(case, [other for other in cases if _answers(other, case)]) for case in cases]


def _answers(other: Case, case: Case) -> bool:
    """Whether a plan is one of the same criterion and size, on no more poses."""
    if other.found is None or other.optimised != case.optimised or other.size != case.size:
        return False
    return _limit(other) <= _limit(case)


def _limit(case: Case) -> float:
    """Number of distinct poses at most."""
    return np.inf if case.distinct is None else case.distinct


def _with_best(case: Case, others: Sequence[Case]) -> Case:
    """The case, with the plan of another one where that is better."""
    own = np.inf if case.found is None else case.found.cost
    for other in others:
        assert other.found is not None
        if other.found.cost < own * (1 - GAIN):
            own = other.found.cost
            case = replace(case, plan=other.plan, found=other.found, reason="")
    return case


def relaxed_under(criterion: Relaxable, relaxed: RelaxedPlan) -> RelaxedPlan:
    """The relaxation under a criterion, from that under its `plan_criterion`.

    O1 = D^(1/2) is greater where D is, so D's weights are O1's, and each bound on the cost of D is
    turned into one on that of O1 by the same increasing function. The multipliers prove both.

    Args:
        criterion: The criterion.
        relaxed: The relaxation under `criterion.plan_criterion`.
    """
    if criterion.name == relaxed.criterion.name:
        return relaxed
    cost = criterion.cost_from_plan_criterion(relaxed.cost)

    def turned(bound: Bound) -> Bound:
        return Bound.of(criterion, criterion.cost_from_plan_criterion(bound.cost), cost, bound.kind)

    searched = relaxed.searched_bound
    beyond = relaxed.without_cell
    return replace(
        relaxed,
        criterion=criterion,
        cost=cost,
        proved_bound=turned(relaxed.proved_bound),
        searched_bound=None if searched is None else turned(searched),
        without_cell=None if beyond is None else relaxed_under(criterion, beyond),
    )


Answer = dict[str, Any]
Complete = Callable[..., tuple[dict[str, Answer], set[str]]]  # see `Checkpoint.complete`


def run_study(
    study: Study,
    folder: Path | str,
    *,
    fresh: bool = False,
    options: RunOptions = DEFAULTS,
    designs_of: Callable[[Study], Designs] = Designs,
) -> StudyRun:
    """Find and compare the plans of a study.

    The same study gives the same answer, on any number of processes. Every case is kept in the
    folder's `cases` as soon as it is finished, so that a run that was killed goes on from there.
    Where the time is limited (`time_limit`), the best plans and bounds so far are the answer, and
    what was cut off is not kept.

    Args:
        study: The study.
        folder: Folder of the run, which is made if need be.
        fresh: Whether to begin anew, whatever is finished.
        options: Seed, processes and progress; progress is reported for the questions, for
            each relaxation, search and random plan, and at the end.
        designs_of: Tells what the designs of a study are; defaults to those of compliances.

    Raises:
        UserError: No feasible poses, the candidates cannot identify all parameters, or the workers
            are lost.
    """
    if options.seed is not None:
        study = study.replace(seed=options.seed)
    folder = Path(folder)
    published = study.published_plans()
    with study_errors(study):
        designs = designs_of(study)
        questions = _questions(designs)
        report = _steps(_count(designs, questions), options.progress)
        report("questions")
        checkpoint = checkpoint_of(study, folder / "cases", designs.space)
        if fresh:
            checkpoint.forget_others(())
        complete = partial(checkpoint.complete, workers=options.workers, report=report)
        try:
            bases, answers, cut = _computed(designs, questions, complete)
        except WorkersLostError as error:
            raise UserError(f"{error}; what is finished is kept, run again to go on") from error
    checkpoint.forget_others(_names(designs, questions))
    checkpoint.restore()
    relaxations = _relaxations(designs, bases)
    cases = none_worse([_answered(designs, case, answers, relaxations) for case in questions])
    for index, size in enumerate(study.specification.sizes):
        cases.append(random_case(study, size, index, designs))
        report(cases[-1].name)
    cases += _published_cases(published)
    if cut:
        cases, relaxations = _without_beaten(designs, cases, relaxations)
    table = comparison_table(designs, cases, relaxations)
    run = StudyRun(study, table, relaxations, tuple(cases), folder, designs, cut)
    report("results")
    return run


def _names(designs: Designs, questions: list[Case]) -> set[str]:
    """Names of all relaxations and searches."""
    return {*_relaxation_pieces(designs), *(_search_name(designs, case) for case in questions)}


def _count(designs: Designs, questions: list[Case]) -> int:
    """Number of reports: one for the questions, each relaxation, search and random
    plan, the end.
    """
    begin_and_end = 2
    return len(_names(designs, questions)) + len(designs.study.specification.sizes) + begin_and_end


def _computed(
    designs: Designs, questions: list[Case], complete: Complete
) -> tuple[dict[str, RelaxedPlan], dict[str, Answer], frozenset[str]]:
    """The relaxations, by `relaxation_key`, and the answers of the searches, by name.

    The third are names of those that the end of the time has cut off or left out.
    """
    every = _relaxation_pieces(designs)
    relaxed: dict[str, Answer] = {}
    answers: dict[str, Answer] = {}
    bases: dict[str, RelaxedPlan] = {}
    cut: set[str] = set()
    for cases, names in _groups(designs, questions):
        pieces = {key: piece for key, piece in every.items() if piece.criterion.name in names}
        is_first = not answers
        share = SHARE_OF_BOUND if is_first else 1.0
        found, cut_off = complete(pieces, share=share, is_first=is_first)
        relaxed |= found
        bases |= _bases(pieces, found)
        searches = _searches(designs, cases, bases, cut_off)
        resting = {key for key, search in searches.items() if search.rests_on_cut}
        plans, cut_plans = complete(searches, is_first=is_first, resting_on_cut=resting)
        for key in resting & plans.keys():
            _hold(bases, searches[key], plans[key])
        answers |= plans
        cut |= cut_off | cut_plans
    left_out = _names(designs, questions) - relaxed.keys() - answers.keys()
    return bases, answers, frozenset(cut | left_out)


def _hold(bases: dict[str, RelaxedPlan], search: "_Search", answer: Answer) -> None:
    """Let a bound that was cut off hold for the plan of a search, too.

    The lowest of such bounds holds for all of their plans.
    """
    if HELD not in answer:
        return
    key = search.key
    held = RelaxedPlan.from_dict(search.relaxed.source, search.relaxed.criterion, answer.pop(HELD))
    bases[key] = min(bases[key], held, key=lambda one: one.best_bound.cost)


def _without_beaten(
    designs: Designs, cases: list[Case], relaxations: Mapping[str, RelaxedPlan]
) -> tuple[list[Case], dict[str, RelaxedPlan]]:
    """The cases and relaxations without bounds that one of the plans beats.

    A search for a bound that was cut off may have missed better poses.
    """
    table = comparison_table(designs, cases, relaxations)
    names = {one.criterion.name for one in relaxations.values()}
    beaten = {name for name in names if table[f"efficiency_{name}"].max() > 1 + TABLE_TOLERANCE}
    kept = {key: one for key, one in relaxations.items() if one.criterion.name not in beaten}
    return [replace(one, found=None) if one.optimised in beaten else one for one in cases], kept


def _groups(designs: Designs, questions: list[Case]) -> list[tuple[list[Case], set[str]]]:
    """Cases that are searched for together, and the criteria that are relaxed for them.

    Where the time is limited, plans for the main criterion come first, those of fewer poses last.
    Else all are one group, so that no process waits for others.
    """
    every = {_base(designs, name) for name in _relaxed_names(designs.study)}
    if np.isinf(time_left()):
        return [(questions, every)]
    main = _base(designs, designs.study.main_criterion)
    groups: dict[str, list[Case]] = {"first": [], "others": [], "distinct": []}
    for case in questions:
        of_main = "first" if _base(designs, case.optimised) == main else "others"
        groups["distinct" if case.kind == "distinct" else of_main].append(case)
    criteria_of = {"first": {main}, "others": every - {main}, "distinct": set[str]()}
    return [(cases, criteria_of[key]) for key, cases in groups.items()]


def _steps(total: int, progress: Progress) -> Callable[[str], object]:
    """Reports the share of the steps that are done."""
    done = count(1)
    return lambda label: progress(label, next(done) / total)


def _published_cases(plans: Mapping[str, Plan]) -> list[Case]:
    """The published plans, by name; among several of one size each has its file's name."""
    sizes = [plan.experiments for plan in plans.values()]
    return [
        Case("published", "", size, plan=plan, label=name if sizes.count(size) > 1 else "")
        for size, (name, plan) in zip(sizes, plans.items(), strict=True)
    ]


def _relaxed_names(study: Study) -> list[str]:
    """Names of the criteria that can be relaxed, those that are optimised first."""
    return [name for name in study.names if issubclass(criteria.get(name), criteria.Relaxable)]


def _base(designs: Designs, name: str) -> str:
    """Name of the criterion that is searched for another one, as D is for O1 = D^(1/2)."""
    return designs.criterion(name).plan_criterion.name


def _shares(designs: Designs, name: str) -> tuple[int | None, ...]:
    """Sizes that have relaxations of their own under a criterion: all with a prior in the design,
    else none has.
    """
    return designs.study.specification.sizes if designs.has_prior(name) else (None,)


def _key(designs: Designs, name: str, size: int) -> str:
    """Key of the relaxation under a criterion that plans of this size are compared with."""
    return relaxation_key(name, size if designs.has_prior(name) else None)


def _relaxation_name(key: str) -> str:
    return f"relaxation_{key}"


def _search_name(designs: Designs, case: Case) -> str:
    """Name of the search that answers a case; cases of D and O1 share theirs."""
    return replace(case, optimised=_base(designs, case.optimised)).name


def _questions(designs: Designs) -> list[Case]:
    """The plans to search for: every criterion and size, and fewer poses for the main criterion."""
    study = designs.study
    found = []
    for size in study.specification.sizes:
        least = smallest_size(designs.space(size), designs.criterion())
        found += [Case("optimised", name, size) for name in study.specification.optimise]
        fewer = designs.distinct(range(least, min(size, MOST_COMPARED + 1)))
        found += [Case("distinct", study.main_criterion, size, distinct=k) for k in fewer]
    return found


@dataclass(frozen=True, eq=False)
class _Relax:
    """The relaxation of one criterion, as a piece of work that answers with plain numbers."""

    designs: Designs
    criterion: criteria.Relaxable
    share: int | None

    @property
    def source(self) -> CandidateSource:
        """Where its candidates come from; that depends on the size where a prior counts."""
        space = self.designs.space(self.share, self.criterion.name)
        return source_of(self.designs.study, space=space)

    def __call__(self) -> Answer:
        found = relax_poses(
            self.source,
            self.designs.study.specification.candidates,
            self.criterion,
            continuous=True,
            options=self.designs.relax_options(),
        )
        answer = found.to_dict()
        del answer["seconds"]  # the same study gives the same files
        return answer


def _relaxation_pieces(designs: Designs) -> dict[str, _Relax]:
    """The relaxations over all feasible poses, one for all criteria that share their plans.

    That of the main criterion, for the largest plan, comes first.
    """
    study = designs.study
    names = sorted(_relaxed_names(study), key=lambda name: name != study.main_criterion)
    every = [designs.criterion(name).plan_criterion for name in names]
    bases = {criterion.name: require_relaxable(criterion) for criterion in every}
    return {
        _relaxation_name(relaxation_key(name, share)): _Relax(designs, base, share)
        for name, base in bases.items()
        for share in sorted(_shares(designs, name), key=lambda size: -(size or 0))
    }


def _bases(pieces: Mapping[str, _Relax], answers: Mapping[str, Answer]) -> dict[str, RelaxedPlan]:
    """The relaxations that were answered, by `relaxation_key`."""
    return {
        relaxation_key(piece.criterion.name, piece.share): RelaxedPlan.from_dict(
            piece.source, piece.criterion, answers[name]
        )
        for name, piece in pieces.items()
        if name in answers
    }


def _relaxations(designs: Designs, bases: Mapping[str, RelaxedPlan]) -> dict[str, RelaxedPlan]:
    """The relaxation under each criterion, from that under the one that is searched for it."""
    study = designs.study
    every = {
        relaxation_key(name, share): (name, relaxation_key(_base(designs, name), share))
        for name in _relaxed_names(study)
        for share in _shares(designs, name)
    }
    return {
        key: relaxed_under(require_relaxable(designs.criterion(name)), bases[base])
        for key, (name, base) in every.items()
        if base in bases
    }


@dataclass(frozen=True, eq=False)
class _Search:
    """The search for one plan, as a piece of work that answers with plain numbers."""

    designs: Designs
    relaxed: RelaxedPlan
    case: Case
    starts: int
    rests_on_cut: bool = False

    @property
    def key(self) -> str:
        """Key of the relaxation."""
        return _key(self.designs, self.case.optimised, self.case.size)

    def __call__(self) -> Answer:
        try:
            found = self.designs.search(self.relaxed, self.case, self.starts)
        except NoPlanError as error:
            return {"reason": str(error)}
        if found.ended == "interrupted":
            raise KeyboardInterrupt  # the best plan so far is not the answer
        answer = found.to_dict()
        del answer["seconds"]  # the same study gives the same files
        if self.rests_on_cut:
            answer[HELD] = found.relaxed.to_dict()
        return answer


def _searches(
    designs: Designs, questions: list[Case], bases: Mapping[str, RelaxedPlan], cut: Container[str]
) -> dict[str, "_Search"]:
    """The searches for the plans, by name, the largest first since they take longest.

    Those without a relaxation are left out.
    """
    study = designs.study
    searches: dict[str, _Search] = {}
    for case in sorted(questions, key=lambda case: -case.size):
        name = _search_name(designs, case)
        starts = study.specification.descents(case.optimised)
        if name in searches:  # shared; one of the criteria may be the one that gets more descents
            starts = max(starts, searches[name].starts)
        base = _base(designs, case.optimised)
        key = _key(designs, base, case.size)
        if key in bases:
            asked = replace(case, optimised=base)
            is_cut = _relaxation_name(key) in cut
            searches[name] = _Search(designs, bases[key], asked, starts, is_cut)
    return searches


def _answered(
    designs: Designs,
    case: Case,
    answers: Mapping[str, Answer],
    relaxations: Mapping[str, RelaxedPlan],
) -> Case:
    """A case with its plan, from the numbers of a `_Search`."""
    answer = answers.get(_search_name(designs, case), {"reason": NOT_BEGUN})
    if "reason" in answer:
        return replace(case, reason=answer["reason"])
    relaxed = relaxations[_key(designs, case.optimised, case.size)]
    found = ExactPlan.from_dict(relaxed, answer)
    cost = found.relaxed.criterion.cost_from_plan_criterion(found.cost)
    return replace(case, plan=found.plan, found=replace(found, cost=cost))
