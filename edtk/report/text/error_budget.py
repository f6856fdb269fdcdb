"""Text of an error budget."""

from edtk.model.error_budget import ErrorBudget, JointPart

SHARE = 0.01  # of the total, from which a joint that is not identified is named
# What the parts leave out where displacements are counted from the rigid robot.
NOT_IN_IT = "errors of the robot's geometry, and of its place in the measuring frame"


def error_budget(found: ErrorBudget) -> str:
    """The expected error in the task, with its parts."""
    parts = ", ".join(
        f"{name.replace('_', ' ')} {1e3 * part:.2g}" for name, part in found.parts.items()
    )
    without = f"  not in it: {NOT_IN_IT}\n" if found.absolute else ""
    joints = "".join(f"  {line}\n" for line in assumed_joints(found))
    return (
        f"total expected error {1e3 * found.total:.2g} mm (root mean square), "
        f"{1e3 * found.uncompensated:.2g} mm without compensation\n"
        f"  of it [mm]: {parts}\n{joints}{without}"
        f"  to improve first: {ADVICE[found.largest]}"
    )


def assumed_joints(found: ErrorBudget) -> list[str]:
    """A sentence for each joint that is not identified, with its part of the total."""
    return [assumed_joint(part) for part in found.joints if part.error > SHARE * found.total]


def assumed_joint(part: JointPart) -> str:
    """What is assumed of a joint, and what that makes of the error."""
    joint = part.joint
    error = f"{1e3 * part.error:.2g} mm"
    told = ""
    if part.told < joint.std:
        told = f"; the measurements tell it to {part.told:.1g}: list it in joints.unknown"
    if joint.rigid:
        size = f"{joint.std:.2g} rad/(N m)"
        rigid = f"which counts as rigid: {size} assumed, {joint.source}"
        return f"{error} by {joint.name}, {rigid}{told}"
    known = f"{joint.compliance:.2g} +- {joint.std:.1g} rad/(N m)"
    return f"{error} by {joint.name}, which counts as known: {known}{told}"


# What makes each part smaller.
ADVICE = {
    "noise": "measure more experiments, or with less noise",
    "model": "fit the loaded equilibrium",
    "load": "weigh the load, and measure its direction",
    "tool": "measure where the tool point and the marker are",
    "rigid_joints": "identify the joints that count as rigid too, or bound their compliances",
    "known_joints": "identify the joints that count as known too, or state a smaller std",
    "drift": "measure unloaded and loaded readings shortly after each other",
    "repeatability": "repeat the measurements",
}
