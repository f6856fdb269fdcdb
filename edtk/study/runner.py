"""The study runner: candidates -> relaxation -> apportionment -> refinement -> comparison."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

import criteria
import edtk
from edtk.atomic import atomic_path
from edtk.design import Candidates, Plan, RelaxedPlan, apportion, refine
from edtk.study.relaxed import candidates_of, relaxed_plan
from edtk.study.report import write_report
from edtk.study.spec import Study

Progress = Callable[[str], object]
TOLERANCE = 1e-4  # of the search over the continuum


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
    candidates, relaxed = _relaxations(study, progress)
    cases = []
    for case in _cases(study, published, candidates, relaxed):
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
    return 1 + len(_relaxable(study)) + sizes * (chosen + 1) + len(study.file.published) + 1


def _relaxations(study: Study, progress: Progress) -> tuple[Candidates, dict[str, RelaxedPlan]]:
    """Candidates, and the relaxation of every criterion that is compared or optimised, over all feasible poses."""
    candidates = candidates_of(study)
    progress("candidates")
    relaxed = {}
    for name in _relaxable(study):
        relaxed[name] = relaxed_plan(study, name, continuous=True, tolerance=TOLERANCE, candidates=candidates)
        progress(f"relaxation {name}")
    return candidates, relaxed


def _relaxable(study: Study) -> list[str]:
    """Names of the criteria that can be relaxed, those that are optimised first."""
    names = dict.fromkeys((*study.file.optimise, *study.file.criteria))
    return [name for name in names if criteria.get(name).has_convex_form()]


def _cases(
    study: Study, published: dict[str, Plan], candidates: Candidates, relaxed: dict[str, RelaxedPlan]
) -> Iterator[Case]:
    """All plans of the comparison, each from a random stream of its own."""
    for i, size in enumerate(study.file.sizes):
        for j, name in enumerate(study.file.optimise):
            rng = np.random.default_rng([study.file.seed, 1, i, j])
            plan = exact_plan(relaxed[name], candidates.q, size, study.file.starts, rng)
            reason = "" if plan else _too_few(study, size)
            yield Case("optimised", name, size, plan, reason)
        rng = np.random.default_rng([study.file.seed, 2, i])
        n = len(candidates.q)
        chosen = rng.choice(n, size=size, replace=size > n)
        random: Plan | None = study.design.plan(candidates.q[chosen], np.ones(size, dtype=int))
        if not np.isfinite(criteria.create("A").cost(candidates.problem.information(np.bincount(chosen, minlength=n)))):
            random = None
        yield Case("random", "", size, random, "" if random else _too_few(study, size))
    for plan in published.values():
        yield Case("published", "", plan.experiments, plan)


def _too_few(study: Study, size: int) -> str:
    """Why a size has no plan."""
    return f"{size} experiment{'s' if size > 1 else ''} cannot identify {study.model.p} parameters"


def exact_plan(
    relaxed: RelaxedPlan, candidates: np.ndarray, size: int, starts: int, rng: np.random.Generator
) -> Plan | None:
    """The best of several refined plans: one from the apportioned weights, the others drawn by weight or at random.

    Args:
        relaxed: Poses and weights to start from, with the criterion to improve.
        candidates: Candidate poses (n, n_joints) to draw from besides.
        size: Number of experiments m.
        starts: Number of refinements.
        rng: Source of randomness.

    Returns:
        A plan of m experiments, or None where none of the starts identifies all parameters.
    """
    design, criterion = relaxed.design, relaxed.criterion
    best, best_cost = None, np.inf
    start = np.repeat(relaxed.q, apportion(relaxed.weights, size), axis=0)
    for _ in range(starts):
        plan = refine(design, criterion, design.plan(start, np.ones(size, dtype=int)))
        cost = float(criterion.cost(design.information(plan)))
        if cost < best_cost:
            best, best_cost = plan, cost
        start = relaxed.q[rng.choice(len(relaxed.q), size=size, p=relaxed.weights)]
        if rng.random() < 0.5:
            start = candidates[rng.choice(len(candidates), size=size)]
    return best


def _table(study: Study, cases: list[Case], relaxed: dict[str, RelaxedPlan]) -> pd.DataFrame:
    """One row a plan, SI units; efficiencies against the bounds over all feasible poses."""
    rows = []
    for case in cases:
        row: dict[str, object] = {"plan": case.name, "kind": case.kind, "optimised_for": case.optimised}
        row |= {"experiments": case.size, "reason": case.reason}
        M = None if case.plan is None else study.design.information(case.plan)
        for name in study.file.criteria:
            row[name] = np.nan if M is None else float(study.criterion(name).value(M))
        for name, relaxation in relaxed.items():
            degree = criteria.get(name).degree
            bound = relaxation.best_bound * case.size**-degree
            cost = np.inf if M is None else float(study.criterion(name).cost(M))
            row[f"efficiency_{name}"] = bound / cost
        row |= {"seed": study.file.seed, "study_sha256": study.digest, "edtk": edtk.__version__}
        rows.append(row)
    return pd.DataFrame(rows)
