"""Proofs as data: coverings of poses and of regions by boxes, and whole plans of a problem."""

from typing import Any

import numpy as np

from criteria import Relaxable
from edtk.certificate.recompute.covering import BOUNDED, COMBINED
from edtk.certificate.recompute.pose_polynomials import COUPLED, OF_LINKS
from edtk.certificate.recompute.region import rounding_of_check
from edtk.design.bound import printed_form
from edtk.design.enclosure.boxes import Grid, Leaves, Reason, coefficients
from edtk.design.enclosure.cover import Covering
from edtk.design.enclosure.polynomial import Polynomial
from edtk.design.enclosure.prove_region import ProvedRegion
from edtk.design.enclosure.region_functions import RegionPolynomials
from edtk.design.enclosure.space_polynomials import SpacePolynomials
from edtk.design.enclosure.symmetry import TURN, Halving
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.design.exact.exact_tree import ExactTree
from edtk.design.problem import Problem, problem_digest
from edtk.design.relaxation.relaxed_region import RelaxedRegion
from edtk.robots.constraints.constraint import Constraint
from edtk.robots.constraints.height import Height
from edtk.robots.constraints.joint_limits import CoupledLimits
from edtk.robots.constraints.radius import Radius
from edtk.robots.constraints.tilt import Tilt
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices

LETTERS: dict[type[Constraint], str] = {Height: "h", Radius: "r", Tilt: "ud"}
BOXES_AT_ONCE = 256  # boxes
TWICE = 2.0  # of the least factor of a slack that closes an infeasible box
CERTIFICATE = "exact plan of a problem"  # the kind of the certificates that are made here
# Condition numbers of rows, each column scaled, up to which the check confirms what is proved.
# Found on 150 problems: it knows what every plan has by squares, and whitens other rows only.
ALONE = 1e5
BESIDE_OTHERS = 1e3
COLUMNS = ("multiplier", "parent", "group", "first", "stop", "count")


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


def region_certificate(found: RelaxedRegion) -> dict[str, Any]:
    """What proves a relaxation over a region, as plain data for JSON.

    Its claims about candidates are those of its points and of the grid. A proved bound is among
    them where rows are polynomials, in the parameters as they are given, and one multiplier proves
    it; others have no certificate of their boxes.
    """
    content = found.on_grid().to_dict()
    if not isinstance(found, ProvedRegion) or not _has_words(found):
        return content
    covering = found.covering.coverings[0]
    assert isinstance(covering, Covering)
    polynomials = RegionPolynomials.of(found.judged.region)
    Z = found.covering.multipliers[0]
    Z = 0.5 * (Z + Z.T)
    size = np.abs(polynomials.rows).sum(axis=2) + polynomials.errors
    whole = float(np.einsum("ra,ab,rb->", size, np.abs(Z), size))
    tested = covering.enclosed.objectives[0].numerator
    limit = float(found.covering.upper[0]) + rounding_of_check(whole, tested.coefficients)
    leaves = covering.leaves[0]
    letters, factors = _closed(leaves, covering, limit)
    tree, combined = tree_of(leaves, letters, covering.grid.parts)
    criterion = found.judged.criterion
    assert isinstance(criterion, Relaxable)
    M = found.judged.region.problem(found.points).information(found.weights)
    cost = float(criterion.lower_bound(Z[None], np.array([limit]), M))
    low, high = found.region.limits
    content["bound_proved"] = printed_form(cost * (1 - found.accuracy), criterion.sense)
    shares = criterion.dual_weights(Z, M)
    content["region"] = {
        "low": low.tolist(),
        "high": high.tolist(),
        "sizes": list(polynomials.sizes),
        "rows": polynomials.rows.tolist(),
        "errors": polynomials.errors.tolist(),
        "slacks": [
            {
                "sizes": list(slack.coefficients.shape),
                "coefficients": slack.coefficients.ravel().tolist(),
                "error": slack.error,
            }
            for slack in covering.enclosed.slacks
        ],
        "multiplier": Z.tolist(),
        "limit": limit,
        **({} if shares is None else {"dual_weights": shares.tolist()}),
        "tree": tree,
        "factors": factors[combined].tolist(),
        "points": np.concatenate([found.points, found.grid]).tolist(),
    }
    return content


def _has_words(found: ProvedRegion) -> bool:
    """Whether a certificate can tell of the boxes."""
    covering = found.covering
    one = len(covering.coverings) == 1 and isinstance(covering.coverings[0], Covering)
    return one and found.judged.T is None and found.judged.criterion.degree > 0


def _closed(leaves: Leaves, covering: Covering, limit: float) -> tuple[list[str], Array]:
    """A letter for each leaf (b,), and its factors of the slacks (b, c).

    An infeasible box is closed by a factor of the slack that is negative there.
    """
    factors = leaves.penalties.copy()
    letters = [BOUNDED if own == Reason.BELOW else COMBINED for own in leaves.reason.tolist()]
    infeasible = np.flatnonzero(leaves.reason == Reason.INFEASIBLE)
    if not len(infeasible):
        return letters, factors
    slacks = covering.enclosed.slacks
    tops = np.array([largest_on(slack, leaves, covering.grid, infeasible) for slack in slacks])
    which = tops.argmin(axis=0)
    tested = covering.enclosed.objectives[0].numerator
    over = largest_on(tested, leaves, covering.grid, infeasible)
    excess = np.maximum(over - limit, 0.0) + abs(limit)
    factors[infeasible] = 0.0
    factors[infeasible, which] = TWICE * excess / -tops[which, np.arange(len(which))]
    return letters, factors


def require_checkable(problem: Problem, keeps: bool) -> None:
    """Check that the second implementation has the digits to confirm a proof.

    Args:
        problem: The candidates.
        keeps: Whether plans have other experiments beside.

    Raises:
        UserError: The parameters are nearly dependent.
    """
    found = problem.conditioning
    told = found.s[~found.is_open]
    condition = float(told[-1] / told[0]) if len(told) else 1.0
    most = BESIDE_OTHERS if keeps or problem.known is not None else ALONE
    if condition > most:
        raise UserError(
            "the parameters are nearly dependent: the candidates' rows have the condition number "
            f"{condition:.1e}, each column scaled; a certificate of whole plans expects "
            f"{most:.0e} at most; leave it out, or centre the variables"
        )


def store_exact(plan: ProblemPlan) -> dict[str, Any]:
    """The certificate of a plan's proof, for JSON.

    Raises:
        UserError: There is no proof, or it rests on experiments that no certificate states.
    """
    proof = plan.proof
    problem = plan.problem
    criterion = plan.criterion
    if proof is None or plan.exact_bound is None:
        raise UserError(f"there is no proof to write: {plan.basis}")
    if plan.elsewhere:
        raise UserError("kept experiments that are none of the candidates have no certificate yet")
    new = np.flatnonzero(proof.counts)
    # What every plan has, whether it was measured already or must be, is the same for a proof.
    kept = plan.kept if plan.least is None else plan.least
    within: dict[str, Any] = (
        {} if plan.most is None else {"most": np.minimum(plan.most, plan.size).tolist()}
    )
    if plan.limits is not None and plan.limits.costs is not None:
        within |= {"costs": plan.limits.costs.tolist(), "cost_budget": plan.limits.funds}
        within |= {} if plan.limits.sized else {"places": plan.limits.m}
    return within | {
        "kind": CERTIFICATE,
        "criterion": criterion.to_dict(),
        "candidates": {
            "number": problem.n,
            "parameters": list(problem.parameters),
            "sha256": problem_digest(problem),
        },
        "size": plan.size,
        "kept": np.repeat(np.arange(problem.n), kept).tolist(),
        "plan": {"candidate": new.tolist(), "count": proof.counts[new].tolist()},
        "value": plan.value,
        "bound_exact": plan.exact_bound.value,
        "proved_exact": plan.proved_exact,
        "tree": tree_to_dict(proof.tree),
    }


def tree_to_dict(tree: ExactTree) -> dict[str, Any]:
    """Nodes and multipliers, as upper triangles row by row."""
    i, j = np.triu_indices(len(tree.T))
    found: dict[str, Any] = {
        "T": tree.T.tolist(),
        "order": tree.order.tolist(),
        "multipliers": tree.multipliers[:, i, j].tolist(),
        **{name: getattr(tree, name).tolist() for name in COLUMNS},
    }
    if tree.prices.shape[1]:
        found["prices"] = tree.prices.tolist()
    return found if tree.shares is None else found | {"shares": tree.shares.tolist()}
