"""The poses of a plan, each once, with its visits under each load."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.design.plan import Plan
from edtk.model.robot import Robot
from edtk.system.typing import Array, Indices
from edtk.tables.in_file_units import in_file_units

DIGITS = 9  # of joint variables: rounding must not make two poses of one


@dataclass(frozen=True, eq=False)
class PosesByLoad:
    """Poses and how often each is visited under each load.

    Attributes:
        q: Joint variables (k, n) [rad or m].
        visits: Number of visits (k, s).
        wrenches: The loads (s, 6), none first [N, N m].
        robot: The robot, which says the units of the joints.
    """

    q: Array
    visits: Indices
    wrenches: Array
    robot: Robot

    @classmethod
    def of(cls, plan: Plan, wrenches: Array, robot: Robot) -> "PosesByLoad":
        """The poses of a plan: without a load first, then both, then loaded alone.

        Args:
            plan: The plan.
            wrenches: Loads that come first (s, 6); others of the plan follow.
            robot: The robot.
        """
        every = np.concatenate([wrenches, plan.wrench])
        first = np.sort(np.unique(every, axis=0, return_index=True)[1])
        loads = every[first]
        which = np.array([int(np.flatnonzero((loads == W).all(axis=1))[0]) for W in plan.wrench])
        _, start, pose = np.unique(
            np.round(plan.q, DIGITS) + 0.0, axis=0, return_index=True, return_inverse=True
        )
        visits = np.zeros((len(start), len(loads)), dtype=int)
        np.add.at(visits, (pose.reshape(-1), which), plan.repeats)
        kind = np.where(visits[:, 0] == 0, 2, (visits[:, 1:].any(axis=1)).astype(int))
        order = np.lexsort((start, kind))
        return cls(plan.q[start][order], visits[order], loads, robot)

    def visits_of(self, plan: Plan) -> Indices:
        """How many of the visits of each pose (k,) are those of a part of the plan."""
        same = (np.abs(plan.q[:, None] - self.q) <= 10.0**-DIGITS).all(axis=-1)
        return np.asarray((same * plan.repeats[:, None]).sum(axis=0))

    def to_list(self) -> list[dict[str, Any]]:
        """Plain numbers: each pose as files have it [deg, mm], and its visits by load."""
        shown = in_file_units(self.robot, self.q)
        return [
            {
                "q_deg": q.tolist(),
                "unloaded": int(own[0]),
                "loaded": int(own[1:].sum()),
                "visits": own.tolist(),
            }
            for q, own in zip(shown, self.visits, strict=True)
        ]
