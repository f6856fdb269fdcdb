"""
Your own criterion
==================

A criterion is one class: it says how good an information matrix is. This example adds the
*c-criterion*, the variance of one linear combination of the parameters, and finds an optimal
design for it.
"""

from pathlib import Path

import numpy as np

import edtk
from edtk import criteria


class DifferenceOfTwo(criteria.ConvexCriterion):
    """Variance of ``k_1 - k_2``: ``c' cov c`` with c = (1, -1, 0, ...).

    The gradient is ``-(cov c)(cov c)'``.
    """

    name = "difference"
    title = "Variance of the difference of the first two parameters"
    formula = "c' cov c"
    sense = "min"
    degree = 1.0

    def _cost(self, M, cov):
        return cov[..., 0, 0] - 2 * cov[..., 0, 1] + cov[..., 1, 1]

    def _gradient(self, M, cov):
        column = cov[..., :, 0] - cov[..., :, 1]
        return -column[..., :, None] * column[..., None, :]

    def expression(self, M, T=None):
        import cvxpy as cp

        c = np.zeros(M.shape[0])
        c[:2] = 1, -1
        return cp.matrix_frac(c if T is None else T.T @ c, M)


# %%
# The class is all that the relaxation needs. The design below is over a cubic on [0, 1].

x = np.linspace(0, 1, 101)
rows = np.stack([np.ones_like(x), x, x**2, x**3], axis=-1)
problem = edtk.Problem(rows[:, None, :])
design = edtk.relax(problem, DifferenceOfTwo())
print(design)
for point, weight in zip(x, design.weights, strict=True):
    if weight > 0.001:
        print(f"x = {point:.2f}  weight {weight:.4f}")

# %%
# A registered criterion has a name, and can be used in studies and on the command line.

criteria.register(DifferenceOfTwo)
study = edtk.load_study(Path(edtk.__file__).parents[1] / "studies" / "kr270_milling.toml")
plan = edtk.plan(study, size=4, criterion="difference", seed=1, workers=1)
print(plan)
