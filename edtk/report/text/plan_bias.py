"""Text of a plan's bias."""

import numpy as np

from edtk.calibration.plan_bias import PlanBias
from edtk.report.text_table import name_width


def plan_bias(found: PlanBias) -> str:
    """A line for each parameter, and the error in the test pose."""
    b = found.bias
    width = name_width(found.parameters, 7)
    lines = [
        f"{found.experiments} experiments on the loaded equilibrium, identified with the linear "
        "model",
        f"{'param':{width}}{'true':>11} {'bias':>11} {'std':>10} {'bias/std':>10} {'bias %':>9}",
    ]
    rows = zip(found.parameters, b.true, b.bias, b.std, b.in_std, b.percent, strict=True)
    for name, true, bias, std, in_std, percent in rows:
        lines.append(
            f"{name:{width}}{true:11.4g} {bias:+11.3g} {std:10.4g} {in_std:+10.4g} {percent:+9.4g}"
        )
    lines.append(f"compliances in {found.unit}")
    if found.rho0 is not None and found.rho0_bias is not None:
        both = float(np.hypot(found.rho0, found.rho0_bias))
        place = f"{found.poses} test poses" if found.poses > 1 else "test pose"
        lines.append(
            f"{place}: noise leaves rho0 = {1e3 * found.rho0:.4g} mm, the bias "
            f"{1e3 * found.rho0_bias:.4g} mm, both {1e3 * both:.4g} mm (root mean square)"
        )
    return "\n".join(lines)
