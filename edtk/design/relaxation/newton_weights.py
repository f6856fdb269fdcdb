"""The restricted master problem of a smooth criterion, by Newton's method."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from criteria import Relaxable
from criteria.criterion import derivatives
from criteria.linalg.inverse import EPS, eigenpairs, whitener_of_regular
from criteria.linalg.typing import triangle
from edtk.design.relaxation.master_equations import (
    SHORTEST,
    ActiveInformation,
    Solve,
    step_length,
    weight_equations,
)
from edtk.design.relaxation.proof import rounding_of_inverse
from edtk.system.typing import Array

NEWTON_STEPS = 60
# Part of the way to the boundary that a step may take; it grows towards one with the accuracy.
FIRST_TOWARDS_BOUNDARY = 0.9
# Slacks of the first weights, in parts of the degree: those of weights that are all alike.
FIRST_SLACK = 0.3
LEAST_SHRINKING = 1e-4  # of the product of weights and slacks in one step
# Slacks further than so many gaps from the gradient are brought back to it before the next step:
# near a singular optimum the gradient changes fast.
ASTRAY = 10.0
SUFFICIENT = 1e-4  # part of the linear decrease that a step must reach
# A criterion that breaks its homogeneity has another optimum than the method finds.
HOMOGENEOUS = 1e-6
# Order up to which differences of gradients stand in for a curvature in closed form.
BY_DIFFERENCES = 40


class NewtonError(ArithmeticError):
    """Newton's method does not suit a criterion, or breaks down."""


def suits_newton(criterion: Relaxable, p: int) -> bool:
    """Whether a criterion of p parameters can be minimised by Newton's method."""
    is_smooth = criterion.smooth and criterion.convex and criterion.degree > 0
    if not is_smooth:
        return False
    return p <= BY_DIFFERENCES or bool(criterion.curvatures(np.eye(p)))


def newton_weights(
    criterion: Relaxable, active: ActiveInformation, start: Array, accuracy: float
) -> Array:
    """Minimise a smooth criterion over the weights of a few candidates.

    A cost of degree d is minimised over weights of sum one where ``log cost(M(w)) + d sum(w)`` is
    minimised over ``w >= 0``; the sum then is one by itself. This function is convex, since the
    criterion is convex and homogeneous: ``cost^(-1/d)`` is concave. Its gradient is the slack
    ``v_i = d - <Z, M_i>`` for minus the gradient Z of log cost. A primal-dual interior point method
    with Mehrotra's predictor and corrector follows ``w_i v_i = mu`` to mu near zero (Nocedal and
    Wright, Numerical Optimization, chapter 14 and section 19.3).

    Args:
        criterion: A criterion that `suits_newton`.
        active: Information of the candidates (k).
        start: Weights (k,) to start from; those of zero are new.
        accuracy: Relative excess of the largest sensitivity over the mean one at which to end.

    Returns:
        Weights (k,), positive, of sum one.

    Raises:
        NewtonError: The method has broken down.
        LinAlgError: A matrix is singular.
    """
    point = _Point.first(criterion, active, start)
    best = point
    for _ in range(NEWTON_STEPS):
        if best.excess <= accuracy or best.excess <= best.rounding:
            break
        step = point.step()
        if step is None:
            break
        point = step
        best = point if point.excess < best.excess else best
    return best.weights / best.weights.sum()


@dataclass(frozen=True, eq=False)
class _Point:
    """Weights and slacks (k,), and what the criterion says about them.

    Attributes:
        criterion: What is minimised.
        active: Information of the candidates (k).
        weights: Weights (k,).
        slacks: Slacks (k,).
        M: Their design (p, p).
        T: Its whitener (p, p), from which its inverse, the gradient and the next step follow.
        cost: The cost.
        sensitivities: Those (k,) to minus the gradient of log cost.
    """

    criterion: Relaxable
    active: ActiveInformation
    weights: Array
    slacks: Array
    M: Array
    T: Array
    cost: float
    sensitivities: Array

    @classmethod
    def at(
        cls, criterion: Relaxable, active: ActiveInformation, weights: Array, slacks: Array
    ) -> "_Point":
        """A point, with cost and sensitivities computed.

        The cost is that of its gradient G, ``-<G, M> / degree`` by homogeneity.

        Raises:
            NewtonError: The weights leave a direction open, to rounding.
        """
        M = active.information(weights)
        T = whitener_of_regular(M)
        if T is None:
            raise NewtonError("the weights leave a direction open")
        G = criterion.gradient_of_regular(M, T @ T.T)
        cost = -float(np.vdot(G, M)) / criterion.degree
        if not 0 < cost < np.inf:
            raise NewtonError("the weights leave a direction open")
        found = active.sensitivities(G / -cost)
        return cls(criterion, active, weights, slacks, M, T, cost, found)

    @classmethod
    def first(cls, criterion: Relaxable, active: ActiveInformation, start: Array) -> "_Point":
        """A point near the central path, from weights (k,) some of which are zero.

        It is the mean of these weights and of equal ones, which are well inside: the further the
        new candidates exceed the old ones, the further away the optimum is, and the more it has of
        the equal ones.
        """
        d = criterion.degree
        begun = cls.at(criterion, active, start, np.full(len(start), FIRST_SLACK * d))
        cost = float(criterion.cost_of_regular(begun.M, begun.T @ begun.T.T))
        if not abs(begun.cost - cost) <= HOMOGENEOUS * cost:
            raise NewtonError(f"criterion {criterion.name} is not homogeneous of degree {d:g}")
        if np.ptp(start) <= EPS:
            return begun
        slack = d - begun.sensitivities
        away = min(max(-slack.min() / d, EPS), 1.0)
        weights = (1 - away) * start + away / len(start)
        slacks = np.maximum(slack, FIRST_SLACK * away * d / (len(start) * weights))
        return cls.at(criterion, active, weights, slacks)

    @cached_property
    def excess(self) -> float:
        """How far the largest sensitivity exceeds the mean one, relatively."""
        return float(self.sensitivities.max() * self.weights.sum() / self.criterion.degree - 1.0)

    @cached_property
    def rounding(self) -> float:
        """Relative error that rounding makes in cost and sensitivities."""
        return rounding_of_inverse(self.M, np.square(self.T).sum(axis=1))

    @property
    def objective(self) -> float:
        """``log cost + d sum(w)``."""
        return float(np.log(self.cost) + self.criterion.degree * self.weights.sum())

    def step(self) -> "_Point | None":
        """The next point; None where no step makes progress."""
        w = self.weights
        v = self.slacks
        gradient = self.criterion.degree - self.sensitivities
        solve = self._equations()
        mu = float(w @ v) / len(w)
        # Predictor: how much a step straight to the optimum could gain.
        dw = solve(-gradient)
        dv = -v - v / w * dw
        reached = (w + step_length(w, dw, 1.0) * dw) @ (v + step_length(v, dv, 1.0) * dv) / len(w)
        target = max(mu * max(float(reached / mu) ** 3, LEAST_SHRINKING), self._least_target(mu))
        # Corrector: towards the central path, with the products that the predictor has left out.
        products = target - dw * dv
        if np.abs(gradient - v).max() > ASTRAY * len(w) * mu:
            products = np.full(len(w), mu)
        dw = solve(products / w - gradient)
        dv = (products - v * dw) / w - v
        most = max(FIRST_TOWARDS_BOUNDARY, 1.0 - mu)
        # A step almost to a bound may be rounded onto it.
        slacks = np.maximum(v + step_length(v, dv, most) * dv, EPS * v)
        return self._search(dw, slacks, float(gradient @ dw), mu, step_length(w, dw, most))

    def _least_target(self, mu: float) -> float:
        """The product at which rounding is as large as the gap that products leave.

        Near a singular optimum the information about the direction that it leaves open is
        proportional to the products, and rounding to its inverse.
        """
        k = len(self.weights)
        return float(np.sqrt(self.rounding * k * mu) / k)

    def _search(
        self, dw: Array, slacks: Array, slope: float, mu: float, along: float
    ) -> "_Point | None":
        """The end of a step that does not raise the objective beyond what the path allows."""
        allowed = self.objective + len(dw) * mu
        while along > SHORTEST:
            weights = np.maximum(self.weights + along * dw, EPS * self.weights)
            decrease = SUFFICIENT * along * abs(slope)
            try:
                found = self.at(self.criterion, self.active, weights, slacks)
            except NewtonError:  # the weights leave a direction open
                along *= 0.5
                continue
            if found.objective <= allowed + decrease:
                return found
            along *= 0.5
        return None

    def _equations(self) -> Solve:
        """The equations of a Newton step."""
        D = self.slacks / self.weights
        rows, columns = triangle(len(self.M))
        twice = np.where(rows == columns, 1.0, 2.0)
        T = self.T
        terms = self.criterion.curvatures(T)
        if not terms:
            return weight_equations(self._by_differences(), D, self.sensitivities)
        if len(terms) > 1:
            P = []
            for each in terms:
                one = np.ones(len(triangle(len(each.z))[0]))
                P.append(each.squares(self.active.triangles(T @ each.V, one)))
            return weight_equations(np.vstack(P), D)
        (found,) = terms
        scale = np.sqrt(found.W[rows, columns] * twice)
        lost = np.sqrt(found.c) * self.sensitivities if found.c else None
        return weight_equations(self.active.told_triangles(T @ found.V, scale), D, lost)

    def _by_differences(self) -> Array:
        """P (q, k) with ``P'P`` the second derivative of the cost, in parts of the cost."""
        rows, columns = triangle(len(self.M))
        # Steps of order one in each entry, whatever the units.
        d = np.sqrt(np.diag(self.M))
        dd = d[rows] * d[columns]
        _, _, K = derivatives(self.criterion, self.M[None])
        values, V = eigenpairs(K[0] * np.outer(dd, dd) / self.cost)
        root = np.sqrt(np.maximum(values, 0.0))[:, None] * V.T
        return np.asarray(root @ self.active.triangles(np.diag(1.0 / d), np.ones(len(rows))))
