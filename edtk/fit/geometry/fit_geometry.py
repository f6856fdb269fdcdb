"""Geometry and springs from absolute readings, differences, or both, with a judgement."""

from dataclasses import dataclass, replace

import numpy as np

from edtk.fit.geometry.fitted_geometry import (
    MM,
    FittedGeometry,
    GeometricFit,
    Loads,
    TurnResiduals,
    loading_of,
    root_mean_square,
    student_quantile,
)
from edtk.fit.geometry.least_squares_fit import PoseRows, least_squares_fit, working
from edtk.fit.geometry.marker_positions import MarkerPositions
from edtk.fit.geometry.place_robot import place_robot
from edtk.fit.least_squares import LeftOut, independent_coordinates
from edtk.fit.restricted_likelihood import fit_model_error, noise_of_repeats
from edtk.measure.geometric_model import GeometricModel, Torque
from edtk.measure.noise import PositionNoise
from edtk.measure.parameters import TURNS, GeometricParameter, Identifiable, identifiable
from edtk.system.typing import Array, Mask

POSES = 60  # random poses that show what any poses could tell
ROUNDS = 8  # of fit and noise, in turn
SETTLED = 1e-3  # relative change of the noise between rounds
# Errors of coordinates, at least, of which a part is what models leave out [mm]. A parameter whose
# column moves all coordinates by less, if it is as far from the drawing as it may be, is not told.
ERRORS = 0.1
NU = 5.0  # degrees of freedom of a robust loss


class TooFewPosesError(ValueError):
    """A sheet has fewer coordinates than there are parameters.

    Attributes:
        missing: How many poses more are needed at least.
    """

    def __init__(self, coordinates: int, rank: int, missing: int) -> None:
        poses = f"{missing} more pose{'s' if missing > 1 else ''}"
        super().__init__(
            f"{coordinates} measured coordinates for {rank} parameters that poses can tell apart; "
            f"expected at least {poses}"
        )
        self.missing = missing


def fit_geometry(
    model: GeometricModel,
    data: MarkerPositions,
    stated: PositionNoise,
    loads: Loads | None = None,
    robust: bool = False,
) -> GeometricFit:
    """Fit all that the poses tell, by generalised least squares with fitted variances.

    First base and tools are placed with the geometry of the drawing. Then a minimal set of
    parameters is chosen (`identifiable`), and fitted in turns with the sizes of the errors: those
    of a reading by repeated visits, and what the model leaves out by the residuals.

    Args:
        model: All parameters that are asked for; its base is where the search begins.
        data: The positions.
        stated: The noise of a reading; its tracker stands in the world of the drawing.
        loads: What loads the joints under a wrench.
        robust: Whether poses that fit badly count less, as with multivariate t errors.

    Raises:
        TooFewPosesError: There are fewer coordinates than parameters.
    """
    means = data.means
    placed, start = place_robot(model, means)
    stated = stated.seen_from(placed.start)
    torque = loading_of(np.zeros(model.robot.n), means, loads)
    absolute = means.absolute
    alone = absolute.measured - placed.see(start, absolute.q, derivatives=False).points
    possible = _possible(placed, start, means, loads)
    minimal = placed.with_parameters(tuple(placed.parameters[i] for i in possible.kept))
    _require_enough(means, minimal.p)
    begin = start[possible.kept]
    spread = np.array([one.spread for one in minimal.parameters])
    least = max(ERRORS, stated.reading) / spread
    told = identifiable(
        _scaled(minimal, begin, means, torque), minimal.parameters, stages(minimal), least
    )
    kept = minimal.with_parameters(tuple(minimal.parameters[i] for i in told.kept))
    theta = least_squares_fit(kept, begin[told.kept], means, torque).theta
    theta, noise, weights = _in_turns(kept, theta, data, stated, loads, robust)
    common, shown = _as_shown(kept, theta, noise, weights, data, loads)
    opened = tuple(minimal.parameters[i] for i in told.left)
    tools = placed_tools(placed, start)
    turned = placed_turns(placed, start)
    fit = judge_fit(
        kept, theta, shown, (common, weights), data, loads, (opened, told.shares, tools, turned)
    )
    return replace(
        fit,
        structural=minimal.p,
        redundant=possible.words,
        open=told.words,
        placed=root_mean_square(alone),
    )


def placed_tools(model: GeometricModel, theta: Array) -> Array:
    """Markers (k, 3) in the tool frame, with the shifts among parameters theta (p,) [m]."""
    places = np.array(model.offsets, dtype=float)
    for one, value in zip(model.parameters, theta, strict=True):
        if one.place == "tool" and not one.turns:
            places[model.markers.index(one.of), "xyz".index(one.component)] += value
    return places


def placed_turns(model: GeometricModel, theta: Array) -> Array | None:
    """Orientations (k, 3) of the markers there, as rotation vectors [rad]; None without any."""
    if model.row_count == 3:
        return None
    turns = np.zeros((len(model.markers), 3))
    for one, value in zip(model.parameters, theta, strict=True):
        if one.place == "tool" and one.turns:
            turns[model.markers.index(one.of), TURNS.index(one.component)] = value
    return turns


def stages(model: GeometricModel) -> list[list[int]]:
    """What is kept first: base and tools, then the zeros of the joints, springs, and the rest."""
    order = {"base": 0, "tool": 0, "compliance": 2}
    ranks = [1 if one.along else order.get(one.place, 3) for one in model.parameters]
    return [[i for i, rank in enumerate(ranks) if rank == stage] for stage in range(4)]


def _scaled(model: GeometricModel, theta: Array, means: MarkerPositions, torque: Torque) -> Array:
    """The regressor (rows, p) of what was seen, in millimetres for a unit of each parameter."""
    J = model.see(theta, means.q, torque).jacobian
    assert J is not None
    return MM * (J * model.scales)[means.seen].reshape(-1, model.p)


def _possible(
    model: GeometricModel, theta: Array, means: MarkerPositions, loads: Loads | None
) -> Identifiable:
    """What any poses could tell, under the loads of the sheet: random ones besides its own."""
    rng = np.random.default_rng(0)
    lower, upper = np.clip(model.robot.limits, -np.pi, np.pi)
    q = rng.uniform(lower, upper, (POSES, model.robot.n))
    like = np.concatenate([np.arange(len(means)), rng.integers(0, len(means), POSES)])
    wide = replace(
        means[like],
        q=np.concatenate([means.q, q]),
        measured=np.zeros((len(like), *means.measured.shape[1:])),
    )
    torque = loading_of(np.zeros(model.robot.n), wide, loads)
    scaled = _scaled(model, theta, wide, torque)
    return identifiable(scaled, model.parameters, stages(model))


def _require_enough(means: MarkerPositions, rank: int) -> None:
    """Check that there are as many coordinates as parameters.

    Raises:
        TooFewPosesError: There are not.
    """
    coordinates = int(means.rows_seen.sum())
    if coordinates < rank:
        missing = -(-(rank - coordinates) // int(means.present.sum()))
        raise TooFewPosesError(coordinates, rank, missing)


def _in_turns(
    model: GeometricModel,
    theta: Array,
    data: MarkerPositions,
    stated: PositionNoise,
    loads: Loads | None,
    robust: bool,
) -> tuple[Array, PositionNoise, Array]:
    """Fit parameters and noise in turns; parameters (p,), noise and weights (m,) of the poses."""
    means = data.means
    noise = stated
    weights = np.ones(len(means))
    last = np.zeros(2)
    slides = _slides(model)

    def at_rest(theta: Array) -> Torque:
        return loading_of(model.compliances(theta), means, loads)

    for turn in range(ROUNDS):
        rows = PoseRows.of(model, theta, means, at_rest(theta))
        if not turn:
            noise = noise_of_repeats(data, rows.motion, rows.places, stated)[0]
        trusted = rows.weighted(weights)
        noise = fit_model_error(
            noise,
            rows.motion,
            rows.places,
            data.worth,
            trusted.residual,
            trusted.design,
            slides,
            differs=means.is_difference,
        )
        V = noise.of_pose(rows.motion, rows.places, data.worth, means.is_difference)
        if robust:
            weights = _trusted(rows.residual, V, means)
        whitening = np.linalg.inv(np.linalg.cholesky(working(V, means)))
        whitening = whitening * np.sqrt(weights)[:, None, None]
        theta = least_squares_fit(model, theta, means, at_rest, whitening).theta
        now = np.array([noise.model_white, np.max(noise.model_joints, initial=0.0)])
        if turn and np.abs(now - last).max() <= SETTLED * max(now.max(), noise.reading):
            break
        last = now
    return theta, noise, weights


def _as_shown(
    model: GeometricModel,
    theta: Array,
    noise: PositionNoise,
    weights: Array,
    data: MarkerPositions,
    loads: Loads | None,
) -> tuple[Array, PositionNoise]:
    """Covariances (m, r, r) that the fit was weighted by, and the noise that is stated with it.

    Weights have one size of the model's error for all joints, which predicts best; the stated noise
    has one a joint where the residuals say so, without which bands are too narrow where a load that
    nobody told bends the robot.
    """
    means = data.means
    torque = loading_of(model.compliances(theta), means, loads)
    rows = PoseRows.of(model, theta, means, torque).weighted(weights)
    differs = means.is_difference
    shown = fit_model_error(
        noise,
        rows.motion,
        rows.places,
        data.worth,
        rows.residual,
        rows.design,
        _slides(model),
        singly=True,
        differs=differs,
    )
    return noise.of_pose(rows.motion, rows.places, data.worth, differs), shown


def _slides(model: GeometricModel) -> Mask:
    """Which joints (n,) are prismatic."""
    return np.array([joint.kind == "prismatic" for joint in model.robot.joints])


def _trusted(residual: Array, V: Array, means: MarkerPositions) -> Array:
    """Weights (m,) of poses with multivariate t errors, one at most (Lange et al. 1989)."""
    z2 = np.einsum("mr,mr->m", residual, np.linalg.solve(V, residual[..., None])[..., 0])
    weights = (NU + means.rows_seen.sum(axis=(1, 2))) / (NU + z2)
    return np.minimum(weights, 1.0)


def judge_fit(
    model: GeometricModel,
    theta: Array,
    noise: PositionNoise,
    weighting: tuple[Array, Array],
    data: MarkerPositions,
    loads: Loads | None,
    beside: tuple[tuple[GeometricParameter, ...], Array, Array, Array | None],
) -> GeometricFit:
    """The fit with its covariance, and each pose as it is predicted without it.

    Parameters have the covariance ``R^-1 S R^-T``, ``S = sum_b Q_b' V_b Q_b``, of any weighted
    least squares whose weights are not the inverse of V (Huber 1967).

    Args:
        model: The identified parameters.
        theta: Their values (p,) in SI units.
        noise: The errors of a pose, and so V.
        weighting: Covariances (m, 3k, 3k) of the poses with one size of the model's error for all
            joints, by which the fit weighted them, and weights (m,) of a robust loss.
        data: The positions.
        loads: What loads the joints.
        beside: Open parameters, how they hang on the others, and where the markers were placed
            and how they were turned there.
    """
    common, weights = weighting
    means = data.means
    rows = PoseRows.of(model, theta, means, loading_of(model.compliances(theta), means, loads))
    work = working(common, means)
    V = noise.of_pose(rows.motion, rows.places, data.worth, means.is_difference)
    out = _LeftOutPoses.of(rows, V, work, weights)
    # Sizes that each joint has of its own may be those of one wrong pose, which they would hide.
    surprise = _LeftOutPoses.of(rows, common, work, weights).surprise
    fitted = FittedGeometry(
        model=model,
        theta=theta,
        covariance=out.covariance,
        open_parameters=beside[0],
        shares=beside[1],
        noise=noise,
        placed=beside[2],
        placed_turns=beside[3],
    )
    spread = np.einsum("mrr->mr", out.covariance_of_errors)
    half = np.sqrt(np.maximum(spread, 0.0)) * student_quantile(fitted.dof(rows.motion, rows.places))
    shape = (len(means), len(data.markers), means.rows)
    blank = np.where(means.rows_seen, 0.0, np.nan)
    residual = rows.residual.reshape(shape) / MM + blank
    left_out = out.errors.reshape(shape) / MM + blank
    left_out_half = half.reshape(shape) / MM + blank
    return GeometricFit(
        fitted=fitted,
        data=data,
        structural=model.p,
        redundant=(),
        open=(),
        placed=np.nan,
        residual=residual[..., :3],
        left_out=left_out[..., :3],
        left_out_half=left_out_half[..., :3],
        turns=TurnResiduals(*(part[..., 3:] for part in (residual, left_out, left_out_half)))
        if means.turns is not None
        else None,
        # A pose that a robust loss trusts less surprises all the same.
        surprise=surprise / weights,
        independent=independent_coordinates(
            out.covariance_of_errors,
            means.rows_seen.reshape(len(means), -1),
            noise.model_fit is not None,
        ),
        weights=weights,
    )


@dataclass(frozen=True, eq=False)
class _LeftOutPoses:
    """Poses as they are predicted without them.

    Attributes:
        errors: Measured less predicted coordinates (m, r) [mm].
        covariance_of_errors: Of those of each pose (m, r, r) [mm^2].
        surprise: Squared sizes (m,) of the errors over their covariances.
        covariance: Of the parameters (p, p), in their units.
    """

    errors: Array
    covariance_of_errors: Array
    surprise: Array
    covariance: Array

    @classmethod
    def of(cls, rows: PoseRows, V: Array, work: Array, weights: Array) -> "_LeftOutPoses":
        """Of a fit with covariances V (m, r, r), weighted by others alike and by weights (m,)."""
        L = np.linalg.cholesky(work / weights[:, None, None])
        inverse_L = np.linalg.inv(L)
        X = inverse_L @ rows.design
        z = (inverse_L @ rows.residual[..., None])[..., 0]
        own = inverse_L @ (V / weights[:, None, None]) @ np.swapaxes(inverse_L, 1, 2)
        m, r = z.shape
        Q, R = np.linalg.qr(X.reshape(m * r, -1))
        Q = Q.reshape(m, r, -1)
        transposed = np.swapaxes(Q, 1, 2)
        h = np.einsum("mrp,mr->mp", Q, z)
        out = LeftOut.of(transposed @ Q, h, transposed @ own @ Q)
        # A pose that alone tells something leaves nothing to compare it with.
        told = np.eye(r) - Q @ out.alone @ transposed
        without = np.einsum("mrs,ms->mr", told, z) + np.einsum("mrp,mp->mr", Q, out.u)
        of_without = told @ own @ told + Q @ out.C @ transposed
        inverse = np.linalg.inv(R) if R.size else np.zeros((0, 0))
        return cls(
            errors=np.einsum("mrs,ms->mr", L, without),
            covariance_of_errors=L @ of_without @ np.swapaxes(L, 1, 2),
            surprise=_surprise(without, of_without),
            covariance=inverse @ out.S @ inverse.T,
        )


def _surprise(errors: Array, covariance: Array) -> Array:
    """``e' C^+ e`` (m,) of errors (m, r) with covariances (m, r, r), some of which are singular."""
    inverse = np.linalg.pinv(covariance, rcond=1e-9, hermitian=True)
    return np.asarray(np.einsum("mr,mrs,ms->m", errors, inverse, errors))
