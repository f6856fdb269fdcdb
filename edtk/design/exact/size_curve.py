"""The cost of the best plan over the number of experiments: what one more is worth."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from criteria import Criterion
from edtk.design.exact.counts.find_counts import find_counts
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.design.exact.model_design import Design, ModelDesign
from edtk.design.exact.plan_region import RegionPlan, plan_region
from edtk.design.information import Rows
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.design.relaxation.relax_region import relax_region
from edtk.system.errors import UserError, whole_number
from edtk.system.typing import Array, Indices

CURVE_STARTS = 8  # of the search for each size
SIZES_ABOVE = 8  # sizes that are looked at by default, above the smallest


@dataclass(frozen=True, eq=False)
class SizeCurve:
    """Costs of the best plans that were found, and bounds, by size.

    Attributes:
        criterion: What was minimised.
        sizes: Numbers of experiments (s,), increasing.
        costs: Costs (s,) of the plans.
        bounds: No plan of so many experiments costs less (s,); zero where there is no bound.
        own: Size and cost of the plan that is asked about; None of weights.
    """

    criterion: Criterion
    sizes: Indices
    costs: Array
    bounds: Array
    own: tuple[int, float] | None


def size_curve(design: Design, sizes: Iterable[int] | None = None) -> SizeCurve:
    """Search for plans of several sizes on the model of a design, for its criterion.

    Args:
        design: The design. What was kept is kept, and limits on counts hold.
        sizes: Numbers of experiments, kept ones included. By default those around that of a plan,
            and the smallest ones for weights.

    Raises:
        UserError: No plan of any of these sizes tells the parameters, or limits of another kind.
    """
    seen = ModelDesign.of(design)
    if isinstance(design, ProblemPlan) and design.spent is not None:
        raise UserError("a plan within a budget has no number of experiments of its own")
    if seen.arranged is not None:
        raise UserError("a structure of errors is one of so many runs; plan each size by itself")
    made = _made(design)
    rows = seen.support.rows.shape[1]
    least = max(made + 1, -(-seen.p // rows))
    if sizes is None:
        first = least if seen.size is None else max(least, seen.size - SIZES_ABOVE // 2)
        asked = list(range(first, first + SIZES_ABOVE + 1))
    else:
        asked = sorted({whole_number(size, "sizes", made + 1) for size in sizes})
    found = []
    for size in asked:
        try:
            plan = _plan(design, seen.model, size)
        except UserError:
            continue  # so few do not tell the parameters
        found.append((size, plan.cost, plan.told_bound.cost))
    if not found:
        raise UserError("no plan of any of these sizes tells all that the criterion needs")
    told, costs, bounds = (np.array(column) for column in zip(*found, strict=True))
    own = None if seen.size is None else (seen.size, design.cost)
    if own is not None and own[0] in told:
        # A plan of the same size that is better is the better one of that size.
        place = told.tolist().index(own[0])
        costs[place] = min(costs[place], own[1])
    return SizeCurve(design.criterion, told, costs, bounds, own)


def _made(design: Design) -> int:
    """Number of experiments that every plan has."""
    if isinstance(design, ProblemPlan):
        return int(design.kept.sum())
    return design.kept if isinstance(design, RegionPlan) else 0


def _plan(design: Design, model: Problem | Region, size: int) -> ProblemPlan | RegionPlan:
    """The best plan of a size that few starts find."""
    criterion = design.criterion
    if isinstance(model, Region):
        return _region_plan(design, model, size)
    kept = design.kept if isinstance(design, ProblemPlan) else np.zeros(model.n, dtype=int)
    most = design.most if isinstance(design, ProblemPlan) else None
    rows = model.factors(np.flatnonzero(kept)) * np.sqrt(kept[kept > 0])[:, None, None]
    base = np.zeros((model.p, model.p)) if model.prior is None else size * model.prior
    left = None if most is None else most - kept
    limits = Limits(size - int(kept.sum()), base, left)
    known = Rows(rows).each if kept.any() else None
    return find_counts(model, criterion, limits, kept, starts=CURVE_STARTS, known=known)


def _region_plan(design: Design, region: Region, size: int) -> RegionPlan:
    """The same in a region; what was kept is part of its prior, shared by the new experiments."""
    kept = design.kept if isinstance(design, RegionPlan) else 0
    new = size - kept
    if kept and region.known is not None:
        assert isinstance(design, RegionPlan)
        if region.known.squares.any():
            raise UserError("kept experiments beside a prior have no curve over sizes")
        region = region.beside(region.known.shared(new / int(design.counts.sum())))
    return plan_region(region, new, design.criterion, starts=CURVE_STARTS, relaxed_by=relax_region)
