"""The chances that a plan shows faults, and tells them apart, as lines of text."""

from collections.abc import Sequence

from edtk.design.detection import Detection
from edtk.design.separation import ENOUGH, Separation
from edtk.model.robot import Robot
from edtk.tables.in_file_units import in_file_units


def shown_faults(
    robot: Robot,
    detections: Sequence[Detection],
    separations: Sequence[Separation],
    unknown: str = "compliances",
) -> list[str]:
    """A line for each fault, and for each two of them, with what would help.

    Args:
        robot: The robot, which says the units of the joints.
        detections: The chances that faults are noticed.
        separations: The chances that they are told apart.
        unknown: What may take up a fault.
    """
    return [
        *(_detection(robot, detection, unknown) for detection in detections),
        *(_separation(robot, separation) for separation in separations),
    ]


def _detection(robot: Robot, found: Detection, unknown: str) -> str:
    """The chance that a fault is noticed, with the experiment that would help."""
    what = _fault(found)
    if found.never:
        return f"{what}: never noticed, {unknown} take it up"
    chance = f"{what}: noticed with {100 * found.power:.0f} %"
    if found.better is None or round(100 * found.power_with) == round(100 * found.power):
        return chance
    pose = ", ".join(f"{x:.2f}" for x in in_file_units(robot, found.better[None])[0])
    return f"{chance}, with one more experiment {100 * found.power_with:.0f} %, at {pose}"


def _fault(found: Detection) -> str:
    """A fault with its joint and size."""
    where = f" of {found.joint}" if found.joint else ""
    return f"{found.fault}{where} {found.size:g} {found.unit}"


def _separation(robot: Robot, found: Separation) -> str:
    """The chance that of two faults the right one is named, and what would help."""
    what = " or ".join(_fault(fault) for fault in found.faults)
    chance = f"{what}: told apart with {100 * found.right:.0f} %"
    if found.right >= ENOUGH:
        return chance
    if found.times is not None:
        chance += f"; {100 * ENOUGH:.0f} % if each experiment is measured {found.times} times"
    if found.better is None:
        return chance
    pose = ", ".join(f"{x:.2f}" for x in in_file_units(robot, found.better[None])[0])
    return f"{chance}; {100 * found.right_with:.0f} % with one more experiment, at {pose}"
