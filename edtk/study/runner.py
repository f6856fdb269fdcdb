"""The study runner: candidates -> relaxation -> apportionment -> refinement -> comparison."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

import criteria
import edtk
from criteria import Criterion
from edtk.atomic import atomic_path
from edtk.design import (
    EmptyFeasibleSetError,
    Plan,
    PoseDesign,
    Problem,
    Relaxation,
    RelaxationError,
    apportion,
    refine,
    relax,
    sample_feasible,
)
from edtk.errors import UserError
from edtk.inference import SingularPlanError, covariance
from edtk.study.report import write_report
from edtk.study.spec import Study

Progress = Callable[[str], object]


@dataclass(frozen=True, eq=False)
class Case:
    """One plan of the comparison.

    Attributes:
        kind: "optimised", "published" or "random".
        optimised: Name of the criterion it was optimised for, or "".
        size: Number of experiments m.
        plan: The plan; None where the case cannot be done.
        reason: Why it cannot be done, or "".
    """

    kind: str
    optimised: str
    size: int
    plan: Plan | None
    reason: str = ""

    @property
    def name(self) -> str:
        """Stem of the plan's file."""
        return "_".join(filter(None, (self.kind, self.optimised, f"m{self.size}")))


def run_study(study: Study, out: Path, progress: Progress = lambda label: None) -> pd.DataFrame:
    """Answer a study: plans, `results.csv` and `report.md` with its figure, in the folder `out`.

    The same study gives the same files: every case draws from its own stream, seeded by the study's seed.

    Args:
        study: The question.
        out: Folder for the results; made where it does not exist, its files are replaced one by one, each whole.
        progress: Called with a label as each step is done; `steps(study)` of them.

    Returns:
        The table of `results.csv`.

    Raises:
        UserError: No feasible poses, or the candidates cannot identify all parameters.
    """
    published = study.published_plans()
    problem, q, relaxed = _relaxations(study, progress)
    cases = []
    for case in _cases(study, published, q, problem, relaxed):
        cases.append(case)
        progress(case.name)
    table = _table(study, cases, relaxed)
    out.mkdir(parents=True, exist_ok=True)
    for case in cases:
        if case.plan is not None and case.kind != "published":
            case.plan.to_csv(out / "plans" / f"{case.name}.csv", study.robot)
    with atomic_path(out / "results.csv") as temporary:
        table.to_csv(temporary, index=False, float_format="%.10g")
    write_report(study, table, relaxed, out)
    progress("report")
    return table


def steps(study: Study) -> int:
    """Number of times that `run_study` reports progress."""
    sizes, chosen = len(study.file.sizes), len(study.file.optimise)
    return 1 + chosen + sizes * (chosen + 1) + len(study.file.published) + 1


def _relaxations(study: Study, progress: Progress) -> tuple[Problem, np.ndarray, dict[str, Relaxation]]:
    """Candidates, and the relaxation of every criterion that is optimised."""
    rng = np.random.default_rng([study.file.seed, 0])
    design = study.design
    try:
        q = sample_feasible(design.workspace, study.file.candidates, rng, design.free, design.fixed)
    except EmptyFeasibleSetError as error:
        raise study.error("workspace", str(error)) from error
    problem = design.problem(q)
    progress("candidates")
    _check_identifiable(study, problem)
    relaxed = {}
    for name in study.file.optimise:
        try:
            relaxed[name] = relax(problem, study.criterion(name))
        except (RelaxationError, NotImplementedError) as error:
            raise UserError(f"{study.path}: optimise: criterion {name!r}: {error}") from error
        progress(f"relaxation {name}")
    return problem, q, relaxed


def _check_identifiable(study: Study, problem: Problem) -> None:
    """All candidates together must identify all parameters."""
    try:
        covariance(problem.information(np.ones(len(problem.blocks))), study.model.parameters)
    except SingularPlanError as error:
        raise study.error("joints.unknown", str(error).replace("the plan", "any plan with this load")) from error


def _cases(
    study: Study, published: dict[str, Plan], q: np.ndarray, problem: Problem, relaxed: dict[str, Relaxation]
) -> Iterator[Case]:
    """All plans of the comparison, each from a random stream of its own."""
    for i, size in enumerate(study.file.sizes):
        for j, (name, relaxation) in enumerate(relaxed.items()):
            rng = np.random.default_rng([study.file.seed, 1, i, j])
            plan = exact_plan(study.design, study.criterion(name), q, relaxation, size, study.file.starts, rng)
            reason = "" if plan else _too_few(study, size)
            yield Case("optimised", name, size, plan, reason)
        rng = np.random.default_rng([study.file.seed, 2, i])
        chosen = rng.choice(len(q), size=size, replace=size > len(q))
        random: Plan | None = study.design.plan(q[chosen], np.ones(size, dtype=int))
        if not np.isfinite(criteria.create("A").cost(problem.information(np.bincount(chosen, minlength=len(q))))):
            random = None
        yield Case("random", "", size, random, "" if random else _too_few(study, size))
    for plan in published.values():
        yield Case("published", "", plan.experiments, plan)


def _too_few(study: Study, size: int) -> str:
    """Why a size has no plan."""
    return f"{size} experiment{'s' if size > 1 else ''} cannot identify {study.model.p} parameters"


def exact_plan(
    design: PoseDesign,
    criterion: Criterion,
    q: np.ndarray,
    relaxation: Relaxation,
    size: int,
    starts: int,
    rng: np.random.Generator,
) -> Plan | None:
    """The best of several refined plans: one from the apportioned weights, the others drawn by weight.

    Args:
        design: Model, feasible set and free joints.
        criterion: What to improve.
        q: The candidates (n, n_joints) that the relaxation weighs.
        relaxation: Their weights.
        size: Number of experiments m.
        starts: Number of refinements.
        rng: Source of randomness.

    Returns:
        A plan of m experiments, or None where none of the starts identifies all parameters.
    """
    best, best_cost = None, np.inf
    counts = apportion(relaxation.weights, size)
    chosen = np.repeat(np.flatnonzero(counts), counts[counts > 0])
    for _ in range(starts):
        start = design.plan(q[chosen], np.ones(size, dtype=int))
        plan = refine(design, criterion, start)
        cost = float(criterion.cost(design.information(plan)))
        if cost < best_cost:
            best, best_cost = plan, cost
        chosen = rng.choice(len(q), size=size, p=relaxation.weights)
        if rng.random() < 0.5:
            chosen = rng.choice(len(q), size=size)
    return best


def _table(study: Study, cases: list[Case], relaxed: dict[str, Relaxation]) -> pd.DataFrame:
    """One row a plan, SI units; efficiency against the relaxation where the plan was optimised for it.

    A candidate set is not the continuum of poses: a refined plan may lie beyond the candidates' bound.
    """
    rows = []
    for case in cases:
        row: dict[str, object] = {"plan": case.name, "kind": case.kind, "optimised_for": case.optimised}
        row |= {"experiments": case.size, "reason": case.reason}
        M = None if case.plan is None else study.design.information(case.plan)
        for name in study.file.criteria:
            row[name] = np.nan if M is None else float(study.criterion(name).value(M))
        for name, relaxation in relaxed.items():
            degree = criteria.get(name).degree
            bound = relaxation.bound * case.size**-degree
            cost = np.inf if M is None else float(study.criterion(name).cost(M))
            row[f"efficiency_{name}"] = bound / cost
        row |= {"seed": study.file.seed, "study_sha256": study.digest, "edtk": edtk.__version__}
        rows.append(row)
    return pd.DataFrame(rows)
