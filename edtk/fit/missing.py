"""How much a model of springs leaves out, as far as a sheet tells it: sizes by their likelihood."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.fit.correlated_noise import RowNoise, groups_by_size, whiten_columns, whole_groups
from edtk.measure.missing_pieces import PieceColumns, PossibleSprings
from edtk.measure.model_error import ASSUMED
from edtk.system.typing import Array, Indices

# Shares that a piece may have: nothing, or a size on a scale of factors of two.
SIZES = np.array([0.0, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32])
# What is known before a sheet: one arm in two has no springs across its joints, and no stiffness
# that varies; no gear is without friction, but one in four has so little that it does not count.
# Where a piece is there its share is a tenth, exponentially distributed. Bearings and links add a
# tenth to a third to what gears give, friction holds some per cent to a sixth of a load, and
# stiffnesses vary by a tenth with position. With one half for friction, too, a sheet that tells it
# at 2.3 standard deviations was taken for one of ideal springs (kept_promises.py).
ABSENT = np.array([0.5, 0.25, 0.5])
# Sizes that stand for all that are left possible, each of the same probability, at most.
KEPT = 24


def prior_of_sizes(usual: float = ASSUMED) -> Array:
    """Probabilities (3, sizes) of `SIZES`, each of which stands for what is nearer by logarithms.

    Args:
        usual: Share that a piece has on average, where it is there.

    Returns:
        Those of springs across, of what friction holds, and of turns.
    """
    between = np.sqrt(SIZES[1:-1] * SIZES[2:])
    edges = np.concatenate([[0.0], between, [np.inf]])
    there = np.outer(1 - ABSENT, np.diff(-np.exp(-edges / usual)))
    return np.column_stack([ABSENT, there])


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

    With the regressors A, errors of the model ``U S v`` of sizes S and shares v of mean m and
    variance one, and the covariance R of noise and turns, Henderson's equations (1950) give springs
    and shares at once:

        M = [[I + S U'R^-1 U S, S U'R^-1 A], [A'R^-1 U S, A'R^-1 A]],
        -2 log L = log |R| + log |M| + y'R^-1 y + m'm - b'M^-1 b,
        b = [m + S U'R^-1 y, A'R^-1 y],

    which is the likelihood of Patterson and Thompson (1971), and ``M^-1`` is the covariance of
    their errors. What else is uncertain of the day is a part of R, with its known size.

    Attributes:
        sums: One for each size of the turns.
        pieces: Columns of the pieces.
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
        return cls(tuple(sums), columns.pieces, scale, usual)

    @cached_property
    def posterior(self) -> "SizePosterior | None":
        """Probabilities of all sizes, and springs and shares for each of them.

        None where the readings tell no springs, or say nothing of any size.
        """
        try:
            found = self._posterior()
        except np.linalg.LinAlgError:
            return None
        return found if np.isfinite(found.weights).all() else None

    def _posterior(self) -> "SizePosterior":
        """The same, of springs that the readings tell.

        Raises:
            numpy.linalg.LinAlgError: They do not.
        """
        kinds, before = self.pieces.kinds, self.pieces.mean
        c, p = len(kinds), len(self.scale)
        sizes = np.stack(np.meshgrid(SIZES, SIZES, indexing="ij"), axis=-1).reshape(-1, 2)
        S = np.concatenate([sizes[:, kinds], np.ones((len(sizes), p))], axis=1)
        order = self._orders()
        last = 1 + int(order.max())
        of_across, of_held, of_turn = np.log(prior_of_sizes(self.usual))
        parts = []
        for turn, sums in enumerate(self.sums):
            fixed, log_V = _without(sums, last)
            G = np.array([fixed[np.ix_(own, own)] for own in order])
            y = np.array([fixed[own, p] for own in order])
            times = len(SIZES)
            M, b = _equations(np.tile(G, (times, 1, 1)), np.tile(y, (times, 1)), S, before)
            mean = np.linalg.solve(M, b[..., None])[..., 0]
            square = fixed[p, p] + before @ before - (b * mean).sum(axis=1)
            likelihood = -0.5 * (log_V + np.linalg.slogdet(M)[1] + square)
            known = of_turn[turn] + of_across[:, None] + of_held
            parts.append((likelihood + known.ravel(), mean, M, np.full(len(S), SIZES[turn])))
        log, mean, M, turns = (np.concatenate(one) for one in zip(*parts, strict=True))
        weights = np.exp(log - log.max())
        every = np.tile(sizes, (len(self.sums), 1))
        units = np.concatenate([every[:, kinds], np.tile(1 / self.scale, (len(M), 1))], axis=1)
        shares = np.column_stack([every, turns])
        return SizePosterior(shares, weights / weights.sum(), mean * units, M, units, c)

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
    values, axes = np.linalg.eigh(transposed @ T)
    return np.maximum(values, 0.0), np.swapaxes(axes, 1, 2) @ (transposed @ X)


def _without(sums: _Sums, first: int) -> tuple[Array, float]:
    """Sums (first, first) with what else is uncertain taken as noise of variance one."""
    G = sums.G
    inner = np.eye(len(G) - first) + G[first:, first:]
    across = G[:first, first:]
    found = G[:first, :first] - across @ np.linalg.solve(inner, across.T)
    return found, sums.log_V + float(np.linalg.slogdet(inner)[1])


def _equations(G: Array, y: Array, S: Array, before: Array) -> tuple[Array, Array]:
    """M (s, c + p, c + p) and b (s, c + p) for sizes S (s, c + p), of sums G and y of each."""
    c = len(before)
    M = S[:, :, None] * G * S[:, None]
    M[:, range(c), range(c)] += 1.0
    b = S * y
    b[:, :c] += before
    return M, b


@dataclass(frozen=True, eq=False)
class SizePosterior:
    """What a sheet leaves possible of the sizes of what is missing.

    Attributes:
        sizes: Shares (s, 3) of the pieces: across, held, turn.
        weights: Their probabilities (s,).
        mean: Shares and springs (s, c + p) for each, by generalised least squares.
        M: Inverses (s, c + p, c + p) of the covariance, over `units`.
        units: Of these (s, c + p).
        c: Number of shared columns.
    """

    sizes: Array
    weights: Array
    mean: Array
    M: Array
    units: Array
    c: int

    @property
    def likeliest(self) -> Array:
        """The likeliest shares (3,); all zero where the sheet does not speak for any.

        They are those where each piece was as likely absent as there before: what a sheet says, and
        not what is known of arms.
        """
        known = np.where(self.sizes == 0, ABSENT, 1 - ABSENT).prod(axis=1)
        return np.asarray(self.sizes[int((self.weights / known).argmax())])

    @property
    def shares(self) -> dict[str, float]:
        """The likeliest shares of the pieces [%]."""
        across, held, turn = (100 * self.likeliest).tolist()
        return {"across_percent": across, "held_percent": held, "turn_percent": turn}

    @property
    def is_seen(self) -> bool:
        """Whether the sheet speaks for something that is missing."""
        return bool(self.likeliest.any())

    @cached_property
    def kept(self) -> tuple[Indices, Array]:
        """Some sizes that stand for all, and their weights."""
        order = np.lexsort(self.sizes.T[[0, 2, 1]])
        levels = (np.arange(KEPT) + 0.5) / KEPT
        at = np.searchsorted(np.cumsum(self.weights[order]), levels)
        chosen, counts = np.unique(order[np.minimum(at, len(order) - 1)], return_counts=True)
        return chosen, counts / KEPT

    def covariance(self, which: Indices) -> Array:
        """Covariances (s, c + p, c + p) of shares and springs for some of the sizes."""
        units = self.units[which]
        inverse = np.linalg.inv(self.M[which])
        return np.asarray(units[:, :, None] * inverse * units[:, None])

    def possible(self, k: Array) -> PossibleSprings:
        """What is left possible, beside the springs k (p,) by which commands are made."""
        chosen, weights = self.kept
        mean = self.mean[chosen].copy()
        mean[:, self.c :] -= k
        _, held, turn = self.sizes[chosen].T
        return PossibleSprings(weights, held, turn, mean, self.covariance(chosen))
