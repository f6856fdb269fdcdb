"""The setting of a design as a certificate states it: robot, load, noise, constraints, test pose."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.chain import Chain
from edtk.system.typing import Array

TINY = 1e-9  # violation of a constraint that is rounding [m or rad]


@dataclass(frozen=True, eq=False)
class Setting:
    """All that the information of an experiment depends on.

    Attributes:
        chain: Robot with the calibration tool.
        unknown: Indices (p,) of the joints whose compliances are the parameters.
        sigma: Standard deviation of each measured row (3,) or (6,) [m, rad].
        workspace: The keys of the study's [workspace].
        excluded: Poses (e, n) to stay away from [rad or m], and the distance [rad].
        load: The keys of the study's [load].
        free: Indices of the joints that are designed.
        fixed: Joint variables (n,) whose entries outside `free` are kept [rad or m].
        target: Regressor A0 (3, p) of the test pose; None without a test pose.
    """

    chain: Chain
    unknown: list[int]
    sigma: Array
    workspace: dict[str, Any]
    excluded: list[tuple[Array, float]]
    load: dict[str, Any]
    free: list[int]
    fixed: Array
    target: Array | None

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> "Setting":
        """Read the setting from the part `setting` of a certificate.

        Raises:
            KeyError, TypeError, ValueError: A part is missing, or is not what it should be.
        """
        chain = Chain.from_dict(content["robot"])
        unknown = [int(j) for j in content["unknown"]]
        task = content["test_pose"]
        target = None
        if task is not None:
            bent = Chain.from_dict(content["robot"] | {"tool": task["tool"]})
            q = np.array([task["q"]], dtype=float)
            target = rows(bent, unknown, q, np.array([task["wrench"]], dtype=float))[0, :3]
        excluded = [
            (np.array(part["poses"], dtype=float), float(part["distance"]))
            for part in content["excluded"]
        ]
        return cls(
            chain=chain,
            unknown=unknown,
            sigma=np.array(content["sigma"], dtype=float),
            workspace=content["workspace"],
            excluded=excluded,
            load=content["load"],
            free=[int(j) for j in content["free"]],
            fixed=np.array(content["fixed"], dtype=float),
            target=target,
        )

    def whitened_rows(self, q: Array, wrench: Array) -> Array:
        """Regressors over sigma (k, rows, p) of poses q (k, n) with wrenches (k, 6)."""
        A = rows(self.chain, self.unknown, q, wrench)
        return A[:, : len(self.sigma)] / self.sigma[:, None]

    def violation(self, q: Array) -> Array:
        """By how much each pose (k,) violates its worst constraint [m or rad]; at most 0 if feasible."""
        tool, _ = self.chain.tool_pose_and_jacobian(q)
        lower, upper = self.chain.limits
        worst = np.maximum(lower - q, q - upper).max(axis=1)
        position = tool[:, :3, 3]
        height = self.workspace.get("height_min_mm")
        if height is not None:
            worst = np.maximum(worst, height / 1e3 - position[:, 2])
        radius = self.workspace.get("radius_min_mm")
        if radius is not None:
            distance = np.linalg.norm(position[:, :2], axis=1)
            worst = np.maximum(worst, radius / 1e3 - distance)
        tilt = self.workspace.get("tilt_max_deg")
        if tilt is not None:
            horizontal = np.linalg.norm(tool[:, :2, 2], axis=1)
            angle = np.abs(np.arctan2(tool[:, 2, 2], horizontal))
            worst = np.maximum(worst, angle - np.deg2rad(tilt))
        for poses, distance_rad in self.excluded:
            turn = np.angle(np.exp(1j * (q[:, None] - poses)))
            turn[..., self.chain.prismatic] = 0.0
            nearest = np.sqrt((turn**2).sum(axis=-1)).min(axis=1)
            worst = np.maximum(worst, distance_rad - nearest)
        return np.asarray(worst)

    def feasible(self, q: Array) -> Array:
        """Whether each pose (k,) satisfies every constraint, but for rounding."""
        return np.asarray(self.violation(q) <= TINY)


def rows(chain: Chain, unknown: list[int], q: Array, wrench: Array) -> Array:
    """Regressors (k, 6, p), Eq. (4): column j of the Jacobian times its joint torque ``J_j' W``."""
    _, jacobian = chain.tool_pose_and_jacobian(q)
    columns = jacobian[:, :, unknown]
    torque = np.einsum("krp,kr->kp", columns, wrench)
    return np.asarray(columns * torque[:, None])
