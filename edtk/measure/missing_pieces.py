"""What a model of springs leaves out, by pieces: springs across the joints, friction, other turns.

Errors of a model are not noise. A bearing that tilts, or a link that bends, moves the tool in each
pose by the same compliance; friction holds the same load. So an error of the model hangs together
from pose to pose, and reaches from the poses of a calibration into those of a task by the same
columns by which an identified spring would.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.friction import held
from edtk.robots.frames import Frames
from edtk.robots.robot import Robot
from edtk.system.typing import Array, Indices

SIDES = 2  # axes across that of a joint

Motion = Callable[[Frames], Array]


@dataclass(frozen=True, eq=False)
class MissingPieces:
    """Columns of what the six springs of a model are not, each for a share of one.

    1. *Across*: about both axes across that of joint j there is a spring as soft as the joint's
       own, ``J_e k_j (J_e' w)`` with the motion J_e of what is measured by a turn about that axis.
       Bearings tilt, and links bend, like that.
    2. *Held*: friction of joint j holds the part u_j of its mean load m_j in calibration:
       ``-u_j y_j k_j m_j sign(tau_j)`` with ``y_j = dy/dq_j``; where ``|tau_j|`` is less than a
       tenth of m_j it is in proportion to that, see `Friction`. It always holds back, so that
       ``u_j = v_j s/sqrt(2)`` with v_j of mean and variance one, as of an exponential
       distribution: ``E[u_j^2] = s^2``, and any two are correlated by a half, see `correlated`.
    3. *Turn*: joint j turns by ``k_j tau_j`` once more, ``y_j k_j tau_j``, by another share in
       each pose, as where its stiffness varies with its position.

    The shares of the first two kinds are the same in all poses.

    Attributes:
        k: Compliances (n,) of all joints, zero for rigid ones [rad/(N m)].
        load: Mean sizes (n,) of the joints' loads in calibration [N m or N].
    """

    k: Array
    load: Array

    @classmethod
    def of(cls, robot: Robot, k: Array, torque: Array) -> "MissingPieces":
        """The pieces of a calibration.

        Args:
            robot: The chain.
            k: Compliances (n,) of all joints; one that is not positive counts as rigid.
            torque: Their loads (m, n) in its measurements [N m or N].
        """
        return cls(np.maximum(k, 0.0), np.abs(torque).mean(axis=0))

    def size(self, robot: Robot) -> Array:
        """Compliances (n,) of springs across the joints; beside a rigid one, as the next joint."""
        turns = np.array([joint.kind == "revolute" for joint in robot.joints])
        soft = np.flatnonzero(turns & (self.k > 0))
        if not len(soft):
            return np.zeros(len(self.k))
        nearest = np.abs(np.arange(len(self.k))[:, None] - soft).argmin(axis=1)
        return np.where(turns, self.k[soft[nearest]], 0.0)

    def shared(
        self, model: ElastostaticModel, q: Array, wrench: ArrayLike, motion_of: Motion | None = None
    ) -> Array:
        """Columns (..., rows, 3n) of the pieces that all poses share: across, and held.

        Args:
            model: What is measured, and what loads the joints.
            q: Poses (..., n) [rad or m].
            wrench: Loads (..., 6) or (6,) [N, N m].
            motion_of: Motions (n, rows, ...) of what is measured; those of the model by default.
        """
        motion_of = model.motion_of if motion_of is None else motion_of
        frames = model.robot.frames(q, range(len(model.robot.chain)))
        soft = self.size(model.robot).reshape(-1, *[1] * (frames.q.ndim - 1))
        parts = []
        for side in range(SIDES):
            tilted = _across(model.robot, frames, side)
            turned = soft * model.torque_of(tilted, wrench)
            parts.append(motion_of(tilted) * turned[:, None])
        load = self.load.reshape(soft.shape)
        torque = model.torque_of(frames, wrench)
        turned = self.k.reshape(soft.shape) * torque * held(torque, load)
        parts.append(-np.sqrt(0.5) * motion_of(frames) * turned[:, None])
        return np.moveaxis(np.concatenate(parts), (0, 1), (-1, -2))

    @cached_property
    def kinds(self) -> Indices:
        """Which piece each shared column (3n,) is of: 0 across, 1 held."""
        return np.repeat([0, 1], [SIDES * len(self.k), len(self.k)])

    @property
    def mean(self) -> Array:
        """The mean (3n,) of the shared columns' shares, whose variance is one."""
        return np.asarray(self.kinds == 1, dtype=float)

    def turns(
        self, model: ElastostaticModel, q: Array, wrench: ArrayLike, motion_of: Motion | None = None
    ) -> Array:
        """Columns (..., rows, n) of the piece that is another one in each pose."""
        motion_of = model.motion_of if motion_of is None else motion_of
        frames = model.robot.frames(q, range(len(model.robot.chain)))
        torque = self.k.reshape(-1, *[1] * (frames.q.ndim - 1)) * model.torque_of(frames, wrench)
        return np.moveaxis(motion_of(frames) * torque[:, None], (0, 1), (-1, -2))


def _across(robot: Robot, frames: Frames, side: int) -> Frames:
    """The chain whose revolute joints turn about an axis across their own, one of two.

    The axis is fixed to the body before the joint. Joints that follow others have none.
    """
    axes = np.zeros_like(frames.axes)
    free = range(len(robot.chain)) if frames.ties is None else frames.ties.free
    for j in free:
        joint = robot.chain[j]
        if joint.kind == "revolute":
            local = joint.origin[:3, :3] @ joint.aligned[:, side]
            axes[j] = _in_world(robot, frames, j, local)
    return replace(frames, axes=axes, prismatic=np.zeros_like(frames.prismatic))


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
        turn: Sizes (s,) of the piece that is another one in each pose.
        mean: Shares (c,) of the other pieces and errors (p,) of the springs, true less taken, for
            each (s, c + p).
        covariance: Their covariances (s, c + p, c + p).
    """

    weights: Array
    turn: Array
    mean: Array
    covariance: Array

    def spread(self, p: int) -> Array:
        """Mean squares (p, p) of the errors of the springs."""
        mean, V = self.mean[:, -p:], self.covariance[:, -p:, -p:]
        return np.einsum("s,sij->ij", self.weights, V + mean[:, :, None] * mean[:, None])

    def errors(self, A: Array, turns: Array) -> tuple[Array, Array]:
        """Means (s, ..., r) and covariances (s, ..., r, r) of what is left of a displacement.

        Args:
            A: Columns (..., r, c + p) of the shares and the springs.
            turns: Columns (..., r, n) of the piece that is another one in each pose.
        """
        mean = np.einsum("...ri,si->s...r", A, self.mean)
        own = np.einsum("...rn,...qn->...rq", turns, turns)
        V = np.einsum("...ri,sij,...qj->s...rq", A, self.covariance, A, optimize=True)
        size = self.turn.reshape(-1, *[1] * own.ndim)
        return mean, V + size**2 * own
