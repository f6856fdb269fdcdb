"""Problems of arrays, and cost and bound of a relaxation by numpy alone.

Tolerances are those of `slip`, to which cost and bound are defined in rounding, and of the gap that
was asked for.
"""

from functools import cache

import numpy as np
import pytest

import criteria
from edtk.design.problem import Problem
from edtk.design.relaxation.relax import relax

GAP = 1e-6
EPS = np.finfo(float).eps
NAMES = criteria.available()
# O1 and O3 are powers of D and E, whose programs they share: where a test is about programs and
# solvers, they prove nothing more.
BASES = tuple(name for name in NAMES if name not in ("O1", "O3"))
# One criterion of each kind that is treated in its own way: smooth and convex, with kinks, of
# degree zero, and the least of a family.
KINDS = ("A", "E", "O2", "O4")
SMOOTH = tuple(name for name in NAMES if criteria.get(name).smooth)
MONOTONE = tuple(name for name in NAMES if criteria.get(name).monotone)
UNITS = np.array([1e-7, 1e-2, 1e1, 1e4])
TARGET = np.random.default_rng(9).normal(size=(3, 4))
every = pytest.mark.parametrize("name", NAMES)
every_base = pytest.mark.parametrize("name", BASES)
every_kind = pytest.mark.parametrize("name", KINDS)


def blocks_of(seed, n=60, size=2, p=4):
    """Random regressors (n, size, p)."""
    return np.random.default_rng(seed).normal(size=(n, size, p))


def off_centre(seed, n):
    """Single rows with a direction in common, so that equal eigenvalues are out of reach."""
    return blocks_of(seed, n, 1) + np.array([2.0, 1.0, 0.5, 0.0])


def cubic():
    """Cubic regression on 41 points."""
    return np.vander(np.linspace(-1, 1, 41), 4, increasing=True)[:, None, :]


def uneven():
    """Candidates whose information differs by twelve decades."""
    return blocks_of(3) * 10 ** np.random.default_rng(5).uniform(-3, 3, size=(60, 1, 1))


WELL = {
    "blocks of two": blocks_of(0),
    "many rows": blocks_of(1, 600, 1),
    "cubic": cubic(),
    "off-centre": off_centre(2, 30),
    "uneven": uneven(),
}
BADLY = {
    "parameters x 1e-7 .. 1e4": blocks_of(0, 16) * UNITS,
    "cubic x 1e4 .. 1e-7": cubic()[::4] * UNITS[::-1],
    "all x 1e-9": blocks_of(0, 16) * 1e-9,
}
CASES = WELL | BADLY


def units_of(case):
    """Units (4,) of the parameters of a case, against which a target has to be scaled."""
    units = {"parameters x 1e-7 .. 1e4": UNITS, "cubic x 1e4 .. 1e-7": UNITS[::-1]}
    return units.get(case, np.ones(4))


def criterion_of(name, units=1.0):
    """A criterion, new each time, so that no compiled program of another test is used."""
    return criteria.create(name, target=TARGET * units)


@cache
def solved(name, case):
    """The relaxation of a case by all solvers in turn, once."""
    return relax(Problem(CASES[case]), criterion_of(name, units_of(case)))


def inverse(M):
    """Inverses (..., p, p) of M scaled to a unit diagonal, so that units lose nothing."""
    d = np.sqrt(np.diagonal(M, axis1=-2, axis2=-1))
    dd = d[..., :, None] * d[..., None, :]
    return np.linalg.inv(M / dd) / dd


def slips(M):
    """Relative errors (...) to which costs are defined: 64 p eps cond of M of unit diagonal."""
    d = np.sqrt(np.diagonal(M, axis1=-2, axis2=-1))
    return 64 * M.shape[-1] * EPS * np.linalg.cond(M / (d[..., :, None] * d[..., None, :]))


def slip(M, name=""):
    """Relative error of the cost of one matrix.

    To the error of cov, relative to its largest eigenvalue, O5 is as sensitive as a root.
    """
    rounding = float(slips(M))
    if name != "O5":
        return rounding
    variances = np.maximum(np.linalg.eigvalsh(inverse(M)), 0.0)
    lost = rounding * variances[-1]
    roots = np.sqrt(variances + lost) - np.sqrt(variances)
    return rounding + roots.sum() / np.sqrt(variances[-1])


def bound_slip(M, name):
    """Relative error of a bound.

    Bounds of O2 and O4 are differences of sensitivities, and lose what is small beside the largest.
    """
    return 64 * len(M) * EPS * np.linalg.cond(M) if name in ("O2", "O4") else slip(M, name)


def costs(name, M, target):
    """Costs (...) of M (..., p, p) as Table 1 prints them or their reciprocals."""
    p = M.shape[-1]
    if name in ("D", "O1"):
        det = np.exp(-np.linalg.slogdet(M).logabsdet / p)
        return det if name == "D" else np.sqrt(det)
    cov = inverse(M)
    if name == "A":
        return np.trace(cov, axis1=-2, axis2=-1)
    if name == "G":
        return np.diagonal(cov, axis1=-2, axis2=-1).max(axis=-1)
    if name in ("rho0", "rho_max"):  # of a single task
        return np.sqrt(np.trace(target @ cov @ target.T, axis1=-2, axis2=-1))
    variances = np.maximum(np.linalg.eigvalsh(cov), 0.0)
    if name == "O5":
        return np.sqrt(variances).sum(axis=-1)
    worst = variances[..., -1]
    if name in ("E", "O3"):
        return worst if name == "E" else np.sqrt(worst)
    largest = np.linalg.eigvalsh(M)[..., -1]
    return {"O2": np.sqrt(largest * worst), "O4": np.sqrt(largest) * worst}[name]


def spectrum(Z):
    """Eigenvalues (p,) and -vectors of Z of unit diagonal, without rounding, and its scale (p,)."""
    d = np.sqrt(np.abs(np.diag(Z)))
    d = np.where(d > 0, d, 1.0)
    z, V = np.linalg.eigh(Z / np.outer(d, d))
    return np.where(np.abs(z) > 16 * len(Z) * EPS * np.abs(z).max(), z, 0.0), V, d


def root_trace(Z, power=0.5):
    """``trace Z^power`` of a positive semidefinite Z, by singular values of a root of it."""
    z, V, d = spectrum(Z)
    root = np.sqrt(np.maximum(z, 0.0))[:, None] * V.T * d
    return (np.linalg.svd(root, compute_uv=False) ** (2 * power)).sum()


def proved(name, Z, blocks, M, target):
    """The lower bound that multipliers Z (r, p, p) prove over information blocks (n, p, p).

    Every design X obeys <Z, X> <= t, the largest sensitivity. The bounds of A, D, G, O5 and rho0
    are those of Hoelder's inequality for traces; that of G is for a weighted sum of the variances,
    whatever its weights.
    """
    t = np.einsum("rij,nij->rn", Z, blocks).max(axis=1)
    if name == "O4":
        return np.sqrt(least_product(Z, t))
    (Z,) = Z
    (t,) = t
    p = len(Z)
    if name == "O2":
        z = np.linalg.eigvalsh(Z - t * np.eye(p))
        return np.sqrt(max(1.0, z[z > 0].sum() / -z[z < 0].sum() if (z < 0).any() else 1.0))
    if name == "G":
        variance = np.diag(inverse(M))
        near_optimal = np.maximum(np.diag(M @ Z @ M), 0.0)
        worst = (variance == variance.max()).astype(float)
        return max(weighted_trace(Z, u) for u in (near_optimal, worst)) / t
    det = p * np.exp(np.linalg.slogdet(Z).logabsdet / p)
    return {
        "A": lambda: root_trace(Z) ** 2 / t,
        "D": lambda: det / t,
        "E": lambda: np.trace(Z) / t,
        "O1": lambda: np.sqrt(det / t),
        "O3": lambda: np.sqrt(np.trace(Z) / t),
        "O5": lambda: root_trace(Z, 1 / 3) ** 1.5 / np.sqrt(t),
        "rho0": lambda: root_trace(target @ Z @ target.T) / np.sqrt(t),
        "rho_max": lambda: root_trace(target @ Z @ target.T) / np.sqrt(t),
    }[name]()


def weighted_trace(Z, u):
    """``(trace K^(1/2))^2``, K = U^(1/2) Z U^(1/2), the best of steps ``u <- diag K^(1/2)``."""
    found = []
    for _ in range(500):
        root = np.sqrt(u / u.sum())
        values, V = np.linalg.eigh(root[:, None] * Z * root)
        roots = np.sqrt(np.maximum(values, 0.0))
        found.append(roots.sum() ** 2)
        u = np.square(V) @ roots
    return max(found)


def least_product(Z, t):
    """The least s kappa where ``t_j s + b_j kappa >= a_j``, kappa >= 1 and s >= 0.

    a and b are the traces of Z+ and Z-. At the least s of each kappa, which is piecewise linear and
    convex, the product is concave between two corners: it is least at one of them, or at the least
    kappa that lines of t <= 0 leave.
    """
    z = np.linalg.eigvalsh(Z)
    a = np.maximum(z, 0).sum(axis=1)
    b = np.maximum(-z, 0).sum(axis=1)
    b = np.where([(spectrum(y)[0] >= 0).all() for y in Z], 0.0, b)
    a, b, t = (x[(t > 0) | (b > 0)] for x in (a, b, t))
    steep = t <= 0
    start = max(1.0, (a[steep] / b[steep]).max(initial=1.0))
    a, b = (x[~steep] / t[~steep] for x in (a, b))
    with np.errstate(divide="ignore", invalid="ignore"):
        corners = np.concatenate([[start], ((a[:, None] - a) / (b[:, None] - b)).ravel(), a / b])
    kappa = corners[np.isfinite(corners) & (corners >= start)]
    return (kappa * np.maximum(0.0, a - b * kappa[:, None]).max(axis=1, initial=0.0)).min()


def check(r, problem, name, target=TARGET, units=1.0):
    """Assert that what a relaxation says of itself is true: weights, cost, bound and gap."""
    M = np.tensordot(r.weights, problem.blocks(), axes=1)
    normalised = problem.blocks()
    if name == "O2":
        trace = np.maximum(np.trace(normalised, axis1=1, axis2=2), np.finfo(float).tiny)
        normalised = normalised / trace[:, None, None]
    rounding = slip(M, name)
    bound = r.proved_bound.cost
    assert (r.weights >= 0).all()
    assert r.weights.sum() == pytest.approx(1, abs=1e-12)
    np.testing.assert_array_equal(r.support, np.flatnonzero(r.weights > 0))
    assert r.cost == pytest.approx(costs(name, M, target * units), rel=rounding)
    assert bound <= r.cost * (1 + rounding)
    assert r.gap == pytest.approx(1 - bound / r.cost, abs=4 * EPS)
    if bound > (1.0 if name == "O2" else 0.0):  # so much every design proves by itself
        steps = 1e-8 if name == "G" else 0.0  # of the weights, which may converge slowly
        independent = proved(name, r.multipliers, normalised, M, target * units)
        assert bound <= independent * (1 + bound_slip(M, name) + steps)
