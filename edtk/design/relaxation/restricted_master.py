"""The relaxation over a few candidates, by cvxpy."""

import threading
import warnings
from weakref import WeakKeyDictionary

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from criteria import Relaxable
from criteria.linalg.inverse import whitener
from criteria.linalg.triangle import triangle

Array = NDArray[np.float64]
SOLVERS: dict[str, dict[str, float]] = {
    "CLARABEL": {
        "tol_gap_rel": 1e-11,
        "tol_gap_abs": 1e-11,
        "tol_feas": 1e-10,
        "reduced_tol_gap_rel": 1e-7,
    },
    "SCS": {"eps_rel": 1e-9, "eps_abs": 1e-9, "max_iters": 20_000},
}
LOOSE: dict[str, dict[str, float]] = {
    "CLARABEL": {"tol_gap_rel": 1e-4, "tol_gap_abs": 1e-4, "tol_feas": 1e-6}
}
POLISH = "SLSQP"
CHAIN = (*SOLVERS, POLISH)
WHITE = 1e3  # factor by which a design's eigenvalues may be off one and count as white
PRUNE = 1e-7  # weights below this part of the largest are dropped


class RelaxationError(RuntimeError):
    """No design could be found, or none whose certificate could be computed."""


class RestrictedMaster:
    """The relaxation over a few candidates, compiled once by cvxpy and solved for one set of them after another.

    Args:
        criterion: A criterion with a convex form.
        around: A regular design (p, p): the program is written in the parameters that whiten it.
        size: The largest number of candidates.
    """

    def __init__(self, criterion: Relaxable, around: Array, size: int) -> None:
        self.criterion, self.size, self.T = criterion, size, whitener(around)
        p = len(self.T)
        self.rows, self.columns = triangle(p)
        self.w = cp.Variable(size, nonneg=True)
        self.blocks = cp.Parameter((len(self.rows), size))
        M = cp.Variable((p, p), symmetric=True)
        self.balance = cp.vec(M, order="C")[self.rows * p + self.columns] == self.blocks @ self.w
        objective, constraints = criterion.formulation(
            M, cp.sum(self.w), self.T, float(criterion.cost(around))
        )
        self.program = cp.Problem(cp.Minimize(objective), [self.balance, *constraints])

    def suits(self, M: Array, n: int) -> bool:
        """Whether n candidates fit in, and the design M (p, p) is nearly white in the program's parameters."""
        size = np.linalg.eigvalsh(self.T.T @ M @ self.T)
        return bool(n <= self.size and size[0] > 1 / WHITE and size[-1] < WHITE)

    def solve(self, blocks: Array, solver: str, loose: bool = False) -> tuple[Array, Array]:
        """Weights (n,) of sum one over candidates, and the multiplier Z (p, p) that proves them.

        Args:
            blocks: Information of the candidates (n, p, p).
            solver: One of `SOLVERS`, or `POLISH`.
            loose: Whether an answer to a few digits will do, if the solver has such settings.

        Raises:
            RelaxationError: The solver failed; its words are given. An inaccurate answer is no failure: it is
                judged by its certificate.
        """
        try:
            weights, Z = (
                self._polish(blocks) if solver == POLISH else self._solve(blocks, solver, loose)
            )
        except (
            cp.SolverError,
            cp.DCPError,
            np.linalg.LinAlgError,
            ValueError,
            ArithmeticError,
        ) as error:
            raise RelaxationError(f"{solver}: {' '.join(str(error).split())}") from error
        weights = np.where(weights > PRUNE * weights.max(), weights, 0.0)
        weights /= weights.sum()
        if not np.isfinite(self.criterion.cost(np.tensordot(weights, blocks, axes=1))):
            weights = (1 - PRUNE) * weights + PRUNE / len(
                weights
            )  # the optimum leaves a direction all but open
            if not np.isfinite(self.criterion.cost(np.tensordot(weights, blocks, axes=1))):
                raise RelaxationError(f"{solver}: the candidates leave a direction open")
        return weights, Z

    def _solve(self, blocks: Array, solver: str, loose: bool) -> tuple[Array, Array]:
        """By cvxpy; Z is the multiplier of ``M == sum w_i M_i``, and unused places are candidates of no information."""
        n = len(blocks)
        self.blocks.value = np.zeros(self.blocks.shape)
        self.blocks.value[:, :n] = (self.T.T @ blocks @ self.T)[:, self.rows, self.columns].T
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of inaccuracy
            self.program.solve(
                solver=solver, **SOLVERS[solver] | (LOOSE.get(solver, {}) if loose else {})
            )
        answer = self.w.value, self.balance.dual_value
        if (
            any(a is None or not np.isfinite(a).all() for a in answer)
            or not (answer[0][:n] > 0).any()
        ):
            raise ValueError(f"status {self.program.status}")
        Z = np.zeros(self.T.shape)
        Z[self.rows, self.columns] = answer[1] / np.where(self.rows == self.columns, 1.0, 2.0)
        return np.asarray(answer[0][:n]), self.T @ (Z + np.triu(Z, 1).T) @ self.T.T

    def _polish(self, blocks: Array) -> tuple[Array, Array]:
        """By sequential quadratic programming on the weights of a smooth criterion; Z is minus the gradient."""
        criterion, T = self.criterion, self.T
        if not criterion.smooth:
            raise ValueError(f"criterion {criterion.name} is not smooth")
        whitened, S = T.T @ blocks @ T, np.linalg.inv(T)

        def log_cost(w: Array) -> tuple[float, Array]:
            M = S.T @ np.tensordot(w, whitened, axes=1) @ S
            cost = float(criterion.cost(M))
            if not np.isfinite(cost):
                return 1e3, np.zeros_like(w)
            return float(np.log(cost)), np.einsum(
                "ij,nij->n", S @ criterion.gradient(M) @ S.T, whitened
            ) / cost

        result = minimize(
            log_cost,
            np.full(len(blocks), 1.0 / len(blocks)),
            jac=True,
            method="SLSQP",
            bounds=[(0.0, 1.0)] * len(blocks),
            constraints=[{"type": "eq", "fun": lambda w: w.sum() - 1.0, "jac": np.ones_like}],
            options={"maxiter": 300, "ftol": 1e-13},
        )
        weights = np.maximum(result.x, 0.0)
        return weights, -criterion.gradient(np.tensordot(weights / weights.sum(), blocks, axes=1))


class _Compiled(threading.local):
    """The last program of every criterion that is in use, in this thread: compiling takes longer than solving."""

    def __init__(self) -> None:
        self.masters: WeakKeyDictionary[Relaxable, RestrictedMaster] = WeakKeyDictionary()


_compiled = _Compiled()


def restricted_master_for(criterion: Relaxable, around: Array, size: int) -> RestrictedMaster:
    """A master for `size` candidates in which the design `around` (p, p) is nearly white; the last one if it suits."""
    master = _compiled.masters.get(criterion)
    if master is None or master.T.shape != around.shape or not master.suits(around, size):
        master = _compiled.masters[criterion] = RestrictedMaster(criterion, around, size)
    return master
