"""`edtk.plan` of a study: its search, and the files that are written of it."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from edtk.design.exact.exact_plan import ExactPlan
from edtk.study.plan_study import plan_study
from edtk.study.run_options import Progress, RunOptions
from edtk.study.study import Study
from edtk.verbs.inputs import PlanLike, as_plan, errors_in, files_of
from edtk.verbs.table_and_certificate import TableAndCertificate
from edtk.verbs.workers_for import workers_for

if TYPE_CHECKING:
    from edtk.calibration.detect import SizedFault


def plan_of_study(
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
    from edtk.calibration.detect import detect
    from edtk.calibration.plan_budget import plan_budget
    from edtk.calibration.plan_tasks import plan_tasks
    from edtk.calibration.separations import separations

    whole = found.whole
    detections = detect(study, whole, faults)
    return replace(
        found,
        error_budget=plan_budget(study, whole),
        detections=detections,
        separations=separations(study, whole, detections),
        tasks=plan_tasks(study, whole),
    )
