"""The setting of a design that a certificate states: robot, load, noise, limits, test pose."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.chain import Chain
from edtk.certificate.recompute.combinations import combinations
from edtk.certificate.recompute.geometry import Geometry
from edtk.certificate.recompute.load import Load
from edtk.certificate.recompute.noise import Noise
from edtk.certificate.recompute.physics import Physics
from edtk.certificate.recompute.plain_data import numbers, rows, table, text, whole
from edtk.certificate.recompute.regressors import regressors
from edtk.certificate.recompute.tasks import Tasks
from edtk.certificate.recompute.workspace import Workspace
from edtk.system.typing import Array, Mask

BLOCK = 3_000_000  # numbers in an array that lies between poses and rows
TINY = 1e-9  # violation of a constraint that is rounding [m or rad]
MEASURED = {"position": 3, "pose": 6}  # rows that an experiment measures
KEYS = ("robot", "unknown", "rows", "sigma", "load", "workspace", "excluded", "free", "fixed")
OPTIONAL = ("physics", "noise", "interest", "prior", "geometry", "margin")


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

    @classmethod
    def from_dict(cls, content: Any) -> "Setting":
        """Read the setting from the part `setting` of a certificate.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        content = table(content, (*KEYS, "test_pose"), "setting", OPTIONAL)
        chain = Chain.from_dict(content["robot"])
        n = chain.n
        unknown = _indices(content["unknown"], n, "setting.unknown")
        kind = text(content["rows"], MEASURED, "setting.rows")
        measured = MEASURED[kind]
        physics = None
        if "physics" in content:
            physics = Physics.from_dict(content["physics"], len(chain.axes))
            measured = physics.measured
        sigma = numbers(content["sigma"], (measured,), "setting.sigma")
        noise = None
        if "noise" in content:
            noise = Noise.from_dict(content["noise"], n, measured)
            physics = physics or Physics.at_tool_point(kind)
        geometry = None
        if "geometry" in content:
            if physics is None:
                raise ValueError("setting: the key 'physics' is missing")
            geometry = Geometry.from_dict(content["geometry"], chain, physics)
        p = len(unknown) if geometry is None else geometry.p
        white = (sigma > 0).all() or (noise is not None and (sigma >= 0).all())
        if not p or not white:
            raise ValueError("setting: expected an unknown joint, and sigmas above zero")
        return cls(
            name=_name(content["robot"]["name"]),
            chain=chain,
            unknown=unknown,
            sigma=sigma,
            workspace=Workspace.from_dict(chain, content["workspace"], content["excluded"]),
            load=Load.from_dict(content["load"]),
            free=_indices(content["free"], n, "setting.free"),
            fixed=numbers(content["fixed"], (n,), "setting.fixed"),
            tasks=_tasks(content, chain, physics, geometry, unknown),
            physics=physics,
            interest=_interest(content, p),
            prior=_prior(content, p),
            noise=noise,
            geometry=geometry,
            margin=_margin(content, chain),
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
        return len(self.unknown) if self.geometry is None else self.geometry.p

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters (p,)."""
        if self.geometry is None:
            return tuple(f"k{j + 1}" for j in self.unknown)
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
        A = np.concatenate(blocks)
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
            if self.noise is None:
                return A / self.sigma[:, None]
            visits = np.ones(len(q)) if visits is None else visits
            return self.noise.whitened(A, self.chain, self.physics, self.sigma, q, visits)
        A = regressors(self.chain, self.unknown, q, wrench)
        return A[:, : len(self.sigma)] / self.sigma[:, None]

    def _regressors(self, physics: Physics, q: Array, wrench: Array) -> Array:
        """Regressors (k, rows, p) of what is measured."""
        if self.geometry is not None:
            return self.geometry.rows(self.chain, physics, q, wrench)
        return physics.regressors(self.chain, self.unknown, q, wrench)

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


def _some(values: Array | None, some: slice) -> Array | None:
    """Some of the values, if there are any."""
    return None if values is None else values[some]


def _tasks(
    content: dict[str, Any],
    chain: Chain,
    physics: Physics | None,
    geometry: Geometry | None,
    unknown: list[int],
) -> Tasks:
    """The tasks: of the tool point under a load, or of all markers where geometry is unknown."""
    if geometry is None or physics is None:
        return Tasks.from_content(content["test_pose"], content["robot"], unknown)
    return Tasks.of_markers(content["test_pose"], chain, physics, geometry)


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
