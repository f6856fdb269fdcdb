"""The logarithm of a criterion's cost over plans: value, slope and curvature by the poses."""

from dataclasses import dataclass

import numpy as np

from criteria import Criterion
from criteria.derivatives import derivatives
from criteria.linalg.triangle import triangle
from edtk.design.experiments import weighted_information
from edtk.design.interior_point.neighbourhood import Neighbourhood
from edtk.design.interior_point.objective import Local, Objective
from edtk.design.space import Points
from edtk.system.typing import Array, Indices

FEW = 12  # parameters


@dataclass(frozen=True, eq=False)
class LogCost(Objective):
    """Logarithms of a criterion's costs of plans, as the objective of a descent.

    The logarithm has order one whatever the units, and makes steps independent of the criterion's
    degree of homogeneity.

    Args:
        criterion: The criterion to minimise.
        repeats: Repetitions (n, k) of the experiments of all starts.
    """

    criterion: Criterion
    repeats: Array

    def value(self, here: Points, start: Indices) -> Array:
        """Values (b,), inf where the plan is singular."""
        return np.log(self.criterion.cost(here.information(self.repeats[start])))

    def local(self, near: Neighbourhood, start: Indices) -> Local:
        """Values, slopes and curvature; slopes and curvature are zero where the value is inf.

        With ``L = log cost``, its gradient G and its second derivative K by M, and with
        ``M = sum_i r_i (M0 + A_i' A_i)``, where A is whitened,

            dL/dx_ia = <G, dM/dx_ia> = 2 r_i <A_i G, dA_i/dx_ia>,
            d2L/dx_ia dx_jb = K[dM/dx_ia, dM/dx_jb] + (i = j) <G, d2M/dx_ia dx_ib>.

        In the second line dM is a difference between neighbours, and the last term is a difference
        between their slopes under the same G.
        """
        # Repeats of a pose share its discrepancy, if there is any.
        experiments = near.experiments.visited(self.repeats[start])
        A = experiments.regressor
        repeats = self.repeats[start, :, None, None]
        b = len(start)
        M = weighted_information(A[0], self.repeats[start], near.space.prior)
        cost, G, K = derivatives(self.criterion, M)
        # The logarithm divides its derivatives by the cost; singular plans have none.
        finite = np.isfinite(cost)[:, None, None]
        divisor = np.where(finite, cost[:, None, None], 1.0)
        G = np.where(finite, G / divisor, 0.0)
        K = np.where(finite, K / divisor, 0.0)
        slopes = near.first(experiments.slope(2.0 * repeats * (A @ G[:, None])))
        own = repeats[..., 0] * _triangles(experiments)
        dM = near.differences(own).transpose(1, 2, 0, 3).reshape(b, -1, own.shape[-1])
        slope = slopes[0].reshape(b, -1)
        # The second term is that of the logarithm: (log c)'' = c''/c - (c'/c)^2.
        joint = dM @ K @ np.swapaxes(dM, 1, 2) - slope[:, :, None] * slope[:, None]
        return Local(np.log(cost), slopes[0], near.second(slopes), joint)


def _triangles(experiments: Points) -> Array:
    """Upper triangles (..., q) of the information of one measurement in each experiment.

    Whole arrays are added for each entry of few, in a fifth of the time of many small products.
    """
    A = experiments.regressor
    if A.shape[-1] <= FEW:
        return np.moveaxis(experiments.packed, 0, -1)
    rows, columns = triangle(A.shape[-1])
    return np.asarray((np.swapaxes(A, -1, -2) @ A)[..., rows, columns])
