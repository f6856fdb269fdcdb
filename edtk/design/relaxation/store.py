"""A relaxation as plain data, and back."""

from collections.abc import Mapping
from typing import Any

import numpy as np

import criteria
from edtk.design.bound import Bound, BoundKind, printed_form
from edtk.design.problem import Problem
from edtk.design.problem_digest import problem_digest
from edtk.design.relaxation.certify import certify
from edtk.design.relaxation.inner_proof import InnerProof
from edtk.design.relaxation.relaxation import Relaxation

CERTIFICATE = "relaxation of a problem"  # the kind of the certificates that are made here
SOLVER = "from a certificate"


def store(found: Relaxation, problem: Problem) -> dict[str, Any]:
    """The certificate of a relaxation, as plain data for JSON.

    Value and bound are those that `certify` finds from the rest.

    Args:
        found: The relaxation.
        problem: Its candidates.
    """
    # The two triangles of a product differ by rounding; a certificate has one matrix.
    multipliers = 0.5 * (found.multipliers + np.swapaxes(found.multipliers, 1, 2))
    cost, bound = certify(problem, found.criterion, found.weights, multipliers, found.inner)
    M = problem.information(found.weights)
    duals = [found.criterion.dual_weights(Z, M) for Z in multipliers]
    content = {
        "kind": CERTIFICATE,
        "criterion": found.criterion.to_dict(),
        "candidates": {
            "number": problem.n,
            "parameters": list(problem.parameters),
            "sha256": problem_digest(problem),
        },
        "weights": {
            "candidate": found.support.tolist(),
            "weight": found.weights[found.support].tolist(),
        },
        "value": printed_form(cost, found.criterion.sense),
        "bound": printed_form(bound, found.criterion.sense),
        "gap": 1 - bound / cost,
        "multipliers": multipliers.tolist(),
    }
    if any(u is not None for u in duals):
        content["dual_weights"] = [u.tolist() for u in duals if u is not None]
    if found.inner is not None:
        content["inner"] = {"T": found.inner.T.tolist(), "Z": found.inner.Z.tolist()}
    return content


def restore(data: Mapping[str, Any], problem: Problem) -> Relaxation:
    """The relaxation that a certificate is about; cost and bound are computed anew.

    Args:
        data: What `store` made.
        problem: Its candidates.

    Raises:
        ValueError: The candidates are others, or weights or multipliers do not fit them.
    """
    if data["candidates"]["sha256"] != problem_digest(problem):
        raise ValueError("the certificate is about other candidates than those of this problem")
    criterion = criteria.from_dict(data["criterion"])
    if not isinstance(criterion, criteria.Relaxable):
        raise ValueError(f"criterion {criterion.name!r} cannot be relaxed")
    weights = np.zeros(problem.n)
    weights[data["weights"]["candidate"]] = data["weights"]["weight"]
    multipliers = np.array(data["multipliers"], dtype=float)
    kept = data.get("inner")
    inner = None if kept is None else InnerProof(np.array(kept["T"]), np.array(kept["Z"]))
    cost, bound = certify(problem, criterion, weights, multipliers, inner)
    return Relaxation(
        criterion=criterion,
        weights=weights,
        cost=cost,
        proved_bound=Bound.of(criterion, bound, cost, BoundKind.PROVED_ON_CANDIDATES),
        multipliers=multipliers,
        solver=SOLVER,
        iterations=0,
        inner=inner,
        problem=problem,
    )
