"""How much a model of springs leaves out, as far as a sheet tells it: sizes by their likelihood."""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import comb

import numpy as np

from criteria.linalg.inverse import eigenpairs
from edtk.fit.correlated_noise import RowNoise, groups_by_size, whiten_columns, whole_groups
from edtk.measure.friction import scatter
from edtk.measure.missing_pieces import SPREAD_ACROSS, PieceColumns, PossibleSprings
from edtk.measure.model_error import ASSUMED
from edtk.system.typing import Array, Indices, Mask

# Shares that a piece may have: nothing, or a size on a scale of factors of two.
SIZES = np.array([0.0, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32])
# What is known before a sheet: one arm in two has no stiffness that varies; no gear is without
# friction, but one in four has so little that it does not count; where springs across are, see
# `Places`. Where a piece is there its share is a tenth, exponentially distributed. Bearings and
# links add a tenth to a third to what gears give, friction holds some per cent to a sixth of a
# load, and stiffnesses vary by a tenth with position. With one half for friction, too, a sheet that
# tells it at 2.3 standard deviations was taken for one of ideal springs (kept_promises.py).
ABSENT = np.array([0.0, 0.25, 0.5])
ACROSS = scatter(SPREAD_ACROSS)  # standard deviation of shares across of mean square one
GROUPS = 7  # of joints, each of which may have springs across: their places are all counted up
# Sizes and places that stand for all that are left possible, each of the same probability, at most.
# The error promised is then 4 % off that of 3000 of them, root mean square over 72 sheets, and 5 %
# with 24 (kept_promises.py).
KEPT = 48


def prior_of_sizes(usual: float = ASSUMED) -> Array:
    """Probabilities (3, sizes) of `SIZES`, each of which stands for what is nearer by logarithms.

    Args:
        usual: Share that a piece has on average, where it is there.

    Returns:
        Those of springs across where there are some, of what friction holds, and of turns.
    """
    between = np.sqrt(SIZES[1:-1] * SIZES[2:])
    edges = np.concatenate([[0.0], between, [np.inf]])
    there = np.outer(1 - ABSENT, np.diff(-np.exp(-edges / usual)))
    return np.column_stack([ABSENT, there])


@dataclass(frozen=True, eq=False)
class Places:
    """Where springs across may be: at some joints and not at others, or all along the arm.

    A bearing that tilts says nothing of the next one. With one size for all, joints that a sheet
    shows to be sound would vouch for those that it does not show. So the springs are across some
    joints, and of one size there; or links bend, which is springs across all joints and in the
    middles of links. What share of the joints it is nobody knows before: each number of them, none
    and all along included, is as likely, and all choices of a number are alike. That is the prior
    of Scott and Berger (2010), by which many places are no evidence for springs in one of them.
    Where each number of n joints is as likely, so is each number of any some of them: a joint that
    no reading shows changes nothing of the others, and keeps the chance that they leave it.

    Attributes:
        masks: Columns (w, a) that are there; none of them first.
        chances: Probabilities (w,).
    """

    masks: Mask
    chances: Array

    @classmethod
    def of(cls, joints: Indices, n: int) -> "Places":
        """The places of columns.

        Args:
            joints: The joint (a,) that each is across, or n for the middle of a link.
            n: Number of joints. Where more than `GROUPS` have columns, neighbours go together.
        """
        across = joints < n
        each, number = np.unique(joints[across], return_inverse=True)
        count = min(len(each), GROUPS)
        there = np.array(list(product((False, True), repeat=count)))
        masks = np.zeros((len(there), len(joints)), dtype=bool)
        masks[:, across] = there[:, number * count // len(each)]
        ways = [comb(count, int(number)) for number in there.sum(axis=1)]
        if not across.all():
            masks = np.vstack([masks, np.ones_like(masks[:1])])
            ways.append(1)
        chances = 1 / np.array(ways)
        return cls(masks, chances / chances.sum())


@dataclass(frozen=True, eq=False)
class MissingColumns:
    """What readings show of all that a model may leave out, for shares of one.

    Attributes:
        pieces: Columns of the pieces in all measurements (m,).
        pose: Number (m,) of each measurement's pose and load, from 0.
        known: Columns (m, rows, e) of what else is uncertain, by one standard deviation each.
    """

    pieces: PieceColumns
    pose: Indices
    known: Array

    def __getitem__(self, rows: Indices) -> "MissingColumns":
        """Those of some measurements."""
        pose = np.unique(self.pose[rows], return_inverse=True)[1]
        return MissingColumns(self.pieces[rows], pose, self.known[rows])


@dataclass(frozen=True, eq=False)
class _Sums:
    """Products of whitened columns and readings, with the turns of one size taken as noise.

    Attributes:
        G: Of regressors, readings, springs across, what friction of each size holds, and what else
            is uncertain (w, w), in that order.
        log_V: Logarithm of the determinant of the noise.
    """

    G: Array
    log_V: float


@dataclass(frozen=True, eq=False)
class SizeLikelihood:
    """The restricted likelihood of what a model leaves out, and the springs for each size.

    With the regressors A, errors of the model ``U S v`` of scales S and shares v of mean m and
    variance one, see `SizePosterior.scales`, and the covariance R of noise and turns, Henderson's
    equations (1950) give springs and shares at once:

        M = [[I + S U'R^-1 U S, S U'R^-1 A], [A'R^-1 U S, A'R^-1 A]],
        -2 log L = log |R| + log |M| + y'R^-1 y + m'm - b'M^-1 b,
        b = [m + S U'R^-1 y, A'R^-1 y],

    which is the likelihood of Patterson and Thompson (1971), and ``M^-1`` is the covariance of
    their errors. What else is uncertain of the day is a part of R, with its known size.

    Attributes:
        sums: One for each size of the turns.
        pieces: Columns of the pieces, of no measurements.
        scale: Sizes (p,) of the regressors, by which they are divided.
        usual: Share that a piece has on average.
    """

    sums: tuple[_Sums, ...]
    pieces: PieceColumns
    scale: Array
    usual: float = ASSUMED

    @classmethod
    def of(
        cls,
        A: Array,
        measured: Array,
        noise: RowNoise,
        columns: MissingColumns,
        usual: float = ASSUMED,
    ) -> "SizeLikelihood":
        """Take the sums over all measurements, which is all that sizes need of them.

        Args:
            A: Regressors (m, rows, p).
            measured: Deflections (m, rows) [m, rad].
            noise: Their noise.
            columns: What may be missing.
            usual: Share that a piece has on average.
        """
        scale = np.sqrt(np.square(A).sum(axis=(0, 1)))
        parts = [
            _sums_of(A[rows] / scale, measured[rows], noise[rows], columns[rows])
            for rows in whole_groups(columns.pose)
        ]
        sums = [
            _Sums(np.sum([one.G for one in of_size], axis=0), sum(one.log_V for one in of_size))
            for of_size in zip(*parts, strict=True)
        ]
        # Of the pieces it is their kinds that count here: columns of large sheets are not kept.
        return cls(tuple(sums), columns.pieces[np.arange(0)], scale, usual)

    @cached_property
    def posterior(self) -> "SizePosterior | None":
        """Probabilities of all sizes, and springs and shares for each of them.

        None where the readings tell no springs, or say nothing of any size.
        """
        try:
            found = self._posterior()
            told = np.isfinite(found.by_size).all() and np.isfinite(found.springs[0]).all()
        except np.linalg.LinAlgError:
            return None
        return found if told else None

    def _posterior(self) -> "SizePosterior":
        """The same, of springs that the readings tell.

        Raises:
            numpy.linalg.LinAlgError: They do not.
        """
        places = Places.of(self.pieces.joints, self.pieces.turns.shape[-1])
        across, held, turn = prior_of_sizes(self.usual)
        where = across[:, None] * places.chances
        where[:, 0] = 0.0
        where[0, 0] = places.chances[0]
        known = turn[:, None, None, None] * held[:, None, None] * where
        with np.errstate(divide="ignore"):
            log = np.log(known) + self._log_likelihoods(places.masks)
        weights = np.exp(log - log.max())
        total = float(weights.sum())
        return SizePosterior(self, places, weights / total, float(log.max() + np.log(total)))

    def _log_likelihoods(self, masks: Mask) -> Array:
        """Those (turns, held, across, places) of all sizes, with springs in places (places, a).

        Springs of one size s and mean m have the determinant of ``I + s^2 R``, with what remains of
        their columns, R, beside regressors and friction, and the quadratic form
        ``m'm - (m + s r)' (I + s^2 R)^-1 (m + s r)``, with r of the readings.
        """
        R, r, rest = self._across_alone()
        before = self.pieces.mean
        squares = np.square(SIZES)[:, None]
        found = np.empty((*rest.shape, len(SIZES), len(masks)))
        for place, mask in enumerate(masks):
            values, axes = eigenpairs(R[..., mask, :][..., mask])
            mean = before[: len(mask)][mask]
            along = (mean + SIZES[:, None] * r[..., None, mask]) @ axes
            gain = 1 + squares * np.maximum(values, 0.0)[..., None, :]
            parts = np.log(gain) - along**2 / gain
            found[..., place] = parts.sum(axis=-1) + rest[..., None] + mean @ mean
        return -0.5 * found

    def _across_alone(self) -> tuple[Array, Array, Array]:
        """Sums of the columns across, freed of regressors and friction of each size.

        Returns:
            Of the columns (turns, held, a, a), and with the readings (turns, held, a); and -2 log L
            (turns, held) without any spring across.
        """
        a, c = len(self.pieces.joints), len(self.pieces.kinds)
        G, y, rest = self._sums_by_size
        S = np.ones(G.shape[1:3])
        S[:, :a] = ACROSS
        S[:, a:c] = SIZES[:, None]
        before = self.pieces.mean
        M, b = _equations(G, y, S, before)
        inner, beside = M[..., a:, a:], M[..., a:, :a]
        own = b[..., a:, None]
        solved = np.linalg.solve(inner, np.concatenate([beside, own], axis=-1))
        taken = np.swapaxes(beside, -1, -2) @ solved
        freed = M[..., :a, :a] - np.eye(a) - taken[..., :a]
        square = rest[:, None] - (own * solved[..., a:]).sum(axis=(-1, -2))
        alone = np.linalg.slogdet(inner)[1] + square - before[:a] @ before[:a]
        return freed, b[..., :a] - before[:a] - taken[..., a], alone

    def solved(self, sizes: Array, scales: Array) -> tuple[Array, Array]:
        """Shares and springs (s, c + p), and their covariances (s, c + p, c + p).

        Args:
            sizes: Those of `SIZES` (s, 3): across, held, turn.
            scales: Sizes (s, c) of the shared columns.
        """
        held, turn = np.searchsorted(SIZES, sizes[:, 1:]).T
        G, y, _ = self._sums_by_size
        s, p = len(scales), len(self.scale)
        S = np.concatenate([scales, np.ones((s, p))], axis=1)
        M, b = _equations(G[turn, held], y[turn, held], S, self.pieces.mean)
        units = np.concatenate([scales, np.tile(1 / self.scale, (s, 1))], axis=1)
        mean = np.linalg.solve(M, b[..., None])[..., 0]
        return mean * units, units[:, :, None] * np.linalg.inv(M) * units[:, None]

    @cached_property
    def _sums_by_size(self) -> tuple[Array, Array, Array]:
        """Sums of shares and regressors, with what else is uncertain taken as noise.

        Returns:
            Their products (turns, held, c + p, c + p), those with the readings (turns, held,
            c + p), and ``log |R| + y'R^-1 y + m'm`` (turns,).
        """
        order, p, before = self._orders(), len(self.scale), self.pieces.mean
        each = [_without(sums, 1 + int(order.max())) for sums in self.sums]
        fixed = np.array([G for G, _ in each])
        rest = [log_V + G[p, p] + before @ before for G, log_V in each]
        return fixed[:, order[:, :, None], order[:, None]], fixed[:, order, p], np.array(rest)

    def _orders(self) -> Indices:
        """Places (sizes, c + p) in sums of shares and regressors, for each size of friction."""
        p, kinds = len(self.scale), self.pieces.kinds
        a, n = int((kinds == 0).sum()), int((kinds == 1).sum())
        across = np.arange(p + 1, p + 1 + a)
        # Friction of no size has the columns of the smallest, times zero.
        starts = p + 1 + a + n * np.maximum(np.arange(len(SIZES)) - 1, 0)
        each = [np.concatenate([across, start + np.arange(n), np.arange(p)]) for start in starts]
        return np.array(each)


def _sums_of(
    A: Array, measured: Array, noise: RowNoise, columns: MissingColumns
) -> tuple[_Sums, ...]:
    """The sums over whole poses, one for each size of the turns."""
    pieces = columns.pieces
    held = [pieces.held(size) for size in SIZES[1:]]
    every = [A, measured[..., None], pieces.across, *held, columns.known]
    X = whiten_columns(np.concatenate(every, axis=-1), noise)
    T = whiten_columns(pieces.turns, noise)
    flat = X.reshape(-1, X.shape[-1])
    whole = flat.T @ flat
    of_pose = [_of_poses(X[rows], T[rows]) for rows in groups_by_size(columns.pose)]
    values = np.concatenate([one[0] for one in of_pose]).ravel()
    shown = np.concatenate([one[1] for one in of_pose]).reshape(len(values), -1)
    found = []
    for size in SIZES:
        gain = size**2 * values
        part = shown * (size / np.sqrt(1 + gain))[:, None]
        found.append(_Sums(whole - part.T @ part, float(np.log1p(gain).sum())))
    return tuple(found)


def _of_poses(X: Array, T: Array) -> tuple[Array, Array]:
    """Eigenvalues (g, n) of ``T'T`` of poses, and what columns show along each axis (g, n, w).

    Args:
        X: Columns (g, s, rows, w) of s measurements in each pose.
        T: Turns (g, s, rows, n).
    """
    X = X.reshape(len(X), -1, X.shape[-1])
    T = T.reshape(len(T), -1, T.shape[-1])
    transposed = np.swapaxes(T, 1, 2)
    values, axes = eigenpairs(transposed @ T)
    return np.maximum(values, 0.0), np.swapaxes(axes, 1, 2) @ (transposed @ X)


def _without(sums: _Sums, first: int) -> tuple[Array, float]:
    """Sums (first, first) with what else is uncertain taken as noise of variance one."""
    G = sums.G
    inner = np.eye(len(G) - first) + G[first:, first:]
    across = G[:first, first:]
    found = G[:first, :first] - across @ np.linalg.solve(inner, across.T)
    return found, sums.log_V + float(np.linalg.slogdet(inner)[1])


def _equations(G: Array, y: Array, S: Array, before: Array) -> tuple[Array, Array]:
    """M (..., c + p, c + p) and b (..., c + p) for sizes S (s, c + p), of sums G and y of each."""
    c = len(before)
    M = S[:, :, None] * G * S[:, None]
    M[..., range(c), range(c)] += 1.0
    b = S * y
    b[..., :c] += before
    return M, b


@dataclass(frozen=True, eq=False)
class SizePosterior:
    """What a sheet leaves possible of the sizes of what is missing.

    Attributes:
        given: The likelihood.
        places: Where springs across may be.
        by_size: Probabilities (turns, held, across, places) of all sizes of `SIZES`.
        evidence: Logarithm of the likelihood over all sizes, up to half that of the determinant of
            the noise.
    """

    given: SizeLikelihood
    places: Places
    by_size: Array
    evidence: float

    @property
    def weights(self) -> Array:
        """The same (s,) of all possibilities, in the order of `sizes`."""
        return self.by_size.ravel()

    @cached_property
    def sizes(self) -> Array:
        """Shares (s, 3) of the pieces: across, held, turn."""
        every = np.stack(np.meshgrid(SIZES, SIZES, SIZES, indexing="ij")[::-1], axis=-1)
        return np.repeat(every.reshape(-1, 3), len(self.places.chances), axis=0)

    def scales(self, which: Indices) -> Array:
        """Standard deviations (s, c) of what shared columns are for, for some possibilities."""
        across, held, _ = self.sizes[which].T
        there = self.places.masks[which % len(self.places.chances)]
        n = len(self.given.pieces.kinds) - there.shape[1]
        own = ACROSS * across[:, None] * there
        return np.concatenate([own, np.tile(held[:, None], n)], axis=1)

    @cached_property
    def spread(self) -> tuple[Array, float]:
        """Root mean squares of the scales of shared columns (c,), and of the sizes of turns."""
        squares = np.square(SIZES)
        turn = squares @ self.by_size.sum(axis=(1, 2, 3))
        held = squares @ self.by_size.sum(axis=(0, 2, 3))
        across = ACROSS**2 * squares @ self.by_size.sum(axis=(0, 1)) @ self.places.masks
        n = len(self.given.pieces.kinds) - len(across)
        return np.sqrt(np.append(across, np.full(n, held))), float(np.sqrt(turn))

    @cached_property
    def likeliest(self) -> int:
        """The likeliest possibility; nothing is missing where the sheet does not speak for it.

        Its shares are those where each piece was as likely absent as there before: what a sheet
        says, and not what is known of arms.
        """
        absent = ABSENT.copy()
        absent[0] = self.places.chances[0]
        count = len(self.places.chances)
        sizes = self.sizes[::count]
        known = np.where(sizes == 0, absent, 1 - absent).prod(axis=1)
        said = self.by_size.sum(axis=-1).ravel() / np.where(known > 0, known, 1.0)
        best = int(said.argmax())
        return best * count + int(self.by_size.reshape(-1, count)[best].argmax())

    @property
    def shares(self) -> dict[str, float]:
        """The likeliest shares of the pieces [%]."""
        across, held, turn = (100 * self.sizes[self.likeliest]).tolist()
        return {"across_percent": across, "held_percent": held, "turn_percent": turn}

    @property
    def is_seen(self) -> bool:
        """Whether the sheet speaks for something that is missing."""
        return bool(self.sizes[self.likeliest].any())

    @cached_property
    def kept(self) -> tuple[Indices, Array]:
        """Some possibilities that stand for all, and their weights."""
        order = np.lexsort(self.sizes.T[[0, 2, 1]])
        levels = (np.arange(KEPT) + 0.5) / KEPT
        at = np.searchsorted(np.cumsum(self.weights[order]), levels)
        chosen, counts = np.unique(order[np.minimum(at, len(order) - 1)], return_counts=True)
        return chosen, counts / KEPT

    def solved(self, which: Indices) -> tuple[Array, Array]:
        """Shares and springs (s, c + p) for some possibilities, and their covariances."""
        return self.given.solved(self.sizes[which], self.scales(which))

    @cached_property
    def alone(self) -> Array:
        """Covariance (p, p) of the springs where nothing is missing."""
        c, p = len(self.given.pieces.kinds), len(self.given.scale)
        _, covariance = self.given.solved(np.zeros((1, 3)), np.zeros((1, c)))
        return np.asarray(covariance[0, -p:, -p:])

    @cached_property
    def springs(self) -> tuple[Array, Array]:
        """The same for those that are kept."""
        return self.solved(self.kept[0])

    def possible(self, k: Array) -> PossibleSprings:
        """What is left possible, beside the springs k (p,) by which commands are made."""
        chosen, weights = self.kept
        mean, covariance = self.springs
        mean = mean - np.pad(k, (mean.shape[1] - len(k), 0))
        _, held, turn = self.sizes[chosen].T
        return PossibleSprings(weights, held, turn, mean, covariance)
