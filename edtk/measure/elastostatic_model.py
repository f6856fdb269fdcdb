"""The elastostatic model: deflection under load, linear in the joint compliances."""

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from edtk.measure.friction import Friction
from edtk.measure.instruments.marker import Marker
from edtk.measure.instruments.one_row import whole_instruments
from edtk.measure.instruments.pose_marker import PoseMarker
from edtk.measure.instruments.sensor import Sensor
from edtk.measure.parameters import parameter_names
from edtk.robots.compensator import GivingWay
from edtk.robots.frames import (
    WRENCH,
    BodyPoint,
    Frames,
    columns_slope,
    cross,
    dot,
    force_and_torque,
    summed_slope,
)
from edtk.robots.robot import Robot
from edtk.robots.rotations import without_rounding
from edtk.robots.weights import DeadWeights, Loading
from edtk.system.typing import Array, as_slice


def regressor_at_tool_point(
    frames: Frames, wrench: ArrayLike, joints: list[int], reach: float, turns: bool
) -> Array:
    """Column j is ``(v_j, w_j) tau_j``, as both factors belong to the same point.

    Args:
        frames: The poses.
        wrench: Forces and torques (..., 6) or (6,) [N, N m].
        joints: Indices (p,) of the joints that have a column.
        reach: Reach of the robot, against which rounding is judged [m].
        turns: Whether rotations are measured too.

    Returns:
        Regressors (p, 3 or 6, ...).
    """
    F, T = force_and_torque(wrench, frames)
    which = as_slice(joints)
    angular = frames.angular[which]
    linear = without_rounding(frames.linear[which], reach)
    torque = dot(linear, F)
    if T.any():
        torque += dot(angular, T)
    size = reach * np.abs(F).sum(axis=1) + np.abs(T).sum(axis=1)
    torque = without_rounding(torque, size)
    A = linear * torque[:, None]
    if not turns:
        return A
    return np.concatenate([A, angular * torque[:, None]], axis=1)


def slope_at_tool_point(frames: Frames, wrench: ArrayLike, joints: list[int], B: Array) -> Array:
    """Derivatives of ``<B, A>`` in one pass, see `ElastostaticModel.regressor_slope`.

    With ``(b_j, c_j)`` the column of B and ``s_j = v_j.b_j + w_j.c_j``, both terms are those of
    one point, with the weights

        f_j = tau_j b_j + s_j F,   t_j = tau_j c_j + s_j T.

    Args:
        frames: The poses.
        wrench: Forces and torques (..., 6) or (6,) [N, N m].
        joints: Indices (p,) of the joints that have a column.
        B: Weights (p, 3 or 6, ...); six where rotations are measured too.

    Returns:
        Derivatives (n, ...).
    """
    which = as_slice(joints)
    v = frames.linear[which]
    w = frames.angular[which]
    F, T = force_and_torque(wrench, frames)
    tau = dot(v, F)
    s = dot(v, B[:, :3])
    # The terms of torques and measured rotations are left out where all of them are zero.
    rotations = B.shape[1] == 6
    turned = rotations or bool(T.any())
    if turned:
        tau += dot(w, T)
    if rotations:
        s += dot(w, B[:, 3:])
    f = tau[:, None] * B[:, :3] + s[:, None] * F
    turning, moving = np.zeros((2, len(frames.q), *f.shape[1:]))
    turning[which] = cross(v, f)
    moving[which] = cross(f, w)
    if turned:
        t = s[:, None] * T
        if rotations:
            t = t + tau[:, None] * B[:, 3:]
        turning[which] += cross(w, t)
    return summed_slope(frames.linear, frames.angular, turning, moving)


Rows = Literal["position", "pose"]


@dataclass(frozen=True, eq=False)
class ElastostaticModel:
    """A robot with compliant joints, loaded and measured at its tool point, or elsewhere.

    A measurement is a function y(q) of the joints, and a load turns joint j by ``k_j tau_j(q)``.
    So column j of the regressor is ``dy/dq_j tau_j``, see `motion_of` and `torque_of`.

    Args:
        robot: The chain; its tool frame is where the wrench acts and the deflection is measured.
        unknown: Indices (p,) of the joints whose compliances are the parameters; None for all.
        rows: "position" for three measured rows (Eq. 7), "pose" for all six (Eq. 8), of the tool
            point.
        sensors: Instruments whose rows are measured instead, one after another; none by default.
        load_point: Where the wrench acts; the tool point by default.
        weights: Weights that load the joints besides the wrench; None for none.
        own_weights: Weights that bend the robot with and without the load, so that displacements
            see them to the second order only, at a loaded equilibrium; None for none.
        gives: How joints with compensators give way about a guess of their compliances, which the
            columns of regressors are times; None where none does, or for the joints alone.
        friction: What friction of the unknown joints holds, whose shares are parameters behind the
            compliances; None where it counts for nothing.

    Raises:
        ValueError: An index is out of range or repeated.
    """

    robot: Robot
    unknown: tuple[int, ...] | None = None
    rows: Rows = "position"
    sensors: tuple[Sensor, ...] = ()
    load_point: BodyPoint = field(default_factory=BodyPoint)
    weights: DeadWeights | None = None
    own_weights: DeadWeights | None = None
    gives: GivingWay | None = None
    friction: Friction | None = None

    def __post_init__(self) -> None:
        unknown = tuple(range(self.robot.n)) if self.unknown is None else tuple(self.unknown)
        repeated = len(set(unknown)) < len(unknown)
        in_range = set(unknown) <= set(range(self.robot.n))
        if repeated or not in_range or not unknown:
            raise ValueError(
                f"unknown joints {unknown} must be distinct indices below {self.robot.n}"
            )
        object.__setattr__(self, "unknown", unknown)

    @property
    def joints(self) -> list[int]:
        """Indices of the joints whose compliances are the parameters."""
        return list(self.unknown or ())

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters: k2 for joint q2, and k_NAME for a joint of another name.

        Those of friction come last.
        """
        names = [self.robot.joint_names[j] for j in self.joints]
        held = () if self.friction is None else self.friction.names(names)
        return (*parameter_names(names), *held)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the parameters: those of prismatic joints are displacements per force."""
        kinds = (self.robot.joints[j].kind for j in self.joints)
        return tuple("rad/(N m)" if kind == "revolute" else "m/N" for kind in kinds)

    @property
    def unit(self) -> str:
        """The unit of all parameters, or their units."""
        return " or ".join(sorted(set(self.units), reverse=True))

    @property
    def p(self) -> int:
        """Number of parameters."""
        return len(self.joints) + (0 if self.friction is None else len(self.friction))

    @cached_property
    def instruments(self) -> tuple[Sensor, ...]:
        """All that is measured; the tool point where no sensors are given."""
        return self.sensors or (Marker() if self.rows == "position" else PoseMarker(),)

    @cached_property
    def whole_instruments(self) -> tuple[Sensor, ...]:
        """The same, an instrument whose rows are listed one by one as a whole."""
        return whole_instruments(self.instruments)

    @property
    def row_count(self) -> int:
        """Number of measured rows."""
        return sum(sensor.rows for sensor in self.instruments)

    @cached_property
    def is_plain(self) -> bool:
        """Whether load and measurement are at the tool point, and nothing else loads the joints."""
        return not self.sensors and self.weights is None and self.load_point.is_tool_point

    @cached_property
    def by_wrench(self) -> "ElastostaticModel":
        """The model under the wrench alone, whose regressors are linear in it."""
        return self if self.weights is None else replace(self, weights=None)

    @property
    def loading(self) -> Loading:
        """What loads the joints at a loaded equilibrium, besides the wrench itself."""
        both = [weights for weights in (self.weights, self.own_weights) if weights is not None]
        every = both[0].with_more(both[1]) if len(both) > 1 else next(iter(both), None)
        return Loading(self.load_point, every)

    @cached_property
    def bodies(self) -> tuple[int, ...]:
        """Joints whose bodies' frames the model needs, see `Robot.frames`."""
        points = [self.load_point, *(sensor.point for sensor in self.instruments)]
        found = {joint for point in points for joint in point.bodies}
        return tuple(sorted(found.union(self.weights.bodies if self.weights else ())))

    def frames(self, q: ArrayLike, beside: Collection[int] = ()) -> Frames:
        """The chain in the poses q (..., n) [rad or m], with all that this model needs of it.

        Args:
            q: The poses.
            beside: Joints whose bodies others need, see `Robot.frames`.
        """
        return self.robot.frames(q, {*self.bodies, *beside})

    def points_of(self, frames: Frames) -> Array:
        """Positions (s, 3, ...) of the points that the s whole instruments measure [m]."""
        return np.stack([sensor.point.position(frames) for sensor in self.whole_instruments])

    def motion_of(self, frames: Frames) -> Array:
        """Derivatives ``dy/dq`` (n, rows, ...) of the measured rows by all joints [m/rad, 1]."""
        motion = [
            without_rounding(frames.folded(sensor.motion(frames)), self.reach_of(sensor.point))
            for sensor in self.whole_instruments
        ]
        return motion[0] if len(motion) == 1 else np.concatenate(motion, axis=1)

    def motion_slope_of(self, frames: Frames, B: Array) -> Array:
        """Derivatives (n, ...) of ``<B, dy/dq>`` by all joints, weights B (n, rows, ...) fixed."""
        total = np.zeros_like(frames.q)
        first = 0
        for sensor in self.whole_instruments:
            last = first + sensor.rows
            total += frames.folded(sensor.motion_slope(frames, frames.spread(B[:, first:last])))
            first = last
        return total

    def torque_of(self, frames: Frames, wrench: ArrayLike) -> Array:
        """Loads ``tau`` (n, ...) of all joints [N m, or N if prismatic].

        Args:
            frames: The poses.
            wrench: Forces and torques (..., 6) or (6,) at the load point [N, N m].
        """
        F, T = force_and_torque(wrench, frames)
        point = self.load_point.of_load(wrench)
        reach = self.reach_of(point)
        torque = dot(without_rounding(point.linear(frames), reach), F)
        if T.any():
            torque += dot(point.angular(frames), T)
        size = reach * np.abs(F).sum(axis=1) + np.abs(T).sum(axis=1)
        if self.weights is not None:
            torque += self.weights.torque(frames)
            size = size + reach * np.abs(self.weights.force(frames)).sum(axis=1)
        return without_rounding(frames.folded(torque), frames.folded_sizes(size))

    def torque_slope_of(self, frames: Frames, wrench: ArrayLike, s: Array) -> Array:
        """Derivatives (n, ...) of ``sum_j s_j tau_j`` by all joints, weights s (n, ...) fixed."""
        s = frames.spread(s)
        F, T = force_and_torque(wrench, frames)
        point = self.load_point.of_load(wrench)
        linear = point.linear(frames)
        angular = point.angular(frames)
        twist = s[:, None] * T if T.any() else None
        slope = columns_slope(linear, angular, s[:, None] * F, twist)
        if self.weights is not None:
            slope += self.weights.torque_slope(frames, s)
        return frames.folded(slope)

    def reach_of(self, point: BodyPoint) -> float:
        """An upper bound on the distance of a point from the world's origin [m]."""
        return self.robot.reach + float(np.linalg.norm(point.offset, axis=0).max())

    def regressor(self, q: ArrayLike, wrench: ArrayLike) -> Array:
        """Eq. (4): ``A = [J_1 J_1' W, ..., J_n J_n' W]``, so that the deflection is ``A k``.

        Args:
            q: Joint variables (..., n) [rad or m].
            wrench: Forces and torques (..., 6) or (6,) at the load point, in the world frame
                [N, N m].

        Returns:
            Regressors (..., rows, p) of Eq. (3) and (7) [m/(rad/(N m))]; rotation rows in
            [rad/(rad/(N m))].
        """
        return np.moveaxis(self.regressor_of(self.frames(q), wrench), (0, 1), (-1, -2))

    def regressor_of(self, frames: Frames, wrench: ArrayLike) -> Array:
        """Regressors (p, rows, ...) of poses whose frames are at hand, component first."""
        A = self._of_springs(frames, wrench)
        if self.friction is None:
            return A
        factors = self.friction.factors(self.torque_of(frames, wrench)[self.joints])
        return np.concatenate([A, A * factors[:, None]])

    def _of_springs(self, frames: Frames, wrench: ArrayLike) -> Array:
        """The columns of the compliances alone."""
        A = self._by_loads(frames, wrench)
        if self.gives is None:
            return A
        return A * self.gives.factors(frames.q)[0][self.joints, None]

    def _by_loads(self, frames: Frames, wrench: ArrayLike) -> Array:
        """The same of joints without compensators."""
        joints = self.joints
        if self.is_plain and np.shape(wrench)[-1] == WRENCH:
            turns = self.rows == "pose"
            return regressor_at_tool_point(frames, wrench, joints, self.robot.reach, turns)
        return self.motion_of(frames)[joints] * self.torque_of(frames, wrench)[joints, None]

    def regressor_slope(self, q: ArrayLike, wrench: ArrayLike, B: ArrayLike) -> Array:
        """Derivatives of ``<B, A>`` by all joint variables, B held fixed.

        Slopes of criteria need the derivatives of A in no other way. With column j of A equal to
        ``y_j tau_j`` and ``s_j = <b_j, y_j>``,

            d<B, A>/dq = d(sum_j <tau_j b_j, y_j>)/dq + d(sum_j s_j tau_j)/dq,

        tau held fixed in the first term and s in the second: `motion_slope_of` and
        `torque_slope_of`.

        Args:
            q: Joint variables (..., n) [rad or m].
            wrench: Forces and torques (..., 6) or (6,) at the load point [N, N m].
            B: Weights (..., rows, p) or (rows, p) of the regressor's entries.

        Returns:
            Derivatives (..., n).
        """
        frames = self.frames(q)
        B = np.asarray(B, dtype=float)
        B = np.broadcast_to(B, (*frames.position.shape[1:], *B.shape[-2:]))
        slopes = self.regressor_slope_of(frames, wrench, np.moveaxis(B, (-1, -2), (0, 1)))
        return np.moveaxis(slopes, 0, -1)

    def regressor_slope_of(self, frames: Frames, wrench: ArrayLike, B: Array) -> Array:
        """Slopes of poses whose frames are at hand, component first; see `regressor_slope`.

        Args:
            frames: The poses, by `frames`.
            wrench: Forces and torques (..., 6) or (6,) [N, N m].
            B: Weights (p, rows, ...).

        Returns:
            Derivatives (n, ...).
        """
        if self.friction is None:
            return self._spring_slope(frames, wrench, B)
        # Columns of friction are those of springs, times a factor of the load.
        own, held = np.split(B, 2)
        torque = self.torque_of(frames, wrench)[self.joints]
        weights = own + self.friction.factors(torque)[:, None] * held
        s = np.zeros_like(frames.q)
        s[self.joints] = dot(self._of_springs(frames, wrench), held) * self.friction.slopes(torque)
        return self._spring_slope(frames, wrench, weights) + self.torque_slope_of(frames, wrench, s)

    def _spring_slope(self, frames: Frames, wrench: ArrayLike, B: Array) -> Array:
        """The slopes of the columns of the compliances alone."""
        joints = self.joints
        slope = np.zeros_like(frames.q)
        if self.gives is not None:
            factors, by_joint = self.gives.factors(frames.q)
            along = (self._by_loads(frames, wrench) * B).sum(axis=1)
            slope[joints] = by_joint[joints] * along
            B = B * factors[joints, None]
        # The slopes of folded columns are no longer those of one Jacobian.
        if self.is_plain and frames.ties is None and np.shape(wrench)[-1] == WRENCH:
            return slope + slope_at_tool_point(frames, wrench, joints, B)
        s = np.zeros_like(frames.q)
        s[joints] = dot(self.motion_of(frames)[joints], B)
        weights = np.zeros((self.robot.n, *B.shape[1:]))
        weights[joints] = self.torque_of(frames, wrench)[joints, None] * B
        slope += self.motion_slope_of(frames, weights)
        return slope + self.torque_slope_of(frames, wrench, s)

    def cartesian_stiffness(self, q: ArrayLike, k: ArrayLike) -> Array:
        """Eq. (1): ``K_C = J^-T K_theta J^-1``, as the inverse of ``J k_theta J'``.

        Args:
            q: Joint variables (..., n) [rad or m], of any number of joints.
            k: Compliances (p,) of the unknown joints [rad/(N m)]; the other joints are rigid.

        Returns:
            Stiffness matrices (..., 6, 6) [N/m, N, N m/rad].

        Raises:
            numpy.linalg.LinAlgError: The compliance matrix is singular (fewer than six compliant
                joints, or a singular pose).
        """
        return np.asarray(np.linalg.inv(self.cartesian_compliance(q, k)))

    def cartesian_compliance(self, q: ArrayLike, k: ArrayLike) -> Array:
        """``K_C^-1 = J k_theta J'``, which is defined in every pose.

        Args:
            q: Joint variables (..., n) [rad or m].
            k: Compliances (p,) of the unknown joints [rad/(N m)].

        Returns:
            Compliance matrices (..., 6, 6) [m/N, 1/N, rad/(N m)].
        """
        J = self.robot.jacobian(q)[..., self.joints]
        return (J * np.asarray(k, dtype=float)) @ np.swapaxes(J, -1, -2)

    def deflection(self, q: ArrayLike, wrench: ArrayLike, k: ArrayLike) -> Array:
        """Eq. (2): ``dt = J k_theta J' W``, restricted to the measured rows.

        Args:
            q: Joint variables (..., n) [rad or m].
            wrench: Forces and torques (..., 6) or (6,) [N, N m].
            k: Compliances (p,) [rad/(N m)].

        Returns:
            Deflections (..., rows) [m], rotation rows in [rad].
        """
        W = np.asarray(wrench, dtype=float)
        t = np.einsum("...ij,...j->...i", self.cartesian_compliance(q, k), W)
        return np.asarray(t[..., :3] if self.rows == "position" else t)
