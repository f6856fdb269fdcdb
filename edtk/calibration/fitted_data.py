"""Measurements with everything that is computed from them once: regressors, fit and plan match."""

from dataclasses import dataclass
from functools import cached_property

from edtk.calibration.equal_rows import EqualRows, equal_rows
from edtk.calibration.input_errors.explanation import Explanation, explanation
from edtk.calibration.known_part import known_part
from edtk.calibration.match_plan import PlanMatch, match_plan
from edtk.design.plan import Plan
from edtk.inference.identification import Identification
from edtk.inference.identify import identify
from edtk.inference.measurements import Measurements
from edtk.study.study import Study
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class FittedData:
    """Measurements of a study, their fit, and the plan that they were to carry out.

    Attributes:
        study: The question.
        data: The measurements.
        A: Their regressors (m, rows, p).
        fit: Estimates and statistics.
        plan: The plan that was to be carried out; None if it is not known.
    """

    study: Study
    data: Measurements
    A: Array
    fit: Identification
    plan: Plan | None = None

    @classmethod
    def of(
        cls,
        study: Study,
        data: Measurements,
        plan: Plan | None = None,
        robust: bool = False,
        known: bool = True,
    ) -> "FittedData":
        """Fit a study's compliances to measurements.

        Args:
            study: The question.
            data: The measurements.
            plan: The plan that was to be carried out.
            robust: Huber's loss instead of squares.
            known: Whether the given sigma is believed, or estimated from the residuals.

        Raises:
            SingularPlanError: The measurements do not identify all parameters.
            NothingLeftError: No residuals remain to estimate sigma from.
            SigmaTooSmallError: Robust, and no residual is as small as sigma says.
        """
        A = data.regressor(study.model)
        names = study.model.parameters
        unexplained = data.deflection - known_part(study, data)
        fit = identify(A, unexplained, data.sigma, names, robust, known)
        return cls(study, data, A, fit, plan)

    @cached_property
    def unexplained(self) -> Array:
        """Displacements (m, rows) that are left to the unknown compliances [m, rad]."""
        return self.data.deflection - known_part(self.study, self.data)

    @cached_property
    def match(self) -> PlanMatch | None:
        """Which experiment of the plan each measurement is one of; None without a plan."""
        return None if self.plan is None else match_plan(self.study, self.data, self.plan)

    @cached_property
    def explanation(self) -> Explanation | None:
        """Other readings of the columns that explain a misfit; None where nothing is to explain."""
        return explanation(self.study, self.data, self.fit)

    @cached_property
    def equal_rows(self) -> EqualRows | None:
        """Rows that are the same to the last digit; None where all are different."""
        return equal_rows(self.data)
