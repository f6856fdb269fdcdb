"""The errors of visits, split by what moves together: an analysis of variance of residuals."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from edtk.inference.visited import PoseErrors, Visited
from edtk.system.typing import Array

# Singular values of unit columns that are rounding.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Stratum:
    """One part of the residuals.

    Attributes:
        squares: Sum of squares, in units of the tracker's noise.
        dof: Degrees of freedom.
    """

    squares: float
    dof: int

    @property
    def mean_square(self) -> float:
        """Mean square, of expectation one where only the tracker errs, as stated."""
        return self.squares / self.dof

    def __add__(self, other: "Stratum") -> "Stratum":
        """Both together."""
        return Stratum(self.squares + other.squares, self.dof + other.dof)


@dataclass(frozen=True)
class ErrorStrata:
    """Residuals in four parts, in order of what adds to them.

    Of each pose, with C the motions of the joints in each visit of it, J those common to all
    visits, and E what visits have in common at all. J is in C and in E; columns of the regressor
    are ``dy/dq_j tau_j`` and so in J: the fit takes p degrees of freedom of the last part, and
    where only the tracker errs the sums of squares are independent chi-squares.

    Attributes:
        tracker: Outside of C and E: errors of the tracker alone.
        shape: In E outside of C: what all visits show, and no motion of joints makes: tracker and
            discrepancy.
        visits: In C outside of J: visits of a pose differ by motions of joints: tracker and
            repeatability.
        poses: In J, less what the compliances took: tracker, repeatability and discrepancy.
    """

    tracker: Stratum
    shape: Stratum
    visits: Stratum
    poses: Stratum

    @property
    def all(self) -> tuple[Stratum, ...]:
        """Those of them that have degrees of freedom."""
        found = (self.tracker, self.shape, self.visits, self.poses)
        return tuple(stratum for stratum in found if stratum.dof > 0)

    @classmethod
    def of(cls, seen: Visited) -> "ErrorStrata":
        """Split the residuals, pose by pose."""
        found = [Stratum(0.0, 0), Stratum(0.0, 0), Stratum(0.0, 0), Stratum(0.0, 0)]
        for pose in seen.poses():
            found = [before + part for before, part in zip(found, _parts(pose), strict=True)]
        # What is fitted lies in the last part alone.
        found[3] = found[3] + Stratum(0.0, -seen.Q.shape[-1])
        return cls(*found)


def _parts(pose: PoseErrors) -> Iterator[Stratum]:
    """The strata of one pose, before anything was fitted."""
    z = pose.residual
    together = _orthonormal(pose.motion, np.zeros((len(z), 0)))
    moving = _orthonormal(pose.apart, together)
    shape = _orthonormal(pose.shared, np.hstack([together, moving]))
    every = np.hstack([together, moving, shape])
    rest = z - every @ (every.T @ z)
    yield Stratum(float(rest @ rest), len(z) - every.shape[1])
    for U in (shape, moving, together):
        yield Stratum(float(((U.T @ z) ** 2).sum()), U.shape[1])


def _orthonormal(X: Array, apart: Array) -> Array:
    """Orthonormal columns of what X (N, c) spans beyond orthonormal columns `apart` (N, d)."""
    size = np.linalg.norm(X, axis=0)
    unit = X[:, size > 0] / size[size > 0]
    beyond = unit - apart @ (apart.T @ unit)
    U, s, _ = np.linalg.svd(beyond, full_matrices=False)
    found = U[:, s > ROUNDING]
    # Once more, as a difference of nearly equal columns is orthogonal only to its own rounding.
    return np.linalg.qr(found - apart @ (apart.T @ found))[0]
