"""Text of a relaxation."""

import numpy as np

from edtk.design.relaxation.relaxation import Relaxation
from edtk.report.text_table import text_table


def relaxation(found: Relaxation) -> str:
    """Value, bound, and a line for each candidate with weight, the heaviest first."""
    number = f"{found.value:.7g}, bound {found.bound:.7g} (proved, relative gap {found.gap:.1e})"
    return (
        f"{found.criterion.name}, {found.criterion.title}: {number}\n"
        f"{text_table(*relaxation_rows(found))}"
    )


def relaxation_rows(found: Relaxation) -> tuple[list[str], list[list[str]]]:
    """Header and rows: candidate, counted from 0 as in the problem, and weight."""
    support = found.support
    order = support[np.argsort(-found.weights[support], kind="stable")]
    return ["candidate", "weight"], [[str(i), f"{found.weights[i]:.5f}"] for i in order]
