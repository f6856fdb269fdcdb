"""Text of a checked certificate."""

from edtk.certificate.verification import Claim, Verification

# What each claim says, for a person.
MEANING = {
    "feasible": "all poses are within the limits and the workspace",
    "weights": "the weights are shares of one",
    "repeats": "every pose is measured a whole number of times",
    "value": "the criterion has this value",
    "bound": "no design over the candidates is better",
    "bound_searched": "no design over the poses that the search found is better",
    "search": "a second search finds no pose of a larger sensitivity",
    "gap": "relative distance from value to bound",
    "efficiency": "bound over cost",
}


def verification(found: Verification) -> str:
    """A line for each claim, then the verdict."""
    lines = [found.subject]
    lines += [_line(claim) for claim in found.claims]
    verdict = "valid: every claim holds" if found.valid else "NOT valid: at least one claim fails"
    return "\n".join([*lines, verdict])


def _line(claim: Claim) -> str:
    """Whether a claim holds, its numbers, and what it says."""
    mark = "holds" if claim.holds else "FAILS"
    recomputed = "-" if claim.recomputed is None else f"{claim.recomputed:.10g}"
    stated = "-" if claim.stated is None else f"{claim.stated:.10g}"
    text = claim.reason or MEANING[claim.claim]
    return f"  {mark}  {claim.claim:15} stated {stated:>17}  recomputed {recomputed:>17}  {text}"
