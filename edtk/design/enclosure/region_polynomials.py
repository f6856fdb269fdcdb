"""The sensitivity over a region as a polynomial, whose largest value proves a bound."""

from dataclasses import dataclass, replace

import numpy as np

from criteria import Criterion
from edtk.design.enclosure.cover import Covering, cover
from edtk.design.enclosure.objective import Enclosed, Objective
from edtk.design.enclosure.polynomial import ROUNDOFF, Axis, Polynomial
from edtk.design.expansion import Expansion
from edtk.design.region import FEASIBLE, Region
from edtk.design.relaxation.proof import is_normalised, trace_matrix
from edtk.system.typing import Array, Indices

ROOM = 4.0
SHARP = 1e-9  # relative excess of the largest value of a slack, which costs some hundred boxes


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
