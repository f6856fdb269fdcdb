"""What explains the residuals of a calibration: repetitions, and faults that are known."""

from edtk.calibration.calibration import Calibration
from edtk.calibration.causes.cause import NOISE, Cause
from edtk.calibration.diagnostics.noise_diagnostics import UNLIKELY
from edtk.calibration.row_names import row_names
from edtk.inference.lack_of_fit import LackOfFit
from edtk.report.page import paragraph, table
from edtk.report.shown_probability import shown_probability


def residual_causes(found: Calibration) -> list[str]:
    """Sentences on lack of fit and causes, and a table of the causes, as pieces of HTML."""
    test = found.lack_of_fit
    parts = [] if test is None else [paragraph(_repetitions(found, test))]
    if found.fit.robust:
        parts.append(paragraph("Causes are not looked for, as the fit is robust."))
    elif found.causes:
        rows = [_row(cause) for cause in found.causes]
        for row in rows[1:]:
            row[0] = f"or {row[0]}"
        parts.append(table(HEADER, rows, full=True))
        if len(rows) > 1:
            parts.append(paragraph(EITHER))
    elif found.fit.p_value is not None and found.fit.p_value < UNLIKELY and not _told(found):
        text = "None of the faults that are known explains the residuals: load, tool, measuring "
        more = (
            "frame, drift, units, columns, a wrong pose, the zero of one joint, links of another "
            "length, friction, backlash or stiffness by sign of torque."
        )
        parts.append(paragraph(text + more))
    return parts


def _told(found: Calibration) -> bool:
    """Whether errors of joints or model, which visits tell, explain the residuals."""
    return found.noise is not None and found.fitted.common_noise


def _repetitions(found: Calibration, test: LackOfFit) -> str:
    """Whether repetitions agree among themselves better than with the model."""
    numbers = f"F = {test.F:.3g} for {test.dof[0]} and {test.dof[1]} degrees of freedom"
    numbers = f"{numbers}, p {shown_probability(test.p)}"
    who = "Repetitions of a pose"
    if found.noise is not None:
        who = "Visits of a pose" if found.noise.revisited else "Markers of a visit"
    if not test.seen:
        return f"{who} agree with the model as well as with each other ({numbers})."
    if found.noise is not None:
        return f"{who} agree with each other better than with the model ({numbers})."
    sigma = 1e3 * float(found.data.sigma[found.data.lengths].mean())
    used = ", which all standard deviations take into account" if found.fitted.common_noise else ""
    return (
        f"{who} agree with each other better than with the model ({numbers}): they "
        f"scatter by {test.pure_error * sigma:.2g} mm, and share {test.common * sigma:.2g} mm "
        f"that the model does not explain{used}."
    )


EITHER = (
    "These measurements cannot tell which of the causes it is, as both make nearly the same "
    "residuals in these poses. Other poses can: edtk plan --detect names one."
)
HEADER = (
    "what explains the residuals",
    "size",
    "std",
    "unit",
    "joint",
    "rows",
    "share of the misfit [%]",
    "p",
)


def _row(cause: Cause) -> list[str]:
    """One cause in cells."""
    return [
        "noise of another size" if cause.cause == NOISE else cause.cause.replace("_", " "),
        f"{cause.size:.3g}",
        "-" if cause.std is None else f"{float(f'{cause.std:.1g}'):g}",
        cause.unit or "-",
        cause.joint or "-",
        row_names(cause.rows).partition(" ")[2] if cause.rows else "all",
        f"{100 * cause.explained:.3g}",
        shown_probability(cause.p, 1).removeprefix("= "),
    ]
