"""Tails and quantiles that tests and intervals need, and how large errors of compensations may be.

They are those of `scipy.stats`, to the last digit: the same special functions without that module's
import, which takes longer than most commands, and without its checks, which take longer than a fit.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from criteria.linalg.inverse import eigenpairs
from edtk.measure.expected_error import TaskAccuracy, compensation_accuracy
from edtk.measure.task import Tasks
from edtk.system.typing import Array

CERTAIN = 1e8  # noncentrality at which no threshold of a test is missed
# Nodes of the quadrature along Talbot's contour. Its error is of the order 3.9^-NODES, and its
# rounding some 60 times that of a double: more nodes would only add rounding.
NODES = 24
# Nodes of the quadrature over an estimated noise, by its degrees of freedom.
SMOOTH_DOF = 3
LEGENDRE_NODES = 256
HERMITE_NODES = 48
# The quantiles of 2.5 and 97.5 % are then off by up to 6e-3 and 1e-3 of themselves.
POINTS = 2**14
BAND = (0.025, 0.975)  # between these probabilities lie 95 % of the errors


def chi_square_tail(x: ArrayLike, dof: ArrayLike) -> Array:
    """Probability that a chi-square with `dof` > 0 degrees of freedom is larger than x."""
    from scipy.special import chdtrc

    return np.asarray(chdtrc(dof, x))


def chi_square_quantile(probability: ArrayLike, dof: ArrayLike) -> Array:
    """The x that a chi-square with `dof` > 0 degrees of freedom is below with a probability."""
    from scipy.special import gammaincinv

    return np.asarray(2 * gammaincinv(np.asarray(dof) / 2, probability))


def noncentral_chi_square_tail(x: float, dof: float, noncentrality: float) -> float:
    """Probability that a noncentral chi-square is larger than x."""
    from scipy.special import chndtr

    # The function has no value from about 1e16 on, where chances have long been one.
    return float(1 - chndtr(x, dof, min(noncentrality, CERTAIN)))


def fisher_tail(x: ArrayLike, numerator_dof: ArrayLike, denominator_dof: ArrayLike) -> Array:
    """Probability that a variable with Fisher's F distribution is larger than x >= 0."""
    from scipy.special import fdtrc

    return np.asarray(fdtrc(numerator_dof, denominator_dof, x))


def fisher_quantile(
    probability: ArrayLike, numerator_dof: ArrayLike, denominator_dof: ArrayLike
) -> Array:
    """The x that a variable with Fisher's F distribution is below with a probability."""
    from scipy.special import fdtri

    return np.asarray(fdtri(numerator_dof, denominator_dof, probability))


def student_quantile(probability: ArrayLike, dof: ArrayLike) -> Array:
    """The x that Student's t is below with a probability; that of a normal for infinite `dof`."""
    from scipy.special import stdtrit

    return np.asarray(stdtrit(dof, probability))


def student_below(x: ArrayLike, dof: ArrayLike) -> Array:
    """Probability that Student's t is below x; that of a normal variable for infinite `dof`."""
    from scipy.special import stdtr

    return np.asarray(stdtr(dof, x))


def log_normal_below(x: ArrayLike) -> Array:
    """Logarithm of the probability that a standard normal variable is below x."""
    from scipy.special import log_ndtr

    return np.asarray(log_ndtr(x))


def poisson_tail(count: ArrayLike, mean: ArrayLike) -> Array:
    """Probability that a Poisson variable is larger than a count of at least zero."""
    from scipy.special import pdtrc

    return np.asarray(pdtrc(count, mean))


def weighted_chi_square_cdf(x: ArrayLike, weights: ArrayLike) -> Array:
    """Probability ``P(sum_i l_i z_i^2 <= x)`` with independent standard normal z.

    The Laplace transform of the distribution function is ``prod_i (1 + 2 l_i s)^(-1/2) / s``. Its
    singularities all lie on the negative real axis and in 0, so that Talbot's contour around them
    inverts it with geometric convergence, whatever the weights; the contour is that of Trefethen,
    Weideman and Schmelzer, BIT 46 (2006) 653, Eq. (3.2).

    Args:
        x: Where to evaluate (...,), above zero.
        weights: The weights l (..., r), not negative and not all zero.

    Returns:
        Probabilities (...).
    """
    x = np.asarray(x, dtype=float)
    weights = np.asarray(weights, dtype=float)
    # Half of the contour: the other half is its complex conjugate.
    angle = (2 * np.arange(NODES // 2) + 1) * np.pi / NODES
    c = 0.6407 * angle
    z = NODES * (-0.6122 + 0.5017 * angle / np.tan(c) + 0.2645j * angle)
    dz = NODES * (0.5017 / np.tan(c) - 0.5017 * c / np.sin(c) ** 2 + 0.2645j)
    factors = np.sqrt(1 + 2 * (weights / x[..., None])[..., None, :] * z[:, None]).prod(axis=-1)
    total = (np.exp(z) / (factors * z) * dz).sum(axis=-1)
    return np.clip(2 * total.imag / NODES, 0.0, 1.0)


def error_quantiles(A: Array, cov: Array, levels: ArrayLike, dof: float = np.inf) -> Array:
    """Quantiles of ``|A dk|`` for errors dk with that covariance.

    ``|A dk|^2 = sum_i l_i z_i^2 / s`` with the eigenvalues l of ``A cov A'``, where s is one for
    normal dk, and chi-square over its degrees of freedom, independent of z, for Student's t. The
    quantile lies between those of ``l_1 z_1^2 / s`` and of ``l_1 (z_1^2 + ... + z_r^2) / s``, l_1
    being the largest, where Brent's method finds it.

    Args:
        A: Regressors (..., rows, p) of the task poses [m/(rad/(N m))].
        cov: Covariance (p, p) of the compliances; if dof is finite, the estimated one.
        levels: Probabilities (c,) strictly between 0 and 1.
        dof: Degrees of freedom of the covariance; inf where sigma is known.

    Returns:
        Quantiles (..., c) [m].
    """
    return _centred_quantiles(A @ cov @ np.swapaxes(A, -1, -2), levels, dof)


def _centred_quantiles(V: Array, levels: ArrayLike, dof: float) -> Array:
    """Quantiles (..., c) of the lengths of errors with covariances V (..., rows, rows)."""
    levels = np.asarray(levels, dtype=float)
    spectrum = np.maximum(np.linalg.eigvalsh(V), 0.0)
    found = np.zeros((*spectrum.shape[:-1], len(levels)))
    scatter = _Scatter(dof, *_estimated(dof))
    for i in np.ndindex(*spectrum.shape[:-1]):
        largest = spectrum[i].max()
        if largest > 0:
            weights = spectrum[i] / largest
            found[i] = [np.sqrt(largest * _quantile(weights, level, scatter)) for level in levels]
    return found


@dataclass(frozen=True, eq=False)
class _Scatter:
    """The noise over its estimate, squared: s of the docstring above.

    Attributes:
        dof: Degrees of freedom of the estimate; inf where the noise is known.
        scales: Values (n,) of s.
        shares: Their probabilities (n,).
    """

    dof: float
    scales: Array
    shares: Array

    def quantile(self, level: float, n: int) -> float:
        """Quantile of ``(z_1^2 + ... + z_n^2) / s``."""
        if np.isinf(self.dof):
            return float(chi_square_quantile(level, n))
        return float(n * fisher_quantile(level, n, self.dof))


@cache
def _estimated(dof: float) -> tuple[Array, Array]:
    """Nodes (n,) and probabilities (n,) of chi-square over its degrees of freedom.

    As a function of the normal variable of the same rank it is smooth, as Gauss-Hermite quadrature
    wants it. With fewer than three degrees its tails are too heavy for that; then the rule is that
    of Gauss and Legendre over the probability.
    """
    if np.isinf(dof):
        return np.ones(1), np.ones(1)
    from scipy.special import chdtri, ndtr

    if dof < SMOOTH_DOF:
        z, share = np.polynomial.legendre.leggauss(LEGENDRE_NODES)
        return chi_square_quantile((1 + z) / 2, dof) / dof, share / 2
    z, share = np.polynomial.hermite_e.hermegauss(HERMITE_NODES)
    # Each half by its own tail: probabilities near one have no digits left.
    lower = chi_square_quantile(ndtr(z), dof)
    upper = chdtri(dof, ndtr(-z))
    quantiles = np.where(z < 0, lower, upper)
    return quantiles / dof, share / share.sum()


def _quantile(weights: Array, level: float, scatter: _Scatter) -> float:
    """The quantile of ``sum_i l_i z_i^2 / s`` for weights l (r,) whose largest is one."""
    from scipy.optimize import brentq

    low = scatter.quantile(level, 1)
    high = scatter.quantile(level, len(weights))

    def excess(x: float) -> float:
        probabilities = weighted_chi_square_cdf(x * scatter.scales, weights)
        return float(scatter.shares @ probabilities) - level

    # With a single weight that counts the quantile is an end of the bracket, which rounding may
    # exclude.
    if excess(low) >= 0:
        return low
    if excess(high) <= 0:
        return high
    return float(brentq(excess, low, high, xtol=1e-300, rtol=1e-12))


def _quantiles_about(mean: Array, V: Array, levels: ArrayLike, dof: float) -> Array:
    """Quantiles (t, c) of the lengths of errors with means (t, rows) and covariances V.

    Without an offset they are those of `error_quantiles`, exactly. With one, the Laplace transform
    has essential singularities where that one has branch points, and its inversion loses all digits
    for large offsets. So the distribution is that of a fixed, evenly spread set of points: a
    lattice in the unit cube (Roberts' generalised golden ratio), mapped to normal variables along
    the axes of V, and to a chi-square for the estimated noise. Where V has equal eigenvalues
    rounding chooses the axes, and with them the last of three digits.

    Args:
        mean: Offsets (t, rows) [m].
        V: Covariances (t, rows, rows); if dof is finite, the estimated ones [m^2].
        levels: Probabilities (c,) strictly between 0 and 1.
        dof: Degrees of freedom of the covariances; inf where sigma is known.
    """
    from scipy.special import ndtri

    levels = np.asarray(levels, dtype=float)
    found = np.zeros((len(V), len(levels)))
    offset = mean.any(axis=-1)
    found[~offset] = _centred_quantiles(V[~offset], levels, dof)
    rows = V.shape[1]
    points = _lattice(rows + 1)
    z = ndtri(points[:, :rows])
    if np.isfinite(dof):
        z /= np.sqrt(chi_square_quantile(points[:, rows:], dof) / dof)
    spectrum, axes = eigenpairs(V)
    for i in np.flatnonzero(offset):
        along = z * np.sqrt(np.maximum(spectrum[i], 0.0)) + mean[i] @ axes[i]
        found[i] = np.quantile(np.linalg.norm(along, axis=1), levels)
    return found


@dataclass(frozen=True, eq=False)
class NormalMixture:
    """Errors of several places that are normal, with one of several means and covariances.

    Attributes:
        weights: Probabilities (s,) of these.
        mean: Means (s, t, r) of the errors in t places [m].
        covariance: Their covariances (s, t, r, r) [m^2].
        dof: Degrees of freedom by which the covariances are known; inf where they are.
    """

    weights: Array
    mean: Array
    covariance: Array
    dof: float = np.inf

    @classmethod
    def single(cls, mean: Array, covariance: Array, dof: float = np.inf) -> "NormalMixture":
        """Errors with one mean (t, r) and covariance (t, r, r) each."""
        return cls(np.ones(1), mean[None], covariance[None], dof)

    def plus(self, covariance: Array, mean: Array | None = None) -> "NormalMixture":
        """The same with independent errors (t, r, r) besides, and an offset (t, r)."""
        shifted = self.mean if mean is None else self.mean + mean
        return replace(self, mean=shifted, covariance=self.covariance + covariance)

    def among(self, rows: slice) -> "NormalMixture":
        """The same of some of the coordinates."""
        mean, covariance = self.mean[..., rows], self.covariance[..., rows, rows]
        return replace(self, mean=mean, covariance=covariance)

    @property
    def sizes(self) -> Array:
        """Root mean squares (s, t) of the errors [m]."""
        squares = np.square(self.mean).sum(axis=-1)
        return np.asarray(np.sqrt(squares + np.einsum("strr->st", self.covariance)))

    @property
    def size(self) -> Array:
        """Root mean squares (t,) that half of the probability is below [m].

        A mean over all would be that of the few that are improbable and large.
        """
        return weighted_median(self.sizes, self.weights)

    def quantiles(self, levels: ArrayLike) -> Array:
        """Quantiles (t, c) of the lengths of the errors [m]; of one covariance almost exact."""
        if len(self.weights) == 1:
            return _quantiles_about(self.mean[0], self.covariance[0], levels, self.dof)
        levels = np.asarray(levels, dtype=float)
        found = np.empty((self.mean.shape[1], len(levels)))
        for t in range(len(found)):
            length, share = self._lengths(t)
            order = np.argsort(length)
            below = np.cumsum(share[order]) - 0.5 * share[order]
            found[t] = np.interp(levels, below, length[order])
        return found

    def beyond(self, sizes: Array) -> Array:
        """Probabilities (t,) of errors that are longer than some lengths (t,) [m]."""
        pairs = ((self._lengths(t), size) for t, size in enumerate(sizes))
        return np.array([float(share[length > size].sum()) for (length, share), size in pairs])

    def _lengths(self, t: int) -> tuple[Array, Array]:
        """Lengths of a fixed, evenly spread set of errors in a place, and their shares."""
        from scipy.special import ndtri

        rows = self.mean.shape[-1]
        points = _lattice(rows + 1)[: POINTS // len(self.weights)]
        z = ndtri(points[:, :rows])
        if np.isfinite(self.dof):
            z = z / np.sqrt(chi_square_quantile(points[:, rows:], self.dof) / self.dof)
        spectrum, axes = eigenpairs(self.covariance[:, t])
        roots = axes * np.sqrt(np.maximum(spectrum, 0.0))[:, None]
        errors = self.mean[:, t, None] + np.einsum("sri,ni->snr", roots, z)
        share = np.repeat(self.weights / len(z), len(z))
        return np.linalg.norm(errors, axis=-1).ravel(), share


def weighted_median(values: Array, weights: Array) -> Array:
    """Values (...) that half of the weights (s,) are below, of values (s, ...)."""
    flat = values.reshape(len(values), -1)
    order = np.argsort(flat, axis=0)
    below = np.cumsum(weights[order], axis=0)
    at = (below < 0.5 * below[-1]).sum(axis=0)
    found = np.take_along_axis(flat, np.take_along_axis(order, at[None], axis=0), axis=0)
    return np.asarray(found[0].reshape(values.shape[1:]))


def _lattice(dimension: int) -> Array:
    """Points (POINTS, dimension) that fill the open unit cube evenly."""
    # The generalised golden ratio is the root of g^(d+1) = g + 1.
    ratio = 2.0
    for _ in range(64):
        ratio = (1 + ratio) ** (1 / (dimension + 1))
    steps = ratio ** -np.arange(1, dimension + 1)
    return (0.5 + np.arange(1, POINTS + 1)[:, None] * steps) % 1.0


def task_accuracy(
    tasks: Tasks,
    cov: Array,
    before: Array | None = None,
    dof: float = np.inf,
    is_path: bool = False,
) -> TaskAccuracy:
    """Find the error to expect in each pose of the tasks.

    Args:
        tasks: The poses, with their tools and loads.
        cov: Covariance (p, p) of the compliances.
        before: Displacement (t,) in each without compensation [m]; None if it is not known.
        dof: Degrees of freedom of the covariance; inf where sigma is known.
        is_path: Whether the poses follow each other along a path.
    """
    harms = [task.harm(task.q) for task in tasks]
    points = np.array([task.point for task in tasks])
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return TaskAccuracy(
        along=np.append(0.0, np.cumsum(steps)),
        weight=np.array([task.weight for task in tasks]),
        error=np.array([float(compensation_accuracy(A, cov)) for A in harms]),
        band=np.array([error_quantiles(A, cov, BAND, dof) for A in harms]),
        before=before,
        is_path=is_path,
    )
