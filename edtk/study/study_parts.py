"""Tasks, prior, feasible set and robot that a study names."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import criteria
from edtk.design.plan import Plan
from edtk.fit.prior import Normal, Prior
from edtk.measure.compliances import load_compliances
from edtk.measure.parameters import springs_asked
from edtk.measure.pose_table import (
    of_file_units,
)
from edtk.measure.task import Task, Tasks
from edtk.robots.constraints.excluded import Excluded
from edtk.robots.joint import AT_LIMIT
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Beyond, Robot
from edtk.robots.robot_file import RobotAndMore, RobotFileError, robot_from_dict
from edtk.robots.weights import DeadWeights
from edtk.robots.workspace import Workspace, within_margin
from edtk.study.asked import Asked
from edtk.study.schema import Specification
from edtk.study.study_model import giving_way, other_springs, own_task_weights
from edtk.study.tables_of_robot import KnownCompliance
from edtk.study.tables_of_task import PayloadTable, TaskTable, TestPose
from edtk.system.errors import UserError, note
from edtk.system.typing import Array

MOST_POSES = 1000  # of a path that count; more would cost minutes, and tell no more
ASYMMETRY = 1e-6  # relative: printed digits of a covariance may differ by that
LEAST_STD = 1e-20  # [rad/(N m)]: a compliance that is known so well is no prior
TOO_CERTAIN = f"expected standard deviations of at least {LEAST_STD:g} rad/(N m)"
NO_VARIANCE = 2  # degrees of freedom up to which Student's t has no variance
KEY_OF_KIND = {"revolute": "limits_deg", "prismatic": "limits_mm"}
LINKS = ("base_link", "tip_link")


@dataclass(frozen=True, eq=False)
class TaskDefaults:
    """What kinds of studies say otherwise of a task.

    Attributes:
        weights: Gives all that loads the joints besides a wrench, for the payload of a task.
        tool: The tool of a task that names none; None where its markers count then.
        wrench: The load (6,) of a row of a path that names none; None where it has to.
    """

    weights: Callable[[Asked, PayloadTable | None], DeadWeights | None]
    tool: Array | None
    wrench: Array | None


def study_tasks(study: Asked, others: TaskDefaults) -> Tasks:
    """The poses in which the robot shall be accurate, in their order; there may be none.

    Raises:
        UserError: The file of a path cannot be read, or has a pose that the robot cannot take;
            names the row and the column.
    """
    given = study.specification
    if given.task is not None:
        task = _task(study, given.task, others)
        load = others.wrench if given.task.load is None else given.task.load.build()
        pairs = zip(*_of_file(study, given.task.file, load), strict=True)
        return Tasks(replace(task, q=q, wrench=wrench) for q, wrench in pairs)
    return Tasks(
        replace(
            _task(study, pose, others),
            q=of_file_units(study.robot, np.array(pose.q_deg)),
            wrench=np.zeros(6) if pose.load is None else pose.load.build(),
            weight=pose.weight,
        )
        for pose in given.test_poses
    )


def _task(study: Asked, table: TestPose | TaskTable, others: TaskDefaults) -> Task:
    """What test poses and paths say alike; in the zero pose, without a load."""
    return Task(
        q=np.zeros(study.robot.n),
        tool=others.tool if table.tool is None else table.tool.build(),
        wrench=np.zeros(6),
        robot=study.robot,
        unknown=study.unknown,
        within=float(np.deg2rad(table.robust_deg)),
        lever=table.lever_mm / 1e3,
        dead_weights=others.weights(study, table.payload),
        carries=table.payload is not None,
        own_weights=own_task_weights(study),
        gives=giving_way(study, brought=True),
    )


def _of_file(study: Asked, file: str, load: Array | None) -> tuple[Array, Array]:
    """Poses and wrenches of a path, a row each; a long path is thinned, with a note."""
    path = study.folder / file
    plan = Plan.from_csv(path, study.robot, study.fixed, load)
    check_limits(study, plan.q)
    count = len(plan.q)
    rows = np.unique(np.linspace(0, count - 1, min(count, MOST_POSES)).round().astype(int))
    if len(rows) < count:
        note(
            f"{len(rows)} of {count} poses count, evenly spread from the first row to the last, "
            "and are numbered among themselves",
            path,
        )
    return plan.q[rows], plan.wrench[rows]


def check_limits(study: Asked, q: Array) -> None:
    """Check that the robot can take all poses (t, n): the test poses, or the rows of a path.

    Raises:
        UserError: It cannot take one of them; names it.
    """
    outside = study.robot.bounds.excess(q) > AT_LIMIT
    if outside.any():
        i = int(outside.any(axis=1).argmax())
        rows = np.flatnonzero(outside[i])
        raise _beyond(study, i, Beyond.of(study.robot, q[i], rows[0]), len(rows) - 1)


def _beyond(study: Asked, index: int, beyond: Beyond, more: int) -> UserError:
    """The error of a pose that is beyond a joint's limits, as the controller shows them."""
    low, high = beyond.limits
    others = f", and {more} more" if more else ""
    message = (
        f"the robot cannot take this pose: joint {beyond.name} is at {beyond.value:.6g}, beyond "
        f"its limits {low:.6g} .. {high:.6g}{others}"
    )
    given = study.specification.task
    if given is None:
        return study.error(f"{study.key_of(index)}.q_deg", message)
    return UserError(message, where=Path(study.folder / given.file), key=f"row {index + 1}")


def study_prior(study: Asked) -> Prior:
    """Build the prior of a study's unknown compliances, which are positive, from its [prior] table.

    Raises:
        UserError: The table names another joint, its covariance is no covariance, or its file
            cannot be read.
    """
    table = study.specification.prior
    unknown = study.specification.joints.unknown
    springs = tuple(one.name.removeprefix("k_") for one in other_springs(study))
    for name in table.joints:
        if name not in (*unknown, *springs):
            listed = ", ".join((*unknown, *springs))
            message = f"{name!r} is no unknown joint; expected {listed}"
            raise study.error("prior.joints", message)
    marginals = tuple(table.joints.get(name, table.all).build() for name in unknown)
    if table.earlier_file is not None:
        return Prior(marginals, _from_file(study, table.earlier_file))
    if table.earlier is not None:
        return Prior(marginals, _from_table(study))
    return Prior(marginals)


def _from_table(study: Asked) -> Normal:
    """The normal prior that the study's file states itself."""
    unknown = study.specification.joints.unknown
    earlier = study.specification.prior.earlier
    assert earlier is not None
    mean = earlier.mean_rad_per_Nm
    if set(mean) != set(unknown):
        message = f"expected one value each for {', '.join(unknown)}"
        raise study.error("prior.earlier.mean_rad_per_Nm", message)
    p = len(unknown)
    rows = earlier.covariance
    if len(rows) != p or any(len(row) != p for row in rows):
        message = f"expected {p} rows of {p} numbers, one per unknown joint"
        raise study.error("prior.earlier.covariance", message)
    covariance = np.array(rows)
    not_positive = study.error(
        "prior.earlier.covariance", "expected a symmetric, positive definite matrix"
    )
    if not np.allclose(covariance, covariance.T, rtol=ASYMMETRY, atol=0):
        raise not_positive
    if 0 < np.diag(covariance).min() < LEAST_STD**2:
        raise study.error("prior.earlier.covariance", TOO_CERTAIN)
    try:
        return Normal(np.array([mean[name] for name in unknown]), covariance)
    except np.linalg.LinAlgError:
        raise not_positive from None


def _from_file(study: Asked, name: str) -> Normal:
    """The result of an earlier calibration, as `edtk identify` has written it.

    Where sigma was estimated the covariance is widened to that of Student's t.
    """
    unknown = study.specification.joints.unknown
    key = "prior.earlier_file"
    try:
        found = load_compliances(study.folder / name, study.robot.joint_names, unknown)
    except UserError as error:
        place = name if error.key is None else f"{name}: {error.key}"
        raise study.error(key, f"{place}: {error.message}") from error
    not_positive = study.error(
        key, f"{name}: expected a positive definite covariance, or std, beside k"
    )
    if found.covariance is None:
        raise not_positive
    dof = found.covariance_dof
    if dof <= NO_VARIANCE:
        message = f"{name}: expected a covariance_dof above {NO_VARIANCE}, or no variance is finite"
        raise study.error(key, message)
    wider = dof / (dof - NO_VARIANCE) if np.isfinite(dof) else 1.0
    if 0 < np.diag(found.covariance).min() < LEAST_STD**2:
        raise study.error(key, f"{name}: {TOO_CERTAIN}")
    chosen = [found.joints.index(joint) for joint in unknown]
    try:
        return Normal(found.unbounded[chosen], wider * found.covariance[np.ix_(chosen, chosen)])
    except np.linalg.LinAlgError:
        raise not_positive from None


NO_WRENCH = np.zeros(6)  # of poses to stay away from, whatever their load


def study_workspace(study: Asked) -> Workspace:
    """Build the feasible set of a study: limits, constraints, and poses to keep away from.

    Raises:
        UserError: A file of excluded poses cannot be read, or a joint has no range left.
    """
    constraints = (*study.specification.workspace.build(), *_exclusions(study))
    return Workspace(_within_margin(study), constraints)


def _within_margin(study: Asked) -> Robot:
    """The robot, whose joints keep their margin from the limits.

    Raises:
        UserError: A joint has no range left.
    """
    margin = study.specification.joints.margin()
    try:
        return within_margin(study.robot, margin, frozenset(study.fixed))
    except ValueError as error:
        raise study.error("joints.margin_deg", str(error)) from error


def _exclusions(study: Asked) -> list[Excluded]:
    """Distances from the poses that plans keep away from, a constraint for each file or plan."""
    workspace = study.specification.workspace
    plans = [_unchecked(study, study.folder / name) for name in workspace.excluded]
    if isinstance(study.excluded, Plan):
        plans.append(study.excluded)
    elif study.excluded is not None:
        plans.append(_unchecked(study, study.excluded))
    within = float(np.deg2rad(workspace.excluded_within_deg))
    return [Excluded(_distinct(plan.q), within) for plan in plans]


def _unchecked(study: Asked, path: Path) -> Plan:
    """A plan whose poses need not be feasible, and whose loads do not matter.

    Raises:
        UserError: Names the file and the row or column.
    """
    return Plan.from_csv(path, study.robot, study.fixed, NO_WRENCH)


def _distinct(q: Array) -> Array:
    """Poses (m, n) without those that came before: a sheet has each as often as it was visited."""
    _, first = np.unique(q, axis=0, return_index=True)
    return q[np.sort(first)]


def with_springs(keys: Specification, robot: Robot, where: str) -> Specification:
    """The keys, with the joints among `joints.unknown` whose own springs [parameters] asks for.

    Known compliances stay known, unless a spring is asked for by its name.

    Raises:
        UserError: The springs are none of this robot, or one is named twice.
    """
    table = keys.parameters
    if table is None or not table.springs:
        return keys
    key = "parameters.springs"
    try:
        asked = springs_asked(robot, table.springs)
    except ValueError as error:
        raise UserError(str(error), where=where, key=key) from error
    known = keys.joints.known_rad_per_Nm
    own = [one.of for one in asked if one.place == "compliance"]
    own = [name for name in own if name in table.springs or name not in known]
    for name in table.compliance or ():
        if name in table.springs:
            message = f"{name!r} is among parameters.compliance too; expected it in one of them"
            raise UserError(message, where=where, key=key)
    unknown = tuple(dict.fromkeys((*keys.joints.unknown, *own)))
    joints = keys.joints.model_copy(update={"unknown": unknown})
    return keys.model_copy(update={"joints": joints})


def study_robot(keys: Specification, folder: Path, where: str) -> Robot:
    """Find the robot of a study, with the limits that the study has in place of its own.

    Args:
        keys: The keys of the study.
        folder: Folder to which the path of a robot's file is relative.
        where: The study, for messages.

    Raises:
        UserError: One line that names the study, the key and what was expected.
    """
    try:
        robot = _found(keys, folder)
    except RobotFileError as error:
        if error.key in LINKS:
            message = error.message if error.where is None else f"{error.where} {error.message}"
            raise UserError(message, where=where, key=error.key) from error
        if error.key == "limits":
            raise UserError(str(error.message), where=where, key=_limits_key(keys)) from error
        raise UserError(str(error), where=where, key="robot") from error
    for kind, key in KEY_OF_KIND.items():
        for name in getattr(keys.joints, key):
            joint = robot.joints[robot.joint_names.index(name)]
            if joint.kind != kind:
                message = f"the joint is {joint.kind}; give its limits in {KEY_OF_KIND[joint.kind]}"
                raise UserError(message, where=where, key=f"joints.{key}.{name}")
    return robot


def _found(keys: Specification, folder: Path) -> Robot:
    limits = keys.joints.limits()
    if keys.robot_name is not None:
        robot = load_robot(
            keys.robot_name, folder, base=keys.base_link, tip=keys.tip_link, limits=limits
        )
        return robot if isinstance(keys.robot, str) else RobotAndMore.read(keys.robot).added(robot)
    for key in LINKS:
        if getattr(keys, key) is not None:
            message = "goes with a URDF file; this robot is a table, which has no links"
            raise RobotFileError(message, key=key)
    assert not isinstance(keys.robot, str)
    try:
        return robot_from_dict(keys.robot).with_limits(limits)
    except RobotFileError:
        raise
    except ValueError as error:
        raise RobotFileError(str(error), key="limits") from error


def _limits_key(keys: Specification) -> str:
    """The key at which limits are wrong or missing."""
    return "joints.limits_mm" if keys.joints.limits_mm else "joints.limits_deg"


def prior_information(study: Asked) -> Array | None:
    """The precision of the Gaussian near the study's prior, which is added to that of a plan.

    An earlier calibration has the inverse of its covariance; a half-normal density of scale s has
    ``1/s^2``, and a log-normal one of median m and factor f has ``1/(m log f)^2``.

    Returns:
        Information (p, p) about compliances alone; None unless `[prior] in_design` is set.

    Raises:
        UserError: The prior is not one, or says nothing.
    """
    given = study.specification
    if not given.prior.in_design or given.parameters:
        return None
    precision, _ = study_prior(study).gaussian()
    if not np.asarray(precision).any():
        message = (
            "the prior says nothing about any compliance; expected an earlier calibration, or "
            "densities that are not flat"
        )
        raise study.error("prior.in_design", message)
    return precision


def designed_keys(study: Asked) -> dict[str, Any]:
    """Keys of the study by which plans are designed: known compliances as parameters with a prior.

    A joint of known compliance v with the standard deviation s may as well be an unknown one of
    which ``N(v, s^2)`` is known before. So it counts in the task, what measurements tell of it
    improves it, and criteria without a task are about the others, as their interest says.

    Returns:
        The keys that differ: the last unknown joints are those that were known. None where no
        known compliance is uncertain.
    """
    given = study.specification
    uncertain = {name: one for name, one in given.joints.known.items() if one.deviation > 0}
    # Of a study with [parameters] a known compliance is one of them from the start.
    if not uncertain or given.parameters:
        return {}
    keys = given.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    joints = keys["joints"]
    unknown = list(given.joints.unknown)
    optimise = list(filter(counts_known, given.optimise))
    known = {name: k for name, k in joints["known_rad_per_Nm"].items() if name not in uncertain}
    changed: dict[str, Any] = {
        "joints": joints | {"unknown": [*unknown, *uncertain], "known_rad_per_Nm": known},
        "prior": _design_prior(study, uncertain),
        "interest": keys.get("interest", {"joints": unknown}),
        "optimise": optimise or ["A"],
        "criteria": list(dict.fromkeys([*filter(counts_known, given.criteria), "A"])),
    }
    if given.simulation is not None:
        values = {name: one.value for name, one in uncertain.items()}
        values |= given.simulation.compliance_rad_per_Nm
        changed["simulation"] = {"compliance_rad_per_Nm": values}
    return changed


def counts_known(name: str) -> bool:
    """Whether plans for a criterion count how uncertain known compliances are.

    It is about a task, or can be about a part of the parameters. A name that no criterion has is
    left to whoever makes it, and says where it stands.
    """
    try:
        known = criteria.get(name)
    except criteria.CriterionError:
        return False
    part = issubclass(known, criteria.Relaxable) and known.monotone and known.convex
    return known.needs_target or (part and known.takes_interest and not known.needs_parameters)


def _design_prior(study: Asked, uncertain: Mapping[str, KnownCompliance]) -> dict[str, Any]:
    """The keys of the prior that counts in designs, with known compliances behind the others."""
    given = study.specification.prior
    found: dict[str, Any] = {"in_design": True}
    marginals: dict[str, Any] = {
        name: _log_normal(one.value, one.deviation) for name, one in uncertain.items()
    }
    if given.in_design:
        own = {name: one.model_dump(exclude_none=True) for name, one in given.joints.items()}
        found |= {"all": given.all.model_dump(exclude_none=True)}
        earlier = study_prior(study).earlier
        if earlier is not None:
            p = len(earlier.mean)
            std = [one.deviation for one in uncertain.values()]
            covariance = np.diag([*np.zeros(p), *np.square(std)])
            covariance[:p, :p] = earlier.covariance
            mean = [*earlier.mean.tolist(), *(one.value for one in uncertain.values())]
            names = [*study.specification.joints.unknown, *uncertain]
            found["earlier"] = {
                "mean_rad_per_Nm": dict(zip(names, mean, strict=True)),
                "covariance": covariance.tolist(),
            }
            marginals = {name: {"kind": "flat"} for name in uncertain}
        marginals = own | marginals
    return found | {"joints": marginals}


def _log_normal(value: float, std: float) -> dict[str, Any]:
    """The keys of a log-normal density that is ``N(value, std^2)`` near its median."""
    factor = float(np.exp(std / value))
    return {"kind": "log-normal", "median_rad_per_Nm": value, "factor": factor}
