"""Boxes that cover a domain, and coefficients of polynomials on them."""

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np

from edtk.design.enclosure import basis
from edtk.design.enclosure.polynomial import ROUNDOFF, Axis, Polynomial
from edtk.system.typing import Array, Indices, Mask

TENSORS_AT_ONCE = 128  # boxes at a time: their tensors stay in the cache
LARGE_TENSOR = 32_000  # numbers of a tensor of which as many do
DEEPEST = 52  # halvings along an axis, which leave a box of the size of rounding
WIDER = 2.0**-40  # part by which first boxes overlap, far above the rounding of their middles


class Reason(IntEnum):
    """Why a box is closed."""

    OPEN = 0
    BELOW = 1
    INFEASIBLE = 2
    PENALISED = 3


@dataclass(frozen=True, eq=False)
class Boxes:
    """Dyadic boxes: along each axis one of ``2^depth`` parts of an interval of a grid.

    Attributes:
        depth: How often each was halved along each axis (b, d).
        place: Number of the part (b, d), counted through all intervals of the grid.
    """

    depth: Indices
    place: Indices

    def __len__(self) -> int:
        return len(self.depth)

    def __getitem__(self, which: Indices | Mask | slice) -> "Boxes":
        return Boxes(self.depth[which], self.place[which])

    @classmethod
    def joined(cls, parts: "list[Boxes]") -> "Boxes":
        """All of them."""
        return cls(
            np.concatenate([part.depth for part in parts]),
            np.concatenate([part.place for part in parts]),
        )

    def half(self, axis: int, side: int) -> "Boxes":
        """The lower (0) or upper (1) halves along an axis."""
        depth = self.depth.copy()
        place = self.place.copy()
        depth[:, axis] += 1
        place[:, axis] = 2 * place[:, axis] + side
        return Boxes(depth, place)


@dataclass(frozen=True, eq=False)
class Grid:
    """The first boxes: intervals of equal width along each axis, narrow enough for the basis."""

    axes: tuple[Axis, ...]

    @cached_property
    def parts(self) -> Indices:
        """Number of intervals along each axis (d,)."""
        return np.array(
            [
                max(1, int(np.ceil((axis.high - axis.low) / basis.WIDEST - WIDER)))
                if axis.kind == "angle"
                else 1
                for axis in self.axes
            ]
        )

    @cached_property
    def limits(self) -> Array:
        """Lower and upper ends (2, d) of the whole box."""
        return np.array([[axis.low for axis in self.axes], [axis.high for axis in self.axes]])

    @cached_property
    def widest(self) -> Array:
        """Half widths (d,) of the intervals, which overlap a little."""
        low, high = self.limits
        return np.asarray((high - low) / (2 * self.parts) * (1 + WIDER))

    def first(self) -> Boxes:
        """All boxes of the grid."""
        places = np.indices(tuple(self.parts)).reshape(len(self.axes), -1).T
        return Boxes(np.zeros_like(places), places)

    def halves(self, boxes: Boxes) -> Array:
        """Half widths (b, d)."""
        return np.asarray(np.ldexp(self.widest, -boxes.depth))

    def middles(self, boxes: Boxes) -> Array:
        """Middles (b, d)."""
        interval = boxes.place >> boxes.depth
        inside = boxes.place - (interval << boxes.depth)
        low, high = self.limits
        centre = low + (high - low) * (2 * interval + 1) / (2 * self.parts)
        return np.asarray(centre + self.widest * (np.ldexp(2.0 * inside + 1, -boxes.depth) - 1))


@dataclass(frozen=True, eq=False)
class Leaves:
    """Boxes that cover the domain, and what is known of each.

    Attributes:
        boxes: The boxes (b).
        reason: Why each is closed (b,), see `Reason`.
        bound: No feasible place of it has an objective above (b,).
        penalties: The factors mu of the slacks (b, c) that prove it.
    """

    boxes: Boxes
    reason: Indices
    bound: Array
    penalties: Array

    def __len__(self) -> int:
        return len(self.boxes)

    def __getitem__(self, which: Indices | Mask | slice) -> "Leaves":
        return Leaves(
            self.boxes[which], self.reason[which], self.bound[which], self.penalties[which]
        )

    @classmethod
    def unknown(cls, boxes: Boxes, bound: Array, slacks: int) -> "Leaves":
        """Open boxes."""
        b = len(boxes)
        return cls(boxes, np.zeros(b, dtype=int), bound, np.zeros((b, slacks)))

    @classmethod
    def joined(cls, parts: "list[Leaves]") -> "Leaves":
        """All of them."""
        return cls(
            Boxes.joined([part.boxes for part in parts]),
            np.concatenate([part.reason for part in parts]),
            np.concatenate([part.bound for part in parts]),
            np.concatenate([part.penalties for part in parts]),
        )


def coefficients(polynomial: Polynomial, middles: Array, halves: Array) -> tuple[Array, float]:
    """Coefficients (b, ...) of a polynomial on boxes, and by how much they may be off.

    With matrices F of the axes and sizes f of the sums of terms of their entries, a coefficient is
    a sum of sizes of at most ``prod f |c|_1``, to which all roundings are relative.
    """
    found = polynomial.coefficients[None]
    size = polynomial.size
    units = 0.0
    for j, (axis, n) in enumerate(zip(polynomial.axes, polynomial.degrees, strict=True)):
        F = basis.from_functions(axis, n, middles[:, j], halves[:, j])
        found = along(F, found, j)
        size *= basis.largest_entry(axis, n, float(halves[:, j].max()))
        units += basis.rounding_of_entry(axis, n)
    return found, size * units * (1 + units) + polynomial.error


def limits_on(polynomial: Polynomial, grid: Grid) -> tuple[float, float]:
    """A lower and an upper bound of a polynomial over all boxes of a grid."""
    boxes = grid.first()
    step = at_once(polynomial)
    least, most = np.inf, -np.inf
    for i in range(0, len(boxes), step):
        part = boxes[i : i + step]
        found, error = coefficients(polynomial, grid.middles(part), grid.halves(part))
        least = min(least, float(found.min()) - error)
        most = max(most, float(found.max()) + error)
    return least, most


def at_once(polynomial: Polynomial) -> int:
    """Boxes to treat together: `TENSORS_AT_ONCE`, and fewer of tensors that fill the cache."""
    return max(1, TENSORS_AT_ONCE * LARGE_TENSOR // max(LARGE_TENSOR, polynomial.coefficients.size))


def rounding_of_halves(polynomial: Polynomial, unit: float = ROUNDOFF) -> float:
    """Rounding of one halving along any axis, relative to the largest coefficient."""
    return basis.rounding_of_half(max(polynomial.coefficients.shape), unit)


def rounding_of_slack(slack: Polynomial) -> float:
    """Rounding of coefficients after all halvings, by which a slack may miss being feasible."""
    halvings = DEEPEST * len(slack.axes)
    size = slack.size
    for axis, n in zip(slack.axes, slack.degrees, strict=True):
        size *= basis.largest_entry(axis, n, basis.WIDEST / 2)
    return halvings * rounding_of_halves(slack) * size


def along(matrices: Array, values: Array, axis: int) -> Array:
    """A matrix for each box (b, k, n), or one for all, times coefficients (b, ..., n, ...)."""
    shape = values.shape
    before = int(np.prod(shape[1 : axis + 1]))
    if axis == len(shape) - 2:
        flat = values.reshape(shape[0], before, shape[-1])
        found: Array = flat @ np.swapaxes(matrices, -1, -2)
    else:
        deep = values.reshape(shape[0], before, shape[axis + 1], -1)
        found = matrices[..., None, :, :] @ deep
    return found.reshape(len(found), *shape[1 : axis + 1], matrices.shape[-2], *shape[axis + 2 :])
