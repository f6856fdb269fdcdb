"""How large errors are, by restricted likelihood: of instruments, joints, visits, and the model."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from edtk.fit.geometry.marker_positions import MarkerPositions
from edtk.measure.position_noise import ROUNDING, BlockVariances, PositionNoise
from edtk.measure.whitening import of_rows
from edtk.robots.rotations import rotation_vectors
from edtk.system.typing import Array, Indices, Mask

ITERATIONS = 60  # of Fisher scoring; ten are the rule
SETTLED = 1e-4  # relative change of what a variance adds to the total
HALVINGS = 4  # of a step that lowers the likelihood, before a step that cannot takes its place
ENOUGH = 20  # degrees of freedom of repeats, from which they tell the noise of a reading
# Twice the gain in log-likelihood, from which a model error is believed: chance exceeds it one time
# in twenty, or in forty where the variance may not be negative.
SPEAKS = 4.0


@dataclass(frozen=True, eq=False)
class Blocks:
    """Independent blocks b of residuals, as many rows r each: ``V_b = F_b + sum_i v_i K_ib``.

    Attributes:
        fixed: Known covariances F (b, r, r).
        kinds: Matrices K_i (b, r, r) of each kind.
        residual: Residuals z (b, r) of any fit of the design.
        design: Columns (b, r, p) that were fitted; p may be zero.
    """

    fixed: Array
    kinds: Sequence[Array]
    residual: Array
    design: Array


def fit_variances(
    blocks: Sequence[Blocks], told: Mask | None = None, settled: float = SETTLED
) -> BlockVariances:
    """Fit the variances of all kinds to all blocks.

    The residual likelihood (Patterson and Thompson 1971) is that of what the design leaves. With
    ``P = V^-1 - V^-1 X (X' V^-1 X)^-1 X' V^-1``, Fisher scoring solves
    ``1/2 tr(P K_i P K_j) dv_j = 1/2 (z' P K_i P z - tr(P K_i))`` for the variances that are not
    held at zero. Where its step lowers the likelihood, each variance is multiplied by
    ``sqrt(z' P K_i P z / tr(P K_i))`` instead, which never does (Zhou, Hu, Zhou and Lange 2019).

    Args:
        blocks: The residuals, those of one size together, with the same kinds.
        told: Mask (c,) of the kinds whose variances are fitted; the others are zero.
        settled: Change of what a variance adds, over the mean square, below which it has settled.

    Raises:
        numpy.linalg.LinAlgError: Without variances, what is known is no covariance.
    """
    stacked = [_Stacked.of(some) for some in blocks]
    count = len(blocks[0].kinds)
    free = np.ones(count, dtype=bool) if told is None else np.array(told)
    coordinates = sum(some.residual.size for some in blocks)
    square = sum(float((some.residual**2).sum()) for some in blocks) / coordinates
    size = sum((np.einsum("cbrr->c", some.K) for some in stacked), np.zeros(count)) / coordinates
    unit = _powers_of_two(size)
    stacked = [some.in_units(unit) for some in stacked]
    size = size / unit
    v = np.where(free & (size > 0), square / np.where(size > 0, size, 1.0) / max(count, 1), 0.0)
    at = _scores(stacked, v)
    for _ in range(ITERATIONS if count else 0):
        after, there = _step(at, v, free, lambda w: _scores(stacked, w))
        still = (np.abs(after - v) * size).max(initial=0.0) <= settled * square
        v, at = after, there
        if still:
            break
    covariance = np.zeros((count, count))
    known = np.flatnonzero(v > 0)
    if len(known):
        covariance[np.ix_(known, known)] = np.linalg.pinv(0.5 * at.products[np.ix_(known, known)])
    return BlockVariances(v / unit, covariance / np.outer(unit, unit), at.likelihood)


def _powers_of_two(size: Array) -> Array:
    """Units (c,) in which kinds are of order one, which cost no rounding; one where there is none.

    Variances of angles and of coordinates differ by ten powers of ten, which Fisher's information
    would show as a singular matrix.
    """
    there = np.where(size > 0, size, 1.0)
    return np.asarray(np.exp2(np.rint(np.log2(there))))


@dataclass(frozen=True, eq=False)
class _Stacked:
    """Blocks with their kinds K (c, b, r, r) in one array."""

    fixed: Array
    K: Array
    z: Array
    X: Array

    @classmethod
    def of(cls, blocks: Blocks) -> "_Stacked":
        """Of blocks with any kinds, or none."""
        kinds = blocks.kinds
        K = np.stack(kinds) if len(kinds) else np.zeros((0, *blocks.fixed.shape))
        return cls(blocks.fixed, K, blocks.residual, blocks.design)

    def in_units(self, unit: Array) -> "_Stacked":
        """With kinds over units (c,)."""
        return replace(self, K=self.K / unit[:, None, None, None])


@dataclass(frozen=True, eq=False)
class _Weighted:
    """Blocks in units of their covariances V.

    Attributes:
        inverse: V^-1 (b, r, r).
        W: ``V^-1 X`` (b, r, p).
        y: ``V^-1 z`` (b, r).
        log_V: Logarithm of the determinant.
    """

    inverse: Array
    W: Array
    y: Array
    log_V: float

    @classmethod
    def of(cls, some: _Stacked, v: Array) -> "_Weighted":
        """At variances v (c,)."""
        V = some.fixed + np.einsum("c,cbrs->brs", v, some.K)
        L = np.linalg.cholesky(V)
        inverse = np.linalg.inv(V)
        y = np.einsum("brs,bs->br", inverse, some.z)
        log_V = 2 * float(np.log(np.diagonal(L, axis1=1, axis2=2)).sum())
        return cls(inverse, inverse @ some.X, y, log_V)


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


def _scores(blocks: Sequence[_Stacked], v: Array) -> _Scores:
    """The terms at variances v (c,)."""
    weighted = [_Weighted.of(some, v) for some in blocks]
    pairs = list(zip(blocks, weighted, strict=True))
    # As products of two matrices: einsum alone sums over so many rows one by one.
    XW = sum(np.tensordot(some.X, own.W, axes=((0, 1), (0, 1))) for some, own in pairs)
    H = np.asarray(np.linalg.pinv(XW, hermitian=True), dtype=float)
    onto = sum(np.einsum("brp,br->p", some.X, own.y) for some, own in pairs)
    k = np.asarray(H @ onto, dtype=float)
    parts = [_terms(some, own, H, k) for some, own in pairs]
    G = sum(part.G for part in parts)
    HG = H @ G
    values = np.linalg.eigvalsh(XW) if len(H) else np.ones(1)
    log_design = float(np.log(values[values > 0]).sum())
    log_V = sum(own.log_V for own in weighted)
    square = sum(part.square for part in parts)
    return _Scores(
        quadratic=np.asarray(sum(part.quadratic for part in parts)),
        trace=sum(part.trace for part in parts) - np.einsum("pq,cqp->c", H, G),
        products=sum(part.products for part in parts) + np.einsum("cpq,dqp->cd", HG, HG),
        likelihood=-0.5 * (log_V + log_design + square),
    )


@dataclass(frozen=True, eq=False)
class _Terms:
    """What blocks of one size add to the scores, before the design is taken out of all together.

    Attributes:
        quadratic: ``z' P K_i P z`` (c,).
        trace: ``tr(V^-1 K_i)`` (c,).
        products: ``tr(V^-1 K_i V^-1 K_j)`` less twice what the design takes of it (c, c).
        G: ``X' V^-1 K_i V^-1 X`` (c, p, p).
        square: ``z' P z``.
    """

    quadratic: Array
    trace: Array
    products: Array
    G: Array
    square: float


def _terms(some: _Stacked, own: _Weighted, H: Array, k: Array) -> _Terms:
    """Of blocks, with ``H = (X' V^-1 X)^-1`` and coefficients k (p,) of all."""
    K, W = some.K, own.W
    Pz = own.y - W @ k
    each = own.inverse @ K
    KW = K @ W
    # tr(H W'K_c V^-1 K_d W) as sums over rows: matrices of all pairs of kinds would cost c times.
    before = (K @ (W @ H)).reshape(len(K), some.X.size)
    after = (own.inverse @ KW).reshape(len(K), some.X.size)
    return _Terms(
        quadratic=np.einsum("br,cbrs,bs->c", Pz, K, Pz),
        trace=np.einsum("cbrr->c", each),
        products=np.einsum("cbrs,dbsr->cd", each, each, optimize=True) - 2 * before @ after.T,
        G=np.moveaxis(np.tensordot(W, KW, axes=((0, 1), (1, 2))), 1, 0),
        square=float((some.z * Pz).sum()),
    )


def joint_kinds(slides: Mask) -> list[Mask]:
    """Masks (n,) of the joints that share one size of the model's error: by kind."""
    return [mask for mask in (~slides, slides) if mask.any()]


def single_joints(slides: Mask) -> list[Mask]:
    """Masks (n,) of the joints where each has a size of its own."""
    return list(np.eye(len(slides), dtype=bool))


def fitted_kinds(slides: Mask, variances: int, whites: int) -> list[Mask]:
    """The masks (n,) that so many variances are of: those of coordinates come first."""
    kinds = joint_kinds(slides)
    if variances == whites:
        return []
    return kinds if variances == whites + len(kinds) else single_joints(slides)


def noise_of_repeats(
    data: MarkerPositions, motion: Array, places: Array, stated: PositionNoise
) -> tuple[PositionNoise, BlockVariances | None]:
    """Tell the noise of a reading from visits of the same pose.

    Differences of the visits of a pose hold no model at all: ``v - 1`` orthonormal contrasts of v
    visits have the covariance R of a reading each. A stated tracker keeps the shape of its errors
    and its share beside white ones; the repeats tell their common size.

    Args:
        data: All visits.
        motion: Motions (poses, 3k, n) of the coordinates by the joints [mm/mrad].
        places: Where the markers are (poses, k, 3), in the frame of the instrument [m].
        stated: The noise that counts where there are too few repeats.
    """
    contrasts, pose = contrasts_of(data)
    dof = len(contrasts) * int(data.present.sum())
    if dof < ENOUGH:
        return stated, None
    J = motion[pose]
    n = motion.shape[2]
    shape = (len(J), J.shape[1], J.shape[1])
    eye = np.broadcast_to(np.eye(J.shape[1]), shape)
    there = data.present.reshape(-1)
    alike = stated.squared_ratios(J.shape[1])
    whites = [kind * there * alike for kind in stated.white_kinds(J.shape[1])]
    kinds = [
        *(np.broadcast_to(np.diag(white), shape) for white in whites),
        *(J[:, :, [j]] @ np.swapaxes(J[:, :, [j]], 1, 2) for j in range(n)),
    ]
    if stated.tracker is not None:
        kinds[0] = stated.of_instrument(places[pose], J.shape[1]) * np.outer(*[whites[0] > 0] * 2)
    nothing = np.zeros((*contrasts.shape, 0))
    found = fit_variances([Blocks(ROUNDING**2 * eye, kinds, contrasts, nothing)])
    sizes = np.sqrt(found.variances)
    reading, *turn = np.maximum(sizes[: len(whites)], ROUNDING).tolist()
    read = replace(stated, reading=reading) if stated.tracker is None else stated.scaled(reading)
    told = replace(
        read,
        joints=sizes[len(whites) :],
        repeats=dof,
        unknown=False,
        turn=turn[0] if turn else None,
    )
    return told, found


def contrasts_of(data: MarkerPositions) -> tuple[Array, Indices]:
    """Orthonormal contrasts (c, r) of whole visits of a pose [mm, mrad], and their poses (c,).

    They are as large as those of single readings; rows that nothing reads are zero.
    """
    whole = data.seen.all(axis=1)
    rows: list[Array] = []
    poses: list[int] = []
    for pose in range(data.poses):
        visits = np.flatnonzero(whole & (data.pose == pose))
        if len(visits) < 2:
            continue
        z = 1e3 * _coordinates(data, visits).reshape(len(visits), -1)
        # A difference has the noise of two readings.
        z = z / np.sqrt(2.0) if data.is_difference[visits[0]] else z
        # Helmert: each visit against the mean of those before it.
        for i in range(1, len(visits)):
            rows.append((z[i] - z[:i].mean(axis=0)) * np.sqrt(i / (i + 1)))
            poses.append(pose)
    width = data.rows * len(data.markers)
    return np.array(rows).reshape(-1, width), np.array(poses, dtype=int)


def _coordinates(data: MarkerPositions, visits: Indices) -> Array:
    """Positions, and orientations as turns from that of the first visit (v, k, rows) [m, rad]."""
    x = np.where(data.rows_seen[visits, :, :3], data.measured[visits], 0.0)
    if data.turns is None:
        return x
    turned = data.turns[visits] @ np.swapaxes(data.turns[visits[:1]], -1, -2)
    turned = np.where(data.rows_seen[visits, :, 3:, None], turned, np.eye(3))
    return np.concatenate([x, rotation_vectors(turned)], axis=-1)


def fit_model_error(
    noise: PositionNoise,
    motion: Array,
    places: Array,
    counts: Array | Indices,
    residual: Array,
    design: Array,
    slides: Mask,
    singly: bool = False,
    differs: Mask | None = None,
) -> PositionNoise:
    """Tell what the model leaves out from the residuals of poses.

    It is nothing unless the residuals speak for it: variances that cannot be negative are too large
    on average where there is nothing to be found, and so would be all covariances. Likewise joints
    have sizes of their own only where these gain more than as many free numbers would by chance
    (Akaike 1974): a load that nobody told, for one, turns some joints and not others. Where the
    size of the instrument's errors is unknown, it is fitted with them, and stands for all that is
    white.

    Args:
        noise: The noise of a reading, which stays.
        motion: Motions (m, 3k, n) [mm/mrad].
        places: Where the markers are (m, k, 3), in the frame of the instrument [m].
        counts: Readings (m, k) of each marker, or what those of each row (m, k, rows) are worth.
        residual: Residuals (m, 3k) [mm], zero where nothing was seen.
        design: Columns (m, 3k, p) [mm per unit], zero there too.
        slides: Which joints (n,) are prismatic.
        singly: Whether each joint may have a size of its own.
        differs: Which poses (m,) are differences of two readings, whose errors have a size of
            their own; None for none.
    """
    rigid = np.zeros(len(slides))
    plain = replace(
        noise,
        model_white=0.0,
        model_joints=rigid,
        model_fit=None,
        model_turn=0.0,
        model_change=(0.0, 0.0),
    )
    differs = np.zeros(len(motion), dtype=bool) if differs is None else differs
    kinds = _model_kinds(plain, places, of_rows(counts, motion.shape[1]), differs)
    J = motion * kinds.absolute[:, :, None]
    masks = joint_kinds(slides)
    exact = plain.sized((0.0, 0.0)) if plain.unknown else plain
    fixed = exact.of_pose(motion, places, counts)

    def fitted(masks: list[Mask]) -> BlockVariances:
        of_joints = (J[:, :, mask] @ np.swapaxes(J[:, :, mask], 1, 2) for mask in masks)
        every = [*kinds.whites, *of_joints, *kinds.changes]
        return fit_variances([Blocks(fixed, every, residual, design)])

    found = fitted(masks)
    least = kinds.whites if plain.unknown else ()
    nothing = fit_variances([Blocks(fixed, least, residual, design)])
    if 2 * (found.log_likelihood - nothing.log_likelihood) < SPEAKS:
        if not plain.unknown:
            return plain
        found, masks = nothing, []
    single = single_joints(slides)
    if singly and len(single) > len(masks) > 0:
        each = fitted(single)
        if each.log_likelihood - found.log_likelihood > len(single) - len(masks):
            found, masks = each, single
    return _with_model_error(plain, found, masks, len(kinds.whites))


@dataclass(frozen=True, eq=False)
class _ModelKinds:
    """What white errors may add to the poses.

    Attributes:
        absolute: Which rows (m, r) absolute readings have.
        whites: Of these (m, r, r), or of an instrument of unknown size.
        changes: Of differences (m, r, r); none without any.
    """

    absolute: Array
    whites: list[Array]
    changes: list[Array]


def _model_kinds(noise: PositionNoise, places: Array, worth: Array, differs: Mask) -> _ModelKinds:
    """The kinds of white errors of readings that are worth so much (m, r)."""
    there = (worth > 0).astype(float)
    absolute = there * ~differs[:, None]
    alike = noise.white_kinds(worth.shape[1])
    if noise.unknown:
        root = there / np.sqrt(np.where(worth > 0, worth, 1.0))
        V = noise.of_instrument(places, worth.shape[1]) * root[:, :, None] * root[:, None]
        return _ModelKinds(absolute, [V * np.outer(kind, kind) for kind in alike], [])
    whites = [np.diag(kind) * absolute[:, None] for kind in alike]
    changes = [np.diag(kind) * (there - absolute)[:, None] for kind in alike]
    return _ModelKinds(absolute, whites, changes if differs.any() else [])


def _with_model_error(
    plain: PositionNoise, found: BlockVariances, masks: list[Mask], whites: int
) -> PositionNoise:
    """The noise with fitted variances: of white errors, of joints that masks tell, of changes."""
    sizes = np.sqrt(found.variances)
    joints = np.zeros_like(plain.model_joints)
    last = whites + len(masks)
    for mask, size in zip(masks, sizes[whites:last], strict=True):
        joints[mask] = size
    change = [*sizes[last:].tolist(), 0.0, 0.0]
    # Bands are those of absolute readings, of which differences tell nothing.
    of_told = found.covariance[:last, :last]
    told = replace(found, variances=found.variances[:last], covariance=of_told)
    if plain.unknown:
        return replace(plain.sized(sizes.tolist()), model_joints=joints, model_fit=told)
    return replace(
        plain,
        model_white=float(sizes[0]),
        model_joints=joints,
        model_fit=told,
        model_turn=float(sizes[1]) if whites > 1 else 0.0,
        model_change=(change[0], change[1]),
    )
