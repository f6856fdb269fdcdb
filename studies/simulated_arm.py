"""A robot that is simulated apart from edtk: where it rests under springs, weights and a wrench.

Studies and tests take it for the truth. It imports nothing of edtk, and shares no formula with it:
a pose is a product of motions, forces are derivatives of energies by a complex step, and an arm at
rest is a minimum of energy that scipy finds, or the fixed point of "springs give way to what loads
them", which is faster and holds for springs without an energy, too.

The chain is ``base prod_j (O_j E_j exp(xi_j y_j)) tool``. Coordinates x of the springs are first
the turns of the n drives, then motions of the elastic joints that make up E_j: each along or about
an axis of the frame O_j, in the order in which they are listed. Variables of the joints are
``y = P (q + x) + b`` with the commanded drives q. Arrays are batch first, numbers are SI.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import optimize

Array = NDArray[np.float64]
Motion = Literal["tx", "ty", "tz", "rx", "ry", "rz"]
MOTIONS: tuple[Motion, ...] = ("tx", "ty", "tz", "rx", "ry", "rz")

STEP = 1e-30  # of a complex derivative, which has no rounding
ITERATIONS = 300  # of springs that give way; ten are the rule
CONVERGED = 1e-15  # change of a coordinate [rad or m], of a motion of order one
SETTLED = 1e-4  # of a minimum of energy, by which its place is known
SINGULAR = 1e-13  # eigenvalue of a matrix of unit diagonal that is rounding
DOWN = np.array([0.0, 0.0, -9.80665])  # gravity [m/s^2]


@dataclass(frozen=True, eq=False)
class Point:
    """A point of a body.

    Attributes:
        body: Index of the joint that moves the body; None for the tool frame, -1 for the base.
        place: Its coordinates (3,) in the frame of that joint [m].
    """

    body: int | None = None
    place: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, eq=False)
class Mass:
    """A mass [kg] at a point."""

    mass: float
    at: Point


@dataclass(frozen=True, eq=False)
class Compensator:
    """A spring across a joint, between a point of the body before and one of the body after.

    With its length s, and s0 where the joint's variable is zero, it pulls with the force

        coil: ``f = preload + stiffness (s - s0)``,
        gas:  ``f = preload / (1 - slope (s - s0))``, the pressure of a volume that shrinks,

    of which the energy is the integral by s.

    Attributes:
        joint: Index of the joint.
        before: Anchor (3,) on the body before, in the joint's frame where its variable is zero [m].
        after: Anchor (3,) on the body after, in the same frame [m].
        preload: Force at s0 that pulls the anchors together [N].
        stiffness: Of a coil [N/m].
        slope: Of a gas [1/m].
    """

    joint: int
    before: Array
    after: Array
    preload: float
    stiffness: float = 0.0
    slope: float = 0.0

    def energy(self, before: NDArray, after: NDArray) -> NDArray:
        """Energy (...) where the anchors are at these points (..., 3) [J]."""
        apart = after - before
        longer = np.sqrt((apart * apart).sum(axis=-1)) - np.linalg.norm(self.after - self.before)
        gas = -self.preload * np.log(1 - self.slope * longer) / self.slope if self.slope else 0
        coil = 0.0 if self.slope else self.preload * longer
        return gas + coil + self.stiffness * longer**2 / 2


LawKind = Literal["square", "cubic", "sign", "gap"]


@dataclass(frozen=True)
class Law:
    """By how much a coordinate gives way beside its compliance, for its load t.

    square: ``c t|t|``, cubic: ``c t^3``, sign: ``c |t|``, gap: ``c sign(t)``.
    """

    coordinate: int
    kind: LawKind
    size: float

    def __call__(self, t: Array) -> Array:
        """The motion for loads t [rad or m]."""
        power = {"square": t * np.abs(t), "cubic": t**3, "sign": np.abs(t), "gap": np.sign(t)}
        return self.size * power[self.kind]


@dataclass(frozen=True, eq=False)
class SimulatedArm:
    """A chain with its springs.

    Attributes:
        origins: Transforms (N, 4, 4) to the joints' frames [m].
        axes: Their axes (N, 3).
        compliance: Symmetric matrix (s, s), or its diagonal (s,), of all coordinates; zero for a
            rigid one [rad/(N m), m/N].
        base: Transform (4, 4) of the chain's root.
        tool: Transform (4, 4) of the tool frame after the last joint.
        slides: Which joints (N,) are prismatic.
        elastic: The elastic joints: the joint before which each lies, and its motion.
        coupling: P (N, n); the identity by default.
        offset: b (N,).
        masses: Weights on the arm.
        compensators: Springs across joints.
        at: Where the wrench acts.
        laws: Springs that are not linear.
        friction: Load (s,) of each coordinate that friction holds, up to the whole [N m or N].
        varying: How much the compliance of each drive varies with its position, as a share.
        phase: Where in a turn (n,) it does [rad].
    """

    origins: Array
    axes: Array
    compliance: Array
    base: Array = field(default_factory=lambda: np.eye(4))
    tool: Array = field(default_factory=lambda: np.eye(4))
    slides: tuple[bool, ...] = ()
    elastic: tuple[tuple[int, Motion], ...] = ()
    coupling: Array | None = None
    offset: Array | None = None
    masses: tuple[Mass, ...] = ()
    compensators: tuple[Compensator, ...] = ()
    at: Point = field(default_factory=Point)
    laws: tuple[Law, ...] = ()
    friction: Array | None = None
    varying: float = 0.0
    phase: Array | None = None

    @property
    def drives(self) -> int:
        """Number n of commanded variables."""
        return len(self.axes) if self.coupling is None else self.coupling.shape[1]

    @property
    def size(self) -> int:
        """Number s of coordinates."""
        return self.drives + len(self.elastic)

    @property
    def matrix(self) -> Array:
        """Compliances (s, s)."""
        return np.diag(self.compliance) if np.ndim(self.compliance) == 1 else self.compliance

    def replace(self, **changes: object) -> "SimulatedArm":
        """The same arm with other attributes."""
        return replace(self, **changes)  # type: ignore[arg-type]

    def frames(self, q: ArrayLike, x: NDArray | None = None) -> tuple[list[NDArray], list[NDArray]]:
        """Where bodies are, for drives q (..., n) and coordinates x (..., s); rigid without.

        Returns:
            Frames (..., 4, 4) of the bodies that the joints move, the tool's last; and the frames
            before the joints, to which elastic joints are fixed.
        """
        q = np.asarray(q, dtype=float)
        x = np.zeros((*q.shape[:-1], self.size)) if x is None else x
        y = q + x[..., : self.drives]
        if self.coupling is not None:
            y = np.einsum("ij,...j->...i", self.coupling, y)
        if self.offset is not None:
            y = y + self.offset
        T = np.broadcast_to(self.base, (*y.shape[:-1], 4, 4))
        before = []
        bodies = []
        for j, origin in enumerate(self.origins):
            T = T @ origin
            before.append(T)
            for number, (joint, motion) in enumerate(self.elastic, self.drives):
                if joint == j:
                    axis = np.eye(3)[MOTIONS.index(motion) % 3]
                    T = T @ _moved(axis, x[..., number], motion.startswith("t"))
            T = T @ _moved(self.axes[j], y[..., j], bool(self.slides) and self.slides[j])
            bodies.append(T)
        return [*bodies, T @ self.tool], before

    def points(self, q: ArrayLike, points: Sequence[Point], x: NDArray | None = None) -> NDArray:
        """Points (..., k, 3) in the world [m]."""
        bodies, _ = self.frames(q, x)
        return np.stack([self._place(bodies, point) for point in points], axis=-2)

    def energy(self, q: ArrayLike, force: ArrayLike, x: NDArray) -> NDArray:
        """Energy (...) of forces (..., 3), weights and compensators, without springs [J]."""
        bodies, before = self.frames(q, x)
        U = -(np.asarray(force) * self._place(bodies, self.at)).sum(axis=-1)
        for one in self.masses:
            U = U - one.mass * (self._place(bodies, one.at) @ DOWN)
        for one in self.compensators:
            ends = [_carried(T, p) for T, p in self._anchors(one, bodies, before)]
            U = U + one.energy(*ends)
        return U

    def loads(self, q: ArrayLike, wrench: ArrayLike, x: Array) -> Array:
        """Generalised forces (m, s) on the coordinates, by a complex step each.

        A constant torque T has no energy: its power is ``T . w`` with the turning w of its body,
        ``dR R' = w x``.
        """
        q, W = (np.asarray(one, dtype=float) for one in (q, wrench))
        bent = x + 1j * STEP * np.eye(self.size)[:, None]
        forces = -np.imag(self.energy(q, W[..., :3], bent)) / STEP
        if np.any(W[..., 3:]):
            bodies, _ = self.frames(q, bent)
            R = self._body(bodies, self.at.body)[..., :3, :3]
            spin = np.imag(R) @ np.swapaxes(np.real(R), -1, -2) / STEP
            w = np.stack([spin[..., 2, 1], spin[..., 0, 2], spin[..., 1, 0]], axis=-1)
            forces = forces + (w * W[..., 3:]).sum(axis=-1)
        return forces.T

    def gives_way(self, q: Array, loads: Array) -> Array:
        """Coordinates (m, s) to which springs come under loads (m, s)."""
        if self.friction is not None:
            loads = np.sign(loads) * np.maximum(np.abs(loads) - self.friction, 0.0)
        x = loads @ self.matrix
        if self.varying:
            phase = np.zeros(self.drives) if self.phase is None else self.phase
            x[:, : self.drives] /= 1 + self.varying * np.sin(q + phase)
        for law in self.laws:
            x[:, law.coordinate] += law(loads[:, law.coordinate])
        return x

    def rest(self, q: ArrayLike, wrench: ArrayLike) -> Array:
        """Coordinates (m, s) at rest under wrenches (m, 6), for drives q (m, n).

        Raises:
            ValueError: The arm does not come to rest.
        """
        q = np.atleast_2d(np.asarray(q, dtype=float))
        W = np.broadcast_to(np.asarray(wrench, dtype=float), (len(q), 6))
        x = np.zeros((len(q), self.size))
        for _ in range(ITERATIONS):
            last = x
            x = self.gives_way(q, self.loads(q, W, last))
            if np.abs(x - last).max(initial=0.0) < CONVERGED:
                return x
        raise ValueError("the arm does not come to rest")

    def least_energy(self, q: ArrayLike, wrench: ArrayLike) -> Array:
        """The same by scipy, for linear springs and forces: a minimum of all energy.

        With ``C = R R'`` springs hold ``z' z / 2`` where they are at ``x = R z``, so that rigid
        coordinates need no infinite stiffness. The minimum is one to about the root of the
        rounding of the energy, and is settled as a root of its gradient.

        Raises:
            ValueError: A wrench has a torque, a spring is not linear, or there is no minimum.
        """
        q = np.atleast_2d(np.asarray(q, dtype=float))
        W = np.broadcast_to(np.asarray(wrench, dtype=float), (len(q), 6))
        if np.any(W[:, 3:]) or self.laws or self.friction is not None or self.varying:
            raise ValueError("an energy is known of linear springs and forces only")
        return np.array([self._least_of_one(a, b) for a, b in zip(q, W, strict=True)])

    def _least_of_one(self, q: Array, wrench: Array) -> Array:
        """Coordinates (s,) of one pose."""
        R = _root(self.matrix)

        def energy(z: Array) -> float:
            return float(z @ z / 2 + self.energy(q, wrench[:3], R @ z))

        def gradient(z: Array) -> Array:
            return z - R.T @ self.loads(q[None], wrench[None], (R @ z)[None])[0]

        least = optimize.minimize(energy, np.zeros(R.shape[1]), jac=gradient, method="BFGS")
        settled = optimize.root(gradient, least.x, tol=1e-15).x
        if np.abs(settled - least.x).max() > SETTLED * np.abs(least.x).max():
            raise ValueError("the arm has no minimum of energy")
        return R @ settled

    def _body(self, bodies: list[NDArray], body: int | None) -> NDArray:
        if body == -1:
            return np.broadcast_to(self.base, bodies[0].shape)
        return bodies[-1 if body is None else body]

    def _place(self, bodies: list[NDArray], point: Point) -> NDArray:
        return _carried(self._body(bodies, point.body), point.place)

    def _anchors(
        self, one: Compensator, bodies: list[NDArray], before: list[NDArray]
    ) -> list[tuple[NDArray, Array]]:
        """Both anchors: frames (..., 4, 4) that carry them, and their places there."""
        return [(before[one.joint], one.before), (bodies[one.joint], one.after)]


def _root(C: Array) -> Array:
    """R (s, r) with ``R R' = C``, of a matrix that is positive semidefinite.

    It is scaled to a unit diagonal first, as millimetres and radians stand side by side.
    """
    size = np.sqrt(np.diag(C))
    unit = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(C / unit / unit[:, None])
    kept = values > SINGULAR
    return unit[:, None] * vectors[:, kept] * np.sqrt(values[kept])


def _moved(axis: Array, size: NDArray, slides: bool) -> NDArray:
    """Transforms (..., 4, 4) of turns by so much about a unit axis, or of shifts along it."""
    T = np.zeros((*size.shape, 4, 4), dtype=size.dtype)
    T[..., range(4), range(4)] = 1.0
    if slides:
        T[..., :3, 3] = size[..., None] * axis
        return T
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    T[..., :3, :3] += np.sin(size)[..., None, None] * K
    # 1 - cos(a) = 2 sin(a/2)^2 has no rounding of its own
    T[..., :3, :3] += 2 * (np.sin(size / 2) ** 2)[..., None, None] * (K @ K)
    return T


def _carried(T: NDArray, place: Array) -> NDArray:
    """A point (..., 3) in the world."""
    return T[..., :3, :3] @ place + T[..., :3, 3]


def bending(link: ArrayLike, flexural: float, torsional: float) -> Array:
    """Compliance (6, 6) at the end of a beam that is held at its root, of ``MOTIONS``.

    Across the beam, whose direction is d, a force moves the end by L^3/3EI and a torque turns it by
    L/EI; one along it by L/GJ. A force f turns the end by ``L^2/2EI d x f``, and a torque moves it
    by the transpose.

    Args:
        link: From root to end (3,), of the length L [m].
        flexural: EI [N m^2].
        torsional: GJ [N m^2].
    """
    length = float(np.linalg.norm(link))
    d = np.asarray(link, dtype=float) / length
    along = np.outer(d, d)
    across = np.eye(3) - along
    crossed = np.cross(np.eye(3), d) * length**2 / (2 * flexural)
    C = np.zeros((6, 6))
    C[:3, :3] = length**3 / (3 * flexural) * across
    C[3:, 3:] = length / flexural * across + length / torsional * along
    C[3:, :3] = crossed
    C[:3, 3:] = crossed.T
    return C
