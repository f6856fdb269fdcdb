"""Certificates about problems: a bound over a region, and an exact plan with the proof of it."""

from typing import Any

import numpy as np

from criteria import Relaxable
from edtk.certificate.coverings import largest_on, tree_of
from edtk.certificate.recompute.covering import BOUNDED, COMBINED
from edtk.certificate.recompute.region import rounding_of_check
from edtk.design.bound import printed_form
from edtk.design.enclosure.boxes import Leaves, Reason
from edtk.design.enclosure.cover import Covering
from edtk.design.enclosure.prove_region import ProvedRegion
from edtk.design.enclosure.region_functions import RegionPolynomials
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.design.exact.exact_tree import ExactTree
from edtk.design.problem import Problem, problem_digest
from edtk.design.relaxation.relaxed_region import RelaxedRegion
from edtk.system.errors import UserError
from edtk.system.typing import Array

TWICE = 2.0  # of the least factor of a slack that closes an infeasible box
CERTIFICATE = "exact plan of a problem"  # the kind of the certificates that are made here
# Condition numbers of rows, each column scaled, up to which the check confirms what is proved.
# Found on 150 problems: it knows what every plan has by squares, and whitens other rows only.
ALONE = 1e5
BESIDE_OTHERS = 1e3
COLUMNS = ("multiplier", "parent", "group", "first", "stop", "count")


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
