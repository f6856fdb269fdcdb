"""Text of an evaluation."""

import criteria
from edtk.report.text_table import name_width
from edtk.study.evaluate import Evaluation


def evaluation(found: Evaluation) -> str:
    """A line for each criterion, and one for each standard deviation."""
    beside = " beside what the prior tells" if found.with_prior else ""
    lines = [f"{found.experiments} experiments{beside}"]
    labels = [found.labels.get(name, name) for name in found.criteria]
    width = name_width(labels, 6)
    for label, (name, value) in zip(labels, found.criteria.items(), strict=True):
        criterion = criteria.get(name)
        factor, unit = criterion.shown
        shown = f"{factor * value:.6g} {unit}"
        lines.append(f"  {label:{width}}{criterion.sense:5}{shown:18}{criterion.formula}")
    if found.expected is not None:
        lines.append(str(found.expected))
    lines.append("standard deviations")
    width = name_width(found.parameters, 6)
    for name, std, unit in zip(found.parameters, found.std, found.units, strict=True):
        lines.append(f"  {name:{width}}{std:.4g} {unit}")
    if found.interest:
        lines.append("standard deviations of what is of interest")
        width = name_width(found.interest, 6)
        lines += [f"  {name:{width}}{std:.4g} {unit}" for name, std in found.interest.items()]
    return "\n".join(lines)
