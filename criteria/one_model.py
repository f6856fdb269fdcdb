"""A criterion of one of several models, whose information is one block of a block diagonal."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from criteria.criterion import DESCRIBED, Criterion
from criteria.curvature import Curvature
from criteria.errors import CriterionError
from criteria.linalg.inverse import whitener
from criteria.linalg.models import Models
from criteria.linalg.typing import Array, Mask
from criteria.relaxable import Formulation, Relaxable

if TYPE_CHECKING:
    import cvxpy as cp

# What the criterion of a model takes over from the one of its block.
DECLARED = (*DESCRIBED, "shown", "expression_power", "has_logarithm", "batched_curvature")


class OneModel(Relaxable):
    """``phi(M_j)`` as a function of ``diag(M_1, .., M_k)``, the information about k models.

    A multiplier Z of block diagonal designs X is one of each block as well: for semidefinite Z,
    ``<Z_jj, X_j> <= <Z, X>``.

    Args:
        base: The criterion phi.
        models: All models.
        number: The number j of the model.
    """

    models: Models

    def __init__(self, base: Relaxable, models: Models, number: int) -> None:
        self.base = base
        self.models = models
        self.number = number
        self.part = models.parts[number]
        for key in DECLARED:
            setattr(self, key, getattr(base, key))
        self.needs_all = base.needs_all and len(models) == 1

    @property
    def label(self) -> str:
        """The base's."""
        return self.base.label

    @property
    def order(self) -> int:
        """Number of parameters of all models."""
        return self.models.p

    def block(self, M: Array) -> Array:
        """The model's block (..., s, s) of matrices (..., p, p)."""
        return M[..., self.part, self.part]

    def _whole(self, block: Array) -> Array:
        """Matrices (..., p, p) with this block (..., s, s) alone."""
        p = self.models.p
        found = np.zeros((*block.shape[:-2], p, p))
        found[..., self.part, self.part] = block
        return found

    def in_units(self, T: Array) -> Self:
        """The base in the units of its own parameters."""
        return type(self)(self.base.in_units(self.block(T)), self.models, self.number)

    def transformed(self, T: Array) -> Self | None:
        """The base as a function of its own other parameters, where T (p, p) mixes no models."""
        if not self.models.are_apart(T):
            return None
        base = self.base.transformed(self.block(T))
        if not isinstance(base, Relaxable):
            return None
        return type(self)(base, self.models, self.number)

    @property
    def as_multiple(self) -> tuple[Relaxable, float]:
        """That of the block."""
        base, factor = self.base.as_multiple
        return type(self)(base, self.models, self.number), factor

    def inverse(self, M: Array) -> tuple[Array, Array, Mask]:
        """The inverse of the block, and zeros beside it."""
        safe, cov, regular = self.base.inverse(self.block(M))
        return self._whole(safe), self._whole(cov), regular

    def whitener(self, M: Array) -> Array:
        """The block's."""
        own = self.base.whitener(self.block(M))
        found = np.zeros((self.models.p, own.shape[1]))
        found[self.part] = own
        return found

    def strayed(self, M: Array) -> float:
        """The base's, of the block."""
        return self.base.strayed(self.block(M))

    def missing(self, M: Array, parameters: tuple[str, ...]) -> tuple[str, ...]:
        """The base's, of the block."""
        return self.base.missing(self.block(M), parameters[self.part])

    def dependence(self, scale: Array) -> float:
        """The base's, of its own parameters."""
        return self.base.dependence(scale[self.part])

    def rounding(self, W: Array) -> float:
        """The base's, of what W says about its own parameters."""
        return self.base.rounding(W[self.part])

    def rests_on_solver(self, Z: Array, M: Array) -> bool:
        """Whether the base's bound does."""
        return self.base.rests_on_solver(self.block(Z), self.block(M))

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """The base's, of the blocks of the multipliers."""
        return self.base.lower_bound(self.block(Z), t, self.block(M))

    def curvature(self, R: Array) -> Curvature | None:
        """The base's, whose parameters are the columns of V for this model."""
        found = self.base.curvature(self.block(R))
        if found is None:
            return None
        V = np.zeros((*R.shape[:-1], found.z.shape[-1]))
        V[..., self.part, :] = found.V
        return Curvature(V, found.z, found.W, found.c)

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """The base's, of the block."""
        block, own = self._block_in(M, T)
        return self.base.formulation(block, total, own, unit)

    def log_information(
        self, M: "cp.Expression", T: Array, unit: float
    ) -> tuple["cp.Expression", list["cp.Constraint"]]:
        """The base's, of the block."""
        block, own = self._block_in(M, T)
        return self.base.log_information(block, own, unit)

    def _block_in(self, M: "cp.Expression", T: Array) -> tuple["cp.Expression", Array]:
        """The block of ``S'M S``, ``S = T^-1``, in parameters that T_j (s, s) whitens; and T_j.

        Where T whitens a design, its block is ``S_j'S_j`` with the columns S_j of the model.
        """
        S = np.linalg.inv(T)[:, self.part]
        own = whitener(S.T @ S)
        turned = S @ own
        block = turned.T @ M @ turned
        # cvxpy cannot tell that the product is symmetric, and asks for it.
        return 0.5 * (block + block.T), own

    def _cost(self, M: Array, cov: Array) -> Array:
        return self.base.cost_of_regular(self.block(M), self.block(cov))

    def _gradient(self, M: Array, cov: Array) -> Array:
        return self._whole(self.base.gradient_of_regular(self.block(M), self.block(cov)))

    @property
    def arguments(self) -> dict[str, Any]:
        """The base's."""
        return self.base.arguments


def in_models(parts: Sequence[Criterion], sizes: Sequence[int]) -> tuple[OneModel, ...]:
    """Criteria of ``diag(M_1, .., M_k)``, each about the parameters of its own model alone.

    Args:
        parts: Criteria, one a model.
        sizes: Numbers of parameters of the models.

    Raises:
        CriterionError: There are not as many sizes as criteria, or one is not positive; or a
            criterion is about another number of parameters.
    """
    if len(sizes) != len(parts) or min(sizes) < 1:
        raise CriterionError(f"sizes: expected a positive number for each of {len(parts)} criteria")
    models = Models(tuple(sizes))
    found = []
    for number, (part, size) in enumerate(zip(parts, sizes, strict=True)):
        if part.order not in (None, size):
            raise CriterionError(
                f"criterion {part.label!r} is about {part.order} parameters, and its model has "
                f"{size}"
            )
        assert isinstance(part, Relaxable)  # of parts that are smooth, convex and monotone
        found.append(OneModel(part, models, number))
    return tuple(found)
