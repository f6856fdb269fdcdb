"""Which experiment of a plan each measurement is one of."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from edtk.design.plan import Plan
from edtk.inference.measurements import Measurements, row_numbers
from edtk.study.study import Study
from edtk.tables.pose_table import pose_factors

Array = NDArray[np.float64]
Indices = NDArray[np.int_]
OTHER_LOAD = 0.25  # of the planned one: what is farther off is another load


@dataclass(frozen=True, eq=False)
class PlanMatch:
    """Measurements beside the experiments of a plan, both counted from 0.

    Attributes:
        pose: Planned experiment (m,) whose pose is nearest.
        distance: How far that is (m,), in the joint where it is farthest [deg, mm].
        experiment: Of the planned experiments in that pose, the one (m,) whose force has the most similar direction.
        missing: Planned experiments (k,) that no measurement is one of.
    """

    pose: Indices
    distance: Array
    experiment: Indices
    missing: Indices


def match_plan(study: Study, data: Measurements, plan: Plan) -> PlanMatch:
    """Find each measurement's experiment by its pose, then by its load: the planned one nearest to what was applied.

    Where none of those planned in the pose is near, as with forces in another unit, the direction tells.
    """
    factors, within = pose_factors(study.robot), resolution_of(study)
    tree, measured = cKDTree(plan.q / factors), data.q / factors
    distance, pose = tree.query(measured, p=np.inf)
    experiment = pose.copy()
    several = np.flatnonzero(
        tree.query_ball_point(measured, within, p=np.inf, return_length=True) > 1
    )
    for row, here in zip(
        several, tree.query_ball_point(measured[several], within, p=np.inf), strict=True
    ):
        plan_study = np.array(sorted(here))
        W, loads = data.wrench[row], plan.wrench[plan_study]
        off = np.linalg.norm(loads - W, axis=1)
        if off.min() > OTHER_LOAD * np.linalg.norm(loads[off.argmin()]):
            off = -(_direction(loads) @ _direction(W[None])[0])
        experiment[row] = plan_study[off.argmin()]
    whole = row_numbers(plan.q, plan.wrench)
    return PlanMatch(
        pose,
        distance,
        experiment,
        np.flatnonzero(~np.isin(whole, whole[experiment[distance <= within]])),
    )


def resolution_of(study: Study) -> float:
    """How far [deg, mm] a pose may be from a planned one, for the digits that a plan is printed with."""
    return max(study.specification.workspace.plan_resolution_deg, 1e-3) * (1 + 1e-9)


def _direction(wrench: Array) -> Array:
    """Unit wrenches (k, 6); a wrench that is zero stays so."""
    return wrench / np.maximum(np.linalg.norm(wrench, axis=1, keepdims=True), 1e-300)
