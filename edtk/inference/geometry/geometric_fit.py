"""A robot's geometry and springs, identified from absolute positions."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.inference.geometry.fitted_geometry import FittedGeometry
from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.system.typing import Array

MM = 1e3


@dataclass(frozen=True, eq=False)
class TurnResiduals:
    """Residuals of orientations, as turns in the axes of the instrument [rad].

    Attributes:
        residual: Of the fit (m, k, 3); NaN where a marker was not seen.
        left_out: Of each pose predicted without it (m, k, 3).
        left_out_half: Half the widths of the 95 % bands of those (m, k, 3).
    """

    residual: Array
    left_out: Array
    left_out_half: Array


@dataclass(frozen=True, eq=False)
class GeometricFit:
    """A fit of one sheet, with what tells how good it is.

    Attributes:
        fitted: Parameters and noise.
        data: The positions.
        structural: Rank that enough poses would have.
        redundant: Sentences on parameters that no pose could tell from others.
        open: Sentences on those that these poses do not.
        placed: Root mean square distance [m] with base and tools fitted alone.
        residual: Measured less fitted positions of the poses' means (m, k, 3) [m]; NaN where a
            marker was not seen.
        left_out: The same for each pose predicted without it (m, k, 3).
        left_out_half: Half the widths of the 95 % bands of those (m, k, 3) [m].
        surprise: Squared size (m,) of each pose's error left out, over its covariance: chi-square
            with as many degrees of freedom as coordinates.
        independent: As many independent coordinates tell as much by how many are inside their
            bands, see `independent_coordinates`.
        weights: Weights (m,) of the poses: one, or less where a robust loss trusts them less.
        turns: The residuals of orientations; None where these were not measured.
    """

    fitted: FittedGeometry
    data: MarkerPositions
    structural: int
    redundant: tuple[str, ...]
    open: tuple[str, ...]
    placed: float
    residual: Array
    left_out: Array
    left_out_half: Array
    surprise: Array
    independent: float
    weights: Array
    turns: TurnResiduals | None = None

    @property
    def rank(self) -> int:
        """Number of parameters that were identified."""
        return self.fitted.model.p

    @property
    def rms(self) -> float:
        """Root mean square distance of the fit [m]."""
        return root_mean_square(self.residual)

    @property
    def loo_rms(self) -> float:
        """Root mean square distance of poses that were left out one by one [m]."""
        return root_mean_square(self.left_out)

    @property
    def worse_than_placed(self) -> bool:
        """Whether a pose left out is predicted worse than with base and tool alone.

        Where nothing else is fitted, there is nothing to compare.
        """
        fitted = self.fitted.model.parameters
        more = any(one.place in ("joint", "compliance") for one in fitted)
        return more and self.loo_rms > self.placed

    @cached_property
    def share_inside(self) -> float:
        """Share of coordinates that, left out, are within their 95 % bands."""
        pairs = [(self.left_out, self.left_out_half)]
        if self.turns is not None:
            pairs.append((self.turns.left_out, self.turns.left_out_half))
        errors, halves = (np.concatenate(part, axis=-1) for part in zip(*pairs, strict=True))
        seen = np.isfinite(errors)
        return float((np.abs(errors) <= halves)[seen].mean())


def root_mean_square(distances: Array) -> float:
    """Root mean square length of vectors (m, k, 3) [m], of which some are NaN."""
    squares = (distances**2).sum(axis=-1)
    known = np.isfinite(squares)
    return float(np.sqrt(squares[known].mean())) if known.any() else float("nan")


def root_mean_squares(distances: Array) -> Array:
    """The same of each visit (m,)."""
    return np.array([root_mean_square(one[None]) for one in distances])
