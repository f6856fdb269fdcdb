"""The answer to a whole study: bounds and plans for every criterion and size, compared."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import criteria
from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.exact.find_plan import SearchOptions, find_plan
from edtk.design.exact.require_enough import TooFewExperimentsError
from edtk.design.exact.smallest_size import smallest_size
from edtk.design.relaxation.relax import require_relaxable
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.study.case import Case
from edtk.study.checkpoint import Checkpoint, checkpoint_of
from edtk.study.comparison_table import comparison_table
from edtk.study.random_case import random_case
from edtk.study.relax_study import relax_study, source_of
from edtk.study.run_options import DEFAULTS, Progress, RunOptions
from edtk.study.study import Study
from edtk.study.study_errors import study_errors
from edtk.study.study_run import StudyRun
from edtk.study.write_plans import write_plans
from edtk.system.atomic_file import atomic_path
from edtk.system.errors import UserError
from edtk.system.workers import WorkersLostError

# Relative gap of the search over all poses: tables show efficiencies to 0.1 %.
TOLERANCE = 1e-4
# Fewer distinct poses are compared with more up to this number: beyond it nothing is gained.
MOST_DISTINCT = 8


def run_study(
    study: Study, folder: Path | str, *, fresh: bool = False, options: RunOptions = DEFAULTS
) -> StudyRun:
    """Find and compare the plans of a study; write `results.csv` and the plans.

    The same study gives the same files, on any number of processes. Every case is kept in the
    folder's `cases` as soon as it is finished, so that a run that was killed goes on from there.

    Args:
        study: The study.
        folder: Folder for the results, which is made if need be; its files are replaced one by
            one, each whole.
        fresh: Whether to begin anew, whatever is finished.
        options: Seed, processes and progress; progress is reported `steps(study)` times.

    Raises:
        UserError: No feasible poses, the candidates cannot identify all parameters, or the workers
            are lost.
    """
    if options.seed is not None:
        study = study.replace(seed=options.seed)
    folder = Path(folder)
    published = study.published_plans()
    with study_errors(study):
        questions = _questions(study)
        report = _Steps(_count(study, questions), options.progress)
        report("questions")
        checkpoint = checkpoint_of(study, folder / "cases")
        if fresh:
            checkpoint.forget_others(())
        try:
            relaxations = _relaxations(study, checkpoint, options, report)
            cases = _searched(study, questions, relaxations, checkpoint, options, report)
        except WorkersLostError as error:
            raise UserError(f"{error}; what is finished is kept, run again to go on") from error
    for index, size in enumerate(study.specification.sizes):
        cases.append(random_case(study, size, index))
        report(cases[-1].name)
    cases += [Case("published", "", plan.experiments, plan=plan) for plan in published.values()]
    table = comparison_table(study, cases, relaxations)
    write_plans(cases, study.robot, folder / "plans")
    with atomic_path(folder / "results.csv") as temporary:
        table.to_csv(temporary, index=False, float_format="%.10g")
    report("results")
    return StudyRun(study, table, relaxations, tuple(cases), folder)


def steps(study: Study) -> int:
    """Number of times that `run_study` reports progress."""
    with study_errors(study):
        return _count(study, _questions(study))


def _count(study: Study, questions: list[Case]) -> int:
    """The same, of a study whose questions are known: they, the random plans, first and last."""
    return len(_relaxable(study)) + len(questions) + len(study.specification.sizes) + 2


class _Steps:
    """Reports the share of the steps that are done."""

    def __init__(self, total: int, progress: Progress) -> None:
        self.total = total
        self.done = 0
        self.progress = progress

    def __call__(self, label: str) -> None:
        self.done += 1
        self.progress(label, self.done / self.total)


def _relaxable(study: Study) -> list[str]:
    """Names of the criteria that can be relaxed, those that are optimised first."""
    return [name for name in study.names if issubclass(criteria.get(name), criteria.Relaxable)]


def _questions(study: Study) -> list[Case]:
    """The plans to search for: every criterion and size, and fewer poses for the main criterion."""
    least = smallest_size(study.space)
    found = []
    for size in study.specification.sizes:
        found += [Case("optimised", name, size) for name in study.specification.optimise]
        fewer = range(least, min(size, MOST_DISTINCT + 1))
        found += [Case("distinct", study.main_criterion, size, distinct=k) for k in fewer]
    return found


@dataclass(frozen=True, eq=False)
class _Relax:
    """The relaxation of one criterion, as a piece of work that answers with plain numbers."""

    study: Study
    criterion: str

    def __call__(self) -> dict[str, Any]:
        found = relax_study(self.study, self.criterion, continuous=True, tolerance=TOLERANCE)
        answer = found.to_dict()
        del answer["seconds"]  # the same study gives the same files
        return answer


def _relaxations(
    study: Study, checkpoint: Checkpoint, options: RunOptions, report: _Steps
) -> dict[str, RelaxedPlan]:
    """The relaxation of every criterion that is compared or optimised, over all feasible poses."""
    names = _relaxable(study)
    pieces = {f"relaxation_{name}": _Relax(study, name) for name in names}
    answers = checkpoint.complete(pieces, options.workers, report)
    return {
        name: RelaxedPlan.from_dict(
            source_of(study),
            require_relaxable(study.criterion(name)),
            answers[f"relaxation_{name}"],
        )
        for name in names
    }


@dataclass(frozen=True, eq=False)
class _Search:
    """The search for one plan, as a piece of work that answers with plain numbers."""

    study: Study
    relaxed: RelaxedPlan
    case: Case

    def __call__(self) -> dict[str, Any]:
        specification = self.study.specification
        starts = specification.descents(self.case.optimised)
        try:
            options = SearchOptions(seed=specification.seed, starts=starts)
            found = find_plan(self.relaxed, self.case.size, self.case.distinct, options=options)
        except TooFewExperimentsError as error:
            return {"reason": str(error)}
        if found.ended == "interrupted":
            raise KeyboardInterrupt  # the best plan so far is not the answer
        answer = found.to_dict()
        del answer["seconds"]  # the same study gives the same files
        return answer


def _searched(
    study: Study,
    questions: list[Case],
    relaxations: dict[str, RelaxedPlan],
    checkpoint: Checkpoint,
    options: RunOptions,
    report: _Steps,
) -> list[Case]:
    """The plans that were searched for, or the reasons why there are none."""
    largest_first = sorted(questions, key=lambda case: -case.size)  # they take longest
    pieces = {
        case.name: _Search(study, relaxations[case.optimised], case) for case in largest_first
    }
    answers = checkpoint.complete(pieces, options.workers, report)
    checkpoint.forget_others([*answers, *(f"relaxation_{name}" for name in relaxations)])
    return [_answered(case, answers[case.name], relaxations[case.optimised]) for case in questions]


def _answered(case: Case, answer: dict[str, Any], relaxed: RelaxedPlan) -> Case:
    """A case with its plan, from the numbers of a `_Search`."""
    if "reason" in answer:
        return replace(case, reason=answer["reason"])
    found = ExactPlan.from_dict(relaxed, answer)
    return replace(case, plan=found.plan, found=found)
