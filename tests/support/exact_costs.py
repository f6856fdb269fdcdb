"""Costs of designs in arithmetic of 50 digits, by formulas of their own."""

import mpmath
import numpy as np

DIGITS = 50
# What floating-point rows and weights may lack of telling a combination: a design that does is
# singular, and exact arithmetic calls its cost infinite.
SINGULAR = mpmath.mpf("1e-25")


def arguments(name, rng, rows):
    """What a criterion of these rows (n, r, p) takes, about predictions or parameters."""
    flat = rows.reshape(-1, rows.shape[-1])
    p = flat.shape[1]
    made = {
        "rho0": lambda: {"target": rng.normal(size=(3, p))},
        "rho_max": lambda: {"targets": rng.normal(size=(3, 2, p))},
        "c": lambda: {"c": flat[0] + flat[-1]},
        "I": lambda: {"points": flat[:4]},
        "prediction_G": lambda: {"points": flat[:4]},
        "Ds": lambda: {"interest": rng.normal(size=(p, (p + 1) // 2))},
        "phi": lambda: {"q": 2.0},
    }
    return made.get(name, dict)()


def rows_of(kind, rng, r, p, condition):
    """Rows (p + 8, r, p) that are ill-conditioned in one way or another."""
    rows = rng.normal(size=(p + 8, r, p))
    if kind == "columns that differ by little" and p > 1:
        rows[..., -1] = rows[..., 0] + rows[..., -1] / condition
    if kind == "a small singular value":
        Q = np.linalg.qr(rng.normal(size=(p, p)))[0]
        rows = rows @ (np.geomspace(1, 1 / condition, p)[:, None] * Q)
    if kind == "units":
        rows = rows * condition ** rng.uniform(0, 1, size=p)
    if kind == "powers":
        x = rng.uniform(0, 1, size=(p + 8, r)) + 0.3 * condition ** (1 / max(p - 1, 1))
        rows = x[..., None] ** np.arange(p)
    return rows


KINDS = ("columns that differ by little", "a small singular value", "units", "powers")


def exact_cost(name, rows, weights, arguments, beside=0, blocks=(), sigma=None):
    """The cost of weights (n,) on rows (n, r, p), all taken as exact; None of a singular design.

    Information beside them (p, p) is of mpmath or floating-point numbers. Of counts (b, n) in
    blocks their effects, of which nothing is known, are taken out. Rows have the noise sigma (r,).
    """
    with mpmath.workdps(DIGITS):
        M = exact_information(rows, weights, sigma) + mpmath.matrix(beside or rows.shape[-1])
        for counts in blocks:
            for j in range(rows.shape[1]):
                s = mpmath.matrix(1, rows.shape[-1])
                for i in np.flatnonzero(counts):
                    s += int(counts[i]) * mpmath.matrix(rows[i, j : j + 1].tolist())
                s /= 1 if sigma is None else mpmath.mpf(float(sigma[j]))
                M -= s.T * s / int(counts.sum())
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


def exact_information(rows, weights, sigma=None):
    """``sum_i w_i A_i' A_i`` of floating-point numbers, nothing rounded but to so many digits.

    A_i are the rows, each divided by its sigma (r,), if there is one.
    """
    with mpmath.workdps(DIGITS):
        r, p = rows.shape[1:]
        noise = np.ones(r) if sigma is None else sigma
        divisor = mpmath.diag([1 / mpmath.mpf(float(s)) for s in noise])
        M = mpmath.zeros(p)
        for i in np.flatnonzero(weights):
            A = divisor * mpmath.matrix(rows[i].tolist())
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
    """At unit diagonal, as a determinant of far units is taken for zero."""
    d = [mpmath.sqrt(each) for each in _diagonal(V)]
    unit = mpmath.diag([1 / each for each in d])
    return (mpmath.det(unit * V * unit) * mpmath.fprod(d) ** 2) ** (mpmath.mpf(1) / V.rows)


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
