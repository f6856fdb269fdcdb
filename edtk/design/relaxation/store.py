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
from edtk.system.typing import Array

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
        ValueError: The candidates are others, weights or multipliers do not fit them, or the data
            are not those of a certificate.
    """
    try:
        return _restored(data, problem)
    except ValueError:
        raise
    # Whatever an enemy, or a disk, has put in the place of numbers, tables and names.
    except (LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
        words = " ".join(f"{type(error).__name__}: {error}".split())
        raise ValueError(f"this is no certificate of a relaxation ({words})") from error


def _restored(data: Mapping[str, Any], problem: Problem) -> Relaxation:
    """The relaxation of a certificate, of which nothing is believed."""
    if data["candidates"]["sha256"] != problem_digest(problem):
        raise ValueError("the certificate is about other candidates than those of this problem")
    criterion = criteria.from_dict(data["criterion"])
    if not isinstance(criterion, criteria.Relaxable):
        raise ValueError(f"criterion {criterion.name!r} cannot be relaxed")
    weights = _weights(data["weights"], problem.n)
    multipliers = np.array(data["multipliers"], dtype=float)
    kept = data.get("inner")
    inner = None if kept is None else InnerProof(np.array(kept["T"]), np.array(kept["Z"]))
    cost, bound = certify(problem, criterion, weights, multipliers, inner)
    believes = np.isfinite(cost) and criterion.rests_on_solver(
        multipliers, problem.information(weights)
    )
    kind = BoundKind.SOLVED if believes else BoundKind.PROVED_ON_CANDIDATES
    return Relaxation(
        criterion=criterion,
        weights=weights,
        cost=cost,
        proved_bound=Bound.of(criterion, bound, cost, kind),
        multipliers=multipliers,
        solver=SOLVER,
        iterations=0,
        rests_on_solver=bool(believes),
        inner=inner,
        problem=problem,
    )


def _weights(data: Mapping[str, Any], n: int) -> Array:
    """Weights (n,) of the candidates that are listed with theirs.

    Raises:
        ValueError: The lists are not of the same length, or name a candidate that is none or twice.
    """
    chosen = data["candidate"]
    listed = np.array(data["weight"], dtype=float)
    are_indices = all(type(i) is int and 0 <= i < n for i in chosen)
    if not are_indices or len(set(chosen)) < len(chosen) or listed.shape != (len(chosen),):
        raise ValueError(
            f"weights: expected a weight for each of some candidates, from 0 to {n - 1}, once each"
        )
    weights = np.zeros(n)
    weights[np.array(chosen, dtype=int)] = listed
    return weights
