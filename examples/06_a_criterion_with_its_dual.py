r"""
A criterion with its dual
=========================

A bound needs a *dual*: the least cost of all information matrices that a multiplier allows. A
criterion that gives only a convex program has its dual from a solver; one that knows it in closed
form proves bounds by itself. This example derives one from the beginning.

The criterion is the sum of the k largest variances, in the worst k directions of the parameters:
the k largest eigenvalues of the covariance. For k = 1 that is E, for k = p it is A.
"""

import matplotlib.pyplot as plt
import numpy as np

import edtk
from edtk import criteria

# %%
# The dual, on paper
# ------------------
#
# A multiplier Z with ``<Z, M_i> <= t`` for all candidates bounds every design X: ``<Z, X> <= t``.
# We need the least cost of all X with ``<Z, X> <= 1``, the *polar*; a cost of degree one is then at
# least polar / t.
#
# 1. The sum of the k largest eigenvalues of C is the largest ``<U, C>`` of all matrices U between 0
#    and I with trace k (Ky Fan). So *every* such U gives a lower bound, and we may choose.
# 2. By the inequality of Cauchy and Schwarz,
#    ``<U, X^-1> <Z, X> >= (trace (U^(1/2) Z U^(1/2))^(1/2))^2``.
# 3. With the eigenvectors of Z and eigenvalues u of U that is ``(sum_i sqrt(u_i z_i))^2``, where
#    ``0 <= u_i <= 1`` and the u_i have the sum k. It is largest for u in the ratios of z, cut off
#    at one: ``u_i = min(1, c z_i)``.
#
# For k = 1 it is ``sum z_i``, the dual of E. For k = p all u are one, and it is
# ``(sum sqrt(z_i))^2``, the dual of A.


def shares(z, k):
    """``u_i = min(1, c z_i)`` of sum k, for z in rising order."""
    u = np.ones_like(z)
    for capped in range(k):  # the largest so many are cut off
        rest = z[: len(z) - capped]
        c = (k - capped) / rest.sum()
        if c * rest[-1] <= 1:
            u[: len(rest)] = c * rest
            return u
    u[: len(z) - k] = 0.0
    return u


class SumOfLargest(criteria.ConvexCriterion):
    """The sum of the k largest eigenvalues of cov; the gradient is ``-V diag(s v^2) V'``."""

    name = "sum_of_largest"
    title = "Sum of the k largest variances"
    formula = "v_1 + .. + v_k"
    sense = "min"
    degree = 1.0
    smooth = False  # where two eigenvalues change places
    needs_parameters = True

    def __init__(self, k):
        self.k = int(k)

    @property
    def arguments(self):
        return {"k": self.k}

    def _cost(self, M, cov):
        return np.linalg.eigvalsh(cov)[..., -self.k :].sum(axis=-1)

    def _gradient(self, M, cov):
        v, V = np.linalg.eigh(cov)
        slopes = np.where(np.arange(v.shape[-1]) >= v.shape[-1] - self.k, v**2, 0.0)
        return -(V * slopes[..., None, :]) @ np.swapaxes(V, -1, -2)

    def polar(self, Z, M):
        z = np.maximum(np.linalg.eigvalsh(Z), 0.0)
        return float(np.sqrt(shares(z, self.k) * z).sum() ** 2)

    def formulation(self, M, total, T, unit):
        """The least such sum of any C that is at least ``T M^-1 T'``."""
        import cvxpy as cp

        p = len(T)
        C = cp.Variable((p, p), symmetric=True)
        scaled = T / np.sqrt(unit)
        above = cp.bmat([[C, scaled], [scaled.T, M]])
        return cp.lambda_sum_largest(C, self.k), [above >> 0, total == 1]


# %%
# The dual, checked
# -----------------
#
# Two checks find nearly every mistake. No matrix with ``<Z, X> = 1`` costs less than the polar; and
# minus the gradient at M, with ``t = <Z, M>``, proves the cost of M itself.

rng = np.random.default_rng(0)
for k in (1, 2, 3, 4):
    criterion = SumOfLargest(k)
    B = rng.normal(size=(1000, 4, 6))
    X = B @ np.swapaxes(B, 1, 2)
    Z, M = X[:2]
    X = X / np.einsum("ij,nij->n", Z, X)[:, None, None]
    assert criterion.polar(Z, M) <= criterion.cost(X).min()
    G = -criterion.gradient(M)
    assert np.isclose(criterion.polar(G, M) / np.sum(G * M), criterion.cost(M))

# %%
# The design, and what its bound rests on
# ---------------------------------------
#
# The relaxation proves its bound by our formula: no solver's word is in it.

x = np.linspace(-1, 1, 101)
problem = edtk.Problem(np.vander(x, 4, increasing=True)[:, None, :])
for k in (1, 2, 3, 4):
    design = edtk.relax(problem, SumOfLargest(k))
    proof = "by a solver's word" if design.rests_on_solver else "proved"
    print(f"k = {k}: {design.value:.5f}, at least {design.bound:.5f} ({proof})")
print(f"E: {1 / edtk.relax(problem, 'E').value:.5f}, A: {edtk.relax(problem, 'A').value:.5f}")

# %%
# A registered criterion has a name, parameters, and certificates.

criteria.register(SumOfLargest)
design = edtk.relax(problem, criteria.create("sum_of_largest", k=2))
print(edtk.verify(design.to_dict(), problem).summary())

# %%
# The equivalence theorem: the sensitivity to the multiplier is largest where the design has weight.

figure, ax = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
design.plot(ax, x=x)
