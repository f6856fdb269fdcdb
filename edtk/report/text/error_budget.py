"""Text of an error budget."""

from edtk.model.error_budget import ErrorBudget

# Where something is measured, or loads the joints, that the budget does not know.
NO_BUDGET = (
    "no error budget: it knows neither distances and mixed instruments, nor weights beside a load; "
    "load, tool and rigid joints may add more than the noise does"
)


def error_budget(found: ErrorBudget) -> str:
    """The expected error in the task, with its parts."""
    parts = ", ".join(
        f"{name.replace('_', ' ')} {1e3 * part:.2g}" for name, part in found.parts.items()
    )
    return (
        f"total expected error {1e3 * found.total:.2g} mm (root mean square), "
        f"{1e3 * found.uncompensated:.2g} mm without compensation\n"
        f"  of it [mm]: {parts}\n"
        f"  to improve first: {ADVICE[found.largest]}"
    )


# What makes each part smaller.
ADVICE = {
    "noise": "measure more experiments, or with less noise",
    "model": "fit the loaded equilibrium",
    "load": "weigh the load, and measure its direction",
    "tool": "measure where the tool point and the marker are",
    "rigid_joints": "identify the joints that count as rigid too, or bound their compliances",
    "drift": "measure unloaded and loaded readings shortly after each other",
    "repeatability": "repeat the measurements",
}
