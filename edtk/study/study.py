"""A study: the content of its file, and the objects that it describes."""

import hashlib
import tomllib
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

import criteria
from edtk.design.design_space import DesignSpace
from edtk.design.plan import Plan
from edtk.model.constraints.constraint import Constraint
from edtk.model.constraints.excluded import Excluded
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.load_robot import load_robot
from edtk.model.loads.fixed_load import FixedLoad
from edtk.model.rigid_joints import rigid_joints, rigid_joints_in_words
from edtk.model.robot import Robot
from edtk.model.robot_from_dict import RobotFileError
from edtk.model.workspace import Workspace
from edtk.study.schema import Specification
from edtk.system.errors import UserError
from edtk.tables.pose_table import PoseFileError, pose_factors

Array = NDArray[np.float64]


class Study:
    """A validated study: the file's content and the objects built from it.

    Args:
        path: Where the file lies; plans and robots named in it are relative to its folder.
        file: Its content.
        digest: First twelve hex digits of the file's SHA-256.
        excluded: A file of poses to stay away from, besides those that the file itself excludes.

    Raises:
        UserError: Names the file, the key and what was expected.
    """

    def __init__(
        self, path: Path, file: Specification, digest: str, excluded: Path | None = None
    ) -> None:
        self.path, self.specification, self.digest, self.excluded = path, file, digest, excluded
        self.robot = self._load_robot()
        names = self.robot.joint_names
        for key in ("unknown", "fixed_deg", "fixed_mm"):
            for name in getattr(file.joints, key):
                if name not in names:
                    raise self.error(
                        f"joints.{key}", f"no joint {name!r}; this robot has {', '.join(names)}"
                    )
        self._check_fixed()
        if len(set(file.joints.unknown)) < len(file.joints.unknown):
            raise self.error("joints.unknown", "a joint is named twice")
        if file.measurement.rows == "pose" and file.measurement.sigma_deg is None:
            raise self.error(
                "measurement.sigma_deg", "expected, since rows = 'pose' measures rotations too"
            )
        self._check_test_pose()
        self._check_criteria()

    def error(self, key: str, message: str) -> UserError:
        """A mistake at one key of this file."""
        return UserError(f"{self.path}: {key}: {message}")

    def _load_robot(self) -> Robot:
        try:
            return load_robot(self.specification.robot, self.path.parent).with_tool(
                self.specification.tool.build()
            )
        except RobotFileError as error:
            raise self.error("robot", str(error)) from error

    def _check_test_pose(self) -> None:
        pose = self.specification.test_pose
        if pose is not None and len(pose.q_deg) != self.robot.n:
            raise self.error(
                "test_pose.q_deg",
                f"has {len(pose.q_deg)} entries, expected {self.robot.n}, one per joint",
            )

    def _check_fixed(self) -> None:
        """Fixed values are given in the joint's own unit, and lie within its limits."""
        for key, kind in (("fixed_deg", "revolute"), ("fixed_mm", "prismatic")):
            for name in getattr(self.specification.joints, key):
                joint = self.robot.joints[self.robot.joint_names.index(name)]
                if joint.kind != kind:
                    other = "fixed_mm" if key == "fixed_deg" else "fixed_deg"
                    raise self.error(
                        f"joints.{key}.{name}",
                        f"the joint is {joint.kind}; give its value in {other}",
                    )
        for j, value in self.fixed.items():
            low, high = self.robot.joints[j].limits
            if not low <= value <= high:
                name = self.robot.joint_names[j]
                key = "fixed_deg" if name in self.specification.joints.fixed_deg else "fixed_mm"
                raise self.error(f"joints.{key}.{name}", "the value is outside the joint's limits")

    def _check_criteria(self) -> None:
        for key in ("criteria", "optimise"):
            for name in getattr(self.specification, key):
                try:
                    cls = criteria.get(name)
                except criteria.CriterionError as error:
                    raise self.error(key, str(error)) from error
                if cls.needs_target and self.specification.test_pose is None:
                    raise self.error(
                        key, f"criterion {name!r} needs a [test_pose], and there is none"
                    )
                if key == "optimise" and not cls.has_convex_form():
                    raise self.error(
                        key,
                        f"criterion {name!r} has no convex form to optimise; it can only be compared",
                    )

    @cached_property
    def model(self) -> ElastostaticModel:
        """The elastostatic model with the calibration tool."""
        return ElastostaticModel(self.robot, self._unknown, self.specification.measurement.rows)

    @property
    def _unknown(self) -> tuple[int, ...]:
        return tuple(
            self.robot.joint_names.index(name) for name in self.specification.joints.unknown
        )

    @property
    def fixed(self) -> dict[int, float]:
        """Values [rad or m] of the fixed joints by index."""
        given = self.specification.joints.fixed_deg | self.specification.joints.fixed_mm
        factors = dict(zip(self.robot.joint_names, pose_factors(self.robot), strict=True))
        return {
            self.robot.joint_names.index(n): float(value * factors[n]) for n, value in given.items()
        }

    @property
    def sigma(self) -> Array:
        """Standard deviation of each measured row (rows,) [m, rad]."""
        m = self.specification.measurement
        position = np.full(3, m.sigma_mm / 1e3)
        return (
            position
            if m.rows == "position"
            else np.append(position, np.full(3, np.deg2rad(m.sigma_deg or 0)))
        )

    @cached_property
    def space(self) -> DesignSpace:
        """Model, feasible set and free joints, for designing plans."""
        fixed = self.fixed
        values = np.array([fixed.get(j, 0.0) for j in range(self.robot.n)])
        free = [j for j in range(self.robot.n) if j not in fixed]
        constraints = (*self.specification.workspace.build(), *self._exclusions())
        workspace = Workspace(self.robot, constraints)
        return DesignSpace(
            self.model, workspace, self.sigma, self.specification.load.build(), free, values
        )

    def _exclusions(self) -> list[Constraint]:
        """Distances from the poses that must not be used."""
        given = self.specification.workspace.excluded
        files = [self.path.parent / given] if given else []
        files += [self.excluded] if self.excluded else []
        within = float(np.deg2rad(self.specification.workspace.excluded_within_deg))
        return [Excluded(self._read(path, np.zeros(6)).q, within) for path in files]

    def _read(self, path: Path | str, wrench: Array | None) -> Plan:
        """A plan's file, unchecked."""
        try:
            return Plan.from_csv(path, self.robot, self.fixed, wrench)
        except PoseFileError as error:
            raise UserError(str(error)) from error

    @cached_property
    def target(self) -> Array | None:
        """A0 (3, p) of the test pose, Eq. (4) with the task's tool and load; None without a test pose."""
        pose = self.specification.test_pose
        if pose is None:
            return None
        task = ElastostaticModel(self.robot.with_tool(pose.tool.build()), self._unknown)
        return task.regressor(pose.q_deg * pose_factors(self.robot), pose.load.build())

    @property
    def rigid(self) -> str:
        """Which joints count as rigid in the test pose although its load turns them, in words; nothing for none."""
        pose = self.specification.test_pose
        if pose is None:
            return ""
        q = np.array(pose.q_deg)[None] * pose_factors(self.robot)
        robot = self.robot.with_tool(pose.tool.build())
        joints = rigid_joints(robot, q, pose.load.build()[None], self.specification.joints.unknown)
        return rigid_joints_in_words(joints)

    @property
    def names(self) -> tuple[str, ...]:
        """Criteria that are optimised or compared, those that are optimised first."""
        return tuple(dict.fromkeys((*self.specification.optimise, *self.specification.criteria)))

    def criterion(self, name: str) -> criteria.Criterion:
        """A criterion by name, with this study's target."""
        return criteria.create(name, self.target)

    @cached_property
    def compliances(self) -> Array:
        """Assumed true compliances (p,) [rad/(N m)] for simulations.

        Raises:
            UserError: The file does not give them for every unknown joint.
        """
        given = (
            {}
            if self.specification.simulation is None
            else self.specification.simulation.compliance_rad_per_Nm
        )
        for name in self.specification.joints.unknown:
            if name not in given:
                raise self.error(
                    "simulation.compliance_rad_per_Nm", f"expected a value for joint {name!r}"
                )
        return np.array([given[name] for name in self.specification.joints.unknown])

    @property
    def reads(self) -> tuple[Path, ...]:
        """All files that the study is read from: its own, and those that it names."""
        named = [
            *self.specification.published,
            self.specification.workspace.excluded,
            self.specification.prior.earlier_file,
        ]
        named += [self.specification.robot] if self.specification.robot.endswith(".toml") else []
        beside = [self.path.parent / name for name in named if name]
        return (self.path, *beside, *([self.excluded] if self.excluded else []))

    def load_plan(self, path: Path | str) -> Plan:
        """Read a plan and check every pose against limits and workspace.

        A pose counts as feasible if one within the study's `plan_resolution_deg` of it is (published poses are
        rounded). Excluded poses count too: they may have been measured, and are only not to be planned.

        Raises:
            UserError: Names the file and the row.
        """
        load = self.space.load
        plan = self._read(path, load.always if isinstance(load, FixedLoad) else None)
        turning = np.array([joint.kind == "revolute" for joint in self.robot.joints])
        resolution = np.deg2rad(self.specification.workspace.plan_resolution_deg) * turning
        workspace = Workspace(self.robot, self.specification.workspace.build())
        slack = workspace.slack_within(plan.q, resolution)
        rows = np.flatnonzero((slack < -1e-9).any(axis=1))
        if len(rows):
            broken = map(str, workspace.violations(slack[rows[0]]))
            raise UserError(f"{path}: row {rows[0] + 1}: the pose violates {'; '.join(broken)}")
        return plan

    def published_plans(self) -> dict[str, Plan]:
        """The published plans named in the file, by their file's stem."""
        return {
            Path(name).stem: self.load_plan(self.path.parent / name)
            for name in self.specification.published
        }


def load_study(path: Path | str, excluded: Path | str | None = None) -> Study:
    """Read and validate a study file.

    Args:
        path: The file.
        excluded: A plan's file with poses to stay away from, besides those that the study itself excludes.

    Raises:
        UserError: One line that names the file, the key and what was expected.
    """
    path = Path(path)
    try:
        raw = path.read_bytes()
        content: dict[str, Any] = tomllib.loads(raw.decode("utf-8"))
    except FileNotFoundError:
        raise UserError(f"{path}: no such study file") from None
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: not valid TOML: {error}") from error
    try:
        file = Specification.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        expected = "unknown key" if first["type"] == "extra_forbidden" else first["msg"]
        if first["type"] == "missing":
            expected = "this key is required"
        given = "" if isinstance(first["input"], dict) else f" (got {first['input']!r})"
        raise UserError(f"{path}: {key}: {expected}{given}") from error
    return Study(
        path,
        file,
        hashlib.sha256(raw).hexdigest()[:12],
        None if excluded is None else Path(excluded),
    )
