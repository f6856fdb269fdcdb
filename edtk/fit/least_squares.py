"""The linear least-squares fit, its covariance, and what it is without each group of rows."""

from dataclasses import dataclass

import numpy as np

from criteria.linalg.inverse import eigenpairs, guarded_inverse
from edtk.fit.correlated_noise import AnyNoise, CorrelatedNoise, whiten_columns
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices, Mask

# Leverage below one that rounding makes of a direction that one group of rows tells alone.
ALONE = 1e-9
# Sum of a group's leverages below one, up to which one of them may be as near to it.
NEARLY = 1e-6
OUTSIDE = 0.05  # share of coordinates outside 95 % bands
# With the density phi and the bound z of a normal number, ``2 (z phi(z))^2`` of the variance
# ``0.05 * 0.95`` of its being outside: the part that grows with the square of a correlation.
OF_SQUARE = 0.5525


class SingularPlanError(ValueError):
    """A plan cannot identify all parameters.

    Attributes:
        parameters: Names of the parameters that the plan cannot tell apart or does not excite.
        directions: Combinations of several parameters, like "k2 - 0.5 k3", about which the plan
            says nothing; single parameters are not repeated here.
        words: Sentences that say the same, what cannot be told from what; there may be none.
    """

    def __init__(
        self,
        parameters: tuple[str, ...],
        directions: tuple[str, ...] = (),
        words: tuple[str, ...] = (),
    ) -> None:
        super().__init__(parameters, directions, words)
        self.parameters = parameters
        self.directions = directions
        self.words = words

    def __str__(self) -> str:
        text = (
            f"the plan cannot identify all parameters: {', '.join(self.parameters)} "
            "cannot be told from its measurements"
        )
        if self.words:
            return f"{text}: {'; '.join(self.words)}"
        if self.directions:
            combined = " and ".join(f"({direction})" for direction in self.directions)
            text += f"; nothing is known along {combined}"
        return text


@dataclass(frozen=True, eq=False)
class Estimate(Presented):
    """Estimated compliances.

    Attributes:
        k: Estimates (..., p) [rad/(N m)].
        covariance: Their covariance (p, p), Eq. (13).
        parameters: Names (p,); empty where nobody gave names.
    """

    k: Array
    covariance: Array
    parameters: tuple[str, ...] = ()

    def headline(self) -> str:
        """How many compliances of how many fits."""
        fits = "" if self.k.ndim == 1 else f" of {self.k[..., 0].size} fits"
        return f"{self.k.shape[-1]} compliances{fits}"

    @property
    def std(self) -> Array:
        """Standard deviations (p,) [rad/(N m)]."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """Correlations (p, p)."""
        return np.asarray(self.covariance / np.outer(self.std, self.std))


def unidentified(M: Array, parameters: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the parameters that take part in a direction which M (p, p) does not excite."""
    # SciPy's linear algebra takes long to import; only an error needs it.
    from criteria.linalg.estimable import null_space

    involved = np.any(null_space(M)[0] != 0, axis=1).tolist()
    return tuple(name for name, yes in zip(parameters, involved, strict=True) if yes)


def covariance(M: Array, parameters: tuple[str, ...]) -> Array:
    """Covariance of the estimates, Eq. (13): ``cov(k) = (sum A_i' A_i / sigma^2)^-1`` (p, p).

    Args:
        M: Information matrix (p, p).
        parameters: Names (p,), for the error.

    Raises:
        SingularPlanError: M is singular.
    """
    _, inverse, regular = guarded_inverse(M)
    if not regular:
        raise _singular(M, parameters)
    return inverse


def _singular(M: Array, parameters: tuple[str, ...]) -> SingularPlanError:
    """The error that names what a singular M (p, p) leaves open."""
    from criteria.linalg.estimable import open_directions

    # An M that is singular by a hair may have a null space that is empty to rounding: name all.
    named = unidentified(M, parameters) or parameters
    directions = open_directions(M, parameters)
    return SingularPlanError(named, tuple(d for d in directions if d not in parameters))


def estimate(A: Array, measured: Array, sigma: AnyNoise, parameters: tuple[str, ...]) -> Estimate:
    """Fit compliances to deflections by weighted least squares, solved by QR.

    Eq. (6) and (9): ``k = (sum A_i'A_i)^-1 sum A_i' dp_i``, rows weighted by 1/sigma^2.

    Args:
        A: Regressors (m, rows, p) [m/(rad/(N m))].
        measured: Deflections dp (..., m, rows) [m, rad].
        sigma: Noise, one number, one a row (rows,) or one a measurement and row (m, rows) [m, rad];
            or correlated noise.
        parameters: Names (p,).

    Raises:
        SingularPlanError: The regressors do not identify all parameters.
    """
    whitened = Whitened.of(A, sigma, parameters)
    return Estimate(whitened.solve(measured), whitened.covariance, parameters)


@dataclass(frozen=True, eq=False)
class Whitened:
    """Regressors in units of the noise, factored once for any number of fits.

    ``W A = Q R diag(scale)`` with ``Q'Q = I``; W divides by sigma, or makes correlated errors
    independent.

    Attributes:
        Q: Orthonormal columns (m, rows, p).
        R: Upper triangle (p, p) of columns of unit length.
        scale: Length (p,) of each column of W A.
        weight: 1/sigma (m, rows).
        covariance: Eq. (13) (p, p).
        correlated: The noise where its errors are correlated; None where W is `weight`.
    """

    Q: Array
    R: Array
    scale: Array
    weight: Array
    covariance: Array
    correlated: CorrelatedNoise | None = None

    @classmethod
    def of(cls, A: Array, sigma: AnyNoise, parameters: tuple[str, ...]) -> "Whitened":
        """Factor regressors (m, rows, p) and the noise, of sizes that broadcast to (m, rows).

        Raises:
            SingularPlanError: The regressors do not identify all parameters.
        """
        correlated = sigma if isinstance(sigma, CorrelatedNoise) else None
        std = sigma.std if isinstance(sigma, CorrelatedNoise) else np.asarray(sigma, dtype=float)
        weight = 1.0 / np.broadcast_to(std, A.shape[:2])
        whole = A * weight[..., None] if correlated is None else whiten_columns(A, correlated)
        stacked = whole.reshape(-1, A.shape[-1])
        # Called for its error alone: the inverse below comes from the rows, by QR, which does not
        # square the condition number as stacked' stacked does.
        covariance(stacked.T @ stacked, parameters)
        # Columns differ by powers of ten where joints differ in their lever arms.
        scale = np.linalg.norm(stacked, axis=0)
        Q, R = np.linalg.qr(stacked / scale)
        inverse = np.linalg.inv(R) / scale[:, None]
        cov = inverse @ inverse.T
        return cls(Q.reshape(A.shape), R, scale, weight, cov, correlated)

    def in_sigma(self, lengths: Array) -> Array:
        """Deflections or residuals (..., m, rows) in units of the noise, as independent numbers."""
        if self.correlated is None:
            return lengths * self.weight
        return self.correlated.whiten(lengths)

    def project(self, measured: Array) -> Array:
        """``Q' W dp`` (..., p): all that deflections (..., m, rows) say of parameters."""
        y = self.in_sigma(measured).reshape(*measured.shape[:-2], -1)
        return y @ self.Q.reshape(-1, len(self.scale))

    def solve(self, measured: Array) -> Array:
        """Least-squares estimates (..., p) from deflections (..., m, rows)."""
        return np.linalg.solve(self.R, self.project(measured)[..., None])[..., 0] / self.scale

    def residual(self, measured: Array) -> Array:
        """``(I - Q Q') W dp`` (m, rows): what no parameters explain, in units of the noise.

        Args:
            measured: Deflections dp (m, rows).
        """
        z = self.in_sigma(measured)
        return np.asarray(z - self.Q @ np.einsum("mrp,mr->p", self.Q, z))

    def shift(self, rows: Indices, units: Array | None = None) -> tuple[Indices, Array]:
        """A common shift of some measurements, whitened.

        Args:
            rows: The measurements.
            units: What each unit of the shift adds to all measurements (m, rows, c); defaults to a
                unit of each coordinate.

        Returns:
            The measurements (t,) that it shows in, which are more where errors are correlated, and
            its columns (t, rows, c) in them.
        """
        unit = np.eye(self.weight.shape[1]) if units is None else units
        if self.correlated is None:
            own = unit if units is None else unit[rows]
            return rows, self.weight[rows][:, :, None] * own
        company = self.correlated.company(rows)
        own = unit if units is None else unit[company]
        moved = np.isin(company, rows)[:, None, None] * own
        return company, whiten_columns(moved, self.correlated[company])

    def by_reading(self) -> Array:
        """``W' Q`` (m, rows, p): what a unit of each coordinate adds to ``Q' W dp``."""
        if self.correlated is None:
            return self.Q * self.weight[:, :, None]
        return np.moveaxis(self.correlated.adjoint(np.moveaxis(self.Q, -1, 0)), 0, -1)

    def deletable(self, z: Array) -> tuple[Array, Array]:
        """Regressors and residuals from which single measurements can be left out.

        With ``B_i = W_i' Q`` of a measurement's columns W_i, and ``N_i = W_i' W_i``, leaving it out
        lowers the sum of squares by ``d_i' (N_i - B_i B_i')^-1 d_i`` for ``d_i = W_i' z``. That is
        the form which independent measurements have, of ``N_i^-1/2 B_i`` and ``N_i^-1/2 d_i``.

        Args:
            z: Whitened residuals (m, rows).

        Returns:
            These two, (m, rows, p) and (m, rows).
        """
        if self.correlated is None:
            return self.Q, z
        values, vectors = eigenpairs(self.correlated.precision())
        root = (vectors / np.sqrt(values)[:, None]) @ np.swapaxes(vectors, 1, 2)
        return root @ self.by_reading(), (root @ self.correlated.adjoint(z)[..., None])[..., 0]


@dataclass(frozen=True, eq=False)
class LeftOut:
    """A least-squares fit without each group of rows in turn, such as the readings of one pose.

    Weighted rows are ``Q R`` with ``Q'Q = I``, and z are the weighted residuals of the fit of all.
    With ``G_b = Q_b'Q_b`` and ``h_b = Q_b'z_b`` of a group b, the fit without it differs by
    ``-R^-1 u_b``, ``u_b = (I - G_b)^-1 h_b``, which is exact where the model is linear. Rows of the
    covariance V in units of their weights make that of its parameters ``R^-1 C_b R^-T`` with

        C_b = (I - G_b)^-1 (S - S_b) (I - G_b)^-1,   S_b = Q_b' V_b Q_b,   S = sum_b S_b,

    as of any weighted least squares (Huber 1967). What a group alone tells is left aside.

    Attributes:
        u: Shifts (b, p), in the coordinates of Q.
        C: Covariances (b, p, p), in these coordinates.
        S: That of the fit of all (p, p).
        alone: Projectors (b, p, p) on the directions that only the group tells.
        inverse: ``(I - G_b)^-1`` (b, p, p) in all others.
    """

    u: Array
    C: Array
    S: Array
    alone: Array
    inverse: Array

    @classmethod
    def of(cls, G: Array, h: Array, S: Array) -> "LeftOut":
        """Of the groups' sums G (b, p, p), h (b, p) and S (b, p, p)."""
        p = G.shape[-1]
        left = np.eye(p) - G
        alone = np.zeros_like(G)
        # The least eigenvalue is at least one less the trace of G: most groups need none.
        suspects = np.flatnonzero(np.einsum("bpp->b", G) > 1 - NEARLY)
        values, vectors = eigenpairs(left[suspects])
        own = values < ALONE
        alone[suspects] = (vectors * own[:, None]) @ np.swapaxes(vectors, 1, 2)
        inverse = np.linalg.inv(left + alone) - alone
        whole = S.sum(axis=0)
        C = inverse @ (whole - S) @ inverse
        return cls((inverse @ h[..., None])[..., 0], C, whole, alone, inverse)

    def between(self, a: Array, group: Indices) -> Array:
        """Covariances (n, n) of what rows of different groups are off where these are left out.

        With ``a_b = Q_b``, and weights that are those of the errors, what they are off by is
        ``(I - Q_b Q_b')^-1 z_b``, whose covariance is ``-a_b (I - G_b)^-1 S (I - G_c)^-1 a_c'``.

        Args:
            a: Rows (n, p), in the coordinates of Q.
            group: Their groups (n,).
        """
        x = (a[:, None] @ self.inverse[group])[:, 0]
        return np.asarray(-x @ self.S @ x.T)


def share_inside(errors: Array, half: Array) -> float:
    """Share of errors that are within their bands of half the width `half`; NaN do not count."""
    known = np.isfinite(errors)
    return float((np.abs(errors) <= half)[known].mean()) if known.any() else np.nan


def chance_of_outside(share: float, number: float) -> float:
    """Probability that of so many independent coordinates such a share or more is outside.

    It is the binomial tail ``I_0.05(x, n - x + 1)``, by the incomplete beta function for numbers
    that are no integers.

    Args:
        share: Share outside their 95 % bands.
        number: Number of independent coordinates.
    """
    from scipy.special import betainc

    count = share * number
    if count <= OUTSIDE * number:
        return 1.0
    return float(betainc(count, number - count + 1, OUTSIDE))


def independent_coordinates(covariance: Array, seen: Mask, scaled: bool) -> float:
    """As many independent coordinates have shares inside that vary as much.

    Whether a normal number is beyond its bounds is a sum of Hermite polynomials of even order, so
    that of two numbers with the correlation c the covariance is ``sum_k a_k^2 c^k``, k = 2, 4 ...;
    here it is bounded by that of order two and ``c^4`` for the rest. The number is that of all
    coordinates over the mean over them of the sums of these, as a share of their own variance
    (Rao and Scott 1981). Errors of different poses count as independent.

    Where the size of the errors was fitted to themselves, their mean square is what the bands say:
    the sum of all polynomials of order two, ``z^2 - 1``, is none, and that order drops out.

    Args:
        covariance: Of the coordinates of each pose (m, r, r).
        seen: Which of them (m, r) were measured.
        scaled: Whether the size of the errors was fitted.
    """
    variance = np.einsum("mrr->mr", covariance)
    root = np.sqrt(np.where(seen & (variance > 0), variance, np.inf))
    total = alike(covariance / root[:, :, None] / root[:, None], scaled)
    return float(seen.sum()) ** 2 / total if total > 0 else 0.0


def alike(correlations: Array, scaled: bool) -> float:
    """Sum over pairs of coordinates of the covariances of being outside, see above."""
    squares = correlations**2
    second = 0.0 if scaled else OF_SQUARE
    return float((second * squares + (1 - OF_SQUARE) * squares**2).sum())
