"""The fit of measurements that are read in one way: a name, a size and a likelihood."""

from dataclasses import dataclass

import numpy as np

from edtk.calibration.input_errors.reading import Reading
from edtk.calibration.known_part import known_part
from edtk.calibration.nonlinear_part import nonlinear_part
from edtk.inference.distributions import chi_square_tail
from edtk.inference.least_squares import SingularPlanError, Whitened
from edtk.model.equilibrium import NoEquilibriumError
from edtk.study.study import Study
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Refit:
    """How well a reading fits, with compliances that are not negative.

    Attributes:
        reading: The columns as they are read.
        k: Compliances (p,), not negative [rad/(N m)].
        chi2: Sum of the squared residuals in units of sigma; inf where compliances are open.
        dof: Degrees of freedom: coordinates less compliances.
    """

    reading: Reading
    k: Array
    chi2: float
    dof: int

    @classmethod
    def of(cls, study: Study, reading: Reading, less: Array | float = 0.0) -> "Refit":
        """Fit the linear model by least squares.

        Args:
            study: The model.
            reading: The measurements.
            less: Part of the displacements (m, rows) that the linear model does not know [m, rad].
        """
        from scipy.optimize import nnls

        data = reading.data
        A = data.regressor(study.model)
        dof = data.deflection.size - A.shape[-1]
        try:
            whitened = Whitened.of(A, data.sigma, study.model.parameters)
        except SingularPlanError:
            return cls(reading, np.zeros(A.shape[-1]), np.inf, dof)
        linear = data.deflection - known_part(study, data) - less
        k = nnls(whitened.R, whitened.project(linear))[0] / whitened.scale
        z = (linear - A @ k) * whitened.weight
        return cls(reading, k, float((z**2).sum()), dof)

    def corrected(self, study: Study) -> "Refit":
        """The fit without what the load's equilibrium adds to the linear model, if that is better.

        It is a step of the nonlinear fit: the difference between equilibrium and linear model is
        that of these compliances.
        """
        if not np.isfinite(self.chi2):
            return self
        try:
            less = nonlinear_part(study, self.reading.data, self.k)
        except NoEquilibriumError:
            return self
        again = Refit.of(study, self.reading, less)
        return again if again.chi2 < self.chi2 else self

    @property
    def size(self) -> float:
        """Residuals in units of sigma, root mean square."""
        return float(np.sqrt(self.chi2 / max(self.dof, 1)))

    @property
    def p(self) -> float:
        """Probability of so large residuals by noise alone."""
        return float(chi_square_tail(self.chi2, self.dof)) if self.dof else 1.0
