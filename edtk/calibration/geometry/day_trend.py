"""Whether the frame drifts, or the links grow, in the course of a day, by residuals of a fit."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from edtk.calibration.geometry.fit_rows import FitRows, explained_by, log_chance, of_positions
from edtk.inference.geometry.geometric_fit import MM, GeometricFit
from edtk.model.geometry.all_parameters import all_parameters
from edtk.model.geometry.geometric_parameter import GeometricParameter
from edtk.system.typing import Array

UNLIKELY = 1e-5
EXPLAINS = 0.1  # of the weighted squares, at least
COORDINATES = 3.0  # of a pose that err together
RATES = (0.0, 3.0, 8.0)  # of settling in a day: a steady drift, and warming up
FEWEST = 8  # poses


@dataclass(frozen=True, eq=False)
class DayTrend:
    """Something that grows from the first pose to the last.

    Attributes:
        kind: "drift" of the frame, or "growth" of all links.
        size: At the end of the day: how far positions are off, root mean square [m], or the growth
            of all lengths [m/m].
        explained: Share of the weighted squares that it explains.
        columns: Its columns (m, 3k, c) [mm a unit].
    """

    kind: Literal["drift", "growth"]
    size: float
    explained: float
    columns: Array


def day_trend(fit: GeometricFit, others: Sequence[GeometricParameter] = ()) -> DayTrend | None:
    """Try a drift of the frame and a growth of all links, and test the best.

    At the time t, from 0 at the first pose to 1 at the last, both have the size ``t`` or, as where
    something warms up, ``(1 - exp(-c t)) / (1 - exp(-c))``. A drift has the six columns of a motion
    of the frame, and growth one: the motion by all lengths of the drawing together. The noise is
    fitted anew beside them (see `moved_frame`). The smallest probability of the fall of the squares
    counts as often as shapes are tried.

    Args:
        fit: Of a sheet whose poses are in the order in which they were measured.
        others: Errors of the drawing that were not asked for, which are fitted beside it.
    """
    rows = FitRows.of(fit).beside(others)
    if len(rows.residual) < FEWEST:
        return None
    kinds: list[tuple[Literal["drift", "growth"], Array]] = [
        ("drift", frame_columns(fit)),
        ("growth", growth_columns(fit)),
    ]
    tried = (_best(rows, kind, columns) for kind, columns in kinds)
    found = [one for one in tried if one is not None]
    gains = rows.gains([one.columns for one in found])
    return max(zip(gains, found, strict=True), key=lambda one: one[0], default=(0.0, None))[1]


def frame_columns(fit: GeometricFit) -> Array:
    """Columns (m, 3k, 6) of a motion of the frame [mm a mm, mm a mrad]."""
    model = fit.fitted.model
    base = model.with_parameters(all_parameters(model.robot, model.markers, [], tool=False))
    by_base = base.see(np.zeros(6), fit.data.means.q).jacobian
    assert by_base is not None
    return MM * of_positions(by_base * base.scales, fit.data.means)


def growth_columns(fit: GeometricFit) -> Array:
    """The column (m, 3k, 1) of a growth of all lengths between joints [mm by 1 mm/m]."""
    model = fit.fitted.model
    robot = model.robot
    lengths = tuple(
        one for one in all_parameters(robot, model.markers, base=False, tool=False) if not one.turns
    )
    every = model.with_parameters(lengths)
    jacobian = every.see(np.zeros(every.p), fit.data.means.q).jacobian
    assert jacobian is not None
    origins = {joint.name: joint.origin[:3, :3].T @ joint.origin[:3, 3] for joint in robot.chain}
    long = np.array([origins[one.of]["xyz".index(one.component)] for one in lengths])
    return of_positions((jacobian @ long)[..., None], fit.data.means)


def _best(rows: FitRows, kind: Literal["drift", "growth"], columns: Array) -> DayTrend | None:
    """The shape of one kind that explains most, where chance does not."""
    m, _, c = columns.shape
    dof = rows.dof(c)
    if dof < 2 * c:
        return None
    times = np.linspace(0.0, 1.0, m)
    shapes = [np.expm1(-r * times) / np.expm1(-r) if r else times for r in RATES]
    noise = rows.noise_beside(columns * times[:, None, None])
    tried = []
    for shape in shapes:
        grown = columns * shape[:, None, None]
        one = explained_by(*rows.whitened(noise, rows.residual[..., None], rows.design, grown))
        tried.append((one.share, one.values, grown))
    share, values, grown = max(tried, key=lambda one: one[0])
    chance = log_chance(share, c, max(dof / COORDINATES, 1.0)) + np.log(len(shapes))
    if chance > np.log(UNLIKELY) or share < EXPLAINS:
        return None
    if kind == "growth":
        return DayTrend(kind, 1e-3 * float(values[0]), share, grown)
    seen = rows.fit.data.means.seen[-1].reshape(-1)
    off = (columns[-1] @ values).reshape(-1, 3)[seen]
    size = float(np.sqrt((off**2).sum(axis=-1).mean())) / MM if len(off) else 0.0
    return DayTrend(kind, size, share, grown)
