"""Plans in a cell: which poses are free and seen, and what is nearest in each."""

import numpy as np

from edtk.cell.plan_check import PlanCheck
from edtk.report.tables import notebook_table, text_table
from edtk.robots.frames import MM


def plan_check_text(found: PlanCheck) -> str:
    """What was looked at, and a line for each pose and each way."""
    lines = ["; ".join([found.headline(), *looked_at(found)]), text_table(*plan_check_rows(found))]
    if found.ways:
        lines += ["", text_table(*way_rows(found))]
    return "\n".join(lines)


def plan_check_notebook(found: PlanCheck) -> str:
    """The rows of the text."""
    return notebook_table(found.headline(), *plan_check_rows(found), looked_at(found))


def looked_at(found: PlanCheck) -> list[str]:
    """Number of bodies and pairs, and the margin; nothing without a cell."""
    cell = found.cell
    if cell is None:
        return []
    defaults = sum(body.source == "default" for body in cell.bodies)
    typical = f" ({defaults} of them with typical sizes, not measured)" if defaults else ""
    return [
        f"{len(cell.bodies)} bodies{typical}, {len(cell.pairs)} pairs, "
        f"margin {cell.margin * MM:g} mm"
    ]


def plan_check_rows(found: PlanCheck) -> tuple[list[str], list[list[str]]]:
    """Header and rows: pose, clearance beyond the margin, what is nearest, and what is seen."""
    header = ["pose"]
    rows = [[str(i + 1)] for i in range(len(found.q))]
    if found.cell is not None:
        header += ["clearance_mm", "", "nearest"]
        clearance = found.clearance
        for i, (room, free) in enumerate(zip(clearance.least, clearance.free, strict=True)):
            pair = " - ".join(clearance.names(i) or ("nothing to look at",))
            millimetres = f"{room * MM:.1f}" if np.isfinite(room) else ""
            rows[i] += [millimetres, "free" if free else "touches", pair]
    if found.seen is not None:
        header.append("seen")
        rows = [[*row, found.seen.words(i)] for i, row in enumerate(rows)]
    return header, rows


def way_rows(found: PlanCheck) -> tuple[list[str], list[list[str]]]:
    """Header and rows: from where to where, whether it is free, and what is nearest on it."""
    rows = []
    for one in found.ways:
        start, end = ("home" if row is None else str(row + 1) for row in one.rows)
        leg = one.nearest
        by = 0 if one.way is None else len(one.way.via)
        verdict = "no free way found" if one.way is None else "free"
        if by:
            verdict = f"free by {by} via pose{'s' if by > 1 else ''}"
        room = f"{leg.clearance * MM:.1f}" if np.isfinite(leg.clearance) else ""
        pair = " - ".join(leg.pair or ("nothing to look at",))
        rows.append([f"{start} to {end}", room, verdict, pair])
    return ["leg", "clearance_mm", "", "nearest"], rows
