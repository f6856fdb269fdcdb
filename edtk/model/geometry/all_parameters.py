"""All parameters that a calibration of a chain, its base, its tools and its springs may have."""

from collections.abc import Mapping, Sequence
from typing import Literal

from edtk.model.geometry.geometric_parameter import COMPONENTS, SHIFTS, GeometricParameter
from edtk.model.robot import Robot

ALONG = 1 - 1e-9  # cosine beyond which a component is the one along the joint's axis
KINDS = ("zeros", "lengths", "tilts")


def all_parameters(
    robot: Robot,
    markers: Sequence[str],
    geometry: Literal["all"] | Sequence[str] = "all",
    compliance: Sequence[str] = (),
    base: bool = True,
    tool: bool = True,
    pose: bool = False,
    likely: Mapping[str, float] | None = None,
) -> tuple[GeometricParameter, ...]:
    """List the parameters that a calibration asks for, whether they can be told apart or not.

    Args:
        robot: The drawing.
        markers: Names of the markers, each of which has a place of its own.
        geometry: "all", or a list of joints ("q2": all six before it), of kinds ("zeros" of the
            joints, "lengths" and "tilts") and of single parameters ("q2.rx").
        compliance: Names of free joints with unknown springs.
        base: Whether the place of the robot is unknown.
        tool: Whether the places of the markers on the tool are.
        pose: Whether rotations are measured, so that the tool has three angles too.
        likely: Compliances that joints are likely to have, by name [rad/(N m)]; none by default.

    Returns:
        Base, tools, joints from base to tip, springs.

    Raises:
        ValueError: The chain has no such joint, kind or parameter.
    """
    slides = {joint.name: joint.kind == "prismatic" for joint in robot.joints}
    of_joints = _chosen(_of_joints(robot), geometry)
    components = COMPONENTS if pose else SHIFTS
    of_base = [GeometricParameter("base", "", c) for c in COMPONENTS if base]
    of_tools = [GeometricParameter("tool", n, c) for n in markers for c in components if tool]
    springs = [
        GeometricParameter("compliance", n, slides=slides[n], likely=(likely or {}).get(n))
        for n in compliance
    ]
    return (*of_base, *of_tools, *of_joints, *springs)


def _of_joints(robot: Robot) -> list[GeometricParameter]:
    """Six before each joint of the chain, that along its axis marked."""
    found = []
    for joint in robot.chain:
        turns = joint.kind == "revolute"
        for i, component in enumerate(COMPONENTS):
            own = abs(joint.axis[i % 3]) > ALONG and (i >= len(SHIFTS)) == turns
            found.append(GeometricParameter("joint", joint.name, component, along=bool(own)))
    return found


def _chosen(
    every: list[GeometricParameter], geometry: Literal["all"] | Sequence[str]
) -> list[GeometricParameter]:
    """Those of the list.

    Raises:
        ValueError: An entry names none.
    """
    if isinstance(geometry, str):
        if geometry != "all":
            raise ValueError(f"geometry {geometry!r}; expected 'all' or a list")
        return every
    chosen: set[str] = set()
    for entry in geometry:
        named = {one.name for one in every if entry in (one.name, one.of, one.kind)}
        if not named:
            joints = ", ".join(dict.fromkeys(one.of for one in every))
            raise ValueError(
                f"no parameter {entry!r}; expected 'all', or some of {', '.join(KINDS)}, of the "
                f"joints {joints}, or of their components such as {every[-1].name}"
            )
        chosen |= named
    return [one for one in every if one.name in chosen]
