"""The logarithm of a criterion's cost over plans: value, slope and curvature by all design variables."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from criteria.linalg.triangle import triangle
from criteria.second_derivative import derivatives
from edtk.design.design_space import Experiments
from edtk.design.interior_point.descend import Indices, Local, Objective
from edtk.design.interior_point.neighbourhood import Neighbourhood

Array = NDArray[np.float64]


def information(experiments: Experiments, repeats: Array) -> Array:
    """Information matrices (b, p, p) of plans (b, k) with repetitions (b, k)."""
    return _information(experiments.regressor, repeats, experiments.space.shared)


def _information(A: Array, repeats: Array, shared: Array | None) -> Array:
    """``sum r_i A_i' A_i`` (b, p, p) of regressors (b, k, rows, p), and what is shared."""
    b, k, rows, p = A.shape
    A = (A * np.sqrt(repeats)[..., None, None]).reshape(b, k * rows, p)
    M = np.swapaxes(A, 1, 2) @ A
    return M if shared is None else M + repeats.sum(axis=1)[:, None, None] * shared


@dataclass(frozen=True, eq=False)
class LogCost(Objective):
    """Logarithms of a criterion's costs of plans.

    Args:
        criterion: What is minimised.
        repeats: Repetitions (n, k) of the experiments of all starts.
    """

    criterion: Criterion
    repeats: Array

    def value(self, here: Experiments, start: Indices) -> Array:
        """Values (b,), inf where the plan is singular."""
        return np.log(self.criterion.cost(information(here, self.repeats[start])))

    def local(self, near: Neighbourhood, start: Indices) -> Local:
        """Values, slopes and curvature; zero where the value is inf.

        With L = log cost, its gradient G and its second derivative K by M, and ``M = sum r_i A_i' A_i/sigma^2``,

            dL/dx_ia = <G, dM/dx_ia> = 2 r_i <A_i G, dA_i/dx_ia>/sigma^2,
            d2L/dx_ia dx_jb = K[dM/dx_ia, dM/dx_jb] + (i = j) <G, d2M/dx_ia dx_ib>.

        dM in the second line is a difference between neighbours, the last term one of their slopes under the same G.
        """
        A, repeats = near.experiments.regressor, self.repeats[start, :, None, None]
        b, p = A.shape[1], A.shape[-1]
        cost, G, K = derivatives(
            self.criterion, _information(A[0], self.repeats[start], near.space.shared)
        )
        finite = np.isfinite(cost)[:, None, None]
        c = np.where(finite, cost[:, None, None], 1.0)
        G, K = np.where(finite, G / c, 0.0), np.where(finite, K / c, 0.0)
        slopes = near.first(near.experiments.slope(2.0 * repeats * (A @ G[:, None])))
        i, j = triangle(p)
        M = (repeats * (np.swapaxes(A, -1, -2) @ A))[..., i, j]
        dM = near.differences(M).transpose(1, 2, 0, 3).reshape(b, -1, len(i))
        g = slopes[0].reshape(b, -1)
        joint = dM @ K @ np.swapaxes(dM, 1, 2) - g[:, :, None] * g[:, None]
        return np.log(cost), slopes[0], near.second(slopes), joint
