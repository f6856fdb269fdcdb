"""The sentence of faults that explain residuals."""

from edtk.calibration.cause_wording import cause_wording
from edtk.calibration.finding import Finding


def causes_wording(found: Finding) -> str:
    """A fault that explains the residuals, or two of which it is one."""
    cause = found.data["cause"]
    others = found.data["others"]
    share = f"{100 * cause.explained:.3g} % of the misfit (p = {cause.p:.1g})"
    if not others:
        return f"{cause_wording(cause)}: that explains {share}"
    either = ", or ".join(cause_wording(one) for one in (cause, *others))
    times = others[0].times
    which = "these measurements cannot tell which"
    if times is not None and times > 1:
        which += f", measuring each experiment {times} times could"
    return f"{either}: {which}; the first explains {share}"


def no_cause_wording(found: Finding) -> str:
    """A misfit that no fault explains, and what would tell more."""
    tells = []
    if not found.data["repeated"]:
        tells.append("each pose measured twice, which tells noise from model")
    if not found.data["loads"]:
        tells.append("a pose under half the load and along another axis, which tells what bends")
    tells.append(
        "positions without load in many poses, which tell the geometry (docs/howto/geometry.md)"
    )
    return (
        "no cause in the list explains this: the model. Something bends, slips or is placed "
        f"otherwise than in the study; more would tell {'; '.join(tells)}"
    )
