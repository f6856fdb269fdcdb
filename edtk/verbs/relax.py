"""`edtk.relax`: the best weights over candidate experiments, with a bound on every design."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, overload

if TYPE_CHECKING:
    from edtk.design.problem import Problem
    from edtk.design.region import Region
    from edtk.design.relaxation.relaxation import Relaxation
    from edtk.design.relaxation.relaxed_plan import RelaxedPlan
    from edtk.design.relaxation.relaxed_region import RelaxedRegion
    from edtk.study.study import Study
    from edtk.verbs.inputs import CriterionLike, StudyLike, TableAndCertificate

Progress = Callable[[str, float], object]
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
    out: Path | str | None = None,
    certificate: Path | str | None = None,
    progress: Progress = ...,
) -> "RelaxedPlan": ...


@overload
def relax(
    question: "Problem",
    criterion: "CriterionLike | None" = None,
    *,
    size: int | None = None,
    out: Path | str | None = None,
    certificate: Path | str | None = None,
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
) -> "RelaxedRegion": ...


def relax(
    question: "StudyLike | Problem | Region",
    criterion: "CriterionLike | None" = None,
    candidates: int | None = None,
    *,
    continuous: bool = False,
    size: int | None = None,
    seed: int | None = None,
    memory_mb: float = MEMORY_MB,
    out: Path | str | None = None,
    certificate: Path | str | None = None,
    progress: Progress = lambda stage, gap: None,
) -> "RelaxedPlan | Relaxation | RelaxedRegion":
    """Minimise a criterion over weights instead of whole experiments, and prove a bound.

    Args:
        question: A study, the path of a study file, a `Problem` of arrays, or a `Region` of points.
            The options below belong to studies; `size`, `out` and `certificate` to problems too.
        criterion: Name of a criterion, a table of its name and parameters, or a `Criterion`;
            defaults to the study's main criterion, and to "D" for a problem or a region.
        candidates: Number of candidate poses; defaults to the study's. Of a region, about the
            number of points of the grid where ascents begin; defaults to 5000.
        continuous: Whether to search all feasible poses, beyond the candidates.
        size: Number of experiments that share a prior which counts in designs; defaults to the
            first of the study's sizes, and for a problem to one.
        seed: Seed of the candidates; defaults to the study's.
        memory_mb: Limit on memory [MB].
        out: File to write poses and weights to (CSV); "-" is standard output.
        certificate: File to write what proves the numbers to (JSON), for `edtk.verify`; likewise.
        progress: Called with the stage and its relative gap.

    Returns:
        Weights with `.value`, `.bound` and `.gap`.

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
    from edtk.design.problem import Problem
    from edtk.design.region import Region

    if isinstance(question, Problem):
        _require_default("a problem of arrays", candidates=candidates, seed=seed)
        asked = "D" if criterion is None else criterion
        return _relax_problem(question, asked, size, out, certificate)
    if isinstance(question, Region):
        _require_default("a region", seed=seed)
        asked = "D" if criterion is None else criterion
        return _relax_region(question, asked, candidates, size, progress, out, certificate)
    from edtk.design.relaxation.relax_poses import PlanInterrupted
    from edtk.study.plan_study import RunOptions
    from edtk.verbs.inputs import TableAndCertificate, as_study, errors_in, for_criterion

    study = as_study(question)
    files = TableAndCertificate(out, certificate)
    files.require(*study.reads)
    study, name = for_criterion(study, criterion)
    if certificate is not None:
        from edtk.certificate.certificate import require_certifiable

        require_certifiable(study, name, certificate)
    try:
        with errors_in(study.where):
            found = _relaxed_by(study)(
                study,
                name,
                candidates=candidates,
                continuous=continuous,
                size=size,
                memory_mb=memory_mb,
                options=RunOptions(seed=seed, progress=progress),
            )
    except PlanInterrupted as interrupt:
        _write(study, interrupt.best, files)
        raise
    _write(study, found, files)
    return found


def _relaxed_by(study: "Study") -> Callable[..., "RelaxedPlan"]:
    """What relaxes a study: of geometry, or of compliances alone."""
    if study.specification.parameters is not None:
        from edtk.calibration.geometry_design.plan_geometry import relax_geometry

        return relax_geometry
    from edtk.study.plan_study import relax_study

    return relax_study


def _write(study: "Study", found: "RelaxedPlan", files: "TableAndCertificate") -> None:
    """Write the files that were asked for."""

    def proof() -> str:
        from edtk.certificate.certificate import certificate_text
        from edtk.verbs.inputs import setting_of

        return certificate_text(study, found, setting_of(study, found.space))

    files.write(found.to_frame, proof)


def _require_default(what: str, **options: object) -> None:
    """Check that options of another kind of question are not given."""
    from edtk.system.errors import ArgumentError

    for name, value in options.items():
        if value is not None:
            raise ArgumentError(f"not for the relaxation of {what}", argument=name)


def _relax_problem(
    problem: "Problem",
    criterion: "CriterionLike",
    size: int | None,
    out: Path | str | None,
    certificate: Path | str | None,
) -> "Relaxation":
    """The relaxation over the candidates of a problem of arrays."""
    import criteria
    from edtk.design.relaxation.relax import relax as relax_candidates
    from edtk.system.errors import whole_number
    from edtk.system.parsing import json_text
    from edtk.verbs.inputs import TableAndCertificate

    criterion = criteria.as_criterion(criterion, problem.parameters)
    files = TableAndCertificate(out, certificate)
    files.require()
    number = 1 if size is None else whole_number(size, "size", 1)
    found = relax_candidates(problem, criterion.for_size(number))
    found = replace(found, problem=problem)
    files.write(lambda: found.to_frame().reset_index(), lambda: json_text(found.to_dict()) + "\n")
    return found


def _relax_region(
    region: "Region",
    criterion: "CriterionLike",
    candidates: int | None,
    size: int | None,
    progress: Progress,
    out: Path | str | None,
    certificate: Path | str | None,
) -> "RelaxedRegion":
    """The relaxation over all points of a region, and its files."""
    import criteria
    from edtk.design.relaxation.relax_region import relax_region
    from edtk.design.relaxation.search_region import POINTS
    from edtk.system.errors import whole_number
    from edtk.system.parsing import json_text
    from edtk.verbs.inputs import TableAndCertificate

    criterion = criteria.as_criterion(criterion, region.parameters)
    files = TableAndCertificate(out, certificate)
    files.require()
    points = POINTS if candidates is None else whole_number(candidates, "candidates", 2)
    of_one = criterion.for_size(1 if size is None else whole_number(size, "size", 1))
    found = relax_region(region, of_one, points, progress=progress)
    files.write(found.to_frame, lambda: json_text(found.on_grid().to_dict()) + "\n")
    return found
