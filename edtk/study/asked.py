"""The keys of a study, checked, and its robot: what all other objects of it are built from."""

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from edtk.cell.cell import Cell
from edtk.design.plan import Plan
from edtk.measure.pose_table import of_file_units
from edtk.robots.robot import Robot
from edtk.study.schema import Specification
from edtk.study.study_cell import study_cell
from edtk.system.errors import UserError
from edtk.system.typing import Array

IN_PYTHON = "Study"  # takes the place of the file's name in messages about a study without a file


class Asked:
    """What a study says, by its keys and its robot alone.

    Attributes:
        specification: All keys, checked, with their defaults.
        robot: The robot, with the calibration tool.
        folder: Folder to which file names in the specification are relative.
        path: The study's file; None for a study that was built in Python.
        excluded: Poses that plans keep away from, besides those of the specification: a plan, its
            file, or None.
    """

    specification: Specification
    robot: Robot
    folder: Path
    path: Path | None
    excluded: Path | Plan | None

    @property
    def where(self) -> str:
        """The file of the study, as messages name it."""
        return IN_PYTHON if self.path is None else str(self.path)

    def error(self, key: str, message: str) -> UserError:
        """An error at one key of this study."""
        return UserError(message, where=self.where, key=key)

    def key_of(self, index: int) -> str:
        """The key of a test pose, as messages name it."""
        return "test_pose" if len(self.specification.test_poses) == 1 else f"test_pose.{index}"

    def to_dict(self) -> dict[str, Any]:
        """Plain keys from which `Study` builds the same study again; defaults are left out."""
        return self.specification.model_dump(mode="json", exclude_none=True, exclude_defaults=True)

    @property
    def main_criterion(self) -> str:
        """Name of the criterion that the study is about: rho0 if optimised, else the first."""
        return self.specification.main_criterion

    @property
    def names(self) -> tuple[str, ...]:
        """Criteria that are optimised or compared, those that are optimised first."""
        return tuple(dict.fromkeys((*self.specification.optimise, *self.specification.criteria)))

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

    @cached_property
    def cell(self) -> Cell | None:
        """What must not touch; None without a `[scene]`.

        Raises:
            UserError: A body is not as it should be, or two touch in every pose.
        """
        return study_cell(self.specification, self.robot, self.folder, self.where, fixed=self.fixed)

    @property
    def home(self) -> Array | None:
        """The pose (n,) in which a day begins and ends [rad or m]; None where nobody says."""
        scene = self.specification.scene
        if scene is None or scene.home_deg is None:
            return None
        return of_file_units(self.robot, np.array(scene.home_deg))

    @property
    def is_absolute(self) -> bool:
        """Whether displacements are counted from the nominal robot, not from the unloaded one."""
        return self.specification.measurement.reference == "nominal"
