"""`edtk.run`: a whole study, from its bounds to its report."""

from pathlib import Path

from edtk.certificate.certificate import write_certificate
from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.report.write_comparison import write_comparison
from edtk.study.run_options import Progress, RunOptions, no_progress
from edtk.study.run_study import run_study
from edtk.study.study import Study
from edtk.study.study_run import StudyRun
from edtk.verbs.inputs import StudyLike, as_study, errors_in
from edtk.verbs.require_output import require_output
from edtk.verbs.workers_for import workers_for


def run(
    study: StudyLike,
    out: Path | str | None = None,
    *,
    workers: int | None = None,
    dask: str | None = None,
    fresh: bool = False,
    progress: Progress = no_progress,
) -> StudyRun:
    """Optimise plans for every criterion and size of a study, compare them, and write the report.

    A run that was killed goes on from its finished cases when it is called again.

    Args:
        study: A study, or the path of a study file.
        out: Folder for `report.md`, `results.csv`, plans and certificates; defaults to
            `results/NAME`, where NAME is that of the study's file.
        workers: Processes on this machine; defaults to one a core.
        dask: Address of a Dask scheduler (tcp://HOST:PORT) whose workers do the work instead.
        fresh: Whether to begin anew, whatever is finished.
        progress: Called with a label as each step is done, and the share of the steps so far.

    Returns:
        The table of all plans, the plans, and the relaxations with their bounds.

    Raises:
        UserError: One line that says what cannot be done, and where.
    """
    question = as_study(study)
    folder = _folder(question) if out is None else Path(out)
    require_output(folder / "report.md")
    with workers_for(workers, dask) as pool, errors_in(question.where):
        options = RunOptions(workers=pool, progress=progress)
        found = run_study(question, folder, fresh=fresh, options=options)
        _write_certificates(found)
        write_comparison(found)
    return found


def _folder(study: Study) -> Path:
    """The folder of a study's results, where none is given: `results/NAME`."""
    return Path("results") / (study.path.stem if study.path is not None else "study")


def _write_certificates(found: StudyRun) -> None:
    """Write what proves each relaxation and each plan that was searched, and remove older files."""
    folder = found.folder / "certificates"
    results: dict[str, RelaxedPlan | ExactPlan] = {
        f"relaxation_{name}": relaxed for name, relaxed in found.relaxations.items()
    }
    results |= {case.name: case.found for case in found.cases if case.found is not None}
    for name, result in results.items():
        write_certificate(folder / f"{name}.json", found.study, result)
    for path in folder.glob("*.json"):
        if path.stem not in results:
            path.unlink()
