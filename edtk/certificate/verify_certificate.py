"""Recompute every claim of a certificate from its poses and multipliers, in a code path of its own.

A certificate is treated as an enemy's: whatever it states is computed anew, and the numbers that prove
a bound must have the properties that the proof needs.
"""

import math
from collections.abc import Callable
from typing import Any

from edtk.certificate.case import Case
from edtk.certificate.recompute import values
from edtk.certificate.verification import Claim, Verification

AGREE = 1e-8  # relative difference that two ways of rounding may make; 1e-13 is the rule
ABSOLUTE = 1e-8  # difference of a gap or an efficiency, which are of order one
EXCESS = 1e-3  # relative excess of a sensitivity found here over those that a search rests on


def verify_certificate(content: dict[str, Any]) -> Verification:
    """Check all claims of a certificate.

    Args:
        content: The certificate, as `certificate_of` makes it.

    Returns:
        Each claim with the stated and the recomputed number.

    Raises:
        KeyError, TypeError, ValueError: The content is no certificate.
    """
    case = Case.from_dict(content)
    claims = [_feasible(case), _amounts(case)]
    recomputed: dict[str, float] = {}
    sources: dict[str, Callable[[], float]] = {
        "value": lambda: case.value,
        "bound": lambda: case.bound(searched=False),
        "bound_searched": lambda: case.bound(searched=True),
        "gap": lambda: _gap(case, recomputed),
        "efficiency": lambda: 1.0 - _gap(case, recomputed),
    }
    for name, stated in case.stated.items():
        if name not in sources:
            raise ValueError(f"claims: unknown claim {name!r}")
        claim = _compared(name, stated, sources[name])
        recomputed[name] = math.nan if claim.recomputed is None else claim.recomputed
        claims.append(claim)
    if "bound_searched" in case.stated:
        claims.append(_search(case))
    return Verification(f"{case.name}, {case.kind}", tuple(claims))


def _feasible(case: Case) -> Claim:
    """All poses satisfy the joint limits and the workspace."""
    violation = case.violation
    holds = violation <= 1e-9  # rounding of a forward kinematics [m or rad]
    reason = "" if holds else "a pose violates a constraint"
    return Claim("feasible", holds, 0.0, violation, reason)


def _amounts(case: Case) -> Claim:
    """Weights sum to one, or repetitions are whole numbers."""
    name = "weights" if case.kind == "relaxation" else "repeats"
    total = float(case.made.amount.sum())
    holds = case.amounts_are_sound
    reason = "" if holds else "expected shares of one, or whole repetitions of at least one"
    return Claim(name, holds, 1.0 if case.kind == "relaxation" else total, total, reason)


def _gap(case: Case, recomputed: dict[str, float]) -> float:
    """``1 - bound/cost`` of the recomputed numbers: of the proved bound where one is stated."""
    bound = recomputed["bound"] if "bound" in recomputed else recomputed["bound_searched"]
    best = values.cost(case.name, recomputed["value"])
    return 1.0 - values.cost(case.name, bound) / best


def _compared(name: str, stated: float, source: Callable[[], float]) -> Claim:
    """Compare a stated number with a recomputed one; a proof that proves nothing does not hold."""
    try:
        found = source()
    except (ValueError, ArithmeticError, KeyError) as error:
        return Claim(name, False, stated, None, f"cannot be recomputed: {error}")
    absolute = ABSOLUTE if name in ("gap", "efficiency") else 0.0
    holds = math.isclose(stated, found, rel_tol=AGREE, abs_tol=absolute)
    return Claim(name, holds, stated, found, "" if holds else "the recomputed number differs")


def _search(case: Case) -> Claim:
    """No pose that a search of this module's own finds has a much larger sensitivity."""
    try:
        excess = case.excess
    except (ValueError, ArithmeticError, KeyError) as error:
        return Claim("search", False, 0.0, None, f"cannot be repeated: {error}")
    holds = excess <= EXCESS
    reason = "" if holds else "a pose of a larger sensitivity was found"
    return Claim("search", holds, 0.0, max(excess, 0.0), reason)
