"""A region where experiments may lie: a model as a function of its points. It knows no robot."""

from collections.abc import Callable, Sequence
from copy import copy

import numpy as np
from numpy.typing import ArrayLike

from criteria.linalg.root import root
from edtk.design.box_limits import box_limits
from edtk.design.inside_differences import inside_differences
from edtk.design.nearly_equal import nearly_equal
from edtk.design.problem import Problem
from edtk.design.region_points import RegionPoints
from edtk.design.rows import Rows
from edtk.design.user_function import UserFunction, user_functions
from edtk.design.variable_names import as_names, variable_names
from edtk.system.errors import ArgumentError
from edtk.system.presented import Presented
from edtk.system.typing import Array

Model = Callable[[Array], ArrayLike]
# Points at which a model is tried before any work: parts of the range of each variable.
TRIED = (0.5, 0.3179, 0.7311)
# Relative difference of rows computed together and one by one, beyond which a model is not a
# function of its point alone; and of a gradient from the difference of rows.
ALIKE = 1e-9
GRADIENT_ALIKE = 1e-5


class Region(Presented):
    """Experiments ``y = A(x) k + noise`` at points x of a box, under smooth constraints.

    The model is a function of many points at once. For a nonlinear model ``y = eta(x, k)`` its rows
    are the derivatives of eta by the parameters, at a first guess of k. `edtk.relax` finds the best
    weights over all points of the region, and `edtk.plan` the best plan of some experiments.

    Args:
        rows: The model: points x (n, d) to regressors A (n, rows, p), or (n, p) where an experiment
            measures one number.
        low: Lower bounds (d,) of the variables; a number for a single variable.
        high: Upper bounds (d,).
        gradient: Derivatives of the rows by the variables: points (n, d) to (n, rows, p, d), or
            (n, p, d); the variable may also be the first axis after the points. Without it they are
            differences, of ten digits: see `inside_differences`.
        constraints: Functions c of points (n, d), with values (n,) or (n, c): a point is feasible
            where they are not negative. They must be smooth, and leave some room between them.
        parameters: Names (p,) for messages; they default to k1 .. kp.
        sigma: Standard deviation of the noise, one number or one per row (rows,). Noise that
            depends on the point belongs into the rows.
        prior: Prior information M0 (p, p) per single experiment, see `Problem`.
        variables: Names (d,) of the variables; they default to x1 .. xd, or x for one.

    Raises:
        ArgumentError: A bound, name or shape does not fit, or the model is not as described.

    Example:
        >>> import numpy as np, edtk
        >>> def rows(x):  # Michaelis and Menten: y = V s/(K + s), linearised at V = 2, K = 1
        ...     s = x[:, 0]
        ...     return np.stack([s / (1 + s), -2 * s / (1 + s) ** 2], axis=-1)
        >>> design = edtk.relax(edtk.Region(rows, 0, 4, parameters=("V", "K")), "D")
        >>> design.points.round(4).tolist(), design.weights.round(4).tolist()
        ([[0.6667], [4.0]], [0.5, 0.5])
    """

    limits: Array
    parameters: tuple[str, ...]
    variables: tuple[str, ...]
    prior: Array | None

    def __init__(
        self,
        rows: Model,
        low: ArrayLike,
        high: ArrayLike,
        gradient: Model | None = None,
        constraints: Model | Sequence[Model] = (),
        parameters: Sequence[str] | None = None,
        sigma: ArrayLike = 1.0,
        prior: ArrayLike | None = None,
        variables: Sequence[str] | None = None,
    ) -> None:
        self.limits = box_limits(low, high)
        self.variables = variable_names(variables, self.size)
        self._T: Array | None = None
        self._row_shape: tuple[int, ...] | None = None
        self._rows = UserFunction(rows, "rows")
        self._gradient = None if gradient is None else UserFunction(gradient, "gradient")
        self._constraints = user_functions(constraints, "constraints")
        # A problem of one point checks names, noise and prior.
        one = self._middle()
        A = self._rows(one)
        if A.ndim not in (2, 3) or 0 in A.shape[1:]:
            raise self._rows.wrong_shape(A, "(n, rows, p) or (n, p) of n points")
        self._sigma: Array = np.ones(1 if A.ndim == 2 else int(A.shape[1]))
        if np.shape(sigma) not in ((), self._sigma.shape):
            message = f"shape {np.shape(sigma)}; expected a number, or {len(self._sigma)} of them"
            raise ArgumentError(message, argument="sigma")
        problem = Problem(self.rows_at(one), sigma, as_names(parameters), prior)
        self._sigma = np.broadcast_to(np.asarray(sigma, dtype=float), self._sigma.shape)
        self.parameters = problem.parameters
        self.prior = problem.prior
        self.p = problem.p
        self._row_shape = A.shape[1:]
        self._require_model()
        self._variable_first = gradient is not None and self._is_variable_first()

    def headline(self) -> str:
        """Variables with their bounds, constraints and parameters."""
        low, high = self.limits
        box = ", ".join(
            f"{name} in [{a:g}, {b:g}]"
            for name, a, b in zip(self.variables, low, high, strict=True)
        )
        c = int(self.slack_at(self._middle()).shape[-1])
        some = f" under {c} constraint{'s' * (c > 1)}" if c else ""
        plural = "s" if self.p > 1 else ""
        return f"{box}{some}; {self.p} parameter{plural} ({', '.join(self.parameters)})"

    @property
    def size(self) -> int:
        """Number d of variables."""
        return int(self.limits.shape[1])

    @property
    def movable(self) -> list[int]:
        """Indices of the variables that a descent may change: all."""
        return list(range(self.size))

    def at(self, x: Array) -> RegionPoints:
        """The experiments at points x (..., d)."""
        return RegionPoints(self, x)

    def problem(self, x: ArrayLike) -> Problem:
        """Make a problem of arrays with the points x (n, d) as its candidates."""
        points = np.asarray(x, dtype=float).reshape(-1, self.size)
        return Problem(self.rows_at(points), 1.0, self.parameters, self.prior)

    def with_prior(self, more: Array) -> "Region":
        """The same region, of whose experiments each has more prior information (p, p)."""
        other = copy(self)
        other.prior = more if self.prior is None else self.prior + more
        return other

    def in_units(self, T: Array, chosen: Array) -> "Region":
        """The same region for parameters k' with ``k = T k'``, of which some do not matter.

        Args:
            T: Regular matrix (p, p).
            chosen: Ones for parameters that count, zeros (p,) for those whose regressors are zero.
        """
        other = copy(self)
        other._T = T * chosen
        if self.prior is not None:
            F = root(self.prior) @ T
            other.prior = F.T @ F
        return other

    def rows_at(self, x: Array) -> Array:
        """Whitened rows (..., rows, p) at points x (..., d)."""
        flat = self._inside(x)
        A = self._told(self._rows(flat, self._row_shape), flat, "rows")
        A = A.reshape((len(flat), len(self._sigma), -1)) / self._sigma[:, None]
        if self._T is not None:
            A = Rows(A).times(self._T).A
        return np.asarray(A.reshape(x.shape[:-1] + A.shape[1:]))

    def derivative_at(self, x: Array) -> Array:
        """Derivatives (..., rows, p, d) of the whitened rows at points x (..., d)."""
        flat = self._inside(x)
        if self._gradient is None:
            G = inside_differences(self.rows_at, flat, self.limits)
        else:
            G = self._by_gradient(flat, self._variable_first) / self._sigma[:, None, None]
            if self._T is not None:
                G = np.einsum("nrpd,pq->nrqd", G, self._T)
        return np.asarray(G.reshape(x.shape[:-1] + G.shape[1:]))

    def slack_at(self, x: Array) -> Array:
        """Slacks (..., c) of the constraints at points x (..., d)."""
        flat = self._inside(x)
        own = [np.zeros((len(flat), 0))]
        for constraint in self._constraints:
            c = constraint(flat)
            self._require_finite(c, flat, "constraints")
            own.append(c.reshape(len(flat), -1))
        return np.concatenate(own, axis=1).reshape(*x.shape[:-1], -1)

    def slack_derivative_at(self, x: Array) -> Array:
        """Derivatives (..., c, d) of the slacks at points x (..., d)."""
        if not self._constraints:
            return np.zeros((*x.shape[:-1], 0, self.size))
        G = inside_differences(self.slack_at, self._inside(x), self.limits)
        return np.asarray(G.reshape(x.shape[:-1] + G.shape[1:]))

    def point_text(self, x: Array) -> str:
        """A point (d,) in words, for messages."""
        return ", ".join(f"{n} = {v:.6g}" for n, v in zip(self.variables, x, strict=True))

    def _middle(self) -> Array:
        """The point (1, d) in the middle of the box."""
        return self.limits.mean(axis=0)[None]

    def _inside(self, x: Array) -> Array:
        """Points (m, d), none outside the box by the last digit or by the step of a difference.

        A model may be undefined outside: log x, or the root of 1 - x.
        """
        return np.clip(x.reshape(-1, self.size), *self.limits)

    def _by_gradient(self, x: Array, variable_first: bool) -> Array:
        """Derivatives (n, rows, p, d) as the user's gradient gives them, without the noise."""
        assert self._gradient is not None
        own = self._row_shape or ()
        shape = (self.size, *own) if variable_first else (*own, self.size)
        G = self._told(self._gradient(x, shape), x, "gradient")
        G = np.moveaxis(G, 1, -1) if variable_first else G
        return G.reshape(len(x), len(self._sigma), self.p, self.size)

    def _told(self, values: Array, x: Array, name: str) -> Array:
        """Values (n, ...) at points (n, d), zero at infeasible points where the model has none.

        Searches may look a step beyond a constraint, where a model need not be defined.
        """
        lost = np.flatnonzero(~np.isfinite(values).all(axis=tuple(range(1, values.ndim))))
        if not len(lost):
            return values
        feasible = (self.slack_at(x[lost]) >= 0).all(axis=1)
        self._require_finite(values[lost[feasible]], x[lost[feasible]], name)
        values = values.copy()
        values[lost] = 0.0
        return values

    def _require_finite(self, values: Array, x: Array, name: str) -> None:
        """Check values (n, ...) at points (n, d).

        Raises:
            ArgumentError: One is not finite; its point is named.
        """
        lost = np.flatnonzero(~np.isfinite(values).all(axis=tuple(range(1, values.ndim))))
        if len(lost):
            where = self.point_text(x[lost[0]])
            raise ArgumentError(f"a value is not finite at {where}", argument=name)

    def _require_model(self) -> None:
        """Try the model at a few points, together and one by one.

        Raises:
            ArgumentError: It is not vectorised.
        """
        x = self._trial_points()
        for name, function in (("rows", self.rows_at), ("constraints", self.slack_at)):
            together = function(x)
            single = np.concatenate([function(point[None]) for point in x])
            if not nearly_equal(together, single, ALIKE):
                raise ArgumentError(
                    "values of many points differ from those of one point at a time; expected a "
                    "function of each point alone",
                    argument=name,
                )

    def _is_variable_first(self) -> bool:
        """Whether the gradient has the variable as its first axis after the points, or its last.

        Raises:
            ArgumentError: It is not the derivative of the rows in either form.
        """
        low, high = self.limits
        x = self._trial_points()
        expected = inside_differences(self.rows_at, x, self.limits) * (high - low)
        wrong: ArgumentError | None = None
        for first in (False, True):
            try:
                G = self._by_gradient(x, first) / self._sigma[:, None, None]
            except ArgumentError as error:
                wrong = wrong or error
                continue
            if nearly_equal(G * (high - low), expected, GRADIENT_ALIKE):
                return first
            wrong = ArgumentError(
                "it is not the derivative of the rows, as differences show; expected shape "
                "(n, rows, p, d) or (n, p, d), the variable last",
                argument="gradient",
            )
        assert wrong is not None
        raise wrong

    def _trial_points(self) -> Array:
        """Points (n, d) at which a model is tried before any work."""
        low, high = self.limits
        return np.array([low + part * (high - low) for part in TRIED])
