"""The fit of measurements that are read in one way: a name, a size and a likelihood."""

from dataclasses import dataclass, replace

import numpy as np

from edtk.calibration.input_errors.reading import Reading
from edtk.calibration.known_part import known_part
from edtk.calibration.nonlinear_part import nonlinear_part
from edtk.inference.distributions import chi_square_tail
from edtk.inference.find_outliers import find_outliers
from edtk.inference.least_squares import SingularPlanError, Whitened
from edtk.model.equilibrium import NoEquilibriumError
from edtk.study.study import Study
from edtk.system.typing import Array, Indices

MOST_OUTLIERS = 0.1  # share of the rows that may be outliers of a reading
ROUNDS = 10  # of finding outliers, which can hide each other
OUTLIER = 25.0  # chi-square of a row from which it is one, of a thousand rows


@dataclass(frozen=True, eq=False)
class Refit:
    """How well a reading fits, with compliances that are not negative.

    Attributes:
        reading: The columns as they are read.
        k: Compliances (p,), not negative [rad/(N m)].
        chi2: Sum of the squared residuals in units of sigma; inf where compliances are open.
        dof: Degrees of freedom: coordinates less compliances.
        left_out: Number of rows that were left out as outliers.
    """

    reading: Reading
    k: Array
    chi2: float
    dof: int
    left_out: int = 0

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
            whitened = Whitened.of(A, data.noise, study.model.parameters)
        except SingularPlanError:
            return cls(reading, np.zeros(A.shape[-1]), np.inf, dof)
        linear = data.deflection - known_part(study, data) - less
        k = nnls(whitened.R, whitened.project(linear))[0] / whitened.scale
        z = whitened.in_sigma(linear - A @ k)
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

    def without_outliers(self, study: Study) -> "Refit":
        """The fit without the rows that do not belong to the others; the same if they are many."""
        data = self.reading.data
        refit = self
        for _ in range(ROUNDS):
            left = refit.reading.data
            outliers = refit._outliers(study)
            if not len(outliers):
                break
            rest = np.delete(np.arange(len(left)), outliers)
            if len(rest) < (1 - MOST_OUTLIERS) * len(data):
                return self
            refit = Refit.of(study, replace(self.reading, data=left[rest])).corrected(study)
        return replace(refit, left_out=len(data) - len(refit.reading.data))

    def _outliers(self, study: Study) -> Indices:
        """Rows that do not belong to the others."""
        data = self.reading.data
        A = data.regressor(study.model)
        whitened = Whitened.of(A, data.noise, study.model.parameters)
        residual = data.deflection - known_part(study, data) - A @ self.k
        z = whitened.in_sigma(residual)
        total = float((z**2).sum())
        return find_outliers(*whitened.deletable(z), self.dof, total=total)

    @property
    def cost(self) -> float:
        """Minus twice the log likelihood, with so much for each outlier as it must have at least.

        The costs of two readings differ by the logarithm of their likelihood ratio, twice.
        """
        return self.chi2 + OUTLIER * self.left_out

    @property
    def size(self) -> float:
        """Residuals in units of sigma, root mean square."""
        return float(np.sqrt(self.chi2 / max(self.dof, 1)))

    @property
    def p(self) -> float:
        """Probability of so large residuals by noise alone."""
        return float(chi_square_tail(self.chi2, self.dof)) if self.dof else 1.0
