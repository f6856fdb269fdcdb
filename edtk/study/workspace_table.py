"""Constraints on the calibration poses, as a study's table `workspace`."""

from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, Field

from edtk.model.constraints.constraint import Constraint
from edtk.model.constraints.height import Height
from edtk.model.constraints.radius import Radius
from edtk.model.constraints.tilt import Tilt
from edtk.study.listed import listed
from edtk.study.table import Positive, Table
from edtk.system.finite import Finite


class WorkspaceTable(Table):
    """Constraints on the calibration poses, besides the joint limits."""

    height_min_mm: Finite | None = Field(
        None, description="Least height of the tool point above the world's origin [mm]"
    )
    radius_min_mm: Positive | None = Field(
        None, description="Least distance of the tool point from the world's z-axis [mm]"
    )
    tilt_max_deg: Annotated[Positive, Field(le=90)] | None = Field(
        None, description="Largest angle of the tool's z-axis to the horizontal plane [deg]"
    )
    plan_resolution_deg: Annotated[Finite, Field(ge=0)] = Field(
        0.0, description="Rounding of plans that are read: a pose is feasible within it [deg]"
    )
    excluded: Annotated[tuple[str, ...], BeforeValidator(listed)] = Field(
        (),
        description="Plan (CSV), or list of plans, of poses that plans keep away from; paths "
        "beside the study",
    )
    excluded_within_deg: Positive = Field(
        5.0,
        description="Least distance from each excluded pose, Euclidean over the revolute joints "
        "[deg]",
    )

    def build(self) -> tuple[Constraint, ...]:
        """The constraints that are given [m, rad]; excluded poses are no part of them."""
        found: list[Constraint] = []
        if self.height_min_mm is not None:
            found.append(Height(self.height_min_mm / 1e3))
        if self.radius_min_mm is not None:
            found.append(Radius(self.radius_min_mm / 1e3))
        if self.tilt_max_deg is not None:
            found.append(Tilt(float(np.deg2rad(self.tilt_max_deg))))
        return tuple(found)
