"""Plans from files, checked against a study."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from edtk.design.plan import Plan
from edtk.model.loads.fixed_load import FixedLoad
from edtk.model.workspace import Workspace
from edtk.system.errors import UserError
from edtk.system.typing import Array

if TYPE_CHECKING:
    from edtk.study.study import Study

FEASIBLE = -1e-9  # least slack [m or rad] of a pose that counts as feasible, against rounding


def load_plan(study: "Study", path: Path | str) -> Plan:
    """Read a plan and check every pose against limits and workspace.

    A pose counts as feasible if one within the study's `plan_resolution_deg` of it is, since
    published poses are rounded. Excluded poses are feasible too: they may have been measured, and
    are only not to be planned.

    Args:
        study: The study.
        path: The plan's file (CSV).

    Raises:
        UserError: Names the file and the row.
    """
    plan = read_plan(study, path, _default_wrench(study))
    revolute = np.array([joint.kind == "revolute" for joint in study.robot.joints])
    resolution = np.deg2rad(study.specification.workspace.plan_resolution_deg) * revolute
    workspace = Workspace(study.robot, study.specification.workspace.build())
    slack = workspace.slack_within(plan.q, resolution)
    outside = (slack < FEASIBLE).any(axis=1)
    if outside.any():
        row = int(outside.argmax())
        broken = "; ".join(map(str, workspace.violations(slack[row])))
        raise UserError(f"the pose violates {broken}", where=path, key=f"row {row + 1}")
    return plan


def _default_wrench(study: "Study") -> Array | None:
    """The wrench (6,) of a pose whose row says none: the study's only load; none of geometry."""
    if study.specification.parameters is not None:
        return np.zeros(6)
    load = study.space.load
    return load.always if isinstance(load, FixedLoad) else None


def read_plan(study: "Study", path: Path | str, wrench: Array | None) -> Plan:
    """Read a plan whose poses are not checked.

    Args:
        study: The study, which names the columns and gives the values of fixed joints.
        path: The plan's file (CSV).
        wrench: Default wrench (6,) [N, N m]; None if the file must say which forces are applied.

    Raises:
        UserError: Names the file and the row or column.
    """
    return Plan.from_csv(path, study.robot, study.fixed, wrench)
