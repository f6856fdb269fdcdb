"""Whether repetitions agree, measurements that do not belong to the others, and a wary fit."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from criteria.linalg.inverse import eigenpairs
from edtk.fit.correlated_noise import CorrelatedNoise
from edtk.fit.distributions import chi_square_tail, fisher_tail
from edtk.fit.least_squares import SingularPlanError, Whitened
from edtk.system.typing import Array, Indices

UNLIKELY = 0.01  # probability below which so large an F is no chance
# Probability of flagging anything at all in data without outliers.
LEVEL = 0.01
# A row whose leverages sum to more may alone determine a parameter: I - H_i is then near singular.
NEARLY_ALONE = 0.99
# Eigenvalues of I - H_i below this are zeros: the fit runs through that coordinate.
DETERMINED = 1e-9
# Outliers that are looked at one by one; more are a matter of the noise or the model.
MOST_OUTLIERS = 20


@dataclass(frozen=True)
class HuberSteps:
    """How Huber's estimate is found: fit and scale in turn."""

    # Fit and scale in turn. Of 300 random fits half settled within 6 rounds and all but 7 within
    # 14; those still changed after 20, by 0.3 % at most.
    rounds: int = 20
    tolerance: float = 1e-6
    # Steps of one fit: half a dozen is the rule, more where few residuals are within the corner.
    most_steps: int = 1000
    step_tolerance: float = 1e-9  # of the corner, in orthonormal coordinates
    step_rounding: float = 1e-14  # of the parameters, in orthonormal coordinates
    loss_rounding: float = 1e-13  # of the loss, a sum over all rows
    singular: float = 1e-9  # least eigenvalue of a curvature up to which Newton's step is not taken
    block: int = 2**14  # rows at a time


HUBER = HuberSteps()


@dataclass(frozen=True)
class LackOfFit:
    """Pure error against lack of fit.

    Attributes:
        F: Mean square of the groups' means about the model, over that of repetitions about their
            means.
        p: Probability of so large an F where the model fits and errors are independent.
        pure_error: Standard deviation of repetitions about their mean, over the stated sigma.
        common: Standard deviation of what repetitions have in common and the model does not
            explain, over the stated sigma; 0 where F is below one.
        dof: Degrees of freedom of the groups' means, and of the pure error.
        repetitions: How many readings a group has; the effective number of unequal groups.
    """

    F: float
    p: float
    pure_error: float
    common: float
    dof: tuple[int, int]
    repetitions: float = 1.0

    @property
    def seen(self) -> bool:
        """Whether repetitions agree better than the model fits, by more than chance."""
        return self.p < UNLIKELY

    def to_dict(self) -> dict[str, float]:
        """F and its probability, for JSON."""
        return {"F": self.F, "p": self.p}


def lack_of_fit(z: Array, group: Indices, parameters: int) -> LackOfFit | None:
    """Test whether repetitions scatter as much as the model is off.

    The sum of squares of residuals splits into that of repetitions about their group's mean,
    with ``N - G r`` degrees of freedom for G groups of r coordinates, and that of the means, with
    ``G r - p``; the ratio of mean squares has Fisher's distribution. Errors that all repetitions of
    a pose have in common, with a variance t^2 beside the s^2 of each, make the mean square of the
    means ``s^2 + n t^2`` for n repetitions.

    Args:
        z: Residuals (m, rows) in units of sigma.
        group: Number (m,) of each row's group of repetitions, from 0.
        parameters: Number p of fitted parameters.

    Returns:
        The test; None without repetitions, or if the means are as many as the parameters.
    """
    groups = int(group.max()) + 1
    rows = z.shape[1]
    count = np.bincount(group)
    pure_dof = z.size - groups * rows
    means_dof = groups * rows - parameters
    if pure_dof < 1 or means_dof < 1:
        return None
    mean = np.stack([np.bincount(group, column) / count for column in z.T], axis=1)
    within = float(((z - mean[group]) ** 2).sum())
    between = float((count[:, None] * mean**2).sum())
    if within == 0:
        return None
    pure = within / pure_dof
    F = between / means_dof / pure
    # The effective number of repetitions of unequal groups, as in the analysis of variance.
    repetitions = (count.sum() - (count**2).sum() / count.sum()) / max(groups - 1, 1)
    common = max(between / means_dof - pure, 0.0) / max(repetitions, 1.0)
    return LackOfFit(
        F=float(F),
        p=float(fisher_tail(F, means_dof, pure_dof)),
        pure_error=float(np.sqrt(pure)),
        common=float(np.sqrt(common)),
        dof=(means_dof, pure_dof),
        repetitions=max(float(repetitions), 1.0),
    )


def find_outliers(
    Q: Array, z: Array, dof: float, scale: float | None = None, total: float | None = None
) -> Indices:
    """Find rows (measurements of one marker, all coordinates together) that are outliers at 1 %.

    With ``H_i = Q_i Q_i'`` the block of the hat matrix, ``T_i = z_i' (I - H_i)^-1 z_i`` is the drop
    of the sum of squares S when row i is left out. Externally studentised, against the scatter of
    the others, ``(T_i / r) / ((S - T_i) / (dof - r))`` has the F distribution with (r, dof - r)
    degrees of freedom, where r is the number of coordinates in the row. Row i is flagged where that
    is exceeded with a probability below 0.01/m (Bonferroni). So it does not matter whether sigma is
    believed; but several outliers can hide each other.

    With a robust scale given, ``T_i / (r scale^2)`` is compared with F(r, dof), or chi-square where
    dof is infinite, and outliers cannot hide each other; the level is approximate then, as
    residuals of a robust fit are not quite those of least squares (simulated: 3 % for 1 %).

    Args:
        Q: Orthonormal regressors (m, rows, p).
        z: Residuals in units of the given noise (m, rows).
        dof: Degrees of freedom of the fit, or of the scale.
        scale: A scale that outliers do not spoil; None for that of the other rows.
        total: The sum of squares S; None for that of z. It is another one where errors are
            correlated, see `Whitened.deletable`.

    Returns:
        Indices of the rows, counted from 0.
    """
    T, r = _deletion(Q, z)
    if scale is not None and np.isinf(dof):
        squares = T / max(scale, np.finfo(float).tiny) ** 2
        p = np.where(r > 0, chi_square_tail(squares, np.maximum(r, 1)), 1.0)
    else:
        p = _studentised(T, r, (z**2).sum() if total is None else total, dof, scale)
    return np.flatnonzero(p < LEVEL / len(T))


def _studentised(T: Array, r: Indices, total: float, dof: float, scale: float | None) -> Array:
    """Probability (m,) of a larger T_i under Fisher's law; one where nothing can be compared."""
    rest = dof - r if scale is None else np.full(len(r), dof)
    able = (rest > 0) & (r > 0)
    numerator_dof = np.where(able, r, 1)
    denominator_dof = np.where(able, rest, 1)
    spread = (total - T) / denominator_dof if scale is None else np.full(len(r), scale**2)
    least = 1e-20 * total + np.finfo(float).tiny  # where one row is all that scatters
    ratio = T / numerator_dof / np.maximum(spread, least)
    return np.where(able, fisher_tail(ratio, numerator_dof, denominator_dof), 1.0)


def _deletion(Q: Array, z: Array) -> tuple[Array, Indices]:
    """T_i (m,) and its degrees of freedom (m,): fewer than rows where row i alone fixes parameters.

    A row that alone tells of some parameter has an I - H_i that is singular: only the coordinates
    that other rows tell of too can be tested, in its eigenvectors.
    """
    hat = Q @ np.swapaxes(Q, 1, 2)
    keep = np.eye(z.shape[1]) - hat
    rank = np.full(len(z), z.shape[1])
    T = np.zeros(len(z))
    alone = np.trace(hat, axis1=1, axis2=2) > NEARLY_ALONE
    solved = np.linalg.solve(keep[~alone], z[~alone, :, None])[..., 0]
    T[~alone] = (z[~alone] * solved).sum(axis=1)
    if alone.any():
        w, V = eigenpairs(keep[alone])
        tested = w > DETERMINED
        component = np.einsum("mrs,mr->ms", V, z[alone])
        squares = np.where(tested, component**2 / np.where(tested, w, 1.0), 0.0)
        T[alone] = squares.sum(axis=1)
        rank[alone] = tested.sum(axis=1)
    return T, rank


def own_outliers(
    A: Array,
    measured: Array,
    noise: CorrelatedNoise,
    parameters: tuple[str, ...],
    found: Indices,
) -> Indices:
    """Of the outliers of a fit with correlated noise, those that are no others' neighbours.

    Readings of a visit tell each other's errors. Where one is off, the others seem to be off as
    well, each of which could be left out to make the rest agree better. So each is tested once more
    beside readings that are no outliers alone.

    Args:
        A: Regressors (m, rows, p) [m/(rad/(N m))].
        measured: Deflections (m, rows) [m, rad].
        noise: Their noise.
        parameters: Names (p,).
        found: Rows that are outliers with all others there.

    Returns:
        Those of these rows; all of them where none is an outlier without the others.
    """
    if not 1 < len(found) <= MOST_OUTLIERS:
        return found
    others = np.setdiff1d(np.arange(len(A)), found)
    own = []
    for row in found:
        rows = np.sort(np.append(others, row))
        try:
            whitened = Whitened.of(A[rows], noise[rows], parameters)
        except SingularPlanError:
            return found
        z = whitened.residual(measured[rows])
        dof = z.size - A.shape[-1]
        again = find_outliers(*whitened.deletable(z), dof, total=float((z**2).sum()))
        if row in rows[again]:
            own.append(row)
    return np.array(own) if own else found


# In standard deviations of the noise: 95 % efficient for normal errors (Huber 1981).
CORNER = 1.345
# Median absolute value of a standard normal variable, inverted.
MAD_TO_STD = 1.4826
# Residuals below this share of the largest measurement are rounding, and no noise.
NO_NOISE = 1e-11


class SigmaTooSmallError(ValueError):
    """No residual is as small as the noise that is believed."""


@dataclass(frozen=True, eq=False)
class HuberFit:
    """A robust fit.

    Attributes:
        x: Parameters (p,).
        scale: Standard deviation of the bulk of the residuals: 1.4826 times their median absolute
            value, times sqrt(N / (N - p)).
        inflation: The covariance of x is this times (X'X)^-1.
    """

    x: Array
    scale: float
    inflation: float


def fit_huber(
    Q: Array, R: Array, y: Array, start: Array, known: bool, least: float = -np.inf
) -> HuberFit:
    """Fit parameters that a few gross errors do not spoil.

    Minimises ``sum rho(y - X x)``, ``X = Q R``, with ``rho(r) = r^2/2`` for ``|r| <= c`` and
    ``c |r| - c^2/2`` beyond. The covariance is that of an M-estimator of regression (Huber 1981,
    Section 7.6) with ``psi = rho'``: ``K^2 [sum psi^2 / (N - p)] / mean(psi')^2 (X'X)^-1`` with
    ``K = 1 + p/N (1 - mean psi') / mean psi'``. It holds for independent errors of one symmetric
    distribution, whose tails are taken from the residuals.

    Args:
        Q: Orthonormal columns (m, rows, p).
        R: Upper triangle (p, p), which makes the columns X of about unit length, in units of the
            noise.
        y: Measured (m, rows), in units of the noise; N = m rows > p.
        start: Where to begin (p,), the least-squares estimate.
        known: Whether the noise of y is of size one; else its size is estimated along with x.
        least: Lower bound of every parameter.

    Raises:
        SigmaTooSmallError: The size of the noise is known, and no residual is below the corner.
    """
    data = _Data(Q.reshape(-1, len(R)), R, y.ravel())
    p = len(R)
    x = np.maximum(start, least)
    scale = _scale(data.residuals(x), p)
    for _ in range(1 if known else HUBER.rounds):
        size = 1.0 if known else scale
        if size <= NO_NOISE * np.abs(data.y).max():
            # Half of the residuals are rounding: the corner would be zero, and psi without a slope.
            return HuberFit(x, scale, 1.0 if known else scale**2)
        corner = CORNER * size
        x = _minimise(data, x, corner, least)
        residuals = data.residuals(x)
        before = scale
        scale = _scale(residuals, p)
        if abs(scale - before) <= HUBER.tolerance * before:
            break
    return HuberFit(x, scale, _inflation(residuals, p, corner))


def huber_weights(z: Array, scale: float) -> Array:
    """Weights of residuals z, of noise of size `scale`, by which least squares has the same fit."""
    corner = CORNER * scale
    return np.asarray(corner / np.maximum(np.abs(z), corner))


@dataclass(frozen=True, eq=False)
class _Data:
    """Columns ``X = Q R`` and what is to be fitted with them.

    Attributes:
        Q: Orthonormal columns (N, p).
        R: Upper triangle (p, p).
        y: Measured (N,).
    """

    Q: Array
    R: Array
    y: Array

    def residuals(self, x: Array) -> Array:
        """Residuals ``y - X x`` (N,)."""
        return self.y - self.Q @ (self.R @ x)

    def blocks(self) -> Iterator[tuple[Array, Array]]:
        """Q and y, so many rows at a time that their residuals stay in the cache."""
        for first in range(0, len(self.y), HUBER.block):
            rows = slice(first, first + HUBER.block)
            yield self.Q[rows], self.y[rows]


@dataclass(frozen=True, eq=False)
class _Local:
    """The loss about some parameters, in the orthonormal coordinates ``z = R x``.

    Attributes:
        loss: ``sum rho(r)``.
        slope: ``Q' psi(r)`` (p,), the direction in which the loss falls.
        curvature: ``sum psi'(r) Q Q'`` (p, p).
    """

    loss: float
    slope: Array
    curvature: Array


def _minimise(data: _Data, start: Array, corner: float, least: float) -> Array:
    """The parameters (p,) of the least loss; on the bound exactly where they are on it.

    The loss is quadratic but for residuals that cross the corner, so that Newton's method ends
    after a few steps, exactly. A step that does not lower the loss is replaced by one of
    reweighted least squares, which always does: its quadratic lies above the loss.
    """
    x = start
    here = _local(data, x, corner)
    for _ in range(HUBER.most_steps):
        lower = _lowered(data, x, here, here.curvature, corner, least)
        if lower is None:
            majorant = _majorant(data, x, corner)
            lower = _lowered(data, x, here, majorant, corner, least)
        if lower is None:
            return x
        before = x
        x, here = lower
        if _settled(data.R, before, x, corner):
            return x
    return x


def _lowered(
    data: _Data, x: Array, here: _Local, curvature: Array, corner: float, least: float
) -> tuple[Array, _Local] | None:
    """The minimiser (p,) of a quadratic about x, and the loss there; None if that is not lower."""
    moved = _stepped(data.R, x, here.slope, curvature, least)
    if moved is None:
        return None
    there = _local(data, moved, corner)
    # Near the minimum a step may lower the loss by less than the rounding of its sum.
    return (moved, there) if there.loss <= here.loss * (1 + HUBER.loss_rounding) else None


def _settled(R: Array, x: Array, moved: Array, corner: float) -> bool:
    """Whether a step is rounding: in orthonormal coordinates noise has the size of the corner."""
    step = np.abs(R @ (moved - x)).max()
    return bool(step <= HUBER.step_tolerance * corner + HUBER.step_rounding * np.abs(R @ x).max())


def _local(data: _Data, x: Array, corner: float) -> _Local:
    """Loss, slope and curvature about some parameters, in one pass over the rows."""
    z = data.R @ x
    loss = 0.0
    slope = np.zeros(len(z))
    curvature = np.eye(len(z))
    for Q, y in data.blocks():
        r = y - Q @ z
        psi = np.clip(r, -corner, corner)
        loss += float(psi @ (r - 0.5 * psi))
        slope += psi @ Q
        # Few residuals are beyond the corner: their share is subtracted from Q'Q = I.
        beyond = Q[np.abs(r) > corner]
        curvature -= beyond.T @ beyond
    return _Local(loss, slope, curvature)


def _majorant(data: _Data, x: Array, corner: float) -> Array:
    """``Q' diag(psi(r)/r) Q`` (p, p): the quadratic of reweighted least squares."""
    z = data.R @ x
    total = np.zeros((len(z), len(z)))
    for Q, y in data.blocks():
        weight = huber_weights(y - Q @ z, corner / CORNER)
        total += Q.T @ (Q * weight[:, None])
    return total


def _stepped(R: Array, x: Array, slope: Array, curvature: Array, least: float) -> Array | None:
    """The minimiser (p,) above the bound of a quadratic about x; None where it has none."""
    w, V = eigenpairs(curvature)
    if w[0] <= HUBER.singular:
        return None
    if np.isneginf(least):
        return x + np.linalg.solve(R, V @ ((slope @ V) / w))
    from scipy.optimize import nnls

    # |C R (x' - x) - C^-1 slope| with C = sqrt(w) V' is the quadratic, but for a constant.
    root = np.sqrt(w)
    C = root[:, None] * V.T @ R
    return least + nnls(C, C @ (x - least) + (slope @ V) / root)[0]


def _inflation(r: Array, p: int, corner: float) -> float:
    """The factor on (X'X)^-1 in the covariance, from residuals r (N,) of p parameters.

    Raises:
        SigmaTooSmallError: No residual is within the corner.
    """
    N = len(r)
    inside = float(np.mean(np.abs(r) <= corner))  # mean of psi'
    if not inside:
        ratio = np.abs(r).min()
        raise SigmaTooSmallError(
            f"the smallest residual is {ratio:.3g} times sigma: expected a larger sigma"
        )
    correction = 1 + p / N * (1 - inside) / inside
    spread = float((np.clip(r, -corner, corner) ** 2).sum()) / (N - p)
    return correction**2 * spread / inside**2


def _scale(r: Array, p: int) -> float:
    """Standard deviation of the bulk of residuals r (N,) of a fit of p parameters."""
    return float(MAD_TO_STD * np.median(np.abs(r)) * np.sqrt(len(r) / (len(r) - p)))
