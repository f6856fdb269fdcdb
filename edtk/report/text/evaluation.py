"""Text of an evaluation."""

import criteria
from edtk.report.text_table import name_width
from edtk.study.evaluate import Evaluation


def evaluation(found: Evaluation) -> str:
    """A line for each criterion, and one for each standard deviation."""
    lines = [f"{found.experiments} experiments"]
    width = name_width(found.criteria, 6)
    for name, value in found.criteria.items():
        criterion = criteria.get(name)
        factor, unit = criterion.shown
        shown = f"{factor * value:.6g} {unit}"
        lines.append(f"  {name:{width}}{criterion.sense:5}{shown:18}{criterion.formula}")
    if found.expected is not None:
        lines.append(str(found.expected))
    lines.append("standard deviations")
    width = name_width(found.parameters, 6)
    for name, std, unit in zip(found.parameters, found.std, found.units, strict=True):
        lines.append(f"  {name:{width}}{std:.4g} {unit}")
    return "\n".join(lines)
