"""Costs of designs in arithmetic of 50 digits, by formulas of their own."""

import mpmath
import numpy as np

DIGITS = 50
# What floating-point rows and weights may lack of telling a combination: a design that does is
# singular, and exact arithmetic calls its cost infinite.
SINGULAR = mpmath.mpf("1e-25")


def exact_cost(name, rows, weights, arguments):
    """The cost of weights (n,) on rows (n, r, p), all taken as exact; None of a singular design."""
    with mpmath.workdps(DIGITS):
        M = _information(rows, weights)
        d = [mpmath.sqrt(M[i, i]) for i in range(M.rows)]
        if not min(d) > 0:
            return None
        unit = mpmath.diag([1 / each for each in d])
        R = unit * M * unit
        if min(mpmath.eigsy(R, eigvals_only=True)) < SINGULAR:
            return None
        return COSTS[name](unit * R**-1 * unit, arguments)


def excess(number, exact):
    """The relative excess of a floating-point number over an exact one."""
    with mpmath.workdps(DIGITS):
        return float(mpmath.mpf(float(number)) / exact - 1)


def _information(rows, weights):
    p = rows.shape[-1]
    M = mpmath.zeros(p)
    for i in np.flatnonzero(weights):
        A = mpmath.matrix(rows[i].tolist())
        M += mpmath.mpf(float(weights[i])) * (A.T * A)
    return M


def _trace(X):
    return mpmath.fsum(X[i, i] for i in range(X.rows))


def _diagonal(X):
    return [X[i, i] for i in range(X.rows)]


def _of(X, cov):
    """Covariance of ``X k``."""
    K = mpmath.matrix(X.tolist())
    return K * cov * K.T


def _eigenvalues(cov):
    return list(mpmath.eigsy(cov, eigvals_only=True))


def _mean_power(cov, q):
    values = _eigenvalues(cov)
    return (mpmath.fsum(v**q for v in values) / len(values)) ** (1 / mpmath.mpf(q))


def _root_of_determinant(V):
    return mpmath.det(V) ** (mpmath.mpf(1) / V.rows)


COSTS = {
    "A": lambda cov, a: _trace(cov),
    "D": lambda cov, a: _root_of_determinant(cov),
    "E": lambda cov, a: max(_eigenvalues(cov)),
    "G": lambda cov, a: max(_diagonal(cov)),
    "O1": lambda cov, a: mpmath.sqrt(_root_of_determinant(cov)),
    "O2": lambda cov, a: mpmath.sqrt(max(_eigenvalues(cov)) / min(_eigenvalues(cov))),
    "O3": lambda cov, a: mpmath.sqrt(max(_eigenvalues(cov))),
    "O4": lambda cov, a: max(_eigenvalues(cov)) / mpmath.sqrt(min(_eigenvalues(cov))),
    "O5": lambda cov, a: mpmath.fsum(mpmath.sqrt(v) for v in _eigenvalues(cov)),
    "rho0": lambda cov, a: mpmath.sqrt(_trace(_of(a["target"], cov))),
    "rho_max": lambda cov, a: max(mpmath.sqrt(_trace(_of(X, cov))) for X in a["targets"]),
    "c": lambda cov, a: _trace(_of(a["c"][None], cov)),
    "I": lambda cov, a: _trace(_of(a["points"], cov)) / len(a["points"]),
    "Ds": lambda cov, a: _root_of_determinant(_of(a["interest"].T, cov)),
    "phi": lambda cov, a: _mean_power(cov, a["q"]),
    "prediction_G": lambda cov, a: max(_diagonal(_of(a["points"], cov))),
}
