"""Checked certificates."""

import math

import criteria
from criteria.criterion import printed
from criteria.registry import BUILTINS
from edtk.certificate.verify_certificate import Claim, Verification

# Claims whose numbers are the criterion's.
IN_UNITS = ("value", "bound", "bound_searched", "bound_proved", "value_exact", "bound_exact")
DIGITS = 10
RECOMPUTED = "recomputed in a second implementation"
# What each claim says, for a person.
MEANING = {
    "candidates": "the certificate is about these candidates",
    "study": "robot, load, noise and limits are those of the study",
    "question": "candidates, budget and kept experiments are those of the study",
    "feasible": "every pose is within the joint limits and the workspace",
    "loads": "every load is among those that may be applied",
    "limits": "the counts that the weights stand for obey the limits of the certificate",
    "costs": "visits and load changes together, within the budget",
    "plan": "as many experiments as are stated",
    "kept": "the kept poses are within the joint limits and the workspace",
    "weights": "the weights are shares of one",
    "repeats": "every pose is measured a whole number of times",
    "value": "of these experiments together",
    "bound": "proved on {candidates}: no design of them is better",
    "bound_searched": "searched, not proved: no design over all poses is better",
    "bound_proved": "proved: no design over all poses is better, by boxes that cover all of them",
    "value_exact": "of the best plan that is known on the candidates",
    "bound_exact": "proved on {candidates}: no plan of whole experiments on them is better",
    "proved_exact": "that plan is the best of all on {candidates}",
    "search": "a second search finds no pose whose sensitivity is 0.1 % larger",
    "gap": "relative distance from the bound to the value",
    "efficiency": "share of the best possible cost, as the bound has it",
}
# By how much a check fails.
EXCESS = {
    "feasible": "by {:.3g} (m or rad)",
    "kept": "by {:.3g} (m or rad)",
    "loads": "by {:.3g} of the largest load",
    "weights": "got a sum of {:.10g}",
    "repeats": "got {:.10g} in all",
    "search": "by {:.3g} of the largest one",
}
WITHOUT_NUMBER = (
    "candidates",
    "study",
    "question",
    "feasible",
    "limits",
    "loads",
    "kept",
    "weights",
    "repeats",
    "search",
    "proved_exact",
)


def verification_text(found: Verification) -> str:
    """What the certificate is about, a line for each claim, then the verdict."""
    verdict = f"valid {found.proved}" if found.valid else "NOT valid"
    lines = [f"{found.subject}: {verdict}"]
    lines += [found.whose] if found.whose else []
    lines += [_line(found, claim) for claim in found.claims]
    count = len(found.claims)
    if found.valid:
        return "\n".join([*lines, f"valid: all {count} claims hold, {RECOMPUTED}"])
    names = ", ".join(found.failed)
    failed = f"NOT valid: {len(found.failed)} of {count} claims fail: {names}, {RECOMPUTED}"
    return "\n".join([*lines, failed])


def _line(found: Verification, claim: Claim) -> str:
    """Whether a claim holds, its number, and what it says or why it fails."""
    if claim.holds:
        number = "" if claim.claim in WITHOUT_NUMBER else _shown(found, claim, claim.recomputed)
        plural = "" if claim.candidates == 1 else "s"
        candidates = f"{claim.candidates} candidate{plural}"
        meaning = MEANING[claim.claim].format(candidates=candidates)
        return f"  holds  {claim.claim:14}  {number:18}  {meaning}"
    if claim.claim in WITHOUT_NUMBER:
        by = "" if not claim.recomputed else f", {_shown(found, claim, claim.recomputed)}"
        return f"  FAILS  {claim.claim:14}  {claim.reason}{by}"
    numbers = [
        f"{word} {_shown(found, claim, number)}"
        for word, number in (("stated", claim.stated), ("recomputed", claim.recomputed))
        if number is not None and math.isfinite(number)
    ]
    return f"  FAILS  {claim.claim:14}  {', '.join([claim.reason, *numbers])}"


def _shown(found: Verification, claim: Claim, number: float | None) -> str:
    """A number in the unit in which people read it."""
    if number is None:
        return "-"
    if claim.claim in IN_UNITS and found.criterion in BUILTINS:
        return printed(criteria.get(found.criterion), number, digits=DIGITS)
    if claim.claim in EXCESS:
        return EXCESS[claim.claim].format(number)
    return f"{number:.3g}" if claim.claim == "gap" else f"{number:.{DIGITS}g}"
