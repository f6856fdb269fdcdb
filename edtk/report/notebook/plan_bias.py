"""Table of a plan's bias, for a notebook."""

from edtk.calibration.plan_bias import PlanBias
from edtk.report.notebook_table import notebook_table


def plan_bias(found: PlanBias) -> str:
    """A row for each compliance."""
    rows = [
        [name, f"{true:.4g}", f"{bias:+.3g}", f"{std:.3g}", f"{in_std:+.3g}"]
        for name, true, bias, std, in_std in zip(
            found.parameters,
            found.bias.true,
            found.bias.bias,
            found.bias.std,
            found.bias.in_std,
            strict=True,
        )
    ]
    header = ["parameter", f"true [{found.unit}]", "bias", "std", "bias/std"]
    return notebook_table(found.headline(), header, rows)
