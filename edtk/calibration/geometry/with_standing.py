"""Markers that stay where they are while the robot moves: they are not on its tool."""

from dataclasses import replace

import numpy as np

from edtk.calibration.diagnostics.diagnostic import Severity
from edtk.calibration.geometry.geometric_doubt import GeometricDoubt
from edtk.calibration.geometry.study_geometry import StudyGeometry
from edtk.inference.geometry.marker_positions import MarkerPositions

STILL = 0.01  # of the way that others move: a point that moves less stands on the base
FAR = 0.02  # [m] others have to move by as much


def with_standing(
    setting: StudyGeometry, data: MarkerPositions
) -> tuple[StudyGeometry, MarkerPositions, list[GeometricDoubt]]:
    """The setting and the positions with markers that stand still among those on the base.

    Args:
        setting: The study, with the markers that it has on the tool and on the base.
        data: Their positions, those on the base last.

    Returns:
        Both, and a doubt where the study has such a marker on the tool; a note where it names none.
    """
    k = len(setting.markers)
    lost = (np.abs(np.nan_to_num(data.measured)) == 0).all(axis=-1, keepdims=True)
    x = np.where(lost, np.nan, data.measured)[:, :k]
    seen = np.isfinite(x).all(axis=-1).sum(axis=0)
    moves = np.zeros(k)
    for i in np.flatnonzero(seen):
        own = x[:, i][np.isfinite(x[:, i]).all(axis=-1)]
        moves[i] = np.median(np.linalg.norm(own - np.median(own, axis=0), axis=-1))
    most = moves.max(initial=0.0)
    still = [i for i in range(k) if seen[i] > 1 and most > FAR and moves[i] < STILL * most]
    if not still:
        return setting, data, []
    moving = [i for i in range(k) if i not in still]
    names = tuple(setting.markers[i] for i in still)
    order = [*moving, *range(k, len(data.markers)), *still]
    there = replace(
        setting,
        markers=tuple(setting.markers[i] for i in moving),
        references=(*setting.references, *names),
    )
    ordered = data.of_markers(order)
    given = bool(setting.study.specification.marker)
    text = (
        f"{', '.join(names)} stay{'s' * (len(names) == 1)} in place while others move, and "
        f'count{"s" * (len(names) == 1)} as on the base; expected [[marker]] with joint = "base"'
    )
    severity = Severity.WARNING if given else Severity.NOTE
    return there, ordered, [GeometricDoubt(severity, "standing", text)]
