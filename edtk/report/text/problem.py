"""Text of a design problem."""

import numpy as np

from edtk.design.problem import Problem
from edtk.report.text_table import text_table


def problem(result: Problem) -> str:
    """A line for each parameter."""
    return f"{result.headline()}\n{text_table(*problem_rows(result))}"


def problem_rows(result: Problem) -> tuple[list[str], list[list[str]]]:
    """Header and rows: parameter, and its mean and largest information in a single candidate."""
    names = result.parameters
    p = len(names)
    diagonal = [result.sensitivities(np.outer(e, e)) for e in np.eye(p)]
    rows = [
        [name, f"{values.mean():.4g}", f"{values.max():.4g}"]
        for name, values in zip(names, diagonal, strict=True)
    ]
    return ["parameter", "mean information", "largest information"], rows
