"""Cost and bound of a relaxation over candidates of arrays, recomputed by numpy alone.

**Costs.** With weighted rows S of a design and ``cov = W W'`` from their singular values, every
criterion but O2 and O4 is a function of the singular values of ``L = K'W``, the deviations of
combinations K'k. **Bounds.** Of any semidefinite ``Z = F'F`` with ``<Z, M_i> <= t`` the least cost
is a function of the singular values of ``F K``. Both rise with each singular value. So rounding is
counted where it is made: costs are computed once more with values that are longer by as much as
rounding may have made them shorter, and bounds with values that are shorter by as much.

**Parameters.** Nearly dependent columns lose their digits in squares, so that all is done for
parameters k' with ``k = T k'``; what T is does not matter, as each product with it is summed in the
longest numbers of the machine, and its rounding counted.
"""

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.certificate.recompute.eigenpairs import LONG, LONG_EPS, Long, eigenpairs, rotations
from edtk.certificate.recompute.tasks import EPS, CovarianceRoot
from edtk.certificate.recompute.values import Multipliers, factor_of, noise_amplification
from edtk.certificate.recompute.weight_limits import WeightLimits
from edtk.system.typing import Array, Indices

TINY = float(np.finfo(float).tiny)
# x86 has longer numbers than doubles; Windows and Apple's machines have not.
IS_LONGER = LONG_EPS < EPS
EPS_OF_SUM = LONG_EPS if IS_LONGER else 2.0**-63  # for each term of `long_product`
SPLIT = 2.0**27 + 1  # halves the 53 digits of a double
AT_ONCE = 2**18  # doubles of rows that are looked at together
DIGITS = 4  # roundings of each number of a combination of rows, as it is given
LOST = 1e3  # multiple of ``p eps`` up to which a singular value is rounding
FAR = 1e-7  # ratio of singular values from which on a decomposition leaves no digits
WELL = 1e3  # condition number of rows up to which their own parameters will do


def long_product(A: Array, T: Array) -> Long:
    """``A T`` (..., q) of A (..., p) and T (p, q), whose terms may cancel, in long numbers.

    Where the machine has none, the rounding of each product (Dekker) and of each sum (Knuth) is
    added up beside the sum, and to it at the end.
    """
    if IS_LONGER:
        return np.asarray(A.astype(LONG) @ T.astype(LONG))
    found = np.zeros((*A.shape[:-1], T.shape[1]))
    rest = np.zeros_like(found)
    for a, t in zip(np.moveaxis(A, -1, 0)[..., None], T, strict=True):
        product = a * t
        a_high, t_high = _high(a), _high(t)
        crossed = a_high * (t - t_high) + (a - a_high) * t_high
        rest += ((a_high * t_high - product) + crossed) + (a - a_high) * (t - t_high)
        larger = found + product
        of_product = larger - found
        rest += (found - (larger - of_product)) + (product - of_product)
        found = larger
    return found + rest


def _high(x: Array) -> Array:
    """The first 26 digits of numbers (Veltkamp)."""
    scaled = SPLIT * x
    return scaled - (scaled - x)


def row_root(M: Array) -> tuple[Array, Array]:
    """Rows (..., p, p) whose squares are M (..., p, p), and how far M is from them (...).

    The distance is a part of ``sqrt(M_aa M_bb)`` in each entry: rounding, and negative eigenvalues
    at unit diagonal.
    """
    d = np.sqrt(np.maximum(np.diagonal(M, axis1=-2, axis2=-1), 0.0))
    unit = np.where(d > 0, d, 1.0)
    r, V = eigenpairs(M / unit[..., :, None] / unit[..., None, :])
    rows = np.sqrt(np.maximum(r, 0.0))[..., None] * np.swapaxes(V, -1, -2) * d[..., None, :]
    return rows, np.maximum(-r[..., 0], 0.0) + 8 * M.shape[-1] * EPS * np.abs(r).max(axis=-1)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Candidate experiments, in whatever form they were given.

    Attributes:
        rows: Whitened rows ``A_i / sigma`` (n, r, p).
        information: What was given in their place (n, p, p); the rows then are about its roots.
        prior: Prior information (p, p) of each experiment, in long numbers.
        sha256: The digest of what was given.
        undivided: Regressors (n, r, p) and the deviations (n, r) by which their rows are divided;
            None where that has rounded nothing.
    """

    rows: Array
    information: Array | None
    prior: Long
    sha256: str
    undivided: tuple[Array, Array] | None = None

    @classmethod
    def of(cls, rows: Array | None, triangles: Array | None, prior: Array | None) -> "Candidates":
        """Take rows (n, r, p), or else upper triangles (p(p+1)/2, n), and a prior (p, p)."""
        given = rows if rows is not None else triangles
        assert given is not None
        words = "rows" if rows is not None else "triangles"
        digest = hashlib.sha256(f"{words} {' '.join(map(str, given.shape))}\n".encode())
        for array in (given, prior):
            if array is not None:
                digest.update(np.ascontiguousarray(array, dtype="<f8").data)
        information = None
        if rows is None:
            information = _unpacked(given)
            rows, _ = row_root(information)
        p = rows.shape[2]
        own = np.zeros((p, p)) if prior is None else prior
        return cls(rows, information, own.astype(LONG), digest.hexdigest())

    def with_prior(self, precision: Array) -> "Candidates":
        """The same with more prior information (p, p)."""
        return replace(self, prior=self.prior + precision)

    def scaled(self, power: int | Indices) -> "Candidates":
        """The same in other units: ``2^power`` times the rows, or each of their columns (p,)."""
        squares = self.information
        powers = np.broadcast_to(power, self.p)
        both = powers[:, None] + powers
        return replace(
            self,
            rows=np.ldexp(self.rows, powers),
            undivided=None if self.undivided is None else self._undivided(powers),
            information=None if squares is None else np.ldexp(squares, both),
            prior=np.ldexp(self.prior, both),
        )

    def _undivided(self, power: Indices) -> tuple[Array, Array]:
        """What is divided, with ``2^power`` times the regressors."""
        assert self.undivided is not None
        given, sigma = self.undivided
        return np.ldexp(given, power), sigma

    def framed(self, frame: "Frame", some: slice | Indices) -> tuple[Array, Array]:
        """Rows (k, r, p) of some candidates for parameters of a frame, see `Frame.rows`."""
        if self.undivided is None:
            return frame.rows(self.rows[some])
        given, sigma = self.undivided
        return frame.rows(given[some], sigma[some])

    @cached_property
    def prior_rows(self) -> Array:
        """About the root (p, p) of the prior."""
        return row_root(self.prior.astype(float))[0]

    def traces(self, part: slice) -> Array:
        """The traces (k,) of the information of some candidates, with the prior."""
        own = float(np.trace(self.prior))
        if self.information is not None:
            return np.asarray(np.trace(self.information[part], axis1=1, axis2=2) + own)
        return np.asarray(np.square(self.rows[part]).sum(axis=(1, 2)) + own)

    @property
    def n(self) -> int:
        """Number of candidates."""
        return len(self.rows)

    @property
    def p(self) -> int:
        """Number of parameters."""
        return int(self.rows.shape[2])

    @property
    def power(self) -> int:
        """The power of two that brings the largest entry to order one."""
        largest = max(np.abs(self.rows).max(), np.abs(self.prior_rows).max())
        return -int(np.frexp(largest)[1])

    @property
    def units(self) -> Indices:
        """The powers of two (p,) that bring the columns, with the prior, to a length near one."""
        # The squares of small columns would be nothing.
        largest = np.maximum(
            np.abs(self.rows).max(axis=(0, 1)), np.abs(self.prior_rows).max(axis=0)
        )
        _, first = np.frexp(np.where(largest > 0, largest, 1.0))
        squares = np.square(np.ldexp(self.rows, -first)).sum(axis=1).mean(axis=0)
        squares = squares + np.square(np.ldexp(self.prior_rows, -first)).sum(axis=0)
        _, second = np.frexp(np.sqrt(np.where(largest > 0, squares, 1.0)))
        return np.asarray(-first - second)

    def parts(self) -> Iterator[slice]:
        """Parts of the candidates that are looked at together."""
        step = max(AT_ONCE // self.rows[0].size, 1)
        return (slice(start, start + step) for start in range(0, self.n, step))


def _unpacked(triangles: Array) -> Array:
    """Symmetric matrices (n, p, p) of upper triangles (p(p+1)/2, n), row by row."""
    p = (math.isqrt(8 * len(triangles) + 1) - 1) // 2
    M = np.empty((triangles.shape[1], p, p))
    i, j = np.triu_indices(p)
    M[:, i, j] = triangles.T
    M[:, j, i] = triangles.T
    return M


@dataclass(frozen=True, eq=False)
class Frame:
    """Parameters k' with ``k = T k'``, for any T (p, p).

    Attributes:
        T: The matrix.
        exact: Whether T is diagonal with powers of two, so that products with it are exact.
    """

    T: Array
    exact: bool = False

    @classmethod
    def of_columns(cls, candidates: Candidates) -> "Frame":
        """Columns of all candidates, and the prior, with a length near one."""
        return cls(np.diag(np.ldexp(np.ones(candidates.p), candidates.units)), exact=True)

    @classmethod
    def of_candidates(cls, candidates: Candidates) -> "Frame":
        """Parameters in which rows are independent; columns of a length near one, if they are."""
        units = cls.of_columns(candidates)
        own = np.diag(units.T)
        s, V = _singular_values(candidates, own)
        told = s > LOST * len(s) * EPS * s[0]
        if s[told][-1] * WELL >= s[0]:
            return units
        return cls(own[:, None] * V.T / np.where(told, s, 1.0))

    @classmethod
    def of_axes(cls, candidates: Candidates) -> "Frame":
        """Parameters of independent rows along orthogonal axes, unless units are far apart."""
        s, V = _singular_values(candidates, np.ones(candidates.p))
        return cls(V.T / s) if s[-1] > FAR * s[0] else cls.of_columns(candidates)

    def at_order_one(self, candidates: Candidates) -> "Frame":
        """The same parameters in a unit, a power of two, in which rows are of order one.

        No digit changes; far from one, squares would leave the numbers.
        """
        _, own = np.frexp(np.abs(self.T).max())
        T = np.ldexp(self.T, -own)
        largest = max(float(np.abs(A @ T).max()) for A in (*candidates.rows, candidates.prior_rows))
        _, exponent = np.frexp(largest)
        return replace(self, T=np.ldexp(T, -exponent))

    def rows(self, A: Array, sigma: Array | None = None) -> tuple[Array, Array]:
        """Rows ``A_i T`` (k, r, p) of rows (k, r, p), and bounds (k,) on their rounding.

        They are divided by sigma (k, r) last: entry by entry it would hide what cancels.
        """
        if self.exact and sigma is None:
            return A * np.diag(self.T), np.zeros(len(A))
        product = long_product(A, self.T)
        sizes = np.abs(A) @ np.abs(self.T)
        if sigma is not None:
            product = product / sigma[..., None]
            sizes = sizes / sigma[..., None]
        found = np.asarray(product, dtype=float)
        rounded = EPS * np.linalg.norm(found, axis=(1, 2))
        return found, len(self.T) * EPS_OF_SUM * np.linalg.norm(sizes, axis=(1, 2)) + rounded

    def squares(self, M: Long) -> tuple[Long, Array]:
        """``T'M T`` (..., p, p) in long numbers, and bounds (..., p, p) on its rounding."""
        T = self.T.astype(LONG)
        sizes = np.abs(self.T).T @ np.abs(M.astype(float)) @ np.abs(self.T)
        return T.T @ M.astype(LONG) @ T, 3 * len(T) * LONG_EPS * sizes

    def side(self, K: Array) -> "Side":
        """``T'K`` (p, s) of combinations K (p, s)."""
        sizes = np.abs(self.T).T @ np.abs(K)
        if self.exact:
            found = (np.diag(self.T)[:, None] * K).astype(LONG)
            return Side(found, np.zeros(K.shape), DIGITS * EPS * sizes, (self.T, K))
        found = long_product(self.T.T, K)
        chooses = np.isin(K, (0.0, 1.0)).all(axis=0) & (K.sum(axis=0) == 1)
        # In longer numbers nothing is rounded after the sum.
        last = 0.0 if IS_LONGER else EPS * np.abs(found)
        error = np.where(chooses, 0.0, len(K) * EPS_OF_SUM * sizes + last)
        return Side(found, error, np.where(chooses, 0.0, DIGITS * EPS * sizes), (self.T, K))


def _singular_values(candidates: Candidates, units: Array) -> tuple[Array, Array]:
    """Singular values s (p,) and V (p, p) of the mean rows in units (p,), none of them squared."""
    p = candidates.p
    R = candidates.prior_rows * units
    for part in candidates.parts():
        rows = candidates.rows[part].reshape(-1, p) * units / candidates.n**0.5
        R = np.asarray(np.linalg.qr(np.vstack([R, rows]), mode="r"))
    _, s, V = np.linalg.svd(np.vstack([R, np.zeros((p, p))]), full_matrices=False)
    return s, V


@dataclass(frozen=True, eq=False)
class Side:
    """``T'K`` of combinations K of the parameters.

    Attributes:
        long: The matrix (p, s), in long numbers.
        wrong: Bounds (p, s) on its rounding.
        digits: What the last digits of K make of its entries (p, s): a combination of rows, such as
            what c-optimality is about, is rounded as it is given.
        factors: T (p, p) and K (p, s).
    """

    long: Long
    wrong: Array
    digits: Array
    factors: tuple[Array, Array]

    @cached_property
    def J(self) -> Array:
        """The matrix in doubles."""
        return self.long.astype(float)

    @cached_property
    def error(self) -> Array:
        """Bounds (p, s) on the rounding of J."""
        return np.asarray(self.wrong + np.abs(self.long - self.J).astype(float))

    def weighted(self, factors: Array) -> "Side":
        """The combinations times factors (s,)."""
        wrong = (self.wrong + EPS * np.abs(self.J)) * factors
        T, K = self.factors
        return Side(self.long * factors, wrong, self.digits * factors, (T, K * factors))

    def roots(self, F: Array) -> Array:
        """Singular values (s,) of ``F J``, F (k, p), descending, and lowered by their rounding."""
        product = F @ self.J
        s = np.linalg.svd(product, compute_uv=False)
        lost = len(self.J) * EPS * np.abs(F) @ np.abs(self.J) + np.abs(F) @ self.error
        lowered = s - np.linalg.norm(lost) - 8 * max(product.shape) * EPS * s[0]
        return np.pad(np.maximum(lowered, 0.0), (0, self.J.shape[1] - len(s)))

    def deviations(self, W: Array) -> tuple[Array, float]:
        """``L = J'W`` (s, r), and a bound on what its singular values may have lost."""
        L = self.J.T @ W
        lost = len(W) * EPS * np.abs(self.J).T @ np.abs(W) + self.error.T @ np.abs(W)
        return L, float(np.linalg.norm(lost) + 8 * max(L.shape) * EPS * np.linalg.norm(L, 2))

    @cached_property
    def volume(self) -> tuple[Array, float, float]:
        """Q (p, s) and ``log |det R|`` with ``Q R = J``, and a bound on its rounding.

        Of a square J, Q is the identity, and the determinant that of T times that of K, which both
        may be far from singular where J is not. Else Gram and Schmidt's steps, each done twice, are
        taken in long numbers, as combinations of independent parameters may be nearly dependent.
        """
        p, s = self.J.shape
        if p == s:
            T, K = map(log_volume, self.factors)
            found = (T[0] + K[0], T[1] + K[1])
            return np.eye(p), *min(found, log_volume(self.J), key=lambda one: one[1])
        length = np.linalg.norm(self.J, axis=0)
        Q = self.long / length
        R = np.zeros((s, s), dtype=LONG)
        for j in range(s):
            for _ in range(2):
                along = Q[:, :j].T @ Q[:, j]
                R[:j, j] += along
                Q[:, j] -= Q[:, :j] @ along
            R[j, j] = np.sqrt(np.square(Q[:, j]).sum())
            Q[:, j] /= R[j, j]
        relative = 8 * p * LONG_EPS + float(np.linalg.norm(self.wrong / length))
        relative *= float(np.linalg.cond(R.astype(float)))
        logs = float(np.log(np.diag(R)).sum()) + float(np.log(length).sum())
        size = float(np.abs(np.log(np.diag(R))).sum() + np.abs(np.log(length)).sum())
        return Q.astype(float), logs, s * (relative + 8 * p * EPS) + 2 * EPS * size


def independent(K: Array, units: Indices) -> tuple[Array, float, float]:
    """L (p, s), ``log |det G|`` with ``diag(2^units) K = L G``, and a bound on its rounding.

    Units that are far apart make combinations nearly parallel. Gauss' elimination of columns, in
    long numbers and with the largest entry as each pivot, leaves entries of one at most in L, whose
    columns are far from each other. A row has one unit, so that what rounds in a row is small
    beside that row; by Cauchy and Binet a volume changes no more than the minors that count, of
    which that of the pivots is the largest.
    """
    p, s = K.shape
    A = K.astype(LONG)
    L = np.zeros((p, s))
    pivots: list[int] = []
    logs = size = 0.0
    left = list(range(s))
    for k in range(s):
        with np.errstate(divide="ignore"):
            heights = np.log2(np.abs(A[:, left])) + units[:, None]
        i, chosen = np.unravel_index(int(heights.argmax()), heights.shape)
        j = left.pop(int(chosen))
        pivot = A[i, j]
        if pivot == 0:
            return L, -math.inf, 0.0
        own = A[:, j] / pivot
        L[:, k] = np.ldexp(own, units - units[i])
        part = float(np.log(np.abs(pivot))) + float(units[i]) * math.log(2)
        logs += part
        size += abs(part)
        A[:, left] -= own[:, None] * A[i, left]
        A[i, left] = 0
        pivots.append(int(i))
    minor = K[pivots] / np.abs(K[pivots]).max(axis=1, keepdims=True)
    minor = minor / np.linalg.norm(minor, axis=0)
    lost = 8 * p * s**2 * LONG_EPS * float(np.linalg.cond(minor))
    return L, logs, lost + s * p * EPS * float(np.linalg.cond(L)) + 2 * EPS * size


def log_volume(J: Array) -> tuple[float, float]:
    """``log |det J|`` of a square J, and a bound on its rounding.

    It is computed with rows and columns of unit length, so that no unit costs digits; they are
    brought there in two ways, of which one may be bad.
    """
    return min(_even_volume(J), _even_volume(J.T), key=lambda found: found[1])


def _even_volume(J: Array) -> tuple[float, float]:
    """The same, in one of the ways."""
    logs = size = 0.0
    unit = J
    for axis in (0, 1, 0, 1):
        length = np.linalg.norm(unit, axis=axis, keepdims=True)
        if not (length > 0).all():
            return -math.inf, 0.0
        unit = unit / length
        logs += float(np.log(length).sum())
        size += float(np.abs(np.log(length)).sum())
    error = 8 * len(J) ** 2 * EPS * float(np.linalg.cond(unit)) + 2 * EPS * size
    return logs + float(np.linalg.slogdet(unit).logabsdet), error


@dataclass(frozen=True, eq=False)
class Design:
    """What weighted rows tell, for parameters k' of a frame.

    Attributes:
        frame: The parameters.
        root: Root of the covariance of k'.
        blur: Bound on the relative error of every variance.
    """

    frame: Frame
    root: CovarianceRoot
    blur: float

    @classmethod
    def of(cls, candidates: Candidates, frame: Frame, weights: Array) -> "Design":
        """The design of weights (n,).

        With rows that are wrong by E_i, and ``(S W)'(S W) = I``, variances are wrong by the factor
        ``1 + 2 |W| (sum w_i |E_i|^2)^(1/2)`` at most; a matrix that is wrong by E in its entries
        makes them wrong by ``|W|'E |W|``.
        """
        chosen = np.flatnonzero(weights > 0)
        w = weights[chosen]
        M: Long = candidates.prior
        X: Array = np.zeros((len(w), 0, candidates.p))
        E: Array = np.zeros(len(w))
        if candidates.information is None:
            X, E = candidates.framed(frame, chosen)
        else:
            M = M + np.tensordot(w.astype(LONG), candidates.information[chosen], axes=1)
        # Weights come last: their roots round entries of nearly dependent columns, one by one.
        X = (np.sqrt(w)[:, None, None] * X).reshape(-1, candidates.p)
        E = np.sqrt(w) * E
        inward, wrong = frame.squares(M)
        more, part = row_root(inward.astype(float))
        root = CovarianceRoot.of(np.vstack([X, more]))
        size = np.abs(root.W)
        own = np.sqrt(np.maximum(np.diag(inward), 0.0)).astype(float)
        blur = 2 * float(np.linalg.norm(root.W, 2)) * float(np.linalg.norm(E)) if size.size else 0.0
        blur += 16 * candidates.p * EPS * float(root.s.max(initial=1.0) / root.s.min(initial=1.0))
        blur += float(part) * float(np.square(size.T @ own).sum())
        return cls(frame, root, blur + float(np.linalg.norm(size.T @ wrong @ size)))


@dataclass(frozen=True, eq=False)
class Proof:
    """Multipliers, and the largest sensitivities of all candidates to them.

    Attributes:
        frame: The parameters.
        factors: F (r, p, p) with ``F'F`` at most Z.
        t: The largest sensitivities (r,), rounded up.
    """

    frame: Frame
    factors: list[Array]
    t: Array

    @classmethod
    def of(
        cls,
        candidates: Candidates,
        frame: Frame,
        multipliers: Multipliers,
        limits: WeightLimits | None = None,
    ) -> "Proof":
        """Look at all candidates, and at what limits leave of them."""
        t = sensitivities(candidates, frame, multipliers, False, limits)
        return cls(frame, [factor_of(Z) for Z in multipliers.Z], t)


def sensitivities(
    candidates: Candidates,
    frame: Frame,
    multipliers: Multipliers,
    per_trace: bool,
    limits: WeightLimits | None = None,
) -> Array:
    """The largest sensitivities (r,) of a candidate, or of counts within limits, rounded up.

    Rows that are wrong by E_i add ``2 |E_i| (|Z| t_i)^(1/2) + |E_i|^2 |Z|``; information that is
    wrong by E in its entries adds ``<|Z|, E>``.

    Args:
        candidates: The candidates.
        frame: The parameters.
        multipliers: The multipliers (r, p, p) for these.
        per_trace: Whether information is divided by its trace, in the parameters as given.
        limits: Limits on the counts, of which the mean sensitivity is told; None for one candidate.
    """
    size = np.abs(multipliers.Z)
    norm = np.abs(np.linalg.eigvalsh(multipliers.Z)).max(axis=1)[:, None]
    prior, wrong = frame.squares(candidates.prior)
    more = (size * (wrong + EPS * np.abs(prior).astype(float))).sum(axis=(1, 2))
    found = np.full(len(multipliers.Z), -np.inf)
    each = []
    for part in candidates.parts():
        if candidates.information is None:
            X, E = candidates.framed(frame, part)
            t = multipliers.sensitivities(X, prior.astype(float), per_trace=False)
            t += 2 * E * np.sqrt(norm * np.maximum(t, 0.0)) + E**2 * norm
        else:
            M, wrong = frame.squares(candidates.information[part] + candidates.prior)
            t = np.einsum("rab,nab->rn", multipliers.Z.astype(LONG), M).astype(float)
            t += 2 * EPS * np.abs(t) + np.einsum("rab,nab->rn", size, 2 * wrong)
            diagonal = np.maximum(np.diagonal(M, axis1=1, axis2=2), 0.0).astype(float)
            t += multipliers.lift[:, None] * (multipliers.scale @ np.sqrt(diagonal).T) ** 2
        t += more[:, None]
        if per_trace:
            t /= candidates.traces(part)
        found = np.maximum(found, t.max(axis=1))
        if limits is not None:
            each.append(t)
    if limits is not None:
        found = limits.largest(np.concatenate(each, axis=1))
    return np.asarray(found + TINY)  # products of tiny numbers are wrong by as much


def same_multipliers(stated: Array, T: Array, Z: Array) -> bool:
    """Whether multipliers (r, p, p) are ``T Z T'`` but for the rounding of products."""
    if Z.shape != stated.shape:
        return False
    sizes = np.abs(T) @ np.abs(Z) @ np.abs(T).T
    return bool((np.abs(T @ Z @ T.T - stated) <= 1e-12 * len(T) * sizes).all())


def balance_bound(
    name: str,
    candidates: Candidates,
    frame: Frame,
    Z: Array,
    limits: WeightLimits | None = None,
) -> float:
    """The bound of O2 or O4 by multipliers Z (r, p, p) for parameters of a frame.

    Of designs with ``I <= X <= kappa I`` the least ``<Y, X>`` is ``trace(Y+) - kappa trace(Y-)``,
    of ``Y = T Z T'`` for O4. For O2 designs have unit trace, and Y is that less t times the
    identity.
    """
    size = np.abs(Z).max(axis=(1, 2))
    lift = 2 * candidates.p * EPS * size
    # One that is semidefinite but for rounding is lifted until it is: it has no negative part.
    is_semidefinite = np.linalg.eigvalsh(Z)[:, 0] >= -lift / 2
    Z = Z + np.where(is_semidefinite, lift, 0.0)[:, None, None] * np.eye(candidates.p)
    read = Multipliers.of(Z, indefinite=True)
    U, s = _turned(frame.T)
    turned = 1 + 32 * candidates.p**2 * EPS  # axes that are orthogonal but for rounding
    t = sensitivities(candidates, frame, read, name == "O2", limits) * turned
    parts = []
    for z, top, whole in zip(read.Z, t, is_semidefinite, strict=True):
        Y = U.astype(LONG) @ (s[:, None] * z.astype(LONG) * s) @ U.T.astype(LONG)
        sizes = np.abs(U) @ (s[:, None] * np.abs(z) * s) @ np.abs(U).T
        if name == "O2":
            Y = Y - LONG(top) * np.eye(len(z), dtype=LONG)
            sizes = sizes + top * np.eye(len(z))
        above, below = definite_parts(Y, sizes)
        parts.append((above / turned, 0.0 if whole and name == "O4" else below))
    if name == "O4":
        return noise_amplification(parts, t)
    ratios = [above / below for above, below in parts if below > 0]
    return math.sqrt(max([1.0, *ratios]))


def _turned(T: Array) -> tuple[Array, Array]:
    """U (p, p) and s (p,) such that ``T = V U diag(s)`` but for rounding, with an orthogonal V.

    V does not matter for eigenvalues. Where the columns of T are orthogonal, U is the identity, and
    products with s keep the digits of small entries beside large ones.
    """
    s = np.linalg.norm(T, axis=0)
    if (s > 0).all() and np.abs((T / s).T @ (T / s) - np.eye(len(T))).max() <= 8 * len(T) * EPS:
        return np.eye(len(T)), s
    return T, np.ones(len(T))


def definite_parts(Y: Long, sizes: Array) -> tuple[float, float]:
    """``trace(Y+)``, lowered, and ``trace(Y-)``, raised, of a symmetric Y of long numbers.

    Jacobi's rotations keep small entries beside large ones. They are not believed: let
    ``W = V'Y V`` with diagonal d be computed once more, with an error below E in its entries, which
    hold what is left off the diagonal. For X between I and kappa I, of entries
    ``|x_ab| <= (x_aa x_bb)^(1/2)``,

        2 |E_ab| (x_aa x_bb)^(1/2) <= f |d_a| x_aa + E_ab^2/(f |d_a|) x_bb ,

    with a small part f of a positive d_a. Such a d_a loses the part f for each b, and each other
    one loses the second term.

    Args:
        Y: The matrix (p, p).
        sizes: Sizes (p, p) of the terms of its entries, whose rounding is a part of them.
    """
    p = len(Y)
    V = rotations(Y)
    W = V.T @ Y @ V
    E = np.abs(W - np.diag(np.diag(W)))
    E = E + 8 * p * LONG_EPS * (np.abs(V).T @ sizes.astype(LONG) @ np.abs(V))
    d = np.diag(W) - np.diag(E)
    positive = d > 0
    f = LONG(1e-13)
    own = np.where(positive, d, LONG(1))
    lost = np.where(positive[:, None], np.square(E) / (f * own[:, None]), E)
    np.fill_diagonal(lost, 0)
    d = d * np.where(positive, 1 - p * f, LONG(1)) - lost.sum(axis=0)
    # V is orthogonal but for roundings.
    turned = 1 + float(np.abs(V.T @ V - np.eye(p)).sum()) + 8 * p * EPS
    above = float(np.maximum(d, 0).sum()) / turned
    return above, float(-np.minimum(d, 0).sum()) * turned
