"""The place of the robot and of its markers, with the geometry of the drawing."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import product

import numpy as np

from edtk.inference.geometry.least_squares_fit import (
    MM,
    LeastSquaresFit,
    least_squares_fit,
)
from edtk.inference.geometry.linear_start import LinearStart, linear_start
from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.inference.geometry.pose_rows import measured_less_seen
from edtk.model.geometry.geometric_model import GeometricModel
from edtk.model.geometry.geometric_parameter import COMPONENTS, GeometricParameter
from edtk.model.geometry.rotation import rotation, rotation_vectors
from edtk.system.typing import Array

QUARTER = np.pi / 2
MOST = 200  # evaluations from the linear solution, which as a rule is near the end
SOME = 6  # from each other place; the best of them go on to the end
PROMISING = 4
STILL = 1e-9  # singular value beside the largest of a direction that moves no marker
SAME = 1e-6  # relative difference of costs that rounding makes
GOOD = 0.02  # of the spread of positions: a place that fits as well is not searched further


def first_place(model: GeometricModel, means: MarkerPositions) -> LinearStart:
    """The linear solution for the place of robot and markers, see `linear_start`."""
    return linear_start(
        model.robot.forward(means.q), means.measured, means.seen, np.asarray(model.offsets)
    )


def place_robot(model: GeometricModel, means: MarkerPositions) -> tuple[GeometricModel, Array]:
    """Find the base and the tools with which the drawing fits best.

    Starts are the linear solution, and where that does not lead near the positions, 24 orientations
    of the robot with the tools of the drawing; the best descent counts.

    Args:
        model: Its parameters of base and tool are fitted, others stay zero.
        means: A visit a pose.

    Returns:
        The model with its base at the place found, and parameters (p,) for it: those of the tools
        are at their place, and all others zero.
    """
    places = {one.place for one in model.parameters}
    placing = tuple(one for one in model.parameters if one.place in ("base", "tool"))
    only = model.with_parameters(placing)
    found: list[tuple[float, GeometricModel, Array]] = []
    good = 0.5 * GOOD**2 * _spread(means)
    tool_turns = any(one.place == "tool" and one.turns for one in placing)
    for start, tools in _starts(only, means, "base" in places, "tool" in places):
        there = replace(only, start=start)
        turned = _tool_turns(there, means) if tool_turns else np.zeros((len(model.markers), 3))
        every = np.concatenate([tools, turned], axis=1)
        values = [
            every[model.markers.index(one.of), COMPONENTS.index(one.component)]
            if one.place == "tool"
            else 0.0
            for one in placing
        ]
        fit = _fitted(there, np.array(values), means, SOME if found else MOST)
        found.append((fit.cost, there, fit.theta))
        if fit.cost < good:
            break
    best, theta = _descended(found, means)
    at = dict(zip(best.parameters, theta, strict=True))
    whole = replace(model, start=_moved(best, at))
    values = [at[one] if one.place == "tool" else 0.0 for one in whole.parameters]
    return whole, np.array(values)


def _tool_turns(model: GeometricModel, means: MarkerPositions) -> Array:
    """Turns (k, 3) of the tools by which measured orientations are predicted from this base."""
    assert means.turns is not None
    tips = model.see(np.zeros(model.p), means.q, derivatives=False).turns
    turned = np.where(
        means.seen[..., None, None], np.swapaxes(tips, -1, -2) @ np.nan_to_num(means.turns), 0.0
    ).sum(axis=0)
    found = np.zeros((len(turned), 3))
    for i, one in enumerate(turned):
        U, _, Vt = np.linalg.svd(one)
        found[i] = rotation_vectors(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)
    return found


def _fitted(
    model: GeometricModel, theta: Array, means: MarkerPositions, most: int
) -> LeastSquaresFit:
    """A fit that stays where it began along directions in which no marker moves.

    A step of Levenberg-Marquardt has some part along them: the base of a SCARA would sink by
    metres, and its markers rise on the tool.
    """
    fit = least_squares_fit(model, theta, means, most=most)
    J = model.see(fit.theta, means.q).jacobian
    if J is None or not model.p:
        return fit
    R = np.linalg.qr((J * model.scales)[means.seen].reshape(-1, model.p), mode="r")
    _, sizes, Vt = np.linalg.svd(R)
    still = Vt[np.append(sizes, np.zeros(model.p - len(sizes))) < STILL * sizes[0]]
    if not len(still):
        return fit
    moved = still.T @ (still @ ((fit.theta - theta) / model.scales))
    back = fit.theta - moved * model.scales
    apart = measured_less_seen(means, model.see(back, means.q, derivatives=False))
    cost = 0.5 * float(((MM * apart)[means.seen] ** 2).sum())
    # Where these directions bend, what moved stays.
    return replace(fit, theta=back, cost=cost) if cost <= fit.cost * (1 + SAME) else fit


def _descended(
    found: list[tuple[float, GeometricModel, Array]], means: MarkerPositions
) -> tuple[GeometricModel, Array]:
    """The best of the most promising places, at its end."""
    if len(found) == 1:
        return found[0][1:]
    promising = sorted(found, key=lambda one: one[0])[:PROMISING]
    ends: list[tuple[float, GeometricModel, Array]] = []
    for _, model, theta in promising:
        fit = _fitted(model, theta, means, MOST)
        ends.append((fit.cost, model, fit.theta))
    return min(ends, key=lambda one: one[0])[1:]


def _moved(model: GeometricModel, at: Mapping[GeometricParameter, float]) -> Array:
    """The start of the base (4, 4), with its fitted motion."""
    motion = np.array([value for one, value in at.items() if one.place == "base"])
    start = model.start.copy()
    if len(motion):
        start[:3, 3] = start[:3, 3] + start[:3, :3] @ motion[:3]
        start[:3, :3] = start[:3, :3] @ rotation(motion[3:])
    return start


def _spread(means: MarkerPositions) -> float:
    """Sum of squared distances of all positions from their mean [mm^2]."""
    x = MM * means.measured[means.seen]
    return float(((x - x.mean(axis=0)) ** 2).sum())


def _starts(
    model: GeometricModel, means: MarkerPositions, base: bool, tool: bool
) -> list[tuple[Array, Array]]:
    """Places to descend from: the base (4, 4) and the shifts of the markers (k, 3)."""
    nothing = np.zeros_like(model.offsets)
    if not base:
        return [(model.start, nothing)]
    starts = []
    if tool:
        linear = first_place(model, means)
        starts.append((linear.base, linear.tools - model.offsets))
    points = model.see(np.zeros(model.p), means.q, derivatives=False).points
    center = points[means.seen].mean(axis=0)
    goal = means.measured[means.seen].mean(axis=0)
    for R in _orientations():
        start = np.eye(4)
        start[:3, :3] = R
        start[:3, 3] = goal - R @ center
        starts.append((start, nothing))
    return starts


def _orientations() -> list[Array]:
    """The 24 rotations of a cube."""
    from scipy.spatial.transform import Rotation

    every = [
        Rotation.from_euler("xyz", np.array(turns) * QUARTER).as_matrix()
        for turns in product(range(4), repeat=3)
    ]
    rounded = {tuple(np.round(R).astype(int).ravel().tolist()): R for R in every}
    return [np.round(R) for R in rounded.values()]
