"""The answer to a whole study: bounds and plans for every criterion and size, compared."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import criteria
from edtk.design.candidate_source import CandidateSource
from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.exact.no_plan_error import NoPlanError
from edtk.design.exact.smallest_size import smallest_size
from edtk.design.plan import Plan
from edtk.design.relaxation.relax import require_relaxable
from edtk.design.relaxation.relax_poses import relax_poses
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.study.bound_for import relaxation_key
from edtk.study.case import Case
from edtk.study.checkpoint import checkpoint_of
from edtk.study.comparison_table import comparison_table
from edtk.study.designs import Designs
from edtk.study.none_worse import none_worse
from edtk.study.random_case import random_case
from edtk.study.relax_study import source_of
from edtk.study.relaxed_under import relaxed_under
from edtk.study.run_options import DEFAULTS, Progress, RunOptions
from edtk.study.study import Study
from edtk.study.study_errors import study_errors
from edtk.study.study_run import StudyRun
from edtk.system.errors import UserError
from edtk.system.workers import WorkersLostError

Answer = dict[str, Any]
Complete = Callable[[Mapping[str, Callable[[], Answer]]], dict[str, Answer]]

# Fewer distinct poses are compared with more up to this number: beyond it nothing is gained.
MOST_DISTINCT = 8


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
        report = _Steps(_count(designs, questions), options.progress)
        report("questions")
        checkpoint = checkpoint_of(study, folder / "cases", designs.space)
        if fresh:
            checkpoint.forget_others(())
        complete = partial(checkpoint.complete, workers=options.workers, report=report)
        try:
            bases = _relaxed_bases(designs, complete)
            answers = complete(_searches(designs, questions, bases))
        except WorkersLostError as error:
            raise UserError(f"{error}; what is finished is kept, run again to go on") from error
    checkpoint.forget_others([*answers, *map(_relaxation_name, bases)])
    checkpoint.restore()
    relaxations = _relaxations(designs, bases)
    cases = none_worse(
        [
            _answered(
                case,
                answers[_search_name(designs, case)],
                relaxations[_key(study, case.optimised, case.size)],
            )
            for case in questions
        ]
    )
    for index, size in enumerate(study.specification.sizes):
        cases.append(random_case(study, size, index, designs))
        report(cases[-1].name)
    cases += _published_cases(published)
    table = comparison_table(designs, cases, relaxations)
    run = StudyRun(study, table, relaxations, tuple(cases), folder, designs)
    report("results")
    return run


def _count(designs: Designs, questions: list[Case]) -> int:
    """Number of reports: one for the questions, each relaxation, search and random
    plan, the end.
    """
    study = designs.study
    bases = {_base(designs, name) for name in _relaxed_names(study)}
    relaxations = len(bases) * len(_shares(study))
    searches = {_search_name(designs, case) for case in questions}
    begin_and_end = 2
    return relaxations + len(searches) + len(study.specification.sizes) + begin_and_end


class _Steps:
    """Reports the share of the steps that are done."""

    def __init__(self, total: int, progress: Progress) -> None:
        self.total = total
        self.done = 0
        self.progress = progress

    def __call__(self, label: str) -> None:
        self.done += 1
        self.progress(label, self.done / self.total)


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


def _shares(study: Study) -> tuple[int | None, ...]:
    """Sizes that have relaxations of their own: with a prior in the design all, else none has."""
    return study.specification.sizes if study.specification.prior.in_design else (None,)


def _key(study: Study, name: str, size: int) -> str:
    """Key of the relaxation under a criterion that plans of this size are compared with."""
    return relaxation_key(name, size if study.specification.prior.in_design else None)


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
        fewer = designs.distinct(range(least, min(size, MOST_DISTINCT + 1)))
        found += [Case("distinct", study.main_criterion, size, distinct=k) for k in fewer]
    return found


@dataclass(frozen=True, eq=False)
class _Relax:
    """The relaxation of one criterion, as a piece of work that answers with plain numbers."""

    designs: Designs
    criterion: criteria.Relaxable
    share: int | None

    def __call__(self) -> Answer:
        found = relax_poses(
            _source(self.designs, self.share),
            self.designs.study.specification.candidates,
            self.criterion,
            continuous=True,
            options=self.designs.relax_options(),
        )
        answer = found.to_dict()
        del answer["seconds"]  # the same study gives the same files
        return answer


def _source(designs: Designs, share: int | None) -> CandidateSource:
    """Where candidates come from, for plans of so many experiments if that matters."""
    return source_of(designs.study, space=designs.space(share))


def _relaxed_bases(designs: Designs, complete: Complete) -> dict[str, RelaxedPlan]:
    """The relaxations over all feasible poses, one for all criteria that share their plans."""
    study = designs.study
    every = [designs.criterion(name).plan_criterion for name in _relaxed_names(study)]
    bases = {criterion.name: require_relaxable(criterion) for criterion in every}
    pieces = {
        relaxation_key(name, share): _Relax(designs, base, share)
        for share in _shares(study)
        for name, base in bases.items()
    }
    answers = complete({_relaxation_name(key): piece for key, piece in pieces.items()})
    return {
        key: RelaxedPlan.from_dict(
            _source(designs, piece.share), piece.criterion, answers[_relaxation_name(key)]
        )
        for key, piece in pieces.items()
    }


def _relaxations(designs: Designs, bases: dict[str, RelaxedPlan]) -> dict[str, RelaxedPlan]:
    """The relaxation under each criterion, from that under the one that is searched for it."""
    study = designs.study
    return {
        relaxation_key(name, share): relaxed_under(
            require_relaxable(designs.criterion(name)),
            bases[relaxation_key(_base(designs, name), share)],
        )
        for share in _shares(study)
        for name in _relaxed_names(study)
    }


@dataclass(frozen=True, eq=False)
class _Search:
    """The search for one plan, as a piece of work that answers with plain numbers."""

    designs: Designs
    relaxed: RelaxedPlan
    case: Case
    starts: int

    def __call__(self) -> Answer:
        try:
            found = self.designs.search(self.relaxed, self.case, self.starts)
        except NoPlanError as error:
            return {"reason": str(error)}
        if found.ended == "interrupted":
            raise KeyboardInterrupt  # the best plan so far is not the answer
        answer = found.to_dict()
        del answer["seconds"]  # the same study gives the same files
        return answer


def _searches(
    designs: Designs, questions: list[Case], bases: dict[str, RelaxedPlan]
) -> dict[str, "_Search"]:
    """The searches for the plans, by name, the largest first since they take longest."""
    study = designs.study
    searches: dict[str, _Search] = {}
    for case in sorted(questions, key=lambda case: -case.size):
        name = _search_name(designs, case)
        starts = study.specification.descents(case.optimised)
        if name in searches:  # shared; one of the criteria may be the one that gets more descents
            starts = max(starts, searches[name].starts)
        base = _base(designs, case.optimised)
        relaxed = bases[_key(study, base, case.size)]
        searches[name] = _Search(designs, relaxed, replace(case, optimised=base), starts)
    return searches


def _answered(case: Case, answer: Answer, relaxed: RelaxedPlan) -> Case:
    """A case with its plan, from the numbers of a `_Search`."""
    if "reason" in answer:
        return replace(case, reason=answer["reason"])
    found = ExactPlan.from_dict(relaxed, answer)
    cost = found.relaxed.criterion.cost_from_plan_criterion(found.cost)
    return replace(case, plan=found.plan, found=replace(found, cost=cost))
