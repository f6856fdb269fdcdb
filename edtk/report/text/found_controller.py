"""Text of what positions tell about a controller."""

import numpy as np

from edtk.inference.controller_search.counted import Counted
from edtk.inference.controller_search.found_controller import FoundController
from edtk.report.text_table import text_table
from edtk.study.toml_text import inline

QUARTER = 90.0  # [deg]
NEAR = 1.0  # [deg]: a zero so near to a quarter turn may be meant as that
MOST_TIMES = 1e6  # that are told; beyond it the best way leaves rounding alone
UPSIDE_DOWN = np.deg2rad(1.0)


def found_controller(found: FoundController) -> str:
    """Fit, a line for each joint, what is not told, and a table to paste."""
    markers = f"{len(found.markers)} marker{'s' if len(found.markers) > 1 else ''}"
    lines = [
        f"{found.robot}: {found.poses} poses, {markers}, {found.coordinates} coordinates, "
        f"{found.unknowns} unknowns",
        f"the best way to count leaves {_mm(found.best.rms)} (root mean square); {_second(found)}",
        text_table(*_rows(found)),
        *(f"{name}: {why}" for name, why in found.untold.items()),
    ]
    if found.same:
        lines.append("the same arm, which no positions tell apart (limits and small zeros chose):")
        lines += [f"  {_difference(one, found.best)}" for one in found.same]
    if found.others:
        lines.append("these ways to count fit nearly as well:")
        lines += [f"  {_difference(one, found.best)}: {_mm(one.rms)}" for one in found.others]
    return "\n".join([*lines, "", *_table(found.best)])


def _second(found: FoundController) -> str:
    """How clear the answer is."""
    if found.second is None:
        return "there is no other"
    clear = "the answer is clear" if found.clear else "that is not clear enough"
    times = found.second.rms / max(found.best.rms, 1e-300)
    more = f", {times:.3g} times as much" if times < MOST_TIMES else ""
    return f"the second best {_mm(found.second.rms)}{more}: {clear}"


def _mm(length: float) -> str:
    return f"{1e3 * length:.3g} mm"


def _rows(found: FoundController) -> tuple[list[str], list[list[str]]]:
    """A row for each joint."""
    rows = []
    best = found.best
    for j, name in enumerate(best.names):
        zero = f"{best.zero[j]:g} +- {found.zero_std[j]:.2g}"
        remark = _near(best, j)
        if name in found.untold:
            zero = f"{best.zero[j]:g}"
            remark = "not told, see below"
        unit = "mm" if best.kinds[j] == "prismatic" else "deg"
        rows.append([name, f"{best.way.sign[j]:+g}", f"{zero} {unit}", remark])
    follows = best.way.follows
    if follows is not None:
        rows[follows.joint][3] += (
            f"{', ' if rows[follows.joint][3] else ''}follows {best.names[follows.leader]} with "
            f"factor {follows.factor:g}"
        )
    return ["joint", "sign", "zero", ""], rows


def _near(best: Counted, j: int) -> str:
    """The quarter turn that a zero may be meant as."""
    nearest = QUARTER * round(best.zero[j] / QUARTER)
    off = abs(best.zero[j] - nearest)
    is_near = best.kinds[j] != "prismatic" and 0 < off <= NEAR
    return f"{nearest:g} by the maker?" if is_near else ""


def _difference(one: Counted, best: Counted) -> str:
    """In what a way to count differs from the best one."""
    parts = []
    for j, name in enumerate(best.names):
        signed = one.way.sign[j] != best.way.sign[j]
        moved = one.zero[j] != best.zero[j]
        if signed or moved:
            sign = f"sign {one.way.sign[j]:+g}" if signed else ""
            zero = f"zero {one.zero[j]:g}" if moved else ""
            parts.append(f"{name} {' and '.join(filter(None, (sign, zero)))}")
    if one.way.follows != best.way.follows:
        own = one.way.follows
        names = one.names
        parts.append(
            "no joint follows another"
            if own is None
            else f"{names[own.joint]} follows {names[own.leader]} with factor {own.factor:g}"
        )
    if one.tilt > UPSIDE_DOWN:
        parts.append(f"the base turned over by {np.rad2deg(one.tilt):.3g} deg")
    if one.outside:
        parts.append(f"a joint beyond its limits {one.outside} times")
    return ", ".join(parts)


def _table(best: Counted) -> list[str]:
    """The table to paste."""
    table = best.table()
    if not table:
        return ["the controller counts as the robot's file: no table [controller] is needed"]
    return ["[controller]", *(f"{key} = {inline(value)}" for key, value in table.items())]
