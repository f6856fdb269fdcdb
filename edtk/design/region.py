"""A region where experiments may lie: a model as a function of its points. It knows no robot."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.cell.sight import Sight
from edtk.design.design_space import weighted_information
from edtk.design.expansion import Expansion, NotPolynomialError, degrees_of, expand
from edtk.design.information import (
    Known,
    ModelRows,
    Rows,
    nearly_equal,
    pack_gram,
    side_by_side,
)
from edtk.design.problem import Problem, several_models
from edtk.design.theta_box import Robust, RowsAt, RowsOfEach, Scale, Sites, told_names
from edtk.design.user_model import (
    ALIKE,
    UserEnclosure,
    UserFunction,
    as_names,
    inside_differences,
    point_text,
    trial_points,
    user_functions,
    variable_names,
)
from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError, real_numbers
from edtk.system.presented import Presented
from edtk.system.typing import Array, Mask

FEASIBLE = 1e-10  # by which rounding may carry a point over a constraint, in the constraint's units
# Relative difference of a gradient from the difference of rows, beyond which it is another one.
GRADIENT_ALIKE = 1e-5
POINTS_TRIED = 128  # points of a box at which a nonlinear model is tried
# Means over a box: nodes of a rule at most, in all and by each variable; relative difference of two
# rules that are both exact; points a rule must roughly agree with, and by how much of the diagonal
# it may differ; points where none is.
RULE_NODES = 100_000
MOST_OF_EACH = 150
EXACT = 1e-11
FEW_POINTS = 4_096
ROUGHLY = 0.05
EVEN_POINTS = 65_536


def box_limits(low: ArrayLike, high: ArrayLike) -> Array:
    """Make the bounds (2, d) of d variables from two lists, or of one from two numbers.

    Args:
        low: Lower bounds (d,).
        high: Upper bounds (d,).

    Raises:
        ArgumentError: They are not finite, or one is not below the other.
    """
    try:
        lower = np.atleast_1d(np.asarray(low, dtype=float))
        upper = np.atleast_1d(np.asarray(high, dtype=float))
    except (TypeError, ValueError, OverflowError) as error:
        message = "expected numbers, one for each variable"
        raise ArgumentError(message, argument="low, high") from error
    if lower.ndim != 1 or lower.shape != upper.shape or not lower.size:
        raise ArgumentError(
            f"{upper.shape} beside low of {lower.shape}; expected one bound a variable",
            argument="high",
        )
    limits = np.stack([lower, upper])
    if not np.isfinite(limits).all():
        raise ArgumentError("a bound is not finite; expected a box", argument="low, high")
    if not (lower < upper).all():
        i = int(np.argmin(upper - lower))
        raise ArgumentError(
            f"bounds {lower[i]:g} and {upper[i]:g} of variable {i + 1}; expected low < high",
            argument="low, high",
        )
    return limits


@dataclass(frozen=True, eq=False)
class RegionPoints:
    """Points x (..., d) of a region.

    Args:
        space: The region.
        x: Points (..., d).
    """

    space: "Region"
    x: Array

    @cached_property
    def regressor(self) -> Array:
        """Whitened rows (..., rows, p)."""
        return self.space.rows_at(self.x)

    @cached_property
    def derivative(self) -> Array:
        """Derivatives (..., rows, p, d) of the whitened rows."""
        return self.space.derivative_at(self.x)

    @property
    def packed(self) -> Array:
        """Information of one experiment each, packed (p(p+1)/2, ...), without the prior."""
        A = self.regressor
        return pack_gram(A.transpose(A.ndim - 1, A.ndim - 2, *range(A.ndim - 2)))

    @cached_property
    def slack(self) -> Array:
        """Slacks (..., c) of the constraints; negative means infeasible."""
        return self.space.slack_at(self.x)

    @cached_property
    def slack_gradient(self) -> Array:
        """Derivatives (..., c, d) of the slacks."""
        return self.space.slack_derivative_at(self.x)

    @property
    def feasible(self) -> Mask:
        """Whether each point (...) lies in the box and satisfies the constraints."""
        low, high = self.space.limits
        within = ((self.x >= low) & (self.x <= high)).all(axis=-1)
        return np.asarray(within & (self.slack >= -FEASIBLE).all(axis=-1))

    def visited(self, visits: Array) -> "RegionPoints":
        """The same points: repeats share no error."""
        return self

    def information(self, repeats: Array) -> Array:
        """Information matrices (b, p, p) of plans (b, k) with repetitions or weights (b, k)."""
        return weighted_information(self.regressor, repeats, self.space.prior)

    def slope(self, B: Array, part: slice = slice(None)) -> Array:
        """Derivatives (..., d) of ``<B, A>`` by the point, B held fixed.

        Args:
            B: Matrices (..., rows, q).
            part: The q parameters of the whitened rows A that they are about.
        """
        return np.einsum("...rp,...rpd->...d", B, self.derivative[..., part, :])


Model = Callable[[Array], ArrayLike]


class Region(Presented):
    """Experiments ``y = A(x) k + noise`` at points x of a box, under smooth constraints.

    The model is a function of many points at once, or of one, which is called point by point. For a
    nonlinear model ``y = eta(x, k)`` its rows are the derivatives of eta by the parameters, at a
    first guess of k. `edtk.relax` finds the best weights over all points of the region, and
    `edtk.plan` the best plan of some experiments.

    Args:
        rows: The model: points x (n, d) to regressors A (n, rows, p), or (n, p) where an experiment
            measures one number; or one point (d,) to (rows, p) or (p,), where a single variable is
            a number or (1,). Gradient and constraints may be of one point, too.
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
        degree: Degree of rows and constraints by each variable, at most, where they are
            polynomials: a number, or one for each variable (d,). It is needed only where the
            functions do not run on polynomials themselves, see `expand`.
        enclosure: Bounds of the rows over boxes: lower and upper ends (b, d) of many boxes to
            arrays of least and of largest regressors, each (b, rows, p) or (b, p). It is needed
            only for proofs of a model that runs neither on polynomials nor on intervals.

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
    known: Known | None
    robust: Robust | None = None  # several models side by side, and what a design is for

    @checked
    def __init__(
        self,
        rows: Model,
        low: ArrayLike,
        high: ArrayLike,
        gradient: Model | None = None,
        constraints: "Model | Sequence[Model]" = (),  # read below, in words of its own
        parameters: str | Sequence[str] | None = None,
        sigma: ArrayLike = 1.0,
        prior: ArrayLike | None = None,
        variables: str | Sequence[str] | None = None,
        degree: int | Sequence[int] | None = None,
        enclosure: Callable[[Array, Array], tuple[ArrayLike, ArrayLike]] | None = None,
    ) -> None:
        self.limits = box_limits(low, high)
        self.variables = variable_names(variables, self.size)
        self._T: Array | None = None
        self._scale: Scale | None = None
        self._row_shape: tuple[int, ...] | None = None
        self._rows = UserFunction(rows, "rows").for_many(self.limits)
        self._gradient = None
        if gradient is not None:
            self._gradient = UserFunction(gradient, "gradient").for_many(self.limits)
        self._constraints = user_functions(constraints, "constraints", self.limits)
        # A problem of one point checks names, noise and prior.
        one = self._middle()
        A = self._rows(one)
        if A.ndim not in (2, 3) or 0 in A.shape[1:]:
            raise self._rows.wrong_shape(A, "(n, rows, p) or (n, p) of n points")
        self._sigma: Array = np.ones(1 if A.ndim == 2 else int(A.shape[1]))
        noise = real_numbers(sigma, "sigma")
        if noise.shape not in ((), self._sigma.shape):
            message = f"shape {noise.shape}; expected a number, or {len(self._sigma)} of them"
            raise ArgumentError(message, argument="sigma")
        problem = Problem(self.rows_at(one), noise, as_names(parameters), prior)
        self._sigma = np.broadcast_to(noise, self._sigma.shape)
        self.parameters = problem.parameters
        self.known = problem.known
        self.p = problem.p
        self._row_shape = A.shape[1:]
        self._require_model()
        self.enclosure = None if enclosure is None else UserEnclosure(enclosure, A.shape[1:])
        self._degree = None if degree is None else degrees_of(degree, self.size)
        if degree is not None:
            _ = self._row_polynomials, self._slack_polynomials  # it is refused here and now
        self._variable_first = gradient is not None and self._is_variable_first()

    @classmethod
    @checked
    def of_model(
        cls,
        f: str | Sequence[str] | Callable[..., ArrayLike],
        theta: Any,
        box: Any,
        family: str = "normal",
        *,
        link: str | None = None,
        sigma: ArrayLike | Callable[..., ArrayLike] = 1.0,
        covariance: ArrayLike | None = None,
        gradient: Callable[..., ArrayLike] | None = None,
        parameters: str | Sequence[str] | None = None,
        variables: str | Sequence[str] | None = None,
        prior: ArrayLike | None = None,
        robust: str | None = None,
        weights: ArrayLike | None = None,
        constraints: "Model | Sequence[Model]" = (),  # read below, in words of its own
    ) -> "Region":
        """Make a region of a nonlinear model, linearised at theta.

        Args:
            f: See `Problem.of_model`.
            theta: See `Problem.of_model`.
            box: (low, high) of one variable, or a pair for each of them; or a mapping with names.
            family: See `Problem.of_model`.
            link: See `Problem.of_model`.
            sigma: See `Problem.of_model`.
            covariance: See `Problem.of_model`.
            gradient: See `Problem.of_model`.
            parameters: See `Problem.of_model`.
            variables: See `Problem.of_model`.
            prior: See `Problem.of_model`.
            robust: See `Problem.of_model`.
            weights: See `Problem.of_model`.
            constraints: See `Region`.

        Raises:
            ArgumentError: See `Problem.of_model`.

        Example:
            >>> import edtk
            >>> theta = {"a": 0.0, "b": 1.0}
            >>> answers = edtk.Region.of_model("a + b * dose", theta, (-10, 10), family="binomial")
            >>> edtk.relax(answers, "D").points.round(4).tolist()
            [[-1.5434], [1.5434]]
        """
        from edtk.design.of_model import of_model  # it loads scipy

        return of_model(
            BoxSites.of(box, variables, constraints),
            f,
            theta,
            robust,
            weights,
            prior,
            family=family,
            link=link,
            sigma=sigma,
            covariance=covariance,
            gradient=gradient,
            parameters=parameters,
        )

    @classmethod
    @checked
    def of_rivals(
        cls,
        f: str | Sequence[str] | Callable[..., ArrayLike],
        theta: Any,
        rival: str | Sequence[str] | Callable[..., ArrayLike],
        rival_theta: "Mapping[str, Any]",  # read below, likewise
        box: Any,
        family: str = "normal",
        *,
        link: str | None = None,
        sigma: ArrayLike | Callable[..., ArrayLike] = 1.0,
        covariance: ArrayLike | None = None,
        parameters: str | Sequence[str] | None = None,
        variables: str | Sequence[str] | None = None,
        constraints: "Model | Sequence[Model]" = (),  # read below, in words of its own
    ) -> "Region":
        """Make a region of telling a model from a rival, whatever parameters the rival has.

        Args:
            f: See `Problem.of_rivals`.
            theta: See `Problem.of_rivals`.
            rival: See `Problem.of_rivals`.
            rival_theta: See `Problem.of_rivals`.
            box: See `of_model`.
            family: See `Problem.of_rivals`.
            link: See `Problem.of_rivals`.
            sigma: See `Problem.of_rivals`.
            covariance: See `Problem.of_rivals`.
            parameters: See `Problem.of_rivals`.
            variables: See `Problem.of_rivals`.
            constraints: See `Region`.

        Raises:
            ArgumentError: See `Problem.of_rivals`.

        Example:
            >>> import edtk
            >>> line = "c + d * x"
            >>> rivals = edtk.Region.of_rivals(
            ...     "a * x^2", {"a": 1.0}, line, {"c": (-2, 2), "d": (-2, 2)}, (-1, 1)
            ... )
            >>> round(edtk.relax(rivals).worst.value, 4)
            0.25
        """
        from edtk.design.of_model import of_rivals  # it loads scipy

        return of_rivals(
            BoxSites.of(box, variables, constraints),
            f,
            theta,
            rival,
            rival_theta,
            parameters,
            family=family,
            link=link,
            sigma=sigma,
            covariance=covariance,
        )

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

    @property
    def sight(self) -> Sight | None:
        """All rows are read at each point."""
        return None

    def at(self, x: Array, held: Mask | None = None) -> RegionPoints:
        """The experiments at points x (..., d), at which nothing can be held."""
        return RegionPoints(self, x)

    def problem(self, x: ArrayLike) -> Problem:
        """Make a problem of arrays with the points x (n, d) as its candidates."""
        points = np.asarray(x, dtype=float).reshape(-1, self.size)
        each = () if self.robust is None else self.robust.models
        if len(each) > 1:
            kept: Rows = ModelRows([Rows.of(model.rows_at(points)) for model in each])
            kept = kept if self._T is None else kept.times(self._T)
            return Problem.of_kept(kept, self.parameters, self.known)
        found = Problem(self.rows_at(points), 1.0, self.parameters)
        return found if self.known is None else found.with_prior(self.known)

    @property
    def prior(self) -> Array | None:
        """Prior information (p, p) of each experiment; None for none."""
        return None if self.known is None else self.known.information

    def with_prior(self, more: Array) -> "Region":
        """The same region, of whose experiments each has more prior information (p, p)."""
        return self.beside(Known.of(more) if self.known is None else self.known.plus(more))

    def beside(self, known: Known) -> "Region":
        """The same region, of whose experiments each has other prior information."""
        other = copy(self)
        other.known = known
        return other

    def in_units(self, T: Array, chosen: Array) -> "Region":
        """The same region for parameters k' with ``k = T k'``, of which some do not matter.

        Args:
            T: Regular matrix (p, p).
            chosen: Ones for parameters that count, zeros (p,) for those whose regressors are zero.
        """
        other = copy(self)
        other._T = T * chosen
        if self.known is not None:
            other.known = Known.of(self.known.times(T))
        return other

    def rows_at(self, x: Array) -> Array:
        """Whitened rows (..., rows, p) at points x (..., d)."""
        flat = self._inside(x)
        A = self._told(self._rows(flat, self._row_shape), flat, "rows")
        A = A.reshape((len(flat), len(self._sigma), -1)) / self._sigma[:, None]
        if self._T is not None:
            A = Rows(A).times(self._T).A
        return np.asarray(A.reshape(x.shape[:-1] + A.shape[1:]))

    def noise_at(self, x: Array) -> Array | None:
        """By what the rows at points x (n, d) were divided, (n, rows), see `Problem`."""
        sigma = np.broadcast_to(self._sigma, (len(x), len(self._sigma)))
        factor = 1.0 if self._scale is None else self._scale(x)
        return None if factor is None else np.asarray(sigma * factor)

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

    def mean_over_points(self) -> tuple[Array, Array]:
        """Rows (k, rows, p) and weights (k,), whose mean is that over all points of the region.

        In a box they are at the nodes of a product of Gauss and Legendre's rules, with more and
        more of them until the mean of ``A'A`` is the same to eleven digits, and that of 4,096 even
        points is so to some per cent: a wide enough peak between nodes is not passed over. No rule
        has more than 100,000 nodes; it is exact for polynomials of a degree below twice its nodes
        of a variable. Under constraints, or where no rule settles, points are 65,536 of Halton's
        sequence that are feasible, which count alike.
        """
        last = None
        n = 2
        while not self._constraints and n <= MOST_OF_EACH and n**self.size <= RULE_NODES:
            A, weights = self._gauss_legendre(n)
            M = _mean(A, weights)
            if last is not None and nearly_equal(M, last, EXACT):
                if _roughly_equal(M, _mean(*self._even(FEW_POINTS))):
                    return A, weights
                break
            last = M
            n += n // 2
        return self._even(EVEN_POINTS)

    def _gauss_legendre(self, n: int) -> tuple[Array, Array]:
        """Rows at a product of rules of n nodes for each variable, and their weights."""
        nodes, weights = np.polynomial.legendre.leggauss(n)
        axes = np.meshgrid(*[0.5 + 0.5 * nodes] * self.size, indexing="ij")
        shares = np.meshgrid(*[0.5 * weights] * self.size, indexing="ij")
        low, high = self.limits
        x = low + (high - low) * np.stack(axes, axis=-1).reshape(-1, self.size)
        return self.rows_at(x), np.prod(shares, axis=0).ravel()

    def _even(self, count: int) -> tuple[Array, Array]:
        """Rows at so many points that lie evenly, and equal weights.

        Raises:
            ArgumentError: None of the points is feasible.
        """
        from scipy.stats import qmc

        low, high = self.limits
        x = low + (high - low) * qmc.Halton(self.size, scramble=False).random(count)
        x = x[self.at(x).feasible]
        if not len(x):
            message = "leave so little room that no mean over the region is known; expected points"
            raise ArgumentError(message, argument="constraints")
        return self.rows_at(x), np.full(len(x), 1 / len(x))

    @property
    def functions(self) -> tuple[UserFunction, ...]:
        """The function of rows as they are given, and those of constraints."""
        return (self._rows, *self._constraints)

    @property
    def judged_by(self) -> tuple[Array, Array | None]:
        """What makes whitened rows of given ones: sigma (rows,), by which they are divided, and T.

        They are multiplied with T (p, p), or with nothing where it is None.
        """
        return self._sigma, self._T

    def polynomial_rows(self) -> Expansion:
        """The whitened rows (rows, p) as polynomials.

        Raises:
            ArgumentError: They are none.
        """
        rows = self._row_polynomials.reshaped((len(self._sigma), -1))
        return rows.divided(self._sigma).times(self._T)

    def polynomial_slacks(self) -> tuple[Expansion, ...]:
        """The slacks of the constraints as polynomials, those of each function (c,) together.

        Raises:
            ArgumentError: They are none.
        """
        return tuple(slack.reshaped((-1,)) for slack in self._slack_polynomials)

    @cached_property
    def _row_polynomials(self) -> Expansion:
        """What the user's function of rows is; regions in other parameters share it."""
        return self._expanded(self._rows)

    @cached_property
    def _slack_polynomials(self) -> tuple[Expansion, ...]:
        """What each function of constraints is."""
        return tuple(self._expanded(constraint) for constraint in self._constraints)

    def _expanded(self, given: UserFunction) -> Expansion:
        """A function as polynomials.

        Raises:
            ArgumentError: It is none, or none of the degree that is stated.
        """
        try:
            return expand(given, self.limits, self._degree)
        except NotPolynomialError as error:
            where = "" if error.x is None else f" at {self.point_text(error.x)}"
            raise ArgumentError(f"{error}{where}", argument=given.name) from error

    def point_text(self, x: Array) -> str:
        """A point (d,) in words, for messages."""
        return point_text(self.variables, x)

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
        x = trial_points(self.limits)
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
        x = trial_points(self.limits)
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


@dataclass(frozen=True, eq=False)
class BoxSites(Sites[Region]):
    """A box under constraints, of which a model is tried at some points.

    Attributes:
        low: Lower bounds (d,).
        high: Upper bounds (d,).
        constraints: Functions of points whose values are zero or positive where one is allowed.
    """

    low: Array
    high: Array
    constraints: tuple[UserFunction, ...]

    @classmethod
    def of(cls, box: Any, variables: str | Sequence[str] | None, constraints: Any) -> "BoxSites":
        """(low, high) of one variable or of each, or a mapping with names.

        Raises:
            ArgumentError: They are no such pairs, or constraints are no functions.
        """
        from scipy.stats import qmc

        names = None
        if isinstance(box, Mapping):
            names = tuple(box)
            box = list(box.values())
        try:
            pairs = np.atleast_2d(np.asarray(box, dtype=float))
        except (TypeError, ValueError, OverflowError) as error:
            raise ArgumentError("expected (low, high) of each variable", argument="box") from error
        fits = pairs.ndim == 2 and pairs.shape[1] == 2 and np.isfinite(pairs).all()
        if not fits or not (pairs[:, 0] < pairs[:, 1]).all():
            message = "expected finite (low, high) of each variable, low below high"
            raise ArgumentError(message, argument="box")
        low, high = pairs.T
        functions = user_functions(constraints, "constraints", pairs.T)
        halton = qmc.Halton(len(low), scramble=False).random(POINTS_TRIED)
        points = low + (high - low) * halton
        for constraint in functions:
            kept = constraint(points).reshape(len(points), -1).min(axis=1) >= 0
            points = points[kept] if kept.any() else points
        return cls(points, told_names(names, variables), None, low, high, functions)

    def alone(self, rows: RowsAt, parameters: Sequence[str], prior: Any = None) -> Region:
        """The box under one model."""
        return Region(
            rows,
            self.low,
            self.high,
            constraints=[one.function for one in self.constraints],
            parameters=parameters,
            prior=prior,
            variables=self.variables,
        )

    def scaled(self, found: Region, scale: Scale) -> None:
        """Tell a region by what its rows were divided."""
        found._scale = scale

    def together(self, models: Sequence[Region], rows_of_each: RowsOfEach) -> Region:
        """The box under several models."""
        beside = several_models([model.problem(self.trial[:1]) for model in models])
        return self.alone(lambda x: side_by_side(rows_of_each(x)), beside.parameters, beside.prior)

    def allowed(self, x: Array) -> Mask:
        """Those that obey the constraints."""
        slacks = [constraint(x).reshape(len(x), -1) for constraint in self.constraints]
        return np.concatenate([np.zeros((len(x), 1)), *slacks], axis=1).min(axis=1) >= 0


def _mean(A: Array, weights: Array) -> Array:
    """``sum_k w_k A_k'A_k`` (p, p) of rows (k, rows, p)."""
    return np.asarray(np.einsum("k,krp,krq->pq", weights, A, A))


def _roughly_equal(M: Array, other: Array) -> bool:
    """Whether two means (p, p) are alike to some per cent of their diagonals."""
    size = np.sqrt(np.maximum(np.diag(M), np.diag(other)))
    return bool((np.abs(M - other) <= ROUGHLY * np.outer(size, size)).all())
