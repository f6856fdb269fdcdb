"""Designs side by side: each under each criterion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from criteria import Criterion
from edtk.design.bound import printed_form
from edtk.design.exact.model_design import ModelDesign
from edtk.system.errors import ArgumentError
from edtk.system.presented import Presented
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd

OF_BOUND = "of the bound of each criterion"
OF_BEST = "of the best of these designs"
OF_EACH = f"{OF_BEST} by experiment, each under the errors of its own runs"


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
