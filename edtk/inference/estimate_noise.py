"""How large the errors of tracker, joints and model are, by the residuals of visits."""

from dataclasses import dataclass

import numpy as np

from edtk.inference.distributions import fisher_tail
from edtk.inference.error_strata import ErrorStrata, Stratum
from edtk.inference.fit_variances import fit_variances
from edtk.inference.visited import Visited
from edtk.system.typing import Array, Mask

ENOUGH = 10  # degrees of freedom from which the tracker's own scatter is a yardstick


@dataclass(frozen=True, eq=False)
class NoiseEstimate:
    """Estimated sizes of errors, and whether joints move markers together.

    Attributes:
        tracker: Standard deviation of the tracker's errors, over the stated one.
        joints: That of the joints, over the one that a motion of size one is by.
        discrepancy: That of the model, which visits of a pose share [m].
        std: Standard deviations (3,) of these three; NaN where one is zero or cannot be told.
        told: Whether each of the three can be told from the others.
        F: Mean square of what joints make, over that of the rest.
        p: Probability of so large an F where joints do not move, and the model fits.
        strata: The residuals, split by what moves together.
    """

    tracker: float
    joints: float
    discrepancy: float
    std: Array
    told: tuple[bool, bool, bool]
    F: float
    p: float
    strata: ErrorStrata

    @property
    def revisited(self) -> bool:
        """Whether F compares visits of a pose, in which the model has no part."""
        return self.strata.visits.dof > 0

    def relative_dof(self, i: int) -> float:
        """Degrees of freedom of a variance, as if it were a chi-square over them.

        ``2 v^2 / var(v)`` (Satterthwaite 1946), and a standard deviation has half the relative
        error of its square.
        """
        size = (self.tracker, self.joints, self.discrepancy)[i]
        return 0.5 * (size / float(self.std[i])) ** 2


def estimate_noise(seen: Visited) -> NoiseEstimate | None:
    """Split the residuals by what moves together, test whether joints move, estimate the variances.

    Where joints do not move and the model fits, mean squares of strata are independent chi-squares
    over their degrees of freedom, and the ratio F has Fisher's distribution.

    Args:
        seen: Residuals of the least-squares fit with the tracker's noise.

    Returns:
        The estimate; None where nothing but joints can have made the residuals, so that the
        tracker's errors cannot be told from theirs, or nothing else is left.
    """
    strata = ErrorStrata.of(seen)
    rest = _rest(strata)
    moved = strata.visits if strata.visits.dof > 0 else strata.poses
    if rest is None or rest.squares == 0 or moved.dof < 1:
        return None
    told = _told(strata)
    v, covariance = fit_variances(seen, told)
    size = np.sqrt(v)
    std = np.divide(np.sqrt(np.diag(covariance)), 2 * size, out=np.full(3, np.nan), where=size > 0)
    F = moved.mean_square / rest.mean_square
    return NoiseEstimate(
        tracker=float(size[0]),
        joints=float(size[1]),
        discrepancy=float(size[2]),
        std=std,
        told=(bool(told[0]), bool(told[1]), bool(told[2])),
        F=float(F),
        p=float(fisher_tail(F, moved.dof, rest.dof)),
        strata=strata,
    )


def _rest(strata: ErrorStrata) -> Stratum | None:
    """The tracker's scatter; with what all visits show beside motions of joints where it is poor.

    Without a discrepancy both are the same, and a discrepancy hides motions of the joints rather
    than feigning them.
    """
    if strata.tracker.dof >= ENOUGH:
        return strata.tracker
    both = strata.tracker + strata.shape
    return both if both.dof > 0 else None


def _told(strata: ErrorStrata) -> Mask:
    """Which of tracker, joints and discrepancy (3,) can be told apart.

    The discrepancy needs a second yardstick beside that of the joints: visits that differ, or
    markers whose shape all visits see beside the tracker's own scatter.
    """
    second = strata.visits.dof > 0 or (strata.tracker.dof > 0 and strata.shape.dof > 0)
    return np.array([True, True, second])
