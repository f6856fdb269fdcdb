"""The linear least-squares fit that everything in this room starts from, and its covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from criteria.linalg.inverse import guarded_inverse
from edtk.system.presented import Presented
from edtk.system.typing import Array


class SingularPlanError(ValueError):
    """A plan cannot identify all parameters.

    Attributes:
        parameters: Names of the parameters that the plan cannot tell apart or does not excite.
        directions: Combinations of several parameters, like "k2 - 0.5 k3", about which the plan
            says nothing; single parameters are not repeated here.
    """

    def __init__(self, parameters: tuple[str, ...], directions: tuple[str, ...] = ()) -> None:
        super().__init__(parameters, directions)
        self.parameters = parameters
        self.directions = directions

    def __str__(self) -> str:
        text = (
            f"the plan cannot identify all parameters: {', '.join(self.parameters)} "
            "cannot be told from its measurements"
        )
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


def unidentified(M: Array, parameters: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the parameters that take part in a direction which M (p, p) does not excite."""
    # SciPy's linear algebra takes long to import; only an error needs it.
    from criteria.linalg.null_space import null_space

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
    from criteria.linalg.null_space import open_directions

    # An M that is singular by a hair may have a null space that is empty to rounding: name all.
    named = unidentified(M, parameters) or parameters
    directions = open_directions(M, parameters)
    return SingularPlanError(named, tuple(d for d in directions if d not in parameters))


def estimate(A: Array, measured: Array, sigma: ArrayLike, parameters: tuple[str, ...]) -> Estimate:
    """Fit compliances to deflections by weighted least squares, solved by QR.

    Eq. (6) and (9): ``k = (sum A_i'A_i)^-1 sum A_i' dp_i``, rows weighted by 1/sigma^2.

    Args:
        A: Regressors (m, rows, p) [m/(rad/(N m))].
        measured: Deflections dp (..., m, rows) [m, rad].
        sigma: Noise, one number, one a row (rows,) or one a measurement and row (m, rows) [m, rad].
        parameters: Names (p,).

    Raises:
        SingularPlanError: The regressors do not identify all parameters.
    """
    whitened = Whitened.of(A, sigma, parameters)
    return Estimate(whitened.solve(measured), whitened.covariance, parameters)


@dataclass(frozen=True, eq=False)
class Whitened:
    """Regressors in units of the noise, factored once for any number of fits.

    ``A / sigma = Q R diag(scale)`` with ``Q'Q = I``.

    Attributes:
        Q: Orthonormal columns (m, rows, p).
        R: Upper triangle (p, p) of columns of unit length.
        scale: Length (p,) of each column of A/sigma.
        weight: 1/sigma (m, rows).
        covariance: Eq. (13) (p, p).
    """

    Q: Array
    R: Array
    scale: Array
    weight: Array
    covariance: Array

    @classmethod
    def of(cls, A: Array, sigma: ArrayLike, parameters: tuple[str, ...]) -> "Whitened":
        """Factor regressors (m, rows, p) with noise that broadcasts to (m, rows).

        Raises:
            SingularPlanError: The regressors do not identify all parameters.
        """
        weight = 1.0 / np.broadcast_to(np.asarray(sigma, dtype=float), A.shape[:2])
        stacked = (A * weight[..., None]).reshape(-1, A.shape[-1])
        # Called for its error alone: the inverse below comes from the rows, by QR, which does not
        # square the condition number as stacked' stacked does.
        covariance(stacked.T @ stacked, parameters)
        # Columns differ by powers of ten where joints differ in their lever arms.
        scale = np.linalg.norm(stacked, axis=0)
        Q, R = np.linalg.qr(stacked / scale)
        inverse = np.linalg.inv(R) / scale[:, None]
        return cls(Q.reshape(A.shape), R, scale, weight, inverse @ inverse.T)

    def project(self, measured: Array) -> Array:
        """``Q' (dp / sigma)`` (..., p): all that deflections (..., m, rows) say of parameters."""
        y = (measured * self.weight).reshape(*measured.shape[:-2], -1)
        return y @ self.Q.reshape(-1, len(self.scale))

    def solve(self, measured: Array) -> Array:
        """Least-squares estimates (..., p) from deflections (..., m, rows)."""
        return np.linalg.solve(self.R, self.project(measured)[..., None])[..., 0] / self.scale

    def residual(self, measured: Array) -> Array:
        """``(I - Q Q') (dp / sigma)`` (m, rows): what no parameters explain, in units of the noise.

        Args:
            measured: Deflections dp (m, rows).
        """
        z = measured * self.weight
        return np.asarray(z - self.Q @ np.einsum("mrp,mr->p", self.Q, z))
