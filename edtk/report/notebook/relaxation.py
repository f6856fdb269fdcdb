"""Table of a relaxation, for a notebook."""

from edtk.design.relaxation.relaxation import Relaxation
from edtk.report.notebook_table import notebook_table
from edtk.report.text.relaxation import relaxation_rows


def relaxation(result: Relaxation) -> str:
    """The rows of the text."""
    return notebook_table(result.headline(), *relaxation_rows(result))
