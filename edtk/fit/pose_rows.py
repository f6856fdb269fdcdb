"""Nonlinear least squares on what instruments read, and the weights of its coordinates."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.prior import Prior, PriorRows
from edtk.fit.restricted_likelihood import fit_model_error
from edtk.fit.same_poses import SamePoses
from edtk.measure.few_columns import FewColumns
from edtk.measure.measured_model import MeasuredModel, Seen, Torque
from edtk.measure.position_noise import PositionNoise, white_kinds
from edtk.measure.whitening import Precision, Scatter
from edtk.robots.frames import MM
from edtk.robots.rotations import rotation_vectors
from edtk.system.typing import Array, Mask

WHITE_SHARE = 0.5  # of the size of a pose's errors that weights count as white
# Of the squares: a step that lowers them by less, where all is linear, is the last.
LAST_FALL = 1e-18
LEAST_FALL = 1e-3  # of what is foreseen that a step has to lower the squares by
FIRST_DAMPING = 1e-3  # of the diagonal, after a step that did not
LEAST_DAMPING = 1e-8
OPEN = (
    0.0,
    1e-15,
    1e-13,
    1e-11,
    1e-9,
    1e-6,
)  # of the diagonal, where rows do not tell all parameters
MOST_EVALUATIONS = 200  # evaluations; ten are the rule, and positions that no robot has end nowhere


@dataclass(frozen=True, eq=False)
class PoseRows:
    """Residuals, columns and motions of the poses, in millimetres and milliradians.

    They are zero where nothing was seen. What is known besides the poses has rows below theirs, as
    of further poses in which no marker was seen: their errors are independent and of size one, and
    no variance of the noise moves them. Those of visits of a pose are independent, see `SamePoses`.

    Attributes:
        residual: Residuals (m, r).
        columns: Columns X (m, r, p) of the parameters in their units.
        motion: Motions (m, r, n) by the joints.
        places: Where the markers are (m, k, 3) in the frame of the instrument [m].
        same: Which rows of the visits these are.
        beside: Number of the last of these blocks that are no poses.
    """

    residual: Array
    columns: FewColumns
    motion: Array
    places: Array
    same: SamePoses
    beside: int = 0

    @classmethod
    def of(
        cls,
        model: MeasuredModel,
        theta: Array,
        means: MarkerPositions,
        torque: Torque,
        before: PriorRows | None = None,
    ) -> "PoseRows":
        """At parameters theta (p,), with what is known before of them in their units."""
        seen = model.see(theta, means.q, torque)
        assert seen.by_joints is not None
        m, k = means.seen.shape
        width = means.rows * k
        same = means.same_poses
        found = cls(
            MM * same.apart(measured_less_seen(means, seen)).reshape(m, width),
            columns_of(model, means, seen, same),
            seen.by_joints.reshape(m, width, -1),
            seen.places,
            same,
        )
        return found if before is None or not len(before) else found._with(before, theta, model)

    def _with(self, before: PriorRows, theta: Array, model: MeasuredModel) -> "PoseRows":
        """The same with rows of what is known of parameters in their units."""
        apart = before.values - before.rows @ (theta / model.scales)
        known = PriorRows(before.rows, apart)
        design = known.below(self.design)
        extra = len(design) - len(self.residual)
        still = np.zeros((extra, *self.motion.shape[1:]))
        motion = np.concatenate([self.motion, still])
        places = np.concatenate([self.places, np.repeat(self.places[:1], extra, axis=0)])
        columns = FewColumns.among(design, places.shape[1])
        residual = known.measured_below(self.residual)
        return PoseRows(residual, columns, motion, places, self.same, extra)

    @property
    def worth(self) -> Array:
        """What the readings of each row are worth (m, k, rows); nothing in blocks of no pose."""
        return self._with_none(self.same.worth)

    @property
    def differs(self) -> Mask:
        """Which of the blocks (m,) are differences of two readings."""
        return np.concatenate([self.same.differs, np.zeros(self.beside, dtype=bool)])

    def _with_none(self, each: Array) -> Array:
        """Numbers of visits, and zero for the blocks that are no poses."""
        return np.concatenate([each, np.zeros((self.beside, *each.shape[1:]))])

    def errors(self, noise: PositionNoise) -> Scatter:
        """Covariances (m, r, r) of the blocks, each by itself [mm^2]."""
        changes = self._with_none(self.same.changes)
        return noise.of_pose(self.motion, self.places, self.worth, self.differs, changes)

    def with_model_error(
        self, noise: PositionNoise, slides: Mask, singly: bool = False
    ) -> PositionNoise:
        """The noise, with what the model leaves out of these residuals, see `fit_model_error`."""
        changes = self._with_none(self.same.changes)
        given = (self.motion, self.places, self.worth, self.residual, self.columns, slides, singly)
        return fit_model_error(noise, *given, self.differs, changes)

    @cached_property
    def design(self) -> Array:
        """The columns as an array (m, r, p)."""
        return self.columns.dense

    def working(self, V: Scatter, means: MarkerPositions) -> Scatter:
        """The covariances (m, r, r) that weight all blocks, see `working`."""
        white = V.variances
        white[: len(means)] = _sizes(V[: len(means)], means)
        return V.with_white(WHITE_SHARE * white)

    def weighted(self, weights: Array) -> "PoseRows":
        """With residuals and columns scaled by the roots of the poses' weights (m,)."""
        root = np.sqrt(self.weights(weights))[:, None]
        columns = self.columns.scaled(root[..., None])
        return replace(self, residual=self.residual * root, columns=columns)

    def weights(self, weights: Array) -> Array:
        """Weights (m,) of all blocks, one of those that are no poses."""
        return np.concatenate([weights, np.ones(self.beside)])


def measured_less_seen(means: MarkerPositions, seen: Seen) -> Array:
    """Residuals (m, k, rows) [m, rad], zero where nothing was seen.

    That of an orientation is the vector of the turn from the predicted to the measured one, in the
    axes of the instrument.
    """
    apart = np.where(means.rows_seen[..., :3], means.measured - seen.points, 0.0)
    if means.turns is None:
        return apart
    turned = means.turns @ np.swapaxes(seen.turns, -1, -2)
    turned = np.where(means.rows_seen[..., 3:, None], turned, np.eye(3))
    return np.concatenate([apart, rotation_vectors(turned)], axis=-1)


def working(V: Scatter, means: MarkerPositions) -> Scatter:
    """The covariances (m, r, r) that weight the coordinates of a pose: V and half its size, white.

    Weights by V alone would trust what markers of a pose have in common as little as V says, and
    their shape as much. That is best where V is true. Real robots err in other ways too: of poses
    of two of them that were held out, weights by V alone predict up to a tenth worse from many
    poses, and equal weights up to a twentieth worse from few. Covariances of parameters are those
    of the estimate with these weights under V, so that they are right for any weights.

    Args:
        V: Covariances of the poses; where nothing was read, variances do not count.
        means: A visit a pose. Positions and orientations have a size each, and so have differences.
    """
    return V.with_white(WHITE_SHARE * _sizes(V, means))


def _sizes(V: Scatter, means: MarkerPositions) -> Array:
    """Mean variances (m, r) of what was read in a pose, of positions and of orientations."""
    own = V.variances
    there = means.same_poses.worth.reshape(own.shape) > 0
    white = np.zeros_like(own)
    for kind in white_kinds(means.rows, own.shape[1]):
        counted = kind * there
        total = counted.sum(axis=1)
        size = np.divide(
            (own * counted).sum(axis=1), total, where=total > 0, out=np.zeros(len(own))
        )
        white += kind * size[:, None]
    return white


@dataclass(frozen=True, eq=False)
class LeastSquaresFit:
    """A minimum of the sum of squares.

    Attributes:
        theta: Parameters (p,) in SI units.
        cost: Half the sum of squares there.
    """

    theta: Array
    cost: float


def least_squares_fit(
    model: MeasuredModel,
    theta: Array,
    means: MarkerPositions,
    torque: Torque | Callable[[Array, bool], Torque] = None,
    weights: Precision | None = None,
    most: int = MOST_EVALUATIONS,
    before: PriorRows | None = None,
) -> LeastSquaresFit:
    """Fit a model to measured positions by Levenberg-Marquardt, with the analytic Jacobian.

    Parameters are in units in which they are of order one, and residuals in millimetres or in units
    of the noise. A step solves ``(M + l diag(M)) s = g`` with ``M = X' W X``, whose columns are few
    in each row, and their gradient g (Marquardt 1963). The damping l is nothing as long as such
    steps lower the squares.

    Args:
        model: What is fitted.
        theta: Where to begin (p,), in SI units.
        means: The positions, a visit a pose.
        torque: Loads (m, n) of the joints [N m], with those before where readings are differences;
            or what says these at parameters (p,), and whether for derivatives.
        weights: Inverse covariances W of the poses [1/mm^2]; None for equal weights.
        most: Evaluations at most.
        before: What is known before of the parameters in their units, its errors in the same units
            as those of the poses.
    """
    if not model.p:
        return LeastSquaresFit(theta, 0.0)
    known = PriorRows.none(model.p) if before is None else before
    squares = _Squares(model, means, torque, weights, known)
    u = theta / model.scales
    at = squares.at(u)
    damping = 0.0
    slope = squares.slope(u, at)
    for _ in range(most):
        step = slope.step(damping)
        after = squares.at(u + step)
        foreseen = slope.fall(step, damping)
        fall = at.cost - after.cost
        # Near the end a step is worth taking whose fall is below the rounding of the squares.
        rounding = 2 * np.sqrt(at.cost * squares.rounding) + squares.rounding
        if better := fall >= LEAST_FALL * foreseen - rounding:
            u, at = u + step, after
        # Where the squares do not fall, a foreseen fall below their rounding is none: of exact
        # readings steps would go about for ever.
        if foreseen <= max(LAST_FALL * at.cost, squares.rounding if fall > 0 else rounding):
            break
        if better:
            damping = damping / 10 if damping > LEAST_DAMPING else 0.0
            slope = squares.slope(u, at)
        else:
            damping = max(10 * damping, FIRST_DAMPING)
    return LeastSquaresFit(u * model.scales, at.cost)


@dataclass(frozen=True, eq=False)
class _Apart:
    """Residuals at some parameters.

    Attributes:
        weighted: Those of the poses times their weights (m, r).
        known: What is known before, less what these parameters say (c,).
        cost: Half the sum of squares.
    """

    weighted: Array
    known: Array
    cost: float


@dataclass(frozen=True, eq=False)
class _Slope:
    """How squares fall about some parameters.

    Attributes:
        M: Half their second derivatives (p, p), to first order.
        g: Half their fall (p,) along each parameter.
    """

    M: Array
    g: Array

    def step(self, damping: float) -> Array:
        """The step (p,) of Marquardt; more is damped where rows do not tell all parameters."""
        own = np.diagonal(self.M)
        size = np.sqrt(np.where(own > 0, own, 1.0))
        unit = self.M / np.outer(size, size)
        p = len(size)
        for more in OPEN:
            try:
                L = np.linalg.cholesky(unit + (damping + more) * np.eye(p))
                break
            except np.linalg.LinAlgError:
                if more == OPEN[-1]:
                    raise
        half = np.linalg.solve(L, self.g / size)
        return np.asarray(np.linalg.solve(L.T, half) / size)

    def fall(self, step: Array, damping: float) -> float:
        """By how much half the squares fall with a step, where all is linear."""
        own = damping * np.diagonal(self.M)
        return float(0.5 * step @ (self.M @ step) + own @ step**2)


@dataclass(frozen=True, eq=False)
class _Squares:
    """Squares of what a model leaves of positions, and of what is known before."""

    model: MeasuredModel
    means: MarkerPositions
    torque: Torque | Callable[[Array, bool], Torque]
    weights: Precision | None
    known: PriorRows

    @property
    def same(self) -> SamePoses | None:
        """The rows that weights are of; None where all visits count alike."""
        return None if self.weights is None else self.means.same_poses

    @cached_property
    def rounding(self) -> float:
        """Half the squares of what rounding makes of the positions: no fall is told below it."""
        x = np.where(self.means.rows_seen[..., :3], self.means.measured, 0.0)
        off = np.zeros(self.means.rows_seen.shape)
        off[..., :3] = MM * np.finfo(float).eps * x
        return 0.5 * float((off.reshape(len(off), -1) * self._weighted(off)).sum())

    def _weighted(self, apart: Array) -> Array:
        """Rows (m, k, rows) times their weights (m, r)."""
        z = apart.reshape(len(apart), -1)
        return z if self.weights is None else self.weights.times(z[..., None])[..., 0]

    def _seen(self, u: Array, derivatives: bool) -> Seen:
        theta = u * self.model.scales
        torque = self.torque(theta, derivatives) if callable(self.torque) else self.torque
        return self.model.see(theta, self.means.q, torque, derivatives)

    def at(self, u: Array) -> _Apart:
        """At parameters u (p,) in their units."""
        apart = MM * measured_less_seen(self.means, self._seen(u, False)) * self.means.rows_seen
        apart = apart if self.same is None else self.same.apart(apart)
        weighted = self._weighted(apart)
        known = self.known.values - self.known.rows @ u
        squares = float((apart.reshape(weighted.shape) * weighted).sum() + known @ known)
        return _Apart(weighted, known, squares / 2)

    def slope(self, u: Array, at: _Apart) -> _Slope:
        """The slope there."""
        X = self._columns(u)
        alike = np.eye(X.part.shape[2])[None, None]
        information = X.gram(alike) if self.weights is None else X.information(self.weights)
        rows = self.known.rows
        return _Slope(
            information + rows.T @ rows,
            X.onto(at.weighted[..., None])[:, 0] + rows.T @ at.known,
        )

    def _columns(self, u: Array) -> FewColumns:
        """Columns of the poses [mm a unit]."""
        return columns_of(self.model, self.means, self._seen(u, True), self.same)


def columns_of(
    model: MeasuredModel, means: MarkerPositions, seen: Seen, same: SamePoses | None = None
) -> FewColumns:
    """Columns X (m, r, p) of what is seen in the poses by parameters in their units [mm, mrad].

    Rows of what was not read are zero; they are independent ones where `same` says which these are.
    """
    assert seen.columns is not None
    found = seen.columns.in_units(MM * model.scales).scaled(means.rows_seen)
    return found if same is None else replace(found, part=same.apart(found.part))


def known_before(
    prior: Prior, model: MeasuredModel, theta: Array, weight: float = 1.0
) -> PriorRows:
    """What is known of a model's parameters in their units, with errors of some size."""
    return PriorRows.near(prior, theta).scaled(model.scales, weight)
