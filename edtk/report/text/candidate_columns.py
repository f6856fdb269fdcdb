"""What a table says of candidates: their numbers and, of a data frame, their values."""

from edtk.design.frame_problem import FrameProblem
from edtk.design.problem import Problem
from edtk.system.typing import Indices

MOST_COLUMNS = 6  # of a data frame: of wider ones the first


def candidate_columns(problem: Problem | None, chosen: Indices) -> dict[str, list[str]]:
    """Columns by name: `candidate`, counted from 0 as in the problem, and those of its frame.

    Args:
        problem: The candidates; None if they are not known.
        chosen: Those (k,) that are shown.
    """
    columns = {"candidate": [str(i) for i in chosen]}
    if not isinstance(problem, FrameProblem):
        return columns
    rows = problem.frame.iloc[chosen]
    for name in rows.columns[:MOST_COLUMNS]:
        cells = [f"{x:.6g}" if isinstance(x, float) else str(x) for x in rows[name]]
        columns.setdefault(str(name), cells)
    return columns
