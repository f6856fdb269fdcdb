"""The verdict of a calibration: the accuracy to expect, and the diagnostics."""

import numpy as np

from edtk.calibration.calibrate import Calibration
from edtk.report.page import verdict

QUALITY = {
    "good": "Good calibration.",
    "warn": "Usable calibration, with a warning.",
    "bad": "Do not use this calibration yet.",
}
LEAST = 1e-300  # keeps a compliance that is zero from being divided by


def calibration_verdict(found: Calibration) -> str:
    """The box at the top of the report, the most important line first."""
    quality = QUALITY[found.verdict]
    usable = found.verdict != "bad"
    lines = [f"{quality} {_expected(found)}" if usable else quality]
    if found.verdict == "good":
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
    value, (low, high) = fit.accuracy(task.target)
    place = task.place
    rho0 = f"{1e3 * value:.2g}"
    text = f"Expect an error of {rho0} mm (root mean square) {place} after compensation"
    text += "." if low == high else f", between {1e3 * low:.2g} and {1e3 * high:.2g} mm (95 %)."
    if found.rho0_bias is None:
        return text
    both = f"{1e3 * np.hypot(value, found.rho0_bias):.2g}"
    if both == rho0:
        return text
    return f"{text} With the error of the linear model it is {both} mm."
