"""The abstract criterion and the laws that every criterion obeys."""

from abc import ABC
from typing import TYPE_CHECKING, Any, ClassVar, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from criteria.expression import cost_of, gradient_of, polar_of
from criteria.linalg.inverse import guarded_inverse

if TYPE_CHECKING:
    import cvxpy as cp

Array = NDArray[np.float64]
Formulation = tuple["cp.Expression", list["cp.Constraint"]]
Sense = Literal["min", "max"]


class Criterion(ABC):
    """A scalar judgement of an information matrix M, of shape (..., p, p) and symmetric.

    A subclass declares its class attributes and writes `_cost` and `_gradient`, and `expression` where it is
    convex; both hooks are only ever called with regular M, and with its inverse at hand. A subclass that writes
    `expression` alone is complete too: cost and gradient are then read off it, slowly.

    Laws, checked for every registered criterion by one suite:
        homogeneous: ``cost(c M) = c**-degree * cost(M)`` for c > 0.
        symmetric: a permutation of the parameters changes nothing.
        monotone (where declared): M2 - M1 positive semidefinite implies cost(M2) <= cost(M1).
        convex (where declared): in M, so that ``cost(M2) >= cost(M1) + <gradient(M1), M2 - M1>``.
        unit-free (where declared): the ratio of two designs does not depend on the parameters' units.
        singular M: ``cost = inf``, never an exception.

    Attributes:
        name: Registry name, as used in studies and tables.
        title: The name a person reads.
        formula: Definition of `value`, in plain text.
        sense: Whether `value` is minimised or maximised.
        degree: Degree of homogeneity of `cost`.
        convex: Whether `cost` is convex in M.
        smooth: Whether `cost` is differentiable everywhere on the regular matrices.
        monotone: Whether more information never hurts.
        unit_free: Whether efficiencies are free of the parameters' units.
        needs_target: Whether the constructor takes the target matrix A0.
        determinant_only: Whether `cost` depends on the determinant alone.
        shown: Factor from SI, and unit, in which a person reads `value`; no unit where it has none worth printing.
        expression_power: `expression` and `formulation` model ``cost**expression_power``.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    formula: ClassVar[str]
    sense: ClassVar[Sense]
    degree: ClassVar[float]
    convex: ClassVar[bool] = True
    smooth: bool = True
    monotone: bool = True
    unit_free: ClassVar[bool] = False
    needs_target: ClassVar[bool] = False
    determinant_only: ClassVar[bool] = False
    shown: ClassVar[tuple[float, str]] = (1.0, "")
    expression_power: ClassVar[float] = 1.0

    def _cost(self, M: Array, cov: Array) -> Array:
        """Cost (...) of regular M (..., p, p) whose inverse is cov (..., p, p)."""
        return cost_of(self, M)

    def _gradient(self, M: Array, cov: Array) -> Array:
        """Symmetric G (..., p, p) with d cost = <G, dM>; at a kink, any subgradient."""
        return gradient_of(self, M)

    def cost_of_log_determinant(self, log_det: Array, p: int) -> Array:
        """Costs (...) of regular (p, p) matrices of which log det M (...) is known, where `determinant_only`.

        It lets an exchange use the lemma of the determinant, for which no inverse is updated.
        """
        raise NotImplementedError(f"criterion {self.name} takes more than the determinant")

    def expression(self, M: "cp.Expression", T: Array | None = None) -> "cp.Expression":
        """Convex cvxpy expression of ``cost**expression_power``.

        Args:
            M: Symmetric (p, p) expression: the information of k', where k = T k'.
            T: Regular matrix (p, p) that whitens badly scaled parameters; None for the identity. The value is
                that of ``cost(T^-T M T^-1)``.

        Raises:
            NotImplementedError: The criterion has no such form.
        """
        raise NotImplementedError(f"criterion {self.name} has no convex expression")

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """The relaxation as a convex program: an objective to minimise and its constraints.

        The weights that it is solved for may have any sum; divided by it they are the design. By default the
        objective is `expression` and the sum is one. A factor c on T multiplies the cost by ``c^(2 degree)``, so
        the division by `unit` goes into T and every constant inside the expression is of order one.

        Args:
            M: Symmetric (p, p) expression, ``sum w_i M_i`` for k' where k = T k'.
            total: The sum of the weights.
            T: Regular matrix (p, p) that whitens a design near the optimum.
            unit: The cost of that design.
        """
        return self.expression(M, T * unit ** (-0.5 / self.degree)), [total == 1]

    def polar(self, Z: Array, M: Array) -> float:
        """A lower bound on ``cost(X)`` over all X with ``<Z, X> <= 1``: what a multiplier Z proves.

        In closed form where a criterion has one, so that no solver's word is needed; see `polar_of` for the others.

        Args:
            Z: Symmetric positive semidefinite multiplier (p, p).
            M: A regular design (p, p), near which the bound shall be tight.
        """
        return polar_of(self, Z, M)

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """A lower bound on the cost of every design X with ``<Z_j, X> <= t_j`` for all j.

        By homogeneity it is the best of ``polar(Z_j) t_j^-degree``. For a criterion of degree zero, designs are
        understood to have unit trace.

        Args:
            Z: Symmetric multipliers (r, p, p), positive semidefinite where the criterion is monotone.
            t: Their dearest prices (r,) over the candidates.
            M: A regular design (p, p), near which the bound shall be tight.
        """
        return max(
            self.polar(z, M) * top**-self.degree if top > 0 else 0.0
            for z, top in zip(Z, t, strict=True)
        )

    def subproblem(self, Z: Array, t: Array, M: Array) -> "Criterion":
        """What to solve next, given multipliers and their dearest prices so far: a convex criterion itself.

        A criterion that is not convex, but the least of a family of convex ones, names a member here.

        Args:
            Z: Multipliers (r, p, p), r may be zero.
            t: Their dearest prices (r,).
            M: The best design (p, p) so far.
        """
        return self

    def smoothed(self, sharpness: float) -> "Criterion":
        """A smooth criterion whose cost is no lower, and the closer the sharper; the criterion itself if smooth.

        Args:
            sharpness: Exponent of the soft maximum that takes the place of a maximum, above one.
        """
        return self

    @classmethod
    def has_convex_form(cls) -> bool:
        """Whether the criterion can be relaxed: by an `expression`, a `formulation` or `subproblem`s."""
        return any(
            getattr(cls, f) is not getattr(Criterion, f)
            for f in ("expression", "formulation", "subproblem")
        )

    @final
    def cost(self, M: ArrayLike) -> Array:
        """Smaller is better: `value` where it is minimised, its reciprocal where it is maximised.

        Args:
            M: Information matrices (..., p, p).

        Returns:
            Array (...); inf where M is singular to working precision, nan where it is not finite.
        """
        M = np.asarray(M, dtype=float)
        safe, cov, regular = guarded_inverse(M)
        cost = np.where(regular, self._cost(safe, cov), np.inf)
        return np.where(np.isfinite(M).all(axis=(-2, -1)), cost, np.nan)[()]

    @final
    def cost_of_regular(self, M: Array, cov: Array) -> Array:
        """Costs (...) where the inverses are at hand, as after an update: M is regular, and nobody checks.

        Args:
            M: Regular information matrices (..., p, p).
            cov: Their inverses (..., p, p).
        """
        return self._cost(M, cov)

    @final
    def value(self, M: ArrayLike) -> Array:
        """The criterion as printed in `formula`; 0 (if maximised) or inf (if minimised) at singular M.

        Args:
            M: Information matrices (..., p, p).
        """
        cost = self.cost(M)
        return cost if self.sense == "min" else 1.0 / cost

    @final
    def gradient(self, M: ArrayLike) -> Array:
        """Gradient (..., p, p) of `cost`, symmetric: d cost = <G, dM>; nan where M is singular.

        Args:
            M: Information matrices (..., p, p).
        """
        return self.cost_and_gradient(np.asarray(M, dtype=float))[1]

    @final
    def cost_and_gradient(self, M: Array) -> tuple[Array, Array]:
        """`cost` (...) and `gradient` (..., p, p) of finite M (..., p, p), with one inversion for both."""
        safe, cov, regular = guarded_inverse(M)
        G = self.gradient_of_regular(safe, cov)
        return np.where(regular, self._cost(safe, cov), np.inf), np.where(
            regular[..., None, None], G, np.nan
        )

    @final
    def gradient_of_regular(self, M: Array, cov: Array) -> Array:
        """Gradients (..., p, p) where the inverses are at hand, see `cost_of_regular`."""
        G = self._gradient(M, cov)
        return 0.5 * (G + np.swapaxes(G, -1, -2))

    @final
    def efficiency(self, M: ArrayLike, best: ArrayLike) -> Array:
        """Plain ratio of costs, ``cost(best) / cost(M)``: 1 for a plan as good as the best.

        Args:
            M: Information matrices (..., p, p) to judge.
            best: Information matrices (..., p, p) to compare with.
        """
        return self.cost(best) / self.cost(M)

    def in_units(self, T: Array) -> "Criterion":
        """The same criterion for parameters k' with k = T k'; only a target changes.

        Args:
            T: Regular matrix (p, p).
        """
        return self

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r})"

    @classmethod
    def describe(cls) -> dict[str, Any]:
        """The declared properties as a plain dictionary, for tables and JSON."""
        keys = (
            "name",
            "title",
            "formula",
            "sense",
            "degree",
            "convex",
            "smooth",
            "monotone",
            "unit_free",
        )
        return {key: getattr(cls, key) for key in keys}
