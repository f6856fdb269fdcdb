"""Second derivatives of criteria, as Newton's method over many weights needs them."""

from dataclasses import dataclass, replace

import numpy as np

from criteria.linalg.inverse import eigenpairs
from criteria.linalg.typing import Array, Indices, triangle

# Log of the ratio of two eigenvalues that count as one: its square is rounding.
SAME = 1e-8


@dataclass(frozen=True, eq=False)
class Curvature:
    """First and second derivative of ``log cost`` at an information matrix M.

    Let ``T = R V`` for a root R of the covariance, ``R R' = cov``, so that ``T' M T = I``. A change
    dM of M, which is ``E = T' dM T`` in these parameters, changes log cost by

        -sum_a z_a E_aa + 1/2 ( sum_ab W_ab E_ab^2 - c (sum_a z_a E_aa)^2 )

    up to third order. So the second derivative by the weights of k candidates is ``P'P`` for their
    scaled upper triangles P (p(p+1)/2, k), less one square.

    All arrays may be of several M, which come first.

    Attributes:
        V: Orthonormal columns (..., p, s): all parameters, or those of one model of several.
        z: The multiplier, which is diagonal in these parameters (..., s); of the degree's sum.
        W: Weights (..., s, s), symmetric and not negative.
        c: The factor of the square of the slope.
    """

    V: Array
    z: Array
    W: Array
    c: float

    def power(self, exponent: float) -> "Curvature":
        """That of the cost to the power of an exponent, whose log is a multiple."""
        return replace(self, z=exponent * self.z, W=exponent * self.W, c=self.c / exponent)

    def by_entries(self, R: Array, i: Indices, j: Indices) -> tuple[Array, Array]:
        """The derivatives of log cost by some entries of the upper triangle of M.

        Args:
            R: The root (..., p, p) of the covariance.
            i: Rows (q,) of the entries.
            j: Their columns (q,).

        Returns:
            The slope (..., q) and the second derivative (..., q, q).
        """
        p, s = self.V.shape[-2:]
        a, b = triangle(s)
        # Products of large arrays take several times as long where the last axis is not dense.
        T = (R @ self.V).reshape(*R.shape[:-2], p * s)
        of_a, of_b = (s * np.array([i, j])[:, None] + own[:, None] for own in (a, b))
        # E_ab by the entries of dM, of which one off the diagonal stands for two.
        E = T.take(of_a[0], axis=-1) * T.take(of_b[1], axis=-1)
        E += T.take(of_a[1], axis=-1) * T.take(of_b[0], axis=-1)
        E *= np.where(i == j, 0.5, 1.0)
        slope = -(self.z[..., None, :] @ E[..., a == b, :])[..., 0, :]
        # Two entries of E off the diagonal are the same.
        E *= np.sqrt(np.where(a == b, 1.0, 2.0) * self.W[..., a, b])[..., None]
        K = np.swapaxes(E, -1, -2) @ E
        if self.c:
            K -= (self.c * slope)[..., :, None] * slope[..., None, :]
        return slope, K

    def squares(self, E: Array) -> Array:
        """P (q, k) with ``P'P`` the second derivative by the weights of k candidates.

        Log cost is convex, so that on the diagonal ``diag(W) - c z z'`` is semidefinite. A root of
        it takes the place of a square that is taken away, which terms of a sum cannot have each.

        Args:
            E: Upper triangles (q, k) of the candidates' information about the parameters of T.
        """
        rows, columns = triangle(len(self.z))
        on_diagonal = rows == columns
        P = np.sqrt(2.0 * self.W[rows, columns])[:, None] * E
        values, U = eigenpairs(np.diag(np.diag(self.W)) - self.c * np.outer(self.z, self.z))
        P[on_diagonal] = (np.sqrt(np.maximum(values, 0.0)) * U).T @ E[on_diagonal]
        return np.asarray(P)


def curvature_of_variances(B: Array) -> Curvature:
    """The curvature of ``log trace(A cov A')``, for rows ``B = A R`` (..., r, p).

    The second derivative of ``f = <L, cov>``, ``L = A'A``, is ``2 <L, cov dM cov dM cov>``. With
    the right singular vectors V of B, ``T'L T = diag(l)``, so that it is
    ``sum_ab (l_a + l_b) E_ab^2``, and ``f = sum l``.
    """
    _, s, rows = np.linalg.svd(B)
    l = np.zeros(rows.shape[:-1])  # noqa: E741, the letter of the formula
    l[..., : s.shape[-1]] = np.square(s / s[..., :1])
    z = l / l.sum(axis=-1, keepdims=True)
    W = z[..., :, None] + z[..., None, :]
    return Curvature(np.swapaxes(rows, -1, -2), z, W, 1.0)


def curvature_of_spectrum(R: Array, power: float) -> Curvature:
    """The curvature of ``log trace(cov^power)`` for a root R (..., p, p) of the covariance.

    The second derivative of ``trace g(M)`` is ``sum_ab g'[x_a, x_b] dM_ab^2`` in the eigenvectors
    of M, with divided differences of g' between eigenvalues (Bhatia, Matrix Analysis, V.3). They
    are ``power (x_a^-e - x_b^-e)/(x_b - x_a)`` with ``e = power + 1``, and ``power e x^-(e+1)``
    where both are the same.
    """
    _, s, rows = np.linalg.svd(R)
    x = np.square(s[..., :1] / s)
    e = power + 1.0
    # With x_a < x_b = x_a exp(h) it is x_a^-power (1 - exp(-e h))/(1 - exp(-h)) over x_a x_b, which
    # has no cancellation where both are almost the same, and no overflow where they are not.
    pairs = x[..., :, None], x[..., None, :]
    h = np.abs(np.log(pairs[0] / pairs[1]))
    is_same = h < SAME
    safe = np.where(is_same, 1.0, h)
    quotient = np.where(is_same, e, np.expm1(-e * safe) / np.expm1(-safe))
    # T scales each direction to information one, hence the factor x_a x_b.
    W = power * quotient * np.minimum(*pairs) ** -power
    terms = x**-power
    total = terms.sum(axis=-1, keepdims=True)
    V = np.swapaxes(rows, -1, -2)
    return Curvature(V, power * terms / total, W / total[..., None], 1.0)
