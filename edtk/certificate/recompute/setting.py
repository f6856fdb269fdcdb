"""The setting of a design that a certificate states: robot, load, noise, limits, test pose."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.chain import Chain
from edtk.certificate.recompute.load import Load
from edtk.certificate.recompute.neighbourhood import neighbourhood
from edtk.certificate.recompute.plain_data import number, numbers, rows, table, text, whole
from edtk.certificate.recompute.workspace import Workspace
from edtk.system.typing import Array, Mask

TINY = 1e-9  # violation of a constraint that is rounding [m or rad]
MEASURED = {"position": 3, "pose": 6}  # rows that an experiment measures
LONGEST_LEVER = 1e3  # of rotations that count as displacements [m]
KEYS = ("robot", "unknown", "rows", "sigma", "load", "workspace", "excluded", "free", "fixed")


@dataclass(frozen=True, eq=False)
class Setting:
    """All that the information of an experiment depends on.

    Attributes:
        name: Name of the robot.
        chain: Robot with the calibration tool.
        unknown: Indices (p,) of the joints whose compliances are the parameters.
        sigma: Standard deviation of each measured row (3,) or (6,) [m, rad].
        workspace: Constraints on poses.
        load: Loads that may be applied.
        free: Indices of the joints that are designed.
        fixed: Joint variables (n,) whose entries outside `free` are kept [rad or m].
        target: Target (r, p) of rho0, from the test pose; None without one.
    """

    name: str
    chain: Chain
    unknown: list[int]
    sigma: Array
    workspace: Workspace
    load: Load
    free: list[int]
    fixed: Array
    target: Array | None

    @classmethod
    def from_dict(cls, content: Any) -> "Setting":
        """Read the setting from the part `setting` of a certificate.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        content = table(content, (*KEYS, "test_pose"), "setting")
        chain = Chain.from_dict(content["robot"])
        n = len(chain.axes)
        unknown = _indices(content["unknown"], n, "setting.unknown")
        measured = MEASURED[text(content["rows"], MEASURED, "setting.rows")]
        sigma = numbers(content["sigma"], (measured,), "setting.sigma")
        if not unknown or not (sigma > 0).all():
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
            target=_target(content, unknown),
        )

    def whitened_rows(self, q: Array, wrench: Array) -> Array:
        """Regressors over sigma (k, rows, p) of poses q (k, n) with wrenches (k, 6)."""
        A = _regressors(self.chain, self.unknown, q, wrench)
        return A[:, : len(self.sigma)] / self.sigma[:, None]

    def violation(self, q: Array) -> Array:
        """By how much each pose (k,) violates its worst constraint [m or rad].

        It is at most 0 if the pose is feasible. A joint that is not designed has to stay where it
        is fixed; poses that are drawn obey that.
        """
        moved = np.abs(q - self.fixed)
        moved[:, self.free] = 0.0
        return np.asarray(np.maximum(self.workspace.violation(q), moved.max(axis=1)))

    def feasible(self, x: Array) -> Mask:
        """Whether each experiment x (k, n + d) is allowed, but for rounding."""
        n = len(self.fixed)
        return (self.violation(x[:, :n]) <= TINY) & self.load.allows(x[:, n:])


def _target(content: dict[str, Any], unknown: list[int]) -> Array | None:
    """Target (r, p) of rho0 with the tool of the task: the squares of its rows are the harm.

    For a test pose alone it is the regressor A0. Over a neighbourhood it has the rows of all its
    poses, divided by the root of their number. Rotation rows count with the lever, if there is one.
    """
    if content["test_pose"] is None:
        return None
    where = "setting.test_pose"
    task = table(content["test_pose"], ("q", "tool", "wrench"), where, ("within", "lever"))
    chain = Chain.from_dict(content["robot"] | {"tool": task["tool"]})
    q = numbers(task["q"], (len(chain.axes),), f"{where}.q")
    wrench = numbers(task["wrench"], (6,), f"{where}.wrench")
    within = number(task.get("within", 0.0), f"{where}.within")
    lever = number(task.get("lever", 0.0), f"{where}.lever")
    if not 0 <= within <= np.pi or not 0 <= lever <= LONGEST_LEVER:
        raise ValueError(f"{where}: expected an angle within half a turn, and a lever in metres")
    poses = neighbourhood(chain, q, within) if within else q[None]
    A = _regressors(chain, unknown, poses, np.tile(wrench, (len(poses), 1)))
    scale = np.array([1.0, 1.0, 1.0, lever, lever, lever])
    rows_of_all = (A * scale[:, None])[:, : 6 if lever else 3]
    return np.concatenate(rows_of_all) / np.sqrt(len(poses))


def _regressors(chain: Chain, unknown: list[int], q: Array, wrench: Array) -> Array:
    """Regressors (k, 6, p), Eq. (4): each column of the Jacobian times its torque ``J_j' W``."""
    columns = chain.jacobian(q)[:, :, unknown]
    torque = np.einsum("krp,kr->kp", columns, wrench)
    return np.asarray(columns * torque[:, None])


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
