"""The verdict of a calibration: the accuracy to expect, and the diagnostics."""

import numpy as np

from edtk.calibration.calibrate import Calibration
from edtk.report.page import verdict

QUALITY = {
    "good": "Good calibration.",
    "usable": "Usable calibration, with a warning.",
    "bad": "Do not use this calibration yet.",
}
# Words for the parts of an error budget.
PARTS = {
    "noise": "the noise of the measurements",
    "model": "the linear model",
    "load": "an uncertain load",
    "tool": "an uncertain tool point",
    "rigid_joints": "joints that count as rigid",
    "drift": "drift between unloaded and loaded readings",
    "repeatability": "the robot's repeatability",
}
LEAST = 1e-300  # keeps a compliance that is zero from being divided by


def calibration_verdict(found: Calibration) -> str:
    """The box at the top of the report, the most important line first."""
    quality = QUALITY[found.verdict]
    usable = found.verdict != "bad"
    lines = [f"{quality} {_expected(found)}" if usable else quality]
    if not found.diagnostics:
        noise = "the noise was estimated and is not larger than stated"
        if found.fit.known:
            noise = "the residuals fit the noise"
        facts = f"{noise}, there are no outliers, all compliances are positive."
        lines.append(
            f"{facts[0].upper()}{facts[1:]}" if found.diagnostics else f"Nothing is wrong: {facts}"
        )
    if found.expected is not None and usable:
        lines.append(f"{_sentence(found, str(found.expected))}.")
    lines += [f"{_sentence(found, diagnostic.text)}." for diagnostic in found.diagnostics]
    if found.study.rigid and usable:
        lines.append(f"{_sentence(found, found.study.rigid)}.")
    return verdict(found.verdict, lines)


def _sentence(found: Calibration, text: str) -> str:
    """The text with a capital letter, unless it begins with the name of a parameter."""
    if text.startswith(found.study.model.parameters):
        return text
    return f"{text[:1].upper()}{text[1:]}"


def _expected(found: Calibration) -> str:
    """The accuracy to expect, in one or two sentences."""
    fit = found.fit
    task = found.study.task
    if task is None:
        k = np.maximum(np.abs(fit.k), LEAST)
        worst = int(np.argmax(fit.std / k))
        share = f"{100 * fit.std[worst] / k[worst]:.2g} %"
        return f"The least certain compliance is {found.study.model.parameters[worst]}, to {share}."
    if found.budget is None:
        return ""
    total = f"{1e3 * found.budget.total:.2g} mm"
    largest = found.budget.largest
    without = f"{1e3 * found.budget.uncompensated:.2g} mm"
    low, high = fit.accuracy(task.target)[1]
    interval = "" if low == high else f", between {1e3 * low:.2g} and {1e3 * high:.2g} mm (95 %)"
    return (
        f"Expect a total error of {total} (root mean square) {task.place} after compensation, and "
        f"{without} without. The largest part is {PARTS[largest]}: "
        f"{1e3 * found.budget.parts[largest]:.2g} mm; the noise alone makes "
        f"{1e3 * found.budget.noise:.2g} mm{interval}."
    )
