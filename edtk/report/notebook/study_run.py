"""Table of a study run, for a notebook."""

from edtk.report.notebook_table import notebook_table
from edtk.report.text.study_run import study_run_rows
from edtk.study.study_run import StudyRun


def study_run(result: StudyRun) -> str:
    """The rows of the text."""
    return notebook_table(result.headline(), *study_run_rows(result))
