"""The study runner: bounds -> plans for every criterion and size -> comparison, each case kept as it is finished."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import criteria
from edtk.design.candidate_source import EmptyFeasibleSetError
from edtk.design.exact.find_plan import TooFewError, find_plan, smallest_size
from edtk.design.plan import Plan
from edtk.design.problem import RankDeficientError
from edtk.design.relaxation.relax import require_relaxable
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.design.sample_feasible import sample_feasible
from edtk.report.comparison_report import write_report
from edtk.study.checkpoint import Checkpoint, checkpoint_of
from edtk.study.relax_study import relax_study, source_of
from edtk.study.study import Study
from edtk.system.atomic_file import atomic_path
from edtk.system.errors import UserError
from edtk.system.workers import Workers, WorkersLostError
from edtk.version import __version__

Progress = Callable[[str], object]
TOLERANCE = 1e-4  # of the search over the continuum
OURS = re.compile(
    r"(optimised|distinct|random)_(.+_)?m\d+(_k\d+)?"
)  # names of plans that a run writes
RANDOM = 101  # random plans, of which the median is shown
PLACES = 8  # distinct poses up to which fewer are compared with more


@dataclass(frozen=True, eq=False)
class Case:
    """One plan of the comparison.

    Attributes:
        kind: "optimised", "distinct", "published" or "random".
        optimised: Name of the criterion it was optimised for, or "".
        size: Number of experiments m.
        plan: The plan; None where the case cannot be done.
        places: Number of distinct poses at most; None for any.
        reason: Why it cannot be done, or "".
    """

    kind: str
    optimised: str
    size: int
    plan: Plan | None = None
    places: int | None = None
    reason: str = ""

    @property
    def name(self) -> str:
        """Stem of the plan's file."""
        places = f"k{self.places}" if self.places else ""
        return "_".join(filter(None, (self.kind, self.optimised, f"m{self.size}", places)))


@dataclass(frozen=True, eq=False)
class _Relaxing:
    """The relaxation of one criterion, as a piece of work that answers with plain numbers."""

    study: Study
    name: str

    def __call__(self) -> dict[str, Any]:
        found = relax_study(self.study, self.name, continuous=True, tolerance=TOLERANCE)
        answer = found.to_dict()
        del answer["seconds"]  # the same study gives the same files
        return answer


@dataclass(frozen=True, eq=False)
class _Planning:
    """The search for one plan, as a piece of work that answers with plain numbers."""

    study: Study
    relaxed: RelaxedPlan
    case: Case

    def __call__(self) -> dict[str, Any]:
        file = self.study.specification
        starts = file.descents(self.case.optimised)
        try:
            found = find_plan(
                self.relaxed, self.case.size, self.case.places, file.seed, starts=starts
            )
        except TooFewError as error:
            return {"reason": str(error)}
        if found.ended == "interrupted":
            raise KeyboardInterrupt  # what there is is not the answer
        plan = found.plan
        return {
            "q": plan.q.tolist(),
            "wrench": plan.wrench.tolist(),
            "repeats": plan.repeats.tolist(),
        } | {key: getattr(found, key) for key in ("starts", "found", "optima", "ended")}


def run_study(
    study: Study,
    out: Path,
    progress: Progress = lambda label: None,
    workers: Workers = Workers(),  # noqa: B008, frozen
    fresh: bool = False,
) -> pd.DataFrame:
    """Answer a study: plans, `results.csv` and `report.md` with its figures, in the folder `out`.

    The same study gives the same files, whoever does the work. Every case is kept in `out/cases` as soon as it is
    finished; a run that was killed goes on from there.

    Args:
        study: The question.
        out: Folder for the results; made where it does not exist, its files are replaced one by one, each whole.
        progress: Called with a label as each step is done; `steps(study)` of them.
        workers: Who does the work.
        fresh: Whether to begin anew, whatever is finished.

    Returns:
        The table of `results.csv`.

    Raises:
        UserError: No feasible poses, the candidates cannot identify all parameters, or the workers are lost.
    """
    published = study.published_plans()
    questions = _questions(study)
    progress("questions")
    checkpoint = checkpoint_of(study, out / "cases")
    if fresh:
        checkpoint.forget(())
    try:
        relaxed = _relaxations(study, checkpoint, workers, progress)
        cases = _searched(study, questions, relaxed, checkpoint, workers, progress)
    except WorkersLostError as error:
        raise UserError(f"{error}; what is finished is kept, run again to go on") from error
    for i, size in enumerate(study.specification.sizes):
        cases.append(_random(study, size, i))
        progress(cases[-1].name)
    cases += [Case("published", "", plan.experiments, plan) for plan in published.values()]
    table = _table(study, cases, relaxed)
    _write_plans(study, cases, out / "plans")
    with atomic_path(out / "results.csv") as temporary:
        table.to_csv(temporary, index=False, float_format="%.10g")
    write_report(study, table, relaxed, out)
    progress("report")
    return table


def steps(study: Study) -> int:
    """Number of times that `run_study` reports progress."""
    return 1 + len(_relaxable(study)) + len(_questions(study)) + len(study.specification.sizes) + 1


def _relaxable(study: Study) -> list[str]:
    """Names of the criteria that can be relaxed, those that are optimised first."""
    return [name for name in study.names if issubclass(criteria.get(name), criteria.Relaxable)]


def _questions(study: Study) -> list[Case]:
    """The plans to search for: every criterion and size, and fewer distinct poses for the first criterion."""
    file, main = study.specification, study.main_criterion
    try:
        least = smallest_size(study.space)
    except EmptyFeasibleSetError as error:
        raise study.error("workspace", str(error)) from error
    except RankDeficientError as error:
        raise study.error("joints.unknown", str(error)) from error
    found = []
    for size in file.sizes:
        found += [Case("optimised", name, size) for name in file.optimise]
        found += [
            Case("distinct", main, size, places=k) for k in range(least, min(size, PLACES + 1))
        ]
    return found


def _relaxations(
    study: Study, checkpoint: Checkpoint, workers: Workers, progress: Progress
) -> dict[str, RelaxedPlan]:
    """The relaxation of every criterion that is compared or optimised, over all feasible poses."""
    names = _relaxable(study)
    pieces = {f"relaxation_{name}": _Relaxing(study, name) for name in names}
    answers = _answered(pieces, checkpoint, workers, progress)
    found = {}
    for name in names:
        found[name] = RelaxedPlan.from_dict(
            source_of(study),
            require_relaxable(study.criterion(name)),
            answers[f"relaxation_{name}"],
        )
    return found


def _searched(
    study: Study,
    questions: list[Case],
    relaxed: dict[str, RelaxedPlan],
    checkpoint: Checkpoint,
    workers: Workers,
    progress: Progress,
) -> list[Case]:
    """The plans that were searched for, or why there is none."""
    hardest_first = sorted(questions, key=lambda case: -case.size)
    pieces = {case.name: _Planning(study, relaxed[case.optimised], case) for case in hardest_first}
    answers = _answered(pieces, checkpoint, workers, progress)
    checkpoint.forget([*answers, *(f"relaxation_{name}" for name in relaxed)])
    found = []
    for case in questions:
        answer = answers[case.name]
        plan = None
        if "q" in answer:
            plan = Plan(
                np.array(answer["q"]), np.array(answer["wrench"]), np.array(answer["repeats"])
            )
        reason = answer.get("reason", "")
        found.append(Case(case.kind, case.optimised, case.size, plan, case.places, reason))
    return found


def _answered(
    pieces: Mapping[str, Callable[[], dict[str, Any]]],
    checkpoint: Checkpoint,
    workers: Workers,
    progress: Progress,
) -> dict[str, dict[str, Any]]:
    """The answer of every piece of work, from the ledger or, where it is not there, from the team."""
    answers = {name: found for name in pieces if (found := checkpoint.find(name)) is not None}
    for name in answers:
        progress(name)
    missing = [name for name in pieces if name not in answers]
    for i, answer in workers.run([pieces[name] for name in missing]):
        checkpoint.keep(missing[i], answer)
        answers[missing[i]] = answer
        progress(missing[i])
    return answers


def _random(study: Study, size: int, stream: int) -> Case:
    """Of many plans of feasible poses drawn at random, from a stream of its own, the one of median worth."""
    x = sample_feasible(study.space, RANDOM * size, (study.specification.seed, 2, stream)).reshape(
        RANDOM, size, -1
    )
    costs = study.criterion(study.main_criterion).cost(
        study.space.at(x).information(np.ones((RANDOM, size)))
    )
    middle = int(np.argsort(costs, kind="stable")[RANDOM // 2])
    if not np.isfinite(costs[middle]):
        return Case("random", "", size, reason="such a plan cannot identify all parameters")
    return Case("random", "", size, study.space.plan(x[middle], np.ones(size, dtype=int)))


def _write_plans(study: Study, cases: list[Case], folder: Path) -> None:
    """Plans as files; those of an earlier run that are not among them are removed."""
    wanted = {
        f"{case.name}.csv": case.plan
        for case in cases
        if case.plan is not None and case.kind != "published"
    }
    for name, plan in wanted.items():
        plan.to_csv(folder / name, study.robot)
    for kind in ("optimised", "distinct", "random"):
        for path in folder.glob(f"{kind}_*.csv"):
            if path.name not in wanted and OURS.fullmatch(path.stem):
                path.unlink()


def _table(study: Study, cases: list[Case], relaxed: dict[str, RelaxedPlan]) -> pd.DataFrame:
    """One row a plan, SI units; efficiencies against the bounds over all feasible poses."""
    rows = []
    for case in cases:
        row: dict[str, object] = {
            "plan": case.name,
            "kind": case.kind,
            "optimised_for": case.optimised,
        }
        row |= {"experiments": case.size, "distinct_at_most": case.places or case.size}
        row |= {"poses": 0 if case.plan is None else len(case.plan.q), "reason": case.reason}
        M = None if case.plan is None else study.space.information(case.plan)
        for name in study.specification.criteria:
            row[name] = np.nan if M is None else float(study.criterion(name).value(M))
        for name, relaxation in relaxed.items():
            bound = relaxation.best_bound.scaled(case.size)
            cost = np.inf if M is None else float(study.criterion(name).cost(M))
            row[f"efficiency_{name}"] = bound.efficiency(cost)
        row |= {
            "seed": study.specification.seed,
            "study_sha256": study.digest,
            "edtk": __version__,
        }
        rows.append(row)
    return pd.DataFrame(rows)
