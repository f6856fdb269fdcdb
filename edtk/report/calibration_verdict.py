"""The verdict of a calibration: the accuracy to expect, and the diagnostics."""

import numpy as np

from edtk.calibration.calibration import Calibration
from edtk.calibration.finding import Kind
from edtk.model.error_budget import ErrorBudget
from edtk.report.page import verdict
from edtk.report.text.error_budget import assumed_joints

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
    "known_joints": "joints that count as known",
    "drift": "drift between unloaded and loaded readings",
    "repeatability": "the robot's repeatability",
}
LEAST = 1e-300  # keeps a compliance that is zero from being divided by


def calibration_verdict(found: Calibration) -> str:
    """The box at the top of the report, the most important line first."""
    harmful = [d for d in found.diagnostics if d.kind is Kind.DO_NOT_COMPENSATE]
    others = [d for d in found.diagnostics if d.kind is not Kind.DO_NOT_COMPENSATE]
    level = found.verdict
    if harmful:
        lines = [f"{_sentence(found, harmful[0].text)}."]
    elif level == "bad":
        lines = [QUALITY[level], *_untold(found)]
    else:
        lines = [f"{QUALITY[level]} {_expected(found)}".strip(), *_parts(found), *_facts(found)]
    lines += [_ended(_sentence(found, diagnostic.text)) for diagnostic in others]
    lines += [_ended(f"The study: {warning}") for warning in found.study.warnings]
    return verdict(level, lines)


def _ended(text: str) -> str:
    """The text with a full stop, unless it asks."""
    return text if text.endswith("?") else f"{text}."


def _sentence(found: Calibration, text: str) -> str:
    """The text with a capital letter, unless it begins with the name of a parameter."""
    text = text.replace("+-", "\N{PLUS-MINUS SIGN}")
    if text.startswith(found.parameters):
        return text
    return f"{text[:1].upper()}{text[1:]}"


def _expected(found: Calibration) -> str:
    """The accuracy to expect, in one sentence."""
    fit = found.fit
    if found.budget is None:
        k = np.maximum(np.abs(fit.k), LEAST)
        worst = int(np.argmax(fit.std / k))
        share = f"{100 * fit.std[worst] / k[worst]:.2g} %"
        return f"The least certain compliance is {found.parameters[worst]}, to {share}."
    place = f" {found.study.tasks.place}" if found.study.tasks else ""
    return (
        f"Expect a total error of {1e3 * found.budget.total:.2g} mm{place} after compensation, "
        f"instead of {1e3 * found.budget.uncompensated:.2g} mm without."
    )


def _parts(found: Calibration) -> list[str]:
    """The largest part of the error, what is assumed, and what the noise makes of it."""
    budget = found.budget
    if budget is None or found.expected is None or found.study.target is None:
        return []
    largest = budget.largest
    low, high = found.fit.accuracy(found.study.target)[1]
    interval = "" if low == high else f" (95 %: {1e3 * low:.2g} to {1e3 * high:.2g} mm)"
    noise = f"{1e3 * budget.noise:.2g} mm{interval}"
    poses = "pose" if found.expected.poses == 1 else "poses"
    around = (
        f"within {np.rad2deg(found.expected.within):.3g} deg of the test {poses} it makes "
        f"{1e3 * found.expected.mean:.2g} mm on average, and {1e3 * found.expected.largest:.2g} mm "
        "at most"
    )
    first = f"The largest part is {PARTS[largest]}, with {1e3 * budget.parts[largest]:.2g} mm"
    if largest == "noise":
        return [f"The largest part is {PARTS[largest]}, with {noise}; {around}.", *_assumed(budget)]
    rest = f". The noise alone makes {noise}; {around}."
    return [*_assumed(budget), f"{first}{rest}"]


def _untold(found: Calibration) -> list[str]:
    """Joints that the loads turn, and that are not fitted: what does not fit may be theirs."""
    joints = () if found.budget is None else found.budget.joints
    return [
        f"Joint {one.joint.name} counts as {'rigid' if one.joint.rigid else 'known'}, and the "
        "loads turn it: if nothing else explains the misfit, list it in joints.unknown."
        for one in joints
        if one.told < one.joint.std
    ]


def _assumed(budget: ErrorBudget) -> list[str]:
    """What of the total was measured, and what rests on joints that nobody measured."""
    joints = assumed_joints(budget)
    if not joints:
        return []
    named = "; ".join(joints).replace("+-", "\N{PLUS-MINUS SIGN}")
    return [f"Of the total, what was measured makes {1e3 * budget.measured:.2g} mm. {named}."]


def _facts(found: Calibration) -> list[str]:
    """What is in order; nothing where a finding says otherwise."""
    noted = {diagnostic.kind for diagnostic in found.diagnostics}
    if noted - {Kind.GAINS_LITTLE}:
        return []
    noise = "the noise was estimated and is not larger than stated"
    if found.fit.known:
        noise = "the residuals fit the noise"
    facts = f"{noise}, there are no outliers, and all compliances are positive."
    if noted or (found.budget and found.budget.rigid_joints) or found.study.warnings:
        return [f"{facts[0].upper()}{facts[1:]}"]
    return [f"Nothing is wrong: {facts}"]
