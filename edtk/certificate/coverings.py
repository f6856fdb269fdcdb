"""Coverings of all poses as plain data: the boxes as a tree of halvings, and why each is closed."""

from typing import Any

import numpy as np

from edtk.certificate.recompute.covering import BOUNDED, COMBINED
from edtk.certificate.recompute.pose_polynomials import COUPLED, OF_LINKS
from edtk.design.enclosure.boxes import Grid, Leaves, Reason, coefficients
from edtk.design.enclosure.cover import Covering
from edtk.design.enclosure.polynomial import Polynomial
from edtk.design.enclosure.space_polynomials import SpacePolynomials
from edtk.design.enclosure.symmetry import TURN, Halving
from edtk.robots.constraints.constraint import Constraint
from edtk.robots.constraints.height import Height
from edtk.robots.constraints.joint_limits import CoupledLimits
from edtk.robots.constraints.radius import Radius
from edtk.robots.constraints.tilt import Tilt
from edtk.system.typing import Array, Indices

LETTERS: dict[type[Constraint], str] = {Height: "h", Radius: "r", Tilt: "ud"}
BOXES_AT_ONCE = 256  # boxes


def coverings_to_list(robot: SpacePolynomials, covering: Covering) -> list[dict[str, Any]]:
    """The covering of one multiplier, for each of its objectives, see `recompute.covering`.

    Args:
        robot: The polynomials that were enclosed.
        covering: The boxes.

    Raises:
        ValueError: A certificate has no words for a constraint, or for what joints do.
    """
    slacks = _letters(robot)
    halving = robot.halving
    of_all = {
        "joints": _places(robot),
        "links": [[link.first, link.second, link.sign] for link in robot.links],
        "low": [float(axis.low) for axis in halving.whole],
        "high": [float(axis.high) for axis in halving.whole],
        "motions": _motions(halving),
        "parts": covering.grid.parts.tolist(),
        "slacks": slacks,
    }
    found = []
    for leaves, objective in zip(covering.leaves, covering.enclosed.objectives, strict=True):
        letters = _reasons(leaves, covering, slacks)
        tree, combined = tree_of(leaves, letters, covering.grid.parts)
        # The check's rows are in metres.
        factors = leaves.penalties[combined] * objective.unit
        of_one = {"tree": tree, "factors": factors.tolist()}
        found.append({"limit": float(leaves.bound.max())} | of_all | of_one)
    return found


def _motions(halving: Halving) -> list[dict[str, Any]]:
    """Each motion with the joint whose interval it cuts, and what is left of that."""
    found = []
    before = halving.whole
    for motion, after in zip(halving.motions, halving.steps, strict=True):
        joint = next(j for j, axis in enumerate(after) if axis != before[j])
        found.append(
            {
                "mirrors": [int(one) for one in motion.mirrors],
                "turns": [int(one) for one in motion.turns],
                "joint": joint,
                "low": float(after[joint].low),
                "high": float(after[joint].high),
            }
        )
        before = after
    return found


def _places(robot: SpacePolynomials) -> list[int]:
    """The joints that count, by their place among those that are designed.

    Raises:
        ValueError: Polynomials are in other variables than joints.
    """
    chart = robot.chart
    free = robot.space.free
    plain = np.array_equal(chart.matrix[free][:, : len(free)], np.eye(len(free)))
    if not plain or any(j >= len(free) for j in robot.kept):
        raise ValueError("a certificate of all poses has no words for tied joints or free forces")
    return list(robot.kept)


def _letters(robot: SpacePolynomials) -> str:
    """A letter for each slack.

    Raises:
        ValueError: A constraint has none.
    """
    found = ""
    for constraint in robot.space.workspace.beside_limits:
        if isinstance(constraint, CoupledLimits):
            found += _letters_of_coupled(constraint)
            continue
        letters = LETTERS.get(type(constraint))
        if letters is None:
            name = ", ".join(constraint.labels(robot.space.workspace.robot))
            raise ValueError(f"a certificate of all poses has no words for the constraint {name}")
        if isinstance(constraint, Tilt) and constraint.maximum >= np.pi / 2:
            raise ValueError("a tilt of 90 deg or more is no constraint; leave it out")
        found += letters
    return found + OF_LINKS[: len(robot.limits)]


def _letters_of_coupled(constraint: CoupledLimits) -> str:
    """A letter for each joint whose own limits are less than a turn apart.

    Raises:
        ValueError: There are more of them than letters, or none, whose slack has no letter.
    """
    count = int((np.ptp(constraint.bounds.limits, axis=0) < TURN).sum())
    if not 0 < count <= len(COUPLED):
        raise ValueError(
            f"a certificate of all poses has words for 1 to {len(COUPLED)} limits of coupled "
            f"joints; got {count}"
        )
    return COUPLED[:count]


def _reasons(leaves: Leaves, covering: Covering, slacks: str) -> list[str]:
    """A letter (b,) for each leaf; of infeasible ones that of the slack that is below zero.

    A leaf that an early end has left open has the bound of a box around it, with its factors.
    """
    combined = np.asarray((leaves.penalties > 0).any(axis=1))
    found = [COMBINED if one else BOUNDED for one in combined.tolist()]
    infeasible = np.flatnonzero(leaves.reason == Reason.INFEASIBLE)
    tops = [largest_on(one, leaves, covering.grid, infeasible) for one in covering.enclosed.slacks]
    for at, which in zip(infeasible, np.argmin(tops, axis=0) if tops else [], strict=True):
        found[at] = slacks[which]
    return found


def largest_on(polynomial: Polynomial, leaves: Leaves, grid: Grid, which: Indices) -> Array:
    """The largest coefficient of a polynomial on some of the boxes (k,), with its error."""
    found = np.empty(len(which))
    for first in range(0, len(which), BOXES_AT_ONCE):
        boxes = leaves.boxes[which[first : first + BOXES_AT_ONCE]]
        values, error = coefficients(polynomial, grid.middles(boxes), grid.halves(boxes))
        found[first : first + BOXES_AT_ONCE] = values.reshape(len(values), -1).max(axis=1) + error
    return found


def tree_of(leaves: Leaves, letters: list[str], parts: Indices) -> tuple[str, Indices]:
    """The text of a tree whose leaves are given, and its combined leaves in their order.

    A box that is no leaf is halved along an axis along which all leaves in it are finer: one is, as
    the leaves come from halvings, and any such axis leads to the same leaves.
    """
    depth, place = leaves.boxes.depth, leaves.boxes.place
    v = len(parts)
    first = np.indices(tuple(parts)).reshape(v, -1).T
    interval = np.ravel_multi_index(tuple((place >> depth).T), tuple(parts))
    text: list[str] = []
    order: list[int] = []
    for box, _ in enumerate(first):
        stack = [(np.flatnonzero(interval == box), (0,) * v)]
        while stack:
            inside, halved = stack.pop()
            if len(inside) == 1:
                text.append(letters[inside[0]])
                order.append(int(inside[0]))
                continue
            axis = int(np.argmax((depth[inside] - halved).min(axis=0)))
            finer = (*halved[:axis], halved[axis] + 1, *halved[axis + 1 :])
            side = (place[inside, axis] >> (depth[inside, axis] - finer[axis])) & 1
            text.append(str(axis))
            stack += [(inside[side == 1], finer), (inside[side == 0], finer)]
    combined = [k for k in order if letters[k] == COMBINED]
    return "".join(text), np.array(combined, dtype=int)
