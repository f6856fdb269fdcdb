"""Markers that are not where the study has them on the tool, or that have each other's names."""

from itertools import permutations

import numpy as np

from edtk.calibration.diagnostics.diagnostic import Severity
from edtk.calibration.geometry.geometric_doubt import GeometricDoubt
from edtk.calibration.geometry.rigid_tool import EXPLAINED, MOST_MARKERS
from edtk.calibration.geometry.study_geometry import StudyGeometry
from edtk.inference.geometry.geometric_fit import MM, GeometricFit
from edtk.study.study_model import on_robot
from edtk.system.typing import Array

FAR = 0.1  # [m] no guess of where a marker is on a tool is as wrong
CLEAR = 0.01  # [m] markers that are as far off may have been swapped


def marker_doubts(fit: GeometricFit, setting: StudyGeometry) -> list[GeometricDoubt]:
    """Compare where the drawing's robot has the markers on its tool with where the study has them.

    A study need not say where they are; a place of zero counts as none. Names that are swapped in
    all rows leave no residual: only the study's places show them.
    """
    asked = setting.study.specification.parameters
    if asked is None or not asked.tool:
        return []
    stated = {name: np.array(one.position_mm) / MM for one, name in on_robot(setting.study)}
    names = [name for name in fit.data.markers if stated.get(name, np.zeros(3)).any()]
    if not names:
        return []
    there = np.array([stated[name] for name in names])
    placed = fit.fitted.placed[[fit.data.markers.index(name) for name in names]]
    order = _order(placed, there)
    exchanged = [name for i, name in enumerate(names) if order[i] != i]
    apart = MM * np.linalg.norm(placed - there, axis=1)
    if exchanged:
        text = (
            f"markers {' and '.join(exchanged)} look swapped in all rows: they are up to "
            f"{apart.max():.3g} mm from where the study has them on the tool, and each is where it "
            "has another one; expected the names of the study"
        )
        return [GeometricDoubt(Severity.WARNING, "swapped_names", text)]
    far = np.flatnonzero(apart > MM * FAR)
    if not len(far):
        return []
    worst = int(np.argmax(apart))
    more = f", and {len(far) - 1} more" if len(far) > 1 else ""
    place = ", ".join(f"{x:.0f}" for x in MM * placed[worst])
    text = (
        f"marker {names[worst]} is {apart[worst]:.3g} mm from where the study has it on the tool"
        f"{more}: at ({place}) mm. Is it another tool, or another frame? Plans and test poses rest "
        "on position_mm"
    )
    return [GeometricDoubt(Severity.WARNING, "marker_elsewhere", text)]


def _order(placed: Array, stated: Array) -> tuple[int, ...]:
    """In which order the stated places (k, 3) fit best; their own unless far better."""
    k = len(placed)
    plain = tuple(range(k))
    own = float(np.linalg.norm(placed - stated, axis=1).max())
    if not 1 < k <= MOST_MARKERS or own < CLEAR:
        return plain
    sizes = {
        order: float(np.linalg.norm(placed - stated[list(order)], axis=1).max())
        for order in permutations(range(k))
    }
    best = min(sizes, key=sizes.__getitem__)
    return best if sizes[best] < EXPLAINED * own else plain
