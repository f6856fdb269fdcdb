"""Commands that keep the robot accurate under its task's load, with what they leave."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.refused_rows import RefusedRow
from edtk.model.assumed_joint import AssumedJoint
from edtk.model.rigid_joints import RigidJoint, rigid_joints_in_words
from edtk.model.robot import Robot
from edtk.system.atomic_file import write_text
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices
from edtk.tables.csv_text import csv_text
from edtk.tables.pose_columns import pose_columns
from edtk.tables.pose_table import WRENCH_COLUMNS, pose_factors
from edtk.tables.sheet_columns import (
    BAND_COLUMNS,
    PART_COLUMNS,
    REMAINING_COLUMN,
    REMAINING_ROTATION_COLUMN,
    ROW_COLUMN,
    UNCOMPENSATED_COLUMN,
)

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Compensation(Presented):
    """Commands for some task poses, with the errors before and after.

    Attributes:
        robot: The chain with the task's tool; of several tools with the first one's.
        desired: Joint variables (t, n) under load [rad or m].
        wrench: Task wrenches (t, 6) [N, N m].
        command: Joint variables (t, n) to command [rad or m].
        uncompensated: Distance (t,) of the loaded tool point from the desired one, were `desired`
            commanded [m].
        remaining: Root mean square (t,) of the error that is left in all: by wrong compliances, Eq.
            (17), whatever made them wrong, by joints that are not identified, and by the linear
            model where that is known [m]; None if it is not known.
        band: Its 2.5 % and 97.5 % quantiles (t, 2) [m]; None if they are not known.
        linear: Length (t,) of the mean error by which identifying with the linear model is off
            [m]; None if it is not known, and then not part of the others.
        rho0_bias: The same in the test pose [m]; None if it is not known.
        rigid_joints: Joints that count as rigid although the load turns them.
        verdict: "good", "usable" or "bad", as the identification rated the compliances; None if it
            is not known.
        rotation: Root mean square (t,) of the rotation that wrong compliances leave [rad]; None
            unless the test pose has a lever at which rotations count, or if it is not known.
        rows: Rows (t,) of the task that these are, counted from 0.
        refused: Rows of the task that have no answer.
        by_noise: What the noise of the measurements alone makes of it (t,) [m]; None likewise.
        by_joints: The joints that are not identified, and what each makes of it (t,) [m].
        doubts: What looks like another unit in the task or the compliances, a sentence each.
    """

    robot: Robot
    desired: Array
    wrench: Array
    command: Array
    uncompensated: Array
    remaining: Array | None
    band: Array | None
    rows: Indices
    linear: Array | None = None
    rho0_bias: float | None = None
    rigid_joints: tuple[RigidJoint, ...] = ()
    verdict: str | None = None
    rotation: Array | None = None
    refused: tuple[RefusedRow, ...] = ()
    by_noise: Array | None = None
    by_joints: tuple[tuple[AssumedJoint, Array], ...] = ()
    doubts: tuple[str, ...] = ()

    @classmethod
    def joined(
        cls, parts: "Sequence[Compensation]", refused: Sequence[RefusedRow]
    ) -> "Compensation":
        """The commands for several tools, each in its own rows.

        Args:
            parts: Commands for each tool, of the same compliances.
            refused: Rows without commands.
        """
        first = parts[0]
        if len(parts) == 1:
            return replace(first, refused=tuple(refused))
        order = np.argsort(np.concatenate([part.rows for part in parts]))

        def all_of(name: str) -> Any:
            """One column of all parts; None where it is not known."""
            each = [getattr(part, name) for part in parts]
            return None if each[0] is None else np.concatenate(each)[order]

        most: dict[str, RigidJoint] = {}
        for joint in sorted(
            (joint for part in parts for joint in part.rigid_joints),
            key=lambda joint: joint.displacement,
        ):
            most[joint.name] = joint
        names = first.robot.joint_names
        return cls(
            robot=first.robot,
            desired=all_of("desired"),
            wrench=all_of("wrench"),
            command=all_of("command"),
            uncompensated=all_of("uncompensated"),
            remaining=all_of("remaining"),
            band=all_of("band"),
            linear=all_of("linear"),
            rho0_bias=first.rho0_bias,
            rigid_joints=tuple(most[name] for name in names if name in most),
            verdict=first.verdict,
            rotation=all_of("rotation"),
            rows=all_of("rows"),
            refused=tuple(refused),
            by_noise=all_of("by_noise"),
            by_joints=tuple(
                (joint, np.concatenate([part.by_joints[j][1] for part in parts])[order])
                for j, (joint, _) in enumerate(first.by_joints)
            ),
        )

    @property
    def by_assumed(self) -> Array:
        """What joints that are not identified make of the remaining error, together (t,) [m]."""
        squares = [error**2 for _, error in self.by_joints]
        return np.sqrt(np.sum(squares, axis=0)) if squares else np.zeros(len(self.command))

    @property
    def rigid(self) -> str:
        """Which joints count as rigid although the load turns them, in words."""
        return rigid_joints_in_words(self.rigid_joints)

    def headline(self) -> str:
        """Number of poses, and the largest error before and after."""
        before = f"{1e3 * self.uncompensated.max():.3g} mm"
        after = "unknown"
        if self.remaining is not None:
            after = f"{1e3 * self.remaining.max():.3g} mm"
        left_out = f" ({len(self.refused)} left out)" if self.refused else ""
        poses = f"{len(self.command)} task pose{'s' * (len(self.command) != 1)}{left_out}"
        return f"{poses}, largest error {before} before, {after} after"

    def to_frame(self) -> "pd.DataFrame":
        """Commands, wrenches and errors: degrees, millimetres, newtons and newton metres.

        Where rows of the task are left out, the first column is the row there.
        """
        import pandas as pd

        degrees = self.robot.shown(self.command) / pose_factors(self.robot)
        table = pd.DataFrame(degrees, columns=list(pose_columns(self.robot)))
        table[list(WRENCH_COLUMNS)] = self.wrench
        table[UNCOMPENSATED_COLUMN] = 1e3 * self.uncompensated
        if self.remaining is not None and self.band is not None:
            table[REMAINING_COLUMN] = 1e3 * self.remaining
            table[list(BAND_COLUMNS)] = 1e3 * self.band
        if self.by_noise is not None:
            table[list(PART_COLUMNS)] = 1e3 * np.stack([self.by_noise, self.by_assumed], axis=1)
        if self.rotation is not None:
            table[REMAINING_ROTATION_COLUMN] = np.rad2deg(self.rotation)
        if self.refused:
            table.insert(0, ROW_COLUMN, self.rows + 1)
        return table

    def to_csv(self, path: Path | str) -> None:
        """Write the table to a file, whole or not at all, or to standard output (`-`)."""
        write_text(path, csv_text(self.to_frame()))

    def to_dict(self) -> list[dict[str, Any]]:
        """One object per task pose, in SI units, but `q_deg` in degrees and millimetres.

        `row` is the pose's row in the task, from 1; rows that are left out are not here. An error
        that is not known is null.
        """
        degrees = self.robot.shown(self.command) / pose_factors(self.robot)
        unknown = [None] * len(self.command)
        remaining = unknown if self.remaining is None else self.remaining.tolist()
        band = unknown if self.band is None else self.band.tolist()
        linear = unknown if self.linear is None else self.linear.tolist()
        by_noise = unknown if self.by_noise is None else self.by_noise.tolist()
        by_assumed = unknown if self.by_noise is None else self.by_assumed.tolist()
        rotation = [] if self.rotation is None else self.rotation.tolist()
        return [
            {
                "row": int(self.rows[i]) + 1,
                "q": self.command[i].tolist(),
                "q_deg": degrees[i].tolist(),
                "desired_q": self.desired[i].tolist(),
                "wrench": self.wrench[i].tolist(),
                "uncompensated": float(self.uncompensated[i]),
                "remaining_rms": remaining[i],
                "remaining_band": band[i],
                "linear_model": linear[i],
                "remaining_by_noise": by_noise[i],
                "remaining_by_assumed_joints": by_assumed[i],
                **({"remaining_rotation_rms": rotation[i]} if rotation else {}),
            }
            for i in range(len(self.command))
        ]
