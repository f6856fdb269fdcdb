"""A proof about plans of whole experiments as plain data, which `edtk.verify` checks."""

from typing import Any

import numpy as np

from criteria import Criterion, Relaxable
from criteria.criterion import Sense
from edtk.design.bound import printed_form
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.exact_tree import ExactTree
from edtk.design.exact.prove_exact import ExactProof
from edtk.design.problem import Problem, problem_digest
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices

CERTIFICATE = "exact plan of a problem"  # the kind of the certificates that are made here
COLUMNS = ("multiplier", "parent", "group", "first", "stop", "count")
DIGITS_MB = 2e-5  # of a number in JSON, about [MB]
MOST_MB = 28.0  # `edtk.verify` reads files of 30 MB


def store_exact(
    problem: Problem, criterion: Criterion, limits: Limits, kept: Indices, proof: ExactProof
) -> dict[str, Any]:
    """The certificate of a proof, for JSON.

    Args:
        problem: The candidates.
        criterion: The criterion.
        limits: Size, and what every plan has: the prior, as often as experiments are counted, and
            kept experiments.
        kept: How often each candidate was measured already (n,).
        proof: The proof, of the new experiments.

    Raises:
        UserError: The proof is too large for a file, or about limits that no certificate states.
    """
    tree = proof.tree
    if limits.most is not None or limits.costs is not None:
        raise UserError("a plan with `most` or `costs` has no certificate yet")
    if tree.multipliers.size * DIGITS_MB + 6 * tree.nodes * DIGITS_MB / 3 > MOST_MB:
        raise UserError(f"a proof of {tree.nodes:,} nodes is too large for a certificate")
    size = limits.m + int(kept.sum())
    known = problem.with_prior(None).information(kept)
    known = known if problem.prior is None else known + size * problem.prior
    if not np.allclose(known, limits.base, rtol=1e-12, atol=0.0):
        raise UserError("kept experiments that are none of the candidates have no certificate yet")
    new = np.flatnonzero(proof.counts)
    sense: Sense = criterion.sense
    return {
        "kind": CERTIFICATE,
        "criterion": criterion.to_dict(),
        "candidates": {
            "number": problem.n,
            "parameters": list(problem.parameters),
            "sha256": problem_digest(problem),
        },
        "size": size,
        "kept": np.repeat(np.arange(problem.n), kept).tolist(),
        "plan": {"candidate": new.tolist(), "count": proof.counts[new].tolist()},
        "value": printed_form(proof.best, sense),
        "bound_exact": printed_form(proof.cost, sense),
        "proved_exact": proof.proved,
        "tree": _of_tree(tree, criterion, problem.information(proof.counts) + limits.base),
    }


def _of_tree(tree: ExactTree, criterion: Criterion, M: Array) -> dict[str, Any]:
    """Nodes and multipliers, as upper triangles row by row."""
    i, j = np.triu_indices(len(tree.T))
    found: dict[str, Any] = {
        "T": tree.T.tolist(),
        "order": tree.order.tolist(),
        "multipliers": tree.multipliers[:, i, j].tolist(),
        **{name: getattr(tree, name).tolist() for name in COLUMNS},
    }
    shares = _shares(tree, criterion, M)
    return found if shares is None else found | {"shares": shares}


def _shares(tree: ExactTree, criterion: Criterion, M: Array) -> list[list[float]] | None:
    """By what shares a criterion that is the worst of several turns each multiplier to a bound."""
    if not isinstance(criterion, Relaxable):
        return None
    found = []
    for Z in tree.multipliers:
        own = criterion.dual_weights(tree.T @ Z @ tree.T.T, M)
        if own is None:
            return None
        found.append(own.tolist())
    return found
