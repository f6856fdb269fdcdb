"""A robot's geometry and springs, identified from absolute positions."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.inference.geometry.position_noise import PositionNoise, fitted_kinds
from edtk.model.geometry.geometric_model import GeometricModel
from edtk.model.geometry.geometric_parameter import GeometricParameter
from edtk.system.typing import Array, Mask

MM = 1e3
LEAST_DOF = 3.0  # of a band: below it a quantile of Student's t says nothing
# Standard deviation of a parameter that poses leave open, in its units: 10 mm, 10 mrad.
UNKNOWN = 10.0


class Loads(Protocol):
    """What loads the joints."""

    def __call__(self, q: Array, wrench: Array) -> Array:
        """Loads (m, n) of the free joints [N m or N] in poses q (m, n) under wrenches (m, 6)."""


@dataclass(frozen=True, eq=False)
class Predicted:
    """Positions that a fitted model predicts, in the frame of the instrument.

    Attributes:
        points: Positions (m, k, 3) [m].
        std: Standard deviation (m, k, 3) of a measured coordinate about them [m].
        half: Half the width (m, k, 3) of the 95 % band [m].
        open: How far (m, k) what the calibration left open may move each marker, at one standard
            deviation [m].
        turns: Orientations (m, k, 3, 3).
        turn_std: Standard deviation (m, k, 3) of a measured orientation about them, as a turn in
            the axes of the instrument [rad]; None where none is measured.
        turn_half: Half the width (m, k, 3) of its 95 % band [rad]; None likewise.
    """

    points: Array
    std: Array
    half: Array
    open: Array
    turns: Array
    turn_std: Array | None = None
    turn_half: Array | None = None

    def inside(self, measured: Array) -> Mask:
        """Which measured coordinates (m, k, 3) are within the bands; NaN are not."""
        return np.abs(measured - self.points) <= self.half


@dataclass(frozen=True, eq=False)
class FittedGeometry:
    """What a prediction needs: a model, its parameters, and how well they are known.

    Attributes:
        model: With the parameters that were identified.
        theta: Their values (p,) in SI units.
        covariance: Of the parameters in their own units (p, p).
        open_parameters: Parameters that the drawing has besides, and that the poses left open.
        shares: How the open ones hang on the identified ones (p, open), in units.
        noise: The errors of a pose.
        placed: Markers (k, 3) in the tool frame, where the geometry of the drawing has them [m]:
            that of the model's start and these is the robot that commands are made for.
        placed_turns: Their orientations (k, 3) there, as rotation vectors [rad]; None where
            positions alone are measured.
    """

    model: GeometricModel
    theta: Array
    covariance: Array
    open_parameters: tuple[GeometricParameter, ...]
    shares: Array
    noise: PositionNoise
    placed: Array
    placed_turns: Array | None = None

    @cached_property
    def std(self) -> Array:
        """Standard deviations (p,) in the parameters' units."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def values(self) -> Array:
        """Values (p,) in the parameters' units."""
        return self.theta / self.model.scales

    @cached_property
    def compliances(self) -> Array:
        """Compliances (n,) of all free joints [rad/(N m)]; zero where they are not parameters."""
        return self.model.compliances(self.theta)

    def torque(self, q: Array, wrench: Array, loads: Loads | None) -> Array | None:
        """Loads (m, n) of the joints where the springs bring them to rest, to second order."""
        return resting_torque(self.compliances, q, wrench, loads)

    def columns(self, q: Array, wrench: Array, loads: Loads | None = None) -> Array:
        """How the positions move with the parameters (m, 3k, p) [mm per unit].

        Args:
            q: Joint variables (m, n) [rad or m].
            wrench: Forces and torques (m, 6).
            loads: What they load the joints with.
        """
        seen = self.model.see(self.theta, q, self.torque(q, wrench, loads))
        assert seen.jacobian is not None
        return np.asarray(
            MM * (seen.jacobian * self.model.scales).reshape(len(q), -1, self.model.p)
        )

    def predict(
        self, q: Array, wrench: Array | None = None, loads: Loads | None = None
    ) -> Predicted:
        """Positions of all markers in some poses, with 95 % bands.

        The covariance of a pose's coordinates is ``J C J' + R + D``, of the parameters, of a
        reading and of what the model leaves out; and that of open parameters where they move the
        markers.

        Args:
            q: Joint variables (m, n) [rad or m].
            wrench: Forces and torques (m, 6); None for none.
            loads: What they load the joints with.
        """
        wrench = np.zeros((len(q), 6)) if wrench is None else wrench
        torque = self.torque(q, wrench, loads)
        seen = self.model.see(self.theta, q, torque)
        assert seen.jacobian is not None
        assert seen.by_joints is not None
        m, k = seen.points.shape[:2]
        rows = self.model.row_count
        J = MM * (seen.jacobian * self.model.scales).reshape(m, rows * k, -1)
        motion = seen.by_joints.reshape(m, rows * k, -1)
        known = np.einsum("mrp,pq,mrq->mr", J, self.covariance, J)
        own = np.einsum("mrr->mr", self.noise.of_reading(motion) + self.noise.of_model(motion))
        left = self._left(q, torque, J)
        # Rounding may leave less than nothing of a variance that is none.
        var = np.maximum(known + own + left, 0.0)
        half = np.sqrt(var) * student_quantile(self.dof(motion))
        shape = (m, k, rows)
        half = half.reshape(shape) / MM
        std = np.sqrt(var).reshape(shape) / MM
        return Predicted(
            points=seen.points,
            std=std[..., :3],
            half=half[..., :3],
            open=np.sqrt(left.reshape(shape)[..., :3].sum(axis=-1)) / MM,
            turns=seen.turns,
            turn_std=std[..., 3:] if rows > 3 else None,
            turn_half=half[..., 3:] if rows > 3 else None,
        )

    def _left(self, q: Array, torque: Array | None, J: Array) -> Array:
        """Variances (m, 3k) that the open parameters add [mm^2]."""
        if not self.open_parameters:
            return np.zeros(J.shape[:2])
        every = self.model.with_parameters((*self.model.parameters, *self.open_parameters))
        theta = np.concatenate([self.theta, np.zeros(len(self.open_parameters))])
        columns = every.see(theta, q, torque).jacobian
        assert columns is not None
        wide = MM * (columns * every.scales).reshape(*J.shape[:2], -1)
        apart = wide[..., self.model.p :] - J @ self.shares
        return np.asarray(UNKNOWN**2 * (apart**2).sum(axis=-1))

    def dof(self, motion: Array) -> Array:
        """Degrees of freedom (m, 3k) of the bands: those of the fitted variances.

        Args:
            motion: Motions (m, 3k, n) of the coordinates by the joints [mm/mrad].
        """
        fit = self.noise.model_fit
        if fit is None:
            return np.full(motion.shape[:2], np.inf)
        own = np.einsum("mrr->mr", self.noise.of_reading(motion) + self.noise.of_model(motion))
        slides = self.model.chain.robot.joints
        kinds = np.array([joint.kind == "prismatic" for joint in slides])
        whites = self.noise.white_kinds(own.shape[1])
        masks = fitted_kinds(kinds, len(fit.variances), len(whites))
        parts = [
            *(np.broadcast_to(white, own.shape) for white in whites),
            *((motion[..., mask] ** 2).sum(axis=-1) for mask in masks),
        ]
        slopes = np.stack(parts, axis=-1)
        dof = fit.relative_dof(slopes)
        # Only the part that was fitted is uncertain.
        share = np.divide(slopes @ fit.variances, own, out=np.ones_like(own), where=own > 0)
        return np.maximum(dof / np.maximum(share, 1e-6) ** 2, LEAST_DOF)


def resting_torque(
    compliances: Array, q: Array, wrench: Array, loads: Loads | None
) -> Array | None:
    """Loads (m, n) of the joints at rest: ``tau(q + k tau)``, by three substitutions."""
    if loads is None:
        return None
    torque = loads(q, wrench)
    for _ in range(3 if compliances.any() else 0):
        torque = loads(q + compliances * torque, wrench)
    return torque


def student_quantile(dof: Array) -> Array:
    """The 97.5 % quantiles of Student's t."""
    from scipy.stats import t

    return np.asarray(t.ppf(0.975, dof))


@dataclass(frozen=True, eq=False)
class TurnResiduals:
    """Residuals of orientations, as turns in the axes of the instrument [rad].

    Attributes:
        residual: Of the fit (m, k, 3); NaN where a marker was not seen.
        left_out: Of each pose predicted without it (m, k, 3).
        left_out_half: Half the widths of the 95 % bands of those (m, k, 3).
    """

    residual: Array
    left_out: Array
    left_out_half: Array


@dataclass(frozen=True, eq=False)
class GeometricFit:
    """A fit of one sheet, with what tells how good it is.

    Attributes:
        fitted: Parameters and noise.
        data: The positions.
        structural: Rank that enough poses would have.
        redundant: Sentences on parameters that no pose could tell from others.
        open: Sentences on those that these poses do not.
        placed: Root mean square distance [m] with base and tools fitted alone.
        residual: Measured less fitted positions of the poses' means (m, k, 3) [m]; NaN where a
            marker was not seen.
        left_out: The same for each pose predicted without it (m, k, 3).
        left_out_half: Half the widths of the 95 % bands of those (m, k, 3) [m].
        surprise: Squared size (m,) of each pose's error left out, over its covariance: chi-square
            with as many degrees of freedom as coordinates.
        weights: Weights (m,) of the poses: one, or less where a robust loss trusts them less.
        turns: The residuals of orientations; None where these were not measured.
    """

    fitted: FittedGeometry
    data: MarkerPositions
    structural: int
    redundant: tuple[str, ...]
    open: tuple[str, ...]
    placed: float
    residual: Array
    left_out: Array
    left_out_half: Array
    surprise: Array
    weights: Array
    turns: TurnResiduals | None = None

    @property
    def rank(self) -> int:
        """Number of parameters that were identified."""
        return self.fitted.model.p

    @property
    def rms(self) -> float:
        """Root mean square distance of the fit [m]."""
        return root_mean_square(self.residual)

    @property
    def loo_rms(self) -> float:
        """Root mean square distance of poses that were left out one by one [m]."""
        return root_mean_square(self.left_out)

    @cached_property
    def share_inside(self) -> float:
        """Share of coordinates that, left out, are within their 95 % bands."""
        pairs = [(self.left_out, self.left_out_half)]
        if self.turns is not None:
            pairs.append((self.turns.left_out, self.turns.left_out_half))
        errors, halves = (np.concatenate(part, axis=-1) for part in zip(*pairs, strict=True))
        seen = np.isfinite(errors)
        return float((np.abs(errors) <= halves)[seen].mean())


def root_mean_square(distances: Array) -> float:
    """Root mean square length of vectors (m, k, 3) [m], of which some are NaN."""
    squares = (distances**2).sum(axis=-1)
    known = np.isfinite(squares)
    return float(np.sqrt(squares[known].mean())) if known.any() else float("nan")


def root_mean_squares(distances: Array) -> Array:
    """The same of each visit (m,)."""
    return np.array([root_mean_square(one[None]) for one in distances])
