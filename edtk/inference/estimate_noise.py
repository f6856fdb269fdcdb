"""How large the errors of tracker, joints and model are, by the residuals of visits."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.inference.distributions import fisher_tail
from edtk.inference.error_strata import ErrorStrata, Stratum
from edtk.inference.fit_variances import fit_variances
from edtk.inference.lack_of_fit import UNLIKELY, LackOfFit
from edtk.inference.visited import Visited
from edtk.system.typing import Array, Mask

ROUNDING = 1e-6  # of the tracker's noise: residuals as small are no errors
ENOUGH = 10  # degrees of freedom from which the tracker's own scatter is a yardstick


@dataclass(frozen=True, eq=False)
class NoiseEstimate:
    """Estimated sizes of errors, and whether joints move markers together.

    Attributes:
        tracker: Standard deviation of the tracker's errors, over the stated one.
        joints: That of the joints, over the one that a motion of size one is by: degrees, and
            millimetres where they slide.
        discrepancy: That of the model, which visits of a pose share [m].
        std: Standard deviations (3,) of these three; NaN where one is zero or cannot be told.
        told: Whether each of the three can be told from the others.
        F: Mean square of what joints make, over that of the rest.
        p: Probability of so large an F where joints do not move, and the model fits.
        strata: The residuals, split by what moves together.
        by_joints: Root mean square of what joints add to a coordinate, over the tracker's stated
            noise.
        by_model: The same of the discrepancy.
    """

    tracker: float
    joints: float
    discrepancy: float
    std: Array
    told: tuple[bool, bool, bool]
    F: float
    p: float
    strata: ErrorStrata
    by_joints: float
    by_model: float

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

    @property
    def common_dof(self) -> float:
        """Degrees of freedom of the larger of the errors that a visit shares, one at least."""
        dof = self.relative_dof(1 if self.by_joints >= self.by_model else 2)
        return max(dof, 1.0) if np.isfinite(dof) else float(self.strata.poses.dof)

    def to_dict(self) -> dict[str, Any]:
        """The estimates, for JSON; one that cannot be told is null."""
        std = [value if np.isfinite(value) else None for value in self.std.tolist()]
        return {
            "tracker_ratio": self.tracker,
            "tracker_ratio_std": std[0],
            "repeatability_deg": self.joints if self.told[1] else None,
            "repeatability_deg_std": std[1],
            "discrepancy_mm": 1e3 * self.discrepancy if self.told[2] else None,
            "discrepancy_mm_std": None if std[2] is None else 1e3 * std[2],
            "together": {"F": self.F, "p": self.p, "revisited": self.revisited},
        }

    @property
    def moves(self) -> bool:
        """Whether what joints make is larger than the rest, by more than chance."""
        return self.p < UNLIKELY and self.joints > 0

    @property
    def lack_of_fit(self) -> LackOfFit | None:
        """Whether markers of a visit agree better with motions of joints than with the model."""
        strata = self.strata
        apart = yardstick(strata)
        if strata.poses.dof < 1 or apart is None:
            return None
        F = strata.poses.mean_square / apart.mean_square
        return LackOfFit(
            F=F,
            p=float(fisher_tail(F, strata.poses.dof, apart.dof)),
            pure_error=float(np.sqrt(apart.mean_square)),
            common=float(np.hypot(self.by_joints, self.by_model)),
            dof=(strata.poses.dof, apart.dof),
        )


def estimate_noise(seen: Visited) -> NoiseEstimate | None:
    """Split the residuals by what moves together, test whether joints move, estimate the variances.

    Where joints do not move and the model fits, mean squares of strata are independent chi-squares
    over their degrees of freedom, and the ratio F has Fisher's distribution.

    Args:
        seen: Residuals of the least-squares fit with the tracker's noise.

    Returns:
        The estimate; None where nothing but joints can have made the residuals, so that the
        tracker's errors cannot be told from theirs, or nothing else is left; or the residuals do
        not tell variances.
    """
    strata = ErrorStrata.of(seen)
    rest = yardstick(strata)
    moved = strata.visits if strata.visits.dof > 0 else strata.poses
    if rest is None or moved.dof < 1 or rest.mean_square < ROUNDING**2:
        return None
    told = _told(strata)
    try:
        v, covariance = fit_variances(seen, told)
    except np.linalg.LinAlgError:
        return None
    if not np.isfinite(v).all():
        return None
    size = np.sqrt(v)
    std = np.divide(np.sqrt(np.diag(covariance)), 2 * size, out=np.full(3, np.nan), where=size > 0)
    F = moved.mean_square / rest.mean_square
    moved_by = np.sqrt(np.mean((seen.motion**2).sum(axis=-1)))
    shared_by = np.sqrt(np.mean((seen.unit**2).sum(axis=-1)))
    return NoiseEstimate(
        tracker=float(size[0]),
        joints=float(size[1]),
        discrepancy=float(size[2]),
        std=std,
        told=(bool(told[0]), bool(told[1]), bool(told[2])),
        F=float(F),
        p=float(fisher_tail(F, moved.dof, rest.dof)),
        strata=strata,
        by_joints=float(size[1] * moved_by),
        by_model=float(size[2] * shared_by),
    )


def yardstick(strata: ErrorStrata) -> Stratum | None:
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
