"""A criterion that says no more of itself than a plug-in must."""

import numpy as np

import criteria


class NoDual(criteria.ConvexCriterion):
    """The sum of the variances with an expression alone, as a plug-in may have it."""

    name = "no dual"
    title = "No dual"
    formula = "trace(cov)"
    sense = "min"
    degree = 1.0
    smooth = False

    def expression(self, M, T=None):
        """trace(T M^-1 T')."""
        import cvxpy as cp

        return cp.matrix_frac(np.eye(M.shape[0]) if T is None else T.T, M)
