"""How likely pieces that a model lacks are, and what parameters of faults cost beforehand."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from criteria.linalg.inverse import TINY, eigenpairs
from edtk.fit.correlated_noise import RowNoise, groups_by_size, whiten_columns
from edtk.fit.distributions import chi_square_tail, fisher_tail, log_normal_below
from edtk.fit.estimate_noise import Stratum
from edtk.fit.measurements import Measurements
from edtk.measure.model_error import ModelError
from edtk.system.typing import Array, Indices, Mask

# Student's distribution with so many degrees of freedom, of the usual width, is the one of a
# fault's size beforehand: mostly within a factor of two, rarely five times as large.
FREEDOM = 4.0
# It is a mixture of normal ones, whose widths are these factors of the usual one.
FACTORS = 2.0 ** np.arange(-2, 7)
WEIGHTS = FACTORS**-FREEDOM * np.exp(-FREEDOM / (2 * FACTORS**2))
WEIGHTS = WEIGHTS / WEIGHTS.sum()
SMALLER = 4.0 ** -np.arange(3)  # sizes of disturbed readings over that of mistyped ones
# Grids reach so many standard deviations of a logarithm, in steps of a fifth and a tenth of one.
REACH = 8.0


def rarity(
    c: Array, covariance: Array, usual: ArrayLike, only_positive: ArrayLike = False
) -> Array:
    """Twice the negative logarithms of the share of the likelihood that faults' sizes have.

    The likelihood of a size x is ``exp(-(x - c)' C^-1 (x - c) / 2)`` of its maximum. Its mean over
    normal sizes of covariance ``t^2 I`` is

        ``det(I + t^2 C^-1)^-1/2 exp(-c' (C + t^2 I)^-1 c / 2)``,

    and that over Student's distribution is the mean of these (Gelman and others, Bayesian Data
    Analysis, 3rd edition, sections 7.4 and 17.2). Of a fault that the measurements do not show, it
    is what the maximum of the likelihood gained; of one that they show well, about
    ``log det(t^2 C^-1)``, as with Bayes' information criterion. So a fault that explains a small
    misfit, but is usually so large that it would have made a large one, is less likely than one
    that is usually as small; and directions of a fault that measurements hardly show do not count
    against it.

    Args:
        c: Sizes of faults (..., dims) at the maximum of the likelihood, SI.
        covariance: Their covariances C (..., dims, dims).
        usual: Lengths (...) that such sizes usually have, in SI units.
        only_positive: Whether (...) a negative size is none; with one parameter.
    """
    return _mixed(_costs(c, covariance, np.asarray(usual), np.asarray(only_positive)))


def _mixed(cost: Array) -> Array:
    """Twice the negative logarithms (...) of the mean shares over Student's distribution."""
    least = cost.min(axis=-1, keepdims=True)
    return np.asarray(least[..., 0] - 2 * np.log(np.exp(-(cost - least) / 2) @ WEIGHTS))


def reading_rarity(c: Array, covariance: Array, usual: float) -> float:
    """The same of a single reading that is off: by about `usual`, or by much less.

    One that was mistyped is off by the size of all readings; a beam that was disturbed makes less,
    of any order of magnitude.
    """
    sizes = np.asarray(usual * SMALLER, dtype=np.float64)
    each = _mixed(_costs(c, covariance, sizes, np.array(False)))
    return float(-2 * (np.logaddexp.reduce(-each / 2) - math.log(len(each))))


def likely_size(c: Array, covariance: Array, usual: ArrayLike) -> tuple[Array, Array]:
    """Means (..., dims) and covariances (..., dims, dims) of faults' sizes, with what is usual.

    The maximum of the likelihood c is far off along directions that measurements hardly show; there
    the usual size tells more.

    Args:
        c: Sizes of faults (..., dims) at the maximum of the likelihood, SI.
        covariance: Their covariances C (..., dims, dims).
        usual: Lengths (...) that such sizes usually have, in SI units.
    """
    usual = np.asarray(usual)
    cost = _costs(c, covariance, usual, np.array(False))
    weights = WEIGHTS * np.exp(-(cost - cost.min(axis=-1, keepdims=True)) / 2)
    weights = (weights / weights.sum(axis=-1, keepdims=True))[..., None]
    values, vectors = eigenpairs(covariance)
    t2 = _variances(usual, c.shape[-1])[..., None]
    kept = t2 / (np.maximum(values, 0.0)[..., None, :] + t2)
    means = (c[..., None, :] @ vectors) * kept
    mean = (weights * means).sum(axis=-2)
    off = means - mean[..., None, :]
    within = np.eye(c.shape[-1]) * (values * (weights * kept).sum(axis=-2))[..., None]
    spread = within + np.swapaxes(off, -1, -2) @ (off * weights)
    likely = (vectors @ mean[..., None])[..., 0]
    return likely, np.asarray(vectors @ spread @ np.swapaxes(vectors, -1, -2))


def _variances(usual: Array, dims: int) -> Array:
    """Variances (..., factors) of each parameter, such that its vector has the usual length."""
    return np.asarray((usual[..., None] * FACTORS) ** 2 / dims)


def _costs(c: Array, covariance: Array, usual: Array, only_positive: Mask) -> Array:
    """Twice the negative logarithms (..., factors) of the shares over normal sizes."""
    t2 = _variances(usual, c.shape[-1])[..., None]
    values, vectors = eigenpairs(covariance)
    # Rounding may leave no variance at all, and then a quotient by it would overflow.
    values = np.maximum(values, np.finfo(float).tiny)[..., None, :]
    along = (c[..., None, :] @ vectors) ** 2
    cost = (along / (values + t2) + np.log(values + t2) - np.log(values)).sum(axis=-1)
    if only_positive.any():
        # The share of the likelihood over positive sizes, which have twice the density.
        z = (c[..., None, :] * np.sqrt(t2 / (values + t2)) / np.sqrt(values))[..., 0]
        above = 2 * (math.log(2) + log_normal_below(z))
        cost = cost - np.where(only_positive[..., None], above, 0.0)
    return np.asarray(cost)


USUAL_FACTOR = math.log(1.5)  # by which the true noise is off the stated one, as a logarithm
STEPS = np.linspace(-REACH, REACH, 81)
ABOVE = np.linspace(0.0, 2 * REACH, 161)


def noise_rarity(own: Stratum, shared: Sequence[tuple[Stratum, float]] = ()) -> float:
    """Twice the negative logarithm of the share of the likelihood that sizes of noise have.

    Residuals are split into parts of d degrees of freedom each, whose mean squares M are
    ``m chi^2_d / d``: one of the readings' own noise, with ``m = s^2``, and others in which n
    readings have noise in common, with ``m = s^2 + n t^2``. At ``m = M`` the likelihood is largest;
    elsewhere its share is

        ``exp(-d (M/m - 1 - log(M/m)) / 2)``.

    This is its mean where the logarithm of s has Student's distribution with four degrees of
    freedom about that of the stated noise, mostly within a factor of 1.5, and the part of a
    reading's variance that others share, ``t^2 / (s^2 + t^2)``, is anything from none to all alike.
    So little more than nothing is paid for what few degrees of freedom leave open, other than with
    Bayes' information criterion, which knows of no prior.

    Args:
        own: Squares, in units of the stated noise, that only the readings' own noise makes.
        shared: Those that shared noise makes too, each with its number n of readings.
    """
    log_s = math.log(max(own.mean_square, TINY)) / 2 + STEPS / math.sqrt(2 * own.dof)
    x = log_s / USUAL_FACTOR
    density = math.log(3 / 8 / USUAL_FACTOR) - 2.5 * np.log1p(x**2 / 4)
    share = density + _log_likelihood(own, 2 * log_s)
    for part, readings in shared:
        share = share + _with_common(part, readings, 2 * log_s)
    return -2 * float(np.logaddexp.reduce(share) + math.log(log_s[1] - log_s[0]))


def _with_common(part: Stratum, readings: float, log_own: Array) -> Array:
    """Logarithms (s,) of the mean shares of one part, for variances (s,) of readings by themselves.

    With the ratio ``r = m / s^2`` and a share of the variance that is anything alike, ``log r`` has
    the density ``n r / (r - 1 + n)^2``.
    """
    width = math.sqrt(2 / part.dof)
    best = math.log(max(part.mean_square, TINY))
    log_m = np.maximum(log_own, best - REACH * width)[:, None] + width * ABOVE
    log_r = log_m - log_own[:, None]
    more = log_r + np.log1p((readings - 1) * np.exp(-log_r))  # log(r - 1 + n)
    density = math.log(readings) + log_r - 2 * more
    each = density + _log_likelihood(part, log_m) + math.log(width * (ABOVE[1] - ABOVE[0]))
    each[:, 0] -= math.log(2)  # by the trapezoidal rule, as it may be the largest
    return np.asarray(np.logaddexp.reduce(each, axis=1))


def _log_likelihood(part: Stratum, log_m: Array) -> Array:
    """Logarithm of the likelihood of variances, over the largest one."""
    log_ratio = math.log(max(part.mean_square, TINY)) - log_m
    with np.errstate(over="ignore"):
        return np.asarray(-part.dof / 2 * (np.exp(log_ratio) - 1 - log_ratio))


# What ideal springs leave out, as a share of what they move, beforehand: Student's distribution of
# `FREEDOM` degrees of freedom, folded at zero, with this width.
USUAL_SHARE = 0.03
LEAST_SHARE = 1e-4  # below it nothing is left out
LOG_SHARES = np.log(LEAST_SHARE) + 0.5 * np.arange(20)  # up to one, in steps of a factor of 1.6
AROUND = np.linspace(-5.0, 5.0, 21)  # standard deviations about the likeliest, at most a step apart
MOST_PRODUCTS = 4_000_000  # numbers of products that are kept at once
ORDER = 1e-12  # of a root of columns, beside its length, that is rounding


@dataclass(frozen=True, eq=False)
class ErringRows:
    """Readings in units of their noise, turned so that errors of the model err each by itself.

    A share s of what springs move is left out at random, with covariance ``s^2 E`` (`ModelError`),
    which visits of a pose under a load share. In units of the noise its blocks are turned to
    diagonals, so that reading i has the variance ``1 + s^2 e_i``.

    Attributes:
        e: Variances (N,) of the model's errors for a share of one; zero for what is known before.
        turns: Numbers (G, b) of readings of poses, and their turns (G, b, b).
    """

    e: Array
    turns: tuple[tuple[Indices, Array], ...]

    @classmethod
    def of(cls, data: Measurements, bends: Array, noise: RowNoise, more: int = 0) -> "ErringRows":
        """Of displacements that springs make.

        Args:
            data: The measurements.
            bends: What each spring does to them (m, rows, n) [m, rad].
            noise: Their noise.
            more: Readings (N - m rows) below them that tell what was known before.
        """
        m, rows = bends.shape[:2]
        roots = whiten_columns(_roots(data, bends), noise)
        e = np.zeros(m * rows + more)
        turns = []
        for members in groups_by_size(data.pose):
            place = (members[..., None] * rows + np.arange(rows)).reshape(len(members), -1)
            L = roots[members].reshape(*place.shape, -1)
            values, vectors = eigenpairs(L @ np.swapaxes(L, 1, 2))
            e[place] = np.where(values > ORDER * values[:, -1:], values, 0.0)
            turns.append((place, vectors))
        return cls(e, tuple(turns))

    def turned(self, x: Array) -> Array:
        """Readings or columns (N, ...) in units of the noise, turned."""
        found = x.copy()
        for place, vectors in self.turns:
            found[place] = np.einsum("gba,gb...->ga...", vectors, x[place])
        return found


def _roots(data: Measurements, bends: Array) -> Array:
    """A root (m, rows, c) of the covariance E of readings for a share of one.

    Half of the variance is in the turns of the springs, and half in any direction, see
    `ModelError.of_share`. In any direction an instrument errs by itself in each coordinate.
    """
    m, rows, n = bends.shape
    whole = ModelError.of_share(np.ones(n), 1.0)
    by_spring = np.moveaxis(bends, -1, 0)
    every = np.moveaxis(by_spring, 1, -1)  # component first
    sizes = np.empty((rows, m))
    for is_length in np.unique(data.lengths, axis=0):
        own = (data.lengths == is_length).all(axis=1)
        sizes[:, own] = whole.sizes(every[..., own], (~is_length).astype(int))
    # Which instrument of its pose a reading is of.
    first = np.unique(data.pose, return_index=True)[1]
    instrument = np.zeros(m, dtype=int)
    for number in range(len(first)):
        at = data.pose == number
        instrument[at] = np.unique(data.places[at], return_inverse=True)[1]
    anywhere = np.zeros((m, rows, (instrument.max() + 1) * rows))
    for row in range(rows):
        anywhere[np.arange(m), row, instrument * rows + row] = sizes[row]
    return np.concatenate([whole.turn * bends, anywhere], axis=-1)


@dataclass(frozen=True, eq=False)
class Weighed:
    """Pieces beside a model, weighed over all sizes of its errors.

    Attributes:
        score: Twice the negative logarithm of the marginal likelihood, of which that of the model
            without an error is the sum of squares.
        share: The likeliest share that is left out.
        width: The likeliest size of the pieces, over the usual one.
        p: Probability that chance lets the pieces explain so much, beside that error.
        nodes: Weights (w,) of shares and of widths of the pieces' sizes.
        means: Parameters, then pieces (w, p + c), for each of these.
        covariances: Their covariances (w, p + c, p + c).
    """

    score: float
    share: float
    width: float
    p: float
    nodes: Array
    means: Array
    covariances: Array

    @property
    def mean(self) -> Array:
        """Parameters and sizes of the pieces (p + c,)."""
        return np.asarray(self.nodes @ self.means)

    @property
    def covariance(self) -> Array:
        """Their covariance (p + c, p + c)."""
        off = self.means - self.mean
        within = np.einsum("w,wij->ij", self.nodes, self.covariances)
        return np.asarray(within + (off * self.nodes[:, None]).T @ off)


@dataclass(frozen=True, eq=False)
class Pieces:
    """What a model may lack: columns, with sizes that they usually have.

    Attributes:
        columns: What readings show of a unit of each (N, c).
        usual: Sizes (c,) that they usually have, mostly within a factor of two.
        positive: Which (c,) are never negative.
    """

    columns: Array
    usual: Array
    positive: Mask


def no_pieces(N: int) -> Pieces:
    """None, beside N readings."""
    return Pieces(np.zeros((N, 0)), np.zeros(0), np.zeros(0, dtype=bool))


@dataclass(frozen=True, eq=False)
class Evidence:
    """Marginal likelihoods of a linear model with any pieces.

    Readings ``y = X k + D c + e`` have errors of variances ``v_i = 1 + s^2 e_i``. Nothing is known
    of k before, c is normal with the widths T, and with ``W = diag(1/v)``,

        M = D' P D,  r = D' P y,  P = W - W X (X'WX)^-1 X'W,
        -2 log p(y | s, T) = sum log v + log det X'WX + y'Py + log det(I + T M T)
                             - r'(T^-2 + M)^-1 r,

    (Harville 1974 for the part without pieces). The share s and a factor of all widths are
    integrated numerically, over their own distributions; see `rarity` for that of the widths. Where
    pieces are never negative, their likelihood over positive sizes counts, which have twice the
    density, each as if the others were at their means.

    Attributes:
        rows: How the readings err.
        y: Readings (N,), turned.
        X: Regressors (N, p) of the parameters, turned.
    """

    rows: ErringRows
    y: Array
    X: Array

    @classmethod
    def of(cls, rows: ErringRows, measured: Array, A: Array) -> "Evidence":
        """Of readings (N,) and regressors (N, p) in units of the noise."""
        return cls(rows, rows.turned(measured), rows.turned(A))

    @cached_property
    def factored(self) -> tuple[Array, Array, Array]:
        """Q (N, p) and R (p, p) of the regressors, and lengths (p,) of their columns."""
        length = np.linalg.norm(self.X, axis=0)
        Q, R = np.linalg.qr(self.X / length)
        return Q, R, length

    @cached_property
    def alone(self) -> Weighed:
        """The model without any piece."""
        return self.weigh(no_pieces(len(self.y)))

    def weigh(self, pieces: Pieces) -> Weighed:
        """Weigh some pieces beside the model."""
        return weigh_each([self], [pieces])[0]

    def left(self, pieces: Pieces, share: float) -> float:
        """Sum of squares that parameters and pieces leave of readings, at a share of the error."""
        weight = 1 / np.sqrt(1 + share**2 * self.rows.e)
        columns = np.concatenate([self.X, self.rows.turned(pieces.columns)], axis=1)
        columns = columns * weight[:, None]
        length = np.linalg.norm(columns, axis=0)
        y = self.y * weight
        unit = columns / np.where(length > 0, length, 1.0)
        return float(np.square(y - unit @ np.linalg.lstsq(unit, y, rcond=None)[0]).sum())


def weigh_each(models: Sequence[Evidence], pieces: Sequence[Pieces]) -> list[Weighed]:
    """Weigh pieces, of each number of them all at once, each beside a model of the same readings.

    Args:
        models: One for each of the pieces, with the same rows and number of parameters.
        pieces: The pieces.
    """
    found: dict[int, Weighed] = {}
    counts = np.array([len(one.usual) for one in pieces])
    for c in np.unique(counts):
        same = np.flatnonzero(counts == c)
        N, p = models[same[0]].X.shape
        some = max(1, MOST_PRODUCTS // (N * (p + c + 1) ** 2))
        for first in range(0, len(same), some):
            chosen = same[first : first + some]
            parts = _weigh([models[i] for i in chosen], [pieces[i] for i in chosen])
            found.update(zip(chosen.tolist(), parts, strict=True))
    return [found[i] for i in range(len(pieces))]


def _weigh(models: Sequence[Evidence], pieces: Sequence[Pieces]) -> list[Weighed]:
    """Weigh pieces (h of them, of the same number c each) beside their models."""
    rows = models[0].rows
    columns = np.stack([one.columns for one in pieces])
    length = np.linalg.norm(columns, axis=1)
    length = np.where(length > 0, length, 1.0)
    Q, R, own = (np.stack(parts) for parts in zip(*(one.factored for one in models), strict=True))
    D = np.stack([rows.turned(one) for one in columns]) / length[:, None]
    # What regressors take up is left out beforehand: of columns alike nothing else remains.
    taken = np.swapaxes(Q, 1, 2) @ D
    D = D - Q @ taken
    y = np.stack([one.y for one in models])
    B = np.concatenate([Q, D, y[..., None]], axis=2)
    products = (B[..., None] * B[..., None, :]).reshape(*B.shape[:2], -1)
    usual = np.stack([one.usual for one in pieces]) * length
    positive = np.stack([one.positive for one in pieces])
    at = _Node(products, rows.e, Q.shape[2], usual, positive)
    return at.weighed(_outward(R, taken, own, length))


def _outward(R: Array, taken: Array, own: Array, length: Array) -> Array:
    """Parameters and pieces by those u and c of columns of unit length (h, p + c, p + c).

    They are ``k = R^-1 (u - Q'D c)`` and c, over the lengths of their columns.

    Args:
        R: Triangles (h, p, p) of the regressors.
        taken: Q'D (h, p, c), what these take up of the pieces' columns.
        own: Lengths (h, p) of the regressors' columns.
        length: Lengths (h, c) of the pieces' columns.
    """
    h, p, c = taken.shape
    U = np.zeros((h, p + c, p + c))
    U[:, :p, :p] = np.eye(p)
    U[:, :p, p:] = -taken
    U[:, :p] = np.linalg.solve(R, U[:, :p]) / own[..., None]
    U[:, range(p, p + c), range(p, p + c)] = 1 / length
    return U


@dataclass(frozen=True, eq=False)
class _Node:
    """Sums of products at any size of the model's error, of h models with pieces.

    Attributes:
        products: Of each two columns of parameters, pieces and readings (h, N, (p + c + 1)^2).
        e: Variances (N,) of the model's errors.
        p: Number of parameters.
        usual: Widths (h, c) of the pieces.
        positive: Which (h, c) are never negative.
    """

    products: Array
    e: Array
    p: int
    usual: Array
    positive: Mask

    def weighed(self, U: Array) -> list[Weighed]:
        """All sizes together, by the trapezoidal rule about the likeliest share.

        Args:
            U: Parameters and pieces (h, p + c, p + c) by those of the products' columns.
        """
        coarse = self.scores(np.broadcast_to(LOG_SHARES, (len(U), len(LOG_SHARES))))
        log_s = LOG_SHARES[coarse.min(axis=2).argmin(axis=1)]
        step = np.minimum(self.width(log_s), LOG_SHARES[1] - LOG_SHARES[0])
        grid = log_s[:, None] + AROUND * step[:, None]
        scores = self.scores(grid)
        least = scores.min(axis=(1, 2))
        nodes = np.exp(-(scores - least[:, None, None]) / 2)
        nodes[:, [0, -1]] /= 2
        total = nodes.sum(axis=(1, 2)) * (grid[:, 1] - grid[:, 0])
        best = scores.reshape(len(U), -1).argmin(axis=1)
        at_share, at_width = np.unravel_index(best, scores.shape[1:])
        log_share = grid[np.arange(len(U)), at_share]
        chance = self.chance(log_share)
        found = []
        for i, own in enumerate(nodes):
            chosen = own > own.max() * 1e-4
            means, covariances = self.posterior(i, grid[i], chosen)
            found.append(
                Weighed(
                    score=float(least[i]) - 2 * math.log(float(total[i])),
                    share=float(np.exp(log_share[i])),
                    width=float(FACTORS[at_width[i]]),
                    p=float(chance[i]),
                    nodes=own[chosen] / own[chosen].sum(),
                    means=means @ U[i].T,
                    covariances=U[i] @ covariances @ U[i].T,
                )
            )
        return found

    def _sums(self, log_s: Array) -> tuple[Array, Array]:
        """Weighted sums (h, S, k, k), and sums (h, S) of the logarithms of variances."""
        v = 1 + np.exp(2 * log_s)[..., None] * self.e
        k = round(math.sqrt(self.products.shape[2]))
        return ((1 / v) @ self.products).reshape(*log_s.shape, k, k), np.log(v).sum(axis=-1)

    def _beside(self, G: Array) -> tuple[Array, Array, Array, Array]:
        """M (h, S, c, c), r (h, S, c), y'Py (h, S) and log det X'WX (h, S)."""
        p = self.p
        X = G[..., :p, :p]
        taken = np.linalg.solve(X, G[..., :p, p:])
        left = G[..., p:, p:] - np.swapaxes(G[..., :p, p:], -1, -2) @ taken
        return left[..., :-1, :-1], left[..., :-1, -1], left[..., -1, -1], np.linalg.slogdet(X)[1]

    def scores(self, log_s: Array) -> Array:
        """Twice the negative logarithm (h, S, F) of the likelihood with both prior densities.

        With widths ``T = f U`` and ``U M U = V diag(m) V'``, all factors f have the inverse
        ``(I + T M T)^-1 = V diag(1 / (1 + f^2 m)) V'`` of one decomposition.
        """
        G, log_v = self._sums(log_s)
        M, r, rest, log_X = self._beside(G)
        density = -2 * (_log_density(log_s))
        base = log_v + log_X + rest + density
        if not self.usual.shape[1]:
            return np.asarray(base[..., None])
        usual = self.usual[:, None]  # (h, 1, c)
        m, V = eigenpairs(usual[..., None] * M * usual[..., None, :])
        f = FACTORS[:, None]
        grown = 1 + f**2 * np.maximum(m, 0.0)[..., None, :]  # (h, S, F, c)
        along = ((usual * r)[..., None, :] @ V) * f
        score = (np.log(grown) - along**2 / grown).sum(axis=-1)
        if self.positive.any():
            back = np.swapaxes(V, -1, -2)
            std = np.sqrt((1 / grown) @ back**2)
            above = math.log(2) + log_normal_below(((along / grown) @ back) / std)
            score = score - 2 * np.where(self.positive[:, None, None], above, 0.0).sum(axis=-1)
        return np.asarray(base[..., None] + score - 2 * np.log(WEIGHTS))

    def width(self, log_s: Array) -> Array:
        """About one standard deviation (h,) of the logarithm of the share."""
        v = 1 + np.exp(2 * log_s)[:, None] * self.e
        information = 2 * (((v - 1) / v) ** 2).sum(axis=1)
        return np.asarray(1 / np.sqrt(np.maximum(information, 1.0)))

    def posterior(self, i: int, log_s: Array, chosen: Mask) -> tuple[Array, Array]:
        """Means and covariances of model i at some of the shares and widths (S, F)."""
        one = replace(self, products=self.products[[i]])
        G = one._sums(log_s[None])[0][0]
        p, c = self.p, self.usual.shape[1]
        at, width = np.nonzero(chosen)
        whole = G[at, :-1, :-1].copy()
        if c:
            T = FACTORS[width, None] * self.usual[i]
            whole[:, p + np.arange(c), p + np.arange(c)] += T**-2.0
        covariance = np.linalg.inv(whole)
        return (covariance @ G[at, :-1, -1, None])[..., 0], np.asarray(covariance)

    def chance(self, log_s: Array) -> Array:
        """Probability (h,) that chance explains as much as the pieces, at a size of the error.

        The error was found beside them, from as many readings as it makes: Fisher's law.
        """
        c = self.usual.shape[1]
        if not c:
            return np.ones(len(log_s))
        G, _ = self._sums(log_s[:, None])
        M, r, rest, _ = self._beside(G)
        r = r[:, 0]
        inverse = np.linalg.pinv(M[:, 0], rcond=c * np.finfo(float).eps, hermitian=True)
        drop = (r * (inverse @ r[..., None])[..., 0]).sum(axis=1)
        v = np.exp(2 * log_s)[:, None] * self.e
        by_model = (v / (1 + v)).sum(axis=1)
        N = len(self.e)
        dof = np.maximum(by_model * (N - self.p - c) / N, 1.0)
        scale = np.maximum((rest[:, 0] - drop) / max(N - self.p - c, 1), 1e-300)
        drop = np.maximum(drop, 0.0)
        beside = fisher_tail(drop / c / scale, c, dof)
        return np.where(by_model < 1, chi_square_tail(drop, c), beside)


def _log_density(log_s: Array) -> Array:
    """Logarithm of the density (S,) of the logarithm of a share, before the measurements."""
    x = np.exp(log_s) / USUAL_SHARE
    constant = math.log(2 * 3 / 8)  # Student's of four degrees of freedom, folded
    return np.asarray(constant + np.log(x) - (FREEDOM + 1) / 2 * np.log1p(x**2 / FREEDOM))
