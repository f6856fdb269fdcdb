"""The constraints on poses that a certificate states."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.chain import Chain
from edtk.certificate.recompute.plain_data import number, numbers, rows, table
from edtk.system.typing import Array

BOUNDS = ("height_min_mm", "radius_min_mm", "tilt_max_deg")
OTHERS = ("plan_resolution_deg", "excluded", "excluded_within_deg")
MOST_EXCLUDED = 1000  # poses to stay away from: each candidate is compared with all of them
STEP = 1e-6  # of a difference quotient [rad or m]; its error, about 1e-10, is far below a rounding


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
    """

    chain: Chain
    height: float | None
    radius: float | None
    tilt: float | None
    resolution: Array
    excluded: Array
    distance: float

    @classmethod
    def from_dict(cls, chain: Chain, keys: Any, excluded: Any) -> "Workspace":
        """Read the keys of a study's [workspace], and the poses that it excludes.

        Raises:
            ValueError: A key is unknown, or the excluded poses are not those that it speaks of.
        """
        where = "setting.workspace"
        keys = table(keys, (), where, (*BOUNDS, *OTHERS))
        height, radius, tilt = (
            None if name not in keys else number(keys[name], f"{where}.{name}") for name in BOUNDS
        )
        resolution = number(keys.get("plan_resolution_deg", 0.0), f"{where}.plan_resolution_deg")
        within = number(keys.get("excluded_within_deg", 5.0), f"{where}.excluded_within_deg")
        if resolution < 0 or within <= 0:
            raise ValueError(f"{where}: expected a resolution and a distance that are not negative")
        names = rows(keys.get("excluded", []), MOST_EXCLUDED, f"{where}.excluded")
        poses = _excluded(excluded, chain.n, float(np.deg2rad(within)), len(names))
        return cls(
            chain=chain,
            height=None if height is None else height / 1e3,
            radius=None if radius is None else radius / 1e3,
            tilt=None if tilt is None else float(np.deg2rad(tilt)),
            resolution=np.where(chain.prismatic, 0.0, np.deg2rad(resolution)),
            excluded=poses,
            distance=float(np.deg2rad(within)),
        )

    def violation(self, q: Array) -> Array:
        """By how much each pose (k,) violates its worst constraint [m or rad]."""
        worst = self._violations(q).max(axis=1)
        if len(self.excluded):
            worst = np.maximum(worst, self.distance - self._nearest(q))
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

    def _violations(self, q: Array) -> Array:
        """Violations (k, c) of the joint limits and the bounds on the tool [m or rad]."""
        ending = ~self.chain.endless
        lower, upper = self.chain.limits[:, ending]
        found = [lower - q[:, ending], q[:, ending] - upper]
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
