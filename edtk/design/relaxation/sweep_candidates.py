"""One pass over candidates that do not fit in memory."""

import numpy as np

from criteria import Criterion
from edtk.design.candidate_source import CandidateSource
from edtk.design.candidates import Candidates
from edtk.design.relaxation.largest_sensitivities import LargestSensitivities
from edtk.design.relaxation.normalised import normalised
from edtk.system.typing import Array, Indices

FULL = 4  # times the number to keep: a choice among so many costs less than holding them


def sweep_candidates(
    source: CandidateSource, n: int, criterion: Criterion, multipliers: Array, keep: int
) -> tuple[LargestSensitivities, Candidates]:
    """Generate candidates anew, chunk by chunk, and keep those of largest sensitivity.

    Args:
        source: Where the candidates come from.
        n: Number of candidates.
        criterion: What the multipliers belong to.
        multipliers: Multipliers (r, p, p).
        keep: Number of candidates to keep for each multiplier.

    Returns:
        The largest sensitivities of all n candidates, and the candidates that are kept.
    """
    largest: LargestSensitivities | None = None
    kept: Candidates | None = None
    # What a candidate must exceed to be among those to keep, by multiplier.
    least = np.full(len(multipliers), -np.inf)
    for part in source.chunks(n):
        sensitivities = normalised(part.problem, criterion).sensitivities(multipliers)
        of_part = LargestSensitivities.of(sensitivities, part.x)
        largest = of_part if largest is None else largest.or_larger(of_part)
        promising = np.flatnonzero((sensitivities > least[:, None]).any(axis=0))
        if not promising.size:
            continue
        kept = part[promising] if kept is None else kept + part[promising]
        if len(kept.x) > FULL * keep * len(multipliers):
            sensitivities = normalised(kept.problem, criterion).sensitivities(multipliers)
            chosen, least = most_sensitive(sensitivities, keep)
            kept = kept[chosen]
    assert kept is not None
    assert largest is not None
    sensitivities = normalised(kept.problem, criterion).sensitivities(multipliers)
    return largest, kept[most_sensitive(sensitivities, keep)[0]]


def most_sensitive(sensitivities: Array, size: int) -> tuple[Indices, Array]:
    """Choose the candidates of largest sensitivity to each multiplier.

    Args:
        sensitivities: Sensitivities (r, n).
        size: Number of candidates for each multiplier, at most.

    Returns:
        Indices of all chosen candidates, in ascending order, and the least sensitivity (r,) of
        those chosen for each multiplier.
    """
    size = min(size, sensitivities.shape[1])
    order = np.argpartition(-sensitivities, size - 1, axis=1)[:, :size]
    least = np.take_along_axis(sensitivities, order[:, -1:], axis=1).ravel()
    return np.unique(order), least
