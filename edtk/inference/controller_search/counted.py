"""One way to count the joints, with its zeros."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.inference.controller_search.ways_to_count import WayToCount
from edtk.inference.controller_search.whole_turns import whole_turns
from edtk.model.robot import Robot
from edtk.system.typing import Array

DIGITS = 3  # of a degree or millimetre, as controllers have them
TURNS = 2 * np.pi * np.arange(-2, 3)


@dataclass(frozen=True, eq=False)
class Counted:
    """Signs, zeros and coupling of all joints.

    Attributes:
        names: Names of the joints.
        kinds: "revolute" or "prismatic".
        way: Signs and coupling.
        zero: What the controller shows at the model's zero (n,) [deg or mm].
        rms: Root mean square of the distances that the fit leaves [m].
        outside: How often a joint is beyond its limits.
        tilt: Angle by which the base is turned over beside the best way to count [rad].
    """

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    way: WayToCount
    zero: Array
    rms: float
    outside: int
    tilt: float = 0.0

    @classmethod
    def of(
        cls,
        robot: Robot,
        way: WayToCount,
        offset: Array,
        shown: Array,
        told: list[int],
        rms: float,
    ) -> "Counted":
        """Zeros of offsets o (n,) [rad, m], within the limits where whole turns allow it.

        From ``q = S (I + F) (c - z) = L c + o`` follows ``s_j o_j = -z_j - f z_m``.

        Args:
            robot: Limits and kinds.
            way: Signs and coupling.
            offset: Offsets o (n,) of ``q = L c + o``.
            shown: Poses (p, n) as the controller shows them.
            told: Joints whose zeros are told; the others' poses may be anywhere.
            rms: What the fit leaves [m].
        """
        q = shown @ way.counting.T + offset
        turning = whole_turns(robot)
        zero = np.zeros(robot.n)
        outside = 0
        for j, joint in enumerate(robot.joints):
            turns = TURNS if turning[j] else np.zeros(1)
            of_leader = 0.0
            if way.follows is not None and way.follows.joint == j:
                of_leader = way.follows.factor * zero[way.follows.leader]
            zeros = -way.sign[j] * (offset[j] + turns) - of_leader
            lower, upper = joint.limits
            values = q[:, j] + turns[:, None]
            beyond = ((values < lower) | (values > upper)).sum(axis=1) if j in told else turns * 0
            chosen = int(np.lexsort((np.abs(zeros), beyond))[0])
            zero[j] = zeros[chosen]
            outside += int(beyond[chosen])
        kinds = tuple("prismatic" if j.kind == "prismatic" else "revolute" for j in robot.joints)
        shown_zero = np.round(zero / robot.units, DIGITS) + 0.0
        return cls(robot.joint_names, kinds, way, shown_zero, rms, outside)

    @property
    def order(self) -> tuple[float, ...]:
        """Of equal ways comes first that within the limits, then that with small zeros."""
        turned = int((self.way.sign < 0).sum())
        return (self.outside, round(float(np.abs(self.zero).sum())), turned)

    def table(self) -> dict[str, Any]:
        """The keys of a table `controller`."""
        found: dict[str, Any] = {}
        sign = {name: -1 for name, one in zip(self.names, self.way.sign, strict=True) if one < 0}
        if sign:
            found["sign"] = sign
        for key, kind in (("zero_deg", "revolute"), ("zero_mm", "prismatic")):
            rows = zip(self.names, self.kinds, self.zero.tolist(), strict=True)
            zero = {name: value for name, own, value in rows if own == kind and value}
            if zero:
                found[key] = zero
        if self.way.follows is not None:
            one = self.way.follows
            leader: Any = self.names[one.leader]
            if one.factor != 1:
                leader = {"joint": leader, "factor": int(one.factor)}
            found["follows"] = {self.names[one.joint]: leader}
        return found

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers: the table, what it leaves [m], and poses beyond the limits."""
        return {
            "controller": self.table(),
            "rms": self.rms,
            "outside_limits": self.outside,
            "base_tilt": self.tilt,
        }
