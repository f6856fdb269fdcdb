"""What a study of geometry asks of a plan: where poses may lie, what is unknown, and criteria."""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

import criteria
from edtk.calibration.geometry.study_geometry import StudyGeometry
from edtk.calibration.geometry_design.geometry_space import GeometrySpace
from edtk.calibration.geometry_design.position_rows import MM, PositionRows
from edtk.calibration.geometry_design.wrenches_of import wrenches_of
from edtk.design.candidate_source import CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.inference.geometry.fit_geometry import stages
from edtk.model.geometry.geometric_model import GeometricModel
from edtk.model.geometry.identifiable import Identifiable, identifiable
from edtk.model.loads.fixed_load import FixedLoad
from edtk.model.loads.listed_load import ListedLoad
from edtk.study.given_parameters import given_parameters
from edtk.study.study import Study
from edtk.study.study_space import pose_space
from edtk.system.errors import UserError
from edtk.system.typing import Array
from edtk.tables.in_file_units import of_file_units

POSES = 60  # poses under each load that show what any poses could tell
UNTOLD = 1e-6  # [mm] an error in a task that a unit of what no pose tells may make


@dataclass(frozen=True, eq=False)
class GeometryQuestion:
    """The question of a study of geometry, for designs.

    Attributes:
        study: The study.
        setting: Its markers, noise and loads.
        wrenches: What visits may be loaded with (s, 6); the first is no load [N, N m].
        space: The design space. Its parameters are a minimal set: those that feasible poses of the
            study can tell apart under these loads.
        structural: Parameters that any poses could tell, feasible or not.
        shares: How those that feasible poses leave open hang on the others, see `Identifiable`.
        untold: A sentence for each of these, and for each spring that the study asks for and no
            pose tells.
    """

    study: Study
    setting: StudyGeometry
    wrenches: Array
    space: GeometrySpace
    structural: GeometricModel
    shares: Identifiable
    untold: tuple[str, ...]

    @classmethod
    def of(cls, study: Study) -> "GeometryQuestion":
        """The question of a study with [parameters].

        Raises:
            UserError: Its loads are none that a plan can choose among, or no pose is feasible.
        """
        setting = StudyGeometry.of(study)
        wrenches = wrenches_of(study)
        anywhere = _anywhere(setting.model, wrenches)
        told = _told(setting, setting.model, *anywhere)
        structural = _with(setting.model, told)
        load = FixedLoad(wrenches[0]) if len(wrenches) == 1 else ListedLoad(wrenches)
        space = _space(pose_space(study, load), structural, setting)
        shares = _told(setting, structural, *_feasible(space, study, wrenches))
        return cls(
            study,
            setting,
            wrenches,
            replace(space, geometry=_with(structural, shares)),
            structural,
            shares,
            (*_springs(setting.model, told), *shares.words),
        )

    @property
    def model(self) -> GeometricModel:
        """Markers, and the parameters of a plan."""
        return self.space.geometry

    def rows(self, q: Array, wrench: Array) -> Array:
        """How markers move with the parameters (m, k r, p) [mm, mrad] in poses under wrenches."""
        return PositionRows(self.model, self.setting.loads)(q, wrench)

    @cached_property
    def tasks(self) -> Array | None:
        """Rows (t, 3k, p) of the markers' positions in the test poses [mm]; None without any.

        Where orientations are measured, too, tasks ask for positions all the same.

        Raises:
            UserError: Something that no feasible pose tells moves a marker there.
        """
        poses = self.study.specification.test_poses
        if not poses:
            return None
        q = of_file_units(self.study.robot, np.array([pose.q_deg for pose in poses]))
        wrench = np.array([pose.load.build() for pose in poses])
        rows = PositionRows(self.structural, self.setting.loads)(q, wrench)
        rows = rows[:, self.model.placed_rows]
        kept = rows[..., self.shares.kept]
        apart = np.abs(rows[..., self.shares.left] - kept @ self.shares.shares)
        if apart.size and apart.max() > UNTOLD:
            worst = int(apart.max(axis=(0, 1)).argmax())
            raise self.study.error(
                "test_pose",
                f"depends on what no feasible pose tells: {self.shares.words[worst]}; free joints "
                "that are fixed, or widen the workspace",
            )
        return kept

    @cached_property
    def _weights(self) -> Array:
        """Shares (t,) of the test poses."""
        weights = np.array([pose.weight for pose in self.study.specification.test_poses])
        return np.asarray(weights / weights.sum())

    @property
    def target(self) -> Array | None:
        """The target A0 (r, p) of rho0 [m]; None without test poses.

        ``rho0^2 = trace(A0 M^-1 A0')`` is the mean square distance of the markers from where the
        calibrated model has them, over the test poses with their weights and all markers.
        """
        if self.tasks is None:
            return None
        k = len(self.model.markers)
        A0 = (np.sqrt(self._weights / k)[:, None, None] * self.tasks).reshape(-1, self.model.p)
        # As many rows as parameters say the same as all: only A0'A0 counts.
        return np.asarray(np.linalg.qr(A0, mode="r") if len(A0) > A0.shape[1] else A0) / MM

    @property
    def targets(self) -> Array | None:
        """The same of each test pose (t, 3k, p), for the worst of them; zero without weight."""
        if self.tasks is None:
            return None
        counts = self._weights > 0
        return self.tasks * counts[:, None, None] / np.sqrt(len(self.model.markers)) / MM

    def criterion(self, name: str | None = None) -> criteria.Criterion:
        """A criterion of the study's parameters, in their own units (mm, mrad, 1e-6 rad/(N m)).

        Args:
            name: Name of the criterion; defaults to the one that the study is about.

        Raises:
            UserError: There is no such criterion, it needs a test pose, or its parameters are
                wrong.
        """
        study = self.study
        name = study.main_criterion if name is None else name
        try:
            table = study.specification.criterion
            given: Any = given_parameters(name, table, self.space.parameters)
            found = criteria.create(name, self.target, targets=self.targets, **given)
            says_itself = found.needs_target or not found.takes_interest
            if study.specification.interest is None or says_itself:
                return found
            return criteria.Interest(found, *self.interest())
        except criteria.CriterionError as error:
            missing = isinstance(error, criteria.MissingTargetError)
            why = ", and the study has no [test_pose]" if missing else ""
            raise UserError(f"{error}{why}", where=study.where) from error

    def interest(self) -> tuple[Array, tuple[str, ...]]:
        """What is of interest: columns (p, s) of the identity, and the names (s,).

        The others are nuisance. Of parameters that cannot be told apart those count that the
        minimal set has.

        Raises:
            UserError: It has none of those that the study names.
        """
        table = self.study.specification.interest
        assert table is not None
        for name in table.parameters:
            if not any(name in one.groups for one in self.model.parameters):
                raise self.study.error(
                    "interest.parameters",
                    f"{name!r} cannot be told from other parameters; this study tells "
                    f"{', '.join(self.space.parameters)}",
                )
        chosen = [
            i
            for i, one in enumerate(self.model.parameters)
            if set(one.groups) & set(table.parameters)
        ]
        return np.eye(self.model.p)[:, chosen], tuple(self.space.parameters[i] for i in chosen)


def _space(base: DesignSpace, model: GeometricModel, setting: StudyGeometry) -> GeometrySpace:
    """The space of a model, where the poses of another one may lie."""
    own = {one.name: getattr(base, one.name) for one in fields(base)}
    return GeometrySpace(**own, geometry=model, errors=setting.noise, loads=setting.loads)


def _with(model: GeometricModel, told: Identifiable) -> GeometricModel:
    """The model with the parameters that are kept."""
    return model.with_parameters(tuple(model.parameters[i] for i in told.kept))


def _springs(model: GeometricModel, told: Identifiable) -> tuple[str, ...]:
    """Sentences on the springs that no pose tells; much of the geometry is redundant anyway."""
    return tuple(
        words
        for i, words in zip(told.left, told.words, strict=True)
        if model.parameters[i].place == "compliance"
    )


def _told(setting: StudyGeometry, model: GeometricModel, q: Array, wrench: Array) -> Identifiable:
    """What poses tell apart."""
    rows = PositionRows(model, setting.loads)(q, wrench).reshape(-1, model.p)
    return identifiable(rows, model.parameters, stages(model))


def _anywhere(model: GeometricModel, wrenches: Array) -> tuple[Array, Array]:
    """Poses within the joint limits, each under every load."""
    lower, upper = np.clip(model.robot.limits, -np.pi, np.pi)
    q = np.random.default_rng(0).uniform(lower, upper, (POSES, model.robot.n))
    return _under_each(q, wrenches)


def _feasible(space: GeometrySpace, study: Study, wrenches: Array) -> tuple[Array, Array]:
    """Feasible poses of the study, each under every load."""
    q = CandidateSource(space, 0, workers=1).take(POSES).x[:, : study.robot.n]
    return _under_each(q, wrenches)


def _under_each(q: Array, wrenches: Array) -> tuple[Array, Array]:
    """Every pose under every load."""
    return np.tile(q, (len(wrenches), 1)), np.repeat(wrenches, len(q), axis=0)
