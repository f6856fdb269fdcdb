"""`edtk.run`: a whole study, from its bounds to its report."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from edtk.certificate.certificate import certificate_text, is_certifiable
from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.report.comparison_report import comparison_files
from edtk.study.plan_study import RunOptions
from edtk.study.run_study import run_study
from edtk.study.study import Study
from edtk.study.study_run import KINDS, StudyRun, run_files
from edtk.system.arguments import checked
from edtk.system.errors import UserError
from edtk.system.files import Content, FolderLock, made_folder, sweep, write_files
from edtk.system.time_limit import Progress, no_progress, time_limit
from edtk.verbs.inputs import (
    StudyLike,
    errors_in,
    require_folder,
    require_output,
    workers_for,
)
from edtk.verbs.of_kinds import of_study
from edtk.verbs.of_studies import OfStudy
from edtk.verbs.question import seconds_for

REPORT_S = 2.0  # that tables, certificates and pictures of a run of the KR 270 take [s]
REPORT_SHARE = 0.25  # of a budget, at most, that is left for them
# Names of files that a run writes; others in the folder are left alone.
PLAN = rf"({'|'.join(KINDS)})_(.+_)?m\d+(_k\d+)?"
WRITTEN = re.compile(
    r"report\.md|results\.csv|comparison\.png|efficiency_m\d+\.png|poses\.(html|png)"
    rf"|plans/{PLAN}\.csv|(certificates|cases)/[^/]+\.json"
)


@checked
def run(
    study: StudyLike,
    out: Path | str | None = None,
    *,
    workers: int | None = None,
    dask: str | None = None,
    fresh: bool = False,
    budget: float | None = None,
    progress: Progress = no_progress,
) -> StudyRun:
    """Optimise plans for every criterion and size of a study, compare them, and write the report.

    A run that was killed, or whose budget was over, goes on from its finished cases when it is
    called again.

    Args:
        study: A study, or the path of a study file.
        out: Folder for `report.md`, `results.csv`, plans and certificates; defaults to
            `results/NAME`, where NAME is that of the study's file.
        workers: Processes on this machine; defaults to one a core.
        dask: Address of a Dask scheduler (tcp://HOST:PORT) whose workers do the work instead.
        fresh: Whether to begin anew, whatever is finished.
        budget: Seconds for bounds, plans and report together [s]: the best so far are compared
            then. The largest plan for the main criterion comes first and is waited for. What was
            cut off is searched anew by the next run. Defaults to no limit.
        progress: Called with a label as each step is done, and the share of the steps so far.

    Returns:
        The table of all plans, the plans, and the relaxations with their bounds.

    Raises:
        UserError: One line that says what cannot be done, and where.
    """
    limit = seconds_for(budget, "budget")
    asked = of_study(study)
    question = asked.study
    folder = _folder(question) if out is None else Path(out)
    require_folder(out)
    require_output(folder / "report.md")
    _require_apart(question, folder)
    with workers_for(workers, dask) as pool, errors_in(question.where), _alone_in(folder):
        options = RunOptions(workers=pool, progress=progress)
        with time_limit(limit - min(REPORT_S, REPORT_SHARE * limit)):
            found = run_study(
                question, folder, fresh=fresh, options=options, designs_of=asked.calibrations
            )
        files = run_files(found) | _certificates(asked, found) | comparison_files(found)
        write_files(files)
        for path in _of_earlier_runs(folder):
            if path not in files and path.is_file():
                path.unlink()
    return found


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Keep other runs out of a folder, and sweep what killed ones have left there.

    Raises:
        UserError: Another run is at work there.
    """
    with made_folder(folder):
        lock = FolderLock.try_on(folder)
        try:
            if lock.held is False:
                raise UserError(
                    "another run is writing there; expected another folder, or its end",
                    where=folder,
                )
            for place in (folder, *(path for path in folder.iterdir() if path.is_dir())):
                sweep(place)
            yield
        finally:
            lock.close()


def _folder(study: Study) -> Path:
    """The folder of a study's results, where none is given: `results/NAME`."""
    return Path("results") / (study.path.stem if study.path is not None else "study")


def _certificates(asked: OfStudy, found: StudyRun) -> dict[Path, Content]:
    """What proves each relaxation and each plan that was searched, by path."""
    results: dict[str, RelaxedPlan | ExactPlan] = {
        f"relaxation_{name}": relaxed for name, relaxed in found.relaxations.items()
    }
    results |= {case.name: case.found for case in found.cases if case.found is not None}
    folder = found.folder / "certificates"
    written: dict[Path, Content] = {}
    for name, result in results.items():
        relaxed = _relaxed_of(result)
        if is_certifiable(relaxed.criterion.name):
            setting = asked.setting(relaxed.criterion.name, relaxed.space)
            written[folder / f"{name}.json"] = certificate_text(found.study, result, setting)
    return written


def _relaxed_of(result: RelaxedPlan | ExactPlan) -> RelaxedPlan:
    """The relaxation of a result, or the result."""
    return result.relaxed if isinstance(result, ExactPlan) else result


def _of_earlier_runs(folder: Path) -> Iterator[Path]:
    """The files in a folder that have names as runs give them, but for finished cases."""
    for place in (folder, folder / "plans", folder / "certificates"):
        paths = place.glob("*")
        yield from (p for p in paths if WRITTEN.fullmatch(p.relative_to(folder).as_posix()))


def _require_apart(study: Study, folder: Path) -> None:
    """Check that the study reads no file that a run may replace or remove.

    Raises:
        UserError: It does, such as a published plan that an earlier run has written there.
    """
    for path in study.reads:
        name = Path(os.path.relpath(os.path.realpath(path), os.path.realpath(folder)))
        if WRITTEN.fullmatch(name.as_posix()):
            message = "is read by this command and may be replaced; expected another folder"
            raise UserError(message, where=path)
