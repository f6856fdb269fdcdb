"""A chain whose frames are shifted and turned a little before each joint."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.model.geometry.rotation import left_jacobian, rotation
from edtk.model.robot import Robot
from edtk.model.vector_product import vector_product
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class PlacedChain:
    """Where the frames of an erring chain are in some poses, in the world of the model.

    Attributes:
        frames: Rotations (N, m, 3, 3) of the frame before each joint, in whose axes its error is.
        origins: Points (N, m, 3) about which that error turns [m].
        turned: The same frames after the error's turn (N, m, 3, 3): those of the joint itself.
        tips: Rotations (m, 3, 3) of the tool frame.
        points: Tool points (m, 3) [m].
    """

    frames: Array
    origins: Array
    turned: Array
    tips: Array
    points: Array


@dataclass(frozen=True, eq=False)
class ErringChain:
    """A robot with a small rigid motion `e_j` before each joint.

    The pose of the tool is ``base prod_j (O_j exp(e_j) exp(xi_j q_j)) tool`` with the origins O_j
    of the drawing. A motion ``e = (v, w)`` is a shift v, then a turn by the vector w, both along
    the axes of the frame O_j: to first order this is the exponential of the twist (v, w), and it
    describes the same set of motions.

    Args:
        robot: The drawing.
    """

    robot: Robot

    @cached_property
    def slides(self) -> Array:
        """Mask (N,) of the prismatic joints."""
        return np.array([joint.kind == "prismatic" for joint in self.robot.chain])

    @cached_property
    def _axes(self) -> Array:
        """Axes (N, 3) about which the joints turn; zeros where they slide."""
        axes = np.array([joint.axis for joint in self.robot.chain])
        return np.where(self.slides[:, None], 0.0, axes)

    @property
    def n(self) -> int:
        """Number N of joints of the chain, those that follow others included."""
        return len(self.robot.chain)

    def variables(self, q: Array) -> Array:
        """Variables (m, N) of all joints, for those (m, n) of the free ones [rad or m]."""
        ties = self.robot.ties
        return q if ties is None else ties.variables(q.T).T

    def place(self, variables: Array, errors: Array) -> PlacedChain:
        """Place the chain.

        Args:
            variables: Joint variables (m, N) [rad or m].
            errors: Motions (N, 6) before the joints, shifts first [m, rad].
        """
        m = len(variables)
        R = np.broadcast_to(self.robot.base[:3, :3], (m, 3, 3))
        p = np.broadcast_to(self.robot.base[:3, 3], (m, 3))
        frames = np.empty((self.n, m, 3, 3))
        turned = np.empty((self.n, m, 3, 3))
        origins = np.empty((self.n, m, 3))
        bends = rotation(errors[:, 3:])
        turns = rotation(np.ascontiguousarray(variables.T)[..., None] * self._axes[:, None])
        for j, joint in enumerate(self.robot.chain):
            p = p + R @ joint.origin[:3, 3]
            R = R @ joint.origin[:3, :3]
            frames[j] = R
            p = p + R @ errors[j, :3]
            R = R @ bends[j]
            origins[j] = p
            turned[j] = R
            if self.slides[j]:
                p = p + variables[:, j, None] * (R @ joint.axis)
            else:
                R = R @ turns[j]
        tips = R @ self.robot.tool[:3, :3]
        return PlacedChain(frames, origins, turned, tips, p + R @ self.robot.tool[:3, 3])

    def by_errors(self, placed: PlacedChain, errors: Array, points: Array) -> Array:
        """Derivatives (m, k, 3, N, 6) of points on the tool by the errors.

        A shift moves all that follows along the axes of its frame, and a turn about its origin:
        columns ``R_j [I, -[r_j]x J_l]``, with the lever r_j from there to the point.

        Args:
            placed: The chain with these errors.
            errors: Motions (N, 6).
            points: Points (m, k, 3) of the tool in the world of the model [m].
        """
        m, k = points.shape[:2]
        D = np.empty((m, k, 3, self.n, 6))
        bends = placed.frames @ left_jacobian(errors[:, 3:])[:, None]
        # All joints and axes at once: of a few poses the time goes by the number of calls.
        levers = points - placed.origins[:, :, None]
        swings = vector_product(np.swapaxes(bends, 2, 3)[:, :, None], levers[:, :, :, None])
        D[..., :3] = placed.frames.transpose(1, 2, 0, 3)[:, None]
        D[..., 3:] = swings.transpose(1, 2, 4, 0, 3)
        return D

    def turns_by_errors(self, placed: PlacedChain, errors: Array) -> Array:
        """Derivatives (m, 3, N, 6) of the tool's orientation, as turns in the world's axes."""
        m = placed.points.shape[0]
        D = np.zeros((m, 3, self.n, 6))
        bends = placed.frames @ left_jacobian(errors[:, 3:])[:, None]
        D[..., 3:] = np.moveaxis(bends, 0, 2)
        return D

    def by_joints(self, placed: PlacedChain, points: Array) -> Array:
        """Derivatives (m, k, 3, n) of points on the tool by the free joints [m/rad, or 1]."""
        m, k = points.shape[:2]
        D = np.empty((self.n, m, k, 3))
        for j, joint in enumerate(self.robot.chain):
            axis = placed.turned[j] @ joint.axis
            if self.slides[j]:
                D[j] = axis[:, None]
            else:
                D[j] = vector_product(axis[:, None], points - placed.origins[j][:, None])
        ties = self.robot.ties
        return np.moveaxis(D if ties is None else ties.fold(D), 0, -1)

    def turns_by_joints(self, placed: PlacedChain) -> Array:
        """Derivatives (m, 3, n) of the tool's orientation by the free joints."""
        D = np.zeros((self.n, len(placed.points), 3))
        for j, joint in enumerate(self.robot.chain):
            if not self.slides[j]:
                D[j] = placed.turned[j] @ joint.axis
        ties = self.robot.ties
        return np.moveaxis(D if ties is None else ties.fold(D), 0, -1)
