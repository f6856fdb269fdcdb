"""The setting of a design that a certificate states: robot, load, noise, limits, test pose."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.chain import Chain, Gives
from edtk.certificate.recompute.geometry import Geometry
from edtk.certificate.recompute.physics import Friction, Noise, Physics, regressors
from edtk.certificate.recompute.plain_data import (
    WRENCH,
    in_range,
    number,
    numbers,
    rows,
    table,
    text,
    whole,
    wrenches_of,
)
from edtk.certificate.recompute.sight import Sight
from edtk.certificate.recompute.tasks import Tasks, combinations
from edtk.system.typing import Array, Mask

LOAD_KEYS = ("F_N", "T_Nm", "F_max_N", "direction", "list_F_N", "list_at_mm", "wrenches")
CHOICES = ("F_N", "F_max_N", "list_F_N", "wrenches")
# What is stated beside a load, and the only kind that it is for.
GOES_WITH = {"T_Nm": "F_N", "list_at_mm": "list_F_N", "direction": "F_max_N"}
MOST_LISTED = 1000  # loads to choose from
TINY = 1e-9  # of a load, beside the largest one, that is rounding
BOUNDS = ("height_min_mm", "radius_min_mm", "tilt_max_deg")
OTHERS = ("plan_resolution_deg", "excluded", "excluded_within_deg")
MOST_EXCLUDED = 1000  # poses to stay away from: each candidate is compared with all of them
STEP = 1e-6  # of a difference quotient [rad or m]; its error, about 1e-10, is far below a rounding
BLOCK = 3_000_000  # numbers in an array that lies between poses and rows
MEASURED = {"position": 3, "pose": 6}  # rows that an experiment measures
SETTING_KEYS = (
    *("robot", "unknown", "rows", "sigma", "load"),
    *("workspace", "excluded", "free", "fixed"),
)
OPTIONAL = (
    *("physics", "noise", "interest", "prior", "geometry"),
    *("margin", "coupled_margin", "gives", "friction", "sight"),
)


@dataclass(frozen=True, eq=False)
class Load:
    """A fixed wrench, one of a list, or any force up to a size, along a direction or anywhere.

    Attributes:
        listed: Wrenches (l, 6) of which each experiment takes one [N, N m]; a fixed load is a list
            of one. None for a force up to a size.
        fixed: Whether the list is a fixed load, which has no design variable.
        largest: Largest force [N].
        direction: Unit vector (3,) of the force; None if it may point anywhere.
    """

    listed: Array | None
    fixed: bool
    largest: float
    direction: Array | None

    @classmethod
    def from_dict(cls, load: Any) -> "Load":
        """Read the keys of a study's [load].

        Raises:
            ValueError: They do not say which loads are allowed.
        """
        where = "setting.load"
        load = table(load, (), where, LOAD_KEYS)
        given = [key for key in CHOICES if key in load]
        if len(given) != 1:
            raise ValueError(f"{where}: expected one of F_N, F_max_N, list_F_N and wrenches")
        kind = given[0]
        torque = numbers(load.get("T_Nm", [0, 0, 0]), (3,), f"{where}.T_Nm")
        stated = {key for key in GOES_WITH if key in load and (key != "T_Nm" or torque.any())}
        for key in sorted(stated):
            if kind != GOES_WITH[key]:
                raise ValueError(f"{where}: {key} goes with {GOES_WITH[key]} only")
        if kind == "F_N":
            force = numbers(load["F_N"], (3,), f"{where}.F_N")
            return cls(np.concatenate([force, torque, np.zeros(3)])[None], True, 0.0, None)
        if kind == "F_max_N":
            return cls(None, False, *_largest_force(load, where))
        rows(load[kind], MOST_LISTED, f"{where}.{kind}")
        is_wrench = kind == "wrenches"
        listed = wrenches_of(load[kind], f"{where}.{kind}") if is_wrench else _forces(load, where)
        if not len(listed):
            raise ValueError(f"{where}.{kind}: expected at least one")
        return cls(listed, False, 0.0, None)

    @property
    def size(self) -> int:
        """Number d of design variables: none, an index or a size, or a force in polar form."""
        if self.fixed:
            return 0
        return 3 if self.listed is None and self.direction is None else 1

    @property
    def moves(self) -> bool:
        """Whether a search may change the variables; an index does not change by steps."""
        return self.listed is None

    @property
    def limits(self) -> Array:
        """Bounds (2, d) of the variables."""
        if self.size == 3:
            return np.array([[-1.0, -np.pi, -2 * np.pi], [1.0, np.pi, 2 * np.pi]])
        last = 1.0 if self.listed is None else len(self.listed) - 1.0
        return np.array([[0.0] * self.size, [last] * self.size])

    def draw(self, cube: Array) -> Array:
        """Variables (k, d) of points of the unit cube (k, d)."""
        if self.fixed or self.direction is not None:
            return cube
        if self.listed is not None:
            last = len(self.listed) - 1
            return np.minimum(np.floor(len(self.listed) * cube), last)
        # Uniform in the ball: its volume grows with the cube of the size, its area with the sine.
        elevation = np.arcsin(np.clip(2 * cube[:, 1] - 1, -1.0, 1.0))
        azimuth = np.pi * (2 * cube[:, 2] - 1)
        return np.stack([np.cbrt(cube[:, 0]), elevation, azimuth], axis=1)

    def allows(self, u: Array) -> Mask:
        """Which variables (k, d) are within their bounds; an index must be whole too."""
        lower, upper = self.limits
        inside = ((u >= lower - TINY) & (u <= upper + TINY)).all(axis=1)
        return np.asarray(inside if self.moves else inside & (u == np.rint(u)).all(axis=1))

    def wrench(self, u: Array) -> Array:
        """Wrenches (k, 9) with their places [N, N m, m] of variables (k, d)."""
        if self.listed is not None:
            index = np.zeros(len(u), dtype=int) if self.fixed else np.rint(u[:, 0]).astype(int)
            return self.listed[index]
        found = np.zeros((len(u), WRENCH))
        if self.direction is not None:
            found[:, :3] = u * self.largest * self.direction
            return found
        r, elevation, azimuth = u.T
        flat = np.cos(elevation)
        force = [flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)]
        found[:, :3] = self.largest * (r * np.stack(force)).T
        return found

    def excess(self, wrench: Array) -> Array:
        """How far wrenches (k, 9) are from what is allowed, relative to the largest one (k,)."""
        if self.listed is not None:
            away = np.full(len(wrench), np.inf)
            for one in self.listed:
                away = np.minimum(away, np.abs(wrench - one).max(axis=1))
            return away / max(float(np.abs(self.listed).max()), np.finfo(float).tiny)
        force = wrench[:, :3]
        size = np.linalg.norm(force, axis=1)
        away = np.maximum(size - self.largest, np.abs(wrench[:, 3:]).max(axis=1))
        if self.direction is not None:
            along = force @ self.direction
            aside = np.linalg.norm(force - along[:, None] * self.direction, axis=1)
            away = np.maximum(away, np.maximum(-along, aside))
        return np.asarray(np.maximum(away, 0.0) / self.largest)


def _forces(load: dict[str, Any], where: str) -> Array:
    """Listed forces as wrenches (k, 9), each at its place if these are stated."""
    forces = numbers(load["list_F_N"], (None, 3), f"{where}.list_F_N")
    none = np.zeros_like(forces)
    at = load.get("list_at_mm", none.tolist())
    places = numbers(at, forces.shape, f"{where}.list_at_mm")
    return np.hstack([forces, none, places / 1e3])


def _largest_force(load: dict[str, Any], where: str) -> tuple[float, Array | None]:
    """The size of a force up to which it may be [N], and its direction (3,) if that is stated.

    Raises:
        ValueError: The size is not positive, or the direction is zero.
    """
    largest = number(load["F_max_N"], f"{where}.F_max_N")
    if largest <= 0:
        raise ValueError(f"{where}.F_max_N: expected a positive force")
    if "direction" not in load:
        return largest, None
    direction = numbers(load["direction"], (3,), f"{where}.direction")
    if not direction.any():
        raise ValueError(f"{where}.direction: expected a vector that is not zero")
    return largest, direction / np.linalg.norm(direction)


@dataclass(frozen=True, eq=False)
class Workspace:
    """Joint limits, bounds on the tool, and poses to stay away from.

    Attributes:
        chain: The robot with the calibration tool.
        height: Least height of the tool point [m]; None without.
        radius: Least distance of the tool point from the base axis [m]; None without.
        tilt: Largest angle of the tool's z-axis to the horizontal [rad]; None without.
        resolution: Step (n,) to which poses of plans that are read are rounded [rad or m].
        excluded: Poses (e, n) to stay away from [rad or m].
        distance: Distance to keep from them [rad].
        margin: How far planned poses keep away from the limits of coupled joints (c,) [rad].
        sight: Which markers are read, where each has to be in each pose; else None.
    """

    chain: Chain
    height: float | None
    radius: float | None
    tilt: float | None
    resolution: Array
    excluded: Array
    distance: float
    margin: Array
    sight: Sight | None = None

    @classmethod
    def of(cls, content: dict[str, Any], chain: Chain, sight: Sight | None) -> "Workspace":
        """Read the keys of a study's [workspace], and the poses that it excludes.

        Args:
            content: The setting.
            chain: The robot.
            sight: What the instruments see; None where that bounds nothing.

        Raises:
            ValueError: A key is unknown, or the excluded poses are not those that it speaks of.
        """
        where = "setting.workspace"
        keys = table(content["workspace"], (), where, (*BOUNDS, *OTHERS))
        height, radius, tilt = (
            None if name not in keys else number(keys[name], f"{where}.{name}") for name in BOUNDS
        )
        resolution = number(keys.get("plan_resolution_deg", 0.0), f"{where}.plan_resolution_deg")
        within = number(keys.get("excluded_within_deg", 5.0), f"{where}.excluded_within_deg")
        if resolution < 0 or within <= 0:
            raise ValueError(f"{where}: expected a resolution and a distance that are not negative")
        names = rows(keys.get("excluded", []), MOST_EXCLUDED, f"{where}.excluded")
        poses = _excluded(content["excluded"], chain.n, float(np.deg2rad(within)), len(names))
        return cls(
            chain=chain,
            height=None if height is None else height / 1e3,
            radius=None if radius is None else radius / 1e3,
            tilt=None if tilt is None else float(np.deg2rad(tilt)),
            resolution=np.where(chain.prismatic, 0.0, np.deg2rad(resolution)),
            excluded=poses,
            distance=float(np.deg2rad(within)),
            margin=_coupled_margin(content.get("coupled_margin"), chain),
            sight=sight if sight is not None and sight.needs_all else None,
        )

    def violation(self, q: Array) -> Array:
        """By how much each pose (k,) violates its worst constraint [m or rad]."""
        worst = self._violations(q, self.margin).max(axis=1)
        if len(self.excluded):
            worst = np.maximum(worst, self.distance - self._nearest(q))
        if self.sight is not None:
            worst[~self.sight.seen(self.chain, q).all(axis=1)] = np.inf
        return np.asarray(worst)

    def violation_within_rounding(self, q: Array) -> Array:
        """The same (k,) for poses that were rounded, and may have been measured near excluded ones.

        Each violation is reduced by the most that rounding can have added, to first order.
        """
        allowance = np.zeros_like(self._violations(q))
        for j in np.flatnonzero(self.resolution):
            step = np.zeros(q.shape[1])
            step[j] = STEP
            slope = (self._violations(q + step) - self._violations(q - step)) / (2 * STEP)
            allowance += np.abs(slope) * self.resolution[j] / 2
        return np.asarray((self._violations(q) - allowance).max(axis=1))

    def _violations(self, q: Array, margin: Array | float = 0.0) -> Array:
        """Violations (k, c) of the joint limits and the bounds on the tool [m or rad]."""
        ending = ~self.chain.endless
        lower, upper = self.chain.limits[:, ending]
        found = [lower - q[:, ending], q[:, ending] - upper]
        sums, (least, most) = self.chain.coupled
        own = q @ sums.T
        found += [least + margin - own, own - most + margin]
        point, axis = self.chain.tool_point_and_axis(q)
        if self.height is not None:
            found.append(self.height - point[:, 2:])
        if self.radius is not None:
            found.append(self.radius - np.hypot(point[:, 0], point[:, 1])[:, None])
        if self.tilt is not None:
            angle = np.arctan2(axis[:, 2], np.hypot(axis[:, 0], axis[:, 1]))
            found.append(np.stack([angle - self.tilt, -angle - self.tilt], axis=1))
        return np.concatenate(found, axis=1)

    def _nearest(self, q: Array) -> Array:
        """Distance (k,) to the nearest excluded pose, over the revolute joints [rad]."""
        nearest = np.full(len(q), np.inf)
        # One pose at a time: all differences at once would fill the memory.
        for pose in self.excluded:
            turn = np.abs(q - pose)[:, ~self.chain.prismatic] % (2 * np.pi)
            short_way = np.minimum(turn, 2 * np.pi - turn)
            nearest = np.minimum(nearest, np.linalg.norm(short_way, axis=1))
        return nearest


def _excluded(value: Any, n: int, distance: float, least: int) -> Array:
    """Excluded poses (e, n), of at least as many plans as the study's own keys name.

    Raises:
        ValueError: A plan is missing, or keeps another distance than the keys say.
    """
    where = "setting.excluded"
    parts = rows(value, MOST_EXCLUDED, where)
    if len(parts) < least:
        raise ValueError(f"{where}: expected at least {least} plans, which the workspace names")
    found = [np.empty((0, n))]
    for part in parts:
        table(part, ("poses", "distance"), where)
        rows(part["poses"], MOST_EXCLUDED, f"{where}.poses")
        found.append(numbers(part["poses"], (None, n), f"{where}.poses"))
        if not np.isclose(number(part["distance"], f"{where}.distance"), distance, 1e-12, 0):
            raise ValueError(f"{where}.distance: expected excluded_within_deg of the workspace")
    poses = np.concatenate(found)
    if len(poses) > MOST_EXCLUDED:
        raise ValueError(f"{where}: expected at most {MOST_EXCLUDED} poses, got {len(poses)}")
    return poses


@dataclass(frozen=True, eq=False)
class Setting:
    """All that the information of an experiment depends on.

    Attributes:
        name: Name of the robot.
        chain: Robot with the calibration tool.
        unknown: Indices (p,) of the joints whose compliances are the parameters.
        sigma: Standard deviation of the white noise of each measured row (rows,) [m, rad].
        workspace: Constraints on poses.
        load: Loads that may be applied.
        free: Indices of the joints that are designed.
        fixed: Joint variables (n,) whose entries outside `free` are kept [rad or m].
        tasks: The tasks, of which there may be none.
        physics: Instruments, load point and weights; None where load and measurement are at the
            tool point.
        interest: Combinations K (p, s) that criteria without a task are about; None for all
            parameters.
        prior: Whitened rows (r, p) of measurements that tell as much as what is known beforehand.
        noise: Noise that is not white; None without it.
        geometry: The parameters, where they are not compliances alone; None where they are.
        price: Costs (k,) of experiments under wrenches (k, 6), where rows are those of one unit of
            costs; None where experiments are counted.
        margin: How far poses keep away from the limits of each joint (n,) [rad or m]; None for no
            margin.
        gives: How joints with compensators give way; None without any.
        friction: What friction holds of the joints' loads, whose shares are parameters behind the
            compliances; None where it counts for nothing.
        sight: Which rows are read in which poses; None for all in each.
    """

    name: str
    chain: Chain
    unknown: list[int]
    sigma: Array
    workspace: Workspace
    load: Load
    free: list[int]
    fixed: Array
    tasks: Tasks
    physics: Physics | None = None
    interest: Array | None = None
    prior: Array | None = None
    noise: Noise | None = None
    geometry: Geometry | None = None
    price: Callable[[Array], Array] | None = None
    margin: Array | None = None
    gives: Gives | None = None
    friction: Friction | None = None
    sight: Sight | None = None

    @classmethod
    def from_dict(cls, content: Any) -> "Setting":
        """Read the setting from the part `setting` of a certificate.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        content = table(content, (*SETTING_KEYS, "test_pose"), "setting", OPTIONAL)
        chain = Chain.from_dict(content["robot"])
        n = chain.n
        unknown = _indices(content["unknown"], n, "setting.unknown")
        kind = text(content["rows"], MEASURED, "setting.rows")
        physics = _physics(content, chain, kind)
        measured = MEASURED[kind] if physics is None else physics.measured
        sigma = numbers(content["sigma"], (measured,), "setting.sigma")
        widths = [measured] if physics is None else physics.widths
        sight = None
        if "sight" in content:
            sight = Sight.from_dict(content["sight"], len(chain.axes), widths)
        noise = Noise.from_dict(content["noise"], n, measured) if "noise" in content else None
        gives = Gives.from_dict(content["gives"], chain) if "gives" in content else None
        geometry = None
        if "geometry" in content and physics is not None:
            geometry = Geometry.from_dict(content["geometry"], chain, physics, gives)
        friction = _friction(content, unknown, geometry)
        p = geometry.p if geometry is not None else len(unknown) * (1 if friction is None else 2)
        white = (sigma > 0).all() or (noise is not None and (sigma >= 0).all())
        if not p or not white:
            raise ValueError("setting: expected an unknown joint, and sigmas above zero")
        return cls(
            name=_name(content["robot"]["name"]),
            chain=chain,
            unknown=unknown,
            sigma=sigma,
            workspace=Workspace.of(content, chain, sight),
            load=Load.from_dict(content["load"]),
            free=_indices(content["free"], n, "setting.free"),
            fixed=numbers(content["fixed"], (n,), "setting.fixed"),
            tasks=_tasks(content, chain, physics, geometry, unknown, gives, friction),
            physics=physics,
            interest=_interest(content, p),
            prior=_prior(content, p),
            noise=noise,
            geometry=geometry,
            margin=_margin(content, chain),
            gives=gives,
            friction=friction,
            sight=sight,
        )

    @property
    def limits(self) -> Array:
        """Limits (2, n) between which poses are planned [rad or m]."""
        if self.margin is None:
            return self.chain.limits
        lower, upper = self.chain.limits
        return np.stack([lower + self.margin, upper - self.margin])

    @property
    def p(self) -> int:
        """Number of parameters."""
        if self.geometry is not None:
            return self.geometry.p
        return len(self.unknown) * (1 if self.friction is None else 2)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters (p,)."""
        if self.geometry is None:
            held = [] if self.friction is None else [f"friction {j + 1}" for j in self.unknown]
            return (*(f"k{j + 1}" for j in self.unknown), *held)
        return tuple(one.name for one in self.geometry.parameters)

    def whitened_rows(self, q: Array, wrench: Array, visits: Array | None = None) -> Array:
        """Regressors over sigma (k, rows, p) of poses q (k, n) with wrenches (k, 6).

        Where noise is not white, the rows are those of unit covariance. Visits (k,) say how many
        share the model's errors in each pose, by default one.
        """
        blocks = []
        # Some at a time: what lies between poses and rows may be hundreds of times larger.
        for first in range(0, max(len(q), 1), self.block):
            some = slice(first, first + self.block)
            blocks.append(self._whitened(q[some], wrench[some], _some(visits, some)))
        A = in_range(np.concatenate(blocks), "rows of a pose")
        return A if self.price is None else A / np.sqrt(self.price(wrench))[:, None, None]

    @property
    def block(self) -> int:
        """Number of experiments whose rows are computed at once."""
        measured = len(self.sigma)
        wide = max(measured if self.noise is not None else 0, len(self.chain.axes), self.p, 6)
        return int(max(BLOCK // (measured * wide), 1))

    def _whitened(self, q: Array, wrench: Array, visits: Array | None) -> Array:
        """The same, whatever they cost."""
        if self.physics is not None:
            A = self._regressors(self.physics, q, wrench)
            read = self._read(q)
            if self.noise is None:
                return A * read[..., None] / self.sigma[:, None]
            visits = np.ones(len(q)) if visits is None else visits
            if self.geometry is not None:
                # Rows of a change are in units of one reading, and the model errs in it once.
                visits = visits / self.geometry.readings(wrench)
            torque = self._torque(self.physics, q, wrench)
            given = (A, self.chain, self.physics, self.sigma, q, visits, torque, read)
            return self.noise.whitened(*given)
        A = self._left(regressors(self.chain, self.unknown, q, wrench), q)[:, : len(self.sigma)]
        return A * self._read(q)[..., None] / self.sigma[:, None]

    def _read(self, q: Array) -> Mask:
        """Which rows (k, rows) are read."""
        if self.sight is None:
            return np.ones((len(q), len(self.sigma)), dtype=bool)
        return self.sight.rows(self.chain, q)

    def _torque(self, physics: Physics, q: Array, wrench: Array) -> Array:
        """Loads (k, n) of the joints, by which the model errs; zeros where it does not."""
        if self.noise is None or self.noise.springs is None:
            return np.zeros(q.shape)
        if self.geometry is not None:
            return self.geometry.torque(self.chain, physics, q, wrench)
        return physics.torque(self.chain, q, wrench)

    def _left(self, A: Array, q: Array) -> Array:
        """Regressors (k, rows, p) of joints that give way less, or more, with compensators.

        A change of a compliance turns its joint by a part of ``dk tau``, and tau is the load where
        the joint has come to rest: a part again of that where it is commanded.
        """
        if self.gives is None:
            return A
        return A * self.gives.factors(self.chain, q)[:, None, self.unknown] ** 2

    def _regressors(self, physics: Physics, q: Array, wrench: Array) -> Array:
        """Regressors (k, rows, p) of what is measured."""
        if self.geometry is not None:
            return self.geometry.rows(self.chain, physics, q, wrench)
        A = self._left(physics.regressors(self.chain, self.unknown, q, wrench), q)
        if self.friction is None:
            return A
        return self.friction.beside(A, physics.torque(self.chain, q, wrench)[:, self.unknown])

    def violation(self, q: Array) -> Array:
        """By how much each pose (k,) violates its worst constraint [m or rad].

        It is at most 0 if the pose is feasible. A joint that is not designed has to stay where it
        is fixed; poses that are drawn obey that.
        """
        moved = np.abs(q - self.fixed)
        moved[:, self.free] = 0.0
        worst = np.maximum(self.workspace.violation(q), moved.max(axis=1))
        if self.margin is not None:
            lower, upper = np.where(self.margin > 0, self.limits, [[-np.inf], [np.inf]])
            worst = np.maximum(worst, np.maximum(lower - q, q - upper).max(axis=1))
        return np.asarray(worst)

    def feasible(self, x: Array) -> Mask:
        """Whether each experiment x (k, n + d) is allowed, but for rounding."""
        n = len(self.fixed)
        return (self.violation(x[:, :n]) <= TINY) & self.load.allows(x[:, n:])


def _friction(
    content: dict[str, Any], unknown: list[int], geometry: Geometry | None
) -> Friction | None:
    """The friction of the joints; None without any.

    Raises:
        ValueError: It is not valid, or beside geometry.
    """
    if "friction" not in content:
        return None
    if geometry is not None:
        raise ValueError("setting.friction: goes with compliances alone")
    return Friction.from_dict(content["friction"], len(unknown))


def _some(values: Array | None, some: slice) -> Array | None:
    """Some of the values, if there are any."""
    return None if values is None else values[some]


def _physics(content: dict[str, Any], chain: Chain, kind: str) -> Physics | None:
    """Instruments and what loads the arm; None where a load at the tool point moves that alone."""
    if "physics" in content:
        return Physics.from_dict(content["physics"], len(chain.axes))
    if "geometry" in content:
        raise ValueError("setting: the key 'physics' is missing")
    if "noise" in content or "friction" in content:
        return Physics.at_tool_point(kind)
    return None


def _tasks(
    content: dict[str, Any],
    chain: Chain,
    physics: Physics | None,
    geometry: Geometry | None,
    unknown: list[int],
    gives: Gives | None,
    friction: Friction | None,
) -> Tasks:
    """The tasks, by compliances alone or by all that is unknown."""
    if geometry is None or physics is None:
        robot = content["robot"]
        return Tasks.from_content(content["test_pose"], robot, unknown, gives, friction)
    return Tasks.of_geometry(content["test_pose"], content["robot"], chain, physics, geometry)


def _prior(content: dict[str, Any], p: int) -> Array | None:
    """Rows (r, p) that stand for what is known beforehand; None where nothing is."""
    if content.get("prior") is None:
        return None
    rows(content["prior"], p, "setting.prior")
    return numbers(content["prior"], (None, p), "setting.prior")


def _margin(content: Any, chain: Chain) -> Array | None:
    """How far poses keep away from limits (n,); None for no margin.

    Raises:
        ValueError: It is negative, or leaves a joint no range.
    """
    if "margin" not in content:
        return None
    margin = numbers(content["margin"], (chain.n,), "setting.margin")
    if not ((margin >= 0) & (2 * margin < np.ptp(chain.limits, axis=0))).all():
        raise ValueError("setting.margin: expected numbers from 0 that leave each joint a range")
    return margin


def _coupled_margin(value: Any, chain: Chain) -> Array:
    """How far poses keep away from the limits of coupled joints (c,).

    Raises:
        ValueError: It is negative, or leaves a joint no range.
    """
    ends = chain.coupled[1]
    margin = np.zeros(ends.shape[1])
    if value is not None:
        margin = numbers(value, (ends.shape[1],), "setting.coupled_margin")
    if not ((margin >= 0) & (2 * margin < ends[1] - ends[0])).all():
        raise ValueError("setting.coupled_margin: expected numbers that leave each joint a range")
    return margin


def _interest(content: dict[str, Any], p: int) -> Array | None:
    """Combinations (p, s) that criteria are about; None where they are about all parameters."""
    if content.get("interest") is None:
        return None
    return combinations(content["interest"], p, "setting.interest")


def _name(value: Any) -> str:
    """The name of a robot.

    Raises:
        ValueError: It is no text.
    """
    if not isinstance(value, str):
        raise ValueError("setting.robot.name: expected a text")
    return value


def _indices(value: Any, n: int, where: str) -> list[int]:
    """Different indices of joints.

    Raises:
        ValueError: They are none.
    """
    found = [whole(j, 0, n - 1, where) for j in rows(value, n, where)]
    if len(set(found)) < len(found):
        raise ValueError(f"{where}: expected each joint once")
    return found
