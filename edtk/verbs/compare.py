"""`edtk.compare`: designs side by side, as a table and a page."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import criteria as known
from edtk.design.exact.comparison import Comparison, compare_designs, compare_values
from edtk.design.exact.model_design import ModelDesign
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.report.views.problem import comparison_page
from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError
from edtk.system.files import write_files
from edtk.verbs.evaluate import evaluate


@checked
def compare(
    designs: "Sequence[Any] | Mapping[str, Any]",  # read below, in words of its own
    model: Any = None,
    *,
    criteria: Sequence[Any] | None = None,
    out: Path | str | None = None,
) -> Comparison:
    """Put designs side by side, each under each criterion.

    Args:
        designs: Plans and weights of a problem or a region, as a list or by their names. Beside a
            problem as `model` a design may be indices of candidates, each as often as it is
            measured; beside a study they are its plans, or the paths of their CSV files.
        model: The `Problem` that indices are of, or the study; not needed otherwise.
        criteria: Names of criteria, or criteria. By default the design's own, D, A, E, G, and the
            mean (I) and the largest variance of predictions (prediction_G; in a region it is that
            over a grid of some 2,000 points and the experiments of the first design); of a study
            all of its criteria.
        out: File to write: a page (.html), or the table (.csv).

    Returns:
        Values and efficiencies, with `.to_frame()`. Efficiencies of problems and regions are
        against the bound of each criterion over the model of the first design, for as many
        experiments as each has; of a study against the best plan of these. With a structure of
        errors they are against the best of these by experiment, each under its own errors.

    Raises:
        UserError: One line that says what cannot be compared.

    Example:
        >>> import numpy as np, edtk
        >>> x = np.linspace(-1.0, 1.0, 11)
        >>> parabola = edtk.Problem(np.vander(x, 3)[:, None, :])
        >>> mine = {"ends and middle": [0, 0, 5, 5, 10, 10], "even": [0, 2, 4, 6, 8, 10]}
        >>> edtk.compare(mine, parabola, criteria=["D", "A"]).to_frame()["efficiency D"].round(3)
        design
        ends and middle    1.000
        even               0.795
        Name: efficiency D, dtype: float64
    """
    path = None if out is None else Path(out)
    if path is not None and path.suffix not in (".html", ".csv"):
        message = "expected a file whose name ends in .html or .csv"
        raise ArgumentError(message, argument="out", given=out)
    named = _named(designs)
    if model is None or isinstance(model, Problem | Region):
        seen = {name: _seen(name, one, model) for name, one in named.items()}
        found = compare_designs(seen, criteria)
    else:
        found = _of_study(named, model, criteria)
    if path is not None:
        is_page = path.suffix == ".html"
        text = comparison_page(found) if is_page else found.to_frame().to_csv(lineterminator="\n")
        write_files({path: text})
    return found


def _named(designs: Sequence[Any] | Mapping[str, Any]) -> dict[str, Any]:
    """Designs by names: numbers with their criterion where none are given.

    Raises:
        ArgumentError: There is none.
    """
    if isinstance(designs, Mapping):
        found = {str(name): one for name, one in designs.items()}
    elif isinstance(designs, Sequence) and not isinstance(designs, str):
        found = {}
        for i, one in enumerate(designs, start=1):
            criterion = getattr(one, "criterion", None)
            is_path = isinstance(one, str | Path)
            label = Path(one).stem if is_path else getattr(criterion, "label", "")
            found[f"{i} {label}".strip()] = one
    else:
        raise ArgumentError("expected a list of designs, or designs by name", argument="designs")
    if not found:
        raise ArgumentError("expected at least one", argument="designs")
    return found


def _seen(name: str, design: Any, model: Problem | Region | None) -> ModelDesign:
    """A design as rows; of indices on a problem, counts of these.

    Raises:
        UserError: It is none.
    """
    if hasattr(design, "told_bound"):
        return ModelDesign.of(design)
    if not isinstance(model, Problem):
        message = "expected a plan or weights; plans of a robot need their study beside them, and "
        message += "indices of candidates their Problem"
        raise ArgumentError(message, argument="designs", given=name)
    try:
        chosen = np.asarray(design)
    except ValueError:
        chosen = np.zeros(0)
    whole = chosen.ndim == 1 and len(chosen) and np.issubdtype(chosen.dtype, np.integer)
    if not whole or not ((chosen >= 0) & (chosen < model.n)).all():
        message = f"expected indices of candidates, from 0 to {model.n - 1}"
        raise ArgumentError(message, argument="designs", given=name)
    counts = np.bincount(chosen, minlength=model.n)
    found = ModelDesign.of_counts(model, known.create("D"), counts, len(chosen))
    if found.is_open:
        message = "tells too little for a value: some parameters are open"
        raise ArgumentError(message, argument="designs", given=name)
    return found


def _of_study(designs: Mapping[str, Any], study: Any, criteria: Sequence[Any] | None) -> Comparison:
    """Plans of a study, under its criteria."""
    each = [evaluate(study, plan) for plan in designs.values()]
    labels = [label for label in each[0].criteria if all(label in one.criteria for one in each)]
    if criteria is not None:
        unknown = [name for name in criteria if name not in labels]
        if unknown:
            message = f"expected some of {', '.join(labels)}"
            raise ArgumentError(message, argument="criteria", given=unknown[0])
        labels = list(criteria)
    return compare_values(
        list(designs),
        [one.experiments for one in each],
        {label: [one.criteria[label] for one in each] for label in labels},
        {label: known.get(label).sense for label in labels},
    )
