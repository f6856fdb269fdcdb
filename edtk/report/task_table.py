"""The accuracy to expect in each of several test poses, as a table."""

import numpy as np

from edtk.inference.task_accuracy import TaskAccuracy
from edtk.system.typing import Indices

MOST_ROWS = 60  # of a table that a person reads


def task_table(found: TaskAccuracy) -> tuple[list[str], list[list[str]]]:
    """Header and rows, of very many poses some that are evenly spread, and the worst one.

    Lengths along the path stand there for a path, weights where they differ, and displacements
    without compensation where compliances are known.

    Args:
        found: The accuracy.
    """
    header = ["pose"]
    weighted = len(set(found.weight.tolist())) > 1
    if found.is_path:
        header.append("along the path [mm]")
    if weighted:
        header.append("weight")
    if found.before is not None:
        header.append("without compensation [mm]")
    header += ["error [mm]", "95 % of the errors [mm]"]
    rows = []
    for i in shown_poses(found):
        row = [f"{i + 1}{' (worst)' if i == found.worst else ''}"]
        if found.is_path:
            row.append(f"{1e3 * found.along[i]:.0f}")
        if weighted:
            row.append(f"{found.weight[i]:g}")
        if found.before is not None:
            row.append(_millimetres(found.before[i]))
        low, high = 1e3 * found.band[i]
        rows.append([*row, _millimetres(found.error[i]), f"{low:.2g} to {high:.2g}"])
    return header, rows


def _millimetres(length: float) -> str:
    """Three digits of a length, zeros at its end included."""
    return f"{1e3 * length:#.3g}".rstrip(".")


def shown_poses(found: TaskAccuracy) -> Indices:
    """Indices of the poses in the table, in their order."""
    count = len(found.error)
    if count <= MOST_ROWS:
        return np.arange(count)
    spread = np.linspace(0, count - 1, MOST_ROWS - 1).astype(int)
    return np.union1d(spread, found.worst)


def task_sentence(found: TaskAccuracy) -> str:
    """The mean and the worst, and how many poses the table shows."""
    shown = len(shown_poses(found))
    count = len(found.error)
    some = "" if shown == count else f" The table shows {shown} of the {count} poses."
    weighted = ", weighted" if len(set(found.weight.tolist())) > 1 else ""
    return (
        f"The error of the tool point after compensation is {1e3 * found.mean:.3g} mm over the "
        f"{count} poses (root mean square{weighted}), and {1e3 * found.error[found.worst]:.3g} mm "
        f"in the worst of them, pose {found.worst + 1}. It comes from the noise of the "
        f"measurements alone.{some}"
    )
