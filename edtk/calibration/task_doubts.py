"""What looks like another unit in a task and its compliances, before commands are believed."""

from collections.abc import Iterator

import numpy as np

from edtk.design.plan import Plan
from edtk.study.study import Study
from edtk.system.typing import Array
from edtk.tables.compliances import Compliances

FACTOR = 10.0  # up to which a ratio is that of units which are a thousand apart
A_THOUSAND = 1e3
# Displacement over the arm's reach beyond which no arm is used: it would give way by decimetres.
FAR = 0.05


def task_doubts(study: Study, found: Compliances, task: Plan) -> tuple[str, ...]:
    """Compare poses, loads and compliances with the sizes that they have in their units.

    Args:
        study: Robot, test poses, and assumed compliances.
        found: Compliances by joint [rad/(N m)].
        task: Desired poses and wrenches.

    Returns:
        A sentence for each that looks like another unit; none where all is plausible.
    """
    return (*_angles(study, task.q), *_forces(study, task.wrench), *_sizes(study, found, task))


def _angles(study: Study, q: Array) -> Iterator[str]:
    """Poses that differ, all within 2 pi degrees of zero."""
    turning = [
        j
        for j, joint in enumerate(study.robot.joints)
        if joint.kind == "revolute" and j not in study.fixed
    ]
    degrees = np.rad2deg(study.robot.shown(q)[:, turning])
    if turning and np.abs(degrees).max() <= 2 * np.pi and np.ptp(degrees, axis=0).any():
        yield (
            "all joint angles of the task are within 6.3 degrees of zero: are they in radians? "
            "expected degrees"
        )


def _forces(study: Study, wrench: Array) -> Iterator[str]:
    """Forces a thousand times smaller, or larger, than those of the study's test poses."""
    known = np.concatenate([np.atleast_2d(one.wrench)[:, :3] for one in study.tasks])
    expected = float(np.linalg.norm(known, axis=1).max())
    applied = float(np.linalg.norm(wrench[:, :3], axis=1).max())
    for factor, unit in ((1 / A_THOUSAND, "kilonewtons"), (A_THOUSAND, "millinewtons")):
        if _is_near(applied, factor * expected):
            ratio = applied / expected
            yield (
                f"the forces of the task are {ratio:.2g} times those of the study's test pose: are "
                f"they in {unit}? expected newtons"
            )


def _sizes(study: Study, found: Compliances, task: Plan) -> Iterator[str]:
    """Compliances a thousand times those assumed, or by which the load moves the arm far."""
    simulation = study.specification.simulation
    given = {} if simulation is None else simulation.compliance_rad_per_Nm
    of_joints = zip(found.joints, found.k, strict=True)
    ratios = np.array([k / given[name] for name, k in of_joints if k > 0 and name in given])
    if len(ratios) and _is_near(float(np.median(ratios)), A_THOUSAND):
        yield (
            f"the compliances are {np.median(ratios):.2g} times those of the study's [simulation]: "
            "are they in rad/(kN m)? expected rad/(N m)"
        )
        return
    moved = _displacement(study, found, task)
    if moved > FAR * study.robot.reach:
        yield (
            f"by these compliances the load moves the tool by {1e3 * moved:.2g} mm, which no arm "
            "is used with; expected compliances in rad/(N m), and loads in newtons"
        )


def _displacement(study: Study, found: Compliances, task: Plan) -> float:
    """What the load moves the tool point by, to the first order and at most [m]."""
    robot = study.robot
    joints = [robot.joint_names.index(name) for name in found.joints]
    J = robot.jacobian(task.q)[:, :, joints]
    torque = np.einsum("trj,tr->tj", J, task.wrench)
    moved = np.einsum("trj,tj->tr", J[:, :3], torque * found.k)
    return float(np.linalg.norm(moved, axis=1).max())


def _is_near(size: float, other: float) -> bool:
    """Whether two sizes are within a factor of ten."""
    return 0 < other / FACTOR < size < other * FACTOR
