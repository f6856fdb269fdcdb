"""What methods for restricted masters share: the central path, equations and information."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, Protocol, Self, TypeVar

import numpy as np

from criteria.linalg.inverse import eigenpairs, whitener_of_regular
from criteria.linalg.models import Models
from criteria.linalg.typing import triangle
from criteria.relaxable import SpectralBand
from edtk.design.problem import Problem
from edtk.design.relaxation.proof import experiment_blocks, experiment_entries
from edtk.system.typing import Array, Indices

TOWARDS_BOUNDARY = 0.95  # part of the way to the boundary that a step may take
SHORTEST = 1e-6  # a shorter step counts as none
JAMMED = 0.1  # a shorter one is made towards the central path instead
SPREAD = 0.5  # part of the first weights that is spread over all candidates
# Order up to which whole matrices are as quick as rows, which of packed candidates would have to
# be factorized first.
SMALL_ORDER = 12
CHUNK = 2**21  # entries of whole matrices that are formed at a time
# How many more candidates than entries of a triangle make the equations of the entries cheaper.
MANY = 1.2
# Largest entry of their equations: rounding of it is then a thousandth of what is asked for.
LARGEST = 1e12
MOST_FEW = 1000  # candidates whose own equations are affordable where it is larger
# Size of the other term at which six digits of the identity are left.
CANCELLED = 1e10


def step_length(x: Array, dx: Array, most: float = TOWARDS_BOUNDARY) -> float:
    """The length, at most one, of a step along dx (k,) from x (k,) above zero.

    Args:
        x: Positive numbers.
        dx: Their changes.
        most: Part of the way to the first zero that the step may go.
    """
    fastest = -(dx / x).min(initial=0.0)
    return float(min(1.0, most / fastest)) if fastest > 0 else 1.0


Along = TypeVar("Along")


class PathPoint(ABC, Generic[Along]):
    """A point inside all constraints, on its way to an optimum along the central path.

    On that path the products of primal numbers and their duals, which are complementary at an
    optimum, are all the same mu. Mehrotra's predictor, a step straight to the optimum, tells how
    small the next mu can be, and which products of changes the corrector has to make up for
    (Nocedal and Wright, Numerical Optimization, chapter 14).

    Attributes:
        steps: Steps at most; ten are the rule.
        least_shrinking: Of the products in one step.
        worse: Factor by which rounding raises the error again, after which no step helps.
    """

    steps: ClassVar[int] = 60
    least_shrinking: ClassVar[float] = 1e-4
    worse: ClassVar[float] = float("inf")

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of products."""

    @property
    @abstractmethod
    def mu(self) -> float:
        """Their mean."""

    @property
    @abstractmethod
    def error(self) -> float:
        """How far the conditions of an optimum are from holding."""

    @property
    def is_astray(self) -> bool:
        """Whether the equations of the duals have to be met before the products may shrink."""
        return False

    @abstractmethod
    def directions(self) -> Callable[[float, Along | None], Along]:
        """The equations of a step, factorized: from mu and the predictor, if any, to changes."""

    @abstractmethod
    def lengths(self, along: Along) -> tuple[float, float]:
        """How far primal and dual may go along some changes."""

    @abstractmethod
    def products_after(self, along: Along, primal: float, dual: float) -> float:
        """The sum of the products at the end of such a step."""

    @abstractmethod
    def moved(self, along: Along, primal: float, dual: float) -> Self | None:
        """The point there; None where it is not inside, or no better."""

    def step(self) -> Self | None:
        """The next point; None where no step leads nearer."""
        direction = self.directions()
        predictor = direction(0.0, None)
        reached = self.products_after(predictor, *self.lengths(predictor))
        ratio = reached / (self.mu * self.count)
        found = None
        if not self.is_astray:
            target = self.mu * min(1.0, max(ratio**3, self.least_shrinking))
            found, length = self._end(direction(target, predictor))
            if length > JAMMED:
                return found
        # Close to a bound steps stay short until the products are alike again.
        return self._end(direction(self.mu, None))[0] or found

    def _end(self, along: Along) -> tuple[Self | None, float]:
        """The end of a step, None where none leads nearer, and its length in the primal."""
        primal, dual = self.lengths(along)
        while primal > SHORTEST:
            found = self.moved(along, primal, dual)
            if found is not None:
                return found, primal
            primal *= 0.5
        return None, 0.0


P = TypeVar("P", bound=PathPoint[Any])


def nearest_point(first: P, accuracy: float) -> P:
    """The point of the least error among those of the path, which ends below an accuracy."""
    point = first
    best = first
    for _ in range(first.steps):
        if best.error <= accuracy or point.error > first.worse * best.error:
            break
        try:
            step = point.step()
        except np.linalg.LinAlgError:
            # Where matrices are singular to rounding, the answer is as good as it can be.
            break
        if step is None:
            break
        point = step
        best = point if point.error < best.error else best
    return best


def definite_duals(band: SpectralBand, near: Array) -> Array:
    """Duals Y and Z (c, p, p) of the inequalities of a band, of a multiplier ``Y - R Z R'``.

    At an optimum ``R^-1 Y R^-T`` and Z have no direction in common where the floor is the identity
    too, so that they are the positive and the negative part of ``R^-1 near R^-T``. Z gets the trace
    a that its equation asks for; the length of Y is open.

    Args:
        band: The program.
        near: The multiplier (p, p).

    Returns:
        Y, and Z where there is an upper bound.
    """
    S = np.linalg.inv(band.cap)
    z, V = eigenpairs(S @ near @ S.T)
    F = band.cap @ V
    above = (F * np.maximum(z, 0.0)) @ F.T
    if not band.a:
        return above[None]
    below = (V * np.maximum(-z, 0.0)) @ V.T
    length = float(np.trace(below))
    # A multiplier without negative part says nothing about the upper bound: all directions alike.
    if length <= 0:
        below = np.eye(len(V))
        length = float(len(V))
    return np.stack([above, below * (band.a / length)])


class Priced(Protocol):
    """Candidates that tell their sensitivities, such as a `Problem` or an `ActiveInformation`."""

    def sensitivities(self, Z: Array) -> Array:
        """``<Z, M_i>`` (k,) of a symmetric Z (p, p)."""
        ...


def leverages(candidates: Priced, weights: Array, M: Array) -> Array:
    """Leverages ``l_i = w_i <M^-1, M_i>`` (k,) of the candidates of a design M; their sum is p.

    Without candidates of leverages that add up to l there remains ``(1 - l) M`` at least, in the
    order of matrices, since ``w_i M_i <= l_i M``. So the sensitivities to the gradient change by a
    part of the order of l. That does not follow from light weights: near a singular optimum all
    that is told about some direction comes from candidates of vanishing weight, and the gradient,
    whose limit is the multiplier of the singular optimum, depends on the ratios of these weights.

    Args:
        candidates: The candidates (k).
        weights: Their weights (k,).
        M: ``sum_i w_i M_i`` (p, p).

    Returns:
        The leverages; zeros where M is singular to working precision.
    """
    T = whitener_of_regular(M)
    return np.zeros(len(weights)) if T is None else weights * candidates.sensitivities(T @ T.T)


class ActiveInformation(ABC):
    """Information M_i (p, p) of one experiment in each of a few candidates, the prior included."""

    @staticmethod
    def of(problem: Problem, active: Indices) -> "ActiveInformation":
        """The information of some candidates (k,) of a problem."""
        models = problem.models
        if len(models) > 1 and (problem.prior is None or models.are_apart(problem.prior)):
            return _Blocks(experiment_entries(problem, active), models)
        if problem.p <= SMALL_ORDER:
            return ActiveInformation.of_blocks(experiment_blocks(problem, active))
        return _Rows(problem[active].factors(), problem.prior)

    @staticmethod
    def of_blocks(blocks: Array) -> "ActiveInformation":
        """Information that is given as matrices (k, p, p)."""
        return _Blocks(blocks.reshape(len(blocks), -1), Models.single(blocks.shape[-1]))

    @abstractmethod
    def information(self, weights: Array) -> Array:
        """``sum_i w_i M_i`` (p, p) of weights (k,)."""

    @abstractmethod
    def sensitivities(self, Z: Array) -> Array:
        """``<Z, M_i>`` (k,) of a symmetric Z (p, p)."""

    def triangles(self, T: Array, scale: Array) -> Array:
        """Scaled upper triangles (q, k) of ``T' M_i T``.

        Args:
            T: Matrix (p, s), where q = s (s + 1)/2.
            scale: Factor (q,) of each entry.
        """
        return self._triangles(T, *triangle(T.shape[1]), scale)

    def told_triangles(self, T: Array, scale: Array) -> Array:
        """Those rows of `triangles` that are not zero for all candidates, whatever these are."""
        return self.triangles(T, scale)

    @abstractmethod
    def _triangles(self, T: Array, rows: Indices, columns: Indices, scale: Array) -> Array:
        """The entries of ``T' M_i T`` in some rows and columns (q,)."""


@dataclass(frozen=True, eq=False)
class _Blocks(ActiveInformation):
    """The entries (k, e) of block diagonal matrices, of one block or of several.

    Attributes:
        flat: The entries, in the order of `Models.entries`.
        models: Where the blocks stand.
    """

    flat: Array
    models: Models

    def information(self, weights: Array) -> Array:
        found = np.zeros((self.models.p, self.models.p))
        found[self.models.entries] = weights @ self.flat
        return found

    def sensitivities(self, Z: Array) -> Array:
        return np.asarray(self.flat @ Z[self.models.entries])

    def _triangles(self, T: Array, rows: Indices, columns: Indices, scale: Array) -> Array:
        # vec(T' M T) is linear in vec(M): one product for all candidates.
        of_rows, of_columns = self.models.entries
        change = T.take(rows, axis=1).take(of_rows, axis=0)
        change *= T.take(columns, axis=1).take(of_columns, axis=0)
        change *= scale
        return np.asarray(change.T @ self.flat.T)

    def told_triangles(self, T: Array, scale: Array) -> Array:
        if len(self.models) == 1:
            return self.triangles(T, scale)
        # Columns tell something together that have a model in common, but for rounding.
        squares = np.square(T)
        parts = np.array([squares[own].sum(axis=0) for own in self.models.parts])
        has = (parts > np.square(np.finfo(float).eps) * parts.sum(axis=0)).astype(float)
        rows, columns = triangle(T.shape[1])
        told = (has.T @ has)[rows, columns] > 0
        return self._triangles(T, rows[told], columns[told], scale[told])


@dataclass(frozen=True, eq=False)
class _Rows(ActiveInformation):
    """Rows U (k, r, p) of ``M_i = M0 + U_i' U_i``, and the prior M0 (p, p) or None."""

    factors: Array
    prior: Array | None

    def information(self, weights: Array) -> Array:
        p = self.factors.shape[-1]
        rows = (self.factors * np.sqrt(weights)[:, None, None]).reshape(-1, p)
        M = rows.T @ rows
        return M if self.prior is None else M + weights.sum() * self.prior

    def sensitivities(self, Z: Array) -> Array:
        found = np.einsum("kri,kri->k", self.factors @ Z, self.factors)
        return found if self.prior is None else found + np.vdot(Z, self.prior)

    def _triangles(self, T: Array, rows: Indices, columns: Indices, scale: Array) -> Array:
        U = self.factors @ T
        P = np.empty((len(rows), len(U)))
        step = max(1, CHUNK // T.size)
        for start in range(0, len(U), step):
            part = U[start : start + step]
            whole = np.swapaxes(part, 1, 2) @ part
            P[:, start : start + step] = whole[:, rows, columns].T
        if self.prior is not None:
            P += (T.T @ self.prior @ T)[rows, columns, None]
        P *= scale[:, None]
        return P


Solve = Callable[[Array], Array]


def weight_equations(P: Array, D: Array, lost: Array | None = None, most: float = MANY) -> Solve:
    """Prepare ``(P'P + diag(D) - l l') x = b`` for several right-hand sides.

    For k candidates and q rows of P, either the (k, k) matrix is factorized, or the (q, q) matrix
    ``I + P D^-1 P'`` of Woodbury's identity, whichever is smaller.

    Args:
        P: Matrix (q, k).
        D: Numbers (k,), at least zero.
        lost: Vector l (k,) of a square that is taken away, after which the matrix must still be
            positive definite; None for none.
        most: Candidates per row of P from which on Woodbury's identity is used, which is less
            accurate.

    Returns:
        A function from b (k,) to x (k,).

    Raises:
        LinAlgError: The matrix is not positive definite to working precision.
    """
    solve = _solver(P, D, most)
    if lost is None:
        return solve
    y = solve(lost)
    rest = 1.0 - lost @ y
    # Rounding may leave nothing of a rest that is positive in truth; then the square is not taken
    # away, which makes the step shorter.
    if rest <= np.finfo(float).eps:
        return solve

    def corrected(b: Array) -> Array:
        return np.asarray(solve(b) + y * (y @ b / rest))

    return corrected


def _solver(P: Array, D: Array, most: float) -> Solve:
    """The solution without the square that is taken away."""
    k = P.shape[1]
    if k <= most * len(P):
        return _few(P, D)
    scaled = P / np.sqrt(D)
    K = scaled @ scaled.T
    diagonal = K.reshape(-1)[:: len(K) + 1]
    # Near the optimum D vanishes on the support, and Woodbury's identity is a difference of large
    # numbers.
    if k <= MOST_FEW and diagonal.max() > LARGEST:
        return _few(P, D)
    diagonal += 1.0
    return _many(P, D, K)


def _few(P: Array, D: Array) -> Solve:
    """By the matrix of the candidates (k, k)."""
    H = P.T @ P
    diagonal = H.reshape(-1)[:: len(H) + 1]
    # Candidates that tell the same make H singular where D vanishes; rounding must not make it
    # indefinite.
    diagonal += D + len(D) * np.finfo(float).eps * diagonal
    by_factors = _factorized(H)

    def solve(b: Array) -> Array:
        x = by_factors(b)
        # Near the optimum H is ill-conditioned; one refinement saves the last digits of a step.
        return x + by_factors(b - P.T @ (P @ x) - D * x)

    return solve


def _many(P: Array, D: Array, K: Array) -> Solve:
    """By the matrix ``K = I + P D^-1 P'`` of the entries (q, q), which is overwritten."""
    by_factors = _factorized(K)

    def solve(b: Array) -> Array:
        x = b / D
        return np.asarray(x - (P.T @ by_factors(P @ x)) / D)

    return solve


def _factorized(K: Array) -> Solve:
    """The solutions ``K^-1 b`` of a symmetric K (n, n), which is overwritten.

    LAPACK is called as it is: for a few dozen unknowns the checks around it take ten times as long.

    Raises:
        LinAlgError: K is not positive definite to working precision.
    """
    from scipy.linalg.lapack import dpotrf, dpotrs

    factor, failed = dpotrf(K.T, lower=1, clean=0, overwrite_a=1)
    if failed:
        raise np.linalg.LinAlgError("the equations are not positive definite")

    def solve(b: Array) -> Array:
        return np.asarray(dpotrs(factor, b, lower=1)[0])

    return solve


ConicSolve = Callable[[Array, Array, float], tuple[Array, float, Array]]


def conic_equations(P: Array, D: Array, last: Array | None) -> ConicSolve:
    """Prepare the equations of weights x, a free number z and packed duals y:

        y + P x + l z = c,    D x - P' y = d,    l' y = u.

    Without duals they are those of `weight_equations`. Where there are more weights than rows, the
    weights are eliminated instead, ``(I + P D^-1 P') y + l z = c - P D^-1 d``, as long as the
    identity is not lost in rounding beside the other term.

    Args:
        P: Matrix (q, k).
        D: Positive numbers (k,).
        last: The vector l (q,); None where there is no z.

    Returns:
        A function from c (q,), d (k,) and u to x (k,), z and y (q,).

    Raises:
        LinAlgError: A matrix is not positive definite to working precision.
    """
    if P.shape[1] > len(P):
        scaled = P / np.sqrt(D)
        if np.einsum("qk,qk->", scaled, scaled) < CANCELLED:
            return _by_duals(P, scaled, D, last)
    return _by_weights(P, D, last)


def _by_weights(P: Array, D: Array, last: Array | None) -> ConicSolve:
    """By the equations of the weights, of which z is one more that may have any sign."""
    whole = P
    if last is not None:
        whole = np.column_stack([P, last])
        D = np.append(D, 0.0)
    few = weight_equations(whole, D, most=np.inf)

    def solve(c: Array, d: Array, u: float) -> tuple[Array, float, Array]:
        right = whole.T @ c
        k = P.shape[1]
        right[:k] += d
        right[k:] -= u
        found = few(right)
        return found[:k], float(found[k:].sum()), c - whole @ found

    return solve


def _by_duals(P: Array, scaled: Array, D: Array, last: Array | None) -> ConicSolve:
    """By the equations of the duals."""
    S = scaled @ scaled.T
    S.reshape(-1)[:: len(S) + 1] += 1.0
    by_factors = _factorized(S)
    along = None if last is None else by_factors(last)

    def solve(c: Array, d: Array, u: float) -> tuple[Array, float, Array]:
        y = by_factors(c - P @ (d / D))
        z = 0.0
        if last is not None and along is not None:
            z = float((last @ y - u) / (last @ along))
            y = y - z * along
        return (d + P.T @ y) / D, z, y

    return solve
