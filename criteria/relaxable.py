"""The second interface of a criterion: what the convex relaxation asks of it."""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from criteria.criterion import Criterion
from criteria.curvature import Curvature
from criteria.linalg.models import Models
from criteria.linalg.typing import Array

if TYPE_CHECKING:
    import cvxpy as cp

ILL_CONDITIONED = 1e3  # condition number of R: duals have its square


@dataclass(frozen=True, eq=False)
class SpectralBand:
    """The program ``min b sum(w) + a kappa``, ``w >= 0``, with ``F <= M(w), R'M(w) R <= kappa I``.

    The upper bound is ``M <= kappa C`` for ``C^-1 = R R'``. In parameters that are very different
    from those of the criterion C has the squares of a large condition number, and would leave no
    digits of its small entries; what counts in R are its large ones.

    Attributes:
        a: Weight of the upper bound, at least zero; zero where there is none.
        b: Weight of the sum of the weights, at least zero.
        floor: F (p, p), positive semidefinite.
        cap: R (p, p), regular.
    """

    a: float
    b: float
    floor: Array
    cap: Array

    @classmethod
    def of(cls, a: float, b: float, p: int) -> "SpectralBand":
        """That of eigenvalues themselves, ``I <= M <= kappa I``."""
        return cls(a, b, np.eye(p), np.eye(p))

    @property
    def is_graded(self) -> bool:
        """Whether the upper bound is so uneven that its dual is lost beside that of the lower."""
        return bool(self.a and np.linalg.cond(self.cap) > ILL_CONDITIONED)

    def transformed(self, T: Array) -> "SpectralBand":
        """The same program for the information ``T'M T``."""
        return replace(
            self, floor=T.T @ self.floor @ T, cap=np.asarray(np.linalg.solve(T, self.cap))
        )


class Losses(Protocol):
    """Smooth losses ``f_j(M)`` of degree one, of which a cost is the largest.

    Attributes:
        models: Of several models side by side, one a loss; None where all losses are about all.
    """

    models: Models | None

    def logs_and_slopes(self, M: Array) -> tuple[Array, Array]:
        """``log f_j`` (k,) at M (p, p), and minus their gradients (k, p, p)."""
        ...

    def loss_curvatures(self, R: Array) -> tuple[Curvature, ...] | None:
        """The derivatives of each ``log f_j`` at a root R (p, p) of the covariance, if known."""
        ...


Formulation = tuple["cp.Expression", list["cp.Constraint"]]


class Relaxable(Criterion):
    """A criterion that the relaxation can minimise over the weights of candidates, with a bound.

    The relaxation solves a convex program (`formulation`) and takes from its answer a multiplier Z
    of ``M == sum w_i M_i``. Every design X obeys ``<Z, X> <= t``, where t is the largest
    sensitivity ``<Z, M_i>`` of a candidate; `lower_bound` turns that into a bound on the cost.

    Attributes:
        expression_power: The program's objective is ``cost**expression_power``.
        has_logarithm: Whether `log_information` is there.
        of_spectrum: Whether it is a function of the eigenvalues of M, some of which are small: it
            is then computed in parameters of which these are nearly the lengths.
        most_subproblems: How many convex programs may be solved one after another. One, unless the
            criterion is the least of a family of which `subproblem` names the members; then the
            multipliers of several members prove the bound together.
    """

    # A root such as rho0 has no convex program of its own kind; its square has.
    expression_power: float = 1.0
    most_subproblems: int = 1
    has_logarithm: bool = False
    of_spectrum: bool = False

    @abstractmethod
    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """The relaxation as a convex program: an objective to minimise, and its constraints.

        The weights that solve it may have any sum; divided by that sum they are the design.

        Args:
            M: Symmetric (p, p) expression, ``sum w_i M_i`` for parameters k' where k = T k'.
            total: The sum of the weights.
            T: Regular matrix (p, p) that whitens a design near the optimum.
            unit: The cost of that design. The objective is measured in this unit.
        """

    @property
    def as_multiple(self) -> "tuple[Relaxable, float]":
        """A criterion and a number such that their product is this criterion."""
        return self, 1.0

    def dual_weights(self, Z: Array, M: Array) -> Array | None:
        """The weights by which a criterion that is a maximum turns a multiplier into a bound.

        They are stored with a certificate, so that a check needs no search for them.

        Args:
            Z: A multiplier (p, p).
            M: A regular design (p, p), near which the bound shall be tight.

        Returns:
            Weights of sum one; None for a criterion that needs none.
        """
        return None

    def log_information(
        self, M: "cp.Expression", T: Array, unit: float
    ) -> tuple["cp.Expression", list["cp.Constraint"]]:
        """A concave expression of ``-log(cost / unit) / degree``, and its constraints.

        It serves compound criteria, whose logarithm is a sum of these; see `has_logarithm`.

        Args:
            M: See `formulation`.
            T: See `formulation`.
            unit: See `formulation`.

        Raises:
            NotImplementedError: The criterion has no such form.
        """
        raise NotImplementedError(f"criterion {self.name} has no logarithm of a convex form")

    def spectral_band(self, p: int) -> SpectralBand | None:
        """The relaxation as a program of extreme eigenvalues, which a method of its own solves.

        Args:
            p: Number of parameters.

        Returns:
            The program; None where the criterion has no such form.
        """
        return None

    def variance_rows(self, p: int) -> Array | None:
        """Rows A_j of which the relaxation minimises the largest ``trace(A_j cov A_j')``.

        Args:
            p: Number of parameters.

        Returns:
            The rows (j, r, p); None where the criterion has no such form.
        """
        return None

    def largest_of(self, p: int) -> Losses | None:
        """Smooth losses of which the cost is the largest.

        Args:
            p: Number of parameters.

        Returns:
            The losses; None where the criterion has no such form.
        """
        return None

    @abstractmethod
    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """A lower bound on the cost of every design X with ``<Z_j, X> <= t_j`` for all j.

        For a criterion of degree zero, designs have unit trace.

        Args:
            Z: Symmetric multipliers (r, p, p), positive semidefinite if the criterion is monotone.
            t: The largest sensitivity (r,) of a candidate to each multiplier.
            M: A regular design (p, p), near which the bound shall be tight.
        """

    def polars(self, Z: Array, M: Array) -> Array:
        """What each of many multipliers proves alone: `lower_bound` with a largest sensitivity one.

        Args:
            Z: Symmetric multipliers (b, p, p), positive semidefinite.
            M: A regular design (b, p, p) for each.

        Returns:
            Bounds (b,); zero where a multiplier proves nothing.
        """
        one = np.ones(1)
        pairs = zip(Z[:, None], M, strict=True)
        return np.array([self.lower_bound(own, one, near) for own, near in pairs])

    def rests_on_solver(self, Z: Array, M: Array) -> bool:
        """Whether `lower_bound` near M believes a solver's optimum, for any of multipliers Z."""
        return False

    def subproblem(self, Z: Array, t: Array, M: Array) -> "Relaxable":
        """The problem to solve next: the criterion itself, or a member of its family.

        Args:
            Z: Multipliers (r, p, p) found so far, r may be zero.
            t: The largest sensitivity (r,) of a candidate to each multiplier.
            M: The best design (p, p) so far.
        """
        return self
