"""Measurements without any fault, with which measurements with a fault are compared."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.calibration.causes.family import Family
from edtk.calibration.causes.tried import Tried
from edtk.inference.distributions import chi_square_tail, fisher_tail
from edtk.inference.least_squares import SingularPlanError, Whitened
from edtk.inference.measurements import Measurements
from edtk.inference.prior_rows import PriorRows
from edtk.inference.whiten import RowNoise, whiten
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.sensors.pose_marker import COORDINATES
from edtk.system.typing import Array

TINY = 1e-12  # size of nothing [m, rad]


@dataclass(frozen=True, eq=False)
class PlainFit:
    """The compliances alone, fitted to measurements, and to what is known of them besides.

    Attributes:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        known: Compliances of further joints, by their index [rad/(N m)].
        prior: What is known of the compliances besides; None for nothing.
        A: Regressors (m, rows, p) of the measurements.
        noise: The noise of the measurements, and of the rows of the prior below them.
        measured: Deflections (m, rows) [m, rad], and values of the prior below them.
        whitened: The factors of all regressors in units of the noise.
        k: Least-squares estimates (p,) [rad/(N m)].
        z: Residuals (m, rows) of the measurements in units of their noise.
        chi2: Sum of squares of all residuals.
        alone: The sum of squares without the prior; None where measurements alone do not tell all
            compliances.
    """

    model: ElastostaticModel
    data: Measurements
    known: Mapping[int, float]
    prior: PriorRows | None
    A: Array
    noise: RowNoise
    measured: Array
    whitened: Whitened
    k: Array
    z: Array
    chi2: float
    alone: float | None

    @classmethod
    def of(
        cls,
        model: ElastostaticModel,
        data: Measurements,
        measured: Array,
        known: Mapping[int, float],
        prior: PriorRows | None,
    ) -> "PlainFit":
        """Fit the compliances.

        Raises:
            SingularPlanError: They are not all told.
        """
        A = data.regressor(model)
        names = model.parameters
        if prior is None:
            whitened = Whitened.of(A, data.noise, names)
            k = whitened.solve(measured)
            z = whiten(measured - A @ k, data.noise)
            chi2 = float((z**2).sum())
            return cls(
                model, data, known, None, A, data.noise, measured, whitened, k, z, chi2, chi2
            )
        noise = prior.noise_below(data.noise, measured.shape[1])
        both = prior.measured_below(measured)
        whitened = Whitened.of(prior.below(A), noise, names)
        k = whitened.solve(both)
        z = whiten(both - prior.below(A) @ k, noise)
        try:
            rest = Whitened.of(A, data.noise, names).residual(measured)
            alone: float | None = float((rest**2).sum())
        except SingularPlanError:
            alone = None
        m = len(data)
        chi2 = float((z**2).sum())
        return cls(model, data, known, prior, A, noise, both, whitened, k, z[:m], chi2, alone)

    @property
    def coordinates(self) -> int:
        """Number of measured coordinates, and of what is known besides."""
        return self.data.deflection.size + (0 if self.prior is None else len(self.prior))

    @property
    def dof(self) -> int:
        """Degrees of freedom."""
        return self.coordinates - len(self.k)

    @property
    def by_prior(self) -> float:
        """What the prior adds to the sum of squares."""
        return 0.0 if self.alone is None else self.chi2 - self.alone

    @property
    def alone_dof(self) -> int:
        """Degrees of freedom of the measurements alone."""
        return self.dof if self.alone is None else self.data.deflection.size - len(self.k)

    @cached_property
    def pure_error(self) -> tuple[float, int]:
        """Sum of squares of repetitions about their means, and its degrees of freedom."""
        z = self.z
        group = self.data.places
        count = np.bincount(group)
        mean = np.stack([np.bincount(group, column) / count for column in z.T], axis=1)
        return float(((z - mean[group]) ** 2).sum()), z.size - len(count) * z.shape[1]

    def probability(self, left: float, dof: int) -> float:
        """Probability that noise leaves so large a sum of squares.

        Where repetitions scatter by more than the stated noise, what is left beside their scatter
        is compared with that, by Fisher's law.
        """
        p = float(chi_square_tail(left, max(dof, 1)))
        pure, pure_dof = self.pure_error
        if pure_dof < 1 or pure <= pure_dof or dof <= pure_dof:
            return p
        F = (left - pure) / (dof - pure_dof) / (pure / pure_dof)
        return max(p, float(fisher_tail(max(F, 0.0), dof - pure_dof, pure_dof)))

    def usual_shift(self, parts: int) -> Array:
        """Sizes (parts,) of shifts of single rows [m, rad]: lengths first, then rotations.

        A reading of another pose, or a mistyped one, is off by about the size of all readings.
        """
        measured = self.measured_rows(self.measured)
        lengths = self.data.lengths
        sizes = [measured[which] for which in (lengths, ~lengths)]
        length, turn = (max(float(np.sqrt(np.mean(x**2))), TINY) if x.size else TINY for x in sizes)
        return np.where(np.arange(parts) < COORDINATES, length, turn)

    def below(self, family: Family) -> Family:
        """The same fault, whose predictions have the rows of the prior below them."""
        prior = self.prior
        if prior is None:
            return family

        def predict(c: Array) -> tuple[Array, Array]:
            A, b = family.predict(c)
            return prior.below(A), prior.zeros_below(b)

        return replace(family, predict=predict)

    def score(self, one: Tried) -> float:
        """The less, the likelier is the fault."""
        return one.score(self.coordinates)

    def measured_rows(self, x: Array) -> Array:
        """The part of an array (m + ..., ...) that is of measurements."""
        return np.asarray(x[: len(self.data)])
