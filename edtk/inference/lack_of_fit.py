"""Whether residuals of repeated measurements agree among themselves better than with the model."""

from dataclasses import dataclass

import numpy as np

from edtk.inference.distributions import fisher_tail
from edtk.system.typing import Array, Indices

UNLIKELY = 0.01  # probability below which so large an F is no chance


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
