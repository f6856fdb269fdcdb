"""Sizes of the errors of positions: of the instrument, of joints that repeat, of the model."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from edtk.fit.geometry.marker_positions import MarkerPositions
from edtk.robots.rotations import rotation_vectors
from edtk.system.typing import Array, Indices, Mask

ITERATIONS = 60  # of Fisher scoring; ten are the rule
SETTLED = 1e-4  # relative change of what a variance adds to the total
HALVINGS = 4  # of a step that lowers the likelihood, before a step that cannot takes its place
ENOUGH = 20  # degrees of freedom of repeats, from which they tell the noise of a reading
# Twice the gain in log-likelihood, from which a model error is believed: chance exceeds it one time
# in twenty, or in forty where the variance may not be negative.
SPEAKS = 4.0
ROUNDING = 1e-6  # [mm] no instrument reads better


@dataclass(frozen=True, eq=False)
class BlockVariances:
    """Variances, and how well they are known.

    Attributes:
        variances: One a kind (c,).
        covariance: Of these (c, c); infinite where a variance is zero and so not bounded below.
        log_likelihood: The residual log-likelihood, up to a constant.
    """

    variances: Array
    covariance: Array
    log_likelihood: float

    def relative_dof(self, slopes: Array) -> Array:
        """Degrees of freedom (...,) of sums ``slopes v``: ``2 mean^2 / variance`` (Satterthwaite).

        Args:
            slopes: Sums' derivatives (..., c) by the variances.
        """
        mean = slopes @ self.variances
        spread = np.einsum("...i,ij,...j->...", slopes, self.covariance, slopes)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(spread > 0, 2 * mean**2 / spread, np.inf)


def fit_variances_of_blocks(
    fixed: Array, kinds: Sequence[Array], residual: Array, design: Array, told: Mask | None = None
) -> BlockVariances:
    """Fit ``V_b = F_b + sum_i v_i K_ib`` to independent blocks b of residuals.

    The residual likelihood (Patterson and Thompson 1971) is that of what the design leaves. Fisher
    scoring solves ``1/2 tr(P K_i P K_j) dv_j = 1/2 (z' P K_i P z - tr(P K_i))`` for the variances
    that are not held at zero. Where its step lowers the likelihood, each variance is multiplied by
    ``sqrt(z' P K_i P z / tr(P K_i))`` instead, which never does (Zhou, Hu, Zhou and Lange 2019).

    Args:
        fixed: Known covariances F (b, r, r).
        kinds: Matrices K_i (b, r, r) of each kind.
        residual: Residuals z (b, r) of any fit of the design.
        design: Columns (b, r, p) that were fitted; p may be zero.
        told: Mask (c,) of the kinds whose variances are fitted; the others are zero.
    """
    count = len(kinds)
    K = np.stack(kinds) if count else np.zeros((0, *fixed.shape))
    free = np.ones(count, dtype=bool) if told is None else np.array(told)
    square = float((residual**2).sum()) / residual.size
    size = np.einsum("cbrr->c", K) / residual.size
    v = np.where(free & (size > 0), square / np.where(size > 0, size, 1.0) / max(count, 1), 0.0)
    at = _scores(fixed, K, residual, design, v)
    for _ in range(ITERATIONS if count else 0):
        after, there = _step(at, v, free, lambda w: _scores(fixed, K, residual, design, w))
        settled = (np.abs(after - v) * size).max(initial=0.0) <= SETTLED * square
        v, at = after, there
        if settled:
            break
    products = at.products
    likelihood = at.likelihood
    covariance = np.zeros((count, count))
    known = np.flatnonzero(v > 0)
    if len(known):
        covariance[np.ix_(known, known)] = np.linalg.pinv(0.5 * products[np.ix_(known, known)])
    return BlockVariances(v, covariance, likelihood)


@dataclass(frozen=True, eq=False)
class _Scores:
    """Terms of the likelihood's slope.

    Attributes:
        quadratic: ``z' P K_i P z`` (c,).
        trace: ``tr(P K_i)`` (c,).
        products: ``tr(P K_i P K_j)`` (c, c).
        likelihood: The residual log-likelihood.
    """

    quadratic: Array
    trace: Array
    products: Array
    likelihood: float


def _step(
    at: _Scores, v: Array, free: Mask, scores: Callable[[Array], _Scores]
) -> tuple[Array, _Scores]:
    """The next variances (c,), and the scores there."""
    slope = 0.5 * (at.quadratic - at.trace)
    moving = np.flatnonzero(free & ((v > 0) | (slope > 0)))
    step = np.zeros_like(v)
    F = 0.5 * at.products[np.ix_(moving, moving)]
    step[moving] = np.linalg.lstsq(F, slope[moving], rcond=None)[0]
    for _ in range(HALVINGS):
        after = np.maximum(v + step, 0.0)
        try:
            there = scores(after)
        except np.linalg.LinAlgError:  # without any variance nothing could be inverted
            step = step / 2
            continue
        if there.likelihood >= at.likelihood - 1e-9 * abs(at.likelihood):
            return after, there
        step = step / 2
    # Neither is negative, but by rounding, where the design leaves next to no residuals.
    both = (v > 0) & (at.quadratic > 0) & (at.trace > 0)
    ratio = np.divide(at.quadratic, at.trace, out=np.ones_like(v), where=both)
    after = v * np.sqrt(ratio)
    try:
        return after, scores(after)
    except np.linalg.LinAlgError:
        return v, at


def _scores(fixed: Array, K: Array, z: Array, X: Array, v: Array) -> _Scores:
    """The terms at variances v (c,)."""
    V = fixed + np.einsum("c,cbrs->brs", v, K)
    L = np.linalg.cholesky(V)
    inverse = np.linalg.inv(V)
    W = inverse @ X
    # As products of two matrices: einsum alone sums over so many rows one by one.
    XW = np.tensordot(X, W, axes=((0, 1), (0, 1)))
    H = np.linalg.pinv(XW, hermitian=True)
    y = np.einsum("brs,bs->br", inverse, z)
    k = H @ np.einsum("brp,br->p", X, y)
    Pz = y - W @ k
    quadratic = np.einsum("br,cbrs,bs->c", Pz, K, Pz)
    own = inverse @ K
    KW = K @ W
    G = np.moveaxis(np.tensordot(W, KW, axes=((0, 1), (1, 2))), 1, 0)
    trace = np.einsum("cbrr->c", own) - np.einsum("pq,cqp->c", H, G)
    HG = H @ G
    # tr(H W'K_c V^-1 K_d W) as sums over rows: matrices of all pairs of kinds would cost c times.
    before = (K @ (W @ H)).reshape(len(K), X.size)
    after = (inverse @ KW).reshape(len(K), X.size)
    products = (
        np.einsum("cbrs,dbsr->cd", own, own, optimize=True)
        - 2 * before @ after.T
        + np.einsum("cpq,dqp->cd", HG, HG)
    )
    values = np.linalg.eigvalsh(XW) if X.shape[-1] else np.ones(1)
    log_design = float(np.log(values[values > 0]).sum())
    log_V = 2 * float(np.log(np.diagonal(L, axis1=1, axis2=2)).sum())
    likelihood = -0.5 * (log_V + log_design + float((z * Pz).sum()))
    return _Scores(quadratic, trace, products, likelihood)


@dataclass(frozen=True, eq=False)
class PositionNoise:
    """Errors of a pose's positions, in millimetres and milliradians.

    A reading of all markers has the covariance ``R = r^2 I + sum_j s_j^2 J_j J_j'`` with the motion
    J_j of the markers by joint j: the joints move all of them together. Repeats average it out.
    What the model leaves out, ``D = w^2 I + e^2 sum_j J_j J_j'``, they do not: it is as if each
    joint were wrong by another small angle in each pose, as by gears that are not round.

    Attributes:
        reading: r [mm].
        joints: s (n,) [mrad, or mm of a prismatic joint].
        model_white: w [mm].
        model_joints: e (n,) likewise: the same for all joints of a kind, or one size a joint where
            the residuals speak for that.
        model_fit: The fitted variances of the model's part; None where none was fitted.
        repeats: Degrees of freedom of the repeats that told r and s; zero where they were stated.
        turn: The same as r, of orientations [mrad], where they are measured; their rows follow the
            positions of each marker.
        model_turn: The same as w, of orientations [mrad].
    """

    reading: float
    joints: Array
    model_white: float = 0.0
    model_joints: Array = field(default_factory=lambda: np.zeros(0))
    model_fit: BlockVariances | None = None
    repeats: int = 0
    turn: float | None = None
    model_turn: float = 0.0

    @property
    def rows(self) -> int:
        """Measured coordinates of a marker."""
        return 3 if self.turn is None else 6

    def white_kinds(self, width: int) -> list[Array]:
        """Masks (r,) of the coordinates that share a white error: positions, and orientations."""
        return white_kinds(self.rows, width)

    def _white(self, position: float, turn: float, width: int) -> Array:
        """Variances (r,) of white errors."""
        sizes = (position, turn)
        kinds = self.white_kinds(width)
        return np.asarray(sum(size**2 * kind for size, kind in zip(sizes, kinds, strict=False)))

    def of_reading(self, motion: Array) -> Array:
        """Covariances R (m, r, r) [mm^2] of one reading, for motions (m, r, n) [mm/mrad]."""
        J = motion * self.joints
        turn = max(self.turn or 0.0, ROUNDING)
        white = self._white(max(self.reading, ROUNDING), turn, motion.shape[1])
        return np.diag(white) + J @ np.swapaxes(J, 1, 2)

    def of_model(self, motion: Array) -> Array:
        """Covariances D (m, r, r) [mm^2] of what the model leaves out."""
        J = motion * (self.model_joints if len(self.model_joints) else 0.0)
        white = self._white(self.model_white, self.model_turn, motion.shape[1])
        return np.diag(white) + J @ np.swapaxes(J, 1, 2)

    def of_pose(self, motion: Array, counts: Indices) -> Array:
        """Covariances (m, r, r) of means over some readings.

        Args:
            motion: Motions (m, r, n) of the coordinates [mm/mrad].
            counts: Readings (m, k) of each marker; where there is none, the coordinates count as
                independent and of size one.
        """
        size = np.sqrt(np.repeat(np.maximum(counts, 1), self.rows, axis=1).astype(float))
        V = self.of_reading(motion) / (size[:, :, None] * size[:, None]) + self.of_model(motion)
        return only_seen(V, counts > 0)


def only_seen(V: Array, seen: Mask) -> Array:
    """Covariances (m, r, r) in which markers that were not seen are independent, of size one."""
    there = np.repeat(seen, V.shape[1] // seen.shape[1], axis=1).astype(float)
    absent = np.eye(V.shape[1]) * (1 - there)[:, None]
    return V * there[:, :, None] * there[:, None] + absent


def white_kinds(rows: int, width: int) -> list[Array]:
    """Masks (width,) of the coordinates that share a white error: positions, and orientations."""
    if rows == 3:
        return [np.ones(width)]
    turns = np.arange(width) % rows >= 3
    return [(~turns).astype(float), turns.astype(float)]


def joint_kinds(slides: Mask) -> list[Mask]:
    """Masks (n,) of the joints that share one size of the model's error: by kind."""
    return [mask for mask in (~slides, slides) if mask.any()]


def single_joints(slides: Mask) -> list[Mask]:
    """Masks (n,) of the joints where each has a size of its own."""
    return list(np.eye(len(slides), dtype=bool))


def fitted_kinds(slides: Mask, variances: int, whites: int) -> list[Mask]:
    """The masks (n,) that so many variances are of: those of coordinates come first."""
    kinds = joint_kinds(slides)
    return kinds if variances == whites + len(kinds) else single_joints(slides)


def noise_of_repeats(
    data: MarkerPositions, motion: Array, stated: PositionNoise
) -> tuple[PositionNoise, BlockVariances | None]:
    """Tell the noise of a reading from visits of the same pose.

    Differences of the visits of a pose hold no model at all: ``v - 1`` orthonormal contrasts of v
    visits have the covariance R of a reading each.

    Args:
        data: All visits.
        motion: Motions (poses, 3k, n) of the coordinates by the joints [mm/mrad].
        stated: The noise that counts where there are too few repeats.
    """
    contrasts, pose = contrasts_of(data)
    if contrasts.size < ENOUGH:
        return stated, None
    J = motion[pose]
    n = motion.shape[2]
    shape = (len(J), J.shape[1], J.shape[1])
    eye = np.broadcast_to(np.eye(J.shape[1]), shape)
    whites = stated.white_kinds(J.shape[1])
    kinds = [
        *(np.broadcast_to(np.diag(white), shape) for white in whites),
        *(J[:, :, [j]] @ np.swapaxes(J[:, :, [j]], 1, 2) for j in range(n)),
    ]
    nothing = np.zeros((*contrasts.shape, 0))
    found = fit_variances_of_blocks(ROUNDING**2 * eye, kinds, contrasts, nothing)
    sizes = np.sqrt(found.variances)
    reading, *turn = np.maximum(sizes[: len(whites)], ROUNDING).tolist()
    told = PositionNoise(
        reading,
        sizes[len(whites) :],
        repeats=contrasts.size,
        turn=turn[0] if turn else None,
    )
    return told, found


def contrasts_of(data: MarkerPositions) -> tuple[Array, Indices]:
    """Orthonormal contrasts (c, r) of whole visits of a pose [mm, mrad], and their poses (c,)."""
    whole = data.seen.all(axis=1)
    rows: list[Array] = []
    poses: list[int] = []
    for pose in range(data.poses):
        visits = np.flatnonzero(whole & (data.pose == pose))
        if len(visits) < 2:
            continue
        z = 1e3 * _coordinates(data, visits).reshape(len(visits), -1)
        # Helmert: each visit against the mean of those before it.
        for i in range(1, len(visits)):
            rows.append((z[i] - z[:i].mean(axis=0)) * np.sqrt(i / (i + 1)))
            poses.append(pose)
    width = data.rows * len(data.markers)
    return np.array(rows).reshape(-1, width), np.array(poses, dtype=int)


def _coordinates(data: MarkerPositions, visits: Indices) -> Array:
    """Positions, and orientations as turns from that of the first visit (v, k, rows) [m, rad]."""
    x = data.measured[visits]
    if data.turns is None:
        return x
    turned = data.turns[visits] @ np.swapaxes(data.turns[visits[:1]], -1, -2)
    return np.concatenate([x, rotation_vectors(turned)], axis=-1)


def fit_model_error(
    noise: PositionNoise,
    motion: Array,
    counts: Indices,
    residual: Array,
    design: Array,
    slides: Mask,
    singly: bool = False,
) -> PositionNoise:
    """Tell what the model leaves out from the residuals of poses.

    It is nothing unless the residuals speak for it: variances that cannot be negative are too large
    on average where there is nothing to be found, and so would be all covariances. Likewise joints
    have sizes of their own only where these gain more than as many free numbers would by chance
    (Akaike 1974): a load that nobody told, for one, turns some joints and not others.

    Args:
        noise: The noise of a reading, which stays.
        motion: Motions (m, 3k, n) [mm/mrad].
        counts: Readings (m, k) of each marker.
        residual: Residuals (m, 3k) [mm], zero where nothing was seen.
        design: Columns (m, 3k, p) [mm per unit], zero there too.
        slides: Which joints (n,) are prismatic.
        singly: Whether each joint may have a size of its own.
    """
    rigid = np.zeros(len(slides))
    plain = PositionNoise(
        noise.reading, noise.joints, 0.0, rigid, repeats=noise.repeats, turn=noise.turn
    )
    there = np.repeat(counts > 0, noise.rows, axis=1).astype(float)
    J = motion * there[:, :, None]
    whites = [np.diag(kind) * there[:, None] for kind in noise.white_kinds(J.shape[1])]
    masks = joint_kinds(slides)
    fixed = plain.of_pose(motion, counts)

    def fitted(masks: list[Mask]) -> BlockVariances:
        kinds = [*whites, *(J[:, :, mask] @ np.swapaxes(J[:, :, mask], 1, 2) for mask in masks)]
        return fit_variances_of_blocks(fixed, kinds, residual, design)

    found = fitted(masks)
    nothing = fit_variances_of_blocks(fixed, (), residual, design)
    if 2 * (found.log_likelihood - nothing.log_likelihood) < SPEAKS:
        return plain
    single = single_joints(slides)
    if singly and len(single) > len(masks):
        each = fitted(single)
        if each.log_likelihood - found.log_likelihood > len(single) - len(masks):
            found, masks = each, single
    sizes = np.sqrt(found.variances)
    joints = rigid.copy()
    for mask, size in zip(masks, sizes[len(whites) :], strict=True):
        joints[mask] = size
    return PositionNoise(
        noise.reading,
        noise.joints,
        float(sizes[0]),
        joints,
        found,
        noise.repeats,
        noise.turn,
        float(sizes[1]) if len(whites) > 1 else 0.0,
    )
