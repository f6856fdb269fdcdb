"""A feasible set in which the weight of an experiment is a variable like its pose."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.design.experiments import weighted_information
from edtk.design.space import Points, Space
from edtk.system.typing import Array, Mask

TINY = 1e-300  # a weight that divides nothing by zero


@dataclass(frozen=True, eq=False)
class WeightedSpace:
    """Experiments x of a space and their weights w in [0, 1], as variables (x, w).

    Rows are multiplied by ``sqrt(k w)``. So k experiments, each measured 1/k times, tell
    ``M0 + sum_i w_i A_i' A_i`` together, with the prior counted once where weights sum to one.

    Attributes:
        base: The space of the experiments.
        k: Number of experiments of a design.
    """

    base: Space
    k: int

    @cached_property
    def limits(self) -> Array:
        """Bounds (2, v + 1)."""
        return np.concatenate([self.base.limits, [[0.0], [1.0]]], axis=1)

    @property
    def movable(self) -> list[int]:
        """Indices of the variables that a descent may change: the weight is one of them."""
        return [*self.base.movable, self.base.limits.shape[1]]

    @property
    def prior(self) -> Array | None:
        """Prior information M0 (p, p) of the base."""
        return self.base.prior

    def at(self, x: Array) -> "WeightedPoints":
        """The weighted experiments (..., v + 1)."""
        return WeightedPoints(self, x, self.base.at(x[..., :-1]))


@dataclass(frozen=True, eq=False)
class WeightedPoints:
    """Weighted experiments, see `Points`.

    Attributes:
        space: Where they lie.
        x: Design variables and weights (..., v + 1).
        points: The experiments themselves.
    """

    space: WeightedSpace
    x: Array
    points: Points

    @cached_property
    def _factor(self) -> Array:
        """``k w`` (...)."""
        return np.asarray(self.space.k * self.x[..., -1])

    @cached_property
    def regressor(self) -> Array:
        """Rows (..., rows, p)."""
        return np.asarray(np.sqrt(self._factor)[..., None, None] * self.points.regressor)

    @property
    def packed(self) -> Array:
        """Information (p(p+1)/2, ...) without the prior."""
        return self._factor * self.points.packed

    @property
    def slack(self) -> Array:
        """Slacks (..., c) of the constraints."""
        return self.points.slack

    @property
    def slack_gradient(self) -> Array:
        """Their derivatives (..., c, v + 1), zero by the weight."""
        G = self.points.slack_gradient
        return np.concatenate([G, np.zeros((*G.shape[:-1], 1))], axis=-1)

    @property
    def feasible(self) -> Mask:
        """Whether each experiment (...) is feasible, with a weight in [0, 1]."""
        w = self.x[..., -1]
        return np.asarray(self.points.feasible & (w >= 0) & (w <= 1))

    def visited(self, visits: Array) -> "WeightedPoints":
        """Each visit of a relaxed design counts as one of a pose of its own."""
        return self

    def information(self, repeats: Array) -> Array:
        """Information matrices (b, p, p), see `weighted_information`."""
        return weighted_information(self.regressor, repeats, self.space.prior)

    def slope(self, B: Array) -> Array:
        """Derivatives (..., v + 1) of ``<B, rows>``; by the weight it is ``<B, rows>/(2 w)``."""
        by_place = self.points.slope(np.sqrt(self._factor)[..., None, None] * B)
        total = (B * self.regressor).sum(axis=(-1, -2))
        by_weight = total / np.maximum(2.0 * self.x[..., -1], TINY)
        return np.concatenate([by_place, by_weight[..., None]], axis=-1)
