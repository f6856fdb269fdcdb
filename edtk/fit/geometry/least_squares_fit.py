"""Nonlinear least squares on what instruments read, and the weights of its coordinates."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from edtk.fit.geometry.marker_positions import MarkerPositions
from edtk.fit.prior import Prior, PriorRows
from edtk.measure.measured_model import MeasuredModel, Seen, Torque
from edtk.measure.position_noise import white_kinds
from edtk.robots.rotations import rotation_vectors
from edtk.system.typing import Array, Mask

MM = 1e3
WHITE_SHARE = 0.5  # of the size of a pose's errors that weights count as white
TOLERANCE = 1e-12
MOST = 200  # evaluations; ten are the rule, and positions that no robot has end nowhere


@dataclass(frozen=True, eq=False)
class PoseRows:
    """Residuals, columns and motions of the poses, in millimetres and milliradians.

    They are zero where nothing was seen. What is known besides the poses has rows below theirs, as
    of further poses in which no marker was seen: their errors are independent and of size one, and
    no variance of the noise moves them.

    Attributes:
        residual: Residuals (m, r).
        design: Columns (m, r, p) of the parameters in their units.
        motion: Motions (m, r, n) by the joints.
        places: Where the markers are (m, k, 3) in the frame of the instrument [m].
        beside: Number of the last of these blocks that are no poses.
    """

    residual: Array
    design: Array
    motion: Array
    places: Array
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
        assert seen.jacobian is not None
        assert seen.by_joints is not None
        m, k = means.seen.shape
        width = means.rows * k
        design = np.where(means.rows_seen[..., None], seen.jacobian * model.scales, 0.0)
        found = cls(
            MM * measured_less_seen(means, seen).reshape(m, width),
            MM * design.reshape(m, width, -1),
            seen.by_joints.reshape(m, width, -1),
            seen.places,
        )
        return found if before is None else found._with(before, theta / model.scales)

    def _with(self, before: PriorRows, u: Array) -> "PoseRows":
        """The same with rows of what is known of parameters u (p,) in their units."""
        apart = before.values - before.rows @ u
        known = PriorRows(before.rows, apart)
        design = known.below(self.design)
        extra = len(design) - len(self.design)
        still = np.zeros((extra, *self.motion.shape[1:]))
        motion = np.concatenate([self.motion, still])
        places = np.concatenate([self.places, np.repeat(self.places[:1], extra, axis=0)])
        return PoseRows(known.measured_below(self.residual), design, motion, places, extra)

    def worth(self, data: MarkerPositions) -> Array:
        """What the readings of each row are worth (m, k, rows); nothing in blocks of no pose."""
        return np.concatenate([data.worth, np.zeros((self.beside, *data.worth.shape[1:]))])

    def differs(self, means: MarkerPositions) -> Mask:
        """Which of the blocks (m,) are differences of two readings."""
        return np.concatenate([means.is_difference, np.zeros(self.beside, dtype=bool)])

    def working(self, V: Array, means: MarkerPositions) -> Array:
        """The covariances (m, r, r) that weight all blocks, see `working`."""
        m = len(means)
        return np.concatenate([working(V[:m], means), (1 + WHITE_SHARE) * V[m:]])

    def weighted(self, weights: Array) -> "PoseRows":
        """With residuals and columns scaled by the roots of the poses' weights (m,)."""
        root = np.sqrt(self.weights(weights))[:, None]
        return replace(self, residual=self.residual * root, design=self.design * root[..., None])

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


def working(V: Array, means: MarkerPositions) -> Array:
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
    own = np.einsum("mrr->mr", V)
    there = means.rows_seen.reshape(own.shape)
    white = np.zeros_like(own)
    for kind in white_kinds(means.rows, V.shape[1]):
        counted = kind * there
        total = counted.sum(axis=1)
        size = np.divide((own * counted).sum(axis=1), total, where=total > 0, out=np.zeros(len(V)))
        white += kind * size[:, None]
    return V + WHITE_SHARE * white[:, None] * np.eye(V.shape[1])


@dataclass(frozen=True, eq=False)
class LeastSquaresFit:
    """A minimum of the sum of squares.

    Attributes:
        theta: Parameters (p,) in SI units.
        cost: Half the sum of squares there.
        converged: Whether the search settled.
    """

    theta: Array
    cost: float
    converged: bool


def least_squares_fit(
    model: MeasuredModel,
    theta: Array,
    means: MarkerPositions,
    torque: Torque | Callable[[Array, bool], Torque] = None,
    whitening: Array | None = None,
    most: int = MOST,
    before: PriorRows | None = None,
) -> LeastSquaresFit:
    """Fit a model to measured positions by Levenberg-Marquardt, with the analytic Jacobian.

    Parameters are in units in which they are of order one, and residuals in millimetres or in units
    of the noise.

    Args:
        model: What is fitted.
        theta: Where to begin (p,), in SI units.
        means: The positions, a visit a pose.
        torque: Loads (m, n) of the joints [N m], with those before where readings are differences;
            or what says these at parameters (p,), and whether for derivatives.
        whitening: Matrices (m, 3k, 3k) that make the errors of a pose independent and of size one
            [1/mm]; rows of markers that were not seen are zero. None for equal weights.
        most: Evaluations at most.
        before: What is known before of the parameters in their units, its errors in the same units
            as those of the poses.
    """
    if not model.p:
        return LeastSquaresFit(theta, 0.0, True)
    from scipy.optimize import least_squares

    scales = model.scales
    known = PriorRows.none(model.p) if before is None else before

    def loading(theta: Array, derivatives: bool) -> Torque:
        return torque(theta, derivatives) if callable(torque) else torque

    def weighted(rows: Array) -> Array:
        """Rows (m, k, rows, ...) in units of the noise, one beneath the other."""
        m, k = means.seen.shape
        rows = rows * means.rows_seen.reshape(*rows.shape[:3], *(1,) * (rows.ndim - 3))
        flat = MM * rows.reshape(m, means.rows * k, -1)
        flat = flat if whitening is None else whitening @ flat
        return flat.reshape(m * means.rows * k, *rows.shape[3:])

    def residual(u: Array) -> Array:
        there = model.see(u * scales, means.q, loading(u * scales, False), False)
        apart = weighted(-measured_less_seen(means, there))
        return np.concatenate([apart, known.rows @ u - known.values])

    def jacobian(u: Array) -> Array:
        J = model.see(u * scales, means.q, loading(u * scales, True)).jacobian
        assert J is not None
        return np.concatenate([weighted(J * scales), known.rows])

    enough = means.seen.size * means.rows + len(known) >= model.p
    found = least_squares(
        residual,
        theta / scales,
        jacobian,
        method="lm" if enough else "trf",
        xtol=TOLERANCE,
        ftol=TOLERANCE,
        gtol=TOLERANCE,
        max_nfev=most,
    )
    return LeastSquaresFit(found.x * scales, float(found.cost), bool(found.status > 0))


def known_before(
    prior: Prior, model: MeasuredModel, theta: Array, weight: float = 1.0
) -> PriorRows:
    """What is known of a model's parameters in their units, with errors of some size."""
    return PriorRows.near(prior, theta).scaled(model.scales, weight)
