"""Experiments with given design variables: their information, slacks, and derivatives."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from edtk.design.packed import pack_gram
from edtk.model.frames import Frames
from edtk.model.noise.whitener import Whitener
from edtk.system.typing import Array, Indices, Mask

if TYPE_CHECKING:
    from edtk.design.design_space import DesignSpace


@dataclass(frozen=True, eq=False)
class Experiments:
    """Experiments x (..., v) of a design space.

    All quantities share the same frames, which are computed once. Arrays are kept component first
    inside, since sums over few components of many experiments are fastest that way.

    Args:
        space: The design space.
        x: Design variables (..., v).
        frames: Frames of the robot's chain in these poses.
        visits: Visits (...) of each pose, which share its discrepancy; None for one each.
    """

    space: "DesignSpace"
    x: Array
    frames: Frames
    visits: Array | None = None

    def __getitem__(self, chosen: Indices) -> "Experiments":
        """The chosen experiments (n, v); nothing is computed anew."""
        visits = None if self.visits is None else self.visits[chosen]
        return Experiments(self.space, self.x[chosen], self.frames[chosen], visits)

    def visited(self, visits: Array) -> "Experiments":
        """The same experiments, each of which is one of so many visits of its pose.

        The experiments themselves where visits share no error, see `VisitNoise`.

        Args:
            visits: Numbers of visits, which broadcast to (...); below one they count as one.
        """
        noise = self.space.noise
        if noise is None or not noise.shares:
            return self
        shape = self.x.shape[:-1]
        return replace(self, visits=np.broadcast_to(np.maximum(visits, 1.0), shape))

    @property
    def _load(self) -> Array:
        """Variables (..., d) of the load."""
        return self.x[..., len(self.space.fixed) :]

    @cached_property
    def _whitener(self) -> Whitener | None:
        """What makes errors of unit covariance of correlated ones; None where they are white."""
        noise = self.space.noise
        if noise is None:
            return None
        visits = 1.0 if self.visits is None else self.visits
        return Whitener.of(noise.covariance_of(self.space.model, self.frames, visits))

    @cached_property
    def _regressor(self) -> Array:
        """Whitened regressors, ``A/sigma`` or ``L^-1 A`` (p, rows, ...), component first."""
        A = self.space.model.regressor_of(self.frames, self.space.load.wrench(self._load))
        if self._whitener is not None:
            return self._whitener.rows(A)
        return A / self.space.sigma.reshape(-1, *[1] * (A.ndim - 2))

    @cached_property
    def regressor(self) -> Array:
        """Whitened regressors (..., rows, p): ``A/sigma``, or ``L^-1 A`` with ``Sigma = L L'``."""
        return _batch_first(self._regressor, (1, 0))

    @property
    def packed(self) -> Array:
        """Information ``A' Sigma^-1 A`` of one measurement each, packed (p(p+1)/2, ...).

        The prior of the design space is no part of it; it enters by `DesignSpace.problem`.
        """
        return pack_gram(self._regressor)

    def information(self, repeats: Array) -> Array:
        """Information matrices of plans, the prior included.

        Repeats share the discrepancy of their own pose; different poses count as far apart.

        Args:
            repeats: Repetitions (b, k) of b plans of k experiments, where x is (b, k, v).

        Returns:
            Matrices (b, p, p).
        """
        regressor = self.visited(repeats).regressor
        return weighted_information(regressor, repeats, self.space.prior)

    def slope(self, B: Array) -> Array:
        """Derivatives of ``<B, A_w>`` by all design variables, weights B held fixed.

        ``A_w = A/sigma`` are the whitened rows. A is linear in the wrench, but for the part of
        weights that hang on the arm, so that the derivative by a variable of the load is
        ``<B, A(dW)/sigma>`` with dW the derivative of the wrench.

        Where errors are correlated, ``A_w = L^-1 A`` with ``Sigma = L L'``, and B must be such that
        ``B A_w'`` is symmetric. It is for ``B = A_w G`` with symmetric G, from differentials of
        information ``<G, dM> = 2 <A_w G, dA_w>``. Then it does not matter how L turns, and

            d<B, A_w> = <L^-T B, dA> - <L^-T B A_w' L^-1, dSigma> / 2.

        Args:
            B: Weights (..., rows, p); of correlated rows see above.

        Returns:
            Array (..., v).
        """
        space = self.space
        model = space.model
        # All derivatives by joints come from one adjoint pass with these weights.
        if self._whitener is None:
            weights = _component_first(B / space.sigma[:, None], (-1, -2))
        else:
            weights = self._whitener.transposed(_component_first(B, (-1, -2)))
        wrench = space.load.wrench(self._load)
        by_joint = model.regressor_slope_of(self.frames, wrench, weights)
        if self._whitener is not None:
            by_joint = by_joint + self._noise_slope(weights, self._whitener)
        wrench_changes = _component_first(space.load.derivative(self._load), (-1,))
        by_load = [
            (weights * model.by_wrench.regressor_of(self.frames, change)).sum(axis=(0, 1))
            for change in wrench_changes
        ]
        # Without a load to design by_load is empty, and reshape gives it the missing axes.
        by_load_too = np.array(by_load).reshape(-1, *by_joint.shape[1:])
        return _batch_first(np.concatenate([by_joint, by_load_too]), (0,))

    def _noise_slope(self, weights: Array, whitener: Whitener) -> Array:
        """``-<P Q', dSigma>/2`` by all joints (n, ...), of P = L^-T B and Q = Sigma^-1 A."""
        noise = self.space.noise
        assert noise is not None
        by_covariance = np.einsum(
            "pr...,ps...->rs...", weights, whitener.transposed(self._regressor)
        )
        return noise.slope_of(self.space.model, self.frames, -0.5 * by_covariance)

    @property
    def slack(self) -> Array:
        """Slacks (..., c) of the constraints other than the bounds; negative means infeasible."""
        none = np.zeros((*self.x.shape[:-1], 0))
        constraints = self.space.workspace.constraints
        own = [_batch_first(constraint.slack(self.frames), (0,)) for constraint in constraints]
        return np.concatenate([none, *own], axis=-1)

    @property
    def slack_gradient(self) -> Array:
        """Derivative (..., c, v) of the slacks by all design variables."""
        gradients = [
            _batch_first(constraint.gradient(self.frames), (0, 1))
            for constraint in self.space.workspace.constraints
        ]
        G = np.zeros((*self.x.shape[:-1], len(self.space.labels), self.space.size))
        if gradients:
            G[..., : len(self.space.fixed)] = np.concatenate(gradients, axis=-2)
        return G

    @property
    def feasible(self) -> Mask:
        """Whether each experiment (...) satisfies all constraints, the bounds included."""
        lower, upper = self.space.limits
        within = ((self.x >= lower) & (self.x <= upper)).all(axis=-1)
        return np.asarray(within & (self.slack >= 0).all(axis=-1))


def weighted_information(A: Array, repeats: Array, prior: Array | None) -> Array:
    """Information matrices ``sum_i r_i (M0 + A_i' A_i)`` (b, p, p) of plans.

    Args:
        A: Whitened regressors (b, k, rows, p).
        repeats: Repetitions r (b, k).
        prior: Prior information M0 (p, p), or None.
    """
    b, k, rows, p = A.shape
    # The rows of a plan are stacked, so that one product of matrices sums over poses and rows.
    stacked = (A * np.sqrt(repeats)[..., None, None]).reshape(b, k * rows, p)
    M = np.swapaxes(stacked, 1, 2) @ stacked
    return M if prior is None else M + repeats.sum(axis=1)[:, None, None] * prior


def _batch_first(A: Array, last: tuple[int, ...]) -> Array:
    """A view of component-first A whose leading axes come last, in this order."""
    return A.transpose(*range(len(last), A.ndim), *last)


def _component_first(A: Array, last: tuple[int, ...]) -> Array:
    """A view of batch-first A whose last axes, counted from the end, come first, in this order."""
    return A.transpose(*last, *range(A.ndim - len(last)))
