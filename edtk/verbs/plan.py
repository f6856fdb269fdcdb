"""`edtk.plan`: the best plan of exactly m experiments."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from edtk.design.exact.exact_plan import ExactPlan
from edtk.study.plan_study import plan_study
from edtk.study.run_options import Progress, RunOptions, no_progress
from edtk.study.study import Study
from edtk.system.atomic_file import Content, write_files
from edtk.tables.csv_text import csv_text
from edtk.verbs.inputs import PlanLike, StudyLike, as_plan, as_study, errors_in
from edtk.verbs.require_output import require_different, require_output
from edtk.verbs.workers_for import workers_for

if TYPE_CHECKING:
    from edtk.calibration.detect import SizedFault


def plan(
    study: StudyLike,
    size: int,
    criterion: str | None = None,
    seed: int | None = None,
    *,
    distinct: int | None = None,
    keep: PlanLike | None = None,
    exclude: Path | str | None = None,
    budget: float | None = None,
    workers: int | None = None,
    dask: str | None = None,
    out: Path | str | None = None,
    certificate: Path | str | None = None,
    detect: Mapping[str, str] | None = None,
    progress: Progress = no_progress,
) -> ExactPlan:
    """Search for the best plan of `size` experiments, and bound how much better any plan can be.

    The same seed gives the same plan on any number of workers. Ctrl-C, or the end of the budget,
    returns the best plan so far; `.ended` says so.

    Args:
        study: A study, or the path of a study file.
        size: Number of experiments m; kept experiments count.
        criterion: Name of the criterion to optimise; defaults to the study's main criterion.
        seed: Seed of the search; defaults to the study's.
        distinct: Distinct new poses at most; defaults to p(p+1)/2 + 1 for p parameters.
        keep: A plan (or its CSV file) of experiments that were made already.
        exclude: A plan (CSV file) of poses to stay away from.
        budget: Seconds after which the search ends [s]; defaults to no limit.
        workers: Processes on this machine; defaults to one a core.
        dask: Address of a Dask scheduler (tcp://HOST:PORT) whose workers do the work instead.
        out: File to write all experiments to (CSV); "-" is standard output.
        certificate: File to write what proves the numbers to (JSON), for `edtk.verify`; likewise.
        detect: Sizes of faults like {"tool_z": "5mm", "load_direction": "2deg"}: the plan tells how
            likely each would be noticed, and the experiment that would help most.
        progress: Called with a line about the current step, and its gap or its best cost.

    Returns:
        The plan with its `.value`, its `.bound`, and its `.efficiency` between 0 and 1.

    Raises:
        UserError: One line that says what cannot be done, and where.

    Example:
        >>> import edtk
        >>> found = edtk.plan("studies/kr270_milling.toml", size=4)  # doctest: +SKIP
        >>> found.plan.to_csv("plan.csv", found.robot)  # doctest: +SKIP
    """
    question = as_study(study) if exclude is None else as_study(study).excluding(exclude)
    faults = _faults(question, detect or {})
    kept = None if keep is None else as_plan(question, keep)
    require_different(out=out, certificate=certificate)
    for path in (out, certificate):
        require_output(path, *question.reads, keep if isinstance(keep, str | Path) else None)
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
    files: dict[Path, Content] = {}
    if out is not None:
        files[Path(out)] = csv_text(found.whole.to_frame(question.robot))
    if certificate is not None:
        from edtk.certificate.certificate import certificate_text

        files[Path(certificate)] = certificate_text(question, found)
    write_files(files)
    return found


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

    whole = found.whole
    return replace(
        found,
        error_budget=plan_budget(study, whole),
        detections=detect(study, whole, faults),
        tasks=plan_tasks(study, whole),
    )
