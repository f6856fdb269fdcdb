"""Where markers shall be, and the commands of a fitted robot that bring them there."""

from dataclasses import dataclass, replace

import numpy as np

from edtk.inference.geometry.fitted_geometry import FittedGeometry, Loads
from edtk.model.geometry.geometric_model import Seen
from edtk.model.geometry.geometric_parameter import TURNS, GeometricParameter
from edtk.model.geometry.rotation import rotation_vectors
from edtk.system.typing import Array, Indices

STEPS = 30  # of Newton's method; four are the rule
SETTLED = 1e-9  # [m, rad] a step that moves no marker by more ends the search
REACHED = 1e-6  # [m, rad] a last step that moves one by more leads nowhere: a stretched arm's do
SINGULAR = 1e-4  # of the largest singular value: smaller ones of a Jacobian are not used
FAR = 0.2  # [rad or m] a correction is never so large


@dataclass(frozen=True, eq=False)
class MarkerGoal:
    """Where the robot of the drawing carries the markers in some poses.

    It stands where it fitted the measurements best, with the markers where they fitted best, and no
    load bends it.

    Attributes:
        points: Positions (t, k, 3) [m].
        turns: Orientations (t, k, 3, 3); None where positions alone are asked for.
    """

    points: Array
    turns: Array | None

    @classmethod
    def of(cls, fitted: FittedGeometry, q: Array) -> "MarkerGoal":
        """In poses q (t, n) of the drawing."""
        drawing = replace(fitted.model, offsets=fitted.placed, parameters=())
        if fitted.placed_turns is None:
            return cls(drawing.see(np.zeros(0), q, derivatives=False).points, None)
        own = tuple(GeometricParameter("tool", name, c) for name in drawing.markers for c in TURNS)
        turned = drawing.with_parameters(own)
        seen = turned.see(fitted.placed_turns.reshape(-1), q, derivatives=False)
        return cls(seen.points, seen.turns)

    def of_poses(self, rows: Indices) -> "MarkerGoal":
        """The same of some of the poses."""
        return MarkerGoal(self.points[rows], None if self.turns is None else self.turns[rows])

    def commands(
        self, fitted: FittedGeometry, start: Array, wrench: Array, loads: Loads | None
    ) -> Array:
        """Commands (t, n) near a start (t, n) that bring the markers here, loads included.

        ``sum_i |x_i(q) - y_i|^2`` of the positions is least, by Newton's method with the smallest
        steps (Gauss-Newton with a pseudo-inverse). Motions that leave the positions alone bring the
        orientations as near as they can: of one marker on six joints all the way, and a robot of
        fewer joints pays no position for them. NaN where the steps do not settle.

        Args:
            fitted: The identified robot.
            start: Joint variables (t, n) [rad or m].
            wrench: Forces and torques (t, 6) in these poses [N, N m].
            loads: What loads the joints.
        """
        q = start.copy()
        moved = np.full(len(q), np.inf)
        for _ in range(STEPS):
            seen = fitted.model.see(fitted.theta, q, fitted.torque(q, wrench, loads))
            assert seen.by_joints is not None
            step = np.clip(self._step(seen, seen.by_joints), -FAR, FAR)
            q = q + step
            moved = np.abs(np.einsum("tkrn,tn->tkr", seen.by_joints, step)).max(axis=(1, 2))
            if moved.max(initial=0.0) < SETTLED:
                break
        return np.where((moved < REACHED)[:, None], q, np.nan)

    def distance(self, seen: Seen) -> Array:
        """Root mean square distance (t,) of the markers from their goals [m]."""
        return np.asarray(np.sqrt(((seen.points - self.points) ** 2).sum(axis=-1).mean(axis=-1)))

    def angle(self, seen: Seen) -> Array | None:
        """Root mean square angle (t,) of the markers from their goals [rad]; None without any."""
        if self.turns is None:
            return None
        return np.asarray(np.sqrt((self._to_turn(seen) ** 2).sum(axis=-1).mean(axis=-1)))

    def _to_turn(self, seen: Seen) -> Array:
        """Turns (t, k, 3) that lead to the goals, in the axes of the instrument [rad]."""
        assert self.turns is not None
        return rotation_vectors(self.turns @ np.swapaxes(seen.turns, -1, -2))

    def _step(self, seen: Seen, by_joints: Array) -> Array:
        """One step (t, n) of the joints."""
        t, n = by_joints.shape[0], by_joints.shape[-1]
        J = by_joints[:, :, :3].reshape(t, -1, n)
        inverse = np.linalg.pinv(J, rcond=SINGULAR)
        apart = (self.points - seen.points).reshape(t, -1, 1)
        step = inverse @ apart
        if self.turns is not None:
            W = by_joints[:, :, 3:].reshape(t, -1, n)
            free = np.eye(n) - inverse @ J
            to_turn = self._to_turn(seen).reshape(t, -1, 1) - W @ step
            step = step + _pseudo_inverse(W @ free, _largest(W)) @ to_turn
        return np.asarray(step[..., 0])


def _largest(A: Array) -> Array:
    """Largest singular values (t,) of matrices (t, r, n)."""
    return np.asarray(np.linalg.norm(A, ord=2, axis=(1, 2)))


def _pseudo_inverse(A: Array, size: Array) -> Array:
    """Pseudo-inverses (t, n, r) of matrices (t, r, n), for the scale of sizes (t,).

    Where the positions leave no motion free, A is nothing but rounding, whose own scale would make
    steps of it.
    """
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    used = s > SINGULAR * size[:, None]
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=used)
    return np.asarray((np.swapaxes(Vt, 1, 2) * inverse[:, None]) @ np.swapaxes(U, 1, 2))
