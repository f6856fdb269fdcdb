"""The loaded equilibrium: where springs and the loads of joints come to rest, whatever they are.

Motors hold the joints at q, springs turn them further by ``u = b(tau)``, and the loads tau follow:
``u = b(tau(q + u))``. With ``K = db/dtau`` and ``H = dtau/dq`` a rest is stable where all
eigenvalues of ``I - K H`` have positive real parts. Coordinates are the joints that motors turn,
then the elastic ones. The linear model is the first order of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from criteria.linalg.inverse import TINY
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.measured_model import Load, LoadsOfReadings, Torque
from edtk.measure.springs import Bending
from edtk.robots.elastic_robot import widened
from edtk.robots.frames import WRENCH, Frames
from edtk.robots.inverse import LONGEST
from edtk.robots.robot import Robot
from edtk.robots.weights import Loading, torque_derivative
from edtk.system.typing import Array, Indices, Mask

# Joint deflection [rad or m] beyond which springs become soft in steps: Newton's method could then
# have jumped to another branch of equilibria.
FAR = 0.1
STEPS = 32
ITERATIONS = 30  # Newton steps; a handful is the rule
NEAR = 1e-5  # Newton step [rad or m] after which the derivative is good for the others
CONVERGED = 1e-12  # Newton step, relative to the deflection, that is rounding
# Of a joint's angle: with a compensator as stiff as its joint, a step is no smaller.
ROUNDING = 4 * np.finfo(float).eps


class Loads(Protocol):
    """What loads the joints."""

    def __call__(self, q: Array, wrench: Array) -> Array:
        """Loads (m, s) [N m or N] in poses q (m, s, or less) under wrenches (m, 6 or 9)."""

    def with_derivative(self, q: Array, wrench: Array) -> tuple[Array, Array]:
        """Loads (m, s), and their derivatives ``H_jl = dtau_j/dq_l`` (m, s, s)."""


class Compliant(Protocol):
    """Springs: what loads turn the joints by."""

    @property
    def play(self) -> float:
        """How far a joint may rest anywhere [rad]."""

    def turn(self, torque: Array) -> Array:
        """Turns b (m, s) under loads (m, s) [rad or m]."""

    def turned_by(self, torque: Array, change: Array) -> Array:
        """``K C`` (m, s, c): how turns under loads (m, s) follow changes C (m, s, c) of these."""

    def scaled(self, factor: float) -> Self:
        """Springs that are softer by a factor."""

    def __getitem__(self, chosen: Indices) -> Self:
        """The springs in some of the poses."""


@dataclass(frozen=True, eq=False)
class Settled:
    """Where Newton's method has ended.

    Attributes:
        turn: Turns u (m, s) of the joints [rad or m].
        torque: Their loads (m, s) [N m or N].
        slope: ``I - K H`` (m, s, s).
        rests: Whether springs and loads agree (m,).
    """

    turn: Array
    torque: Array
    slope: Array
    rests: Mask

    @property
    def far(self) -> Indices:
        """Poses that may have gone over to another equilibrium, or to none."""
        return np.flatnonzero(~self.rests | (np.abs(self.turn) > FAR).any(axis=-1))

    @property
    def stable(self) -> Mask:
        """Which poses (m,) come back when they are pushed."""
        return self.rests & _stable(self.slope)

    def with_others(self, poses: Indices, others: "Settled") -> "Settled":
        """The same with some poses that have ended elsewhere."""
        mine = {one.name: getattr(self, one.name).copy() for one in fields(self)}
        for name, array in mine.items():
            array[poses] = getattr(others, name)
        return Settled(**mine)


def settle(springs: Compliant, loads: Loads, q: Array, wrench: Array, turn: Array) -> Settled:
    """Bring joints to rest from turns near it, each pose until it has converged.

    Args:
        springs: What loads turn the joints by.
        loads: What loads them.
        q: Commanded poses (m, s) [rad or m].
        wrench: Forces and torques (m, 6 or 9) [N, N m].
        turn: Where to start (m, s).
    """
    turn = turn.copy()
    m, s = turn.shape
    torque = np.zeros((m, s))
    slope = np.zeros((m, s, s))
    rests = np.zeros(m, dtype=bool)
    moving = np.arange(m)
    longest = np.inf
    for _ in range(ITERATIONS):
        if not len(moving):
            break
        every = len(moving) == m
        at: Indices | slice = slice(None) if every else moving
        own = springs if every else springs[moving]
        near = q[at] + turn[at]
        if longest > NEAR:
            tau, H = loads.with_derivative(near, wrench[at])
            slope[at] = np.eye(s) - own.turned_by(tau, H)
        else:
            tau = loads(near, wrench[at])
        torque[at] = tau
        apart = own.turn(tau) - turn[at]
        # At a buckling point the derivative is singular: such a pose is given up.
        regular = np.abs(np.linalg.det(slope[at])) > np.finfo(float).eps
        step = np.zeros_like(apart)
        step[regular] = np.linalg.solve(slope[at][regular], apart[regular, :, None])[..., 0]
        lengths = np.abs(step).max(axis=-1, initial=0.0, keepdims=True)
        step *= np.minimum(1.0, LONGEST / np.maximum(lengths, TINY))
        turn[at] += step
        size = np.abs(turn[at]).max(axis=-1, initial=0.0, keepdims=True)
        digits = ROUNDING * np.abs(near).max(axis=-1, initial=0.0, keepdims=True)
        done = (np.abs(step) <= CONVERGED * size + digits).all(axis=-1)
        rests[at] = regular & (done | _in_play(springs.play, apart, slope[at]))
        moving = moving[regular & ~done]
        longest = float(lengths.max(initial=0.0))
    return Settled(turn, torque, slope, rests)


def _in_play(play: float, apart: Array, slope: Array) -> Mask:
    """Whether springs and loads (m,) differ by no more than from one end of a dead zone to another.

    On the way, the springs behind it turn by ``K H`` of that.
    """
    if not play:
        return np.zeros(len(apart), dtype=bool)
    KH = np.eye(slope.shape[-1]) - slope
    widest = play * (1 + np.abs(KH).sum(axis=-1).max(axis=-1, keepdims=True))
    return np.asarray((np.abs(apart) <= widest).all(axis=-1))


def stable_rest(springs: Compliant, loads: Loads, q: Array, wrench: Array) -> tuple[Settled, Mask]:
    """Follow the rest of the arm from the unloaded pose on, while it is stable.

    Where joints turn far, springs become soft in equal steps that all have to be stable: so the
    branch that begins at the unloaded pose is followed, and ends where the arm snaps or buckles.

    Returns:
        Where the joints rest, and whether each pose got there (m,).
    """
    found = settle(springs, loads, q, wrench, np.zeros_like(q))
    good = found.stable
    far = found.far
    if len(far):
        followed, good[far] = _softened(springs[far], loads, q[far], wrench[far])
        found = found.with_others(far, followed)
    return found, good


def _softened(springs: Compliant, loads: Loads, q: Array, wrench: Array) -> tuple[Settled, Mask]:
    """The same in steps."""
    found = settle(springs.scaled(0.0), loads, q, wrench, np.zeros_like(q))
    good = np.ones(len(q), dtype=bool)
    for part in np.linspace(0, 1, STEPS + 1)[1:]:
        at = np.flatnonzero(good)
        softer = springs.scaled(float(part))[at]
        further = settle(softer, loads, q[at], wrench[at], found.turn[at])
        found = found.with_others(at, further)
        good[at] = further.stable
    return found, good


def _stable(slope: Array) -> Mask:
    """Whether all eigenvalues of each matrix (N, n, n) have a positive real part (N,)."""
    off = np.abs(slope - np.eye(slope.shape[-1])).sum(axis=-1).max(axis=-1, initial=0.0)
    # By Gershgorin's theorem a matrix within a row sum of one of the identity has; eigenvalues of
    # many matrices take longer than all the rest.
    good = off < 1
    hard = np.flatnonzero(~good)
    good[hard] = np.linalg.eigvals(slope[hard]).real.min(axis=-1, initial=np.inf) > 0
    return good


@dataclass(frozen=True, eq=False)
class _Changed:
    """Loads with compensators whose numbers differ from what is stated."""

    loads: Loads
    bending: Bending

    def __call__(self, q: Array, wrench: Array) -> Array:
        return self.loads(q, wrench) + self.bending.added(q)

    def with_derivative(self, q: Array, wrench: Array) -> tuple[Array, Array]:
        torque, H = self.loads.with_derivative(q, wrench)
        return torque + self.bending.added(q), H + self.bending.added_derivative(q)


def resting_load(
    bending: Bending, q: Array, wrench: Array, loads: Loads | None, derivatives: bool = True
) -> Load | None:
    """What loads the joints at rest.

    Args:
        bending: What loads turn the joints by.
        q: Joint variables (m, n) [rad or m].
        wrench: Forces and torques (m, 6).
        loads: What they load the joints with; None where nothing does.
        derivatives: Whether to say what the joints give way more, or less, as their loads change
            with them.
    """
    if loads is None:
        return None
    changed = _Changed(loads, bending)
    start = widened(q, bending.width)
    torque = changed(start, wrench)
    if bending.is_rigid:
        return Load(torque)
    found = settle(bending, changed, start, wrench, bending.turn(torque))
    far = found.far
    if len(far):
        followed, _ = stable_rest(bending, changed, start[far], wrench[far])
        found = found.with_others(far, followed)
    if not derivatives:
        return Load(found.torque)
    return Load(
        found.torque,
        np.asarray(np.linalg.inv(found.slope), dtype=float),
        bending.tangent(found.torque),
        start + found.turn,
        bending.changes,
    )


def loading_in(
    bending: Bending,
    q: Array,
    wrench: Array,
    loads: Loads | None,
    differs: Mask,
    derivatives: bool = True,
) -> Torque:
    """What loads the joints at rest in each visit, see `resting_load`, and what did before.

    Args:
        bending: What loads turn the joints by.
        q: Joint variables (m, n) [rad or m].
        wrench: Forces and torques (m, 6).
        loads: What they load the joints with.
        differs: Which readings (m,) are differences of a loaded and an unloaded one.
        derivatives: Whether derivatives by the springs are wanted.
    """
    after = resting_load(bending, q, wrench, loads, derivatives)
    if after is None or not differs.any():
        return after
    unloaded = np.zeros((int(differs.sum()), 6))
    before = resting_load(bending, q[differs], unloaded, loads, derivatives)
    assert before is not None
    return LoadsOfReadings(after, differs, before)


def no_rest(bending: Bending, q: Array, wrench: Array, loads: Loads | None) -> Mask:
    """Poses (m,) without a stable equilibrium: the arm would snap, or the load buckles it."""
    if loads is None or bending.is_rigid:
        return np.zeros(len(q), dtype=bool)
    return ~stable_rest(bending, _Changed(loads, bending), widened(q, bending.width), wrench)[1]


@dataclass(frozen=True, eq=False)
class Rest:
    """Joints between which a displacement is measured.

    Attributes:
        start: Joint variables (..., n) where a displacement begins: the commanded ones, or those
            of a robot that bends under its own weights [rad or m].
        end: Joint variables (..., n) under the load, at rest [rad or m].
    """

    start: Array
    end: Array

    @classmethod
    def of(
        cls,
        model: ElastostaticModel,
        q: ArrayLike,
        wrench: ArrayLike,
        k: ArrayLike,
        signed: bool = False,
    ) -> "Rest":
        """Bring a robot to rest.

        Args:
            model: The robot, its load point and weights.
            q: Commanded joint variables (..., n) [rad or m].
            wrench: Forces and torques (..., 6) or (6,) at the load point [N, N m].
            k: Compliances (..., n) or (n,) of all joints [rad/(N m)].
            signed: Allow negative compliances, see `equilibrium`.

        Raises:
            NoEquilibriumError: A pose buckles.
        """
        q = np.asarray(q, dtype=float)
        end = q + equilibrium(model.robot, q, wrench, k, signed, model.loading)
        return cls(np.broadcast_to(unloaded(model, q, k, signed), end.shape), end)


def unloaded(model: ElastostaticModel, q: Array, k: ArrayLike, signed: bool = False) -> Array:
    """Joint variables (..., n) of a robot that bends under its own weights alone [rad or m].

    Raises:
        NoEquilibriumError: A pose buckles.
    """
    if model.own_weights is None:
        return q
    own = Loading(weights=model.own_weights)
    return np.asarray(q + equilibrium(model.robot, q, np.zeros(6), k, signed, own))


AT_TOOL_POINT = Loading()


class NoEquilibriumError(ValueError):
    """A pose has no stable equilibrium under its load.

    It buckles, or the compliances are far too large.

    Args:
        poses: Indices of all such poses, counted over the whole batch in row-major order.

    Attributes:
        poses: As given.
    """

    def __init__(self, poses: Sequence[int]) -> None:
        super().__init__(
            f"pose {poses[0] + 1} has no stable equilibrium under its load: expected a load that "
            "the compliant joints can carry without buckling"
        )
        self.poses = tuple(poses)

    @property
    def pose(self) -> int:
        """The first of them."""
        return self.poses[0]

    def __reduce__(self) -> tuple[type["NoEquilibriumError"], tuple[tuple[int, ...]]]:
        """Pickle by the poses, so that the error can come back from another process."""
        return type(self), (self.poses,)


def why_no_rest(robot: Robot, q: Array, k: Array) -> str:
    """Why an arm has no stable equilibrium about a pose, in words.

    Args:
        robot: The chain, which may have compensators.
        q: The pose (n,) [rad or m].
        k: Compliances (n,) of all joints [rad/(N m)].
    """
    for pull in robot.pulls:
        j = robot.joint_names.index(pull.given.joint)
        taken = float(pull.derivative(q[j]))
        if k[j] * taken >= 1:
            return (
                f"the arm would snap, as the compensator takes {taken:.3g} N m/rad from joint "
                f"{pull.given.joint}, whose spring has {1 / k[j]:.3g}; expected a pose elsewhere"
            )
    return "the load buckles the arm; expected a load that it can carry"


def equilibrium(
    robot: Robot,
    q: ArrayLike,
    wrench: ArrayLike,
    k: ArrayLike,
    signed: bool = False,
    loading: Loading = AT_TOOL_POINT,
) -> Array:
    """Solve ``theta = k * tau(q + theta)`` with ``tau = J(q + theta)' W``.

    The motors hold q, each joint is a spring, and W keeps its direction in the world while its
    point moves with the tool (a dead load). Newton's method with the analytic derivative
    ``I - diag(k) H``, ``H_jl = dtau_j/dq_l``, starts from the unloaded pose, see `stable_rest`. For
    a pure force H is the Hessian of ``F . p``, and the potential energy of a stable rest is least.

    Replacing ``tau(q + theta)`` by ``tau(q)`` and the motion of the tool by its first order gives
    Eq. (2).

    Args:
        robot: The chain; its tool frame is where the wrench acts, unless `loading` says otherwise.
        q: Commanded joint variables (..., n) [rad or m].
        wrench: Forces and torques (..., 6) or (6,) at the tool point in the world frame [N, N m].
        k: Compliances (..., n) or (n,) of all joints, zero for rigid ones [rad/(N m)], or [m/N] if
            prismatic.
        signed: Allow negative compliances. No joint has one, but an estimate of a small compliance
            may, and the equation has a solution there too.
        loading: Where the wrench acts, and weights that load the joints besides it.

    Returns:
        Deflections theta (..., n) of the joints [rad or m].

    Raises:
        NoEquilibriumError: Names the first pose that has none.
        ValueError: Shapes do not fit, or a compliance is negative or not finite.
    """
    batch, flat = _checked(robot, q, wrench, k, signed)
    q, W, k = flat
    rest, found = stable_rest(_JointSprings(k), _DeadLoads(robot, loading), q, W)
    if not found.all():
        raise NoEquilibriumError(np.flatnonzero(~found).tolist())
    return rest.turn.reshape(*batch, robot.n)


@dataclass(frozen=True, eq=False)
class _JointSprings:
    """Springs about the joints' own axes, with compliances (N, n) of their own in each pose."""

    k: Array
    play = 0.0

    def turn(self, torque: Array) -> Array:
        return self.k * torque

    def turned_by(self, torque: Array, change: Array) -> Array:
        return self.k[:, :, None] * change

    def scaled(self, factor: float) -> "_JointSprings":
        return _JointSprings(factor * self.k)

    def __getitem__(self, chosen: Indices) -> "_JointSprings":
        return _JointSprings(self.k[chosen])


@dataclass(frozen=True, eq=False)
class _DeadLoads:
    """Loads of the joints by a wrench and weights, which keep their directions."""

    robot: Robot
    loading: Loading

    def __call__(self, q: Array, wrench: Array) -> Array:
        return self._torque(self.robot.frames(q, self.loading.bodies), wrench)

    def with_derivative(self, q: Array, wrench: Array) -> tuple[Array, Array]:
        frames = self.robot.frames(q, self.loading.bodies)
        own = self.loading
        return self._torque(frames, wrench), torque_derivative(
            frames, own.point, wrench, *own.counted
        )

    def _torque(self, frames: Frames, wrench: Array) -> Array:
        """Loads (N, n) of the free joints."""
        point = self.loading.point.of_load(wrench)
        tau = np.einsum("jcN,cN->jN", point.linear(frames), wrench[:, :3].T)
        tau += np.einsum("jcN,cN->jN", point.angular(frames), wrench[:, 3:WRENCH].T)
        for weights, share in self.loading.counted:
            tau = tau + weights.torque(frames) * share
        return frames.folded(tau).T


def torque_and_derivative(
    robot: Robot, q: Array, wrench: Array, loading: Loading = AT_TOOL_POINT
) -> tuple[Array, Array]:
    """Joint loads and their derivatives under a constant wrench.

    Args:
        robot: The chain; its tool frame is where the wrench acts, unless `loading` says otherwise.
        q: Joint variables (N, n) [rad or m].
        wrench: Forces and torques (N, 6) [N, N m].
        loading: Where the wrench acts, and weights that load the joints besides it.

    Returns:
        ``tau = J'W`` (N, n) [N m, or N if prismatic], and ``H_jl = dtau_j/dq_l`` (N, n, n).
    """
    return _DeadLoads(robot, loading).with_derivative(q, wrench)


def _checked(
    robot: Robot, q: ArrayLike, wrench: ArrayLike, k: ArrayLike, signed: bool
) -> tuple[tuple[int, ...], list[Array]]:
    """The shape of the batch, and q (N, n), wrench (N, 6) and k (N, n) of all its N poses."""
    q = np.asarray(q, dtype=float)
    W = np.asarray(wrench, dtype=float)
    k = np.asarray(k, dtype=float)
    if q.shape[-1:] != (robot.n,) or k.shape[-1:] != (robot.n,) or W.shape[-1] not in (6, 9):
        raise ValueError(f"expected q (..., {robot.n}), wrench (..., 6) and k (..., {robot.n})")
    if not np.all(((k >= 0) | signed) & np.isfinite(k)):
        raise ValueError("compliances must be finite and not negative")
    batch = np.broadcast_shapes(q.shape[:-1], W.shape[:-1], k.shape[:-1])
    flat = [np.broadcast_to(x, (*batch, x.shape[-1])).reshape(-1, x.shape[-1]) for x in (q, W, k)]
    return batch, flat


def compensated_joints(
    model: ElastostaticModel, q0: ArrayLike, wrench: ArrayLike, k: ArrayLike
) -> Array:
    """Find the command whose loaded tool pose is that of q0: ``q = q0 - k * tau(q0)``.

    ``tau(q0) = J(q0)' W`` are the joint torques. The command is exact, and no linearisation. A
    commanded q comes to rest at ``q + theta`` with ``theta = k * tau(q + theta)``
    (above). Asking that the loaded joints be q0, ``q + theta = q0``, turns this
    equation into ``theta = k * tau(q0)``, which has its unknown on one side only. As only joints
    deform, loaded joints q0 carry the tool to ``g(q0)``, position and orientation. A robot with six
    joints in a regular pose has no other command nearby that does so; with more joints, or in a
    singular pose, this command keeps the desired joints too.

    Eq. (15), ``q = q0 - J0^-1 K_C^-1 W``, is the same command under the assumption of Eq. (1), that
    all compliance is in the joints: ``K_C^-1 = J0 k J0'`` cancels the inverse. Its linear solution
    of Eq. (14) is thus exact for springs that are loaded in the *desired* pose. Eq. (14) solved to
    the end, and Eq. (15) for the position alone with a pseudo-inverse, are off by the second order
    of the load. Eq. (15) also needs K_C and J0 in q0, not in the command.

    Own weights that bend the robot without the load, too, are no error: the goal is where the
    unloaded robot comes to rest, and they turn its joints as far there as under the load.

    Args:
        model: The robot with its task tool.
        q0: Desired joint variables (..., n) [rad or m].
        wrench: Task wrench (..., 6) or (6,) in the desired pose [N, N m].
        k: Compliances (..., p) or (p,) of the model's unknown joints [rad/(N m)]; the others are
            rigid.

    Returns:
        Joint variables (..., n) to command [rad or m].
    """
    q0 = np.asarray(q0, dtype=float)
    W = np.asarray(wrench, dtype=float)
    k = np.asarray(k, dtype=float)
    complete = np.zeros((*k.shape[:-1], model.robot.n))
    complete[..., model.joints] = k
    rest = unloaded(model, q0, complete, signed=True)
    torque = model.torque_of(model.frames(rest), W)[model.joints]
    turn = k * np.moveaxis(torque, 0, -1)
    q = np.array(np.broadcast_to(q0, (*turn.shape[:-1], model.robot.n)))
    q[..., model.joints] -= turn
    return q
