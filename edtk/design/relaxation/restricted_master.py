"""The restricted master problem: the relaxation over a few candidates, solved by cvxpy."""

import threading
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from time import monotonic
from weakref import WeakKeyDictionary

import numpy as np

from criteria import Relaxable
from criteria.linalg.inverse import guarded_inverse, whitener, whitener_of_regular
from criteria.linalg.typing import triangle
from edtk.design.relaxation.master_equations import ActiveInformation, leverages
from edtk.design.relaxation.proof import Step, rounding_of_inverse
from edtk.system.interruptible import interruptible
from edtk.system.time_limit import time_of_program
from edtk.system.typing import Array

TIME_LIMIT = {"CLARABEL": "time_limit", "SCS": "time_limit_secs"}  # what solvers call it
SCS_INTERRUPTED = -5  # SCS takes Ctrl-C for itself
POLISH = "SLSQP"
WHITE = 1e3  # factor by which a design's eigenvalues may differ from one and count as white
PRUNE = 1e-7  # weights below this part of the largest are dropped: the solvers' inaccuracy
# Relative error of a cost above which a design is too near to a singular one, if a little weight on
# every candidate leaves this part of the error at most.
BLURRED_COST = 1e-8
SHARPER = 0.5
# Least eigenvalue at unit diagonal that a little weight on every candidate exceeds.
NEARLY_SINGULAR = 1e-10
POLISH_OPTIONS = {"maxiter": 300, "ftol": 1e-13}
LOG_COST_OF_SINGULAR = 1e3  # larger than the log of any cost that a double can hold
NEWTON = "NEWTON"
# Programs over so many take hardly longer than those over half of them, and fewer are solved.
LEAST_BATCH = 100
# Candidates per parameter that enter per round: the support grows with the number of parameters.
BATCH_PER_PARAMETER = 4
# Accuracy of Newton's method in parts of the gap that the candidates outside leave, and where they
# leave none.
INNER = 0.05
FINEST = 1e-10
# While the gap is above this, cvxpy solves a program to a few digits: its multiplier is good enough
# to say which candidates should enter, and the solver takes fewer iterations.
FAR = 0.05
# Parameters from which on a program of cvxpy takes longer than anyone waits for the last digit.
TOO_MANY = 40


# Tolerances as sharp as the solvers can reach on programs of order one: a bound loses what they
# leave. Clarabel often stalls a little above 1e-11; an answer to 1e-7 then counts as solved, since
# the certificate decides what it is worth.
SOLVERS: dict[str, dict[str, float]] = {
    "CLARABEL": {
        "tol_gap_rel": 1e-11,
        "tol_gap_abs": 1e-11,
        "tol_feas": 1e-10,
        "reduced_tol_gap_rel": 1e-7,
    },
    "SCS": {"eps_rel": 1e-9, "eps_abs": 1e-9, "max_iters": 20_000},
}
# Tolerances of an answer that only has to say which candidates should enter.
LOOSE: dict[str, dict[str, float]] = {
    "CLARABEL": {"tol_gap_rel": 1e-4, "tol_gap_abs": 1e-4, "tol_feas": 1e-6}
}
CHAIN = (*SOLVERS, POLISH)  # interior points are the most accurate, splitting the most robust


class RelaxationError(RuntimeError):
    """No design could be found, or none whose certificate could be computed."""


class RestrictedMaster:
    """The relaxation over a few candidates, compiled once and solved for set after set of them.

    Args:
        criterion: A criterion with a convex form.
        around: A regular design (p, p). The program is written in the parameters that whiten it.
        size: The largest number of candidates.
    """

    def __init__(self, criterion: Relaxable, around: Array, size: int) -> None:
        import cvxpy as cp

        self.criterion = criterion
        self.size = size
        self.T = whitener(around)
        p = len(self.T)
        self.rows, self.columns = triangle(p)
        self.w = cp.Variable(size, nonneg=True)
        self.packed = cp.Parameter((len(self.rows), size))
        M = cp.Variable((p, p), symmetric=True)
        upper = cp.vec(M, order="C")[self.rows * p + self.columns]
        self.balance = upper == self.packed @ self.w
        objective, constraints = criterion.formulation(
            M, cp.sum(self.w), self.T, float(criterion.cost(around))
        )
        self.program = cp.Problem(cp.Minimize(objective), [self.balance, *constraints])
        # cvxpy takes this compiler by itself if there are many parameters. With fewer it takes one
        # that compiles to the same numbers, two to three times as slowly. Old versions lack it.
        has_fast_compiler = hasattr(cp.settings, "COO_CANON_BACKEND")
        self.compiling = {"canon_backend": "COO"} if has_fast_compiler else {}

    def suits(self, M: Array, n: int) -> bool:
        """Whether the program has places for n candidates and nearly whitens M (p, p)."""
        eigenvalues = np.linalg.eigvalsh(self.T.T @ M @ self.T)
        is_white = eigenvalues[0] > 1 / WHITE and eigenvalues[-1] < WHITE
        return bool(n <= self.size and is_white)

    def solve(self, blocks: Array, solver: str, loose: bool = False) -> tuple[Array, Array]:
        """Find the best weights of candidates, and the multiplier that proves them.

        An inaccurate answer is no failure: its certificate tells what it is worth.

        Args:
            blocks: Information of one experiment in each candidate (n, p, p).
            solver: One of `SOLVERS`, or `POLISH`.
            loose: Whether an answer to a few digits will do, if the solver has such settings.

        Returns:
            Weights (n,) of sum one, and the multiplier Z (p, p) of ``M == sum_i w_i M_i``.

        Raises:
            RelaxationError: The solver failed; the message has its words.
        """
        import cvxpy as cp

        try:
            if solver == POLISH:
                weights, Z = self._polish(blocks)
            else:
                weights, Z = self._solve(blocks, solver, loose)
        except (
            cp.SolverError,
            cp.DCPError,
            np.linalg.LinAlgError,
            ValueError,
            ArithmeticError,
            MemoryError,
            TimeoutError,
        ) as error:
            raise RelaxationError(f"{solver}: {' '.join(str(error).split())}") from error
        information = ActiveInformation.of_blocks(blocks)
        return regular_weights(self.criterion, information, weights, solver), Z

    def solve_by_first(
        self, blocks: Array, solvers: Sequence[str], loose: bool
    ) -> tuple[Array, Array, str]:
        """Find weights and multiplier by the first solver of several that has an answer.

        Args:
            blocks: Information of one experiment in each candidate (n, p, p).
            solvers: The solvers in the order in which they are tried.
            loose: See `solve`.

        Returns:
            Weights (n,), multiplier (p, p), and the name of the solver.

        Raises:
            RelaxationError: All failed; the message has the words of each.
        """
        failures = []
        for solver in solvers:
            try:
                return *self.solve(blocks, solver, loose), solver
            except RelaxationError as error:
                failures.append(str(error))
        raise RelaxationError(
            f"no solver found a design for criterion {self.criterion.name} ({'; '.join(failures)})"
        )

    def _solve(self, blocks: Array, solver: str, loose: bool) -> tuple[Array, Array]:
        """Weights (n,) and multiplier (p, p) by a solver of cvxpy's."""
        n = len(blocks)
        # Places without a candidate hold one of no information.
        self.packed.value = np.zeros(self.packed.shape)
        whitened = self.T.T @ blocks @ self.T
        self.packed.value[:, :n] = whitened[:, self.rows, self.columns].T
        options = SOLVERS[solver] | (LOOSE.get(solver, {}) if loose else {})
        options |= {TIME_LIMIT[solver]: time_of_program()}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of inaccuracy, which the certificate measures
            self._run(solver, options)
        weights = self.w.value
        dual = self.balance.dual_value
        has_answer = all(x is not None and np.isfinite(x).all() for x in (weights, dual))
        if not has_answer or not (weights[:n] > 0).any():
            raise ValueError(f"status {self.program.status}")
        # An entry beside the diagonal stands in one equation, but twice in <Z, M>.
        upper = np.zeros(self.T.shape)
        upper[self.rows, self.columns] = dual / np.where(self.rows == self.columns, 1.0, 2.0)
        return np.asarray(weights[:n]), self.T @ (upper + np.triu(upper, 1).T) @ self.T.T

    def _run(self, solver: str, options: dict[str, float]) -> None:
        """Solve the program, as its `solve` does, and hear Ctrl-C while that goes on.

        Raises:
            KeyboardInterrupt: Also where the solver has taken the signal for itself.
        """
        program = self.program
        data, chain, inverse = program.get_problem_data(
            solver, solver_opts=options, **self.compiling
        )
        try:
            solution = interruptible(
                lambda: chain.solve_via_data(program, data, warm_start=True, solver_opts=options)
            )
        except KeyboardInterrupt:
            # The solver may still be at it: nobody else shall use its program.
            _compiled.programs.pop(self.criterion, None)
            raise
        if solver == "SCS" and solution["info"]["status_val"] == SCS_INTERRUPTED:
            raise KeyboardInterrupt
        program.unpack_results(solution, chain, inverse)

    def _polish(self, blocks: Array) -> tuple[Array, Array]:
        """Weights (n,) of a smooth criterion by sequential quadratic programming, from equal ones.

        The multiplier is minus the gradient. The log of the cost is minimised, which is of order
        one in any units.
        """
        from scipy.optimize import minimize

        if not self.criterion.smooth:
            raise ValueError(f"criterion {self.criterion.name} is not smooth")
        criterion = self.criterion
        whitened = self.T.T @ blocks @ self.T
        S = np.linalg.inv(self.T)
        end = monotonic() + time_of_program()

        def log_cost(w: Array) -> tuple[float, Array]:
            if monotonic() > end:
                raise TimeoutError("time limit")
            M = S.T @ np.tensordot(w, whitened, axes=1) @ S
            cost = float(criterion.cost(M))
            if not np.isfinite(cost):
                return LOG_COST_OF_SINGULAR, np.zeros_like(w)
            G = S @ criterion.gradient(M) @ S.T
            return float(np.log(cost)), np.einsum("ij,nij->n", G, whitened) / cost

        result = minimize(
            log_cost,
            np.full(len(blocks), 1.0 / len(blocks)),
            jac=True,
            method=POLISH,
            bounds=[(0.0, 1.0)] * len(blocks),
            constraints=[{"type": "eq", "fun": lambda w: w.sum() - 1.0, "jac": np.ones_like}],
            options=POLISH_OPTIONS,
        )
        weights = np.maximum(result.x, 0.0)
        M = np.tensordot(weights / weights.sum(), blocks, axes=1)
        return weights, -criterion.gradient(M)


def regular_weights(
    criterion: Relaxable,
    active: ActiveInformation,
    weights: Array,
    solver: str,
    lost: float | None = None,
) -> Array:
    """Weights of sum one and of finite cost, without those that are only inaccuracy.

    Args:
        criterion: What the weights minimise.
        active: Information of the candidates (k).
        weights: Weights (k,) as a solver gives them.
        solver: Its name, for the message.
        lost: Share of all weights that the dropped ones may have together; by default each weight
            below 1e-7 of the largest is dropped, unless it is all that some direction has.

    Raises:
        RelaxationError: The candidates leave a direction open.
    """
    if lost is None:
        weights = _without_light(active, weights)
    else:
        order = np.argsort(weights)
        light = order[np.cumsum(weights[order]) <= lost * weights.sum()]
        weights = weights.copy()
        weights[light] = 0.0
    weights /= weights.sum()
    M = active.information(weights)
    is_regular, blurred = _judged(criterion, M)
    if is_regular and blurred <= BLURRED_COST:
        return weights
    # The optimum may leave a direction of the parameters all but open. A little weight on every
    # candidate closes it, and costs less than the gaps that are asked for.
    closed = (1 - PRUNE) * weights + PRUNE / len(weights)
    M = active.information(closed)
    is_closed, rounding = _judged(criterion, M)
    if is_closed and (not is_regular or rounding <= SHARPER * blurred):
        return closed
    if is_regular:
        return weights
    if np.isfinite(criterion.cost(M)):
        return closed  # too near to singular to whiten by, which programs do not insist on
    raise RelaxationError(f"{solver}: the candidates leave a direction open")


def _without_light(active: ActiveInformation, weights: Array) -> Array:
    """Weights (k,) without those that are both light and of no leverage."""
    is_light = weights <= PRUNE * weights.max()
    if not is_light.any():
        return weights
    carried = leverages(active, weights, active.information(weights))
    return np.where(is_light & (carried <= PRUNE), 0.0, weights)


def is_clearly_regular(M: Array) -> bool:
    """Whether a design M (p, p) is far enough from singular to whiten others."""
    return bool(guarded_inverse(M, NEARLY_SINGULAR)[2])


def _judged(criterion: Relaxable, M: Array) -> tuple[bool, float]:
    """Whether a design M (p, p) can whiten the next program, and its `rounding_of_inverse`."""
    T = whitener_of_regular(M)
    if T is None:
        return False, np.inf
    # Other costs may be finite where M is singular, or too near to that to be whitened by.
    is_regular = criterion.needs_all or is_clearly_regular(M)
    return is_regular, rounding_of_inverse(M, np.square(T).sum(axis=1))


class _Compiled(threading.local):
    """The last program of every criterion in use, in this thread.

    Compiling takes longer than solving, and a program cannot be solved by two threads at once.
    """

    def __init__(self) -> None:
        self.programs: WeakKeyDictionary[Relaxable, RestrictedMaster] = WeakKeyDictionary()


_compiled = _Compiled()


def restricted_master_for(criterion: Relaxable, around: Array, size: int) -> RestrictedMaster:
    """A program for a criterion, the one used last if it suits, otherwise a new one.

    Args:
        criterion: A criterion with a convex form.
        around: A regular design (p, p) that must be nearly white in the program's parameters.
        size: Number of candidates that the program must have places for.
    """
    program = _compiled.programs.get(criterion)
    suits = program is not None and program.T.shape == around.shape and program.suits(around, size)
    if program is None or not suits:
        program = RestrictedMaster(criterion, around, size)
        _compiled.programs[criterion] = program
    return program


# Newton's method knows smooth criteria only; the others' programs are cvxpy's.
SOLVERS_IN_TURN = (NEWTON, *CHAIN)


@dataclass(frozen=True)
class SolverOptions:
    """Limits and solvers of column generation; the defaults suit every built-in criterion.

    Attributes:
        rounds: Limit on the number of restricted master problems per convex program.
        batch: Candidates that enter the restricted master problem per round, at most; defaults to
            100, and to more where there are more than 25 parameters.
        solvers: Names from `SOLVERS_IN_TURN`, the first to be tried first.
        few: Whether a design for a part of the parameters rests on as few candidates as that part
            needs, and not M: a search that goes on from a design learns more from all of them.

    Raises:
        ValueError: A solver is unknown, none is given, or rounds or batch are below one.
    """

    rounds: int = 60
    batch: int | None = None
    solvers: tuple[str, ...] = SOLVERS_IN_TURN
    few: bool = True

    def __post_init__(self) -> None:
        unknown = [solver for solver in self.solvers if solver not in SOLVERS_IN_TURN]
        if unknown:
            known = ", ".join(SOLVERS_IN_TURN)
            raise ValueError(f"unknown solver {unknown[0]!r}; available: {known}")
        if self.rounds < 1 or self.batch_of(1) < 1 or not self.solvers:
            raise ValueError("rounds and batch must be at least one, and there must be a solver")

    def batch_of(self, p: int) -> int:
        """The batch for p parameters."""
        return max(LEAST_BATCH, BATCH_PER_PARAMETER * p) if self.batch is None else self.batch


@dataclass(frozen=True)
class Effort:
    """How accurately the next program is solved, and by which solvers in turn."""

    solvers: tuple[str, ...]
    accuracy: float

    @property
    def loose(self) -> bool:
        """Whether an answer to a few digits will do."""
        return self.accuracy > FINEST

    def after(
        self, step: Step, inaccurate: bool, gap: float, p: int, is_proved: bool = False
    ) -> "Effort":
        """The effort for the next program: more where the last answer was too inaccurate.

        Args:
            step: The last answer.
            inaccurate: Whether it was too inaccurate to say which candidates should enter.
            gap: The relative gap that it left.
            p: Number of parameters.
            is_proved: Whether this gap is small enough, so that a last program only sharpens it.
        """
        solvers = self.solvers
        if is_proved and step.solver == NEWTON:
            # Where the method breaks down now, no program of cvxpy's is worth its time and memory.
            solvers = (NEWTON,)
        if inaccurate and not self.loose:
            solvers = solvers[solvers.index(step.solver) + 1 :]
            if step.solver == NEWTON and p > TOO_MANY:
                solvers = ()
        by_newton = step.solver == NEWTON
        can_be_loose = self.loose and not inaccurate and (by_newton or gap > FAR)
        return Effort(solvers, max(INNER * gap, FINEST) if can_be_loose else FINEST)
