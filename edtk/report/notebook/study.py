"""Table of a study, for a notebook."""

from html import escape

from edtk.report.text.study import study_rows
from edtk.study.study import Study


def study(asked: Study) -> str:
    """The question: a row for each key that a person would ask about."""
    rows = "".join(
        f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>"
        for name, value in study_rows(asked)
    )
    return f"<table><caption>{escape(asked.specification.title)}</caption>{rows}</table>"
