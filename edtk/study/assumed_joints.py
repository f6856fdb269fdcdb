"""What a study takes of the joints that it does not identify, and how far that may be off."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from edtk.model.assumed_joint import (
    SAMPLE,
    SHORTEST,
    AssumedJoint,
    Likely,
    as_neighbours,
    by_load,
    levers,
)
from edtk.system.typing import Array

if TYPE_CHECKING:
    from edtk.study.study import Study

KNOWN = "known_rad_per_Nm"


def assumed_joints(study: "Study", k: Array | None = None) -> tuple[AssumedJoint, ...]:
    """List the joints that are not identified, from base to tip.

    A known joint may be off by its standard deviation. A revolute joint without a known compliance
    counts as rigid, and is off by the compliance that it has. That is what the study says of it
    (`rigid_rad_per_Nm`, then `[simulation]`), or else follows from its neighbours by load capacity,
    see `as_neighbours`, and without any from the load.

    Args:
        study: The study.
        k: Compliances (p,) of the unknown joints; default to those of [simulation], as far as it
            has any [rad/(N m)].
    """
    known = study.specification.joints.known
    likely = likely_compliances(study, k)
    found = []
    for index, joint in enumerate(study.robot.joints):
        if index in study.unknown:
            continue
        if joint.name in known:
            one = known[joint.name]
            found.append(AssumedJoint(joint.name, index, one.value, one.deviation, KNOWN))
        elif joint.name in likely:
            size, source = likely[joint.name].compliance, likely[joint.name].source
            found.append(AssumedJoint(joint.name, index, 0.0, size, source))
    return tuple(found)


def likely_compliances(study: "Study", k: Array | None = None) -> dict[str, Likely]:
    """The compliance that each revolute joint is likely to have, by name.

    Args:
        study: The study.
        k: Compliances (p,) of the unknown joints, those that are not positive count as not known;
            default to those of [simulation].
    """
    given = study.specification
    simulated = {} if given.simulation is None else given.simulation.compliance_rad_per_Nm
    told = {name: Likely(size, "[simulation]") for name, size in simulated.items()}
    stated = given.uncertainty.rigid_rad_per_Nm
    told |= {name: Likely(size, "rigid_rad_per_Nm") for name, size in stated.items()}
    near = _neighbours(study, simulated, k)
    lever = levers(study.robot)
    force = _force(study)
    found = {}
    for j, joint in enumerate(study.robot.joints):
        if joint.kind == "revolute":
            guess = as_neighbours(lever, near, j, study.robot.joint_names) if near else None
            found[joint.name] = told.get(joint.name) or guess or by_load(float(lever[j]), force)
    return found


def _neighbours(
    study: "Study", simulated: Mapping[str, float], k: Array | None
) -> dict[int, float]:
    """Compliances of the revolute joints of which something is known, by index [rad/(N m)]."""
    joints = study.robot.joints
    unknown = study.specification.joints.unknown
    sizes = dict(simulated) if k is None else dict(zip(unknown, k.tolist(), strict=True))
    near = study.known | {study.robot.joint_names.index(name): k for name, k in sizes.items()}
    return {j: size for j, size in near.items() if size > 0 and joints[j].kind == "revolute"}


def _force(study: "Study") -> float:
    """Size of the largest load of the study at the tool point, torques by the reach [N]."""
    given = study.specification
    if given.load is None and given.payload is None:
        return 0.0
    load = given.build_load()
    cube = np.random.default_rng(0).random((SAMPLE, load.limits.shape[1]))
    wrench = load.wrench(load.draw(cube))
    size = np.linalg.norm(wrench[:, :3], axis=1)
    turn = np.linalg.norm(wrench[:, 3:], axis=1)
    return float((size + turn / max(study.robot.reach, SHORTEST)).max())
