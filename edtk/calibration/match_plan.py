"""Which experiment of a plan each measurement is one of."""

from dataclasses import dataclass

import numpy as np

from edtk.calibration.pose_resolution import pose_resolution
from edtk.design.plan import Plan
from edtk.inference.measurements import Measurements
from edtk.inference.row_numbers import row_numbers
from edtk.study.study import Study
from edtk.system.typing import Array, Indices
from edtk.tables.pose_table import pose_factors

OTHER_LOAD = 0.25  # of the planned load: an applied load that is farther off is another one


@dataclass(frozen=True, eq=False)
class PlanMatch:
    """Measurements beside the experiments of a plan, both counted from 0.

    Attributes:
        pose: Planned experiment (m,) whose pose is nearest.
        distance: How far that is (m,), in the joint where it is farthest [deg, mm].
        experiment: Of the planned experiments in that pose, the one (m,) whose load is the most
            similar.
        missing: Planned experiments (k,) that no measurement is one of.
        within: How far apart two poses are the same [deg, mm].
    """

    pose: Indices
    distance: Array
    experiment: Indices
    missing: Indices
    within: float


def match_plan(study: Study, data: Measurements, plan: Plan) -> PlanMatch:
    """Find each measurement's experiment by its pose, and among several in one pose by its load.

    Args:
        study: Says, with the digits of the sheet, how far apart two poses are the same; see
            `pose_resolution`.
        data: The measurements.
        plan: The plan that was to be carried out.
    """
    from scipy.spatial import cKDTree

    factors = pose_factors(study.robot)
    within = pose_resolution(study, data)
    tree = cKDTree(study.robot.shown(plan.q) / factors)
    measured = study.robot.shown(data.q) / factors
    distance, pose = tree.query(measured, p=np.inf)
    experiment = pose.copy()
    in_pose = tree.query_ball_point(measured, within, p=np.inf, return_length=True)
    several = np.flatnonzero(in_pose > 1)
    found = tree.query_ball_point(measured[several], within, p=np.inf)
    for row, planned in zip(several, found, strict=True):
        candidates = np.array(sorted(planned))
        nearest = _most_similar(plan.wrench[candidates], data.wrench[row])
        experiment[row] = candidates[nearest]
    number = row_numbers(plan.q, plan.wrench)
    made = number[experiment[distance <= within]]
    missing = np.flatnonzero(~np.isin(number, made))
    return PlanMatch(pose, distance, experiment, missing, within)


def _most_similar(planned: Array, applied: Array) -> int:
    """Of planned wrenches (k, 6) the one that was applied (6,), as far as one can tell.

    That is the nearest. Where none is near, as with forces in another unit, it is the one whose
    direction is the most similar.
    """
    off = np.linalg.norm(planned - applied, axis=1)
    nearest = int(off.argmin())
    # The size of the farthest one is the scale, for the nearest may be zero.
    if off[nearest] <= OTHER_LOAD * np.linalg.norm(planned[off.argmax()]):
        return nearest
    return int((_direction(planned) @ _direction(applied[None])[0]).argmax())


def _direction(wrench: Array) -> Array:
    """Unit wrenches (k, 6); a wrench that is zero stays so."""
    return wrench / np.maximum(np.linalg.norm(wrench, axis=1, keepdims=True), 1e-300)
