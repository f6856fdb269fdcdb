"""The table and the plans of a run as files."""

from pathlib import Path

from edtk.study.study_run import StudyRun
from edtk.system.atomic_file import Content
from edtk.tables.csv_text import csv_text

KINDS = ("optimised", "distinct", "random")  # of plans that a run makes


def run_files(run: StudyRun) -> dict[Path, Content]:
    """The contents of `results.csv` and of every plan that the run has made, by path.

    Published plans have files of their own.
    """
    robot = run.study.robot
    files: dict[Path, Content] = {
        run.folder / "plans" / f"{case.name}.csv": csv_text(case.plan.to_frame(robot))
        for case in run.cases
        if case.plan is not None and case.kind in KINDS
    }
    return files | {run.folder / "results.csv": csv_text(run.table)}
