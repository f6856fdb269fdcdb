"""Random matrices, designs and tolerances on which the tests of this folder rest."""

import warnings
from functools import cache

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

import criteria
from criteria.linalg.inverse import whitener
from criteria.spectral_balance import SpectralBalance

Array = NDArray[np.float64]
EPS = np.finfo(float).eps
SOLVER = 1e-9  # what the solver is asked for in `solve`, relative to an objective of order one


@cache
def make(name: str, p: int) -> criteria.Criterion:
    """A criterion by name, with a random target, or those of four tasks, if it needs them.

    The tasks are equally bad where all variances are one. A criterion with parameters has random
    ones; a number in its name is one of them: "phi 0.5".
    """
    rng = np.random.default_rng(p)
    if name.split()[0] in criteria.families():
        return with_parameters(rng, name, p)
    target = rng.normal(size=(3, p))
    targets = rng.normal(size=(4, 3, p))
    targets *= np.sqrt(p) / np.linalg.norm(targets, axis=(1, 2), keepdims=True)
    return criteria.create(name, target=target, targets=targets)


def with_parameters(rng: np.random.Generator, name: str, p: int) -> criteria.Criterion:
    """A criterion of `criteria.families()` with random parameters of order one."""
    kind, *numbers = name.split()
    given = {
        "I": lambda: {"W": positive(rng, p)},
        "c": lambda: {"c": rng.normal(size=p)},
        "Ds": lambda: {"interest": rng.normal(size=(p, (p + 1) // 2))},
        "phi": lambda: {"q": float(*numbers)},
        "prediction_G": lambda: {"points": rng.normal(size=(6, p))},
        "bayes_D": lambda: {"precision": positive(rng, p)},
        "bayes_A": lambda: {"precision": positive(rng, p)},
        "compound": lambda: {"criteria": ["D", make("I", p), make("c", p)], "weights": [1, 2, 3]},
        "minimax": lambda: {"criteria": ["D", make("phi 2", p), "O5"], "best": [1.5, 0.8, p]},
    }
    return criteria.create(kind, **given[kind]())


def balance(around: Array, share: float = 0.5) -> SpectralBalance:
    """The member of O4's family in which ``a kappa`` has a given share of the cost of `around`."""
    s = float(make("E", len(around)).cost(around))
    kappa = float(make("O2", len(around)).cost(around)) ** 2
    return SpectralBalance(share / kappa, (1 - share) / s)


def slips(M: Array) -> Array:
    """Relative errors (...) to which costs of matrices (..., p, p) are defined: 64 p eps cond."""
    return 64 * M.shape[-1] * EPS * np.linalg.cond(M)


def slip(*matrices: Array) -> float:
    """Relative error to which a cost is defined, that of the worst of some matrices."""
    return max(float(slips(M).max()) for M in matrices)


def orthogonal(rng: np.random.Generator, p: int) -> Array:
    """An orthogonal matrix (p, p)."""
    return np.linalg.qr(rng.normal(size=(p, p)))[0]


def with_spectrum(rng: np.random.Generator, eigenvalues: Array) -> Array:
    """A symmetric matrix of given eigenvalues (p,) and random eigenvectors."""
    Q = orthogonal(rng, len(eigenvalues))
    M = (Q * eigenvalues) @ Q.T
    return 0.5 * (M + M.T)


def positive(rng: np.random.Generator, p: int, condition: float = 10.0) -> Array:
    """A positive definite matrix (p, p) of at most a given condition."""
    return with_spectrum(rng, condition ** rng.uniform(0, 1, size=p))


def symmetric(rng: np.random.Generator, p: int) -> Array:
    """A symmetric matrix (p, p) of norm one."""
    H = rng.normal(size=(p, p))
    return (H + H.T) / np.linalg.norm(H + H.T, 2)


def units(rng: np.random.Generator, p: int) -> Array:
    """Units t (p,) from 1e-7 to 1e4: for parameters k' with k = t k', M becomes M t t'."""
    return 10 ** rng.uniform(-7, 4, size=p)


def solve(
    c: criteria.Relaxable, blocks: Array, around: Array, T: Array
) -> tuple[float, Array, Array]:
    """Optimum of the criterion's program over candidates (n, p, p), with weights and multiplier.

    The optimum is that of ``(cost/unit)^power``, with `unit` the cost of the design `around`, which
    T whitens. The weights (n,) have sum one. The multiplier (p, p) of ``M == sum w_i M_i`` belongs
    to the original units.
    """
    w = cp.Variable(len(blocks), nonneg=True)
    M = cp.Variable(T.shape, symmetric=True)
    whitened = T.T @ blocks @ T
    rows, columns = np.triu_indices(len(T))
    link = cp.vec(M, order="C")[rows * len(T) + columns] == whitened[:, rows, columns].T @ w
    objective, constraints = c.formulation(M, cp.sum(w), T, float(c.cost(around)))
    program = cp.Problem(cp.Minimize(objective), [link, *constraints])
    assert program.is_dcp()
    with warnings.catch_warnings():
        # Where rounding ends the solver a little before that, what is asked of the answer decides.
        warnings.filterwarnings("ignore", "Solution may be inaccurate", UserWarning)
        program.solve(solver="CLARABEL", tol_gap_rel=SOLVER, tol_gap_abs=SOLVER, tol_feas=SOLVER)
    Y = np.zeros(T.shape)
    Y[rows, columns] = link.dual_value / np.where(rows == columns, 1.0, 2.0)
    weights = np.maximum(w.value, 0.0)
    return float(program.value), weights / weights.sum(), T @ (Y + np.triu(Y, 1).T) @ T.T


def optimum(c: criteria.Relaxable, blocks: Array) -> tuple[Array, Array]:
    """Optimal information (p, p) over the candidates, and the multiplier that proves it.

    The multiplier is semidefinite if the criterion is monotone.
    """
    mean = blocks.mean(axis=0)
    _, weights, Z = solve(c, blocks, mean, whitener(mean))
    return np.tensordot(weights, blocks, axes=1), semidefinite(Z, mean) if c.monotone else Z


def semidefinite(Z: Array, M: Array) -> Array:
    """The positive semidefinite part of Z, taken in the parameters that whiten M."""
    T = whitener(M)
    S = np.linalg.inv(T)
    z, V = np.linalg.eigh(S @ Z @ S.T)
    half = (T @ V) * np.sqrt(np.maximum(z, 0.0))
    return half @ half.T


def candidates(rng: np.random.Generator, n: int, p: int, rows: int = 2) -> Array:
    """Information (n, p, p) of n random candidates of a few rows each."""
    A = rng.normal(size=(n, rows, p))
    return np.swapaxes(A, 1, 2) @ A


def sensitivities(Z: Array, blocks: Array) -> Array:
    """The largest sensitivities (r,) of candidates (n, p, p) to multipliers (r, p, p)."""
    return np.einsum("rij,nij->rn", Z, blocks).max(axis=1)
