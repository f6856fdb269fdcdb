"""`edtk.plan` of a study: its search, and the files that are written of it."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import criteria
from edtk.calibration.geometry_design.detect_in_visits import detect_in_visits, sized_visit_faults
from edtk.calibration.geometry_design.evaluate_geometry import GeometryDesigns, poor_left_out
from edtk.calibration.geometry_design.plan_geometry import plan_geometry as plan_of_study
from edtk.design.exact.exact_plan import ExactPlan
from edtk.study.plan_study import Progress, RunOptions, plan_study
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.verbs.inputs import (
    CriterionLike,
    PlanLike,
    TableAndCertificate,
    as_plan,
    errors_in,
    files_of,
    for_criterion,
    workers_for,
)

if TYPE_CHECKING:
    from edtk.calibration.detect import SizedFault
    from edtk.calibration.geometry_design.geometry_plan import GeometryPlan


def plan_geometry(
    study: Study,
    size: int | None,
    criterion: CriterionLike | None,
    seed: int | None,
    keep: PlanLike | None,
    progress: Progress,
    *,
    cost_budget: float | None,
    distinct: int | None,
    exclude: Path | str | None,
    budget: float | None,
    workers: int | None,
    dask: str | None,
    out: Path | str | None,
    certificate: Path | str | None,
    detect: Mapping[str, str] | None,
) -> "GeometryPlan":
    """Search for the best visits of a study with [parameters].

    The arguments are those of `edtk.plan`; the search is done in this process, on any machine.

    Raises:
        ArgumentError: An argument is for plans of compliances alone.
        UserError: One line that says what cannot be done, and where.
    """
    unknown = {"dask": dask}
    for argument, given in unknown.items():
        if given is not None:
            message = (
                "is for plans of compliances alone; those of a study with [parameters] are "
                "searched in this process"
            )
            raise ArgumentError(message, argument=argument)
    question = study if exclude is None else study.excluding(exclude)
    faults = sized_visit_faults(question, detect or {})
    kept = None if keep is None else as_plan(question, keep, "keep", made=True)
    files = TableAndCertificate(out, certificate)
    files.require(*question.reads, *files_of(keep))
    asked, name = for_criterion(question, criterion)
    if certificate is not None:
        _require_certifiable(asked, name, certificate, cost_budget)
    with errors_in(question.where):
        found = plan_of_study(
            asked,
            size,
            name,
            distinct=distinct,
            kept=kept,
            cost_budget=cost_budget,
            seconds=budget,
            options=RunOptions(seed=seed, progress=progress),
        )
    detections, separations = detect_in_visits(found.question, found.whole, faults)
    warnings = found.warnings + poor_left_out(found.question, found.whole)
    if found.relaxed.criterion.needs_target:
        warnings += GeometryDesigns(asked, found.question).around(found.whole)
    found = replace(found, detections=detections, separations=separations, warnings=warnings)
    files.write(lambda: found.whole.to_frame(question.robot), lambda: _proof(asked, found))
    return found


def _require_certifiable(
    study: Study, criterion: str | None, path: Path | str, cost_budget: float | None
) -> None:
    """Check, before a long search, that its certificate can be written.

    Raises:
        UserError: The criterion has parameters, or is the same for plans of any size.
    """
    from edtk.certificate.certificate import require_certifiable

    require_certifiable(study, criterion, path)
    costs = study.specification.costs
    limited = cost_budget is not None or (costs is not None and costs.budget is not None)
    if limited and not criteria.get(criterion or study.main_criterion).degree:
        raise ArgumentError(
            "plans within a budget of costs have none for this criterion, which is the same for "
            "plans of any size; leave it out",
            argument="certificate",
        )


def _proof(study: Study, found: "GeometryPlan") -> str:
    """What proves the numbers of a plan."""
    from edtk.calibration.geometry_design.geometry_question import geometry_setting
    from edtk.certificate.certificate import certificate_text

    setting = geometry_setting(found.question)
    if found.day is None:
        return certificate_text(study, found, setting)
    return certificate_text(study, found, setting, found.day, found.proofs)


def plan_compliances(
    study: Study,
    size: int,
    criterion: str | None,
    seed: int | None,
    keep: PlanLike | None,
    progress: Progress,
    *,
    distinct: int | None,
    exclude: Path | str | None,
    budget: float | None,
    workers: int | None,
    dask: str | None,
    out: Path | str | None,
    certificate: Path | str | None,
    detect: Mapping[str, str] | None,
) -> ExactPlan:
    """Search for the best plan of a study, and write its files.

    The arguments are those of `edtk.plan`.

    Raises:
        UserError: One line that says what cannot be done, and where.
    """
    question = study if exclude is None else study.excluding(exclude)
    faults = _faults(question, detect or {})
    kept = None if keep is None else as_plan(question, keep, "keep", made=True)
    files = TableAndCertificate(out, certificate)
    files.require(*question.reads, *files_of(keep))
    if certificate is not None:
        from edtk.certificate.certificate import require_certifiable

        require_certifiable(question, criterion, certificate)
    with workers_for(workers, dask) as pool, errors_in(question.where):
        found = plan_study(
            question,
            size,
            criterion,
            distinct=distinct,
            kept=kept,
            budget=budget,
            options=RunOptions(seed=seed, workers=pool, progress=progress),
        )
    found = _judged(question, found, faults)
    files.write(
        lambda: found.whole.to_frame(question.robot), lambda: _certificate_text(question, found)
    )
    return found


def _certificate_text(study: Study, found: ExactPlan) -> str:
    """What proves the numbers of a plan."""
    from edtk.certificate.certificate import certificate_text

    return certificate_text(study, found)


def _faults(study: Study, given: Mapping[str, str]) -> tuple["SizedFault", ...]:
    """The faults that were asked for: checked before a long search."""
    if not given:
        return ()
    from edtk.calibration.detect import sized_faults

    return sized_faults(study, given)


def _judged(study: Study, found: ExactPlan, faults: tuple["SizedFault", ...]) -> ExactPlan:
    """The plan with its errors in the task, and with the chances that faults would be noticed."""
    from edtk.calibration.detect import detect, separations
    from edtk.calibration.planned import plan_budget, plan_tasks

    whole = found.whole
    detections = detect(study, whole, faults)
    return replace(
        found,
        error_budget=plan_budget(study, whole),
        detections=detections,
        separations=separations(study, whole, detections),
        tasks=plan_tasks(study, whole),
    )
