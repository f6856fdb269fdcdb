"""The restricted master problem of a criterion of extreme eigenvalues."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from criteria.linalg.inverse import whitener
from criteria.linalg.triangle import triangle
from criteria.spectral_band import SpectralBand
from edtk.design.packed import order
from edtk.design.relaxation.active_information import ActiveInformation
from edtk.design.relaxation.conic_equations import ConicSolve, conic_equations
from edtk.design.relaxation.step_length import step_length
from edtk.system.typing import Array

STEPS = 40
TOWARDS_BOUNDARY = 0.95  # part of the way to the boundary that a step may take
LEAST_SHRINKING = 1e-6  # of the products of primal and dual in one step
INSIDE = 2.0  # how far inside its constraints the first point lies
WORSE = 2.0  # factor by which rounding raises the error again, after which no step helps
SPREAD = 0.5  # part of the first weights that is spread over all candidates


def spectral_weights(
    band: SpectralBand, active: ActiveInformation, start: Array, accuracy: float
) -> tuple[Array, Array]:
    """Minimise ``b sum(w) + a kappa`` over ``w >= 0`` with ``F <= M(w) <= kappa C``.

    This is a semidefinite program, solved by a primal-dual interior point method in the directions
    of Nesterov and Todd, with Mehrotra's predictor and corrector (Todd, Toh and Tutuncu, SIAM J.
    Optim. 8, 1998). Y and Z, both positive semidefinite, are the duals of the two inequalities:
    ``<Y - Z, M_i> + v_i = b`` with slacks v, and ``<Z, C> = a``. In the parameters in which an
    inequality and its dual are the same diagonal matrix, the equations of a step have the form of
    those of D-optimality.

    Args:
        band: The numbers a and b, and the matrices F and C.
        active: Information of the candidates (k).
        start: Weights (k,) to start near.
        accuracy: Relative gap at which to end.

    Returns:
        Weights (k,), positive, of sum one, and the multiplier ``Y - Z`` (p, p).

    Raises:
        LinAlgError: The first weights leave a direction open.
    """
    T = whitener(active.information(start))
    point = _Point.first(band.transformed(T), active, T, start)
    best = point
    for _ in range(STEPS):
        if best.error <= accuracy or point.error > WORSE * best.error:
            break
        try:
            point = point.step()
            best = point if point.error < best.error else best
        except np.linalg.LinAlgError:
            # Where matrices are singular to rounding, the answer is as good as it can be.
            break
    return best.w / best.w.sum(), T @ best.multiplier @ T.T


@dataclass(frozen=True, eq=False)
class _Cone:
    """A positive definite X (p, p) and its dual S in parameters in which they are the same.

    Attributes:
        H: ``H X H' = H^-T S H^-1 = diag(l)`` (p, p).
        l: The diagonal (p,).
    """

    H: Array
    l: Array  # noqa: E741, the letter of the formula

    @classmethod
    def of(cls, X: Array, S: Array) -> "_Cone":
        """The scaling of Nesterov and Todd, by the singular values of a product of factors."""
        L = np.linalg.cholesky(X)
        _, l, rows = np.linalg.svd(np.linalg.cholesky(S).T @ L)  # noqa: E741
        return cls(np.sqrt(l)[:, None] * np.linalg.solve(L.T, rows.T).T, l)

    def change(self, mu: float, lost: Array | None = None) -> Array:
        """C (p, p) with ``(diag(l) C + C diag(l))/2 = mu I - diag(l)^2 - lost``."""
        right = np.diag(mu - self.l**2)
        if lost is not None:
            right = right - lost
        return 2.0 * right / (self.l[:, None] + self.l)

    def longest(self, change: Array) -> float:
        """The length of a step along a change (p, p), in these parameters."""
        root = np.sqrt(self.l)
        eigenvalues = np.linalg.eigvalsh(change / (root[:, None] * root))
        return step_length(np.ones_like(eigenvalues), eigenvalues, TOWARDS_BOUNDARY)


@dataclass(frozen=True, eq=False)
class _Direction:
    """Changes of a point: weights, kappa, slacks, and both matrices of each cone."""

    w: Array
    kappa: float
    v: Array
    X: list[Array]
    S: list[Array]

    def lengths(self, point: "_Point") -> tuple[float, float]:
        """How far primal and dual may go."""
        primal = [cone.longest(X) for cone, X in zip(point.cones, self.X, strict=True)]
        dual = [cone.longest(S) for cone, S in zip(point.cones, self.S, strict=True)]
        return (
            min(step_length(point.w, self.w, TOWARDS_BOUNDARY), *primal),
            min(step_length(point.v, self.v, TOWARDS_BOUNDARY), *dual),
        )


@dataclass(frozen=True, eq=False)
class _Point:
    """A point inside all constraints, in the parameters that T whitens.

    Attributes:
        band: The program in these parameters.
        active: Information of the candidates in the original ones.
        T: The whitener (p, p).
        w: Weights (k,).
        kappa: The upper bound.
        v: Dual slacks (k,).
        duals: Y (p, p), and Z where there is an upper bound.
    """

    band: SpectralBand
    active: ActiveInformation
    T: Array
    w: Array
    kappa: float
    v: Array
    duals: tuple[Array, ...]

    @classmethod
    def first(
        cls, band: SpectralBand, active: ActiveInformation, T: Array, start: Array
    ) -> "_Point":
        """A point that satisfies all equations: its duals leave each slack about as large."""
        w = (1 - SPREAD) * start + SPREAD / len(start)
        M = T.T @ active.information(w) @ T
        S = whitener(M)
        size = INSIDE * float(np.linalg.eigvalsh(S.T @ band.floor @ S)[-1])
        C = whitener(band.ceiling)
        kappa = INSIDE * size * float(np.linalg.eigvalsh(C.T @ M @ C)[-1])
        Y = S @ S.T
        Z = band.a / len(T) * (C @ C.T)
        allowed = band.b + active.sensitivities(T @ Z @ T.T)
        used = active.sensitivities(T @ Y @ T.T)
        Y *= (allowed / np.maximum(used, np.finfo(float).tiny)).min() / INSIDE
        v = allowed - active.sensitivities(T @ Y @ T.T)
        return cls(band, active, T, size * w, kappa, v, (Y, Z) if band.a else (Y,))

    @cached_property
    def inequalities(self) -> list[Array]:
        """``M - F``, and ``kappa C - M`` where there is an upper bound."""
        M = self.T.T @ self.active.information(self.w) @ self.T
        lower = [M - self.band.floor]
        return [*lower, self.kappa * self.band.ceiling - M] if self.band.a else lower

    @cached_property
    def cones(self) -> list[_Cone]:
        """The inequalities with their duals."""
        return [_Cone.of(X, S) for X, S in zip(self.inequalities, self.duals, strict=True)]

    @property
    def count(self) -> int:
        """Number of products of primal and dual."""
        return len(self.w) + len(self.T) * len(self.inequalities)

    @property
    def objective(self) -> float:
        """``b sum(w) + a kappa``."""
        return float(self.band.b * self.w.sum() + self.band.a * self.kappa)

    @property
    def multiplier(self) -> Array:
        """``Y - Z`` (p, p)."""
        return self.duals[0] - self.duals[1] if self.band.a else self.duals[0]

    @cached_property
    def residuals(self) -> tuple[Array, float]:
        """What is missing (k,) in ``<Y - Z, M_i> + v_i = b``, and in ``<Z, C> = a``."""
        found = self.active.sensitivities(self.T @ self.multiplier @ self.T.T)
        upper = self.band.a - np.vdot(self.duals[-1], self.band.ceiling) if self.band.a else 0.0
        return self.band.b - found - self.v, float(upper)

    @cached_property
    def mu(self) -> float:
        """Mean product of primal and dual."""
        products = float(self.w @ self.v)
        products += sum(
            float(np.vdot(X, S)) for X, S in zip(self.inequalities, self.duals, strict=True)
        )
        return products / self.count

    @cached_property
    def error(self) -> float:
        """Relative gap of primal and dual, and what their equations miss."""
        missing, upper = self.residuals
        gap = self.mu * self.count
        lost = float(np.abs(missing).max() * self.w.sum()) + abs(upper) * self.kappa
        return max(gap, lost) / self.objective

    def step(self) -> "_Point":
        """The next point."""
        equations = self._equations()
        predictor = equations.direction(0.0, np.zeros_like(self.w), None)
        primal, dual = predictor.lengths(self)
        reached = float((self.w + primal * predictor.w) @ (self.v + dual * predictor.v))
        for cone, X, S in zip(self.cones, predictor.X, predictor.S, strict=True):
            same = np.diag(cone.l)
            reached += float(np.vdot(same + primal * X, same + dual * S))
        ratio = reached / (self.mu * self.count)
        target = self.mu * min(1.0, max(ratio**3, LEAST_SHRINKING))
        lost = [0.5 * (X @ S + S @ X) for X, S in zip(predictor.X, predictor.S, strict=True)]
        return self._moved(equations.direction(target, predictor.w * predictor.v, lost))

    def _moved(self, direction: _Direction) -> "_Point":
        """The point at the end of a step."""
        primal, dual = direction.lengths(self)
        changes = [c.H.T @ S @ c.H for c, S in zip(self.cones, direction.S, strict=True)]
        return _Point(
            self.band,
            self.active,
            self.T,
            self.w + primal * direction.w,
            self.kappa + primal * direction.kappa,
            self.v + dual * direction.v,
            tuple(S + dual * 0.5 * (d + d.T) for S, d in zip(self.duals, changes, strict=True)),
        )

    def _equations(self) -> "_Equations":
        """The equations of a step, factorized."""
        rows, columns = triangle(len(self.T))
        scale = np.where(rows == columns, 1.0, np.sqrt(2.0))
        parts = [self.active.triangles(self.T @ cone.H.T, scale) for cone in self.cones]
        D = self.v / self.w
        if not self.band.a:
            return _Equations(self, parts[0], None, conic_equations(parts[0], D, None))
        H = self.cones[1].H
        ceiling = _pack(H @ self.band.ceiling @ H.T)
        last = np.concatenate([np.zeros(len(rows)), ceiling])
        P = np.vstack([parts[0], -parts[1]])
        return _Equations(self, P, last, conic_equations(P, D, last))


@dataclass(frozen=True, eq=False)
class _Equations:
    """The equations of a step from a point, for several right-hand sides.

    Attributes:
        point: The point.
        P: Changes (q, k) of the scaled triangles of all inequalities by each weight.
        last: Their change (q,) by kappa, if there is an upper bound.
        solve: Solves the equations.
    """

    point: _Point
    P: Array
    last: Array | None
    solve: ConicSolve

    def direction(self, mu: float, lost: Array, lost_in_cones: list[Array] | None) -> _Direction:
        """The direction to the products mu, where the predictor leaves products out.

        Args:
            mu: Products of primal and dual to aim at.
            lost: Products (k,) of the changes of weights and slacks.
            lost_in_cones: Products (p, p) of those of each inequality, or None for none.
        """
        point = self.point
        count = len(point.cones)
        wanted = [
            cone.change(mu, None if lost_in_cones is None else lost_in_cones[i])
            for i, cone in enumerate(point.cones)
        ]
        missing, upper = point.residuals
        products = mu - point.w * point.v - lost
        packed = np.concatenate([_pack(C) for C in wanted])
        dw, kappa, y = self.solve(packed, products / point.w - missing, upper)
        change = self.P @ dw if self.last is None else self.P @ dw + kappa * self.last
        dX = [_unpack(part) for part in np.split(change, count)]
        dS = [_unpack(part) for part in np.split(y, count)]
        return _Direction(dw, kappa, (products - point.v * dw) / point.w, dX, dS)


def _pack(C: Array) -> Array:
    """The upper triangle (q,) of a symmetric matrix, so scaled that products stay the same."""
    rows, columns = triangle(len(C))
    return C[rows, columns] * np.where(rows == columns, 1.0, np.sqrt(2.0))


def _unpack(packed: Array) -> Array:
    """The matrix (p, p) of a scaled upper triangle."""
    p = order(len(packed))
    rows, columns = triangle(p)
    C = np.empty((p, p))
    C[rows, columns] = packed / np.where(rows == columns, 1.0, np.sqrt(2.0))
    C[columns, rows] = C[rows, columns]
    return C
