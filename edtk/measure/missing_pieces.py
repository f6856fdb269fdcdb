"""What a model of springs leaves out, by pieces: springs across the joints, friction, other turns.

Errors of a model are not noise. A bearing that tilts, or a link that bends, moves the tool in each
pose by the same compliance; friction holds the same load. So an error of the model hangs together
from pose to pose, and reaches from the poses of a calibration into those of a task by the same
columns by which an identified spring would.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.friction import SPREAD_OF_SHARES, held_by, scatter
from edtk.robots.frames import Frames
from edtk.robots.robot import Robot
from edtk.system.typing import Array, Indices

# Standard deviation of shares of springs across, over their mean. Of a positive number whose usual
# size alone is known, the exponential distribution assumes least (Jaynes), and has this one.
SPREAD_ACROSS = 1.0
SIDES = 2  # axes across that of a joint
AXES = 3  # about which a link gives way in its middle
SHORT = 0.01  # of the robot's reach: links that are shorter have their springs at their ends alone

Motion = Callable[[Frames], Array]


@dataclass(frozen=True, eq=False)
class MissingPieces:
    """Columns of what the six springs of a model are not, each for a share of one.

    1. *Across*: about both axes across that of joint j there is a spring as soft as the joint's
       own, ``J_e k_j (J_e' w)`` with the motion J_e of what is measured by a turn about that axis.
       Bearings tilt like that. A link that bends and twists does the same with springs about all
       axes at both of its ends and in its middle: its energy is the integral of squared moments,
       which are linear along it, and so Simpson's rule is exact. So there are springs about three
       axes in the middle of each link, too, as soft as the joint before it; those at its ends are
       across the joints, and their own.
    2. *Held*: friction of joint j holds the part u_j of its mean load m_j in calibration:
       ``-u_j y_j k_j m_j sign(tau_j)`` with ``y_j = dy/dq_j``, and of a load that is smaller than
       the usual share of m_j the whole, see `held_by`. It always holds back, and gears of a robot
       lose alike.
    3. *Turn*: joint j turns by ``k_j tau_j`` once more, ``y_j k_j tau_j``, by another share in
       each pose, as where its stiffness varies with its position.

    The shares ``s v`` of the first two kinds are the same in all poses, with ``E[v^2] = 1``. None
    is negative, so that their mean is not zero, see `correlated`: what springs across do adds up
    along the load, and does not cancel.

    Attributes:
        k: Compliances (n,) of all joints, zero for rigid ones [rad/(N m)].
        load: Mean sizes (n,) of the joints' loads in calibration [N m or N].
        links: Indices (l,) of the joints before which a link gives way.
    """

    k: Array
    load: Array
    links: tuple[int, ...] = ()

    @classmethod
    def of(cls, robot: Robot, k: Array, torque: Array) -> "MissingPieces":
        """The pieces of a calibration.

        Args:
            robot: The chain.
            k: Compliances (n,) of all joints; one that is not positive counts as rigid.
            torque: Their loads (m, n) in its measurements [N m or N].
        """
        free = range(len(robot.chain)) if robot.ties is None else robot.ties.free
        lengths = [np.linalg.norm(robot.chain[i].origin[:3, 3]) for i in free]
        long = [j for j, length in enumerate(lengths) if j and length > SHORT * robot.reach]
        return cls(np.maximum(k, 0.0), np.abs(torque).mean(axis=0), tuple(long))

    def size(self, robot: Robot) -> Array:
        """Compliances (n,) of springs across the joints; beside a rigid one, as the next joint."""
        turns = ~robot.slides
        soft = np.flatnonzero(turns & (self.k > 0))
        if not len(soft):
            return np.zeros(len(self.k))
        nearest = np.abs(np.arange(len(self.k))[:, None] - soft).argmin(axis=1)
        return np.where(turns, self.k[soft[nearest]], 0.0)

    def columns(
        self, model: ElastostaticModel, q: Array, wrench: ArrayLike, motion_of: Motion | None = None
    ) -> "PieceColumns":
        """What the pieces do in poses.

        Args:
            model: What is measured, and what loads the joints.
            q: Poses (..., n) [rad or m].
            wrench: Loads (..., 6) or (6,) [N, N m].
            motion_of: Motions (n, rows, ...) of what is measured; those of the model by default.
        """
        motion_of = model.motion_of if motion_of is None else motion_of
        frames = model.robot.frames(q, range(len(model.robot.chain)))
        lift = (-1, *[1] * (frames.q.ndim - 1))
        soft, links = self.size(model.robot), np.array(self.links, dtype=int)
        ends = (frames, np.arange(len(soft)), soft, SIDES)
        middles = (_in_middles(frames), links, soft[links - 1], AXES)
        parts = []
        for at, joints, size, axes in (ends, middles):
            for axis in range(axes):
                tilted = _about(model.robot, at, axis)
                turned = size.reshape(lift) * model.torque_of(tilted, wrench)[joints]
                parts.append(motion_of(tilted)[joints] * turned[:, None])
        torque = model.torque_of(frames, wrench)
        turned = self.k.reshape(lift) * torque
        across, turns = (
            np.moveaxis(one, (0, 1), (-1, -2))
            for one in (np.concatenate(parts), motion_of(frames) * turned[:, None])
        )
        return PieceColumns(across, turns, np.moveaxis(torque, 0, -1), self.load)

    @property
    def count(self) -> int:
        """Number of shares that all poses have: across, and held."""
        return (SIDES + 1) * len(self.k) + AXES * len(self.links)


@dataclass(frozen=True, eq=False)
class PieceColumns:
    """What pieces do in some poses, for shares of one.

    Attributes:
        across: Columns (..., rows, a) of springs across the joints, and in the middles of links.
        turns: Columns (..., rows, n) of springs that turn once more, by another share in each pose.
        torque: Loads (..., n) of the joints [N m or N].
        load: Their mean sizes (n,) in calibration [N m or N].
    """

    across: Array
    turns: Array
    torque: Array
    load: Array

    def __getitem__(self, rows: Indices) -> "PieceColumns":
        """Those of some poses."""
        return PieceColumns(self.across[rows], self.turns[rows], self.torque[rows], self.load)

    def held(self, size: float) -> Array:
        """Columns (..., rows, n) of what friction holds, of shares of some size.

        They are for ``z_j + 1/r``, of variance one, where ``v_j = (1 + r z_j) / sqrt(1 + r^2)``.
        """
        part = scatter(SPREAD_OF_SHARES) * held_by(size, self.torque, self.load)
        return np.asarray(-self.turns * part[..., None, :])

    def shared(self, size: float) -> Array:
        """Columns (..., rows, a + n) of the pieces that all poses share: across, and held."""
        return np.concatenate([self.across, self.held(size)], axis=-1)

    @property
    def kinds(self) -> Indices:
        """Which piece each shared column (a + n,) is of: 0 across, 1 held."""
        return np.repeat([0, 1], [self.across.shape[-1], self.turns.shape[-1]])

    @property
    def joints(self) -> Indices:
        """The joint (a,) that each spring is across, or n for the middle of a link."""
        n = self.turns.shape[-1]
        number = np.arange(self.across.shape[-1])
        return np.where(number < SIDES * n, number % n, n)

    @property
    def mean(self) -> Array:
        """The mean (a + n,) of the shared columns' shares over their standard deviation."""
        return 1 / np.where(self.kinds == 1, SPREAD_OF_SHARES, SPREAD_ACROSS)

    def mapped(self, change: Callable[[Array], Array]) -> "PieceColumns":
        """The same in other rows."""
        return replace(self, across=change(self.across), turns=change(self.turns))

    def by_row(self) -> "PieceColumns":
        """Those of poses (m,), each row by itself (m rows, 1)."""
        rows = self.turns.shape[-2]
        alone = self.mapped(lambda one: one.reshape(-1, 1, one.shape[-1]))
        return replace(alone, torque=np.repeat(self.torque, rows, axis=0))


def _about(robot: Robot, frames: Frames, axis: int) -> Frames:
    """The chain whose revolute joints turn about one of two axes across their own, or that itself.

    The axis is fixed to the body before the joint. Joints that follow others have none.
    """
    axes = np.zeros_like(frames.axes)
    free = range(len(robot.chain)) if frames.ties is None else frames.ties.free
    for j in free:
        joint = robot.chain[j]
        if joint.kind == "revolute":
            local = joint.origin[:3, :3] @ joint.aligned[:, axis]
            axes[j] = _in_world(robot, frames, j, local)
    return replace(frames, axes=axes, prismatic=np.zeros_like(frames.prismatic))


def _in_middles(frames: Frames) -> Frames:
    """The chain whose joints, but for the first, are in the middles of the links before them."""
    origins = frames.origins.copy()
    origins[1:] = (frames.origins[:-1] + frames.origins[1:]) / 2
    return replace(frames, origins=origins)


def _in_world(robot: Robot, frames: Frames, joint: int, local: Array) -> Array:
    """A direction (3, ...) that is fixed to the body before a joint."""
    if joint == 0:
        lift = (slice(None),) + (None,) * (frames.position.ndim - 1)
        return (robot.base[:3, :3] @ local)[lift] + np.zeros_like(frames.position)
    rotation, _ = frames.bodies[joint - 1]
    return np.einsum("k,kc...->c...", local, rotation)


@dataclass(frozen=True, eq=False)
class PossibleSprings:
    """Sizes of what is missing that a sheet leaves possible, with springs and shares for each.

    Attributes:
        weights: Probabilities (s,).
        held: Sizes (s,) of the shares that friction holds.
        turn: Sizes (s,) of the piece that is another one in each pose.
        mean: Shares (c,) of the other pieces and errors (p,) of the springs, true less taken, for
            each (s, c + p).
        covariance: Their covariances (s, c + p, c + p).
    """

    weights: Array
    held: Array
    turn: Array
    mean: Array
    covariance: Array

    def spread(self, p: int) -> Array:
        """Mean squares (p, p) of the errors of the springs."""
        mean, V = self.mean[:, -p:], self.covariance[:, -p:, -p:]
        return np.einsum("s,sij->ij", self.weights, V + mean[:, :, None] * mean[:, None])

    def errors(self, columns: PieceColumns, A: Array) -> tuple[Array, Array]:
        """Means (s, ..., r) and covariances (s, ..., r, r) of what is left of a displacement.

        Args:
            columns: What pieces do there.
            A: Columns (..., r, p) of the springs.
        """
        own = np.einsum("...rn,...qn->...rq", columns.turns, columns.turns)
        mean = np.empty((len(self.weights), *A.shape[:-1]))
        V = np.square(self.turn).reshape(-1, *[1] * own.ndim) * own
        for size in np.unique(self.held):
            some = self.held == size
            X = np.concatenate([columns.shared(size), A], axis=-1)
            mean[some] = np.einsum("...ri,si->s...r", X, self.mean[some])
            moved = np.einsum("...ri,sij->s...rj", X, self.covariance[some])
            V[some] += np.einsum("s...rj,...qj->s...rq", moved, X)
        return mean, V
