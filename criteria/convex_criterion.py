"""Convex criteria: from one cvxpy expression of the cost, everything else follows."""

import warnings
from typing import TYPE_CHECKING

import numpy as np

from criteria.criterion import Criterion
from criteria.errors import CriterionError
from criteria.linalg.inverse import whitener
from criteria.linalg.spectrum import is_semidefinite
from criteria.linalg.typing import Array
from criteria.relaxable import Formulation, Relaxable, Transformed

if TYPE_CHECKING:
    import cvxpy as cp

# Distance at which a whitened Z of unit trace counts as minus the gradient: it allows for rounding,
# and is far below what would show in a bound.
SAME_DIRECTION = 1e-12
# The sharpest tolerance comes first, since a bound loses what the solver leaves; a looser one is
# tried where the solver does not reach it.
TOLERANCES = (1e-10, 1e-9, 1e-8)
SAFETY = 1e-7  # part by which a solver's optimum is lowered: ten times the loosest tolerance


def require_expression(found: object, place: str) -> "cp.Expression":
    """Check that a criterion's code has returned a scalar expression of cvxpy.

    Args:
        found: What the code has returned.
        place: The code, for the message: "criterion 'mine': its expression".

    Raises:
        CriterionError: It is something else, or has more than one entry.
    """
    import cvxpy as cp

    if not isinstance(found, cp.Expression):
        raise CriterionError(
            f"{place} returns an object of type {type(found).__name__}; expected a scalar "
            "expression of cvxpy"
        )
    if not found.is_scalar():
        raise CriterionError(
            f"{place} has shape {found.shape}; expected a scalar expression of cvxpy"
        )
    return found


class ConvexCriterion(Relaxable):
    """A criterion that is convex in M.

    Write `expression`, and the criterion is complete: cost, gradient and polar are then read off
    it, slowly. Closed forms of `_cost`, `_gradient` and `polar` replace them one by one. A
    criterion that is convex without an expression of its own writes these three, and `formulation`.
    """

    def expression(self, M: "cp.Expression", T: Array | None = None) -> "cp.Expression":
        """Convex cvxpy expression of ``cost**expression_power``.

        Args:
            M: Symmetric (p, p) expression: the information of k', where k = T k'.
            T: Regular matrix (p, p) that whitens badly scaled parameters; None for the identity.
                The expression's value is that of ``cost(T^-T M T^-1)``.

        Raises:
            NotImplementedError: The criterion has no such form.
        """
        raise NotImplementedError(f"criterion {self.name} has no convex expression")

    def polar(self, Z: Array, M: Array) -> float:
        """A lower bound on ``cost(X)`` over all X with ``<Z, X> <= 1``: what a multiplier Z proves.

        Where Z is minus the gradient of a smooth criterion at M, M is the best X up to its length,
        and by homogeneity the answer is ``cost(M) <Z, M>^degree``. Otherwise a convex program of
        size p answers. A criterion that knows its polar in closed form needs no solver's word.

        Args:
            Z: Symmetric positive semidefinite multiplier (p, p).
            M: A regular design (p, p), near which the bound shall be tight.
        """
        cost = float(self.cost(M))
        T = whitener(M)
        S = np.linalg.inv(T)
        whitened = S @ Z @ S.T
        size = float(np.trace(whitened))  # <Z, M>
        if size <= 0:  # of a semidefinite Z: zero, which restricts no X
            return 0.0
        direction = whitened / size
        if self.smooth and _is_parallel(direction, S @ self.gradient(M) @ S.T):
            least = 1.0
        else:
            least = self._least_expression(direction, T * cost ** (-0.5 / self.degree))
        return float(cost * least ** (1.0 / self.expression_power) * size**self.degree)

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """The best of ``polar(Z_j) t_j^-degree``, which follows from homogeneity.

        A multiplier that is not semidefinite proves nothing.
        """
        proves = (t > 0) & (is_semidefinite(Z) if self.monotone else True)
        return max(
            self.polar(z, M) * top**-self.degree if proved else 0.0
            for z, top, proved in zip(Z, t, proves, strict=True)
        )

    @property
    def bounds_by_polars(self) -> bool:
        """Unless the class has a bound of its own."""
        return type(self).lower_bound is ConvexCriterion.lower_bound

    def rests_on_solver(self, Z: Array, M: Array) -> bool:
        """Unless the class has a polar of its own, or each Z is minus the gradient at M."""
        cls = type(self)
        has_form = cls.polar is not ConvexCriterion.polar
        if has_form or not self.bounds_by_polars:
            return False
        return not (self.smooth and self._are_gradients(Z, M))

    def _are_gradients(self, Z: Array, M: Array) -> bool:
        """Whether multipliers (r, p, p) are minus the gradient at M, up to their lengths."""
        S = np.linalg.inv(whitener(M))
        G = S @ self.gradient(M) @ S.T
        return all(_is_parallel(z / np.trace(z), G) for z in S @ Z @ S.T)

    def transformed(self, T: Array) -> Criterion | None:
        """This criterion of other parameters; what it has no closed form of, by its expression."""
        found = super().transformed(T)
        has_form = type(self).polar is not ConvexCriterion.polar
        if has_form or found is None or type(found) is not Transformed:
            return found
        return TransformedExpression(self, found.T)

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """`expression` over weights of sum one.

        A factor c on T multiplies the cost by ``c^(2 degree)``. So the division by `unit` goes into
        T, and every constant inside the expression is of order one.
        """
        return self._expression_of(M, T * unit ** (-0.5 / self.degree)), [total == 1]

    def _cost(self, M: Array, cov: Array) -> Array:
        """``expression^(1/power)``, one matrix after the other."""
        values = [float(self._expression_at(m)[0].value) for m in M.reshape(-1, *M.shape[-2:])]
        return np.array(values).reshape(M.shape[:-2]) ** (1.0 / self.expression_power)

    def _gradient(self, M: Array, cov: Array) -> Array:
        """By cvxpy's own differentiation: ``cost^(1 - power)/power`` times the expression's."""
        power = self.expression_power
        gradients = []
        for m in M.reshape(-1, *M.shape[-2:]):
            expression, X = self._expression_at(m)
            G = expression.grad[X]
            # cvxpy gives a sparse or a dense column, in Fortran order.
            dense = np.asarray(G.todense() if hasattr(G, "todense") else G)
            G = dense.reshape(m.shape, order="F")
            outer = float(expression.value) ** (1.0 / power - 1.0) / power
            gradients.append(outer * 0.5 * (G + G.T))
        return np.array(gradients).reshape(M.shape)

    def _expression_of(self, M: "cp.Expression", T: Array | None = None) -> "cp.Expression":
        """`expression`, of which a subclass may have written one that returns something else."""
        found = self.expression(M) if T is None else self.expression(M, T)
        return require_expression(found, f"criterion {self.name!r}: its expression")

    def _expression_at(self, M: Array) -> tuple["cp.Expression", "cp.Variable"]:
        """The expression with its argument set to M (p, p), and that argument."""
        import cvxpy as cp

        X = cp.Variable(M.shape)
        X.value = M
        return self._expression_of(X), X

    def _least_expression(self, direction: Array, T: Array) -> float:
        """Least `expression` of X (p, p) with ``<direction, X> <= 1``, lowered for safety.

        It is a solver's word, hence the safety margin; zero, which proves nothing, where the
        solver finds no optimum.
        """
        import cvxpy as cp

        X = cp.Variable(direction.shape, PSD=True)
        objective = cp.Minimize(self._expression_of(X, T))
        program = cp.Problem(objective, [cp.trace(direction @ X) <= 1])
        for tolerance in TOLERANCES:
            options = dict.fromkeys(("tol_gap_rel", "tol_gap_abs", "tol_feas"), tolerance)
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")  # an inaccurate answer is tried again below
                    program.solve(solver="CLARABEL", **options)
            except cp.SolverError:
                continue
            if program.status == cp.OPTIMAL:
                return (1 - SAFETY) * float(program.value)
        return 0.0


class TransformedExpression(Transformed, ConvexCriterion):
    """The same of a criterion that writes no closed form of its cost, or of its polar.

    What is read off its expression is read off it with T, so that nothing is squared.
    """

    def polar(self, Z: Array, M: Array) -> float:
        """A solver's answer in these parameters, unless the base has a closed form."""
        if type(self.base).polar is ConvexCriterion.polar:
            return ConvexCriterion.polar(self, Z, M)
        return super().polar(Z, M)

    def rests_on_solver(self, Z: Array, M: Array) -> bool:
        """Unless the base has a closed form, or each Z is minus the gradient at M."""
        if type(self.base).polar is not ConvexCriterion.polar:
            return False
        return not (self.smooth and self._are_gradients(Z, M))

    def _cost(self, M: Array, cov: Array) -> Array:
        if type(self.base)._cost is ConvexCriterion._cost:
            return ConvexCriterion._cost(self, M, cov)
        return super()._cost(M, cov)

    def _gradient(self, M: Array, cov: Array) -> Array:
        if type(self.base)._gradient is ConvexCriterion._gradient:
            return ConvexCriterion._gradient(self, M, cov)
        return super()._gradient(M, cov)


def _is_parallel(direction: Array, G: Array) -> bool:
    """Whether a direction of unit trace is minus a gradient G, up to its length."""
    return bool(np.abs(direction - G / np.trace(G)).max() <= SAME_DIRECTION)
