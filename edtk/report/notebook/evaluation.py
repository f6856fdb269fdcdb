"""Tables of an evaluation, for a notebook."""

import criteria
from edtk.report.notebook_table import notebook_table
from edtk.report.shown_value import shown_value
from edtk.study.evaluate import Evaluation


def evaluation(found: Evaluation) -> str:
    """A row for each criterion, then a row for each standard deviation."""
    values = [
        [
            found.labels.get(name, name),
            shown_value(name, value, 6),
            criteria.get(name).sense,
            criteria.get(name).formula,
        ]
        for name, value in found.criteria.items()
    ]
    deviations = [
        [name, f"{std:.4g}", unit]
        for name, std, unit in zip(found.parameters, found.std, found.units, strict=True)
    ]
    notes = [] if found.expected is None else [str(found.expected)]
    header = ["criterion", "value", "sense", "formula"]
    first = notebook_table(found.headline(), header, values, notes)
    second = notebook_table("standard deviations", ["parameter", "std", "unit"], deviations)
    return f"{first}\n{second}"
