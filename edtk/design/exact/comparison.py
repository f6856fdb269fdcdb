"""Designs side by side: each under each criterion, and one beside plans of other sizes."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from criteria import Criterion
from edtk.design.bound import printed_form
from edtk.design.exact.counts.find_counts import find_counts
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.design.exact.model_design import Design, ModelDesign
from edtk.design.exact.plan_region import RegionPlan, plan_region
from edtk.design.information import Rows
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.design.relaxation.relax_region import relax_region
from edtk.system.errors import ArgumentError, UserError, whole_number
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd


OF_BOUND = "of the bound of each criterion"
OF_BEST = "of the best of these designs"
OF_EACH = f"{OF_BEST} by experiment, each under the errors of its own runs"
CURVE_STARTS = 8  # of the search for each size
SIZES_ABOVE = 8  # sizes that are looked at by default, above the smallest


@dataclass(frozen=True, eq=False)
class Comparison(Presented):
    """Designs (k) under criteria (c).

    Attributes:
        names: What the designs are called (k,).
        experiments: Their numbers of experiments (k,); nan for weights, whose values are of one.
        criteria: Labels of the criteria (c,).
        values: Their values (k, c), as formulas print them.
        efficiencies: Efficiencies (k, c), for as many experiments as each design has.
        basis: What an efficiency of one is.
        designs: The designs as rows; none for plans of a study.
    """

    names: tuple[str, ...]
    experiments: Array
    criteria: tuple[str, ...]
    values: Array
    efficiencies: Array
    basis: str
    designs: tuple[ModelDesign, ...] = ()

    def headline(self) -> str:
        """Number of designs and criteria, and which design has the best of its worst."""
        least = np.nanmin(self.efficiencies, axis=1)
        best = int(np.nanargmax(least))
        return (
            f"{len(self.names)} design{'s' * (len(self.names) > 1)} under {len(self.criteria)} "
            f"criteri{'a' if len(self.criteria) > 1 else 'on'}; {self.names[best]} is "
            f"at least {least[best]:.1%} efficient under each"
        )

    def to_frame(self) -> "pd.DataFrame":
        """A table with a design a row: experiments, then value and efficiency by criterion."""
        import pandas as pd

        columns: dict[str, Any] = {"experiments": self.experiments}
        for i, label in enumerate(self.criteria):
            columns[label] = self.values[:, i]
            columns[f"efficiency {label}"] = self.efficiencies[:, i]
        return pd.DataFrame(columns, index=pd.Index(self.names, name="design"))


def compare_designs(
    designs: Mapping[str, ModelDesign], criteria: Sequence[Any] | None = None
) -> Comparison:
    """Put designs for one model side by side.

    Efficiencies are against bounds over the model of the first design, for as many experiments as
    each has. So one whose candidates are others may be above one. Where a plan has a structure of
    errors, they are against the best of these designs if each had as many experiments, and each is
    judged under its own errors: ``min_j(cost_j m_j^d) / (cost_i m_i^d)`` for a criterion of degree
    d, and m new experiments, which are one of weights.

    Args:
        designs: Designs by their names.
        criteria: See `ModelDesign.other_criteria`.

    Raises:
        ArgumentError: They have other parameters, or other things are known beside them.
    """
    seen = tuple(designs.values())
    first = seen[0]
    for name, one in designs.items():
        if one.parameters != first.parameters:
            message = f"has the parameters {', '.join(one.parameters)}; expected those of the first"
            raise ArgumentError(message, argument="designs", given=name)
        if (one.known is None) != (first.known is None):
            message = "a prior, or what was kept in a region, is known beside some designs alone"
            raise ArgumentError(message, argument="designs", given=name)
    asked = first.other_criteria(criteria)
    costs = np.array([[one.cost(criterion) for criterion in asked.values()] for one in seen])
    of_best = any(one.arranged is not None for one in seen)
    if of_best:
        # Bounds are of independent errors: what such a plan could reach, they do not tell.
        degrees = [criterion.degree for criterion in asked.values()]
        by_one = costs * np.power([[one.new] for one in seen], degrees)
        efficiencies = by_one.min(axis=0) / by_one
    else:
        efficiencies = np.array([_bounds(first, asked, one.new) for one in seen]) / costs
    senses = [criterion.sense for criterion in asked.values()]
    values = [printed_form(costs[:, i], sense) for i, sense in enumerate(senses)]
    return Comparison(
        tuple(designs),
        np.array([np.nan if one.size is None else one.size for one in seen]),
        tuple(asked),
        np.stack(values, axis=-1),
        efficiencies,
        OF_EACH if of_best else OF_BOUND,
        seen,
    )


def _bounds(first: ModelDesign, asked: Mapping[str, Criterion], new: float) -> Array:
    """The bound (c,) of each criterion for so many new experiments on the model of a design."""
    return np.array([first.bound(criterion, new) for criterion in asked.values()])


def compare_values(
    names: Sequence[str],
    experiments: Sequence[int],
    values: Mapping[str, Sequence[float]],
    senses: Mapping[str, Any],
) -> Comparison:
    """Put plans of a study side by side, each against the best of them.

    Args:
        names: What the plans are called (k,).
        experiments: Their numbers of experiments (k,).
        values: Values (k,) of each criterion.
        senses: Whether each is minimised or maximised.
    """
    columns = [np.asarray(column, dtype=float) for column in values.values()]
    costs = [printed_form(own, senses[label]) for label, own in zip(values, columns, strict=True)]
    efficiencies = [np.nanmin(own) / own for own in costs]
    return Comparison(
        tuple(names),
        np.array(experiments, dtype=float),
        tuple(values),
        np.stack(columns, axis=-1),
        np.stack(efficiencies, axis=-1),
        OF_BEST,
    )


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
