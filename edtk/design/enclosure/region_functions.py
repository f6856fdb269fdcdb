"""What is bounded over boxes of a region: its functions as polynomials, or by intervals."""

from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from criteria import Criterion
from edtk.design.enclosure.cover import Covering, cover
from edtk.design.enclosure.intervals import Range, run_on_boxes
from edtk.design.enclosure.objective import Enclosed, Objective
from edtk.design.enclosure.polynomial import ROUNDOFF, Axis, Polynomial
from edtk.design.expansion import Expansion
from edtk.design.region import FEASIBLE, Region
from edtk.design.relaxation.proof import is_normalised, trace_matrix
from edtk.design.user_model import UserFunction
from edtk.system.errors import ArgumentError
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices

ROOM = 4.0
SHARP = 1e-9  # relative excess of the largest value of a slack, which costs some hundred boxes
BOXES_AT_ONCE = 1024  # boxes at a time
MOST_BOXES = 2_000_000  # boxes of a covering; what is open then counts with its bound
# Relative: by so much more a value may be outside its enclosure, which is rounding.
OUTSIDE_BY = 1e-9
TRIED_BOXES = 64  # boxes in which a point is tried


@dataclass(frozen=True, eq=False)
class RegionPolynomials:
    """Rows and slacks of a region as polynomials: ``a_ri(x) = sum_k c_rik u^k``.

    Args:
        region: The region.
        axes: The variables u, from -1 to 1.
        rows: Coefficients (rows, p, n) of all products of powers u^k.
        errors: What the rows (rows, p) differ from these by, at most, anywhere in the box.
        sizes: Numbers (d,) of powers of each variable; n is their product.
        slacks: The slacks, raised by what a point may violate them by and count as feasible.
        products: ``c (C - c)`` of each slack c of degree two or more, where C is a bound of it. It
            is not negative either, and says more: over a disc of radius one ``C - c`` is r^2.
    """

    region: Region
    axes: tuple[Axis, ...]
    rows: Array
    errors: Array
    sizes: tuple[int, ...]
    slacks: tuple[Polynomial, ...]
    products: tuple[Polynomial, ...]

    @classmethod
    def of(cls, region: Region) -> "RegionPolynomials":
        """Those of a region.

        Raises:
            ArgumentError: Its functions are no polynomials, or not known to be.
        """
        # The coefficients are about the exact middle and half width of the box: in u nothing of
        # its place is rounded, however far from the origin it lies.
        axes = (Axis("length", -1.0, 1.0),) * region.size
        found = region.polynomial_rows()
        sizes = tuple(n + 1 for n in found.degrees)
        rows = found.coefficients.reshape(*found.errors.shape, -1)
        slacks = [
            slack + FEASIBLE
            for each in region.polynomial_slacks()
            for slack in _polynomials(each, axes)
        ]
        return cls(
            region,
            axes,
            rows,
            found.errors + rounding(rows),
            sizes,
            tuple(slacks),
            tuple(_product_with_rest(slack) for slack in slacks if max(slack.degrees) > 1),
        )

    def enclosed(self, Z: Array, criterion: Criterion) -> Enclosed:
        """The maximum of the sensitivity ``<Z, M(x)>``, per trace of M(x) for a degree of zero.

        Args:
            Z: A multiplier (p, p).
            criterion: What it belongs to.
        """
        below = None
        if is_normalised(criterion):
            below = self.quadratic(trace_matrix(criterion, self.region.p))
        above = self.quadratic(Z)
        low, high = self.region.limits
        # Those of higher degrees than the sensitivity would make every box dearer.
        fit = (c for c in self.products if np.less_equal(c.degrees, above.degrees).all())
        return Enclosed(
            self.axes,
            (Objective(above, below),),
            (*self.slacks, *fit),
            ((low + high) / 2)[None],
            np.diag((high - low) / 2),
        )

    def cover(
        self, Z: Array, criterion: Criterion, tolerance: float, known: Array, largest: float
    ) -> Covering:
        """Bound the sensitivity to a multiplier over all feasible points.

        Args:
            Z: A multiplier (p, p).
            criterion: What it belongs to.
            tolerance: Relative excess of the bound over the largest value that is known, at most.
            known: Points (k, d) where large values are known.
            largest: The largest of these.

        Raises:
            CoveringInterrupted: Ctrl-C; the exception has the covering so far.
        """
        enclosed = self.enclosed(Z, criterion)
        # No level can be reached that is below the error of the polynomial itself.
        blurred = ROOM * enclosed.objectives[0].numerator.error / (abs(largest) or 1.0)
        u = (known - enclosed.base) / np.diag(enclosed.matrix)
        found = cover(enclosed, max(tolerance, blurred), np.clip(u, -1.0, 1.0))
        x = np.clip(enclosed.experiments(found.place[None])[0], *self.region.limits)
        return replace(found, place=x)

    def quadratic(self, Z: Array) -> Polynomial:
        """``<Z, M0 + A(x)'A(x)>`` with a bound on its error.

        The coefficient of ``u^m`` is the sum of ``Z_ab c_rak c_rbl`` over all ``k + l = m``: a sum
        in which no path has more than ``2p + rows + n + 3`` roundings, so that it is wrong by
        ``gamma`` of that number times the sum of sizes (Higham, Accuracy and Stability of Numerical
        Algorithms, 2002, section 3.1), and the polynomial by their sum. Rows that are wrong by e
        add ``sum |Z_ab| (|a_ra| e_rb + e_ra |a_rb| + e_ra e_rb)``, with ``|a_ra| <= sum |c_rak|``.

        Args:
            Z: A symmetric matrix (p, p).
        """
        R, p, n = self.rows.shape
        together = np.einsum("rak,ab,rbl->kl", self.rows, Z, self.rows, optimize=True)
        total = np.zeros(int(np.prod(np.multiply(2, self.sizes) - 1)))
        np.add.at(total, self._sums(), together)
        size = np.abs(self.rows).sum(axis=2)
        most = size + self.errors
        rounded = gamma(2 * p + R + n + 3) * _product(size, np.abs(Z), size)
        error = _product(most, np.abs(Z), most) - _product(size, np.abs(Z), size)
        shape = np.multiply(2, self.sizes) - 1
        error = (error + rounded) * (1 + gamma(4 * p * p * R + 8))
        found = Polynomial(self.axes, total.reshape(shape), max(error, 0.0))
        prior = self.region.prior
        if prior is None:
            return found
        constant = float((Z * prior).sum())
        of_prior = gamma(p * p + 1) * float(np.abs(Z * prior).sum())
        return found + Polynomial(self.axes, np.full((1,) * len(self.axes), constant), of_prior)

    def _sums(self) -> Indices:
        """Where products (n, n) of two powers lie in a tensor of all sums of their exponents."""
        each = np.indices(self.sizes).reshape(len(self.sizes), -1)
        sums = each[:, :, None] + each[:, None]
        return np.ravel_multi_index(tuple(sums), tuple(np.multiply(2, self.sizes) - 1))


def _product_with_rest(slack: Polynomial) -> Polynomial:
    """``c (C - c)`` of a slack c, with its largest value C over the box, rounded up.

    Where a sensitivity is the same along a curved wall, as a circle's by symmetry, it is a constant
    less a multiple of this; factors of c alone leave a term of second order.
    """
    d = len(slack.axes)
    alone = Enclosed(slack.axes, (Objective(slack),), (), np.zeros((1, d)), np.eye(d))
    return slack * (cover(alone, SHARP).upper - slack)


def gamma(steps: int) -> float:
    """Relative error of so many roundings, at most."""
    return steps * ROUNDOFF / (1 - steps * ROUNDOFF)


def rounding(coefficients: Array) -> Array:
    """What polynomials (..., n) change by, at most, where each coefficient was rounded once."""
    size = np.abs(coefficients).sum(axis=-1)
    return np.asarray(size * gamma(2))


def _product(left: Array, Z: Array, right: Array) -> float:
    """``sum_r left_r' Z right_r`` of numbers that are not negative."""
    return float(np.einsum("ra,ab,rb->", left, Z, right))


def _polynomials(found: Expansion, axes: tuple[Axis, ...]) -> list[Polynomial]:
    """The entries (k,) of an expansion, each with its error."""
    c = found.coefficients
    errors = found.errors + rounding(c.reshape(len(c), -1))
    return [Polynomial(axes, own, error) for own, error in zip(c, errors.tolist(), strict=True)]


@dataclass(frozen=True, eq=False)
class Spans:
    """Boxes that cover a region, each with a bound of the sensitivity.

    Attributes:
        upper: No point of the region has a larger sensitivity.
        lower: The largest one that is known, of a feasible point.
        place: That point (d,).
        boxes: Number of boxes that were looked at.
        seconds: Time that it took [s].
        low: Lower ends (b, d) of the boxes; those without a feasible point are left out.
        high: Upper ends (b, d).
        bound: No feasible point of a box has a larger sensitivity (b,).
    """

    upper: float
    lower: float
    place: Array
    boxes: int
    seconds: float
    low: Array
    high: Array
    bound: Array


@dataclass(frozen=True, eq=False)
class RegionIntervals:
    """Rows and slacks of a region over boxes: ends, and ends of derivatives where they are known.

    ``d(x) = <Z, M0 + A(x)'A(x)>`` is at most the upper end of its interval, and by the mean value
    theorem at most ``d(c) + sum_j h_j max |d'_j|`` around the middle c of a box of half widths h,
    with ``d'_j = 2 <A Z, dA/dx_j>``. The latter is off by the square of the box.
    """

    region: Region

    @classmethod
    def of(cls, region: Region) -> "RegionIntervals":
        """Those of a region, tried at a few boxes.

        Raises:
            ArgumentError: Its functions do not run on intervals, or a value is outside its
                enclosure.
        """
        found = cls(region)
        low, high = region.limits
        rng = np.random.default_rng(0)
        ends = np.sort(low + (high - low) * rng.random((2, TRIED_BOXES, len(low))), axis=0)
        x = ends[0] + (ends[1] - ends[0]) * rng.random((TRIED_BOXES, len(low)))
        name = "rows" if region.enclosure is None else "enclosure"
        _require_inside(region, found.rows(ends[0], ends[1])[0], region.rows_at(x), x, name)
        slack = found.slacks(ends[0], ends[1])
        _require_inside(region, slack, region.slack_at(x), x, "constraints")
        return found

    def rows(self, low: Array, high: Array) -> tuple[Range, Range | None]:
        """Whitened rows (rows, p, b) over boxes (b, d), and their derivatives (d, rows, p, b).

        Raises:
            ArgumentError: The function of rows does not run on intervals.
        """
        region = self.region
        if region.enclosure is None:
            value, slope = _run(region.functions[0], low, high)
            return self._judged(value, 0), self._judged(slope, 1)
        given = np.moveaxis(region.enclosure(low, high), 1, -1)
        return self._judged(Range(given[0], given[1]), 0), None

    def _judged(self, rows: Range, before: int) -> Range:
        """Rows as they are given, (rows, p, b) or (p, b) after some axes, whitened and judged."""
        sigma, T = self.region.judged_by
        shape = (*rows.low.shape[:before], len(sigma), -1, rows.low.shape[-1])
        rows = Range(rows.low.reshape(shape), rows.high.reshape(shape))
        rows = rows * Range.of(sigma[:, None, None]).inverse()
        return rows if T is None else rows.times(T.T, before + 1)

    def slacks(self, low: Array, high: Array) -> Range:
        """Slacks (c, b) over boxes (b, d).

        Raises:
            ArgumentError: A function of constraints does not run on intervals.
        """
        every = [_run(function, low, high)[0] for function in self.region.functions[1:]]
        flat = [Range(c.low.reshape(-1, len(low)), c.high.reshape(-1, len(low))) for c in every]
        none = np.zeros((0, len(low)))
        return Range(
            np.concatenate([none, *(c.low for c in flat)]),
            np.concatenate([none, *(c.high for c in flat)]),
        )

    def sensitivity(
        self, Z: Array, per: Array | None, low: Array, high: Array
    ) -> tuple[Range, Range | None]:
        """The sensitivity (b,) over boxes (b, d) and its derivatives (d, b), see `cover`."""
        value, slope = self._quadratic(Z, low, high)
        if per is None:
            return value, slope
        below, below_slope = self._quadratic(per, low, high)
        ratio = value * below.inverse()
        if slope is None or below_slope is None:
            return ratio, None
        return ratio, (slope + -(ratio * below_slope)) * below.inverse()

    def _quadratic(self, Z: Array, low: Array, high: Array) -> tuple[Range, Range | None]:
        """``<Z, M0 + A'A>`` (b,) and its derivatives (d, b)."""
        A, slope = self.rows(low, high)
        AZ = A.times(Z, 1)
        value = (A * AZ).total((0, 1))
        if self.region.prior is not None:
            product = Range.of(Z) * Range.of(self.region.prior)
            value = value + product.total((0, 1))
        if slope is None:
            return value, None
        return value, (slope * AZ).total((1, 2)) * Range.of(2.0)

    def cover(
        self, Z: Array, criterion: Criterion, tolerance: float, known: Array, largest: float
    ) -> Spans:
        """Bound the sensitivity to a multiplier over all feasible points, by halving boxes.

        Args:
            Z: A multiplier (p, p).
            criterion: What it belongs to; of degree zero the sensitivity is per trace.
            tolerance: Relative excess of the bound over the largest value that is known, at most.
            known: Points (k, d) where large values are known.
            largest: The largest of these.
        """
        per = trace_matrix(criterion, self.region.p) if is_normalised(criterion) else None
        return _Boxes(self, Z, per, tolerance, known, largest).covered()


class _Boxes:
    """A covering as it grows.

    Args:
        of: What encloses sensitivity and slacks.
        Z: The multiplier (p, p).
        per: By what trace the sensitivity is divided, or None.
        tolerance: Relative excess at which a box is closed.
        known: Points (k, d) where large values are known.
        largest: The largest of these.
    """

    def __init__(
        self,
        of: RegionIntervals,
        Z: Array,
        per: Array | None,
        tolerance: float,
        known: Array,
        largest: float,
    ) -> None:
        self.of = of
        self.Z = Z
        self.per = per
        self.tolerance = tolerance
        self.lower = largest
        self.place = known[0]
        self.looked = 0
        self.closed: list[tuple[Array, Array, Array]] = []

    def covered(self) -> Spans:
        """Halve boxes until all are closed, the time is over, or they are too many."""
        since = perf_counter()
        limits = self.of.region.limits
        pending = [(limits[:1], limits[1:], np.array([np.inf]))]
        while pending and self.looked < MOST_BOXES and not (self.looked and out_of_time()):
            low, high, bound = pending.pop()
            if len(low) > BOXES_AT_ONCE:
                pending.append((low[BOXES_AT_ONCE:], high[BOXES_AT_ONCE:], bound[BOXES_AT_ONCE:]))
            pending.append(
                self._halved(low[:BOXES_AT_ONCE], high[:BOXES_AT_ONCE], bound[:BOXES_AT_ONCE])
            )
            if not len(pending[-1][0]):
                pending.pop()
        parts = zip(*self.closed, *pending, strict=True)
        low, high, bound = (np.concatenate(part) for part in parts)
        return Spans(
            float(bound.max()),
            self.lower,
            self.place,
            self.looked,
            perf_counter() - since,
            low,
            high,
            bound,
        )

    def _halved(self, low: Array, high: Array, bound: Array) -> tuple[Array, Array, Array]:
        """Halves of boxes (b, d) that stay open, with what is known of them."""
        self.looked += len(low)
        feasible = (self.of.slacks(low, high).high >= -FEASIBLE).all(axis=0)
        low, high, bound = low[feasible], high[feasible], bound[feasible]
        if not len(low):
            return low, high, bound
        found, spread = self._bounds(low, high)
        bound = np.minimum(bound, found)
        done = bound <= self.lower + self.tolerance * abs(self.lower)
        width = spread / 2
        middle = (low + high) / 2
        # Boxes of the size of rounding cannot be halved.
        done |= ((middle <= low) | (middle >= high)).any(axis=1)
        self.closed.append((low[done], high[done], bound[done]))
        low, high, bound, middle, width = (
            part[~done] for part in (low, high, bound, middle, width)
        )
        rows = np.arange(len(low))
        axis = width.argmax(axis=1)
        first, second = high.copy(), low.copy()
        first[rows, axis] = second[rows, axis] = middle[rows, axis]
        return (
            np.concatenate([low, second]),
            np.concatenate([first, high]),
            np.concatenate([bound, bound]),
        )

    def _bounds(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Bounds (b,) over boxes (b, d), and how much each variable (b, d) adds to them."""
        value, slope = self.of.sensitivity(self.Z, self.per, low, high)
        limits = self.of.region.limits
        middle = (low + high) / 2
        centre, _ = self.of.sensitivity(self.Z, self.per, middle, middle)
        self._see(middle, centre.low)
        if slope is None:
            return value.high, (high - low) / (limits[1] - limits[0])
        steep = abs(slope).high.T
        half = np.nextafter(np.maximum(high - middle, middle - low), np.inf)
        adds = Range.of(steep) * Range.of(half)
        by_mean = (centre + adds.total((1,))).high
        spread = np.where(np.isfinite(adds.high), adds.high, (high - low) / (limits[1] - limits[0]))
        return np.minimum(value.high, by_mean), spread

    def _see(self, x: Array, values: Array) -> None:
        """Remember the feasible point of x (b, d) whose value (b,) is above the largest known."""
        best = int(np.where(self.of.region.at(x).feasible, values, -np.inf).argmax())
        if values[best] > self.lower and self.of.region.at(x[best]).feasible:
            self.lower = float(values[best])
            self.place = x[best]


def _run(function: UserFunction, low: Array, high: Array) -> tuple[Range, Range]:
    """Values and derivatives of a user's function over boxes.

    Raises:
        ArgumentError: It does not run on intervals.
    """
    try:
        return run_on_boxes(function, low, high)
    except Exception as error:  # whatever a function raises that expects an array of floats
        reason = " ".join(str(error).split()).removeprefix(f"{function.name}: ")
        message = (
            f"it runs neither on polynomials nor on intervals ({reason}); expected degree= of "
            "polynomials, or enclosure="
        )
        raise ArgumentError(message, argument=function.name) from error


def _require_inside(region: Region, ends: Range, values: Array, x: Array, name: str) -> None:
    """Check values (n, ...) at points x (n, d) against enclosures (..., n) of boxes around them.

    Raises:
        ArgumentError: A value is outside; its point is named.
    """
    values = np.moveaxis(values, 0, -1)
    room = OUTSIDE_BY * np.maximum(np.abs(values), np.abs(values).max(initial=0.0) * OUTSIDE_BY)
    outside = (values < ends.low - room) | (values > ends.high + room)
    wrong = np.flatnonzero(outside.reshape(-1, len(x)).any(axis=0))
    if len(wrong):
        where = region.point_text(x[wrong[0]])
        raise ArgumentError(f"a value is outside its enclosure at {where}", argument=name)
