"""Text of a relaxation."""

import numpy as np

from edtk.design.relaxation.relaxation import VISIBLE, Relaxation
from edtk.report.text.candidate_columns import candidate_columns
from edtk.report.text_table import text_table


def relaxation(found: Relaxation) -> str:
    """Value, bound, and a line for each candidate with weight, the heaviest first."""
    proved = "by a solver's word" if found.rests_on_solver else "proved"
    number = f"{found.value:.7g}, bound {found.bound:.7g} ({proved}, relative gap {found.gap:.1e})"
    lines = [f"{found.criterion.label} ({found.criterion.formula}): {number}"]
    if found.accuracy > VISIBLE:
        lines.append(
            f"the model is ill-conditioned: rounding may change these numbers by "
            f"{found.accuracy:.0e}, "
            "relatively; centre or scale the regressors for more digits"
        )
    return "\n".join([*lines, text_table(*relaxation_rows(found))])


def relaxation_rows(found: Relaxation) -> tuple[list[str], list[list[str]]]:
    """Header and rows: candidate, counted from 0 as in the problem, what it is, and weight."""
    support = found.support
    order = support[np.argsort(-found.weights[support], kind="stable")]
    columns = candidate_columns(found.problem, order)
    weights = [f"{found.weights[i]:.5f}" for i in order]
    rows = [list(row) for row in zip(*columns.values(), weights, strict=True)]
    return [*columns, "weight"], rows
