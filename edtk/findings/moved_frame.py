"""Whether the frame moved, a joint slipped or a weight hangs that nobody told, by residuals."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from edtk.findings.causes.family import Cause, Family
from edtk.findings.causes.faults import FAULTS, OF_KIND, USUAL_MOVE, USUAL_SLIP
from edtk.findings.fit_rows import (
    FitRows,
    NamedCause,
    SizedColumns,
    log_chance,
    lowered,
    own_columns,
)
from edtk.measure.few_columns import Beside
from edtk.measure.position_noise import PositionNoise
from edtk.robots.frames import MM
from edtk.system.typing import Array, Indices, Mask

# Of the squares, at least: a drift of the floor explains less. Equal weights make more of errors
# that the coordinates of a pose have in common, which are then as if fewer poses told something.
FRAME_EXPLAINS = {False: 0.2, True: 0.5}
FRAME_COORDINATES = {False: 3.0, True: 6.0}  # of a pose that err together
# Causes that have names of their own above, whatever part of the day they are in.
OF_THE_DAY = ("frame_moved", "drift", "growth", "joint_slipped")
MOST_OF_MISFIT = 0.7  # of the misfit, at least, that a fault explains which is there all day
# Of the length of what such a fault adds, that the parameters of the fit have to leave.
SEEN_BESIDE = 1e-4
# Probability that chance explains as much as such a fault, after all faults that were tried.
UNLIKELY_FAULT = 1e-4


@dataclass(frozen=True)
class UntoldWeights:
    """When a weight hangs that nobody told, and how its poses are searched."""

    # Probability that chance explains as much, after all parts of the day that were tried.
    unlikely: float = 1e-4
    explains: float = 0.5  # of the squares, at least: gears that are not round explain less
    # The same where poses with the weight were chosen by what they leave: of errors in one
    # direction the choice of those of one sign explains 2/pi, whatever they are, and a little more
    # of few.
    chosen_explains: float = 0.8
    coordinates: float = 3.0  # of a pose that err together
    usual_bend: float = 3.0  # of a joint under a weight, by a lever of a metre [mrad]
    sure: float = 2.0  # standard deviations by which a joint gives way
    # Of a stated load: a share of it that may be larger is not said to be none.
    hardly_loaded: float = 0.2
    like_none: float = 3.0  # standard deviations within which a share agrees with none
    fewest: int = 4  # poses with the weight, and without it
    starts: int = 6  # random ones of the search for poses with a weight
    rounds: int = 12  # of telling the weight and the poses, in turn
    same_load: float = 1e-6  # [m] a load that changes less from pose to pose tells nothing


WEIGHT = UntoldWeights()


@dataclass(frozen=True)
class MotionsOfFrame:
    """When a motion of the frame between two poses is one."""

    fewest: int = 2  # poses before, after and between
    # Probability that chance explains as much, after all pairs of poses that were tried.
    unlikely: float = 1e-6
    # Probability of a motion that the noise was fitted beside: of 200 sound days none had less.
    rare: float = 1e-2
    # Poses before and after such a motion: of fewer it may be that one is a wrong one.
    side: int = 4
    breaks: int = 30  # poses at which a motion that is taken back is tried first


FRAME = MotionsOfFrame()


@dataclass(frozen=True, eq=False)
class MovedFrame(SizedColumns):
    """A motion of the frame that explains a good part of the residuals.

    Attributes:
        first: The first pose (of the means, in order of the file) after it.
        end: The pose at which it was taken back; the number of poses where it was not.
        shift: How far positions are off after it, root mean square [m].
        explained: Share of the squared residuals that it explains.
    """

    first: int
    end: int
    shift: float
    explained: float


def moved_frame(rows: FitRows) -> MovedFrame | None:
    """Try a rigid motion of the frame between any two poses, and test the best.

    The motion has six parameters, whose columns B count from pose s to pose t. With residuals z of
    the fit and its columns X, both weighted, the squares fall by
    ``g' (B'B - B'X (X'X)^-1 X'B)^-1 g`` with ``g = B'z``; running sums give this for all s and t.
    The ratio to what is left has Fisher's distribution for one pair; the smallest probability
    counts as often as pairs are. The frame does not move back as a rule: motions to the end of the
    day are tried all, and others between some poses, and then near the best of these.

    Residuals are weighted by the noise that was fitted, and equally: a motion is part of what was
    fitted as noise, which may hide it. So the noise is fitted anew beside the motion that lowers
    the squares most, too, and then tells smaller ones. Whether errors that like poses share explain
    it `LikePoses` says.

    Args:
        rows: Of a sheet whose poses are in the order in which they were measured.
    """
    step = _Day(rows, rows.frame).step()
    if step is None:
        return None
    m = len(rows.residual)
    seen = rows.fit.data.means.seen[step.first : step.end].reshape(-1)
    off = step.added[step.first : step.end].reshape(-1, 3)[seen]
    shift = float(np.sqrt((off**2).sum(axis=-1).mean())) / MM
    ends = 1 if step.end == m else 2
    log_tries = ends * float(np.log(m))
    between = (step.first, step.end)
    return MovedFrame(step.columns, USUAL_MOVE * MM, log_tries, *between, shift, step.explained)


@dataclass(frozen=True, eq=False)
class SlippedJoint(SizedColumns):
    """A joint whose zero is another one from some pose on, which explains much of the residuals.

    Attributes:
        joint: Its name.
        first: The first pose (of the means, in order of the file) after it.
        size: By how much it is further than written then, in `unit`.
        unit: Unit of the size.
        explained: Share of the squared residuals that it explains.
        by: The same size [rad or m].
        also: What looks the same: "frame" of the first joint, "tool" of the last; or nothing.
    """

    joint: str
    first: int
    size: float
    unit: str
    explained: float
    by: float
    also: str

    def by_pose(self, pose: Indices) -> Array:
        """By how much it is further than written in poses of these numbers (k,) [rad or m]."""
        return np.where(pose >= self.first, self.by, 0.0)


def slipped_joint(rows: FitRows) -> SlippedJoint | None:
    """Try another zero of each joint from each pose on, as `moved_frame` tries motions, and test.

    Args:
        rows: Of a sheet whose poses are in the order in which they were measured.
    """
    joints = rows.scene.robot.joints
    steps = [_Day(rows, rows.motion[..., [j]]).step(back=False) for j in range(len(joints))]
    told = [(step, j) for j, step in enumerate(steps) if step is not None]
    if not told:
        return None
    step, j = max(told, key=lambda one: one[0].explained)
    joint = joints[j]
    unit, per_unit = OF_KIND[joint.kind]
    return SlippedJoint(
        step.columns,
        USUAL_SLIP[joint.kind] * MM,
        float(np.log(len(joints) * len(rows.residual))),
        joint.name,
        step.first,
        float(step.motion[0]) * per_unit / MM,
        unit,
        step.explained,
        float(step.motion[0]) / MM,
        "frame" if j == 0 else "tool" if j == len(joints) - 1 else "",
    )


def _best(day: "_Day", white: bool, back: bool) -> "_Step | None":
    """The motion that lowers the squares most, where chance does not explain it.

    Args:
        day: The poses.
        white: Whether all coordinates count alike.
        back: Whether it may be taken back.
    """
    m = len(day)
    dof = day.dof
    if m < 2 * FRAME.fewest or dof < 4:
        return None
    sums = day.sums(None if white else day.rows.noise)
    total = sums.total
    best = sums.best([(s, m) for s in range(FRAME.fewest, m - FRAME.fewest + 1)])
    tried = [(best, m)]
    if back:
        pairs = _pairs(m)
        between = sums.best(pairs) if pairs else best
        tried.append((sums.best(_near(between[1], between[2], m)), m * m))
    independent = max(dof / FRAME_COORDINATES[white], 1.0)
    judged = [
        (day.probability(fall, total, independent) * count, fall, s, t)
        for (fall, s, t), count in tried
    ]
    probability, fall, s, t = min(judged)
    if probability > FRAME.unlikely or fall < FRAME_EXPLAINS[white] * total:
        return None
    return day.between(s, t, sums.motion(s, t), fall / total)


def _beside_noise(day: "_Day") -> "_Step | None":
    """The motion to the end of the day, where it is large beside the noise that it leaves.

    A motion of half a millimetre amid errors of a robot of a third is fitted as noise, which then
    looks large enough to explain it. Fitted beside its columns, the noise is as without it.
    """
    m = len(day)
    if m < 2 * FRAME.side or day.dof < 4:
        return None
    _, s, _ = day.sums(day.rows.noise).best([(s, m) for s in range(FRAME.side, m - FRAME.side + 1)])
    after = day.sums(day.noise_beside(s))
    total = after.total
    fall, _, _ = after.best([(s, m)])
    independent = max(day.dof / FRAME_COORDINATES[False], 1.0)
    if (
        day.probability(fall, total, independent) * m > FRAME.rare
        or fall < FRAME_EXPLAINS[False] * total
    ):
        return None
    return day.between(s, m, after.motion(s, m), fall / total)


def _pairs(m: int) -> list[tuple[int, int]]:
    """Some poses between which a motion is tried, the day's ends left out."""
    breaks = np.unique(np.linspace(FRAME.fewest, m - 1, FRAME.breaks).astype(int)).tolist()
    return [(s, t) for s in breaks for t in breaks if t - s >= FRAME.fewest]


def _near(s: int, t: int, m: int) -> list[tuple[int, int]]:
    """Pairs near a pair, as near as the next that was tried, and itself."""
    step = max(m // FRAME.breaks, 1) + 1
    pairs = {(s, t)}
    for a in range(max(s - step, FRAME.fewest), min(s + step, m - FRAME.fewest) + 1):
        for b in range(max(t - step, a + FRAME.fewest), min(t + step, m) + 1):
            pairs.add((a, b))
    return sorted(pairs)


@dataclass(frozen=True, eq=False)
class _Sums:
    """Running sums over the poses, each before its pose.

    Attributes:
        total: The squares of the residuals, without what the columns explain.
        gradient: Sums of B'Wz (m + 1, c).
        square: Sums of B'WB (m + 1, c, c) of each visit by itself.
        along: Sums of what the columns take of B (m + 1, p, c), see `Beside.along`.
        pairs: What two visits of a pose add to the squares, where both are between.
    """

    total: float
    gradient: Array
    square: Array
    along: Array
    pairs: "_Pairs"

    @classmethod
    def of(cls, rows: FitRows, by: Beside, B: Array) -> "_Sums":
        """Of residuals and motions B (m, r, c), by the weights of a design."""
        # The fit has other weights, so that something is left along its own columns.
        z = by.left(rows.independent.residual[..., None])
        Wz = by.weights.times(z)
        each = B.reshape(*rows.same.worth.shape, -1)
        parts = [(own, one.reshape(B.shape)) for own, one in rows.same.one_by_one(each)]
        moved = [(own, np.swapaxes(E, 1, 2), by.weights.times(E)) for own, E in parts]
        m = len(B)
        return cls(
            float((z * Wz).sum()),
            _before(_added(m, [(own, (Et @ Wz)[..., 0]) for own, Et, _ in moved])),
            _before(_added(m, [(own, Et @ WE) for own, Et, WE in moved])),
            _before(_added(m, [(own, by.along(E)) for own, E in parts])),
            _Pairs.of(moved),
        )

    def _motions(self, s: Indices, t: Indices) -> tuple[Array, Array]:
        """Motions (k, c) from poses s to t (k,) that lower the squares most, and how much (k,)."""
        gradient = self.gradient[t] - self.gradient[s]
        square = self.square[t] - self.square[s] + self.pairs.between(s, t)
        return lowered(gradient, square, self.along[t] - self.along[s])

    def motion(self, s: int, t: int) -> Array:
        """The motion (c,) from pose s to pose t that lowers the squares most."""
        return self._motions(np.array([s]), np.array([t]))[0][0]

    def best(self, pairs: Sequence[tuple[int, int]]) -> tuple[float, int, int]:
        """The pair of poses between which a motion lowers the squares most: how much, and it."""
        s, t = np.array(pairs).T
        return max(zip(self._motions(s, t)[1].tolist(), s.tolist(), t.tolist(), strict=True))


def _added(m: int, terms: Sequence[tuple[Indices, Array]]) -> Array:
    """Sums (m, ...) by visit of terms of rows, each with the visit that it is of; -1 for none."""
    found = np.zeros((m, *terms[0][1].shape[1:]))
    for own, term in terms:
        np.add.at(found, own[own >= 0], term[own >= 0])
    return found


@dataclass(frozen=True, eq=False)
class _Pairs:
    """What two visits of a pose add to squares.

    Attributes:
        first: The earlier visits (n,).
        last: The later ones (n,).
        terms: What they add (n, c, c).
        since: The same of all whose first visit is none before each (m + 1, c, c).
    """

    first: Indices
    last: Indices
    terms: Array
    since: Array

    @classmethod
    def of(cls, moved: Sequence[tuple[Indices, Array, Array]]) -> "_Pairs":
        """Of rows E' (m, c, r) of the first visits, and the others, and W E: with their visits."""
        m, c, _ = moved[0][1].shape
        numbers, terms = [np.zeros((0, 2), dtype=int)], [np.zeros((0, c, c))]
        for i, (one, Et, _) in enumerate(moved):
            for other, _, WE in moved[i + 1 :]:
                both = np.flatnonzero(other >= 0)
                term = Et[both] @ WE[both]
                numbers.append(np.sort(np.stack([one[both], other[both]], axis=1)))
                terms.append(term + np.swapaxes(term, 1, 2))
        first, last = np.concatenate(numbers).T
        every = np.concatenate(terms)
        by_first = np.zeros((m + 1, c, c))
        np.add.at(by_first, first, every)
        return cls(first, last, every, np.cumsum(by_first[::-1], axis=0)[::-1])

    def between(self, s: Indices, t: Indices) -> Array:
        """What those add (k, c, c) of which both are from s to t (k,)."""
        found = self.since[s]
        m = len(self.since) - 1
        inner = np.flatnonzero(t < m)
        beyond = (self.first >= s[inner, None]) & (self.last >= t[inner, None])
        found[inner] -= np.tensordot(beyond.astype(float), self.terms, axes=1)
        return found


@dataclass(frozen=True, eq=False)
class _Step:
    """What moved at one pose, and perhaps back at another.

    Attributes:
        first: The first pose after it.
        end: The pose at which it was taken back; the number of poses where it was not.
        columns: Its columns (m, 3k, c), zero in all other poses.
        motion: Its size (c,).
        explained: Share of the squared residuals that it explains.
    """

    first: int
    end: int
    columns: Array
    motion: Array
    explained: float

    @property
    def added(self) -> Array:
        """What it adds (m, 3k) [mm]."""
        return self.columns @ self.motion


@dataclass(frozen=True, eq=False)
class _Day:
    """The poses of a day, in their order.

    Attributes:
        rows: Their residuals and columns.
        moved: Columns (m, 3k, c) of motions, of the frame or of a joint [mm a mm, mm a mrad].
    """

    rows: FitRows
    moved: Array

    def __len__(self) -> int:
        return len(self.moved)

    def step(self, back: bool = True) -> _Step | None:
        """The motion that explains most, where chance does not.

        Args:
            back: Whether it may be taken back.
        """
        found = [*(_best(self, white, back) for white in (False, True)), _beside_noise(self)]
        told = [one for one in found if one is not None]
        return max(told, key=lambda one: one.explained, default=None)

    @property
    def dof(self) -> int:
        """Coordinates that neither the fit nor a motion takes."""
        return self.rows.dof(self.moved.shape[2])

    def probability(self, fall: float, total: float, dof: float) -> float:
        """How likely chance lowers the squares as much between two given poses."""
        share = fall / max(total, 1e-300)
        return float(np.exp(log_chance(share, self.moved.shape[2], dof)))

    def noise_beside(self, s: int) -> PositionNoise:
        """The noise, fitted beside a motion from pose s on."""
        return self.rows.noise_beside(self.moved * (np.arange(len(self)) >= s)[:, None, None])

    def sums(self, noise: PositionNoise | None) -> _Sums:
        """Running sums of all, weighted by a noise, or equally where there is none."""
        return _Sums.of(self.rows, self.rows.weighed(noise), self.moved)

    def between(self, s: int, t: int, motion: Array, explained: float) -> _Step:
        """A motion (c,) from pose s to pose t."""
        pose = np.arange(len(self))
        columns = self.moved * ((pose >= s) & (pose < t))[:, None, None]
        return _Step(s, t, columns, motion, explained)


def _before(terms: Array) -> Array:
    """Sums (m + 1, ...) of all terms before each one, and of all."""
    return np.concatenate([np.zeros((1, *terms.shape[1:])), np.cumsum(terms, axis=0)])


@dataclass(frozen=True, eq=False)
class UntoldLoad(SizedColumns):
    """A weight, or one that is lacking, which explains a good part of the residuals.

    Attributes:
        joints: Names of the joints that give way.
        explained: Share of the squared residuals that this explains.
        loaded: Mask (m,) of the poses that are under it, or of those that lack a stated load.
        log_chance: Logarithm of the probability that chance explains as much.
    """

    joints: tuple[str, ...]
    explained: float
    loaded: Mask
    log_chance: float


def untold_load(rows: FitRows) -> UntoldLoad | None:
    """Try springs of all joints under a weight at the tool, and test those that give way.

    A weight W turns joint j by ``k_j W t_j(q)``, with t_j the torque of a unit force down at the
    tool: the columns are the motions by the joints times t_j, and ``k_j W`` is not negative. The
    noise is fitted anew beside them (see `moved_frame`), and the fall of the squares has to be
    improbable, and half of them with equal weights. The weight of the links bends joints much the
    same way, so that both are meant.

    The weight may hang there in all poses, from one on or up to it, in every other one, or in any
    that the residuals tell. The probability counts as often as there are ways to choose them.

    Args:
        rows: Of positions without springs among its parameters.
    """
    torque = _of_unit_weight(rows)
    every = np.ones(len(torque), dtype=bool)
    return _likeliest(rows, torque, every, [(every, 0.0, WEIGHT.explains)])


def _of_unit_weight(rows: FitRows) -> Array:
    """Torques (m, n) of a unit force down at the tool [N m/N]."""
    frames = rows.scene.robot.frames(rows.scene.q, ())
    return -frames.folded(frames.linear_of_each)[:, 2].T


def lost_load(rows: FitRows) -> UntoldLoad | None:
    """Try the same with minus the torques of the stated load, which visits were not under.

    Springs that all visits tell are too stiff then: each ``k_j`` is free, and not negative. Which
    visits had no load is told among those that are under one. Other loads than stated, and springs
    of another law, leave much the same: nothing is said unless the load lacks as a whole.

    Args:
        rows: Of positions with springs among its parameters.
    """
    q, wrench = rows.scene.q, rows.scene.wrench
    under, alone = (rows.fit.fitted.torque(q, own, rows.loads) for own in (wrench, 0 * wrench))
    if under is None or alone is None:
        return None
    n = rows.motion.shape[2]
    of_load = (alone.torque - under.torque)[:, :n]
    found = _likeliest(rows, of_load, np.asarray(wrench.any(axis=1)), [])
    if found is None or not _is_whole(rows, under.torque[:, :n], of_load, found):
        return None
    return found


def _is_whole(rows: FitRows, under: Array, of_load: Array, found: UntoldLoad) -> bool:
    """Whether visits that lack a part of their load lack all of it.

    Springs k bend joints under the torques without that load, and springs d under the load where it
    may be lacking. They are fitted anew, both free: ``d_j / k_j`` is the share of the load that
    acts on joint j. With the k so found, ``d = f k`` tells one share f of all joints. Each d_j, and
    f, have to agree with zero, and f to be known well enough.

    Args:
        rows: The residuals.
        under: Torques (m, n) of all that is stated [N m].
        of_load: Minus those of the load.
        found: The visits that may lack it.
    """
    fitted = rows.fit.fitted
    sprung = np.flatnonzero(fitted.compliances)
    own = np.array([one.place == "compliance" for one in fitted.model.parameters])
    others = own_columns(rows.fit, rows.loads).in_units(np.where(own, 0.0, 1.0)).independent()
    lacking = np.where(found.loaded[:, None], of_load, 0.0)
    bent, without, load = (
        (rows.motion * torque[:, None])[..., sprung]
        for torque in (under, under + lacking, -lacking)
    )
    whole = rows.residual + bent @ (MM * fitted.compliances[sprung])
    rows = replace(rows, residual=whole, design=others)
    free = np.concatenate([without, load], axis=-1)
    by = rows.weighed(rows.noise_beside(free))
    each = rows.explained(free, by)
    k, d = np.split(each.values, 2)
    alike = rows.explained(np.concatenate([without, (load @ k)[..., None]], axis=-1), by)
    share, std = abs(float(alike.values[-1])), float(alike.std[-1])
    is_none = (
        share < WEIGHT.like_none * std and (np.abs(d) < WEIGHT.like_none * each.std[len(k) :]).all()
    )
    return bool(is_none and share + WEIGHT.sure * std < WEIGHT.hardly_loaded)


def _likeliest(
    rows: FitRows, torque: Array, among: Mask, parts: list[tuple[Mask, float, float]]
) -> UntoldLoad | None:
    """The likeliest part of the day that is under torques (m, n), of some and those it tells.

    Args:
        rows: The residuals.
        torque: Of springs of size one.
        among: Which poses (m,) may be under them.
        parts: Parts of the day, see `_parts_of_day`.
    """
    turned = np.flatnonzero(np.ptp(torque, axis=0) > WEIGHT.same_load)
    if not len(turned) or rows.dof(len(turned)) < len(turned):
        return None
    bent = rows.motion * torque[:, None]
    # Of a weight at the tool, in the units of these torques.
    under = torque.any(axis=1)
    lever = np.linalg.norm(_of_unit_weight(rows)[under])
    usual = WEIGHT.usual_bend * float(lever / np.linalg.norm(torque))
    parts = parts + _parts_of_day(rows, bent[..., turned], among)
    told = [_judged(rows, bent, turned, usual, *one) for one in parts]
    found = [one for one in told if one is not None]
    return min(found, key=lambda one: one.log_chance, default=None)


def _judged(
    rows: FitRows,
    bent: Array,
    turned: Indices,
    usual: float,
    loaded: Mask,
    log_tries: float,
    least: float,
) -> UntoldLoad | None:
    """A weight in some poses, where it explains enough and chance does not."""
    bent = bent * loaded[:, None, None]
    noise = rows.noise_beside(bent[..., turned])
    every = rows.explained(bent[..., turned], rows.weighed(noise))
    giving = turned[every.values > WEIGHT.sure * every.std]
    if not len(giving):
        return None
    columns = bent[..., giving]
    explained, chance = shares_of(rows, columns, noise)
    chance += log_tries
    if explained < least or chance > np.log(WEIGHT.unlikely):
        return None
    names = tuple(rows.scene.robot.joint_names[j] for j in giving)
    return UntoldLoad(columns, usual, log_tries, names, explained, loaded, chance)


def shares_of(rows: FitRows, columns: Array, noise: PositionNoise) -> tuple[float, float]:
    """Share of the squares that columns explain, all coordinates alike, and how likely by chance.

    Args:
        rows: The residuals.
        columns: The columns (m, 3k, c).
        noise: The noise that was fitted beside them.

    Returns:
        The share, and the logarithm of the probability that chance explains as much in units of the
        noise.
    """
    found = rows.explained(columns, rows.weighed(noise)).share
    explained = rows.explained(columns, rows.weighed(None)).share
    count = columns.shape[-1]
    independent = max(rows.dof(count) / WEIGHT.coordinates, 1.0)
    return explained, log_chance(found, count, independent)


def _parts_of_day(rows: FitRows, bent: Array, among: Mask) -> list[tuple[Mask, float, float]]:
    """Masks (m,) of poses that a weight may load, of those (m,) that may be under it.

    Returns:
        The masks, logarithms of how many such there are, and the share that each has to explain.
    """
    m = int(among.sum())
    if m < 2 * WEIGHT.fewest:
        return []
    # The poses that may be under it by number, and -1 for all others.
    each = np.where(among, among.cumsum() - 1, -1)
    turns = [among & (each % 2 == i) for i in (0, 1)]
    breaks = range(WEIGHT.fewest, m - WEIGHT.fewest + 1)
    halves = [mask & among for s in breaks for mask in (each >= s, each < s)]
    day = _LoadedPoses.of(rows, bent)
    half = min(halves, key=day.left)
    turn = min(turns, key=day.left)
    rng = np.random.default_rng(0)
    starts = [half, turn, *(among & (rng.random((WEIGHT.starts, len(among))) < 0.5))]
    free = min((day.settled(start, among) for start in starts), key=day.left)
    found = [
        (one, float(np.log(tries)), WEIGHT.explains)
        for one, tries in ((half, len(halves)), (turn, len(turns)))
    ]
    if WEIGHT.fewest <= free.sum() <= m - WEIGHT.fewest:
        found.append((free, m * float(np.log(2.0)), WEIGHT.chosen_explains))
    return found


@dataclass(frozen=True, eq=False)
class _LoadedPoses:
    """Residuals, and what a weight in some poses leaves of them.

    Attributes:
        z: What the fit leaves of residuals (m, r).
        C: Columns (m, r, c) of a weight.
        rows: The residuals.
        by: The design, all readings alike.
    """

    z: Array
    C: Array
    rows: FitRows
    by: Beside

    @classmethod
    def of(cls, rows: FitRows, C: Array) -> "_LoadedPoses":
        """Of residuals, and columns (m, r, c) of a weight in all poses."""
        by = rows.weighed(None)
        return cls(rows.left(rows.residual[..., None], by)[..., 0], C, rows, by)

    def _apart(self, loaded: Mask) -> tuple[Array, Array]:
        """Residuals (m, r) with a weight in some poses, and its size (c,), none below zero."""
        from scipy.optimize import nnls

        left = self.rows.left(self.C * loaded[:, None, None], self.by)
        # Of as many rows as columns: the squares fall by as much.
        q, r = np.linalg.qr(left.reshape(-1, left.shape[-1]))
        size = nnls(r, q.T @ self.z.reshape(-1))[0]
        return self.z - left @ size, size

    def left(self, loaded: Mask) -> float:
        """Sum of squares."""
        return float((self._apart(loaded)[0] ** 2).sum())

    def settled(self, loaded: Mask, among: Mask) -> Mask:
        """The poses (m,) of some that fit better under the weight, told in turn with its size."""
        for _ in range(WEIGHT.rounds):
            apart, size = self._apart(loaded)
            bend = self.C @ size
            without = apart + bend * loaded[:, None]
            after = among & (((without - bend) ** 2).sum(axis=1) < (without**2).sum(axis=1))
            if (after == loaded).all():
                break
            loaded = after
        return loaded


def other_causes(rows: FitRows) -> list[NamedCause]:
    """Try every fault of the registry that can be seen, in all poses, and test those that explain.

    What lies in the model is no fault: a zero of a joint that is fitted takes up all that it does.
    The noise is fitted anew beside the columns of each (see `moved_frame`). The fall of the squares
    has to be improbable, after all that were tried, and most of the misfit, which is what readings
    leave beyond the noise: errors of a drawing that nobody asked for look a little like any fault.

    Args:
        rows: Residuals of a fit.
    """
    scene = rows.scene
    families = [
        family
        for fault in FAULTS.values()
        if fault.name not in OF_THE_DAY
        for family in scene.families(fault.models)
    ]
    read = rows.weighed(
        replace(
            rows.noise,
            model_white=0.0,
            model_joints=np.zeros(0),
            model_fit=None,
            model_change=(0.0, 0.0),
        )
    )
    alike = rows.weighed(None)
    log_tries = float(np.log(len(families)))
    each = (_explaining(rows, family, read, alike, log_tries) for family in families)
    return [named for named in each if named is not None]


def _explaining(
    rows: FitRows, family: Family, read: Beside, alike: Beside, log_tries: float
) -> NamedCause | None:
    """A fault with its size and its chance.

    Args:
        rows: Residuals of a fit.
        family: The fault.
        read: The residuals by what readings err by.
        alike: The same where all count alike.
        log_tries: Logarithm of the number of faults that are tried.

    Returns:
        The fault; None where it cannot be seen, or does not explain the misfit.
    """
    columns = family.derivative_at_zero(rows.scene.k)
    size = max(float(np.linalg.norm(columns)), 1e-300)
    left = float(np.linalg.norm(rows.left(columns, alike))) / size
    if left < SEEN_BESIDE or rows.dof(family.dims) < 2 * family.dims:
        return None
    # The noise is fitted anew for those alone that explain enough.
    alone = rows.explained(columns, read)
    misfit = alone.fall / alone.share - rows.dof(0) if alone.share > 0 else 0.0
    if misfit <= 0 or alone.fall < MOST_OF_MISFIT * misfit:
        return None
    noise = rows.noise_beside(columns)
    chance = shares_of(rows, columns, noise)[1] + log_tries
    if chance > np.log(UNLIKELY_FAULT):
        return None
    told = rows.explained(columns, rows.weighed(noise))
    size = float(told.values[0] if family.dims == 1 else np.linalg.norm(told.values))
    if family.only_positive and size < 0:
        return None
    along = told.values / max(abs(size), 1e-300)
    cause = Cause(
        family.cause,
        size * family.per_unit,
        family.unit,
        float(np.sqrt(along @ told.covariance @ along)) * family.per_unit,
        float(np.exp(min(chance, 0.0))),
        min(1.0, alone.fall / misfit),
        family.joint,
    )
    return NamedCause(columns, family.usual, log_tries, cause, family, told.values)
