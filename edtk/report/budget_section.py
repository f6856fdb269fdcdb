"""The error budget in a calibration's report: a picture, and a table of what it rests on."""

import numpy as np

from edtk.calibration.calibration import Calibration
from edtk.model.error_budget import ErrorBudget
from edtk.report.draw.error_budget import error_budget
from edtk.report.new_figure import new_figure
from edtk.report.page import paragraph, picture, section, table
from edtk.report.text.error_budget import ADVICE, NOT_IN_IT

SIZE = (4.4, 3.4)  # of the picture [inch]
CAPTION = (
    "Parts of the expected error. Their squares add up to that of the total, so that the largest "
    "part counts most."
)


def budget_section(found: Calibration, budget: ErrorBudget) -> str:
    """What error to expect in the task, by source."""
    figure = new_figure(*SIZE)
    error_budget(budget, figure.add_subplot())
    return section(
        "What makes up the expected error?",
        paragraph(_meaning(found, budget)),
        picture(figure, CAPTION),
        _parts(found, budget),
    )


def _meaning(found: Calibration, budget: ErrorBudget) -> str:
    """The result in words."""
    place = f" {found.study.tasks.place}" if found.study.tasks else ""
    otherwise = "If nothing else was wrong, the" if found.verdict == "bad" else "The"
    rest = np.sqrt(max(budget.total**2 - budget.parts[budget.largest] ** 2, 0.0))
    return (
        f"{otherwise} tool point is expected to be {1e3 * budget.total:.2g} mm off{place} after "
        f"compensation, and {1e3 * budget.uncompensated:.2g} mm without. All errors are root mean "
        f"squares. Without the largest part, {budget.largest.replace('_', ' ')}, "
        f"{1e3 * rest:.2g} mm would remain. To improve first: {ADVICE[budget.largest]}."
        + (f" Not in it are {NOT_IN_IT}." if budget.absolute else "")
    )


def _parts(found: Calibration, budget: ErrorBudget) -> str:
    """A table with a row for each part, the largest first."""
    assumed = _assumed(found, budget)
    order = sorted(budget.parts, key=lambda name: -budget.parts[name])
    rows = [
        [
            name.replace("_", " "),
            f"{1e3 * budget.parts[name]:.2g}",
            assumed[name],
            ADVICE[name] if budget.parts[name] else "-",
        ]
        for name in order
    ]
    header = ["part", "error [mm]", "what it assumes", "what makes it smaller"]
    return table(header, rows, words=2)


def _assumed(found: Calibration, budget: ErrorBudget) -> dict[str, str]:
    """What each part rests on, with the keys of the study's [uncertainty]."""
    given = found.study.specification.uncertainty
    load = f"{given.load_percent:g} % of its size (load_percent)"
    return {
        "noise": _noise(found),
        "model": _model(found),
        "load": f"{load} and {given.load_direction_deg:g} deg of direction (load_direction_deg)",
        "tool": f"{given.tool_mm:g} mm along each axis, marker included (tool_mm)",
        "rigid_joints": _rigid(budget),
        "known_joints": _known(budget),
        "drift": _stated(given.drift_mm, "drift_mm"),
        "repeatability": _stated(given.repeatability_mm, "repeatability_mm"),
    }


def _noise(found: Calibration) -> str:
    """The noise that the standard deviations are of."""
    stated = 1e3 * float(np.sqrt(np.mean(found.data.sigma[found.data.lengths] ** 2)))
    shared = ", and what repetitions share" if found.fitted.common_noise else ""
    if found.fit.known:
        return f"{stated:.3g} mm for each coordinate, as stated{shared}"
    return f"{1e3 * found.sigma_hat:.3g} mm for each coordinate, as estimated{shared}"


def _model(found: Calibration) -> str:
    """The model, and how far it is trusted."""
    if found.fitted.nonlinear:
        return "the loaded equilibrium was fitted: nothing is left"
    if found.rho0_bias is None:
        return "what the linear model leaves is not known"
    return "what the linear model leaves, to the first order"


def _rigid(budget: ErrorBudget) -> str:
    """Joints that count as rigid, with the compliances that they may have."""
    rigid = [one.joint for one in budget.joints if one.joint.rigid]
    if not rigid:
        return "no joint counts as rigid"
    named = [f"{_micro(joint.std)} in {joint.name} ({joint.source})" for joint in rigid]
    return f"a compliance of about {', '.join(named)}"


def _known(budget: ErrorBudget) -> str:
    """Joints of known compliance, and how well it is known."""
    known = [one.joint for one in budget.joints if not one.joint.rigid]
    if not known:
        return "no joint counts as known"
    named = [
        f"{_micro(joint.compliance)} within {_micro(joint.std)} in {joint.name}" for joint in known
    ]
    return f"{', '.join(named)} (known_rad_per_Nm)"


def _micro(compliance: float) -> str:
    """A compliance as people read it."""
    return f"{1e6 * compliance:.2g} \N{MICRO SIGN}rad/(N m)"


def _stated(size_mm: float, key: str) -> str:
    """A size that is zero unless somebody states it."""
    return f"{size_mm:g} mm along each axis ({key})" if size_mm else f"none stated ({key} = 0)"
