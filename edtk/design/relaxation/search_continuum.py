"""The dearest poses of the continuum: where a design should measure next."""

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from criteria.linalg.inverse import whitener
from edtk.design.candidate_source import CandidateSource
from edtk.design.candidates import Candidates
from edtk.design.design_space import DesignSpace
from edtk.design.distinct import distinct
from edtk.design.relaxation.relax import normalised
from edtk.design.relaxation.sensitivity import ascend

Array = NDArray[np.float64]
SCREEN = 20_000  # fresh feasible poses that are priced to find starts
STARTS = 96  # ascents, at most 16 and at least 6 per multiplier


def search_continuum(
    space: DesignSpace,
    criterion: Criterion,
    multipliers: Array,
    known: Candidates,
    accuracy: float,
    seed: tuple[int, ...],
) -> tuple[Array, Candidates]:
    """Ascend the sensitivity over all feasible poses, from the dearest of known and of many fresh poses.

    Args:
        space: Model and feasible set.
        criterion: What the multipliers belong to.
        multipliers: Multipliers (r, p, p).
        known: Poses that the design may rest on.
        accuracy: Relative accuracy of a pose's price at the end of an ascent.
        seed: Seed of the fresh poses.

    Returns:
        The dearest price found (r,) by multiplier, and the poses where the ascents ended. A search proves nothing:
        a dearer pose may exist.
    """
    fresh = CandidateSource(space, seed).take(SCREEN)
    T = whitener(known.problem.mean)
    size = max(6, min(16, STARTS // len(multipliers)))
    starts, units, owner = [], [], []
    for j, Z in enumerate(multipliers):
        sensitivities = [
            normalised(some.problem, criterion).sensitivities(Z) for some in (known, fresh)
        ]
        near = [
            _dearest(some, p, T, k)
            for some, p, k in zip((known, fresh), sensitivities, (size, size // 3), strict=True)
        ]
        starts += near
        units.append(float(np.abs(sensitivities[0]).max()))
        owner += [j] * sum(map(len, near))
    Z = multipliers[owner] / np.array(units)[owner, None, None]
    x = ascend(space, np.concatenate(starts), Z, criterion.degree == 0, accuracy=accuracy)
    found = Candidates(x, space.problem(x))
    ends = normalised(found.problem, criterion).sensitivities(multipliers)
    return np.array([ends[j, np.equal(owner, j)].max() for j in range(len(multipliers))]), found


def _dearest(some: Candidates, sensitivities: Array, T: Array, size: int) -> Array:
    """The dearest experiments (size, v) that differ from each other."""
    order = np.argsort(-sensitivities, kind="stable")[: 100 * size]
    return some.x[order[distinct(some.problem.blocks(order), T, 0.1)[:size]]]
