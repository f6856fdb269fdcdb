"""Residuals and columns of the positions of a fit, and what grew or drifted over a day."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from edtk.findings.causes.scene import since_first
from edtk.fit.geometry.fitted_geometry import MM, GeometricFit
from edtk.fit.geometry.marker_positions import MarkerPositions
from edtk.fit.restricted_likelihood import Blocks, fit_model_error, fit_variances
from edtk.measure.noise import PositionNoise, only_seen
from edtk.measure.parameters import Parameter, all_parameters
from edtk.system.typing import Array

DEPENDENT = 1e-8  # singular value of columns of unit length, beside the largest, that is rounding
UNLIKELY_TREND = 1e-5
EXPLAINS = 0.1  # of the weighted squares, at least
COORDINATES = 3.0  # of a pose that err together
RATES = (0.0, 3.0, 8.0)  # of settling in a day: a steady drift, and warming up
FEWEST_OF_TREND = 8  # poses
UNLIKELY_SCALE = 1e-4
LEAST = 1e-4  # [m/m] below it a scale is that of the air's temperature
FEWEST_OF_SCALE = 6  # parameters of the geometry that show how far from the drawing this robot is


@dataclass(frozen=True, eq=False)
class FitRows:
    """What the positions of the poses leave, in millimetres; orientations are left aside.

    Rows of what was not seen are zero.

    Attributes:
        fit: The fit.
        residual: Residuals (m, 3k).
        design: Columns (m, 3k, p) of its parameters.
        motion: Motions (m, 3k, n) by the joints [mm/mrad].
        places: Where the markers are (m, k, 3), in the frame of the instrument [m].
        noise: The noise of positions that was fitted.
    """

    fit: GeometricFit
    residual: Array
    design: Array
    motion: Array
    places: Array
    noise: PositionNoise

    @classmethod
    def of(cls, fit: GeometricFit) -> "FitRows":
        """Of a fit."""
        model = fit.fitted.model
        means = fit.data.means
        seen = model.see(fit.fitted.theta, means.q)
        assert seen.by_joints is not None
        design = own_columns(fit)
        return cls(
            fit,
            MM * np.nan_to_num(fit.residual).reshape(len(means), -1),
            # Of what was known before, some columns may be dependent.
            design if fit.told_before is None else _independent(design),
            of_positions(seen.by_joints, means),
            seen.places,
            replace(fit.fitted.noise, turn=None, model_turn=0.0),
        )

    def beside(self, others: Sequence[Parameter]) -> "FitRows":
        """The same, as if other parameters were fitted too: noise and columns are beside theirs.

        Columns are orthonormal then, and as many as the parameters that the poses tell apart.

        Args:
            others: Parameters that are none of the fit; without any, nothing changes.
        """
        if not others:
            return self
        fitted = self.fit.fitted
        means = self.fit.data.means
        every = fitted.model.with_parameters((*fitted.model.parameters, *others))
        theta = np.concatenate([fitted.theta, np.zeros(len(others))])
        jacobian = every.see(theta, means.q).jacobian
        assert jacobian is not None
        columns = MM * of_positions(jacobian * every.scales, means)[..., fitted.model.p :]
        design = _independent(np.concatenate([self.design, columns], axis=-1))
        without = replace(self, design=design[..., :0])
        return replace(self, design=design, noise=without.noise_beside(design))

    def dof(self, others: int) -> int:
        """Coordinates that neither the fit nor so many other columns take."""
        return 3 * int(self.fit.data.means.seen.sum()) - self.design.shape[-1] - others

    def noise_beside(self, columns: Array) -> PositionNoise:
        """The noise, fitted beside other columns (m, 3k, c) too, that it may have hidden."""
        joints = self.fit.fitted.model.robot.joints
        slides = np.array([joint.kind == "prismatic" for joint in joints])
        both = np.concatenate([self.design, columns], axis=-1)
        counts = self.fit.data.counts
        return fit_model_error(
            self.noise, self.motion, self.places, counts, self.residual, both, slides
        )

    def gains(self, causes: Sequence[Array]) -> list[float]:
        """How much better the fit is with the columns (m, 3k, c) of each cause, to compare them.

        It is what the weighted squares fall by, less ``c log n`` for c columns (Schwarz 1978), with
        the noise that is fitted beside the columns of all causes.
        """
        if not causes:
            return []
        noise = self.noise_beside(np.concatenate(list(causes), axis=-1))
        z, X, *columns = self.whitened(noise, self.residual[..., None], self.design, *causes)
        cost = np.log(max(self.dof(0), 2))
        return [explained_by(z, X, one).fall - one.shape[-1] * cost for one in columns]

    def whitened(self, noise: PositionNoise | None, *columns: Array) -> list[Array]:
        """Columns (m, 3k, c) in units of a noise; all coordinates alike where there is none."""
        V = (noise or self.noise).of_pose(self.motion, self.places, self.fit.data.counts)
        if noise is None:
            size = np.einsum("mrr->", V) / V[..., 0].size
            alike = np.broadcast_to(size * np.eye(V.shape[1]), V.shape)
            V = only_seen(alike, self.fit.data.means.seen)
        L = np.linalg.cholesky(V)
        return [np.asarray(np.linalg.solve(L, one)) for one in columns]


def own_columns(fit: GeometricFit) -> Array:
    """Columns (m, 3k, p) of the positions by a fit's parameters in their units [mm]."""
    model = fit.fitted.model
    means = fit.data.means
    jacobian = model.see(fit.fitted.theta, means.q).jacobian
    assert jacobian is not None
    return MM * of_positions(jacobian * model.scales, means)


def _independent(design: Array) -> Array:
    """Orthonormal columns (m, 3k, c) that span those of a design (m, 3k, p), of any rank."""
    whole = design.reshape(-1, design.shape[-1])
    length = np.linalg.norm(whole, axis=0)
    unit = whole / np.where(length > 0, length, 1.0)
    U, sizes, _ = np.linalg.svd(unit, full_matrices=False)
    basis = U[:, sizes > DEPENDENT * sizes[0]]
    return np.asarray(basis.reshape(*design.shape[:2], -1))


@dataclass(frozen=True, eq=False)
class Explained:
    """What columns explain beside those of a fit.

    Attributes:
        values: Their coefficients (c,).
        std: Standard deviations (c,) of these, where the errors have the size one.
        fall: What the squares fall by.
        share: Share of the squares that this is.
    """

    values: Array
    std: Array
    fall: float
    share: float


def explained_by(residual: Array, design: Array, columns: Array) -> Explained:
    """What columns explain of residuals; all (m, 3k, c) in units of the noise."""
    z, X, C = (one.reshape(-1, one.shape[-1]) for one in (residual, design, columns))
    Q = np.linalg.qr(X)[0]
    z, C = z - Q @ (Q.T @ z), C - Q @ (Q.T @ C)
    inverse = np.linalg.pinv(C.T @ C, hermitian=True)
    values = inverse @ (C.T @ z)
    total = float((z**2).sum())
    fall = total - float(((z - C @ values) ** 2).sum())
    return Explained(values[:, 0], np.sqrt(np.diag(inverse)), fall, fall / max(total, 1e-300))


def log_chance(share: float, count: int, dof: float) -> float:
    """Logarithm of the probability that so many columns explain such a share by chance."""
    from scipy.stats import f

    return float(f.logsf(share / max(1 - share, 1e-12) * dof / count, count, dof))


def of_positions(columns: Array, means: MarkerPositions) -> Array:
    """Columns (m, 3k, c) of the positions, from those (m, k, r, c) of all that is measured.

    Rows of what was not seen are zero.
    """
    return of_all(columns[:, :, :3], means)


def of_all(columns: Array, means: MarkerPositions) -> Array:
    """Columns (m, rk, c) of all that is measured, as `of_positions` has those of positions."""
    there = means.seen[..., None, None]
    found = np.where(there, columns, 0.0)
    return np.asarray(found.reshape(len(columns), -1, columns.shape[-1]))


@dataclass(frozen=True, eq=False)
class DayTrend:
    """Something that grows from the first pose to the last.

    Attributes:
        kind: "drift" of the frame, or "growth" of all links.
        size: In the last pose (see `since_first`): how far positions are off, root mean square [m],
            or the growth of all lengths [m/m].
        explained: Share of the weighted squares that it explains.
        columns: Its columns (m, 3k, c) [mm a unit].
    """

    kind: Literal["drift", "growth"]
    size: float
    explained: float
    columns: Array


def day_trend(fit: GeometricFit, others: Sequence[Parameter] = ()) -> DayTrend | None:
    """Try a drift of the frame and a growth of all links, and test the best.

    At the time t, from 0 at the first pose to 1 at the last, both have the size ``t`` or, as where
    something warms up, ``(1 - exp(-c t)) / (1 - exp(-c))``. A drift has the six columns of a motion
    of the frame, and growth one: the motion by all lengths of the drawing together. The noise is
    fitted anew beside them (see `moved_frame`). The smallest probability of the fall of the squares
    counts as often as shapes are tried.

    Args:
        fit: Of a sheet whose poses are in the order in which they were measured.
        others: Errors of the drawing that were not asked for, which are fitted beside it.
    """
    rows = FitRows.of(fit).beside(others)
    if len(rows.residual) < FEWEST_OF_TREND:
        return None
    kinds: list[tuple[Literal["drift", "growth"], Array]] = [
        ("drift", frame_columns(fit)),
        ("growth", growth_columns(fit)),
    ]
    tried = (_best(rows, kind, columns) for kind, columns in kinds)
    found = [one for one in tried if one is not None]
    gains = rows.gains([one.columns for one in found])
    return max(zip(gains, found, strict=True), key=lambda one: one[0], default=(0.0, None))[1]


def frame_columns(fit: GeometricFit) -> Array:
    """Columns (m, 3k, 6) of a motion of the frame [mm a mm, mm a mrad]."""
    model = fit.fitted.model
    base = model.with_parameters(all_parameters(model.robot, model.markers, [], tool=False))
    by_base = base.see(np.zeros(6), fit.data.means.q).jacobian
    assert by_base is not None
    return MM * of_positions(by_base * base.scales, fit.data.means)


def growth_columns(fit: GeometricFit) -> Array:
    """The column (m, 3k, 1) of a growth of all lengths between joints [mm by 1 mm/m]."""
    model = fit.fitted.model
    robot = model.robot
    lengths = tuple(
        one for one in all_parameters(robot, model.markers, base=False, tool=False) if not one.turns
    )
    every = model.with_parameters(lengths)
    jacobian = every.see(np.zeros(every.p), fit.data.means.q).jacobian
    assert jacobian is not None
    origins = {joint.name: joint.origin[:3, :3].T @ joint.origin[:3, 3] for joint in robot.chain}
    long = np.array([origins[one.of]["xyz".index(one.component)] for one in lengths])
    return of_positions((jacobian @ long)[..., None], fit.data.means)


def _best(rows: FitRows, kind: Literal["drift", "growth"], columns: Array) -> DayTrend | None:
    """The shape of one kind that explains most, where chance does not."""
    m, _, c = columns.shape
    dof = rows.dof(c)
    if dof < 2 * c:
        return None
    times = since_first(m)
    shapes = [np.expm1(-r * times) / np.expm1(-r) if r else times for r in RATES]
    noise = rows.noise_beside(columns * times[:, None, None])
    tried = []
    for shape in shapes:
        grown = columns * shape[:, None, None]
        one = explained_by(*rows.whitened(noise, rows.residual[..., None], rows.design, grown))
        tried.append((one.share, one.values, grown))
    share, values, grown = max(tried, key=lambda one: one[0])
    chance = log_chance(share, c, max(dof / COORDINATES, 1.0)) + np.log(len(shapes))
    if chance > np.log(UNLIKELY_TREND) or share < EXPLAINS:
        return None
    if kind == "growth":
        return DayTrend(kind, 1e-3 * float(values[0]), share, grown)
    seen = rows.fit.data.means.seen[-1].reshape(-1)
    off = (columns[-1] @ values).reshape(-1, 3)[seen]
    size = float(np.sqrt((off**2).sum(axis=-1).mean())) / MM if len(off) else 0.0
    return DayTrend(kind, size, share, grown)


@dataclass(frozen=True)
class CommonScale:
    """A scale by which lengths that were measured are longer than drawn.

    Attributes:
        size: The scale less one [m/m].
        std: Its standard deviation.
    """

    size: float
    std: float


def common_scale(fit: GeometricFit) -> CommonScale | None:
    """Estimate a scale of all lengths, beside errors of the drawing of unknown size, and test it.

    Where all geometry is fitted, lengths take up a scale s of the instrument: they come out as
    ``theta = T d + s t + e``, with the errors d of the drawing, how all of them (T) and a scale (t)
    move the minimal set, and the errors e of the fit, of covariance C. Robots are built with errors
    of either sign: d has two variances, of lengths and of angles, fitted by restricted likelihood,
    and s is that of generalised least squares with ``C + T D T'``. Base and markers are free.

    Args:
        fit: Of a study that asks for all geometry.
    """
    model = fit.fitted.model
    own = np.array([one.place == "joint" for one in model.parameters])
    if own.sum() < FEWEST_OF_SCALE:
        return None
    means = fit.data.means
    errors = all_parameters(model.robot, model.markers, base=False, tool=False)
    every = model.with_parameters(errors)
    seen = model.see(fit.fitted.theta, means.q)
    jacobian = every.see(np.zeros(every.p), means.q).jacobian
    assert seen.jacobian is not None
    assert jacobian is not None
    scaled = np.zeros((*jacobian.shape[:3], 1))
    scaled[:, :, :3] = seen.points[..., None]  # mm by 1 mm/m; a scale turns nothing
    moved = MM * jacobian * every.scales
    columns = of_all(np.concatenate([moved, scaled], axis=-1), means)
    # Some of the minimal set is told by orientations alone.
    taken = _coefficients(MM * of_all(seen.jacobian * model.scales, means), columns)[own]
    turns = np.array([one.turns for one in errors])
    kinds = [K @ K.T for K in (taken[:, :-1][:, ~turns], taken[:, :-1][:, turns])]
    C = fit.fitted.covariance[np.ix_(own, own)]
    y = fit.fitted.values[own]
    t = taken[:, -1]
    blocks = Blocks(C[None], [K[None] for K in kinds], y[None], t[None, :, None])
    found = fit_variances([blocks])
    V = C + sum(v * K for v, K in zip(found.variances, kinds, strict=True))
    weighted = np.linalg.solve(V, t)
    variance = 1 / float(t @ weighted)
    scale = CommonScale(1e-3 * variance * float(weighted @ y), 1e-3 * float(np.sqrt(variance)))
    return scale if _is_told(scale, len(y) - 1 - len(kinds)) else None


def _coefficients(design: Array, columns: Array) -> Array:
    """How a design (m, r, p) combines to columns (m, r, c): (p, c)."""
    X = design.reshape(-1, design.shape[-1])
    return np.asarray(np.linalg.lstsq(X, columns.reshape(len(X), -1), rcond=None)[0])


def _is_told(scale: CommonScale, dof: int) -> bool:
    """Whether a scale is large, and no matter of chance."""
    from scipy.stats import t

    if abs(scale.size) < LEAST:
        return False
    return bool(2 * t.sf(abs(scale.size) / scale.std, dof) < UNLIKELY_SCALE)
