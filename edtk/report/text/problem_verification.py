"""Text of a checked certificate of a problem of arrays."""

from edtk.certificate.problem_verification import ProblemVerification
from edtk.certificate.verification import Claim

DIGITS = 10
# Remove it once the recomputation imports nothing of the search.
SHARED = "recomputed by the routine that the search uses, not by a second implementation"
MEANING = {
    "candidates": "the certificate is about these candidates",
    "weights": "the weights are shares of one",
    "value": "of these weights",
    "bound": "proved on {candidates} candidates: no weights of them are better",
    "gap": "relative distance from the bound to the value",
}


def problem_verification(found: ProblemVerification) -> str:
    """What the certificate is about, a line for each claim, then the verdict."""
    verdict = f"valid, {found.proved}" if found.valid else "NOT valid"
    lines = [f"{found.label}, weights on {found.poses} of {found.candidates} candidates: {verdict}"]
    lines += [_line(claim) for claim in found.claims]
    count = len(found.claims)
    if found.valid:
        return "\n".join([*lines, f"valid: all {count} claims hold; {SHARED}"])
    names = ", ".join(found.failed)
    failed = f"NOT valid: {len(found.failed)} of {count} claims fail: {names}; {SHARED}"
    return "\n".join([*lines, failed])


def _line(claim: Claim) -> str:
    """Whether a claim holds, its number, and what it says or why it fails."""
    if claim.holds:
        shown = claim.claim in ("value", "bound", "gap")
        number = f"{claim.recomputed:.{DIGITS}g}" if shown else ""
        meaning = MEANING[claim.claim].format(candidates=claim.candidates)
        return f"  holds  {claim.claim:10}  {number:18}  {meaning}"
    words = [
        f"{word} {number:.{DIGITS}g}"
        for word, number in (("stated", claim.stated), ("recomputed", claim.recomputed))
        if number is not None
    ]
    return f"  FAILS  {claim.claim:10}  {', '.join([claim.reason, *words])}"
