"""The search over all poses for the largest sensitivities: where a design should measure next."""

from collections.abc import Generator, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from criteria import Criterion
from criteria.linalg.estimable import range_whitener
from edtk.design.candidate_source import Candidates, CandidateSource
from edtk.design.design_space import DesignSpace, Points, Space
from edtk.design.information import distinct
from edtk.design.interior_point.descend import descend
from edtk.design.interior_point.held import with_fewer
from edtk.design.interior_point.objective import Local, Neighbourhood, Objective
from edtk.design.relaxation.proof import is_normalised, normalised
from edtk.system.time_limit import out_of_time, time_left
from edtk.system.typing import Array, Indices
from edtk.system.workers import THIS_PROCESS, Workers

ASCENT_STEPS = 200
ASCENT_BARRIER = 0.1  # larger than for plans: one experiment is worth more than each of many
# Chunks of samples that a worker looks at before it answers, which takes about a second, and how
# many such stretches a worker is given before what they found is joined: one where time is limited.
STRETCH = 128
AHEAD = 8
FULL = 4  # times the number to keep: a choice among so many costs less than holding them
SCREEN = 20_000  # fresh feasible poses among which starts are chosen
STARTS = 96  # ascents in all, shared out among the multipliers
MOST_STARTS = 16  # ascents from known poses per multiplier: more find nothing new
LEAST_ASCENTS = 6
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
# Those of a search on the way to the bound, which the last one of poses that no search has seen
# decides: of late ends there some changed it by 3 %, and here all by less than 1e-5.
ON_THE_WAY = 20
# Starts among fresh poses for each set of markers that are read together, and sets at most. Without
# them two of three seeds missed a pose of a sensitivity larger by 2 %. Of poses that no search has
# seen there are more: eight alike in each set left a plan in a cell 0.2 % worse, and sixteen that
# differ one of four, whose best pose lay in a set of one pose in 160.
OF_A_SET = 4
OF_A_NEW_SET = 64
MOST_SETS = 16
# Starts anywhere among fresh poses that no search has seen, where the model errs by a share of what
# it says. What friction holds is told best where several joints bear small loads, and the peaks are
# narrow: of 2,000 ascents from anywhere 16 ended in the highest, and of the most sensitive fresh
# poses none was near it. Bounds were 0.04 to 0.8 % too high.
ANYWHERE = 512
LIKE = 100  # poses that are looked at per start: most of the best ones are alike


@dataclass(frozen=True, eq=False)
class Sensitivity(Objective):
    """Minus the sensitivity of one experiment, as an objective to be minimised.

    Attributes:
        Z: The multiplier of each start (n, p, p).
        per_trace: See `sensitivity_and_slope`.
    """

    Z: Array
    per_trace: bool

    def value(self, here: Points, start: Indices) -> Array:
        """Minus the sensitivities (b,) of experiments (b, 1)."""
        return -sensitivity_and_slope(here, self.Z[start], self.per_trace)[0][:, 0]

    def local(self, near: Neighbourhood, start: Indices) -> Local:
        """Minus the sensitivities with slopes and curvature; one experiment has no partners."""
        value, slope = sensitivity_and_slope(near.experiments, self.Z[start], self.per_trace)
        slope = -near.first(slope)
        own = near.second(slope)
        together = np.zeros_like(own[:, 0])
        return Local(-value[0, :, 0], slope[0], own, together)


def sensitivity_and_slope(here: Points, Z: Array, per_trace: bool = False) -> tuple[Array, Array]:
    """Sensitivities ``<Z, M(x)>`` of experiments x, and their derivatives.

    With ``M(x) = M0 + A' A`` of whitened rows A the differential is ``d<Z, M> = 2 <A Z, dA>``. Per
    trace the sensitivity is ``<Z, M>/trace(M)``, with the quotient rule.

    Args:
        here: Points (..., b, k).
        Z: Multipliers (b, p, p), one for each row of experiments.
        per_trace: Whether to divide by ``trace M(x)``: for criteria of degree zero.

    Returns:
        Sensitivities (..., b, k) and slopes (..., b, k, v) by the design variables.
    """
    A = here.regressor
    AZ = A @ Z[:, None]
    prior = here.space.prior
    # From the rows: the matrices of many parameters cost several times as much as their products.
    value = (AZ * A).sum(axis=(-2, -1))
    if prior is not None:
        value = value + np.tensordot(Z, prior, 2)[:, None]
    slope = here.slope(2 * AZ)
    if not per_trace:
        return value, slope
    trace = (A * A).sum(axis=(-2, -1))
    if prior is not None:
        trace = trace + np.trace(prior)
    trace_slope = here.slope(2 * A)
    # An experiment that tells nothing has no direction either; its sensitivity counts as zero.
    trace = np.where(trace > 0, trace, 1.0)
    value = value / trace
    return value, (slope - value[..., None] * trace_slope) / trace[..., None]


def ascend(
    space: Space,
    x: Array,
    Z: Array,
    per_trace: bool = False,
    unit: float = 1.0,
    accuracy: float = 1e-6,
    steps: int = ASCENT_STEPS,
) -> Array:
    """Move experiments uphill to a local maximum of the sensitivity, each under its own multiplier.

    Args:
        space: Feasible set and movable variables.
        x: Feasible starts (b, v).
        Z: Multipliers (b, p, p).
        per_trace: Whether sensitivities are per trace, see `sensitivity_and_slope`.
        unit: The size of a sensitivity.
        accuracy: Accuracy of the sensitivity at the end, in that unit.
        steps: Limit on steps.

    Returns:
        Feasible experiments (b, v), no less sensitive than the starts.
    """
    objective = Sensitivity(Z / unit, per_trace)
    ends = descend(space, x[:, None], objective, steps, accuracy, ASCENT_BARRIER)
    return ends[:, 0]


@dataclass(frozen=True, eq=False)
class LargestSensitivities:
    """The numbers from which a bound follows, together with the multipliers.

    Attributes:
        values: The largest sensitivity (r,) to each multiplier, of the normalised problem.
        x: Design variables (r, v) of the experiments that have it.
    """

    values: Array
    x: Array

    @classmethod
    def of(cls, sensitivities: Array, x: Array) -> "LargestSensitivities":
        """The largest of sensitivities (r, n) of experiments (n, v)."""
        where = sensitivities.argmax(axis=-1)
        return cls(sensitivities[np.arange(len(where)), where], x[where])

    @classmethod
    def over(
        cls, candidates: Candidates, criterion: Criterion, multipliers: Array
    ) -> "LargestSensitivities":
        """The largest sensitivities of candidates (n) to multipliers (r, p, p)."""
        problem = normalised(candidates.problem, criterion)
        return cls.of(problem.sensitivities(multipliers), candidates.x)

    def or_larger(self, others: "LargestSensitivities") -> "LargestSensitivities":
        """The larger one of two, for each multiplier."""
        keeps = self.values >= others.values
        return LargestSensitivities(
            np.maximum(self.values, others.values), np.where(keeps[:, None], self.x, others.x)
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        return {"values": self.values.tolist(), "x": self.x.tolist()}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> "LargestSensitivities":
        """Restore an object that `to_dict` has written, bit by bit."""
        return cls(np.array(data["values"]), np.array(data["x"]))


class PassCutOffError(Exception):
    """The time ended a pass over candidates: the largest sensitivity is not known."""


def sweep_candidates(
    source: CandidateSource,
    n: int,
    criterion: Criterion,
    multipliers: Array,
    keep: int,
    workers: Workers = THIS_PROCESS,
) -> tuple[LargestSensitivities, Candidates]:
    """Generate candidates anew, chunk by chunk, and keep those of largest sensitivity.

    Args:
        source: Where the candidates come from.
        n: Number of candidates.
        criterion: What the multipliers belong to.
        multipliers: Multipliers (r, p, p).
        keep: Number of candidates to keep for each multiplier.
        workers: The processes that do it; of one, the threads of this process.

    Returns:
        The largest sensitivities of all n candidates, and the candidates that are kept.

    Raises:
        PassCutOffError: The time is over (`time_limit`).
    """
    sweep = Sweep(source, criterion, multipliers, keep)
    parts = source.chunks(n) if workers.size == 1 else sweep.of_workers(n, workers)
    with closing(parts):
        _, kept = sweep.most_sensitive(_in_time(parts))
    assert kept is not None
    # The most sensitive of all are among those that are kept.
    return LargestSensitivities.over(kept, criterion, multipliers), kept


def _in_time(parts: Iterable[Candidates]) -> Iterator[Candidates]:
    """The parts, as long as there is time.

    Raises:
        PassCutOffError: There is none.
    """
    for part in parts:
        if out_of_time():
            raise PassCutOffError
        yield part


@dataclass(frozen=True, eq=False)
class Sweep:
    """A pass over candidates that are too many to be held, see `sweep_candidates`."""

    source: CandidateSource
    criterion: Criterion
    multipliers: Array
    keep: int

    def most_sensitive(self, parts: Iterable[Candidates]) -> tuple[int, Candidates | None]:
        """The number of candidates, and those of largest sensitivity; None without any."""
        count = 0
        kept: Candidates | None = None
        # What a candidate must exceed to be among those to keep, by multiplier.
        least = np.full(len(self.multipliers), -np.inf)
        for part in parts:
            count += len(part.x)
            promising = np.flatnonzero((self._of(part) > least[:, None]).any(axis=0))
            if not promising.size:
                continue
            kept = part[promising] if kept is None else kept + part[promising]
            if len(kept.x) > FULL * self.keep * len(self.multipliers):
                chosen, least = most_sensitive(self._of(kept), self.keep)
                kept = kept[chosen]
        return count, None if kept is None else kept[most_sensitive(self._of(kept), self.keep)[0]]

    def _of(self, candidates: Candidates) -> Array:
        """Sensitivities (r, k) of candidates."""
        return normalised(candidates.problem, self.criterion).sensitivities(self.multipliers)

    def of_workers(self, n: int, workers: Workers) -> Generator[Candidates, None, None]:
        """The most sensitive of each stretch of the first n candidates, in their order.

        How many a stretch has is known only afterwards: the last one is cut to what is missing.
        """
        left = n
        first = done = found = 0
        ahead = AHEAD if np.isinf(time_left()) else 1
        while left > 0:
            # Nothing is known of the first stretches; what others hold is much alike.
            wanted = workers.size if not found else -(-left * done // found)
            number = min(max(1, wanted), ahead * workers.size)
            pieces = [Stretch(self, first + STRETCH * i, left) for i in range(number)]
            answers = sorted(workers.run(pieces), key=lambda one: one[0])
            for piece, (_, (count, kept)) in zip(pieces, answers, strict=True):
                if count > left:
                    count, kept = replace(piece, most=left)()
                left -= count
                done += 1
                found += count
                if kept is not None:
                    yield kept
                if left <= 0:
                    break
            first += STRETCH * number


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch of a pass, whose answer depends on its attributes alone, wherever it is found.

    Attributes:
        sweep: The pass.
        first: Index of its first chunk.
        most: Number of candidates, of which there are no more than its chunks hold.
    """

    sweep: Sweep
    first: int
    most: int

    def __call__(self) -> tuple[int, Candidates | None]:
        """The number of its candidates, and the most sensitive ones."""
        return self.sweep.most_sensitive(self._parts())

    def _parts(self) -> Iterator[Candidates]:
        left = self.most
        for part in self.sweep.source.stretch(self.first, STRETCH):
            yield part if len(part.x) <= left else part[np.arange(left)]
            left -= len(part.x)
            if left <= 0:
                return


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
    white = space.noise is None and space.sight is None
    starts, owner, unit = _starts(known, fresh, criterion, multipliers, white, is_new)
    if space.sight is not None:
        from_sets, of = _of_each_set(space, fresh, criterion, multipliers, is_new)
        starts, owner = np.concatenate([starts, from_sets]), np.concatenate([owner, of])
    if is_new and space.noise is not None and space.noise.error is not None:
        starts, owner = _and_anywhere(fresh, starts, owner, len(multipliers))
    # The most sensitive poses of all are those of a set of markers, too.
    starts_of = np.concatenate([owner[:, None], starts], axis=1)
    once = np.sort(np.unique(starts_of, axis=0, return_index=True)[1])
    starts, owner = starts[once], owner[once]
    # Objectives are of order one, whatever the size of a multiplier.
    Z = multipliers[owner] / unit[owner, None, None]
    per_trace = is_normalised(criterion)
    steps = STEPS if is_new else ON_THE_WAY
    x = ascend(space, starts, Z, per_trace, accuracy=accuracy, steps=steps)
    found = Candidates(x, space.problem(x))
    best = _best_of_own(found, criterion, multipliers, owner)
    fewer = with_fewer(space, x[best])
    if fewer is not None:
        held, begun, of = fewer
        which = best[of]
        ends = ascend(held, begun, Z[which], per_trace, accuracy=accuracy, steps=steps)[:, :-1]
        x, owner = np.concatenate([x, ends]), np.concatenate([owner, owner[which]])
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
    size = max(LEAST_ASCENTS, min(most, max(STARTS, most) // len(multipliers)))
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


def _of_each_set(
    space: DesignSpace,
    fresh: Candidates,
    criterion: Criterion,
    multipliers: Array,
    is_new: bool,
) -> tuple[Array, Indices]:
    """Fresh poses of each set of instruments that are read together, and their owners.

    Each set has local maxima of its own, and one of few markers is rarely among the best poses.
    Half of a set's starts are its best ones that differ, the others as they were drawn.
    """
    T = range_whitener(fresh.problem.mean)
    sets = _sets(space, fresh)
    of_fresh = normalised(fresh.problem, criterion).sensitivities(multipliers)
    best_of_set = np.full(int(sets.max()) + 1, -np.inf)
    np.maximum.at(best_of_set, sets, of_fresh.max(axis=0))
    most = OF_A_NEW_SET if is_new else OF_A_SET
    half = max(1, most // (2 * len(multipliers)))
    starts: list[Array] = []
    owner: list[int] = []
    for own in np.argsort(-best_of_set, kind="stable")[:MOST_SETS]:
        members = np.flatnonzero(sets == own)
        among = fresh[members]
        for j, told in enumerate(of_fresh[:, members]):
            best = _most_sensitive(among, told, T, half, LITTLE_DIFFERENT)
            chosen = np.concatenate([best, among.x[:half]])
            starts.append(chosen)
            owner += [j] * len(chosen)
    return np.concatenate(starts), np.array(owner)


def _sets(space: DesignSpace, fresh: Candidates) -> Indices:
    """Which instruments fresh poses (n,) read together, as a number; found once for all turns."""
    assert space.sight is not None
    if fresh not in _known_sets:
        seen = space.sight.seen(fresh.x[:, : space.sight.robot.n])
        _known_sets[fresh] = np.unique(seen, axis=0, return_inverse=True)[1].reshape(-1)
    return _known_sets[fresh]


_known_sets: WeakKeyDictionary[Candidates, Indices] = WeakKeyDictionary()


def _and_anywhere(
    fresh: Candidates, starts: Array, owner: Indices, count: int
) -> tuple[Array, Indices]:
    """Starts, and fresh poses as they were drawn, for each of so many multipliers in turn."""
    anywhere = fresh.x[:ANYWHERE]
    others = np.arange(len(anywhere)) % count
    return np.concatenate([starts, anywhere]), np.concatenate([owner, others])


def _best_of_own(
    found: Candidates, criterion: Criterion, multipliers: Array, owner: Indices
) -> Indices:
    """Indices of the few best ends of each multiplier's own ascents."""
    ends = normalised(found.problem, criterion).sensitivities(multipliers)
    order = np.argsort(-ends[owner, np.arange(len(owner))], kind="stable")
    return np.concatenate(
        [order[owner[order] == j][:LEAST_ASCENTS] for j in range(len(multipliers))]
    )


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
    parts = (order[i : i + LIKE] for i in range(0, len(order), LIKE))
    blocks = (block for part in parts for block in among.problem.blocks(part))
    chosen = distinct(blocks, T, different, most=size)
    return among.x[order[chosen]]
