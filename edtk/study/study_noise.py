"""The noise of a study's measurements, where it is not white."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.model.noise.visit_noise import VisitNoise
from edtk.model.sensors.distance import Distance
from edtk.study.study_model import study_sigma
from edtk.tables.pose_table import pose_factors

if TYPE_CHECKING:
    from edtk.study.study_objects import StudyObjects

READINGS = {"unloaded": 2, "nominal": 1}  # by what a displacement is measured from


def study_noise(study: "StudyObjects") -> VisitNoise | None:
    """Build the noise of the rows that the model of a study has; None where it is white.

    Tracker and discrepancy concern lengths. Rotations have the noise of `measurement.sigma_deg`,
    and distances that of their own instrument, besides what the joints do to both.

    Args:
        study: Its keys, its robot and its model, checked.
    """
    table = study.specification.noise
    if table is None or table.is_white:
        return None
    tracker = table.tracker()
    lengths: list[bool] = []
    tracked: list[tuple[int, int]] = []
    for point, sensor in enumerate(study.model.whole_instruments):
        if tracker is not None and not isinstance(sensor, Distance):
            tracked.append((point, len(lengths)))
        lengths += sensor.lengths.tolist()
    return VisitNoise(
        tracker=tracker,
        tracked=tuple(tracked),
        repeatability=table.repeatability(pose_factors(study.robot)),
        white=study_sigma(study),
        discrepancy=np.where(lengths, table.discrepancy_mm / 1e3, 0.0),
        within=float(np.deg2rad(table.discrepancy_within_deg)),
        readings=READINGS[study.specification.measurement.reference],
    )
