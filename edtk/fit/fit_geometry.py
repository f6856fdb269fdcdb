"""Geometry and springs from absolute readings, differences, or both, with a judgement."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from edtk.fit.fitted_geometry import (
    LEAST_DOF,
    GeometricFit,
    loading_of,
    root_mean_square,
)
from edtk.fit.judge_geometry import judge_fit, left_out_alone
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.place_robot import place_robot
from edtk.fit.pose_rows import (
    WHITE_SHARE,
    PoseRows,
    columns_of,
    known_before,
    least_squares_fit,
    working,
)
from edtk.fit.prior import Prior, PriorRows
from edtk.fit.restricted_likelihood import noise_of_repeats
from edtk.measure.equilibrium import Loads
from edtk.measure.measured_model import MeasuredModel, Torque
from edtk.measure.parameters import TURNS, Identifiable, Parameter, identifiable
from edtk.measure.position_noise import PositionNoise
from edtk.measure.whitening import Precision, Scatter
from edtk.system.typing import Array, Indices

RANDOM_POSES = 60  # random poses that show what any poses could tell
NOISE_ROUNDS = 8  # of fit and noise, in turn
STILL_ROWS = 1e-9  # relative change of the rows of a prior, that is not linear, in another fit
SETTLED_NOISE = 1e-3  # relative change of the noise between rounds
# Errors of coordinates, at least, of which a part is what models leave out [mm]. A parameter whose
# column moves all coordinates by less, if it is as far from the drawing as it may be, is not told.
ERRORS = 0.1
NU = 5.0  # degrees of freedom of a robust loss


class TooFewPosesError(ValueError):
    """A sheet has fewer coordinates than there are parameters."""


class NoiseNotToldError(ValueError):
    """Residuals have too few degrees of freedom to tell a size of the noise."""


def fit_geometry(
    model: MeasuredModel,
    data: MarkerPositions,
    stated: PositionNoise,
    loads: Loads | None = None,
    robust: bool = False,
    prior: Prior | None = None,
) -> GeometricFit:
    """Fit all that the poses tell, by generalised least squares with fitted variances.

    First base and tools are placed with the geometry of the drawing. Then a minimal set of
    parameters is chosen (`identifiable`), and fitted in turns with the sizes of the errors: those
    of a reading by repeated visits, and what the model leaves out by the residuals. What is known
    before of some parameters has rows of its own below those of the poses, and may tell parameters
    that these leave open.

    Args:
        model: All parameters that are asked for; its base is where the search begins.
        data: The positions.
        stated: The noise of a reading; its tracker stands in the world of the drawing.
        loads: What loads the joints under a wrench.
        robust: Whether poses that fit badly count less, as with multivariate t errors.
        prior: What is known of the parameters before; nothing by default.

    Raises:
        TooFewPosesError: There are fewer coordinates than parameters.
        NoiseNotToldError: There are hardly more, and the noise is unknown.
    """
    means = data.means
    placed, start = place_robot(model, means)
    stated = stated.seen_from(placed.start)
    absolute = means.absolute
    alone = absolute.measured - placed.see(start, absolute.q, derivatives=False).points
    choice = _chosen(placed, start, means, stated, loads, prior or Prior.flat(model.p, False))
    kept, theta, before = choice.model, choice.start, choice.before
    if stated.unknown:
        _require_noise_told(means, kept.p)
    torque = loading_of(kept.bending(theta), means, loads)
    theta = fit_beside(kept, theta, means, torque, before, choice.size)
    theta, noise, weights = _in_turns(kept, theta, data, stated, loads, robust, before)
    shown = _as_shown(kept, theta, noise, weights, data, loads, before)
    beside = (
        choice.open,
        choice.told.shares,
        placed_tools(placed, start),
        placed_turns(placed, start),
    )
    fit = judge_fit(kept, theta, shown, (noise, weights), data, loads, beside, before)
    found = replace(
        fit,
        structural=choice.minimal.p,
        redundant=choice.possible.words,
        open=choice.told.words,
        rescued=choice.rescued,
        beyond=choice.beyond,
        placed=root_mean_square(alone),
    )
    if not found.worse_than_placed:
        return found
    return replace(found, placed_apart=root_mean_square(left_out_alone(placed, start, absolute)))


@dataclass(frozen=True, eq=False)
class _Choice:
    """The parameters that poses, and what is known before, tell.

    Attributes:
        minimal: The model with those that any poses could tell.
        model: With those that these poses tell.
        possible: How the first are chosen among all.
        told: How the second are chosen among the first.
        start: Where the second begin (p,).
        before: What is known of the second.
        rescued: Those of the second that these poses alone do not tell, though others would.
        beyond: Those that no poses alone would tell.
        size: Size of an error of a coordinate [mm], beside which rows of the prior count.
    """

    minimal: MeasuredModel
    model: MeasuredModel
    possible: Identifiable
    told: Identifiable
    start: Array
    before: Prior
    rescued: tuple[Parameter, ...]
    beyond: tuple[Parameter, ...]
    size: float

    @property
    def open(self) -> tuple[Parameter, ...]:
        """Those that these poses leave open."""
        return tuple(self.minimal.parameters[i] for i in self.told.left)


def fit_beside(
    model: MeasuredModel,
    theta: Array,
    means: MarkerPositions,
    torque: Torque | Callable[[Array, bool], Torque],
    prior: Prior,
    weight: float = 1.0,
    weights: Precision | None = None,
) -> Array:
    """Parameters (p,) that fit best beside what is known before, see `least_squares_fit`.

    Args:
        model: What is fitted.
        theta: Where to begin (p,).
        means: The positions, a visit a pose.
        torque: Loads of the joints.
        prior: What is known before, linear about the estimate.
        weight: What its errors of size one are in the units of the residuals.
        weights: Inverse covariances of the poses; None for equal weights.
    """
    before = known_before(prior, model, theta, weight)
    for _ in range(NOISE_ROUNDS):
        theta = least_squares_fit(model, theta, means, torque, weights, before=before).theta
        last, before = before, known_before(prior, model, theta, weight)
        if np.allclose(before.rows, last.rows, rtol=STILL_ROWS, atol=0):
            break
    return theta


def _chosen(
    model: MeasuredModel,
    start: Array,
    means: MarkerPositions,
    stated: PositionNoise,
    loads: Loads | None,
    prior: Prior,
) -> _Choice:
    """Choose the parameters that are told; of compliances, weak knowledge counts where none is.

    Raises:
        TooFewPosesError: There are fewer coordinates than parameters.
    """
    size = max(ERRORS, stated.reading)
    wide = _wide(model, start, means, loads)
    if prior.earlier is not None:
        prior = replace(prior, earlier=prior.earlier.completed(wide, model.scales))
    start = _at_most_likely(model, start, prior)
    torque = loading_of(model.rigid, means, loads)
    scaled = _scaled(model, start, means, torque)
    # What poses tell comes first: knowledge besides adds to it.
    nothing = PriorRows.none(model.p)
    alone = identifiable_beside(model, wide, nothing)
    told = _some(model, scaled, nothing, alone.kept, size)
    by_poses = alone.kept[told.kept]
    for known in (prior, prior.with_weak):
        before = known_before(known, model, start, size)
        possible = identifiable_beside(model, wide, before, alone.kept) if len(before) else alone
        _require_enough(means, possible.rank - len(before))
        if len(before):
            told = _some(model, scaled, before, possible.kept, size, by_poses)
        if not len(told.left) or known.marginals == prior.with_weak.marginals:
            break
    kept = possible.kept[told.kept]
    added = [i for i in kept if i not in by_poses]
    return _Choice(
        minimal=_with(model, possible.kept),
        model=_with(model, kept),
        possible=possible,
        told=told,
        start=start[kept],
        before=known.of(kept),
        rescued=tuple(model.parameters[i] for i in added if i in alone.kept),
        beyond=tuple(model.parameters[i] for i in added if i not in alone.kept),
        size=size,
    )


def _with(model: MeasuredModel, chosen: Indices) -> MeasuredModel:
    """The model with some of its parameters."""
    return model.with_parameters(tuple(model.parameters[i] for i in chosen))


def _some(
    model: MeasuredModel,
    scaled: Array,
    before: PriorRows,
    chosen: Indices,
    size: float,
    first: Indices | None = None,
) -> Identifiable:
    """The same of some parameters alone, each to be told better than it may be off anyway."""
    place = {int(old): new for new, old in enumerate(chosen)}
    begin = None if first is None else np.array([place[int(i)] for i in first], dtype=int)
    return identifiable_beside(
        _with(model, chosen), scaled[:, chosen], before.of(chosen), begin, size
    )


def identifiable_beside(
    model: MeasuredModel,
    scaled: Array,
    before: PriorRows,
    first: Indices | None = None,
    size: float | None = None,
) -> Identifiable:
    """A minimal set of those that rows (r, p) and what is known before tell.

    Args:
        model: The parameters.
        scaled: How they move coordinates [mm].
        before: What is known before, with errors of the same size as those of coordinates.
        first: Those that are kept before all others; none by default.
        size: That size [mm]: a parameter has to be told better than it may be off anyway; None
            where it only has to be told.
    """
    rows = np.concatenate([scaled, before.rows]) if len(before) else scaled
    order = stages(model)
    if first is not None:
        order = [list(first), *([i for i in stage if i not in first] for stage in order)]
    if size is None:
        return identifiable(rows, model.parameters, order)
    spread = np.array([one.spread for one in model.parameters])
    # What is known before is told, however little that is.
    own = np.linalg.norm(before.rows, axis=0) / size if len(before) else np.zeros(model.p)
    least = size * np.minimum(1 / spread, np.where(own > 0, own / 2, np.inf))
    return identifiable(rows, model.parameters, order, least)


def told_apart(model: MeasuredModel, scaled: Array, before: PriorRows) -> Identifiable:
    """What rows (r, p) tell apart, and after it what is known before adds.

    Args:
        model: The parameters.
        scaled: How they move coordinates [mm].
        before: What is known before of the parameters in their units, with errors of size one.
    """
    alone = identifiable_beside(model, scaled, PriorRows.none(model.p))
    if not len(before):
        return alone
    return identifiable_beside(model, scaled, before.scaled(np.ones(model.p), ERRORS), alone.kept)


def _at_most_likely(model: MeasuredModel, start: Array, prior: Prior) -> Array:
    """Where a search begins (p,): errors of the joints, and springs, where they are expected."""
    found = start.copy()
    for i, (one, marginal) in enumerate(zip(model.parameters, prior.marginals, strict=True)):
        if one.place == "joint" or one.is_spring:
            found[i] += marginal.gaussian()[0]
    # Of a rigid robot a compensator shows nothing: a search begins with the guess then.
    if len(model.numbers.of) and model.gives is not None:
        own = [i for i, one in enumerate(model.parameters) if one.place == "compliance"]
        guess = model.gives.compliances[model.compliant]
        found[own] = np.where(found[own] == 0, guess, found[own])
    return found


def placed_tools(model: MeasuredModel, theta: Array) -> Array:
    """Markers (k, 3) in the tool frame, with the shifts among parameters theta (p,) [m]."""
    places = np.array(model.offsets, dtype=float)
    for one, value in zip(model.parameters, theta, strict=True):
        if one.place == "tool" and not one.turns:
            places[model.markers.index(one.of), "xyz".index(one.component)] += value
    return places


def placed_turns(model: MeasuredModel, theta: Array) -> Array | None:
    """Orientations (k, 3) of the markers there, as rotation vectors [rad]; None without any."""
    if model.row_count == 3:
        return None
    turns = np.zeros((len(model.markers), 3))
    for one, value in zip(model.parameters, theta, strict=True):
        if one.place == "tool" and one.turns:
            turns[model.markers.index(one.of), TURNS.index(one.component)] = value
    return turns


def stages(model: MeasuredModel) -> list[list[int]]:
    """What is kept first: base and tools, zeros of the joints, their springs, and the geometry.

    Other springs come after it, and couplings of theirs last.
    """
    order = {"base": 0, "tool": 0, "compliance": 2, "joint": 3, "compensator": 4}
    ranks = [
        1 if one.along else order.get(one.place, 3 + len(one.ends)) for one in model.parameters
    ]
    return [[i for i, rank in enumerate(ranks) if rank == stage] for stage in range(6)]


def _scaled(model: MeasuredModel, theta: Array, means: MarkerPositions, torque: Torque) -> Array:
    """Rows (n, p) that are those of what was seen turned, in millimetres for a unit of each."""
    return columns_of(model, means, model.see(theta, means.q, torque)).compressed


def _wide(model: MeasuredModel, theta: Array, means: MarkerPositions, loads: Loads | None) -> Array:
    """The same (n, p) of any poses under the loads of the sheet: random ones, and its own.

    It shows what any poses could tell.
    """
    rng = np.random.default_rng(0)
    lower, upper = np.clip(model.robot.limits, -np.pi, np.pi)
    q = rng.uniform(lower, upper, (RANDOM_POSES, model.robot.n))
    like = np.concatenate([np.arange(len(means)), rng.integers(0, len(means), RANDOM_POSES)])
    wide = replace(
        means[like],
        q=np.concatenate([means.q, q]),
        measured=np.zeros((len(like), *means.measured.shape[1:])),
    )
    torque = loading_of(model.rigid, wide, loads)
    return _scaled(model, theta, wide, torque)


def _require_enough(means: MarkerPositions, rank: int) -> None:
    """Check that there are as many coordinates as parameters.

    Raises:
        TooFewPosesError: There are not.
    """
    coordinates = int(means.rows_seen.sum())
    if coordinates < rank:
        missing = -(-(rank - coordinates) // int(means.present.sum()))
        raise TooFewPosesError(
            f"{coordinates} measured coordinates for {rank} parameters that poses can tell apart; "
            f"expected at least {missing} more pose{'s' if missing > 1 else ''}"
        )


def _require_noise_told(means: MarkerPositions, rank: int) -> None:
    """Check that residuals can tell how large the errors are.

    Raises:
        NoiseNotToldError: They cannot.
    """
    dof = int(means.rows_seen.sum()) - rank
    if dof < LEAST_DOF:
        raise NoiseNotToldError(
            f"{dof} coordinates more than the {rank} parameters do not tell the size of the noise; "
            f"expected at least {LEAST_DOF:.0f}: measure more poses, or state the noise"
        )


def _in_turns(
    model: MeasuredModel,
    theta: Array,
    data: MarkerPositions,
    stated: PositionNoise,
    loads: Loads | None,
    robust: bool,
    prior: Prior,
) -> tuple[Array, PositionNoise, Array]:
    """Fit parameters and noise in turns; parameters (p,), noise and weights (m,) of the poses."""
    means = data.means
    noise = stated
    weights = np.ones(len(means))
    last = np.zeros(3)
    slides = model.robot.slides

    def at_rest(theta: Array, derivatives: bool) -> Torque:
        return loading_of(model.bending(theta), means, loads, derivatives)

    for turn in range(NOISE_ROUNDS):
        before = known_before(prior, model, theta)
        rows = PoseRows.of(model, theta, means, at_rest(theta, True), before)
        if not turn:
            noise = noise_of_repeats(data, rows.motion, rows.places, stated)[0]
        noise = rows.weighted(weights).with_model_error(noise, slides)
        V = rows.errors(noise)[: len(means)]
        if robust:
            weights = _trusted(rows.residual[: len(means)], V, means)
        weighing = working(V, means).over(weights).inverse
        # Rows of the prior count as those of the poses do, whose weights are below those of V.
        weight = 1 / np.sqrt(1 + WHITE_SHARE)
        theta = fit_beside(model, theta, means, at_rest, prior, weight, weighing)
        reading = noise.typical(rows.places) if noise.unknown else noise.reading
        now = np.array([noise.model_white, np.max(noise.model_joints, initial=0.0), reading])
        if turn and np.abs(now - last).max() <= SETTLED_NOISE * now.max():
            break
        last = now
    return theta, noise, weights


def _as_shown(
    model: MeasuredModel,
    theta: Array,
    noise: PositionNoise,
    weights: Array,
    data: MarkerPositions,
    loads: Loads | None,
    prior: Prior,
) -> PositionNoise:
    """The noise that is stated with a fit, which was weighted by another.

    Weights have one size of the model's error for all joints, which predicts best; the stated noise
    has one a joint where the residuals say so, without which bands are too narrow where a load that
    nobody told bends the robot.
    """
    means = data.means
    torque = loading_of(model.bending(theta), means, loads)
    before = known_before(prior, model, theta)
    rows = PoseRows.of(model, theta, means, torque, before).weighted(weights)
    return rows.with_model_error(noise, model.robot.slides, singly=True)


def _trusted(residual: Array, V: Scatter, means: MarkerPositions) -> Array:
    """Weights (m,) of poses with multivariate t errors, one at most (Lange et al. 1989)."""
    z2 = np.einsum("mr,mr->m", residual, V.inverse.times(residual[..., None])[..., 0])
    told = (means.same_poses.worth > 0).sum(axis=(1, 2))
    weights = (NU + told) / (NU + z2)
    return np.minimum(weights, 1.0)
