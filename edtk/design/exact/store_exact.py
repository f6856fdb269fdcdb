"""A proof about plans of whole experiments as plain data, which `edtk.verify` checks."""

from typing import Any

import numpy as np

from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.design.exact.exact_tree import ExactTree
from edtk.design.problem import Problem, problem_digest
from edtk.system.errors import UserError

CERTIFICATE = "exact plan of a problem"  # the kind of the certificates that are made here
# Condition numbers of rows, each column scaled, up to which the check confirms what is proved.
# Found on 150 problems: it knows what every plan has by squares, and whitens other rows only.
ALONE = 1e5
BESIDE_OTHERS = 1e3
COLUMNS = ("multiplier", "parent", "group", "first", "stop", "count")


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
