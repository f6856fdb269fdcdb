"""The information of the active candidates, in the form that Newton's method needs."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from criteria.linalg.triangle import triangle
from edtk.design.problem import Problem
from edtk.design.relaxation.experiment_blocks import experiment_blocks
from edtk.system.typing import Array, Indices

# Order up to which whole matrices are as quick as rows, which of packed candidates would have to
# be factorized first.
SMALL = 12
CHUNK = 2**21  # entries of whole matrices that are formed at a time


class ActiveInformation(ABC):
    """Information M_i (p, p) of one experiment in each of a few candidates, the prior included."""

    @staticmethod
    def of(problem: Problem, active: Indices) -> "ActiveInformation":
        """The information of some candidates (k,) of a problem."""
        if problem.p <= SMALL:
            return ActiveInformation.of_blocks(experiment_blocks(problem, active))
        return _Rows(problem[active].factors(), problem.prior)

    @staticmethod
    def of_blocks(blocks: Array) -> "ActiveInformation":
        """Information that is given as matrices (k, p, p)."""
        return _Blocks(blocks.reshape(len(blocks), -1))

    @abstractmethod
    def information(self, weights: Array) -> Array:
        """``sum_i w_i M_i`` (p, p) of weights (k,)."""

    @abstractmethod
    def sensitivities(self, Z: Array) -> Array:
        """``<Z, M_i>`` (k,) of a symmetric Z (p, p)."""

    @abstractmethod
    def triangles(self, T: Array, scale: Array) -> Array:
        """Scaled upper triangles (q, k) of ``T' M_i T``, q = p (p + 1)/2.

        Args:
            T: Matrix (p, p).
            scale: Factor (q,) of each entry.
        """


@dataclass(frozen=True, eq=False)
class _Blocks(ActiveInformation):
    """Whole matrices, flat (k, p p)."""

    flat: Array

    def information(self, weights: Array) -> Array:
        p = round(self.flat.shape[1] ** 0.5)
        return (weights @ self.flat).reshape(p, p)

    def sensitivities(self, Z: Array) -> Array:
        return np.asarray(self.flat @ Z.ravel())

    def triangles(self, T: Array, scale: Array) -> Array:
        rows, columns = triangle(len(T))
        # vec(T' M T) is linear in vec(M): one product for all candidates.
        change = T[:, None, rows] * T[None, :, columns] * scale
        return np.asarray(change.reshape(-1, len(rows)).T @ self.flat.T)


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

    def triangles(self, T: Array, scale: Array) -> Array:
        rows, columns = triangle(len(T))
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
