"""How large errors are, by restricted likelihood: of instruments, joints, visits, and the model."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from edtk.fit.marker_positions import MarkerPositions
from edtk.measure.few_columns import FewColumns, between, inverse_of, summed
from edtk.measure.position_noise import ROUNDING, BlockVariances, PositionNoise
from edtk.measure.whitening import Precision, Scatter, blocks_times, diagonal_blocks, of_rows
from edtk.robots.rotations import rotation_vectors
from edtk.system.typing import Array, Indices, Mask

SCORING_STEPS = 60  # of Fisher scoring; ten are the rule
SETTLED = 1e-4  # relative change of what a variance adds to the total
HALVINGS = 4  # of a step that lowers the likelihood, before a step that cannot takes its place
ENOUGH_REPEATS = 20  # degrees of freedom of repeats, from which they tell the noise of a reading
# Gain in log-likelihood of a step that is worth another way where rounding hides it: a variance is
# off by a thirtieth of its standard deviation. Where errors of a drawing are a million times those
# of a fit, variances would wander about their best values.
WORTH = 5e-4
# Twice the gain in log-likelihood, from which a model error is believed: chance exceeds it one time
# in twenty, or in forty where the variance may not be negative.
SPEAKS = 4.0


@dataclass(frozen=True, eq=False)
class Blocks:
    """Independent blocks b of residuals, as many rows r each: ``V_b = F_b + sum_i v_i K_ib``.

    Attributes:
        fixed: Known covariances F of blocks.
        kinds: Of each kind K_i the blocks of its instruments (b, k, d, d), ``r = k d``, which it
            moves one by one; or U_i (b, r, n), ``K_i = U_i U_i'``, where it moves all together.
        residual: Residuals z (b, r) of any fit of the design.
        design: Columns (b, r, p) that were fitted; p may be zero.
    """

    fixed: Scatter
    kinds: Sequence[Array]
    residual: Array
    design: FewColumns

    @classmethod
    def dense(
        cls, fixed: Array, kinds: Sequence[Array], residual: Array, design: Array
    ) -> "Blocks":
        """Of matrices F and K_i (b, r, r) without such a form, as of one instrument."""
        apart = [kind[:, None] for kind in kinds]
        return cls(Scatter.of(fixed), apart, residual, FewColumns.among(design, 1))


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
    count = len(blocks[0].kinds)
    free = np.ones(count, dtype=bool) if told is None else np.array(told)
    coordinates = sum(some.residual.size for some in blocks)
    square = sum(float((some.residual**2).sum()) for some in blocks) / coordinates
    each = [[_trace(kind) for kind in some.kinds] for some in blocks]
    size = np.sum(np.reshape(each, (len(blocks), count)), axis=0) / coordinates
    unit = _powers_of_two(size)
    stacked = [_in_units(some, unit) for some in blocks]
    size = size / unit
    v = np.where(free & (size > 0), square / np.where(size > 0, size, 1.0) / max(count, 1), 0.0)
    at = _scores(stacked, v)
    for _ in range(SCORING_STEPS if count else 0):
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
    gain = 0.5 * float(slope @ step)
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
    if gain < WORTH:
        return v, at
    # Neither is negative, but by rounding, where the design leaves next to no residuals.
    both = (v > 0) & (at.quadratic > 0) & (at.trace > 0)
    ratio = np.divide(at.quadratic, at.trace, out=np.ones_like(v), where=both)
    after = v * np.sqrt(ratio)
    try:
        return after, scores(after)
    except np.linalg.LinAlgError:
        return v, at


def _moves_together(kind: Array) -> bool:
    """Whether a kind is told by what it moves all instruments by."""
    return kind.ndim == 3


def _trace(kind: Array) -> float:
    """Trace of a kind, over all blocks."""
    return float((kind**2).sum() if _moves_together(kind) else np.einsum("bkdd->", kind))


def _in_units(some: Blocks, unit: Array) -> Blocks:
    """With kinds over units (c,)."""
    kinds = [
        kind / (np.sqrt(one) if _moves_together(kind) else one)
        for kind, one in zip(some.kinds, unit, strict=True)
    ]
    return replace(some, kinds=kinds)


def _covariance(some: Blocks, v: Array) -> Scatter:
    """``V = F + sum_i v_i K_i`` at variances v (c,)."""
    apart, together = some.fixed.apart, [some.fixed.together]
    for kind, variance in zip(some.kinds, v, strict=True):
        if not _moves_together(kind):
            apart = apart + variance * kind
        elif variance > 0:
            together.append(np.sqrt(variance) * kind)
    return Scatter(apart, np.concatenate(together, axis=-1))


def _scores(blocks: Sequence[Blocks], v: Array) -> _Scores:
    """The terms at variances v (c,)."""
    weighted = [_Together.of(some, _covariance(some, v).inverse) for some in blocks]
    information = sum(own.some.design.information(own.weights, own.F) for own in weighted)
    H, log_design = inverse_of(np.asarray(information))
    k = np.asarray(H @ sum(own.onto for own in weighted))
    parts = [_Terms.of(own, H, k) for own in weighted]
    G = np.asarray(sum(part.G for part in parts))
    HG = H @ G
    log_V = sum(own.weights.log_det for own in weighted)
    square = sum(part.square for part in parts)
    return _Scores(
        quadratic=np.asarray(sum(part.quadratic for part in parts)),
        trace=sum(part.trace for part in parts) - (G * H).sum(axis=(1, 2)),
        products=sum(part.products for part in parts) + np.tensordot(HG, HG, axes=((1, 2), (2, 1))),
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

    @classmethod
    def of(cls, together: "_Together", H: Array, k: Array) -> "_Terms":
        """Of blocks, with ``H = (X' V^-1 X)^-1`` and coefficients k (p,) of all."""
        some, weights = together.some, together.weights
        Pz = together.Wz - weights.times(some.design.times(k)[..., None])
        DH = together.D @ H
        apart = {
            i: _Apart.of(kind, together)
            for i, kind in enumerate(some.kinds)
            if not _moves_together(kind)
        }
        quadratic, trace, products, G = together.terms(Pz, DH)
        for i, one in apart.items():
            quadratic[i] = float((Pz * blocks_times(one.K, Pz)).sum())
            trace[i] = _trace_beside(weights, one.K, one.moved)
            G[i] = one.G
            products[i] = products[:, i] = one.with_those_together(DH)
        for i, one in apart.items():
            for j, other in apart.items():
                if j <= i:
                    products[i, j] = products[j, i] = one.product(other, H)
        square = float((some.residual[..., None] * Pz).sum())
        return cls(quadratic, trace, products, G, square)


@dataclass(frozen=True, eq=False)
class _Together:
    """The kinds ``K_i = U_i U_i'`` that move all instruments together, side by side.

    Attributes:
        some: The blocks.
        weights: ``V^-1 = A - B B'``.
        of_kind: Whether a column (u,) is one of a kind (c, u): one or zero.
        U: The columns (b, r, u).
        W: ``V^-1 U`` (b, r, u).
        Wz: ``V^-1 z`` (b, r, 1).
        F: ``B' X`` (b, n, p).
        D: ``U' V^-1 X`` (b, u, p).
        onto: ``X' V^-1 z`` (p,).
    """

    some: Blocks
    weights: Precision
    of_kind: Array
    U: Array
    W: Array
    Wz: Array
    F: Array
    D: Array
    onto: Array

    @classmethod
    def of(cls, some: Blocks, weights: Precision) -> "_Together":
        """Those of blocks; there may be none."""
        widths = [kind.shape[-1] if _moves_together(kind) else 0 for kind in some.kinds]
        of_kind = np.repeat(np.eye(len(widths)), widths, axis=1)
        own = [kind for kind in some.kinds if _moves_together(kind)]
        every = np.concatenate([*own, some.residual[..., None]], axis=-1)
        W = weights.times(every)
        n = weights.together.shape[-1]
        seen = some.design.seen_by(np.concatenate([weights.together, W], axis=-1))
        F, D, onto = seen[:, :n], seen[:, n:-1], seen[:, -1].sum(axis=0)
        return cls(some, weights, of_kind, every[..., :-1], W[..., :-1], W[..., -1:], F, D, onto)

    def terms(self, Pz: Array, DH: Array) -> tuple[Array, Array, Array, Array]:
        """Quadratic forms, traces, products and G of these kinds; zero of the others.

        Args:
            Pz: P z (b, r, 1).
            DH: ``U' V^-1 X (X' V^-1 X)^-1`` (b, u, p).
        """
        of = self.of_kind
        transposed = np.swapaxes(self.U, 1, 2)
        seen = transposed @ self.W
        through = DH @ np.swapaxes(self.D, 1, 2)
        pairs = (seen**2 - 2 * seen * through).sum(axis=0)
        p = self.D.shape[-1]
        G = [summed(self.D[:, own], self.D[:, own]) for own in of > 0]
        quadratic = of @ ((transposed @ Pz) ** 2).sum(axis=(0, 2))
        trace = of @ (self.U * self.W).sum(axis=(0, 1))
        return quadratic, trace, of @ pairs @ of.T, np.reshape(G, (len(of), p, p))


@dataclass(frozen=True, eq=False)
class _Apart:
    """A kind K that moves instruments one by one.

    Attributes:
        K: Its blocks (b, k, d, d).
        beside: The kinds that do not, and the weights.
        moved: ``K C`` (b, r, n + u) of ``C = [B, V^-1 U]``.
        D: ``C' K V^-1 X`` (b, n + u, p).
        G: ``X' V^-1 K V^-1 X`` (p, p).
    """

    K: Array
    beside: _Together
    moved: Array
    D: Array
    G: Array

    @classmethod
    def of(cls, K: Array, beside: _Together) -> "_Apart":
        """Of its blocks."""
        moved = blocks_times(K, np.concatenate([beside.weights.together, beside.W], axis=-1))
        G, D = between(beside.some.design, beside.weights, K, beside.F, moved)
        return cls(K, beside, moved, D, G)

    def with_those_together(self, DH: Array) -> Array:
        """The same (c,) as `product` with each kind that moves all together; zero with others."""
        beside = self.beside
        n = beside.F.shape[1]
        each = (beside.W * self.moved[..., n:]).sum(axis=(0, 1))
        return np.asarray(beside.of_kind @ (each - 2 * (DH * self.D[:, n:]).sum(axis=(0, 2))))

    def product(self, other: "_Apart", H: Array) -> float:
        """``tr(V^-1 K V^-1 L) - 2 tr(H X' V^-1 K V^-1 L V^-1 X)`` of this and another kind L.

        Between the two ``K V^-1 L = K A L - K B (L B)'``, of which the first moves instruments one
        by one again.
        """
        weights = self.beside.weights
        inner = self.K @ weights.apart @ other.K
        inner = (inner + np.swapaxes(inner, -1, -2)) / 2
        moved = blocks_times(inner, weights.together)
        G = between(self.beside.some.design, weights, inner, self.beside.F, moved)[0]
        n = moved.shape[-1]
        crossed = float((self.moved[..., :n] * weights.times(other.moved[..., :n])).sum())
        taken = float((H * G).sum()) - float(((self.D[:, :n] @ H) * other.D[:, :n]).sum())
        return _trace_beside(weights, inner, moved) - crossed - 2 * taken


def _trace_beside(weights: Precision, K: Array, moved: Array) -> float:
    """``tr(V^-1 K)`` of blocks K (b, k, d, d), with ``K C`` (b, r, c) of which B comes first."""
    B = weights.together
    return float((weights.apart * K).sum() - (B * moved[..., : B.shape[-1]]).sum())


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
    if dof < ENOUGH_REPEATS:
        return stated, None
    J = motion[pose]
    m, width, n = J.shape
    k = len(data.markers)
    there = data.present.reshape(-1)
    alike = stated.squared_ratios(width)
    whites = [(kind * there * alike).reshape(k, -1) for kind in stated.white_kinds(width)]
    kinds = [np.tile(diagonal_blocks(white), (m, 1, 1, 1)) for white in whites]
    if stated.tracker is not None:
        read_at = (whites[0] > 0).astype(float)
        kinds[0] = stated.apart(places[pose], width) * (read_at[..., None] * read_at[:, None])
    white = np.full((m, k, width // k), ROUNDING**2)
    fixed = Scatter(diagonal_blocks(white), np.zeros((m, width, 0)))
    nothing = FewColumns.among(np.zeros((m, width, 0)), k)
    found = fit_variances(
        [Blocks(fixed, [*kinds, *(J[..., [j]] for j in range(n))], contrasts, nothing)]
    )
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
    design: FewColumns,
    slides: Mask,
    singly: bool = False,
    differs: Mask | None = None,
    changes: Array | None = None,
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
        design: Columns X (m, 3k, p) [mm per unit], zero there too.
        slides: Which joints (n,) are prismatic.
        singly: Whether each joint may have a size of its own.
        differs: Which poses (m,) are differences of two readings, whose errors have a size of
            their own; None for none.
        changes: What shares (m, k, rows) of the variance of a change are in the rows, see
            `PositionNoise.of_pose`.
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
    share = of_rows(differs[:, None] if changes is None else changes, motion.shape[1])
    kinds = _model_kinds(plain, places, of_rows(counts, motion.shape[1]), differs, share)
    J = motion * kinds.absolute[:, :, None]
    masks = joint_kinds(slides)
    exact = plain.sized((0.0, 0.0)) if plain.unknown else plain
    fixed = exact.of_pose(motion, places, counts)
    columns = design.independent()

    def fitted(masks: list[Mask]) -> BlockVariances:
        every = [*kinds.whites, *(J[..., mask] for mask in masks), *kinds.changes]
        return fit_variances([Blocks(fixed, every, residual, columns)])

    found = fitted(masks)
    least = kinds.whites if plain.unknown else ()
    nothing = fit_variances([Blocks(fixed, least, residual, columns)])
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
        whites: Of these by instrument (m, k, d, d), or of an instrument of unknown size.
        changes: Of changes (m, k, d, d); none without differences, which tell them. Means have a
            share, too, which is left to the whites: readings that scatter more than is stated look
            in differences like a change, and must not count as none in means.
    """

    absolute: Array
    whites: list[Array]
    changes: list[Array]


def _model_kinds(
    noise: PositionNoise, places: Array, worth: Array, differs: Mask, share: Array
) -> _ModelKinds:
    """The kinds of white errors of readings that are worth so much (m, r).

    Args:
        noise: The noise of a reading.
        places: Where the markers are (m, k, 3).
        worth: What the readings are worth.
        differs: Which poses (m,) are differences.
        share: What of the variance of a change is in each row (m, r).
    """
    m, width = worth.shape
    shape = (m, places.shape[1], width // places.shape[1])
    there = (worth > 0).astype(float)
    absolute = there * ~differs[:, None]
    alike = noise.white_kinds(width)
    if noise.unknown:
        root = there / np.sqrt(np.where(worth > 0, worth, 1.0))
        own = [(kind * root).reshape(shape) for kind in alike]
        V = noise.apart(places, width)
        return _ModelKinds(absolute, [V * (one[..., None] * one[..., None, :]) for one in own], [])
    whites = [diagonal_blocks((kind * absolute).reshape(shape)) for kind in alike]
    told = there * share * differs[:, None]
    changes = [diagonal_blocks((kind * told).reshape(shape)) for kind in alike]
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
    told = found if any(change) else found.first(last)
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
