"""Positions of markers on a robot whose geometry and springs are not those of the drawing."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from edtk.model.geometry.erring_chain import ErringChain, PlacedChain
from edtk.model.geometry.geometric_parameter import COMPONENTS, GeometricParameter
from edtk.model.geometry.rotation import left_jacobian, rotation
from edtk.model.robot import Robot
from edtk.model.vector_product import vector_product
from edtk.system.typing import Array, Indices, Mask


@dataclass(frozen=True, eq=False)
class Seen:
    """What a model says is measured in some poses, and how the parameters move that.

    Attributes:
        points: Markers (m, k, 3) in the frame of the instrument [m].
        turns: Their orientations (m, k, 3, 3) there, in the axes of the instrument.
        jacobian: Derivatives (m, k, rows, P) by the model's parameters, in SI units; rotations as
            turns in the axes of the instrument. None where they were not asked for.
        by_joints: Derivatives (m, k, rows, n) by the free joints; None likewise.
    """

    points: Array
    turns: Array
    jacobian: Array | None = None
    by_joints: Array | None = None


@dataclass(frozen=True, eq=False)
class GeometricModel:
    """Markers seen by an instrument: ``x = B prod_j (O_j exp(e_j) exp(xi_j q_j)) tool_i``.

    Joint j is turned by its spring besides: ``q_j + k_j tau_j``, under the loads tau of the poses.
    The base's error is after its start B, as those of the joints: B is where the world of the
    drawing is in the frame of the instrument.

    Args:
        robot: The drawing, with its tool frame.
        offsets: Markers (k, 3) from the tool point, in the tool frame [m].
        markers: Their names (k,).
        parameters: What is unknown, in this order.
        start: The transform B (4, 4) [m].
        rows: "position" for three measured rows a marker, "pose" for all six.

    Raises:
        ValueError: Names and offsets do not fit each other.
    """

    robot: Robot
    offsets: Array
    markers: tuple[str, ...]
    parameters: tuple[GeometricParameter, ...]
    start: Array = field(default_factory=lambda: np.eye(4))
    rows: Literal["position", "pose"] = "position"

    def __post_init__(self) -> None:
        if np.shape(self.offsets) != (len(self.markers), 3):
            raise ValueError(f"{len(self.markers)} markers, and offsets {np.shape(self.offsets)}")

    @cached_property
    def chain(self) -> ErringChain:
        """The chain of the drawing."""
        return ErringChain(self.robot)

    @property
    def p(self) -> int:
        """Number of parameters."""
        return len(self.parameters)

    @property
    def row_count(self) -> int:
        """Measured rows of one marker."""
        return 3 if self.rows == "position" else 6

    @property
    def placed_rows(self) -> Mask:
        """Which of the rows of a pose (k rows,) are positions."""
        return np.tile(np.arange(self.row_count) < 3, len(self.markers))

    @cached_property
    def scales(self) -> Array:
        """Units (p,) in which the parameters are of order one, in SI."""
        return np.array([parameter.scale for parameter in self.parameters])

    @cached_property
    def compliant(self) -> Indices:
        """Indices of the free joints whose compliances are parameters, in their order."""
        names = [one.of for one in self.parameters if one.place == "compliance"]
        return np.array([self.robot.joint_names.index(name) for name in names], dtype=int)

    def with_parameters(self, parameters: tuple[GeometricParameter, ...]) -> "GeometricModel":
        """The same model with other unknowns."""
        return replace(self, parameters=parameters)

    def compliances(self, theta: Array) -> Array:
        """Compliances (n,) of all free joints at parameters theta (p,) [rad/(N m)]."""
        k = np.zeros(self.robot.n)
        k[self.compliant] = theta[[p.place == "compliance" for p in self.parameters]]
        return k

    def see(
        self,
        theta: Array,
        q: Array,
        torque: Array | None = None,
        derivatives: bool = True,
    ) -> Seen:
        """What is measured in some poses.

        Args:
            theta: Parameters (p,) in SI units.
            q: Joint variables (m, n) [rad or m].
            torque: Loads (m, n) of the free joints [N m or N]; None for none.
            derivatives: Whether those are computed too.
        """
        base, errors, tools = self._motions(theta)
        bent = q if torque is None else q + self.compliances(theta) * torque
        placed = self.chain.place(self.chain.variables(bent), errors)
        points = placed.points[:, None] + np.einsum(
            "mij,kj->mki", placed.tips, self.offsets + tools[:, :3]
        )
        B = self.start[:3, :3] @ rotation(base[3:])
        origin = self.start[:3, 3] + self.start[:3, :3] @ base[:3]
        levers = points @ B.T
        turns = B @ placed.tips[:, None] @ rotation(tools[:, 3:])
        seen = Seen(origin + levers, turns)
        if not derivatives:
            return seen
        world = self._in_world(placed, errors, tools, points)
        moved = {name: _turned(B, D) for name, D in world.items()}
        moved["base"] = self._by_base(base, levers)
        columns = self._chosen(moved, torque)
        return replace(seen, jacobian=columns, by_joints=moved["springs"])

    def motions_of_many(self, theta: Array) -> tuple[Array, Array, Array, Array]:
        """Motions and springs at many sets of parameters (w, p).

        Returns:
            Motions of the base (w, 6), before the joints (w, N, 6) and of the tools (w, k, 6), and
            compliances (w, n) of the free joints.
        """
        parts = [(*self._motions(one), self.compliances(one)) for one in theta]
        base, errors, tools, softness = (np.array(part) for part in zip(*parts, strict=True))
        return base, errors, tools, softness

    def _motions(self, theta: Array) -> tuple[Array, Array, Array]:
        """Motions of the base (6,), before the joints (N, 6) and of the tools (k, 6)."""
        sizes = {"base": 1, "joint": self.chain.n, "tool": len(self.markers)}
        motions = {place: np.zeros(6 * size) for place, size in sizes.items()}
        for one, value in zip(self.parameters, theta, strict=True):
            if one.place != "compliance":
                motions[one.place][self._place_of(one)] = value
        return motions["base"], motions["joint"].reshape(-1, 6), motions["tool"].reshape(-1, 6)

    def _in_world(
        self, placed: PlacedChain, errors: Array, tools: Array, points: Array
    ) -> dict[str, Array]:
        """Derivatives (m, k, rows, ...) in the world of the drawing, by what moves the markers."""
        m, k = points.shape[:2]
        by_errors = self.chain.by_errors(placed, errors, points).reshape(m, k, 3, -1)
        by_joints = self.chain.by_joints(placed, points)
        by_tools = np.zeros((m, k, self.row_count, k, 6))
        each = np.arange(k)
        by_tools[:, each, :3, each, :3] = placed.tips
        if self.rows == "pose":
            turned = self.chain.turns_by_errors(placed, errors).reshape(m, 1, 3, -1)
            by_errors = _stacked(by_errors, turned)
            by_joints = _stacked(by_joints, self.chain.turns_by_joints(placed)[:, None])
            bends = placed.tips[:, None] @ left_jacobian(tools[:, 3:])
            by_tools[:, each, 3:, each, 3:] = np.moveaxis(bends, 1, 0)
        each_tool = by_tools.reshape(m, k, self.row_count, -1)
        return {"joint": by_errors, "springs": by_joints, "tool": each_tool}

    def _by_base(self, base: Array, levers: Array) -> Array:
        """Derivatives (m, k, rows, 6) by the base's error, in the frame of the instrument."""
        R = self.start[:3, :3]
        bends = R @ left_jacobian(base[3:])
        D = np.zeros((*levers.shape[:2], self.row_count, 6))
        D[..., :3, :3] = R
        for c in range(3):
            D[..., :3, 3 + c] = vector_product(bends[:, c], levers)
        if self.rows == "pose":
            D[..., 3:, 3:] = bends
        return D

    def _chosen(self, moved: dict[str, Array], torque: Array | None) -> Array:
        """The columns (m, k, rows, p) of the parameters, in their order."""
        joint_names = self.robot.joint_names
        columns = np.zeros((*moved["joint"].shape[:3], self.p))
        for i, one in enumerate(self.parameters):
            if one.place != "compliance":
                columns[..., i] = moved[one.place][..., self._place_of(one)]
            elif torque is not None:
                j = joint_names.index(one.of)
                columns[..., i] = moved["springs"][..., j] * torque[:, None, None, j]
        return columns

    def _place_of(self, parameter: GeometricParameter) -> int:
        """Where a component of a motion is among those of all bases, joints or tools."""
        c = COMPONENTS.index(parameter.component)
        if parameter.place == "base":
            return c
        names = self.markers if parameter.place == "tool" else self.robot.body_names
        return 6 * names.index(parameter.of) + c


def _turned(B: Array, derivatives: Array) -> Array:
    """Derivatives (m, k, 3 or 6, p) with their three or twice three rows turned by B (3, 3)."""
    m, k, rows, p = derivatives.shape
    return (B @ derivatives.reshape(m, k, rows // 3, 3, p)).reshape(derivatives.shape)


def _stacked(points: Array, turns: Array) -> Array:
    """Rows of points (m, k, 3, p), then those of turns (m, 1, 3, p) of the body they are on."""
    return np.concatenate([points, np.broadcast_to(turns, points.shape)], axis=-2)
