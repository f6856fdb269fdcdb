"""Faults that may explain residuals, and which of them do best."""

import math
from collections.abc import Sequence
from dataclasses import replace

from edtk.calibration.causes.cause import NOISE
from edtk.calibration.causes.tried import Tried

LEVEL = 0.01  # p of faults that are named
COMMON = "common_noise"
# Shares of the level, as divisors, of noise that is tested whatever is looked at beside it, and of
# all other faults together: any cause is then named in at most 1.5 % of good data.
ALWAYS = {NOISE: 2.0, COMMON: 6.0}
OTHERS = 1.25


def likely_faults(tried: Sequence[Tried]) -> list[Tried]:
    """The faults that may explain residuals which are no chance, after looking at all faults.

    Each cause has the same share of the level, which its joints, poses or readings share. Where one
    fault is no chance, every fault that would be none, had nothing else been tried, may be what it
    is: that is for `rank_faults` to say. Their p is the least level at which they are among these.
    """
    kinds = len({one.cause.cause for one in tried} - set(ALWAYS))
    whole = min(
        (one.cause.p * ALWAYS.get(one.cause.cause, OTHERS * kinds * one.tries) for one in tried),
        default=1.0,
    )
    found = [replace(one, cause=replace(one.cause, p=max(one.cause.p, whole))) for one in tried]
    return [one for one in found if one.cause.p < LEVEL]


def rank_faults(found: Sequence[Tried], coordinates: int) -> list[tuple[float, Tried]]:
    """The faults with their scores, the likeliest first.

    A cause that is in one of several joints, or of several shapes, is as likely as these together,
    ``-2 log sum exp(-s/2)`` of their scores s: that is the score of the best of them.

    Args:
        found: The faults.
        coordinates: Number of measured coordinates.
    """
    ranked = sorted(((one.score(coordinates), one) for one in found), key=lambda pair: pair[0])
    by_cause: dict[str, list[float]] = {}
    for score, one in ranked:
        by_cause.setdefault(one.cause.cause, []).append(score)
    best: set[str] = set()
    whole = []
    for score, one in ranked:
        cause = one.cause.cause
        value = score
        if cause not in best:
            best.add(cause)
            share = sum(math.exp(-(other - score) / 2) for other in by_cause[cause])
            value = score - 2 * math.log(share)
        whole.append((value, one))
    return sorted(whole, key=lambda pair: pair[0])
