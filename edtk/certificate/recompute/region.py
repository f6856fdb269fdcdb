"""Boxes that cover a region of points, each closed again by polynomials in Bernstein's basis."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.arrays import Candidates
from edtk.certificate.recompute.candidates import require
from edtk.certificate.recompute.covering import BOUNDED, COMBINED, basis_on, leaves_of
from edtk.certificate.recompute.plain_data import number, numbers, rows, table, whole
from edtk.certificate.recompute.tasks import EPS
from edtk.system.typing import Array

KEYS = ("low", "high", "sizes", "rows", "errors", "slacks", "multiplier", "limit", "tree")
MOST_VARIABLES = 8
MOST_COEFFICIENTS = 4096  # coefficients of a row
MOST_SLACKS = 100
MOST_POWERS = 101  # of one variable: the prover's polynomials have degrees up to 100
OF_VARIABLE = 200.0  # roundings beside those that grow with the powers of a variable, from above
AT_ONCE = 1 << 20  # coefficients
PER_COEFFICIENT = 0.05  # time to check one of a box, along one variable [us]
PER_CUBE_OF_BASIS = 3e-4  # of a matrix to Bernstein's basis, by the cube of its order [us]
ALIKE = 1e-9  # relative difference of a candidate's row from the polynomial, that is rounding


@dataclass(frozen=True, eq=False)
class Region:
    """A region, its rows and slacks as polynomials in ``u = (x - middle)/half``, and a multiplier.

    Attributes:
        limits: Bounds (2, d).
        rows: Coefficients (r, p, *sizes) of whitened rows.
        errors: What rows (r, p) may be off by.
        slacks: Coefficients of each slack, and by how much it may be below.
        Z: The multiplier (p, p).
        limit: No point is stated to have a larger sensitivity.
        tree: The halvings, see `recompute.covering`.
        factors: Factors (L, c) of the slacks of combined leaves.
    """

    limits: Array
    rows: Array
    errors: Array
    slacks: list[tuple[Array, float]]
    Z: Array
    limit: float
    tree: Any
    factors: list[Any]

    @classmethod
    def from_dict(cls, content: Any, r: int, p: int) -> "Region":
        """Read a region of so many rows and parameters.

        Raises:
            ValueError: It is none; one line says where.
        """
        table(content, (*KEYS, "factors", "points"), "region", ("dual_weights",))
        low = numbers(rows(content["low"], MOST_VARIABLES, "region.low"), (None,), "region.low")
        high = numbers(content["high"], low.shape, "region.high")
        if not (low < high).all():
            raise ValueError("region: expected low below high")
        sizes = _sizes(content["sizes"], len(low), "region.sizes")
        A = numbers(content["rows"], (r, p, int(np.prod(sizes))), "region.rows")
        errors = numbers(content["errors"], (r, p), "region.errors")
        Z = numbers(content["multiplier"], (p, p), "region.multiplier")
        if not (errors >= 0).all() or not (Z == Z.T).all():
            raise ValueError("region: expected errors from zero, and a symmetric multiplier")
        limit = number(content["limit"], "region.limit")
        if limit <= 0:
            raise ValueError("region.limit: expected a number above zero")
        slacks = []
        for i, one in enumerate(rows(content["slacks"], MOST_SLACKS, "region.slacks")):
            at = f"region.slacks[{i}]"
            table(one, ("sizes", "coefficients", "error"), at)
            own = _sizes(one["sizes"], len(low), at)
            c = numbers(one["coefficients"], (int(np.prod(own)),), at)
            slacks.append((c.reshape(own), abs(number(one["error"], at))))
        return cls(
            np.stack([low, high]),
            A.reshape(r, p, *sizes),
            errors,
            slacks,
            Z,
            limit,
            content["tree"],
            rows(content["factors"], 1 << 22, "region.factors"),
        )

    def strangers(self, points: Any, candidates: Candidates) -> int:
        """How many candidates (n, r, p) have other rows than the polynomials, or are infeasible.

        Args:
            points: Where the candidates lie (n, d).
            candidates: The candidates.
        """
        x = numbers(points, (candidates.n, self.limits.shape[1]), "region.points")
        low, high = self.limits
        u = (2 * x - low - high) / (high - low)
        away = np.abs(_at(self.rows, u) - candidates.rows) - self.errors
        inside = (np.abs(u) <= 1 + ALIKE).all(axis=1)
        for c, error in self.slacks:
            inside &= _at(c, u) >= -error - ALIKE * np.abs(c).sum()
        alike = (away <= ALIKE * np.abs(candidates.rows).max(axis=0)).all(axis=(1, 2))
        return int((~(inside & alike)).sum())

    def open_leaves(self, prior: Array) -> int:
        """How many boxes are not closed by ``d - limit + sum_i mu_i c_i <= 0``.

        Args:
            prior: Prior information (p, p) of each experiment.
        """
        tested, error = self._sensitivity(prior)
        d = tested.ndim
        depth, place, reasons = leaves_of(self.tree, np.ones(d, dtype=int), "region")
        if not set(reasons) <= {BOUNDED, COMBINED}:
            raise ValueError("region.tree: expected digits of variables, and letters of .+")
        combined = np.flatnonzero(reasons == COMBINED)
        factors = np.zeros((len(depth), len(self.slacks)))
        shape = (len(combined), len(self.slacks))
        if len(combined):
            factors[combined] = numbers(self.factors, shape, "region.factors")
        if not (factors >= 0).all():
            raise ValueError("region.factors: expected numbers from zero")
        forms = [(tested, error), *self.slacks]
        top = tuple(np.max([c.shape for c, _ in forms], axis=0))
        tensor = np.stack([_padded(c, top) for c, _ in forms])
        off = np.array([wrong + _rounding(c) for c, wrong in forms])
        mu = np.concatenate([np.ones((len(depth), 1)), factors], axis=1)
        left = 0
        each = PER_COEFFICIENT * tensor[0].size * (d + 1) + PER_CUBE_OF_BASIS * sum(
            n**3 for n in top
        )
        require(each * len(depth), "the boxes of the region")
        step = max(1, AT_ONCE // max(tensor[0].size, max(top) ** 2))
        for start in range(0, len(depth), step):
            part = slice(start, start + step)
            values = np.tensordot(mu[part], tensor, 1)
            half: Array = np.ldexp(np.ones(1), -depth[part])
            middle: Array = (2.0 * place[part] + 1.0) * half - 1.0
            for j in range(d):
                B = basis_on(top[j], True, middle[:, j], half[:, j], (0.0, 1.0))
                turned = np.einsum("bkn,b...n->b...k", B, np.moveaxis(values, j + 1, -1))
                values = np.moveaxis(turned, -1, j + 1)
            highest = values.reshape(len(values), -1).max(axis=1) + mu[part] @ off
            left += int((~(highest <= 0)).sum())
        return left

    def _sensitivity(self, prior: Array) -> tuple[Array, float]:
        """Coefficients of ``<Z, M0 + A'A> - limit``, and by how much the polynomial may be off."""
        r, p = self.rows.shape[:2]
        sizes = self.rows.shape[2:]
        found = np.zeros(tuple(2 * n - 1 for n in sizes))
        for k in np.ndindex(*sizes):
            ZA = self.rows[(slice(None), slice(None), *k)] @ self.Z
            product = np.tensordot(ZA, self.rows, ((0, 1), (0, 1)))
            found[tuple(slice(i, i + n) for i, n in zip(k, sizes, strict=True))] += product
        found[(0,) * len(sizes)] += (self.Z * prior).sum() - self.limit
        size = np.abs(self.rows).reshape(r, p, -1).sum(axis=2)
        Z = np.abs(self.Z)
        most = size + self.errors
        whole_size = float(np.einsum("ra,ab,rb->", most, Z, most))
        error = whole_size - float(np.einsum("ra,ab,rb->", size, Z, size))
        steps = 4 * p + 2 * r + int(np.prod(sizes)) + p * p + 8
        constant = float((Z * np.abs(prior)).sum()) + abs(self.limit)
        return found, error + steps * EPS * (2 * whole_size + constant)


def _at(c: Array, u: Array) -> Array:
    """Values (m, ...) at points u (m, d) of polynomials with these coefficients (..., *sizes)."""
    found = np.broadcast_to(c, (len(u), *c.shape))
    for own in u.T[::-1]:
        found = np.einsum("m...k,mk->m...", found, own[:, None] ** np.arange(found.shape[-1]))
    return np.asarray(found)


def rounding_of_check(rows_size: float, coefficients: Array) -> float:
    """By how much a limit must be raised so that a check of its boxes has room to round."""
    return 4 * (_rounding(coefficients) + 400 * coefficients.size * EPS * rows_size)


def _rounding(c: Array) -> float:
    """What coefficients in Bernstein's basis may be off by, with matrices of entries up to one.

    An entry for n powers takes ``2n + 1`` roundings at most, and a sum over them n.
    """
    rounds = sum(3 * n + OF_VARIABLE for n in c.shape)
    return rounds * EPS * float(np.abs(c).sum())


def _padded(c: Array, shape: tuple[int, ...]) -> Array:
    """Coefficients with zeros for higher powers."""
    return np.pad(c, [(0, n - own) for own, n in zip(c.shape, shape, strict=True)])


def _sizes(given: Any, d: int, where: str) -> tuple[int, ...]:
    """Numbers of powers of each variable."""
    found = tuple(whole(n, 1, MOST_POWERS, where) for n in rows(given, d, where))
    if len(found) != d or np.prod(found) > MOST_COEFFICIENTS:
        raise ValueError(
            f"{where}: expected {d} numbers, and a product of at most {MOST_COEFFICIENTS}"
        )
    return found
