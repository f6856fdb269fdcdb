"""What a relaxation over a region solves instead of the region as it was given."""

from dataclasses import dataclass

import numpy as np

from criteria import Criterion, Relaxable
from criteria.interest import DEPENDENT
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.design.relaxation.normalised import is_normalised
from edtk.design.relaxation.relax import require_relaxable
from edtk.design.relaxation.setting import Setting
from edtk.design.whitened import Whitened
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array

# Sizes of information beyond which searches over a region would leave floating-point numbers.
SMALL = 1e-100
LARGE = 1e100


@dataclass(frozen=True, eq=False)
class JudgedRegion:
    """A region with the same designs, and a criterion with the same costs.

    A Bayesian criterion's precision becomes a part of the prior. Parameters of a model that is
    ill-conditioned, such as a polynomial far from the origin, are replaced by others that points of
    the region tell equally well: squares of the rows would lose their digits.

    Attributes:
        region: The region, for parameters k'.
        criterion: The criterion as a function of the information about these.
        given: The region for the parameters as they were given, with all of the prior.
        asked: The criterion of these parameters.
        T: ``k = T k'`` (p, p); None where the parameters are the given ones.
    """

    region: Region
    criterion: Relaxable
    given: Region
    asked: Relaxable
    T: Array | None

    @classmethod
    def of(cls, region: Region, criterion: Criterion, x: Array) -> "JudgedRegion":
        """Transform a region, as points x (n, d) of it tell what is needed.

        Raises:
            NotImplementedError: The criterion cannot be relaxed.
            RankDeficientError: The points cannot identify all parameters.
            ArgumentError: The rows are too small, or too large.
        """
        if criterion.precision is not None:
            region = region.with_prior(criterion.precision)
        relaxable = require_relaxable(criterion.without_prior)
        problem = region.problem(x)
        _require_moderate(problem)
        problem.require_identifiable(relaxable)
        conditioning = problem.conditioning
        # Unit traces, which criteria of degree zero need, are those of the given parameters.
        depends = relaxable.dependence(conditioning.scale) > DEPENDENT
        if (depends or not conditioning.is_well) and not is_normalised(relaxable):
            T = conditioning.whitener
            transformed = relaxable.transformed(T)
            if isinstance(transformed, Relaxable):
                judged = region.in_units(T, np.where(conditioning.is_open, 0.0, 1.0))
                return cls(judged, transformed, region, relaxable, T)
        return cls(region, relaxable, region, relaxable, None)

    def errors(self, x: Array, weights: Array, multipliers: Array) -> tuple[float, float]:
        """Relative errors that rounding may have made in cost and bound.

        Args:
            x: Points (n, d).
            weights: Their weights (n,).
            multipliers: Multipliers (r, p, p) of the bound.
        """
        judged = self.region.problem(x)
        whitened = None
        if self.T is not None:
            kept = self.given.problem(x).kept
            whitened = Whitened(judged, self.T, kept.rounding_of_times(self.T))
        setting = Setting(judged, self.criterion, self.asked, whitened, prior=self.given.prior)
        return setting.errors(weights, multipliers)


def _require_moderate(problem: Problem) -> None:
    """Check that squares of squares of the rows are floating-point numbers.

    Raises:
        ArgumentError: They are not.
    """
    with np.errstate(over="ignore"):
        size = float(np.trace(problem.mean))
    if size != 0 and not SMALL < size < LARGE:
        raise ArgumentError(
            f"they are of the order {np.sqrt(size):.0e}, in parts of the noise; expected 1e-50 to "
            "1e50, in other units",
            argument="rows",
        )
