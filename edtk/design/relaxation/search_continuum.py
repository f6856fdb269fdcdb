"""The search over all poses for the largest sensitivities: where a design should measure next."""

import numpy as np

from criteria import Criterion
from criteria.linalg.estimable import range_whitener
from edtk.design.candidate_source import CandidateSource
from edtk.design.candidates import Candidates
from edtk.design.design_space import DesignSpace
from edtk.design.distinct import distinct
from edtk.design.relaxation.ascend import ascend
from edtk.design.relaxation.largest_sensitivities import LargestSensitivities
from edtk.design.relaxation.normalised import is_normalised, normalised
from edtk.system.typing import Array, Indices

SCREEN = 20_000  # fresh feasible poses among which starts are chosen
STARTS = 96  # ascents in all, shared out among the multipliers
MOST_STARTS = 16  # ascents from known poses per multiplier: more find nothing new
LEAST_STARTS = 6
# Designs of many parameters rest on more poses than these, and miss several of them at a time: of
# 35 parameters of geometry, searches of 16 ascents left a gap of 5 % after twenty rounds. Ten
# parameters or fewer, as compliances alone are, need no more.
STARTS_PER_PARAMETER = 4
WITHOUT_MORE = 6
# Ascents from fresh poses that no search has seen, in parts of those from known ones: the last
# search decides about the bound. With a third, bounds of a UR10 were 5e-4 too high for most seeds.
FROM_NEW = 3
OF_MANY = 3  # one of so many of many parameters, whose searches have many ascents anyway
DIFFERENT = 0.1  # relative difference of information from which on two starts are worth two ascents
# White noise gives mirrored and turned poses the same information, and one ascent is enough for all
# of them. A tracker and joints that repeat badly tell them apart by a few per cent: with the starts
# of white noise, one of six seeds missed a pose of a sensitivity larger by 1.7 %.
MORE = 2  # times as many ascents where noise is not white, half of them from fresh poses
LITTLE_DIFFERENT = 0.01
# Two dozen are the rule. A single start that creeps on made a search twice as long, and found what
# others had found already.
STEPS = 40
LIKE = 100  # poses that are looked at per start: most of the best ones are alike


def fresh_poses(space: DesignSpace, seed: tuple[int, ...]) -> Candidates:
    """Draw the feasible poses among which a search chooses starts."""
    return CandidateSource(space, seed).take(SCREEN)


def search_continuum(
    space: DesignSpace,
    criterion: Criterion,
    multipliers: Array,
    known: Candidates,
    accuracy: float,
    fresh: Candidates,
    is_new: bool,
) -> tuple[LargestSensitivities, Candidates]:
    """Ascend the sensitivity over all feasible poses, from the best of known and of fresh ones.

    Args:
        space: Model and feasible set.
        criterion: What the multipliers belong to.
        multipliers: Multipliers (r, p, p).
        known: Poses that the design may rest on.
        accuracy: Relative accuracy of a sensitivity at the end of an ascent.
        fresh: Random poses, see `fresh_poses`.
        is_new: Whether no search has seen these poses, so that more ascents begin at them.

    Returns:
        The largest sensitivities found, and all poses (b) where the ascents ended. A search proves
        nothing: a pose of larger sensitivity may exist.
    """
    white = space.noise is None
    starts, owner, unit = _starts(known, fresh, criterion, multipliers, white, is_new)
    # Objectives are of order one, whatever the size of a multiplier.
    Z = multipliers[owner] / unit[owner, None, None]
    per_trace = is_normalised(criterion)
    x = ascend(space, starts, Z, per_trace, accuracy=accuracy, steps=STEPS)
    found = Candidates(x, space.problem(x))
    return _largest_of_own(found, criterion, multipliers, owner), found


def _starts(
    known: Candidates,
    fresh: Candidates,
    criterion: Criterion,
    multipliers: Array,
    white: bool,
    is_new: bool,
) -> tuple[Array, Indices, Array]:
    """Where to ascend from: for each multiplier the best known and the best fresh poses.

    Returns:
        Starts (b, v), the index (b,) of the multiplier of each, and the size (r,) of a sensitivity
        to each multiplier.
    """
    T = range_whitener(known.problem.mean)
    most = max(MOST_STARTS, STARTS_PER_PARAMETER * (known.problem.p - WITHOUT_MORE))
    size = max(LEAST_STARTS, min(most, max(STARTS, most) // len(multipliers)))
    size = size if white else MORE * size
    of_fresh_poses = size
    if white and most > MOST_STARTS:
        of_fresh_poses = size // OF_MANY
    elif white and is_new:
        of_fresh_poses = FROM_NEW * size
    different = DIFFERENT if white else LITTLE_DIFFERENT
    starts: list[Array] = []
    owner: list[int] = []
    units: list[float] = []
    for j, Z in enumerate(multipliers):
        of_known = normalised(known.problem, criterion).sensitivities(Z)
        of_fresh = normalised(fresh.problem, criterion).sensitivities(Z)
        from_known = _most_sensitive(known, of_known, T, size, different)
        from_fresh = _most_sensitive(fresh, of_fresh, T, of_fresh_poses, different)
        starts += [from_known, from_fresh]
        owner += [j] * (len(from_known) + len(from_fresh))
        units.append(float(np.abs(of_known).max()))
    return np.concatenate(starts), np.array(owner), np.array(units)


def _largest_of_own(
    found: Candidates, criterion: Criterion, multipliers: Array, owner: Indices
) -> LargestSensitivities:
    """The largest sensitivity to each multiplier, among the ends of its own ascents."""
    ends = normalised(found.problem, criterion).sensitivities(multipliers)
    own = np.where(np.arange(len(multipliers))[:, None] == owner, ends, -np.inf)
    return LargestSensitivities.of(own, found.x)


def _most_sensitive(
    among: Candidates, sensitivities: Array, T: Array, size: int, different: float
) -> Array:
    """The experiments (size, v) of largest sensitivities (n,) that differ from each other."""
    order = np.argsort(-sensitivities, kind="stable")[: LIKE * size]
    chosen = distinct(among.problem.blocks(order), T, different, most=size)
    return among.x[order[chosen]]
