"""The accuracy to expect in each of several test poses, as a table."""

import numpy as np

from edtk.model.task_accuracy import TaskAccuracy
from edtk.system.typing import Array, Indices

TOOL_POINT = "the tool point"
MOST_ROWS = 60  # of a table that a person reads


def task_table(found: TaskAccuracy) -> tuple[list[str], list[list[str]]]:
    """Header and rows, of very many poses some that are evenly spread, and the worst one.

    Lengths along the path stand there for a path, weights where they differ, displacements without
    compensation where compliances are known, and total errors where circumstances are.

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
    by_noise = ["error [mm]", "95 % of the errors [mm]"]
    if found.total is not None:
        header.append("total error [mm]")
        by_noise = ["by noise [mm]", "95 % of those [mm]"]
    header += by_noise
    rows = []
    for i in shown_poses(found):
        row = [f"{i + 1}{' (worst)' if i == _marked(found) else ''}"]
        if found.is_path:
            row.append(f"{1e3 * found.along[i]:.0f}")
        if weighted:
            row.append(f"{found.weight[i]:g}")
        if found.before is not None:
            row.append(_millimetres(found.before[i]))
        if found.total is not None:
            row.append(_millimetres(found.total[i]))
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
    return np.union1d(spread, _marked(found))


def _marked(found: TaskAccuracy) -> int:
    """The worst pose, by the total error where that is known."""
    return found.worst_of(found.error if found.total is None else found.total)


def task_sentence(found: TaskAccuracy, of: str = TOOL_POINT) -> str:
    """The mean and the worst, and how many poses the table shows.

    Args:
        found: The accuracy.
        of: Whose errors they are.
    """
    shown = len(shown_poses(found))
    count = len(found.error)
    some = "" if shown == count else f" The table shows {shown} of the {count} poses."
    weighted = ", weighted" if len(set(found.weight.tolist())) > 1 else ""
    noise = found.error
    over = f"over the {count} poses (root mean square{weighted})"
    if found.total is None:
        return (
            f"The error of {of} after compensation is "
            f"{_mean_and_worst(found, noise, over)}. It comes from the noise of the measurements "
            f"alone.{some}"
        )
    return (
        f"The total error of {of} after compensation is "
        f"{_mean_and_worst(found, found.total, over)}. The noise of the measurements alone makes "
        f"{_mean_and_worst(found, noise, 'of it')}.{some}"
    )


def _mean_and_worst(found: TaskAccuracy, errors: Array, over: str) -> str:
    """The mean of some errors (t,), and the worst with its pose."""
    worst = found.worst_of(errors)
    return (
        f"{1e3 * found.mean_of(errors):.3g} mm {over}, and {1e3 * errors[worst]:.3g} mm in the "
        f"worst of them, pose {worst + 1}"
    )
