"""Criteria that are a power of another one, such as O1 = D^(1/2) and O3 = E^(1/2)."""

from typing import TYPE_CHECKING, ClassVar, Self

from criteria.convex_criterion import ConvexCriterion
from criteria.criterion import Criterion, DeterminantCriterion
from criteria.curvature import Curvature
from criteria.linalg.typing import Array
from criteria.relaxable import Formulation, SpectralBand

if TYPE_CHECKING:
    import cvxpy as cp


class PowerCriterion(ConvexCriterion):
    """``cost = base.cost^exponent``: another scale for the same order of plans.

    A power has the base's optimal plans and is proved by the base's multipliers. A subclass
    declares `base_class`, `exponent` and what every criterion declares; its degree is
    ``exponent * base.degree``, its expression_power ``base.expression_power / exponent``.

    Args:
        base: The criterion whose power this is; defaults to ``base_class()``.

    Attributes:
        base_class: The class of the base.
        exponent: The exponent, above zero.
    """

    base_class: ClassVar[type[ConvexCriterion]]
    exponent: ClassVar[float]

    def __init__(self, base: ConvexCriterion | None = None) -> None:
        # A base of its own kind is given where the base is smoothed or has other units.
        self.base = self.base_class() if base is None else base
        self.smooth = self.base.smooth
        self.has_logarithm = self.base.has_logarithm
        self.batched_curvature = self.base.batched_curvature

    @property
    def order(self) -> int | None:
        """The base's."""
        return self.base.order

    @property
    def plan_criterion(self) -> Criterion:
        """The base's, since a power puts plans in the same order."""
        return self.base.plan_criterion

    def cost_from_plan_criterion(self, cost: float) -> float:
        """``cost^exponent``."""
        return float(self.base.cost_from_plan_criterion(cost) ** self.exponent)

    def smoothed(self, sharpness: float) -> Self:
        """The power of the smoothed base."""
        # The relaxation keeps compiled programs by object, so an equal one is not made anew.
        base = self.base.smoothed(sharpness)
        return self if base is self.base else self._like(base)

    def in_units(self, T: Array) -> Self:
        """The power of the base in other units."""
        base = self.base.in_units(T)
        return self if base is self.base else self._like(base)

    def transformed(self, T: Array) -> Criterion | None:
        """The power of the base as a function of the information about other parameters."""
        if isinstance(self, DeterminantCriterion):
            return super().transformed(T)
        base = self.base.transformed(T)
        return None if base is None else self._like(base)  # type: ignore[arg-type]

    def polar_of_root(self, B: Array, W: Array) -> float:
        """The power of the base's."""
        return float(self.base.polar_of_root(B, W) ** self.exponent)

    def _like(self, base: ConvexCriterion) -> Self:
        """The same power of another base of the same kind."""
        return type(self)(base)

    def polar(self, Z: Array, M: Array) -> float:
        """The power of the base's polar."""
        return float(self.base.polar(Z, M) ** self.exponent)

    def polars(self, Z: Array, M: Array) -> Array:
        """The powers of the base's."""
        return self.base.polars(Z, M) ** self.exponent

    def dual_weights(self, Z: Array, M: Array) -> Array | None:
        """The base's."""
        return self.base.dual_weights(Z, M)

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """The power of the base's bound."""
        return float(self.base.lower_bound(Z, t, M) ** self.exponent)

    def curvature(self, R: Array) -> Curvature | None:
        """The base's, times the exponent."""
        found = self.base.curvature(R)
        return None if found is None else found.power(self.exponent)

    def rounding(self, W: Array) -> float:
        """The base's, which is one of variances."""
        return self.base.rounding(W)

    def rests_on_solver(self, Z: Array, M: Array) -> bool:
        """Whether the base's bound does."""
        return self.base.rests_on_solver(Z, M)

    def variance_rows(self, p: int) -> Array | None:
        """The base's, whose optimum is the same."""
        return self.base.variance_rows(p)

    def spectral_band(self, p: int) -> SpectralBand | None:
        """The base's, whose optimum is the same."""
        return self.base.spectral_band(p)

    def expression(self, M: "cp.Expression", T: Array | None = None) -> "cp.Expression":
        """The base's expression, which has another `expression_power` here."""
        return self.base.expression(M, T)

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """The base's program: the unit is turned into one of the base's cost."""
        return self.base.formulation(M, total, T, unit ** (1.0 / self.exponent))

    def log_information(
        self, M: "cp.Expression", T: Array, unit: float
    ) -> tuple["cp.Expression", list["cp.Constraint"]]:
        """The base's: a power changes the logarithm and the degree by the same factor."""
        return self.base.log_information(M, T, unit ** (1.0 / self.exponent))

    def _cost(self, M: Array, cov: Array) -> Array:
        return self.base.cost_of_regular(M, cov) ** self.exponent

    def _gradient(self, M: Array, cov: Array) -> Array:
        cost = self.base.cost_of_regular(M, cov)
        outer = self.exponent * cost ** (self.exponent - 1.0)
        return outer[..., None, None] * self.base.gradient_of_regular(M, cov)
