"""A design over a region: points and weights, with bounds and what proves them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from criteria import Criterion, Relaxable
from criteria.interest import DEPENDENT
from edtk.design.bound import VISIBLE, Bound, BoundKind, RelaxedDesign
from edtk.design.problem import Problem
from edtk.design.problems import Whitened
from edtk.design.region import Region
from edtk.design.relaxation.certify import certify
from edtk.design.relaxation.proof import InnerProof, is_normalised, normalised
from edtk.design.relaxation.relax import require_relaxable
from edtk.design.relaxation.relaxation import Relaxation
from edtk.design.relaxation.search_continuum import LargestSensitivities
from edtk.design.relaxation.setting import Setting
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd

    from edtk.design.theta_box import WorstTheta

# Sizes of information beyond which searches over a region would leave floating-point numbers.
SMALLEST_INFORMATION = 1e-100
LARGEST_INFORMATION = 1e100


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
        setting = Setting(judged, self.criterion, self.asked, whitened, known=self.given.known)
        return setting.errors(weights, multipliers)


def _require_moderate(problem: Problem) -> None:
    """Check that squares of squares of the rows are floating-point numbers.

    Raises:
        ArgumentError: They are not.
    """
    with np.errstate(over="ignore"):
        sizes = np.diag(problem.mean)
    outside = sizes[
        (sizes != 0) & ~((sizes > SMALLEST_INFORMATION) & (sizes < LARGEST_INFORMATION))
    ]
    if len(outside):
        which = "they are" if len(outside) == len(sizes) else "one column is"
        raise ArgumentError(
            f"{which} of the order {np.sqrt(outside[0]):.0e}, in parts of the noise; expected "
            "1e-50 to 1e50, in other units",
            argument="rows",
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class RelaxedRegion(RelaxedDesign):
    """A relaxed design over a region: its weights (k,) are the share that each point should have.

    Its candidates are the points of a grid and its own; its multipliers are in the judged
    parameters.

    Attributes:
        region: The region.
        judged: Both as the search saw them: with all of the prior, in parameters that lose nothing.
        points: Points (k, d), in the order of their variables.
        searched_bound: Not proved: no design over the region has a lower cost, provided that the
            ascents have found the largest sensitivities.
        largest: The largest sensitivities that were found in the region, and where.
        grid: Points (n, d) of the grid.
        accuracy: Relative error that rounding may have made in cost and bounds, see
            `proof.errors`.
        worst: Where in ranges of theta it is worst; None of a region without any.
    """

    region: Region
    judged: JudgedRegion
    points: Array
    searched_bound: Bound
    largest: LargestSensitivities
    grid: Array
    accuracy: float
    worst: "WorstTheta | None" = None

    def headline(self) -> str:
        """Criterion, value, number of points, and gap with its kind."""
        digits = f", numbers to {self.accuracy:.0e}" if self.accuracy > VISIBLE else ""
        return (
            f"{self.criterion.label} = {self.value:.6g} with weights on {len(self.points)} points, "
            f"{self.kind.value} gap {self.gap:.1e}{digits}"
            f"{'' if self.worst is None else f', {self.worst}'}"
        )

    @property
    def told_bound(self) -> Bound:
        """The bound over the whole region."""
        return self.searched_bound

    @property
    def bounds(self) -> dict[str, Bound]:
        """That on the grid, and that of the search."""
        return super().bounds | {"searched": self.searched_bound}

    @property
    def grid_bound(self) -> Bound:
        """The proved bound, which holds for designs over the grid and these points."""
        return self.proved_bound

    @property
    def bound_searched(self) -> float:
        """The searched bound over the region as the criterion's formula prints it."""
        return self.searched_bound.value

    @property
    def places(self) -> Array:
        """The points (k, d)."""
        return self.points

    @property
    def information(self) -> Array:
        """Information matrix (p, p) of one experiment's worth of this design."""
        return self.region.problem(self.points).information(self.weights)

    def on_grid(self) -> Relaxation:
        """The design as a relaxation over its own points and those of the grid, in this order.

        Its bound is proved, and its certificate can be checked: `edtk.verify` takes what
        ``on_grid().to_dict()`` writes, with ``on_grid().problem`` beside it. Cost and bound are
        computed anew.
        """
        problem = self.region.problem(np.concatenate([self.points, self.grid]))
        weights = np.concatenate([self.weights, np.zeros(len(self.grid))])
        T = self.judged.T
        inner = None if T is None else InnerProof(T, self.multipliers)
        Z = self.multipliers if inner is None else inner.outward()
        assert isinstance(self.criterion, Relaxable)
        cost, bound = certify(problem, self.criterion, weights, Z, inner)
        kind = BoundKind.PROVED_ON_CANDIDATES
        return Relaxation(
            criterion=self.criterion,
            weights=weights,
            cost=cost,
            proved_bound=Bound.of(self.criterion, bound, cost, kind),
            multipliers=Z,
            solver=self.solver,
            iterations=self.iterations,
            problem=problem,
            accuracy=self.accuracy,
            rests_on_solver=self.criterion.rests_on_solver(self.multipliers, self._judged_M),
            inner=inner,
        )

    @property
    def _judged_M(self) -> Array:
        """Information matrix (p, p) of the judged parameters."""
        return self.judged.region.problem(self.points).information(self.weights)

    def sensitivities(self, x: Array) -> Array:
        """Sensitivities (r, n) of points x (n, d) in parts of the largest one.

        At an optimum of a smooth criterion none is above one, and they are one at its points: the
        equivalence theorem.
        """
        problem = normalised(self.judged.region.problem(x), self.judged.criterion)
        return np.asarray(problem.sensitivities(self.multipliers) / self.largest.values[:, None])

    def to_frame(self) -> "pd.DataFrame":
        """Make a table with a point a row and its weight in the last column."""
        import pandas as pd

        frame = pd.DataFrame(self.points, columns=list(self.region.variables))
        return frame.assign(weight=self.weights)
