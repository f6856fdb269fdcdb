"""The objects that the keys of a study describe: its model, noise, task and criteria."""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import criteria
from criteria.linalg.estimable import combination
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.noise import VisitNoise
from edtk.measure.pose_table import of_file_units
from edtk.measure.task import Task, Tasks
from edtk.robots.robot import Robot
from edtk.study.schema import Specification
from edtk.study.study_model import study_model, study_noise, study_sigma
from edtk.study.study_parts import study_tasks
from edtk.study.tables_of_task import CriterionTable
from edtk.system.errors import UserError
from edtk.system.typing import Array

IN_PYTHON = "Study"  # takes the place of the file's name in messages about a study without a file


def given_parameters(
    name: str, table: CriterionTable | None, unknown: Sequence[str]
) -> dict[str, Any]:
    """The parameters of a criterion as `criteria.create` takes them; none where it needs none.

    Args:
        name: Name of the criterion.
        table: The study's key `criterion`.
        unknown: Names (p,) of the parameters that are unknown.

    Raises:
        CriterionError: The study gives none, and the criterion needs them, or they name others.
    """
    if table is not None and table.name == name:
        try:
            return table.build(unknown)
        except ValueError as error:
            raise criteria.CriterionError(f"criterion {name!r}: {error}") from error
    if criteria.get(name).needs_parameters:
        expected = ", ".join(criteria.parameters_of(name))
        raise criteria.CriterionError(
            f"criterion {name!r} needs parameters; give criterion = {{ name = {name!r}, ... }} "
            f"with {expected}"
        )
    return {}


class StudyObjects:
    """What a study asks about, built from its checked keys; the base of `Study`.

    Attributes:
        specification: All keys, checked, with their defaults.
        robot: The robot, with the calibration tool.
        folder: Folder to which file names in the specification are relative.
        path: The study's file; None for a study that was built in Python.
    """

    specification: Specification
    robot: Robot
    folder: Path
    path: Path | None

    @property
    def where(self) -> str:
        """The file of the study, as messages name it."""
        return IN_PYTHON if self.path is None else str(self.path)

    def error(self, key: str, message: str) -> UserError:
        """An error at one key of this study."""
        return UserError(message, where=self.where, key=key)

    @property
    def main_criterion(self) -> str:
        """Name of the criterion that the study is about: rho0 if optimised, else the first."""
        return self.specification.main_criterion

    @cached_property
    def model(self) -> ElastostaticModel:
        """The elastostatic model with the calibration tool.

        A study of geometry without springs has one of all joints: it tells motions and loads.
        """
        return study_model(self, self.unknown or tuple(range(self.robot.n)))

    @property
    def unknown(self) -> tuple[int, ...]:
        """Indices of the joints whose compliances are unknown."""
        return tuple(map(self.robot.joint_names.index, self.specification.joints.unknown))

    @property
    def known(self) -> dict[int, float]:
        """Compliances [rad/(N m)] that are known, by the index of the joint, from base to tip."""
        given = self.specification.joints.known
        names = self.robot.joint_names
        return {j: given[name].value for j, name in enumerate(names) if name in given}

    @property
    def fixed(self) -> dict[int, float]:
        """Values [rad or m] of the fixed joints by index."""
        given = self.specification.joints.fixed_deg | self.specification.joints.fixed_mm
        names = self.robot.joint_names
        shown = np.array([given.get(name, 0.0) for name in names])
        values = of_file_units(self.robot, shown)
        return {names.index(name): float(values[names.index(name)]) for name in given}

    @property
    def is_absolute(self) -> bool:
        """Whether displacements are counted from the nominal robot, not from the unloaded one."""
        return self.specification.measurement.reference == "nominal"

    @property
    def sigma(self) -> Array:
        """Standard deviation of each measured row (rows,) of an experiment [m, rad].

        Raises:
            UserError: The noise is not white, so that this says too little of it.
        """
        if self.noise is not None:
            raise self.error(
                "noise",
                "white noise alone can be taken into account here; leave [noise] out and give "
                "measurement.sigma_mm",
            )
        return study_sigma(self)

    @cached_property
    def tasks(self) -> Tasks:
        """The poses in which the robot shall be accurate, with their tools and loads."""
        return study_tasks(self)

    @cached_property
    def noise(self) -> VisitNoise | None:
        """Covariance of a visit's rows, where noise is not white; None where `sigma` says all."""
        return study_noise(self)

    @property
    def task(self) -> Task | None:
        """The only task, or the first of several; None without any. Most questions ask `tasks`."""
        return self.tasks[0] if self.tasks else None

    @property
    def target(self) -> Array | None:
        """Target (r, p) of rho0 [m/(rad/(N m))], see `Tasks.target`; None without a test pose.

        None, too, where the geometry is unknown, whose rho0 is another one, see
        `edtk.geometry_problem`. It is A0 (3, p) of the test pose, Eq. (4), unless a neighbourhood,
        rotations or several test poses count.
        """
        if self.specification.parameters is not None:
            return None
        return self.tasks.target if self.tasks else None

    @cached_property
    def interest(self) -> Array | None:
        """Combinations K (p, s) of the compliances that are of interest; None for all of them.

        None, too, where the geometry is unknown, whose interest is told by names of parameters.
        """
        table = self.specification.interest
        if table is None or self.specification.parameters is not None:
            return None
        return table.build(self.specification.joints.unknown)

    @property
    def interest_names(self) -> tuple[str, ...]:
        """What these combinations are called: "k2", "k2 - k3"; none if all are of interest."""
        if self.interest is None:
            return ()
        return tuple(combination(column, self.model.parameters) for column in self.interest.T)

    @property
    def names(self) -> tuple[str, ...]:
        """Criteria that are optimised or compared, those that are optimised first."""
        return tuple(dict.fromkeys((*self.specification.optimise, *self.specification.criteria)))

    def require_compliances_alone(self) -> None:
        """Check that nothing but compliances is unknown, for what knows no geometry.

        Raises:
            UserError: The study has a table [parameters].
        """
        if self.specification.parameters is not None:
            raise self.error(
                "parameters",
                "this knows compliances alone; expected a study without [parameters]",
            )

    def criterion(self, name: str | None = None) -> criteria.Criterion:
        """A criterion with this study's target, or about what is of interest.

        A target says by itself what is of interest.

        Args:
            name: Name of the criterion; defaults to the one that the study is about.

        Raises:
            UserError: There is no such criterion, it needs a test pose, or it has no meaning for a
                part of the parameters.
        """
        name = self.main_criterion if name is None else name
        self.require_compliances_alone()
        try:
            targets = self.tasks.targets if self.tasks else None
            parameters = self._parameters(name)
            criterion = criteria.create(name, self.target, targets=targets, **parameters)
            says_itself = criterion.needs_target or not criterion.takes_interest
            if self.interest is None or says_itself:
                return criterion
            return criteria.Interest(criterion, self.interest, self.interest_names)
        except criteria.CriterionError as error:
            missing = isinstance(error, criteria.MissingTargetError)
            why = ", and the study has no [test_pose] or [task]" if missing else ""
            raise UserError(f"{error}{why}", where=self.where) from error

    def _parameters(self, name: str) -> dict[str, Any]:
        """The parameters of a criterion that the study gives.

        Raises:
            CriterionError: It gives none, and the criterion needs them, or they name other joints;
                or experiments share a prior, which the study says elsewhere.
        """
        if name.startswith("bayes_") and criteria.get(name).needs_parameters:
            raise criteria.CriterionError(
                f"criterion {name!r}: a study has its prior in [prior]; give in_design = true "
                f"there, and criterion = {name.removeprefix('bayes_')!r}"
            )
        table = self.specification.criterion
        return given_parameters(name, table, self.specification.joints.unknown)

    @cached_property
    def compliances(self) -> Array:
        """Compliances (p,) [rad/(N m)] that simulated measurements assume as true.

        Raises:
            UserError: The study does not give them for every unknown joint.
        """
        simulation = self.specification.simulation
        given = {} if simulation is None else simulation.compliance_rad_per_Nm
        for name in self.specification.joints.unknown:
            if name not in given:
                raise self.error(
                    "simulation.compliance_rad_per_Nm", f"expected a value for joint {name!r}"
                )
        return np.array([given[name] for name in self.specification.joints.unknown])
