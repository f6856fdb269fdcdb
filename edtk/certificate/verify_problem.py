"""Recompute every claim of a certificate of a relaxation over a problem of arrays."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

import criteria
from edtk.certificate.recompute.plain_data import number, numbers, rows, table, text
from edtk.certificate.verify_certificate import Claim, Verification
from edtk.design.bound import printed_form
from edtk.design.problem import Problem, problem_digest
from edtk.design.relaxation.certify import CERTIFICATE, certify
from edtk.design.relaxation.proof import InnerProof
from edtk.system.typing import Array

KEYS = ("kind", "criterion", "candidates", "weights", "value", "bound", "gap", "multipliers")
OPTIONAL = ("dual_weights", "inner")
MOST_MULTIPLIERS = 100
AGREE = 1e-8  # relative difference that two ways of rounding may make
ABSOLUTE = 1e-8  # difference of a gap or of a sum of weights, which are of order one


@dataclass(frozen=True, repr=False)
class ProblemVerification(Verification):
    """All claims of a certificate of a relaxation over a problem's candidates, checked.

    Attributes:
        about: The criterion as a person reads it, with its parameters.
    """

    about: str = ""

    @property
    def proved(self) -> str:
        """What is proved, and on what."""
        if not self.valid:
            return "nothing is proved"
        return f"the bound is proved on the {self.candidates} candidates of the problem alone"

    @property
    def label(self) -> str:
        """The criterion as a person reads it."""
        return self.about

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: `valid`, what the certificate is about, and the claims."""
        return {
            "valid": self.valid,
            "criterion": self.criterion,
            "about": self.about,
            "kind": self.kind,
            "candidates": self.candidates,
            "proved": self.proved,
            "support": self.poses,
            "second_implementation": False,
            "claims": [claim.to_dict() for claim in self.claims],
        }


def verify_problem(content: Any, problem: Problem) -> ProblemVerification:
    """Check all claims of a certificate against the candidates that it is about.

    The certificate is an enemy's: whatever it says is computed anew from weights, multipliers and
    the candidates themselves. That is done by `certify`, which the search uses too: this is no
    second implementation.

    Args:
        content: What `Relaxation.to_dict` wrote, as JSON has it.
        problem: The candidates.

    Returns:
        Each claim with the stated and the recomputed number.

    Raises:
        ValueError: The content is no such certificate; one line says where.
    """
    with np.errstate(all="ignore"):
        table(content, KEYS, "certificate", OPTIONAL)
        text(content["kind"], (CERTIFICATE,), "kind")
        criterion = _criterion(content["criterion"])
        places, shares = _weights(content["weights"], problem.n)
        multipliers = _multipliers(content["multipliers"], problem.p)
        weights = np.bincount(places, shares, problem.n).astype(float)
        try:
            inner = _inner(content.get("inner"), multipliers.shape)
            cost, bound = _recomputed(criterion, problem, weights, multipliers, inner)
        except criteria.CriterionError as error:
            raise ValueError(f"criterion: {error}") from error
    claims = (_same_candidates(content["candidates"], problem), _sound(places, shares))
    stated = {name: number(content[name], name) for name in ("value", "bound", "gap")}
    return ProblemVerification(
        criterion=criterion.name,
        kind="relaxation",
        robot="",
        poses=len(places),
        kept=0,
        candidates=problem.n,
        claims=(*claims, *_numbers(criterion, stated, cost, bound, problem.n)),
        about=criterion.label,
    )


def _criterion(given: Any) -> criteria.Relaxable:
    """The criterion with its parameters."""
    if not isinstance(given, dict) or not isinstance(given.get("name"), str):
        raise ValueError("criterion: expected a table with a name")
    try:
        found = criteria.from_dict(given)
    except (criteria.CriterionError, ValueError, TypeError, OverflowError) as error:
        raise ValueError(f"criterion: {' '.join(str(error).split())}") from error
    if not isinstance(found, criteria.Relaxable):
        raise ValueError(f"criterion: {found.name!r} cannot be relaxed")
    return found


def _weights(given: Any, n: int) -> tuple[np.ndarray, Array]:
    """Candidates (k,) and their weights (k,)."""
    table(given, ("candidate", "weight"), "weights")
    places = rows(given["candidate"], n, "weights.candidate")
    for place in places:
        if isinstance(place, bool) or not isinstance(place, int) or not 0 <= place < n:
            raise ValueError(f"weights.candidate: expected whole numbers from 0 to {n - 1}")
    shares = numbers(given["weight"], (len(places),), "weights.weight")
    return np.array(places, dtype=int), shares


def _multipliers(given: Any, p: int) -> Array:
    """Multipliers (r, p, p), symmetric: of others the symmetric part would count, unseen."""
    found = numbers(rows(given, MOST_MULTIPLIERS, "multipliers"), (None, p, p), "multipliers")
    if not (found == np.swapaxes(found, 1, 2)).all():
        raise ValueError("multipliers: expected symmetric matrices")
    return found


def _inner(given: Any, shape: tuple[int, ...]) -> InnerProof | None:
    """The multipliers with more digits, if there are any."""
    if given is None:
        return None
    table(given, ("T", "Z"), "inner")
    T = numbers(given["T"], shape[1:], "inner.T")
    return InnerProof(T, numbers(given["Z"], shape, "inner.Z"))


def _recomputed(
    criterion: criteria.Relaxable,
    problem: Problem,
    weights: Array,
    multipliers: Array,
    inner: InnerProof | None,
) -> tuple[float, float]:
    """Cost of the weights, and the bound that the multipliers prove; nan where there is none."""
    try:
        cost, bound = certify(problem, criterion, weights, multipliers, inner)
    except (ValueError, ArithmeticError):  # no weights, or no multipliers; or numbers overflow
        return math.nan, math.nan
    return cost, bound if bound > 0 else math.nan


def _same_candidates(given: Any, problem: Problem) -> Claim:
    """The claim that the certificate is about these candidates."""
    table(given, ("number", "parameters", "sha256"), "candidates")
    own = {
        "number": problem.n,
        "parameters": list(problem.parameters),
        "sha256": problem_digest(problem),
    }
    other = [key for key in own if given[key] != own[key]]
    reason = f"the problem has another {', '.join(other)}" if other else ""
    return Claim("candidates", not other, None, None, reason)


def _sound(places: np.ndarray, shares: Array) -> Claim:
    """The claim that weights are shares of one, each candidate's given once."""
    total = float(shares.sum())
    is_share = bool((shares >= 0).all()) and abs(total - 1) <= ABSOLUTE
    holds = is_share and len(np.unique(places)) == len(places) > 0
    reason = "" if holds else "expected weights of sum one, none negative, each candidate once"
    return Claim("weights", holds, 1.0, total, reason)


def _numbers(
    criterion: criteria.Relaxable, stated: dict[str, float], cost: float, bound: float, n: int
) -> list[Claim]:
    """The claims about value, bound and gap."""
    own = {
        "value": printed_form(cost, criterion.sense),
        "bound": printed_form(bound, criterion.sense),
        "gap": 1 - bound / cost if cost > 0 else math.nan,
    }
    found = []
    for name, number_here in own.items():
        absolute = ABSOLUTE if name == "gap" else 0.0
        agrees = math.isclose(stated[name], number_here, rel_tol=AGREE, abs_tol=absolute)
        holds = math.isfinite(number_here) and agrees
        reason = "" if holds else "the recomputed number differs"
        if not math.isfinite(number_here):
            reason = "nothing is proved here" if name == "bound" else "it is not finite here"
        elif name == "gap" and number_here < -ABSOLUTE:
            holds = False
            reason = "the design beats the bound"
        candidates = n if name == "bound" else None
        found.append(Claim(name, holds, stated[name], number_here, reason, candidates))
    return found
