"""`edtk.relax`: the best weights over candidate experiments, with a bound on every design."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, overload

from edtk.system.arguments import checked
from edtk.system.time_limit import Progress
from edtk.verbs.of_kinds import question_of
from edtk.verbs.question import RelaxCall

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from edtk.design.problem import Problem
    from edtk.design.region import Region
    from edtk.design.relaxation.relaxation import Relaxation
    from edtk.design.relaxation.relaxed_plan import RelaxedPlan
    from edtk.design.relaxation.relaxed_region import RelaxedRegion
    from edtk.verbs.asked_limits import Constraint
    from edtk.verbs.inputs import CriterionLike, StudyLike

MEMORY_MB = 1000.0


@overload
def relax(
    question: "StudyLike",
    criterion: "CriterionLike | None" = None,
    candidates: int | None = None,
    *,
    continuous: bool = False,
    size: int | None = None,
    seed: int | None = None,
    memory_mb: float = MEMORY_MB,
    workers: int | None = None,
    dask: str | None = None,
    out: Path | str | None = None,
    certificate: Path | str | None = None,
    progress: Progress = ...,
    budget: float | None = None,
    prove: float | None = None,
) -> "RelaxedPlan": ...


@overload
def relax(
    question: "Problem",
    criterion: "CriterionLike | None" = None,
    *,
    size: int | None = None,
    least: "ArrayLike | None" = None,
    most: "ArrayLike | None" = None,
    costs: "ArrayLike | None" = None,
    cost_budget: "ArrayLike | None" = None,
    constraints: "Sequence[Constraint] | None" = None,
    out: Path | str | None = None,
    certificate: Path | str | None = None,
    progress: Progress = ...,
) -> "Relaxation": ...


@overload
def relax(
    question: "Region",
    criterion: "CriterionLike | None" = None,
    candidates: int | None = None,
    *,
    size: int | None = None,
    out: Path | str | None = None,
    certificate: Path | str | None = None,
    progress: Progress = ...,
    prove: float | None = None,
) -> "RelaxedRegion": ...


@checked
def relax(
    question: "StudyLike | Problem | Region",
    criterion: "CriterionLike | None" = None,
    candidates: int | None = None,
    *,
    continuous: bool = False,
    size: int | None = None,
    seed: int | None = None,
    memory_mb: float = MEMORY_MB,
    workers: int | None = None,
    dask: str | None = None,
    out: Path | str | None = None,
    certificate: Path | str | None = None,
    progress: Progress = lambda stage, gap: None,
    budget: float | None = None,
    prove: float | None = None,
    least: "ArrayLike | None" = None,
    most: "ArrayLike | None" = None,
    costs: "ArrayLike | None" = None,
    cost_budget: "ArrayLike | None" = None,
    constraints: "Sequence[Constraint] | None" = None,
) -> "RelaxedPlan | Relaxation | RelaxedRegion":
    """Minimise a criterion over weights instead of whole experiments, and prove a bound.

    Args:
        question: A study, the path of a study file, a `Problem` of arrays, or a `Region` of points.
            The options below belong to studies; `size`, `out` and `certificate` to problems too.
        criterion: Name of a criterion, a table of its name and parameters, or a `Criterion`;
            defaults to the study's main criterion, and to "D" for a problem or a region. The mean
            of predictions (I) that says no places is over all candidates or points, the largest one
            (prediction_G) over all candidates; of a region it has to say places.
        candidates: Number of candidate poses; defaults to the study's. Of a region, about the
            number of points of the grid where ascents begin; defaults to 5000.
        continuous: Whether to search all feasible poses, beyond the candidates.
        size: Number of experiments that share a prior which counts in designs; defaults to the
            first of the study's sizes, and for a problem to one.
        seed: Seed of the candidates; defaults to the study's.
        memory_mb: Limit on memory [MB].
        workers: Number of processes that go over the candidates which memory does not hold;
            defaults to threads of this process, one a core. The result is the same.
        dask: Address of a Dask scheduler whose workers do that, like tcp://host:8786.
        out: File to write poses and weights to (CSV); "-" is standard output.
        certificate: File to write what proves the numbers to (JSON), for `edtk.verify`; likewise.
        progress: Called with the stage and its relative gap; over ranges of theta with the number
            of theta that were tried alone, besides. A problem has stages over ranges only.
        budget: Seconds after which the best weights so far are given, with the best bound so far;
            a first design on the candidates, or on those drawn by then, is always completed.
            `.ended` says so. Defaults to no limit.
        prove: Relative gap, such as 0.01, to which the bound is proved for all feasible poses of a
            study, or for all points of a region whose functions can be enclosed, see the how-to of
            regions: no design is better. It is `.bound_proved`, beside `.bound_searched`.
        least: Of a problem: limits as `edtk.plan` has them, but on counts that need not be whole.
            They are counts of `size` experiments, `.counts` of the result; without a size they are
            limits on weights. Least count of each candidate (n,), or of all.
        most: Largest count of each candidate (n,), or of all.
        costs: Costs (n,) of one experiment with each candidate; (k, n) for k budgets.
        cost_budget: What the experiments may cost together, a number for each budget (k,). Without
            a size, budgets decide on the number of experiments, and value and bound are those of
            all experiments together.
        constraints: Linear constraints on the counts.

    Returns:
        Weights with `.value`, `.bound` and `.gap`; within limits also `.counts`.

    Raises:
        UserError: One line that says what cannot be done, and where.
        PlanInterrupted: Ctrl-C after a first certified design, which the exception carries.

    Example:
        >>> import numpy as np, edtk
        >>> x = np.linspace(-1, 1, 201)
        >>> rows = np.stack([np.ones_like(x), x, x**2], axis=-1)
        >>> design = edtk.relax(edtk.Problem(rows[:, None, :]), "D")
        >>> x[design.weights > 0.1].round(2).tolist()
        [-1.0, 0.0, 1.0]
    """
    asked = question_of(question)
    call = RelaxCall(
        criterion=criterion,
        candidates=candidates,
        continuous=continuous,
        size=size,
        seed=seed,
        memory_mb=memory_mb,
        workers=workers,
        dask=dask,
        out=out,
        certificate=certificate,
        progress=progress,
        budget=budget,
        prove=prove,
        least=least,
        most=most,
        costs=costs,
        cost_budget=cost_budget,
        constraints=constraints,
    )
    asked.require("relax", **vars(call))
    return asked.relax(call)
