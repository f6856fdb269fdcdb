"""What a plan of visits tells apart, and how well."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.calibration.geometry_design.position_rows import PositionRows
from edtk.design.plan import Plan
from edtk.inference.geometry.fit_geometry import stages
from edtk.model.geometry.identifiable import Identifiable, identifiable
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class ToldByPlan:
    """The parameters that a plan tells.

    Attributes:
        question: The question of the study.
        plan: The plan.
    """

    question: GeometryQuestion
    plan: Plan

    @cached_property
    def told(self) -> Identifiable:
        """Which parameters of the question it tells apart."""
        question = self.question
        rows = question.rows(self.plan.q, self.plan.wrench).reshape(-1, question.model.p)
        return identifiable(rows, question.model.parameters, stages(question.model))

    @cached_property
    def covariance(self) -> Array:
        """Covariance (r, r) of these parameters, in their units."""
        question = self.question
        kept = self.told.kept
        rows = PositionRows(question.model, question.setting.loads, question.setting.noise)
        A = rows(self.plan.q, self.plan.wrench)
        weighted = np.sqrt(self.plan.repeats)[:, None, None] * A[..., kept]
        # From the rows: their squares would lose half of the digits.
        R = np.linalg.qr(weighted.reshape(-1, len(kept)), mode="r")
        inverse = np.linalg.solve(R, np.eye(len(R)))
        return np.asarray(inverse @ inverse.T)
