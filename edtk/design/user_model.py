"""A user's function of points, or of points and parameters: how it is called, and its derivatives.

Those by parameters are taken by complex steps where the function runs on complex ones, else by
differences, and both are compared before any work.
"""

import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from criteria.linalg.inverse import EPS
from edtk.system.errors import ArgumentError, note
from edtk.system.typing import Array, Mask

SLOW_MODEL = 30.0  # seconds that a model may take before its user is told
ALIKE = 1e-9  # relative difference of values of points together and one by one
# A complex step has no difference of nearly equal numbers, so it may be as small as numbers are
# (Squire and Trapp, SIAM Review 40, 1998).
COMPLEX_STEP = 1e-30
# Steps of differences, in parts of a parameter: each is half of the one before. Polynomials through
# all of them are taken at a step of zero (Ridders 1982).
FIRST_STEP = 0.02
HALVED_STEPS = 8
SEEN = 1e4  # roundings by which a step has to change a value, so that some digits tell its slope
AGREES = 1e-6  # of derivatives, in parts of the largest by the same parameter, and of differences
ROUGH = 0.01  # of the largest derivative, by which differences may be off beside exact ones
# Slopes to both sides of a kink differ however small the step is. Of a smooth function the
# difference falls with the step: ten times from one to the other.
SIDES = (1e-4, 1e-5)
KINK = 1e-3
# Points at which a model is tried before any work: parts of the range of each variable.
TRIED = (0.5, 0.3179, 0.7311)


@dataclass(frozen=True, eq=False)
class Slopes:
    """A function of points and theta with its derivatives by theta.

    Attributes:
        value: Points (n, d) and theta (p,) to values (n, k).
        slope: The same to derivatives (n, k, p).
        takes_several: Whether theta may be (p, t, 1), of t models at once: then values (t, n, k).
    """

    value: Callable[[Array, Array], Array]
    slope: Callable[[Array, Array], Array]
    takes_several: bool = False


def slopes_of(
    f: Callable[..., ArrayLike],
    gradient: Callable[..., ArrayLike] | None,
    theta: Array,
    x: Array,
    argument: str,
    names: Sequence[str],
    variables: Sequence[str],
) -> Slopes:
    """A user's function with its derivatives, tried at points x (n, d).

    Raises:
        ArgumentError: It fails, or has no derivative.
    """
    value = as_called(f, theta, x, argument, variables)
    checked = _Differences(value, theta, x, argument, names, variables)
    by_differences, error = checked.slopes()
    if gradient is not None:
        slope = _user_slopes(gradient, x, theta, by_differences)
    elif checked.agrees(_complex_slopes(value, x, theta), by_differences, error):
        slope = partial(_complex_slopes, value)
    else:
        checked.require_smooth(by_differences, error)
        slope = partial(_differences, value, checked.steps)
    return Slopes(value, slope)


class _PointError(Exception):
    """A function of single points failed at one of them, after so many others."""

    def __init__(self, message: str, done: int) -> None:
        super().__init__(message)
        self.done = done


def _one_by_one(
    f: Callable[..., ArrayLike], as_number: bool, variables: Sequence[str], points: Array, t: Array
) -> list[ArrayLike]:
    """Values of a function of one point (d,), or of one number.

    Raises:
        _PointError: It fails; its point is named.
    """
    found = []
    for point in points:
        try:
            found.append(f(point.item() if as_number else point, t))
        except Exception as error:  # a user's function may raise anything
            why = str(error) or type(error).__name__
            raise _PointError(f"at {point_text(variables, point)}: {why}", len(found)) from error
    return found


def as_called(
    f: Callable[..., ArrayLike],
    theta: Array,
    x: Array,
    argument: str,
    variables: Sequence[str],
) -> Callable[[Array, Array], Array]:
    """The function of many points (n, d) with values (n, k), however the user's wants to be called.

    It may take all points (n, d), those of one variable as (n,), one point (d,), or one number. The
    first way whose values are those of the points one by one is taken.

    Raises:
        ArgumentError: None is; the last error is told, or that of the way which went farthest.
    """
    ways: list[Callable[[Array, Array], Any]] = [lambda points, t: f(points, t)]
    if x.shape[1] == 1:
        ways.insert(0, lambda points, t: f(points[:, 0], t))
        ways.append(partial(_one_by_one, f, True, variables))
    ways.append(partial(_one_by_one, f, False, variables))
    if len(x) < 3:  # fewer points do not tell the ways apart
        x = np.concatenate([x, x, x])
    chosen = x[[0, len(x) // 2, len(x) - 1]]
    wrong, farthest = "for points and theta: values have no entry for each point", 0
    start = perf_counter()
    for way in ways:
        try:
            with np.errstate(all="ignore"):
                together = _columns(way(chosen, theta), 3)
                some = _columns(way(chosen[[2, 0]], theta), 2)
        except Exception as error:  # a user's function may raise anything
            done = getattr(error, "done", 0)
            if done >= farthest:
                wrong, farthest = _why(error), done
            continue
        if together is None or some is None or together.shape[1] != some.shape[1]:
            continue
        if np.imag(together).any():
            wrong = "for points and theta: values are complex; expected real numbers"
        elif np.allclose(together[[2, 0]], some, rtol=ALIKE, atol=0.0, equal_nan=True):
            _tell_slow(perf_counter() - start, argument)
            return partial(_values, way, argument=argument)
        else:
            wrong = "for points and theta: a point asked for again has another value"
    raise ArgumentError(f"fails {wrong}", argument=argument)


def _why(error: Exception) -> str:
    """Where and why a user's function fails."""
    if isinstance(error, _PointError) and error.done:
        return str(error)
    cause = error.__cause__ if isinstance(error, _PointError) else error
    return f"for points and theta: {str(cause) or type(cause).__name__}"


def _columns(given: Any, n: int) -> Array | None:
    """Values (n, k), of which (n,) are one column; None where they are of no such shape."""
    values = np.asarray(given)
    if values.dtype.kind not in "fciub":
        raise TypeError(f"values are {values.dtype}; expected numbers")
    values = values.reshape(n, -1) if values.shape[:1] == (n,) and values.ndim <= 2 else values
    return values if values.ndim == 2 and values.shape[0] == n and values.shape[1] else None


def _values(
    way: Callable[[Array, Array], Any], points: Array, theta: Array, argument: str
) -> Array:
    """Values (n, k) of a user's function.

    Raises:
        ArgumentError: It fails.
    """
    try:
        with np.errstate(all="ignore"):
            found = _columns(way(points.copy(), theta), len(points))
    except Exception as error:  # a user's function may raise anything
        raise ArgumentError(f"fails {_why(error)}", argument=argument) from error
    if found is None:
        message = f"values of {len(points)} points have another shape than those of three"
        raise ArgumentError(message, argument=argument)
    return found


def _tell_slow(seconds: float, argument: str) -> None:
    """Tell the user of a model that will take long: five points took so many seconds."""
    a_point = seconds / 5
    if a_point * 1000 > SLOW_MODEL:
        note(
            f"the model takes {a_point:.2g} s a point; a function of all points is faster", argument
        )


def _complex_slopes(value: Callable[[Array, Array], Array], x: Array, theta: Array) -> Array:
    """``Im f(theta + i h e_j) / h`` (n, k, p).

    They are not numbers where the function refuses complex ones.
    """
    found = []
    for j in range(len(theta)):
        step = COMPLEX_STEP * max(abs(theta[j]), 1.0)
        moved = theta.astype(complex)
        moved[j] += 1j * step
        try:
            with warnings.catch_warnings(action="ignore"):  # of one that drops imaginary parts
                values = value(x, moved)
        except ArgumentError:
            return np.full((len(x), 1, len(theta)), np.nan)
        found.append(np.imag(values) / step)
    return np.stack(found, axis=-1)


@dataclass(frozen=True, eq=False)
class _Steps:
    """By what parts of which sizes the parameters are moved.

    A parameter has its own size. One that is zero has none, and steps of one may be too small
    beside the others: ``1e12 + 1e-12 x`` has no digit of the second. Then it is moved by the size
    of the largest, or by one.

    Attributes:
        fixed: Sizes (p,); not a number for those that have their own.
    """

    fixed: Array

    @classmethod
    def of(cls, value: Callable[[Array, Array], Array], x: Array, theta: Array) -> "_Steps":
        """The first sizes by whose steps values stay finite, and change by some digits."""
        own = cls(np.full(len(theta), np.nan))
        largest = float(np.abs(theta).max())
        for j, size in enumerate(own.sizes(theta)):
            sizes = [size, *(other for other in (largest, 1.0) if 0 < other != size)]
            seen = [other for other in sizes if _is_seen(value, x, theta, j, other)]
            if seen and seen[0] != size:
                own.fixed[j] = seen[0]
        return own

    def sizes(self, theta: Array) -> Array:
        """Sizes (p,) at a theta; a zero has that of the others, or one."""
        size = np.abs(theta)
        own = np.where(size > 0, size, size.max() if size.any() else 1.0)
        return np.where(np.isnan(self.fixed), own, self.fixed)


def _is_seen(
    value: Callable[[Array, Array], Array], x: Array, theta: Array, j: int, size: float
) -> bool:
    """Whether values change by more than rounding where a parameter is moved, and stay finite."""
    step = np.zeros(len(theta))
    step[j] = FIRST_STEP * size
    up, down = (np.real(value(x, theta + sign * step)) for sign in (1, -1))
    with np.errstate(all="ignore"):
        change = np.abs(up - down)
        rounding = EPS * np.maximum(np.abs(up), np.abs(down))
    return bool(np.isfinite(change).all() and (change > SEEN * rounding).any())


def _ridders(
    value: Callable[[Array, Array], Array], x: Array, theta: Array, sizes: Array
) -> tuple[Array, Array]:
    """Derivatives (n, k, p) by central differences at several steps, and how far they may be off.

    Neville's scheme on the squares of the steps; of all entries of the table the one is taken which
    is nearest to both of its parents (Ridders, Advances in Engineering Software 4, 1982), beside
    what rounding may have made of the values over its smallest step.
    """
    best, errors = [], []
    for j, size in enumerate(sizes):
        table: list[Array] = []
        for i in range(HALVED_STEPS):
            h = FIRST_STEP * size / 2**i
            e = np.zeros(len(theta))
            e[j] = h
            up, down = np.real(value(x, theta + e)), np.real(value(x, theta - e))
            row = [(up - down) / (2 * h)]
            rounding = EPS * np.maximum(np.abs(up), np.abs(down)) / h
            for m in range(1, i + 1):
                row.append(row[m - 1] + (row[m - 1] - table[m - 1]) / (4.0**m - 1))
                off = np.maximum(np.abs(row[m] - row[m - 1]), np.abs(row[m] - table[m - 1]))
                off = off + rounding
                if i == 1:
                    found, error = row[m], off
                else:
                    better = off < error
                    found = np.where(better, row[m], found)
                    error = np.where(better, off, error)
            table = row
        best.append(found)
        errors.append(error)
    return np.stack(best, axis=-1), np.stack(errors, axis=-1)


def _differences(
    value: Callable[[Array, Array], Array], steps: _Steps, x: Array, theta: Array
) -> Array:
    """Derivatives (n, k, p) by differences alone."""
    with np.errstate(all="ignore"):
        return _ridders(value, x, theta, steps.sizes(theta))[0]


@dataclass(frozen=True, eq=False)
class _Differences:
    """Derivatives of a user's function by differences, and what they say of others."""

    value: Callable[[Array, Array], Array]
    theta: Array
    x: Array
    argument: str
    names: Sequence[str]
    variables: Sequence[str]

    def slopes(self) -> tuple[Array, Array]:
        """Derivatives (n, k, p), and how far they may be off.

        Raises:
            ArgumentError: A value is not finite; its point is named.
        """
        values = np.real(self.value(self.x, self.theta))
        lost = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if len(lost):
            message = f"the value is not finite at {self._point(lost[0])}"
            raise ArgumentError(message, argument=self.argument)
        with np.errstate(all="ignore"):  # what is not finite is no derivative
            return _ridders(self.value, self.x, self.theta, self.steps.sizes(self.theta))

    @cached_property
    def steps(self) -> _Steps:
        """By what the parameters are moved."""
        return _Steps.of(self.value, self.x, self.theta)

    def agrees(self, given: Array, slopes: Array, error: Array) -> bool:
        """Whether other derivatives are these, within what both may be off."""
        if given.shape != slopes.shape or not np.isfinite(given).all():
            return False
        # Differences of a steep model are rough; those of a jump are larger than all derivatives.
        largest = np.abs(given).max(axis=(0, 1))
        rough = np.minimum(10 * error, ROUGH * largest)
        return bool((np.abs(given - slopes) <= self._allowed(slopes) + rough).all())

    def require_smooth(self, slopes: Array, error: Array) -> None:
        """Check that differences tell a derivative.

        Raises:
            ArgumentError: They do not: point and parameter are named.
        """
        unsure = ~(error <= self._allowed(slopes))
        kinked = self._kinks(self._allowed(slopes) * KINK / AGREES)
        bad = np.argwhere(unsure | kinked)
        if len(bad):
            i, _, j = bad[0]
            name, point = self.names[j], self._point(i)
            message = f"no derivative by {name!r} at {point}, as differences show"
            raise ArgumentError(f"{message}; expected a smooth model", argument=self.argument)

    def _allowed(self, slopes: Array) -> Array:
        largest = np.abs(slopes).max(axis=(0, 1))
        return np.broadcast_to(AGREES * np.where(largest > 0, largest, 1.0), slopes.shape)

    def _kinks(self, allowed: Array) -> Mask:
        """Where slopes to both sides differ at a small step as they do at a larger one."""
        here = np.real(self.value(self.x, self.theta))
        found = []
        for j, size in enumerate(self.steps.sizes(self.theta)):
            gaps = []
            for part in SIDES:
                e = np.zeros(len(self.theta))
                e[j] = part * size
                up = np.real(self.value(self.x, self.theta + e)) - here
                down = here - np.real(self.value(self.x, self.theta - e))
                gaps.append(np.abs(up - down) / e[j])
            found.append((gaps[1] > allowed[..., j]) & (gaps[1] > 0.5 * gaps[0]))
        return np.stack(found, axis=-1)

    def _point(self, i: int) -> str:
        return point_text(self.variables, self.x[i])


def _user_slopes(
    gradient: Callable[..., ArrayLike], x: Array, theta: Array, expected: Array
) -> Callable[[Array, Array], Any]:
    """The user's derivatives as (n, k, p).

    Raises:
        ArgumentError: They are not those of the function, as differences show.
    """
    n, k, p = expected.shape
    ways: list[Callable[[Any, Array], Any]] = [lambda points, t: gradient(points, t)]
    if x.shape[1] == 1:
        ways.insert(0, lambda points, t: gradient(points[:, 0], t))
    allowed = 10 * AGREES * np.maximum(np.abs(expected).max(axis=(0, 1)), 1e-300)
    for way in ways:
        try:
            found = np.asarray(way(x, theta), dtype=float)
        except Exception:  # a user's function may raise anything
            continue
        if found.shape not in ((n, p), (n, k, p)) or found.size != expected.size:
            continue
        if (np.abs(found.reshape(n, k, p) - expected) <= allowed).all():
            return partial(_each_response, way, found.ndim == 2)
    message = f"it is not the derivative of f, as differences show; expected shape (n, {p})"
    raise ArgumentError(message, argument="gradient")


def _each_response(
    way: Callable[[Any, Array], Any], is_single: bool, points: Any, theta: Array
) -> Any:
    """A user's derivatives (n, k, p), which may come as (n, p)."""
    found = way(points, theta)
    return np.asarray(found)[:, None, :] if is_single else found


def variable_names(given: str | Sequence[str] | None, n: int) -> tuple[str, ...]:
    """Names (n,) of variables: x for one, x1 .. xn for several, unless others are given.

    Raises:
        ArgumentError: Their number is not n, or two are the same.
    """
    if given is None:
        return ("x",) if n == 1 else tuple(f"x{i + 1}" for i in range(n))
    names = as_names(given) or ()
    if len(names) != n or len(set(names)) != n:
        message = f"{', '.join(names) or 'no names'}; expected {n} different names"
        raise ArgumentError(message, argument="variables")
    return names


def as_names(given: str | Sequence[str] | None) -> tuple[str, ...] | None:
    """Names as a tuple; one may stand alone, and None stays None."""
    if given is None:
        return None
    return (given,) if isinstance(given, str) else tuple(given)


def point_text(variables: Sequence[str], x: Array) -> str:
    """A point (d,) in words, for messages."""
    return ", ".join(f"{name} = {value:.6g}" for name, value in zip(variables, x, strict=True))


@dataclass(frozen=True, eq=False)
class UserFunction:
    """A function of points (n, d), with one value or array of values for each.

    Args:
        function: The function.
        name: The argument by which it came, for messages.
    """

    function: Callable[[Array], ArrayLike]
    name: str

    def __call__(self, x: Array, shape: tuple[int, ...] | None = None) -> Array:
        """Values (n, ...) at points (n, d), which may be not finite.

        Args:
            x: The points.
            shape: Shape of the values of one point; None for any.

        Raises:
            ArgumentError: The function fails, or its values have another shape.
        """
        try:
            with np.errstate(all="ignore"):  # what is not finite is judged by the caller
                values = np.asarray(self.function(x.copy()))
                if np.iscomplexobj(values):
                    raise TypeError("values are complex; expected real ones")
                # What runs on polynomials has them as its values, see `expand`.
                values = values.astype(x.dtype)
        except ArgumentError:  # of a model, which says where
            raise
        except Exception as error:  # a user's function may raise anything
            why = str(error) or type(error).__name__
            message = f"fails for points of shape {x.shape}, each a row: {why}"
            raise ArgumentError(message, argument=self.name) from error
        if values.shape[:1] != (len(x),) or (shape is not None and values.shape[1:] != shape):
            expected = "one entry a point" if shape is None else f"{(len(x), *shape)}"
            raise self.wrong_shape(values, f"{expected} for {len(x)} points")
        return values

    def for_many(self, limits: Array) -> "UserFunction":
        """The same function of many points in a box (2, d), of one that may take a single point.

        Such a one fails for many points together, or has no value for each. A function that fails
        both ways stays as it is, and says so when it is called.
        """
        x = trial_points(limits)
        by_number = replace(self, function=lambda x: _stacked(self.function, x[:, 0]))
        by_point = replace(self, function=lambda x: _stacked(self.function, x))
        for one in (self, by_number, by_point) if limits.shape[1] == 1 else (self, by_point):
            try:
                if one(x).shape[1:] == one(x[:1]).shape[1:]:
                    return one
            except ArgumentError:
                continue
        return self

    def wrong_shape(self, values: Array, expected: str) -> ArgumentError:
        """The error of values of a wrong shape."""
        message = f"values have the shape {values.shape}; expected {expected}"
        return ArgumentError(message, argument=self.name)


@dataclass(frozen=True, eq=False)
class UserEnclosure:
    """Bounds of a model's rows over boxes, as a user's function gives them.

    Args:
        function: Maps lower and upper ends (b, d) of boxes to two arrays (b, ...).
        shape: Shape of the rows of one point.
    """

    function: Callable[[Array, Array], tuple[ArrayLike, ArrayLike]]
    shape: tuple[int, ...]

    def __call__(self, low: Array, high: Array) -> Array:
        """Least and largest rows (2, b, ...) over boxes (b, d).

        Raises:
            ArgumentError: The function fails, or its values are none.
        """
        try:
            least, most = self.function(low.copy(), high.copy())
            ends = np.stack([np.asarray(least, dtype=float), np.asarray(most, dtype=float)])
        except Exception as error:  # likewise
            why = str(error) or type(error).__name__
            message = f"fails for boxes of shape {low.shape}: {why}"
            raise ArgumentError(message, argument="enclosure") from error
        expected = (2, len(low), *self.shape)
        if ends.shape != expected:
            message = f"values have the shape {ends.shape}; expected two of {expected[1:]}"
            raise ArgumentError(message, argument="enclosure")
        if not (ends[0] <= ends[1]).all():  # also where one is not a number
            message = "a least value is above the largest one, or not a number"
            raise ArgumentError(message, argument="enclosure")
        return ends


def _stacked(function: Callable[[Any], ArrayLike], x: Array) -> Array:
    """Values (n, ...) of a function of one point, at points x (n, d), or at numbers x (n,)."""
    return np.stack([np.asarray(function(point), dtype=x.dtype) for point in x])


def trial_points(limits: Array) -> Array:
    """Points (n, d) at which a model is tried before any work."""
    low, high = limits
    return np.array([low + part * (high - low) for part in TRIED])


def user_functions(given: object, name: str, limits: Array) -> tuple[UserFunction, ...]:
    """One function of points in a box (2, d), or a list of them.

    Raises:
        ArgumentError: It is neither.
    """
    each = [given] if callable(given) or not isinstance(given, Iterable) else list(given)
    functions = [function for function in each if callable(function)]
    if len(functions) < len(each):
        raise ArgumentError("expected a function of points, or a list of them", argument=name)
    return tuple(UserFunction(function, name).for_many(limits) for function in functions)


# Distance of the nodes in parts of a variable's range. A second-order difference errs by its square
# (truncation) and by eps over it (rounding): about 4e-11 each, of the change over a whole range of
# a function that is as smooth as a wave of that range.
STEP = float(np.finfo(float).eps ** (1 / 3))


def inside_differences(function: Callable[[Array], Array], x: Array, limits: Array) -> Array:
    """Differentiate by each variable: the slope at x of a parabola through three nodes.

    The nodes c - h, c, c + h lie in the box, with c as close to x as that allows. With
    ``u = (x - c)/h`` the slope is ``((2u - 1) f_- - 4u f_0 + (2u + 1) f_+)/(2h)``: the central
    difference where x is away from the bounds, the one-sided one of second order on a bound.

    Args:
        function: Maps points (m, d) of the box to values (m, ...).
        x: Points (n, d) of the box.
        limits: Bounds (2, d).

    Returns:
        Derivatives (n, ..., d). Ten digits of them are good, see `STEP`.
    """
    n, d = x.shape
    low, high = limits
    h = STEP * (high - low)
    centre = np.clip(x, low + h, high - h)
    nodes = np.broadcast_to(x, (3, d, n, d)).copy()
    each = np.arange(d)
    for place in range(3):
        # Rounding may carry a node over the bound by a last digit.
        moved = np.clip(centre + (place - 1) * h, low, high)
        nodes[place, each, :, each] = moved.T
    values = function(nodes.reshape(-1, d))
    values = values.reshape(3, d, n, *values.shape[1:])
    u = ((x - centre) / h).T.reshape(d, n, *[1] * (values.ndim - 3))
    width = 2 * h.reshape(d, *[1] * (values.ndim - 2))
    slopes = ((2 * u - 1) * values[0] - 4 * u * values[1] + (2 * u + 1) * values[2]) / width
    return np.asarray(np.moveaxis(slopes, 0, -1))
