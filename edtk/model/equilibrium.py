"""The loaded equilibrium: what the linear model is the first order of."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from edtk.model.frames import cross
from edtk.model.robot import Robot

Array = NDArray[np.float64]
FAR = 0.1  # joint deflection [rad or m] beyond which the load is raised in steps
STEPS = 32  # load steps where one is not enough
ITERATIONS = 30  # Newton steps per load step; a handful is the rule


class NoEquilibriumError(ValueError):
    """A pose has no stable equilibrium under its load: it buckles, or the compliances are far too large.

    Attributes:
        pose: Index of the first such pose, counted over the whole batch in row-major order.
    """

    def __init__(self, pose: int) -> None:
        super().__init__(
            f"pose {pose + 1} has no stable equilibrium under its load: expected a load that the compliant joints "
            "can carry without buckling"
        )
        self.pose = pose


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Where compliant joints come to rest.

    Attributes:
        theta: Deflections (..., n) of the joints [rad or m].
        displacement: Motion (..., 6) of the tool from the unloaded to the loaded pose, in world axes: of the tool point
            [m], and the rotation vector of the tool [rad].
    """

    theta: Array
    displacement: Array


def equilibrium(robot: Robot, q: ArrayLike, wrench: ArrayLike, k: ArrayLike) -> Equilibrium:
    """Solve ``theta = k * tau(q + theta)`` with ``tau = J(q + theta)' W``.

    The motors hold q, each joint is a spring, and W keeps its direction in the world while its point moves with the
    tool (a dead load). Newton's method with the analytic derivative ``I - diag(k) H``, ``H_jl = dtau_j/dq_l``, starts
    from the unloaded pose. A rest of the arm counts only if it is stable, all eigenvalues of that derivative having a
    positive real part; for a pure force H is the Hessian of ``F . p`` and this says that the potential energy has a
    minimum there. Where the deflection is large, or one step fails, the load is raised in equal steps and every step
    must be stable, so that the branch that begins at the unloaded pose is followed, and ends where it buckles.

    Replacing ``tau(q + theta)`` by ``tau(q)`` and the motion of the tool by its first order gives Eq. (2).

    Args:
        robot: The chain; its tool frame is where the wrench acts.
        q: Commanded joint variables (..., n) [rad or m].
        wrench: Forces and torques (..., 6) or (6,) at the tool point in the world frame [N, N m].
        k: Compliances (..., n) or (n,) of all joints, zero for rigid ones [rad/(N m)], or [m/N] if prismatic.

    Raises:
        NoEquilibriumError: Names the first pose that has none.
        ValueError: Shapes do not fit, or a compliance is negative or not finite.
    """
    q, W, k = (
        np.asarray(q, dtype=float),
        np.asarray(wrench, dtype=float),
        np.asarray(k, dtype=float),
    )
    if q.shape[-1:] != (robot.n,) or k.shape[-1:] != (robot.n,) or W.shape[-1:] != (6,):
        raise ValueError(f"expected q (..., {robot.n}), wrench (..., 6) and k (..., {robot.n})")
    if not np.all((k >= 0) & np.isfinite(k)):
        raise ValueError("compliances must be finite and not negative")
    batch = np.broadcast_shapes(q.shape[:-1], W.shape[:-1], k.shape[:-1])
    flat = [np.broadcast_to(x, (*batch, x.shape[-1])).reshape(-1, x.shape[-1]) for x in (q, W, k)]
    theta, found = _follow(robot, 1, *flat)
    hard = np.flatnonzero(~found | (np.abs(theta) > FAR).any(axis=-1))
    if len(hard):
        theta[hard], found[hard] = _follow(robot, STEPS, *(x[hard] for x in flat))
    if not found.all():
        raise NoEquilibriumError(int(np.argmin(found)))
    before, after = robot.forward(flat[0]), robot.forward(flat[0] + theta)
    turn = after[:, :3, :3] @ np.swapaxes(before[:, :3, :3], -1, -2)
    rotation = Rotation.from_matrix(turn).as_rotvec() if len(turn) else np.zeros((0, 3))
    displacement = np.concatenate([after[:, :3, 3] - before[:, :3, 3], rotation], axis=-1)
    return Equilibrium(theta.reshape(*batch, robot.n), displacement.reshape(*batch, 6))


def torque_and_derivative(robot: Robot, q: Array, wrench: Array) -> tuple[Array, Array]:
    """Joint loads ``tau = J'W`` (N, n) and their derivatives ``H_jl = dtau_j/dq_l`` (N, n, n), W being constant.

    As in `ElastostaticModel.regressor_slope`: ``dJ_j/dq_l = (w_l x v_j, w_l x w_j)`` for l <= j and
    ``(w_j x v_l, 0)`` for l > j, with the linear and angular columns v and w of the Jacobian.
    """
    frames = robot.frames(q)
    v, w = frames.linear, frames.angular
    F, T = wrench[:, :3].T, wrench[:, 3:].T
    tau = np.einsum("jcN,cN->Nj", v, F) + np.einsum("jcN,cN->Nj", w, T)
    j, m = (index.ravel() for index in np.indices((robot.n, robot.n)))
    H = np.einsum("icN,cN->Ni", cross(w[np.minimum(j, m)], v[np.maximum(j, m)]), F)
    H += np.where(m <= j, np.einsum("icN,cN->Ni", cross(w[m], w[j]), T), 0.0)
    return tau, H.reshape(-1, robot.n, robot.n)


def _follow(
    robot: Robot, steps: int, q: Array, W: Array, k: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Deflections (N, n) under the whole load, raised in equal steps, and whether each pose got there stably (N,)."""
    theta, good = np.zeros_like(q), np.ones(len(q), dtype=bool)
    for part in np.linspace(0, 1, steps + 1)[1:]:
        at = np.flatnonzero(good)
        theta[at], good[at] = _newton(robot, q[at], part * W[at], k[at], theta[at])
    return theta, good


def _newton(
    robot: Robot, q: Array, W: Array, k: Array, theta: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Deflections (N, n) from a start, and whether each is a converged, stable equilibrium (N,)."""
    theta, eye = theta.copy(), np.eye(robot.n)
    good = np.zeros(len(q), dtype=bool)
    moving = np.arange(len(q))
    for _ in range(ITERATIONS):
        if not len(moving):
            break
        tau, H = torque_and_derivative(robot, q[moving] + theta[moving], W[moving])
        slope = eye - k[moving, :, None] * H
        regular = np.abs(np.linalg.det(slope)) > np.finfo(float).eps
        moving, tau, slope = moving[regular], tau[regular], slope[regular]
        step = np.linalg.solve(slope, (k[moving] * tau - theta[moving])[..., None])[..., 0]
        # A step of more than half a radian leaves the range in which the derivative says anything.
        step *= np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=-1, initial=0.0), 1e-300))[
            :, None
        ]
        theta[moving] += step
        still = np.abs(step) <= 1e-12 * np.abs(theta[moving]).max(
            axis=-1, initial=0.0, keepdims=True
        )
        done = still.all(axis=-1)
        good[moving[done]] = np.linalg.eigvals(slope[done]).real.min(axis=-1, initial=np.inf) > 0
        moving = moving[~done]
    return theta, good
