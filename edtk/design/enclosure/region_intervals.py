"""The sensitivity over boxes of a region by interval arithmetic: models that are no polynomials."""

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from criteria import Criterion
from edtk.design.enclosure.intervals import Range, run_on_boxes
from edtk.design.region import FEASIBLE, Region
from edtk.design.relaxation.proof import is_normalised, trace_matrix
from edtk.design.user_model import UserFunction
from edtk.system.errors import ArgumentError
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array

BOXES_AT_ONCE = 1024  # boxes at a time
MOST_BOXES = 2_000_000  # boxes of a covering; what is open then counts with its bound
# Relative: by so much more a value may be outside its enclosure, which is rounding.
OUTSIDE_BY = 1e-9
TRIED_BOXES = 64  # boxes in which a point is tried


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
