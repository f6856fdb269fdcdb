"""A fault of one kind and any size, as a model of the measurements with parameters of its own."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from edtk.inference.least_squares import SingularPlanError, Whitened
from edtk.inference.whiten import RowNoise, whiten
from edtk.system.typing import Array

ITERATIONS = 8  # Gauss-Newton steps; two or three are the rule
CONVERGED = 1e-2  # step of a fault's size, in standard deviations, that changes nothing
# Fall of the sum of squares, after one step, that is too small for a fault to be named.
UNREMARKABLE = 8.0
STEP = 1e-6  # of numerical derivatives [rad, m or 1]; predictions are smooth over a thousand such


@dataclass(frozen=True, eq=False)
class Family:
    """Predictions ``A(c) k + b(c)`` of the measurements, where a fault has the size c.

    Attributes:
        cause: Name of the fault.
        unit: Unit of its size for people.
        per_unit: Units per SI unit.
        dims: Number of its parameters.
        usual: Length of the size that such a fault usually has, in SI units; much larger and much
            smaller ones are less likely beforehand.
        predict: Regressors A (m, rows, p) and constants b (m, rows) of a size c (dims,), in SI
            units; A(0) and b(0) = 0 are the model itself.
        tries: How many families of the same kind there are: one a joint, one a pose; less
            where this one is likelier than the others.
        joint: Name of the joint that the fault is in; empty if it is in none.
        rows: Rows of the measurements that the fault is in, counted from 0; empty for all.
        only_positive: Whether there is no such fault of a negative size.
        grows: Whether the fault grows from row to row, up to its size.
    """

    cause: str
    unit: str
    per_unit: float
    dims: int
    usual: float
    predict: Callable[[Array], tuple[Array, Array]]
    tries: float = 1
    joint: str = ""
    rows: tuple[int, ...] = ()
    only_positive: bool = False
    grows: bool = False

    def derivative(self, c: Array, k: Array) -> Array:
        """Derivatives (m, rows, dims) of the predictions by the size of the fault."""
        columns = []
        for step in STEP * np.eye(self.dims):
            ahead = self.predict(c + step)
            behind = self.predict(c - step)
            change = (ahead[0] - behind[0]) @ k + ahead[1] - behind[1]
            columns.append(change / (2 * STEP))
        return np.stack(columns, axis=-1)

    def derivative_at_zero(self, k: Array) -> Array:
        """Derivatives (m, rows, dims) of the predictions where there is no fault yet."""
        return self.derivative(np.zeros(self.dims), k)


@dataclass(frozen=True, eq=False)
class FamilyFit:
    """Compliances and the size of a fault, fitted together.

    Attributes:
        k: Compliances (p,) [rad/(N m)].
        c: Size of the fault (dims,), SI.
        covariance: Of the size (dims, dims), for the stated noise.
        chi2: Sum of squares of the residuals over sigma.
    """

    k: Array
    c: Array
    covariance: Array
    chi2: float


def fit_family(family: Family, measured: Array, sigma: RowNoise, k: Array) -> FamilyFit | None:
    """Fit compliances and the size of a fault to measurements (m, rows).

    Gauss-Newton from no fault: each step solves the least-squares problem of the compliances and of
    the change of size together.

    Args:
        family: The fault.
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise (m, rows) [m, rad], or correlated noise.
        k: Compliances (p,) of the fit without the fault.

    Returns:
        The fit; None where the measurements cannot tell the fault from the compliances, or the
        steps do not settle.
    """
    c = np.zeros(family.dims)
    p = len(k)
    names = tuple(map(str, range(p + family.dims)))
    A, b = family.predict(c)
    without = float((whiten(measured - b - A @ k, sigma) ** 2).sum())
    for _ in range(ITERATIONS):
        columns = np.concatenate([A, family.derivative(c, k)], axis=-1)
        try:
            whitened = Whitened.of(columns, sigma, names)
        except SingularPlanError:
            return None
        solution = whitened.solve(measured - b)
        k = solution[:p]
        c = c + solution[p:]
        covariance = whitened.covariance[p:, p:]
        if not np.isfinite(solution).all():
            return None
        if np.abs(solution[p:] / np.sqrt(np.diag(covariance))).max() < CONVERGED:
            break
        left = float((whiten(measured - b - columns @ solution, sigma) ** 2).sum())
        if without - left < UNREMARKABLE:
            return FamilyFit(k, c, covariance, left)
        A, b = family.predict(c)
    z = whiten(measured - b - A @ k, sigma)
    return FamilyFit(k, c, covariance, float((z**2).sum()))
