"""The design space of a study."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.design.design_space import DesignSpace
from edtk.design.plan import Plan
from edtk.model.constraints.excluded import Excluded
from edtk.model.joint_margin import within_margin
from edtk.model.loads.load import Load
from edtk.model.robot import Robot
from edtk.model.workspace import Workspace
from edtk.study.load_plan import read_plan
from edtk.study.study_model import study_sigma
from edtk.system.typing import Array

if TYPE_CHECKING:
    from edtk.study.study import Study

NO_WRENCH = np.zeros(6)  # of poses to stay away from, whatever their load


def study_space(study: "Study") -> DesignSpace:
    """Build the design space of a study: model, feasible set, noise, loads and free joints.

    Raises:
        UserError: A file of excluded poses cannot be read, or the study is about geometry too.
    """
    study.require_compliances_alone()
    return pose_space(study, study.specification.build_load())


def pose_space(study: "Study", load: Load) -> DesignSpace:
    """The same with loads of the caller's choice, whatever is unknown.

    Args:
        study: The study.
        load: The wrenches that may be applied.

    Raises:
        UserError: A file of excluded poses cannot be read.
    """
    fixed = study.fixed
    values = np.array([fixed.get(j, 0.0) for j in range(study.robot.n)])
    free = [j for j in range(study.robot.n) if j not in fixed]
    constraints = (*study.specification.workspace.build(), *_exclusions(study))
    workspace = Workspace(_within_margin(study), constraints)
    sigma = study_sigma(study)
    return DesignSpace(study.model, workspace, sigma, load, free, values, noise=study.noise)


def _within_margin(study: "Study") -> Robot:
    """The robot, whose joints keep their margin from the limits.

    Raises:
        UserError: A joint has no range left.
    """
    margin = study.specification.joints.margin()
    try:
        return within_margin(study.robot, margin, frozenset(study.fixed))
    except ValueError as error:
        raise study.error("joints.margin_deg", str(error)) from error


def _exclusions(study: "Study") -> list[Excluded]:
    """Distances from the poses that plans keep away from, a constraint for each file or plan."""
    workspace = study.specification.workspace
    plans = [read_plan(study, study.folder / name, NO_WRENCH) for name in workspace.excluded]
    if isinstance(study.excluded, Plan):
        plans.append(study.excluded)
    elif study.excluded is not None:
        plans.append(read_plan(study, study.excluded, NO_WRENCH))
    within = float(np.deg2rad(workspace.excluded_within_deg))
    return [Excluded(_distinct(plan.q), within) for plan in plans]


def _distinct(q: Array) -> Array:
    """Poses (m, n) without those that came before: a sheet has each as often as it was visited."""
    _, first = np.unique(q, axis=0, return_index=True)
    return q[np.sort(first)]
