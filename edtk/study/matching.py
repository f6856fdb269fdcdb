"""Which experiment of a plan each measurement is one of."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from edtk.design import Plan, pose_factors
from edtk.inference import Measurements
from edtk.inference.measurements import row_numbers
from edtk.study.study import Study

Array = NDArray[np.float64]
Indices = NDArray[np.int_]


@dataclass(frozen=True, eq=False)
class Matching:
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


def matching(study: Study, data: Measurements, plan: Plan) -> Matching:
    """Find each measurement's experiment by its pose, then by the direction of its force."""
    factors = pose_factors(study.robot)
    distance, pose = cKDTree(plan.q / factors).query(data.q / factors, p=np.inf)
    experiment = pose.copy()
    group, whole = row_numbers(plan.q), row_numbers(plan.q, plan.wrench)
    order = np.argsort(group[pose], kind="stable")
    rows_of = np.split(order, np.cumsum(np.bincount(group[pose], minlength=group.max() + 1))[:-1])
    planned_of = np.split(np.argsort(group, kind="stable"), np.cumsum(np.bincount(group))[:-1])
    for rows, planned in zip(rows_of, planned_of, strict=True):
        if len(rows) and len(planned) > 1:
            alike = _direction(data.wrench[rows]) @ _direction(plan.wrench[planned]).T
            experiment[rows] = planned[alike.argmax(axis=1)]
    made = whole[experiment[distance <= resolution_of(study)]]
    return Matching(pose, distance, experiment, np.flatnonzero(~np.isin(whole, made)))


def resolution_of(study: Study) -> float:
    """How far [deg, mm] a pose may be from a planned one, for the digits that a plan is printed with."""
    return max(study.file.workspace.plan_resolution_deg, 1e-3) * (1 + 1e-9)


def _direction(wrench: Array) -> Array:
    """Unit wrenches (k, 6); a wrench that is zero stays so."""
    return wrench / np.maximum(np.linalg.norm(wrench, axis=1, keepdims=True), 1e-300)
