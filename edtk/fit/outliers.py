"""Whether repetitions agree with the model, and measurements that do not belong to the others."""

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
