"""Text of a plan."""

import numpy as np

from edtk.design.plan import Plan
from edtk.report.text_table import text_table
from edtk.tables.pose_table import WRENCH_COLUMNS


def plan(result: Plan) -> str:
    """A line for each pose."""
    return f"{result.headline()}\n{text_table(*plan_rows(result))}"


def plan_rows(result: Plan) -> tuple[list[str], list[list[str]]]:
    """Header and rows: pose, repetitions, joint variables [rad or m], loads that are not zero."""
    loaded = np.flatnonzero(result.wrench.any(axis=0))
    joints = [f"q{j + 1} [rad or m]" for j in range(result.q.shape[1])]
    header = ["pose", "repeats", *joints, *(WRENCH_COLUMNS[i] for i in loaded)]
    rows = []
    for i, (q, wrench) in enumerate(zip(result.q, result.wrench, strict=True)):
        variables = [f"{value:.4f}" for value in q]
        loads = [f"{value:g}" for value in wrench[loaded]]
        rows.append([str(i + 1), str(result.repeats[i]), *variables, *loads])
    return header, rows
