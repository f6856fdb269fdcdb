"""The worth of a plan of visits for a study of geometry."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.calibration.geometry_design.poses_by_load import PosesByLoad
from edtk.model.geometry.geometric_parameter import GeometricParameter
from edtk.study.criteria_frame import criteria_frame
from edtk.system.presented import Presented
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class GeometryEvaluation(Presented):
    """What a plan tells, and how well; parameters in their own units (mm, mrad, 1e-6 rad/(N m)).

    Attributes:
        question: The question of the study.
        poses: The poses with their visits by load.
        criteria: Value of every criterion that applies, by name; rho0 and rho_max in metres. None
            but these where parameters are open.
        observability_unscaled: O1 to O5 from the singular values of the rows in millimetres and
            milliradians.
        covariance: Covariance (r, r) of the parameters that the plan tells.
        parameters: These parameters (r,).
        open: A sentence for each parameter that feasible poses could tell, and this plan does not.
        rho0: Error of the markers to expect in the test poses [m]; None without any, or where it
            depends on an open parameter.
        skipped: Why criteria have no value, by name.
        warnings: What is hard to believe in the study, a line each.
    """

    question: GeometryQuestion
    poses: PosesByLoad
    criteria: dict[str, float]
    observability_unscaled: dict[str, float]
    covariance: Array
    parameters: tuple[GeometricParameter, ...]
    open: tuple[str, ...]
    rho0: float | None
    skipped: dict[str, str]
    warnings: tuple[str, ...]

    def headline(self) -> str:
        """Number of visits, and how many parameters they tell."""
        rho0 = "" if self.rho0 is None else f", rho0 {1e3 * self.rho0:.4g} mm"
        return (
            f"{self.experiments} visits tell {self.rank} of {self.question.model.p} parameters "
            f"apart{rho0}"
        )

    @property
    def experiments(self) -> int:
        """Number of visits."""
        return int(self.poses.visits.sum())

    @property
    def rank(self) -> int:
        """Number of parameters that the plan tells apart."""
        return len(self.parameters)

    @cached_property
    def std(self) -> Array:
        """Standard deviations (r,) in the parameters' units."""
        return np.sqrt(np.diag(self.covariance))

    def to_frame(self) -> "pd.DataFrame":
        """A table with a criterion a row, by name: value, sense, title and formula."""
        return criteria_frame(self.criteria)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        names = [one.name for one in self.parameters]
        return {
            "criteria": self.criteria,
            "observability_unscaled": self.observability_unscaled,
            "std": dict(zip(names, self.std.tolist(), strict=True)),
            "covariance": self.covariance.tolist(),
            "parameters": names,
            "units": [one.unit for one in self.parameters],
            "experiments": self.experiments,
            "rank": self.rank,
            "possible_rank": self.question.model.p,
            "structural_rank": self.question.structural.p,
            "open": list(self.open),
            "untold": list(self.question.untold),
            "rho0_mm": None if self.rho0 is None else 1e3 * self.rho0,
            "loads": self.poses.wrenches.tolist(),
            "poses": self.poses.to_list(),
            "skipped": self.skipped,
            "warnings": list(self.warnings),
        }
