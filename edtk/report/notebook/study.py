"""Table of a study, for a notebook."""

from edtk.report.notebook_table import notebook_table
from edtk.report.text.study import study_rows
from edtk.study.study import Study


def study(asked: Study) -> str:
    """The question: a row for each key that a person would ask about."""
    return notebook_table(asked.specification.title, ["key", "value"], study_rows(asked))
