"""Values of the criteria from singular values of the stacked rows, and lower bounds on them.

The closed forms of the bounds are derived in the documentation, page "Bounds".
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from edtk.certificate.recompute.eigenpairs import eigenpairs
from edtk.certificate.recompute.plain_data import in_range, numbers, rows
from edtk.certificate.recompute.tasks import EPS, deviations
from edtk.system.typing import Array

DEGREE = {
    "A": 1.0,
    "D": 1.0,
    "E": 1.0,
    "G": 1.0,
    "O1": 0.5,
    "O2": 0.0,
    "O3": 0.5,
    "O4": 0.5,
    "O5": 0.5,
    "rho0": 0.5,
    "rho_max": 0.5,
}
OF_TARGET = ("rho0", "rho_max")
OF_COMBINATIONS = ("A", "D", "E", "G", "O1", "O3", "O5")  # monotone, and without a target
MAXIMISED = ("D", "E", "O1", "O3", "O4")
INDEFINITE = ("O2", "O4")  # criteria whose multipliers may have negative eigenvalues
MOST_MULTIPLIERS = 100  # O4 has up to 60, every other criterion one
SYMMETRIC = 1e-9  # difference across the diagonal, beside the largest entry, that is rounding
NEGATIVE = 1e-9  # size of a negative eigenvalue, at unit diagonal, that is rounding
WEIGHT_STEPS = 20  # towards the best weights of the variances for G; any weights prove a bound
NEGLIGIBLE = 1e-8  # part of a variance, beside the largest part, that gets no weight
PARALLEL = 1e-6  # sine of the angle between two lines of which one is left out
OUTSIDE = 1e-9  # by how much, beside its coordinates, rounding can move a corner


def value(name: str, stacked: Array, targets: list[Array], K: Array | None = None) -> float:
    """The criterion's value, as printed, of a design with stacked whitened rows (N, p).

    Args:
        name: One of the eleven criteria.
        stacked: Rows of ``A_i / sigma``, each times the root of its weight or of its repetitions.
        targets: Targets (r, p) of which the harm is the largest one, for rho0 and rho_max: of all
            tasks together for rho0, of each task for rho_max.
        K: Combinations (p, s) of the parameters that the criterion is about; defaults to all
            parameters.

    Raises:
        ValueError: The name is unknown, there is no target where one is needed, or the criterion
            has no meaning for combinations.
    """
    if K is not None:
        L = deviations(stacked, K)
        return _nothing_known(name) if L is None else _of_combinations(name, L)
    _, s, V = np.linalg.svd(stacked, full_matrices=False)
    if len(s) < stacked.shape[1] or s[-1] <= 0:
        return _nothing_known(name)
    if name in OF_TARGET:
        if not targets:
            raise ValueError(f"{name} needs a test pose")
        return max(float(np.linalg.norm(target @ (V.T / s))) for target in targets)
    return _of_spectrum(name, s, ((V.T / s) ** 2).sum(axis=1))


def _nothing_known(name: str) -> float:
    """The value of a design that leaves something open."""
    return 0.0 if name in MAXIMISED else float("inf")


def _of_combinations(name: str, L: Array) -> float:
    """The value for combinations of the covariance ``L L'``, L (s, r)."""
    if name not in OF_COMBINATIONS:
        raise ValueError(f"the criterion {name} has no meaning for combinations of the parameters")
    s = 1 / np.linalg.svd(L, compute_uv=False)[::-1]
    return _of_spectrum(name, s, (L**2).sum(axis=1))


def _of_spectrum(name: str, s: Array, variances: Array) -> float:
    """The value from roots s of the information's eigenvalues, descending, and the variances."""
    mean_log = np.log(s).mean()
    found = {
        "A": variances.sum(),
        "D": np.exp(2 * mean_log),
        "E": s[-1] ** 2,
        "G": variances.max(),
        "O1": np.exp(mean_log),
        "O2": s[0] / s[-1],
        "O3": s[-1],
        "O4": s[-1] ** 2 / s[0],
        "O5": (1 / s).sum(),
    }
    if name not in found:
        raise ValueError(f"no criterion {name!r} is known here")
    return float(found[name])


def cost(name: str, printed: float) -> float:
    """The cost, where smaller is better, of a printed value."""
    if name not in MAXIMISED:
        return printed
    return 1 / printed if printed > 0 else float("inf")


def printed(name: str, cost_of_it: float) -> float:
    """The printed value of a cost."""
    return cost(name, cost_of_it)


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Symmetric matrices Z (r, p, p), of which nothing is believed.

    A multiplier proves a bound whatever it is, but rounding could be exploited: in a sensitivity
    whose terms cancel, or by an eigenvalue just below zero. So sensitivities are rounded up, by
    more than any rounding error, and what the bounds take from Z is rounded down.

    Attributes:
        Z: The matrices; positive semidefinite but for rounding, unless the criterion allows others.
        indefinite: Whether it does.
    """

    Z: Array
    indefinite: bool

    @classmethod
    def from_list(cls, value: Any, name: str, p: int) -> "Multipliers":
        """Read the multipliers of a criterion with p parameters.

        Raises:
            ValueError: They are not finite, of another shape, not symmetric or not semidefinite.
        """
        rows(value, MOST_MULTIPLIERS, "proof.multipliers")
        Z = numbers(value, (None, p, p), "proof.multipliers")
        if not len(Z):
            raise ValueError("proof.multipliers: expected at least one")
        return cls.of(Z, name in INDEFINITE)

    @classmethod
    def of(cls, Z: Array, indefinite: bool) -> "Multipliers":
        """Take multipliers (r, p, p).

        Raises:
            ValueError: They are not symmetric or not semidefinite.
        """
        # Any length proves the same; a length of 1e-320 would round sensitivities to nothing. A
        # power of two changes no digit.
        _, exponent = np.frexp(np.abs(Z).max(axis=(1, 2), keepdims=True))
        Z = np.ldexp(Z, -exponent)
        transposed = np.swapaxes(Z, 1, 2)
        size = np.abs(Z).max(axis=(1, 2), keepdims=True)
        if not (np.abs(Z - transposed) <= SYMMETRIC * size).all():
            raise ValueError("a multiplier is not symmetric")
        # Eigenvalues are taken from one triangle only, so that both have to be the same.
        found = cls((Z + transposed) / 2, indefinite)
        if not found.indefinite and not (found._lowest >= -NEGATIVE * Z.shape[-1]).all():
            raise ValueError("a multiplier is not positive semidefinite")
        return found

    @cached_property
    def scale(self) -> Array:
        """Numbers (r, p) so large that ``|Z_ab|`` is at most ``s_a s_b``.

        They are roots of the diagonal of ``|Z| = Z+ + Z-``, as ``|Z_ab|`` is at most
        ``|Z+_ab| + |Z-_ab|``, and Cauchy and Schwarz bound each of both, and then their sum. A
        semidefinite one is its own ``|Z|``.
        """
        diagonal = np.diagonal(self.Z, axis1=1, axis2=2)
        if self.indefinite:
            values, V = eigenpairs(self.Z)
            size = np.abs(values)
            diagonal = np.einsum("rak,rk->ra", V**2, size)
            # The decomposition rounds like this, in the norm of the whole.
            diagonal = diagonal + 4 * len(V[0]) * EPS * size.max(axis=1, keepdims=True)
        return np.asarray(np.sqrt(np.maximum(diagonal, 0.0)))

    @cached_property
    def _lowest(self) -> Array:
        """Least eigenvalue (r,) of each multiplier at unit diagonal."""
        scale = np.where(self.scale > 0, self.scale, 1.0)
        unit = self.Z / scale[:, :, None] / scale[:, None]
        return np.asarray(np.linalg.eigvalsh(unit)[:, 0], dtype=float)

    @cached_property
    def lift(self) -> Array:
        """What makes each multiplier (r,) positive semidefinite, at unit diagonal."""
        return np.zeros(len(self.Z)) if self.indefinite else np.maximum(-self._lowest, 0.0)

    @cached_property
    def _allowance(self) -> Array:
        """What a sensitivity is rounded up by (r,), per square of the largest that it can be.

        Sixteen roundings, and the lift that makes a multiplier positive semidefinite.
        """
        return 16 * EPS + self.lift

    def sensitivities(self, rows: Array, prior: Array, per_trace: bool) -> Array:
        """``<Z_j, M_i + M0>`` (r, k), rounded up.

        Args:
            rows: Whitened rows (k, measured, p) of the experiments i.
            prior: Prior information M0 (p, p).
            per_trace: Whether to divide by the trace of ``M_i + M0``.
        """
        k, measured, p = rows.shape
        flat = rows.reshape(-1, p)
        found = np.empty((len(self.Z), k))
        for j, Z in enumerate(self.Z):
            each = np.einsum("ia,ia->i", flat @ Z, flat)
            # |<Z, M>| is at most the square of this sum, whatever the signs of its terms.
            reach = (np.abs(flat) @ self.scale[j]) ** 2
            each += self._allowance[j] * reach
            own = (Z * prior).sum()
            most = float(self.scale[j] @ np.sqrt(np.diag(prior))) ** 2
            found[j] = each.reshape(k, measured).sum(axis=1) + own + self._allowance[j] * most
        if per_trace:
            found /= np.einsum("ia,ia->i", flat, flat).reshape(k, measured).sum(axis=1) + np.trace(
                prior
            )
        return found


def lower_bound(
    name: str,
    Z: Array,
    t: Array,
    targets: list[Array],
    M: Array,
    K: Array | None = None,
) -> float:
    """The least cost that any design can have.

    Args:
        name: One of the eleven criteria.
        Z: Multipliers (r, p, p), symmetric; but for O2 and O4 positive semidefinite up to rounding.
        t: Their largest sensitivities (r,), rounded up; those of O2 are per trace.
        targets: A target (r, p) to each multiplier, for rho0 and rho_max; else none. That of
            rho_max is a mean of its tasks, which no design can have better than the worst of them.
        M: The information matrix (p, p) of the design, near which the bound of G is tight.
        K: Combinations (p, s) of the parameters that the criterion is about; defaults to all
            parameters.
    """
    if name == "O2":
        return max(_condition_number(z, top) for z, top in zip(Z, t, strict=True))
    if name == "O4":
        return noise_amplification(_definite_parts(Z), t)
    found = 0.0
    if name in ("rho0", "rho_max") and not targets:
        raise ValueError(f"{name} needs a test pose")
    for j, (z, top) in enumerate(zip(Z, t, strict=True)):
        target = targets[j] if targets else None
        # A multiplier without a positive sensitivity would exclude every design: nobody's proof.
        if top > 0:
            factor = factor_of(z) if K is None else _factor_of_combinations(factor_of(z), K)
            least = _polar(name, factor, target, M if K is None else _information(M, K))
            found = max(found, least * top ** -DEGREE[name])
    return found


def _factor_of_combinations(factor: Array, K: Array) -> Array:
    """A factor (s, s) of at most ``K'Z K``, as ``X >= K C K'`` for the information C about K'k.

    Singular values are rounded down by what the product may have added to them.
    """
    length = np.linalg.norm(K, axis=0)
    _, roots, V = np.linalg.svd(factor @ (K / length), full_matrices=False)
    lowered = np.maximum(roots - 16 * EPS * len(K) * roots[0], 0.0)
    return np.asarray(lowered[:, None] * V * length)


def _information(M: Array, K: Array) -> Array:
    """About the information (s, s) that M (p, p) has of combinations, for G."""
    d = np.sqrt(np.maximum(np.diag(M), np.finfo(float).tiny))
    inverse = np.linalg.pinv(M / d[:, None] / d, rcond=16 * EPS * len(M), hermitian=True)
    scaled = K / d[:, None]
    return np.asarray(np.linalg.inv(scaled.T @ inverse @ scaled))


def _polar(name: str, factor: Array, target: Array | None, M: Array) -> float:
    """The least cost of any X with ``<Z, X> <= 1``, where ``Z = F'F`` for a factor F (p, p).

    Each form needs the eigenvalues of Z, or of ``B Z B'``: squared singular values of ``F B'``.
    """
    p = len(factor)
    if name == "G":
        return _largest_variance(factor, M)
    side = factor if target is None else in_range(factor @ target.T, "proof.multipliers")
    roots = np.linalg.svd(side, compute_uv=False)
    if name in ("D", "O1"):
        if roots[-1] <= 0:
            return 0.0
        determinant = p * float(np.exp(2 * np.log(roots).mean()))
        return determinant if name == "D" else determinant**0.5
    if name in ("E", "O3"):
        trace = float((roots**2).sum())
        return trace if name == "E" else trace**0.5
    if name == "O5":
        return float((roots ** (2 / 3)).sum() ** 1.5)
    total = float(roots.sum())
    return total**2 if name == "A" else total


def factor_of(Z: Array) -> Array:
    """F (p, p) with ``F'F`` at most Z: eigenvalues at unit diagonal are rounded down.

    The scaling keeps the roots of small eigenvalues, whatever the units of the parameters. Those
    that may be nothing but rounding count as zero: their roots would be large.
    """
    scale = np.sqrt(np.maximum(np.diag(Z), 0.0))
    divisor = np.where(scale > 0, scale, 1.0)
    values, V = eigenpairs(Z / divisor[:, None] / divisor)
    values = values - 4 * EPS * len(Z)
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * V.T * scale)


def _largest_variance(factor: Array, M: Array) -> float:
    """The best of ``(trace (U^1/2 Z U^1/2)^1/2)^2`` over weights u of sum one.

    Every u proves a bound. A fixed-point iteration looks for a good one, from the weights that are
    best at the optimum, and from all weight on the largest variance.
    """
    best = 0.0
    variances = np.diag(np.linalg.inv(M))
    part = np.square(factor @ M).sum(axis=0) * variances
    natural = np.where(part > NEGLIGIBLE * part.max(), part / variances, 0.0)
    largest = (variances == variances.max()).astype(float)
    for start in (natural, largest):
        weights = start
        for _ in range(WEIGHT_STEPS):
            if not weights.sum() > 0:
                break  # no weights, no proof
            _, roots, V = np.linalg.svd(factor * np.sqrt(weights / weights.sum()))
            best = max(best, float(roots.sum() ** 2))
            weights = (V.T**2) @ roots
    return best


def _condition_number(Z: Array, t: float) -> float:
    """``s_1/s_p >= (trace Y+ / trace Y-)^1/2`` with ``Y = Z - t I``, for designs of trace one."""
    y = np.linalg.eigvalsh(Z - t * np.eye(len(Z)))
    rounding = len(Z) * EPS * max(abs(t), float(np.abs(Z).max()))
    positive = np.maximum(y - rounding, 0.0).sum()
    negative = np.maximum(rounding - y, 0.0).sum()
    return float(np.sqrt(max(1.0, positive / negative))) if negative > 0 else 1.0


def _definite_parts(Z: Array) -> list[tuple[float, float]]:
    """``trace(Z+)``, lowered, and ``trace(Z-)``, raised, of each multiplier (r, p, p)."""
    found = []
    for values in np.linalg.eigvalsh(Z):
        rounding = len(values) * EPS * float(np.abs(values).max())
        positive = np.maximum(values - rounding, 0.0).sum()
        # A matrix that is semidefinite but for rounding counts as semidefinite: the sensitivities
        # are rounded up by more than it takes to make it so. Any small negative part would let
        # kappa be huge, and prove nothing.
        is_semidefinite = values[0] >= -rounding
        negative = 0.0 if is_semidefinite else np.maximum(rounding - values, 0.0).sum()
        found.append((float(positive), float(negative)))
    return found


def noise_amplification(parts: list[tuple[float, float]], t: Array) -> float:
    """The least ``(s kappa)^1/2`` over ``t s + trace(Z-) kappa >= trace(Z+), s >= 0, kappa >= 1``.

    The product is quasiconcave where both are positive, so that its least value is at a corner.

    Args:
        parts: ``trace(Z+)`` and ``trace(Z-)`` of each multiplier.
        t: Their largest sensitivities (r,).
    """
    pairs = zip(parts, t, strict=True)
    lines = [[top / above, below / above] for (above, below), top in pairs if above > 0]
    unit = float(np.median(np.abs(lines), axis=0)[0]) if lines else 0.0  # of 1/s
    if not unit > 0:
        return 0.0
    slopes = [b for _, b in lines if b > 0]
    # In units of both kappa and s, or lines of large condition numbers would all be parallel.
    flat = float(np.median(slopes)) if slopes else 1.0  # of 1/kappa
    least = _least_product(np.array(lines) / [unit, flat], flat)
    return float(np.sqrt(least / unit / flat)) if np.isfinite(least) else 0.0


def _least_product(lines: Array, lowest: float) -> float:
    """The least ``x y`` over ``a x + b y >= 1`` for lines (a, b), ``x >= 0``, ``y >= lowest``."""
    A, b = _distinct_lines(lines, lowest)
    first, second = np.triu_indices(len(A), 1)
    determinant = A[first, 0] * A[second, 1] - A[first, 1] * A[second, 0]
    x = (b[first] * A[second, 1] - b[second] * A[first, 1]) / determinant
    y = (A[first, 0] * b[second] - A[second, 0] * b[first]) / determinant
    # A corner outside by rounding counts: that can only make the least value smaller.
    rounding = OUTSIDE * (1 + np.abs(x) + np.abs(y))
    away = b - np.outer(x, A[:, 0]) - np.outer(y, A[:, 1])
    inside = away.max(axis=1) <= rounding
    return float((np.maximum(x, 0.0) * np.maximum(y, 0.0))[inside].min(initial=np.inf))


def _distinct_lines(lines: Array, lowest: float) -> tuple[Array, Array]:
    """Unit normals (k, 2) and distances (k,) of the axes and of lines that are not nearly parallel.

    The corner of nearly parallel lines cannot be computed. The one that lies closer to the origin
    is left out: fewer lines leave more points, so that the least value can only become smaller.
    Corners on an axis are exact, whatever the angle.
    """
    normals: list[Array] = []
    distances = []
    length = np.linalg.norm(lines, axis=1)
    for i in np.argsort(length):
        if not length[i] > 0:
            continue  # it excludes every point, which no true certificate does
        normal = lines[i] / length[i]
        if all(abs(normal[0] * one[1] - normal[1] * one[0]) > PARALLEL for one in normals):
            normals.append(normal)
            distances.append(1 / float(length[i]))
    return np.array([*normals, [1.0, 0.0], [0.0, 1.0]]), np.array([*distances, 0.0, lowest])
