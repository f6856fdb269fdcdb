"""What is measured and what loads the joints: rows of regressors, and errors of a visit."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.chain import Chain, Pull
from edtk.certificate.recompute.plain_data import number, numbers, rows, table, text, whole
from edtk.system.typing import Array, Mask

GRAVITY = 9.80665  # standard acceleration [m/s^2], along -z of the world
MEASURED = {"position": 3, "pose": 6, "distance": 1}  # rows of each kind of instrument
MOST_SENSORS = 100
MOST_WEIGHTS = 64
PLACE = ("offset", "joint")
KEYS = ("tracker", "repeatability", "discrepancy", "within", "readings")
SPRINGS = ("k", "turn", "anywhere")
# [rad]: poses nearer than this are one pose, and distances are compared as exactly.
SAME_POSE = 1e-9
COORDINATES = 3  # of a marker that the tracker sees
HELD = 0.1  # of a usual load: friction holds far less than that in proportion


@dataclass(frozen=True, eq=False)
class Place:
    """A point of the tool, or of the body of a joint.

    Attributes:
        offset: Offset (3,) in the frame of the tool, or of the joint [m].
        joint: Index of the joint; None for the tool.
    """

    offset: Array
    joint: int | None

    @classmethod
    def from_dict(cls, content: Any, n: int, where: str) -> "Place":
        """Read the keys `offset` and `joint` of a table.

        Raises:
            ValueError: They are no point of a robot with n joints.
        """
        joint = content["joint"]
        index = None if joint is None else whole(joint, 0, n - 1, f"{where}.joint")
        return cls(numbers(content["offset"], (3,), f"{where}.offset"), index)


Weight = tuple[float, Place] | Pull  # mass [kg] and centre of mass, or what carries a part of it


@dataclass(frozen=True, eq=False)
class Physics:
    """Instruments, load point and weights.

    Attributes:
        sensors: Kind, point and anchor (3,) of each instrument; anchors count for distances [m].
        load_point: Where the wrench acts.
        weights: Mass [kg] and centre of mass of each weight, and compensators.
    """

    sensors: list[tuple[str, Place, Array]]
    load_point: Place
    weights: list[Weight]

    @classmethod
    def from_dict(cls, content: Any, n: int) -> "Physics":
        """Read the part `setting.physics` of a certificate.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        where = "setting.physics"
        content = table(content, ("sensors", "load_point", "weights"), where)
        sensors = []
        for i, sensor in enumerate(rows(content["sensors"], MOST_SENSORS, f"{where}.sensors")):
            place = f"{where}.sensors[{i}]"
            sensor = table(sensor, ("kind", *PLACE), place, ("anchor",))
            kind = text(sensor["kind"], MEASURED, f"{place}.kind")
            anchor = numbers(sensor.get("anchor", [0, 0, 0]), (3,), f"{place}.anchor")
            sensors.append((kind, Place.from_dict(sensor, n, place), anchor))
        if not sensors:
            raise ValueError(f"{where}.sensors: expected at least one")
        load_point = table(content["load_point"], PLACE, f"{where}.load_point")
        return cls(
            sensors,
            Place.from_dict(load_point, n, f"{where}.load_point"),
            read_weights(content["weights"], n, f"{where}.weights"),
        )

    @classmethod
    def at_tool_point(cls, rows: str) -> "Physics":
        """Load and measurement, "position" or "pose", at the tool point."""
        place = Place(np.zeros(3), None)
        return cls([(rows, place, np.zeros(3))], place, [])

    @property
    def measured(self) -> int:
        """Number of measured rows."""
        return sum(self.widths)

    @property
    def widths(self) -> list[int]:
        """Number of measured rows of each instrument."""
        return [MEASURED[kind] for kind, _, _ in self.sensors]

    def regressors(self, chain: Chain, unknown: list[int], q: Array, wrench: Array) -> Array:
        """Regressors (k, rows, p): motion of what is measured times the torque of its joint."""
        torque = self.torque(chain, q, wrench)
        return np.asarray((self.motion(chain, q) * torque[:, None])[:, :, unknown])

    def torque(self, chain: Chain, q: Array, wrench: Array) -> Array:
        """Loads (k, n) of the free joints by wrenches (k, 6) and weights."""
        at_load = chain.jacobian(q, self.load_point.offset, self.load_point.joint)
        acting = at_load_point(chain, q, wrench, self.load_point.joint)
        by_wrench = np.einsum("krn,kr->kn", at_load, acting)
        return np.asarray(by_wrench + weight_torque(chain, self.weights, q))

    def motion(self, chain: Chain, q: Array) -> Array:
        """Derivatives (k, rows, n) of all measured rows by the joints, at poses q (k, n)."""
        return np.concatenate([self._motion(chain, q, *sensor) for sensor in self.sensors], axis=1)

    def positions(self, A: Array) -> Array:
        """The rows (..., 3k, p) of measurements that are positions of the k markers on the tool."""
        kept = []
        for kind, place, _ in self.sensors:
            counts = kind != "distance" and place.joint is None
            kept += [row < 3 and counts for row in range(MEASURED[kind])]
        return np.asarray(A[..., np.array(kept), :])

    def _motion(self, chain: Chain, q: Array, kind: str, place: Place, anchor: Array) -> Array:
        """Derivatives (k, rows, n) of the rows of one instrument by the joints."""
        columns = chain.jacobian(q, place.offset, place.joint)
        if kind == "pose":
            return columns
        if kind == "position":
            return columns[:, :3]
        wire = chain.point(q, place.offset, place.joint) - anchor
        length = np.linalg.norm(wire, axis=1)
        return np.asarray(wire[:, None] @ columns[:, :3] / length[:, None, None])


def read_weights(content: Any, n: int, where: str) -> list[Weight]:
    """Masses [kg] and their centres, and compensators.

    Raises:
        ValueError: They are none, or a mass is negative.
    """
    found: list[Weight] = []
    for i, weight in enumerate(rows(content, MOST_WEIGHTS, where)):
        place = f"{where}[{i}]"
        if isinstance(weight, dict) and "pull" in weight:
            found.append(Pull.from_dict(weight, n, place))
            continue
        weight = table(weight, ("mass", *PLACE), place)
        mass = number(weight["mass"], f"{place}.mass")
        if mass < 0:
            raise ValueError(f"{place}.mass: expected a number from 0 on")
        found.append((mass, Place.from_dict(weight, n, place)))
    return found


def weight_torque(chain: Chain, weights: Collection[Weight], q: Array) -> Array:
    """Joint loads (k, n) of weights [N m, or N if prismatic]: ``-m g dz/dq``, one after another."""
    torque = np.zeros_like(q)
    for weight in weights:
        if isinstance(weight, Pull):
            torque += weight.on(chain, q)[0]
            continue
        mass, place = weight
        torque -= mass * GRAVITY * chain.jacobian(q, place.offset, place.joint)[:, 2]
    return torque


def at_load_point(chain: Chain, q: Array, wrench: Array, joint: int | None = None) -> Array:
    """Wrenches (k, 6) at the load point that do what those at other places, (k, 9), do.

    A force F at a lever d of the load point's body, whose axes are the columns of R, has the torque
    ``R d x F`` about the load point.
    """
    if not wrench[:, 6:].any():
        return wrench[:, :6]
    R = chain.frames(q)[-1 if joint is None else joint][:, :3, :3]
    moment = np.cross(np.einsum("kij,kj->ki", R, wrench[:, 6:]), wrench[:, :3])
    return np.concatenate([wrench[:, :3], wrench[:, 3:6] + moment], axis=1)


def regressors(
    chain: Chain, unknown: list[int], q: Array, wrench: Array, weights: Collection[Weight] = ()
) -> Array:
    """Regressors (k, 6, p), Eq. (4): each column of the Jacobian times its torque ``J_j' W``.

    Args:
        chain: The robot with its tool.
        unknown: Indices (p,) of the joints whose compliances are the parameters.
        q: Poses (k, n) [rad or m].
        wrench: Loads (k, 6) [N, N m].
        weights: What loads the joints besides the wrench.
    """
    columns = chain.jacobian(q)[:, :, unknown]
    torque = np.einsum("krp,kr->kp", columns, at_load_point(chain, q, wrench))
    if weights:
        torque = torque + weight_torque(chain, weights, q)[:, unknown]
    return np.asarray(columns * torque[:, None])


def loads(
    chain: Chain, unknown: list[int], q: Array, wrench: Array, weights: Collection[Weight] = ()
) -> Array:
    """Loads (k, p) of joints by wrenches at the tool point, and weights; see `regressors`."""
    columns = chain.jacobian(q)[:, :, unknown]
    torque = np.einsum("krp,kr->kp", columns, at_load_point(chain, q, wrench))
    return np.asarray(torque + weight_torque(chain, weights, q)[:, unknown])


@dataclass(frozen=True, eq=False)
class Friction:
    """What friction holds of the loads of the unknown joints, by a share of a usual load.

    A joint whose load is ``t`` turns less by ``k m t / sqrt(t^2 + (m / 10)^2)`` for a share of one:
    by ``k m`` under a large load, and by ``10 k t`` under a small one.

    Attributes:
        k: Compliances (p,) [rad/(N m)].
        load: Usual loads (p,) [N m or N].
    """

    k: Array
    load: Array

    @classmethod
    def from_dict(cls, content: Any, p: int) -> "Friction":
        """Read the part `setting.friction` of a certificate; what is known of shares is a prior.

        Raises:
            ValueError: A part is missing, or is not positive.
        """
        where = "setting.friction"
        content = table(content, ("k", "load", "share"), where)
        k, load = (numbers(content[key], (p,), f"{where}.{key}") for key in ("k", "load"))
        if not (k >= 0).all() or not (load > 0).all():
            raise ValueError(f"{where}: expected compliances from zero, and loads above zero")
        if not number(content["share"], f"{where}.share") > 0:
            raise ValueError(f"{where}.share: expected a number above zero")
        return cls(k, load)

    def beside(self, A: Array, torque: Array) -> Array:
        """Columns (k, rows, 2p): those A of compliances, and of friction under loads (k, p)."""
        size = np.sqrt(torque**2 + (HELD * self.load) ** 2)
        return np.concatenate([A, A * (self.k * self.load / size)[:, None]], axis=2)


@dataclass(frozen=True, eq=False)
class Noise:
    """What the covariance of a visit's rows depends on, besides white noise.

    Attributes:
        tracker: Place (3,) of the tracker [m], then a [m] and b [m/m] of the standard deviation
            ``a + b r`` along its beam and across it; None without one.
        repeatability: Standard deviations (n,) of the joints in a reading [rad or m].
        discrepancy: Standard deviations (rows,) of the model's errors [m, rad].
        within: Poses nearer than this share the model's errors [rad].
        readings: Readings of which a row is made.
        springs: Compliances (n,) of which the model's errors are a share, besides, the share of
            their turns and that in any direction; None without such errors.
    """

    tracker: tuple[Array, Array, Array] | None
    repeatability: Array
    discrepancy: Array
    within: float
    readings: int
    springs: tuple[Array, float, float] | None = None

    @classmethod
    def from_dict(cls, content: Any, n: int, measured: int) -> "Noise":
        """Read the part `setting.noise` of a certificate.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        where = "setting.noise"
        content = table(content, KEYS, where, ("model_error",))
        repeatability = numbers(content["repeatability"], (n,), f"{where}.repeatability")
        discrepancy = numbers(content["discrepancy"], (measured,), f"{where}.discrepancy")
        within = number(content["within"], f"{where}.within")
        tracker = None
        if content["tracker"] is not None:
            of = table(content["tracker"], ("position", "along", "across"), f"{where}.tracker")
            position = numbers(of["position"], (3,), f"{where}.tracker.position")
            along = numbers(of["along"], (2,), f"{where}.tracker.along")
            across = numbers(of["across"], (2,), f"{where}.tracker.across")
            tracker = (position, along, across)
        sizes = [repeatability, discrepancy, np.array([within]), *(tracker or ())[1:]]
        if min(float(size.min()) for size in sizes) < 0:
            raise ValueError(f"{where}: expected no number below zero")
        readings = whole(content["readings"], 1, 2, f"{where}.readings")
        springs = None
        if "model_error" in content:
            springs = _springs(content["model_error"], n, f"{where}.model_error")
        return cls(tracker, repeatability, discrepancy, within, readings, springs)

    def whitened(
        self,
        A: Array,
        chain: Chain,
        physics: Physics,
        sigma: Array,
        q: Array,
        visits: Array,
        torque: Array,
        read: Mask,
    ) -> Array:
        """Rows of unit covariance (k, rows, p) of regressors A (k, rows, p); zero if not read.

        Args:
            A: The regressors.
            chain: The robot.
            physics: What is measured.
            sigma: Standard deviations (rows,) of the white part [m, rad].
            q: Poses (k, n) [rad or m].
            visits: Visits (k,) that share the model's errors in each pose.
            torque: Loads (k, n) of the free joints, or their change.
            read: Which rows (k, rows) there are; the others are struck out before.

        Raises:
            ValueError: A covariance is not positive definite.
        """
        motion = physics.motion(chain, q)
        Sigma = self.readings * (motion * self.repeatability**2) @ motion.transpose(0, 2, 1)
        own = sigma**2 + visits[:, None] * self.discrepancy**2
        if self.springs is not None:
            k, turn, anywhere = self.springs
            bent = motion * (k * torque)[:, None]
            Sigma = Sigma + visits[:, None, None] * turn**2 * bent @ bent.transpose(0, 2, 1)
            own = own + visits[:, None] * anywhere**2 * _alike(physics, (bent**2).sum(axis=2))
        Sigma = Sigma + own[:, None] * np.eye(len(sigma))
        if self.tracker is not None:
            self._add_tracker(Sigma, chain, physics, q)
        found = np.zeros(A.shape)
        for pattern in np.unique(read, axis=0):
            some, kept = np.flatnonzero((read == pattern).all(axis=1)), np.flatnonzero(pattern)
            places = np.ix_(some, kept)
            found[places] = _of_unit_covariance(A[places], Sigma[np.ix_(some, kept, kept)])
        return found

    def visits(self, chain: Chain, q: Array, wrench: Array, amount: Array) -> Array:
        """How many visits (k,) of a plan share the model's errors of each pose, its own included.

        Those under a load share nothing with those without one.

        Args:
            chain: The robot, whose prismatic joints do not count for distances.
            q: Poses (k, n) [rad or m].
            wrench: Their loads (k, 6) [N, N m].
            amount: Visits (k,) of each.
        """
        if self.springs is None and not self.discrepancy.any():
            return np.ones(len(q))
        turning = q[:, ~chain.prismatic]
        near = max(self.within * (1 - SAME_POSE), SAME_POSE)
        found = []
        loaded = (wrench != 0).any(axis=1).tolist()
        for pose, own in zip(turning, loaded, strict=True):
            # Half a turn is the farthest: the sine of half the angle has its length, the short way.
            turn = 2 * np.arcsin(np.abs(np.sin((turning - pose) / 2)))
            found.append(((np.linalg.norm(turn, axis=1) < near) & np.equal(loaded, own)) @ amount)
        return np.array(found, dtype=float)

    def _add_tracker(self, Sigma: Array, chain: Chain, physics: Physics, q: Array) -> None:
        """Add the tracker's part to covariances (k, rows, rows), marker by marker."""
        assert self.tracker is not None
        position, along, across = self.tracker
        first = 0
        for kind, place, _ in physics.sensors:
            if kind != "distance":
                beam = chain.point(q, place.offset, place.joint) - position
                r = np.linalg.norm(beam, axis=1)[:, None, None]
                inline = beam[:, :, None] * beam[:, None] / r**2
                aside = np.eye(3) - inline
                part = (along[0] + along[1] * r) ** 2 * inline
                part = part + (across[0] + across[1] * r) ** 2 * aside
                rows = slice(first, first + COORDINATES)
                Sigma[:, rows, rows] += self.readings * part
            first += MEASURED[kind]


def _springs(content: Any, n: int, where: str) -> tuple[Array, float, float]:
    """Compliances (n,), and shares of their turns and in any direction.

    Raises:
        ValueError: A part is missing, or is below zero.
    """
    content = table(content, SPRINGS, where)
    k = numbers(content["k"], (n,), f"{where}.k")
    turn = number(content["turn"], f"{where}.turn")
    anywhere = number(content["anywhere"], f"{where}.anywhere")
    if min(float(k.min()), turn, anywhere) < 0:
        raise ValueError(f"{where}: expected no number below zero")
    return k, turn, anywhere


def _alike(physics: Physics, squares: Array) -> Array:
    """Squares (k, rows) as means over what an instrument reads alike: a place, a turn, a length."""
    found = np.empty_like(squares)
    first = 0
    for kind, _, _ in physics.sensors:
        last = first + MEASURED[kind]
        while first < last:
            part = slice(first, min(first + COORDINATES, last))
            found[:, part] = squares[:, part].mean(axis=1, keepdims=True)
            first = part.stop
    return found


def _of_unit_covariance(A: Array, Sigma: Array) -> Array:
    """Rows A (k, r, p) in which errors of covariances Sigma (k, r, r) are independent, of size one.

    Raises:
        ValueError: A covariance is not positive definite.
    """
    size = np.sqrt(np.diagonal(Sigma, axis1=1, axis2=2))
    try:
        L = np.linalg.cholesky(Sigma / size[:, :, None] / size[:, None])
    except np.linalg.LinAlgError as error:
        raise ValueError("the errors of some rows depend on each other exactly") from error
    return np.asarray(np.linalg.solve(L, A / size[:, :, None]))
