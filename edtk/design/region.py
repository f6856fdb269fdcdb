"""A region where experiments may lie: a model as a function of its points. It knows no robot."""

from collections.abc import Callable, Sequence
from copy import copy

import numpy as np
from numpy.typing import ArrayLike

from criteria.linalg.root import root
from edtk.design.box_limits import box_limits
from edtk.design.inside_differences import inside_differences
from edtk.design.problem import Problem
from edtk.design.region_points import RegionPoints
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
            (n, p, d). Without it they are differences, of ten digits: see `inside_differences`.
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
        self.variables = _names(variables, self.size, "variables", "x")
        self._T: Array | None = None
        self._rows = rows
        self._gradient = gradient
        self._constraints = (constraints,) if callable(constraints) else tuple(constraints)
        # A problem of one point checks names, noise and prior.
        one = self._middle()
        A = self._of_many("rows", self._rows, one, None)
        if A.ndim not in (2, 3) or 0 in A.shape[1:]:
            raise _shape_error("rows", A, "(n, rows, p) or (n, p) of n points")
        self._one_row = A.ndim == 2
        self._sigma: Array = np.ones(1 if self._one_row else int(A.shape[1]))
        problem = Problem(self.rows_at(one), sigma, _tuple(parameters), prior)
        self._sigma = np.broadcast_to(np.asarray(sigma, dtype=float), self._sigma.shape)
        self.parameters = problem.parameters
        self.prior = problem.prior
        self.p = problem.p
        self._require_model()

    def headline(self) -> str:
        """Variables with their bounds, constraints and parameters."""
        low, high = self.limits
        box = ", ".join(
            f"{name} in [{a:g}, {b:g}]"
            for name, a, b in zip(self.variables, low, high, strict=True)
        )
        some = f" under {self._constrained} constraints" if self._constrained else ""
        return f"{box}{some}; {self.p} parameters ({', '.join(self.parameters)})"

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
        A = self._of_many("rows", self._rows, flat, self._row_shape)
        A = A.reshape((len(flat), len(self._sigma), -1)) / self._sigma[:, None]
        if self._T is not None:
            A = A @ self._T
        return np.asarray(A.reshape(x.shape[:-1] + A.shape[1:]))

    def derivative_at(self, x: Array) -> Array:
        """Derivatives (..., rows, p, d) of the whitened rows at points x (..., d)."""
        flat = self._inside(x)
        if self._gradient is None:
            G = inside_differences(self.rows_at, flat, self.limits)
        else:
            own = (self.p,) if self._one_row else (len(self._sigma), self.p)
            G = self._of_many("gradient", self._gradient, flat, (*own, self.size))
            G = G.reshape(len(flat), len(self._sigma), self.p, self.size)
            G = G / self._sigma[:, None, None]
            if self._T is not None:
                G = np.einsum("nrpd,pq->nrqd", G, self._T)
        return np.asarray(G.reshape(x.shape[:-1] + G.shape[1:]))

    def slack_at(self, x: Array) -> Array:
        """Slacks (..., c) of the constraints at points x (..., d)."""
        flat = self._inside(x)
        own = [np.zeros((len(flat), 0))]
        for constraint in self._constraints:
            c = self._of_many("constraints", constraint, flat, None)
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

    @property
    def _row_shape(self) -> tuple[int, ...] | None:
        """Shape of a point's rows as the model gives them; None before they are known."""
        if not hasattr(self, "p"):
            return None
        return (self.p,) if self._one_row else (len(self._sigma), self.p)

    @property
    def _constrained(self) -> int:
        """Number of constraints."""
        return int(self.slack_at(self._middle()).shape[-1])

    def _middle(self) -> Array:
        """The point (1, d) in the middle of the box."""
        return self.limits.mean(axis=0)[None]

    def _inside(self, x: Array) -> Array:
        """Points (m, d), none outside the box by the last digit or by the step of a difference.

        A model may be undefined outside: log x, or the root of 1 - x.
        """
        return np.clip(x.reshape(-1, self.size), *self.limits)

    def _called(self, function: Model, name: str, x: Array) -> Array:
        """Values of a function of the user, as an array of numbers."""
        try:
            values = np.asarray(function(x.copy()), dtype=float)
        except (TypeError, ValueError, IndexError) as error:
            message = f"fails for points of shape {x.shape}: {error}"
            raise ArgumentError(message, argument=name) from error
        return values

    def _of_many(
        self, name: str, function: Model, x: Array, shape: tuple[int, ...] | None
    ) -> Array:
        """Values (m, ...) of a function of the user at points (m, d), checked.

        Raises:
            ArgumentError: They have another shape, or one is not finite: its point is named.
        """
        with np.errstate(all="ignore"):  # what is not finite is named below
            values = self._called(function, name, x)
        if values.shape[:1] != (len(x),) or (shape is not None and values.shape[1:] != shape):
            expected = "one entry a point" if shape is None else f"{(len(x), *shape)}"
            raise _shape_error(name, values, f"{expected} for {len(x)} points")
        finite = np.isfinite(values.reshape(len(x), -1)).all(axis=1)
        if not finite.all():
            where = self.point_text(x[np.flatnonzero(~finite)[0]])
            raise ArgumentError(f"a value is not finite at {where}", argument=name)
        return values

    def _require_model(self) -> None:
        """Try the model at a few points, together and one by one.

        Raises:
            ArgumentError: It is not vectorised, or its gradient is not that of its rows.
        """
        low, high = self.limits
        x = np.array([low + part * (high - low) for part in TRIED])
        for name, function in (("rows", self.rows_at), ("constraints", self.slack_at)):
            together = function(x)
            single = np.concatenate([function(point[None]) for point in x])
            if not _near(together, single, ALIKE):
                raise ArgumentError(
                    "values of many points differ from those of one point at a time; expected a "
                    "function of each point alone",
                    argument=name,
                )
        if self._gradient is None:
            return
        by_difference = inside_differences(self.rows_at, x, self.limits) * (high - low)
        if not _near(self.derivative_at(x) * (high - low), by_difference, GRADIENT_ALIKE):
            raise ArgumentError(
                "it is not the derivative of the rows, as differences show; expected shape "
                "(n, rows, p, d) or (n, p, d), the variable last",
                argument="gradient",
            )


def _names(given: Sequence[str] | None, n: int, argument: str, letter: str) -> tuple[str, ...]:
    """Names (n,), by default a letter with numbers.

    Raises:
        ArgumentError: Their number is not n.
    """
    if given is None:
        return (letter,) if n == 1 else tuple(f"{letter}{i + 1}" for i in range(n))
    names = _tuple(given) or ()
    if len(names) != n or len(set(names)) != n:
        raise ArgumentError(f"{', '.join(names)}; expected {n} different names", argument=argument)
    return names


def _tuple(names: Sequence[str] | None) -> tuple[str, ...] | None:
    """Names as a tuple; one name may stand alone."""
    if names is None:
        return None
    return (names,) if isinstance(names, str) else tuple(names)


def _near(values: Array, others: Array, tolerance: float) -> bool:
    """Whether arrays are equal up to a part of their largest entry."""
    size = max(float(np.abs(others).max(initial=0.0)), float(np.abs(values).max(initial=0.0)))
    return bool(np.abs(values - others).max(initial=0.0) <= tolerance * size)


def _shape_error(name: str, values: Array, expected: str) -> ArgumentError:
    """The error of a function whose values have the wrong shape."""
    return ArgumentError(
        f"values have the shape {values.shape}; expected {expected}", argument=name
    )
