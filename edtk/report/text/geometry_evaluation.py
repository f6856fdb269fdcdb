"""Text of an evaluation of a plan of visits."""

import criteria
from edtk.calibration.geometry_design.geometry_evaluation import GeometryEvaluation
from edtk.report.text.geometry_plan import about, visits_by_load
from edtk.report.text_table import name_width


def geometry_evaluation(found: GeometryEvaluation) -> str:
    """What is told, a line for each criterion, and one for each standard deviation."""
    question = found.question
    lines = [
        f"{found.experiments} visits of {len(found.poses.q)} poses",
        *visits_by_load(found.poses),
        f"{found.rank} parameters can be told apart"
        + (f" of {question.model.p} that better poses would tell" if found.open else ""),
        *(f"open: {words}" for words in found.open),
        *(f"not told by feasible poses: {words}" for words in question.untold),
        *_rho0(found),
        *about(question),
    ]
    width = name_width([*found.criteria, ""], 6)
    for name, value in found.criteria.items():
        criterion = criteria.get(name)
        factor, unit = criterion.shown
        shown = f"{factor * value:.6g} {unit}"
        lines.append(f"  {name:{width}}{criterion.sense:5}{shown:18}{criterion.formula}")
    lines.append("standard deviations")
    width = name_width([*(one.name for one in found.parameters), ""], 6)
    for one, std in zip(found.parameters, found.std, strict=True):
        lines.append(f"  {one.name:{width}}{std:.4g} {one.unit}  {one.words}")
    return "\n".join(lines)


def _rho0(found: GeometryEvaluation) -> list[str]:
    """The error in the test poses, or why there is none."""
    if found.rho0 is not None:
        return [f"rho0 {1e3 * found.rho0:.4g} mm: error of the markers to expect in the test poses"]
    if found.question.target is None:
        return []
    return ["no rho0: what is open moves the markers in the test poses"]
