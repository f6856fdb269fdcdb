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
