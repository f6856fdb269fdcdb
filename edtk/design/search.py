"""The dearest poses of the continuum: where a design should measure next."""

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from criteria.inverse import whitener
from edtk.design.candidates import Candidates, CandidateSource
from edtk.design.pose_design import PoseDesign
from edtk.design.relax import judged
from edtk.design.sensitivity import ascend

Array = NDArray[np.float64]
Indices = NDArray[np.int_]
SCREEN = 20_000  # fresh feasible poses that are priced to find starts
STARTS = 96  # ascents, at most 16 and at least 6 per multiplier


def search(
    design: PoseDesign,
    criterion: Criterion,
    multipliers: Array,
    known: Candidates,
    accuracy: float,
    seed: tuple[int, ...],
) -> tuple[Array, Candidates]:
    """Ascend the sensitivity over all feasible poses, from the dearest of known and of many fresh poses.

    Args:
        design: Model and feasible set.
        criterion: What the multipliers belong to.
        multipliers: Multipliers (r, p, p).
        known: Poses that the design may rest on.
        accuracy: Relative accuracy of a pose's price at the end of an ascent.
        seed: Seed of the fresh poses.

    Returns:
        The dearest price found (r,) by multiplier, and the poses where the ascents ended. A search proves nothing:
        a dearer pose may exist.
    """
    fresh = CandidateSource(design, seed).take(SCREEN)
    T = whitener(known.problem.mean)
    size = max(6, min(16, STARTS // len(multipliers)))
    starts, units, owner = [], [], []
    for j, Z in enumerate(multipliers):
        prices = [judged(some.problem, criterion).prices(Z) for some in (known, fresh)]
        near = [_dearest(some, p, T, k) for some, p, k in zip((known, fresh), prices, (size, size // 3), strict=True)]
        starts += near
        units.append(float(np.abs(prices[0]).max()))
        owner += [j] * sum(map(len, near))
    Z = multipliers[owner] / np.array(units)[owner, None, None]
    x = ascend(design, np.concatenate(starts), Z, criterion.degree == 0, accuracy=accuracy)
    found = Candidates(x, design.problem(x))
    ends = judged(found.problem, criterion).prices(multipliers)
    return np.array([ends[j, np.equal(owner, j)].max() for j in range(len(multipliers))]), found


def _dearest(some: Candidates, prices: Array, T: Array, size: int) -> Array:
    """The dearest experiments (size, v) that differ from each other."""
    order = np.argsort(-prices, kind="stable")[: 100 * size]
    return some.x[order[distinct(some.problem.blocks(order), T, 0.1)[:size]]]


def distinct(blocks: Array, T: Array, tolerance: float) -> Indices:
    """Indices of blocks (k, p, p) that differ from every one before them that is kept.

    Poses that a symmetry of robot and load maps onto each other have the same information, whatever the symmetry.

    Args:
        blocks: Information of poses (k, p, p), the preferred ones first.
        T: What whitens the parameters (p, p).
        tolerance: Relative difference below which two are the same.
    """
    W = (T.T @ blocks @ T).reshape(len(blocks), -1)
    kept: list[int] = []
    for i, w in enumerate(W):
        if not kept or np.linalg.norm(W[kept] - w, axis=1).min() > tolerance * np.linalg.norm(w):
            kept.append(i)
    return np.array(kept, dtype=int)
