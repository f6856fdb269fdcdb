"""The objects that the keys of a study describe: its model, noise, task and criteria."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

import criteria
from criteria.linalg.estimable import combination
from edtk.cell.cell import Clear
from edtk.cell.sight import AllSeen, Sight
from edtk.design.candidate_source import CandidateSource, EmptyFeasibleSetError
from edtk.design.design_space import DesignSpace
from edtk.design.plan import REPEATS, Plan
from edtk.findings.finding import Finding
from edtk.fit.correlated_noise import row_numbers
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.friction import Friction
from edtk.measure.noise import VisitNoise
from edtk.measure.pose_table import (
    LOAD_COLUMNS,
    SHEET_COLUMNS,
    WRENCH_COLUMNS,
    PoseTable,
    Table,
    path_of,
    pose_columns,
    with_own_headers,
)
from edtk.measure.task import Task, Tasks
from edtk.robots.loads.load import Load
from edtk.robots.robot import Robot
from edtk.robots.workspace import Workspace
from edtk.study.asked import Asked
from edtk.study.study_model import guessed_compliances, study_model, study_noise, study_sigma
from edtk.study.study_parts import (
    TaskDefaults,
    prior_information,
    study_tasks,
    study_workspace,
)
from edtk.study.study_sight import study_sight
from edtk.study.tables_of_robot import ParametersTable
from edtk.study.tables_of_task import CriterionTable, InterestTable
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices

JointLoads = Callable[[Array, Array], Array]

POSES = 200  # whose loads are usual
FEASIBLE = -1e-9  # least slack [m or rad] of a pose that counts as feasible, against rounding
COORDINATES = 3  # of the first marker; or a distance, in any number of rows


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


class Kind(ABC):
    """What a study says otherwise where its unknowns are of another kind, see `kinds`.

    Attributes:
        key: The key of a study that says what is unknown.
        hard_to_believe: Checks besides those of any study, see `plausibility`.
        task: What a task has that says nothing else.
        keeps_loads: Whether all visits under a load come together, though changes cost nothing.
    """

    key: ClassVar[str]
    task: ClassVar[TaskDefaults]
    keeps_loads: ClassVar[bool] = False
    hard_to_believe: ClassVar[tuple[Callable[["StudyObjects"], Iterator[Finding]], ...]] = ()

    @abstractmethod
    def unknowns(self, study: Asked) -> str:
        """What is unknown, in a few words."""

    @abstractmethod
    def bodies(self, robot: Robot) -> tuple[str, ...]:
        """Names of the bodies that markers may sit on."""

    @abstractmethod
    def check(self, study: Asked) -> None:
        """Check the keys that only one kind of study knows.

        Raises:
            UserError: One line that names the study, the key and what was expected.
        """

    @abstractmethod
    def is_paired(self, study: Asked) -> bool:
        """Whether an experiment visits its pose twice, without its load and with it."""

    @abstractmethod
    def check_interest(self, study: "StudyObjects", table: InterestTable) -> None:
        """Check that what is of interest makes sense, and that the criteria can be about it.

        Raises:
            UserError: One line that names the study, the key and what was expected.
        """

    @abstractmethod
    def check_criterion(self, study: "StudyObjects", key: str, name: str) -> None:
        """Check that a criterion has the parameters that it needs, and that they fit the unknowns.

        Raises:
            UserError: One line that names the study, the key and what was expected.
        """

    @abstractmethod
    def require_compliances_alone(self, study: Asked) -> None:
        """Check that nothing but compliances is unknown, for what knows no geometry.

        Raises:
            UserError: The study has a table [parameters].
        """

    @abstractmethod
    def parameters(self, study: Asked) -> ParametersTable:
        """The parameters of geometry that the study asks for.

        Raises:
            UserError: The study has no table [parameters].
        """

    @abstractmethod
    def wrench_of_pose(self, study: Asked) -> Array | None:
        """The wrench (6,) of a pose whose row says none; None where a row has to say one."""

    @abstractmethod
    def visits(
        self, study: Asked, path: Table, table: PoseTable, made: bool
    ) -> tuple[Array, Array]:
        """Poses (v, n) and wrenches (v, 6) of the visits of a sheet.

        Args:
            study: The study.
            path: The sheet.
            table: The same, as it was read.
            made: Whether only rows that are filled in count.

        Raises:
            UserError: Names the file and the row or column; or no row is filled in.
        """

    @abstractmethod
    def target(self, tasks: Tasks) -> Array | None:
        """Target (r, p) of rho0 by compliances alone; None where rho0 is another one."""

    @abstractmethod
    def interest(self, table: InterestTable, unknown: Sequence[str]) -> Array | None:
        """Combinations K (p, s) of the compliances that are of interest; None where names say."""


class StudyObjects(Asked):
    """What a study asks about, built from its checked keys; the base of `Study`.

    Attributes:
        kind: What a study of these unknowns says otherwise than others.
        friction: What friction holds of the joints' loads, where it is unknown, too; None where it
            counts for nothing, as in all but designs.
    """

    kind: Kind
    friction: Friction | None = None

    @cached_property
    def model(self) -> ElastostaticModel:
        """The elastostatic model with the calibration tool.

        A study of geometry without springs has one of all joints: it tells motions and loads.
        """
        found = study_model(self, self.unknown or tuple(range(self.robot.n)))
        return found if self.friction is None else replace(found, friction=self.friction)

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
        found = study_tasks(self, self.kind.task)
        return found if self.friction is None else found.with_friction(self.friction)

    @cached_property
    def noise(self) -> VisitNoise | None:
        """Covariance of a visit's rows, where noise is not white; None where `sigma` says all."""
        return study_noise(self, self.model)

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
        return self.kind.target(self.tasks) if self.tasks else None

    @cached_property
    def interest(self) -> Array | None:
        """Combinations K (p, s) of the compliances that are of interest; None for all of them.

        None, too, where the geometry is unknown, whose interest is told by names of parameters.
        """
        table = self.specification.interest
        unknown = self.specification.joints.unknown
        found = None if table is None else self.kind.interest(table, unknown)
        if self.friction is None:
            return found
        # What friction holds is nuisance.
        own = np.eye(len(unknown)) if found is None else found
        return np.pad(own, ((0, len(self.friction)), (0, 0)))

    @property
    def interest_names(self) -> tuple[str, ...]:
        """What these combinations are called: "k2", "k2 - k3"; none if all are of interest."""
        if self.interest is None:
            return ()
        return tuple(combination(column, self.model.parameters) for column in self.interest.T)

    @cached_property
    def sight(self) -> Sight | None:
        """Which instruments are read in which poses; None where the study says nothing of that."""
        return study_sight(self, self.model)

    @cached_property
    def workspace(self) -> Workspace:
        """The feasible set: limits, constraints, and poses that plans keep away from."""
        found = study_workspace(self)
        table = self.specification.sight
        if self.sight is None or table is None or not table.all_markers:
            return found
        return replace(found, constraints=(*found.constraints, AllSeen(self.sight)))

    @cached_property
    def space(self) -> DesignSpace:
        """Model, feasible set and free joints, for designing plans.

        Raises:
            UserError: A file of excluded poses cannot be read, or the study is about geometry too.
        """
        self.require_compliances_alone()
        return self.space_under(self.specification.build_load())

    def space_under(self, load: Load) -> DesignSpace:
        """The same with loads of the caller's choice, whatever is unknown."""
        fixed = self.fixed
        values = np.array([fixed.get(j, 0.0) for j in range(self.robot.n)])
        free = [j for j in range(self.robot.n) if j not in fixed]
        return DesignSpace(
            self.model,
            self.workspace,
            study_sigma(self),
            load,
            free,
            values,
            noise=self.noise,
            sight=self.sight,
            clear=None if self.cell is None else Clear(self.cell),
        )

    def least_error(self, q: Array) -> float:
        """The least standard deviation of a coordinate of the first marker in some poses [m].

        Args:
            q: Poses (s, n) [rad or m]; they do not matter where noise is white.
        """
        if self.noise is None:
            return float(self.sigma[0])
        # Without a load, beside which the model errs too.
        Sigma = self.noise.covariance_of(self.model, self.model.frames(q), np.zeros(6))
        return float(np.sqrt(np.einsum("rrk->rk", Sigma)[:COORDINATES].min()))

    @cached_property
    def prior_information(self) -> Array | None:
        """Information (p, p) that counts beside every plan; None where nothing is known.

        That is of a prior with `in_design`, and of how much friction holds at most.
        """
        known = prior_information(self)
        if self.friction is None:
            return known
        p = len(self.unknown)
        M = np.zeros((self.model.p, self.model.p))
        M[p:, p:] = self.friction.information
        if known is not None:
            M[:p, :p] = known
        return M

    def information(self, plan: Plan) -> Array:
        """Information matrix (p, p) of a plan, and of the prior if that counts in designs."""
        M = self.space.information(plan)
        return M if self.prior_information is None else M + self.prior_information

    def cost(self, criterion: criteria.Criterion, plan: Plan) -> float:
        """The cost of a plan, and of the prior if that counts in designs, by the plan's rows."""
        return self.space.cost(criterion, plan, known=self.prior_information)

    def require_compliances_alone(self) -> None:
        """Check that nothing but compliances is unknown, for what knows no geometry.

        Raises:
            UserError: The study has a table [parameters].
        """
        self.kind.require_compliances_alone(self)

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

    def load_plan(self, path: Table, made: bool = False) -> Plan:
        """Read a plan, or the experiments of a sheet; check each pose against limits and workspace.

        A pose counts as feasible if one within the study's `plan_resolution_deg` of it is, since
        published poses are rounded. Excluded poses are feasible too: they may have been measured,
        and are only not to be planned.

        Args:
            path: The plan's file (CSV), or a data frame that holds what it would.
            made: Whether of a sheet only the rows that are filled in count, and one has to be.

        Raises:
            UserError: Names the file and the row.
        """
        plan = _of_sheet(self, path, made)
        if plan is None:
            plan = Plan.from_csv(path, self.robot, self.fixed, self.kind.wrench_of_pose(self))
        resolution = np.deg2rad(self.specification.workspace.plan_resolution_deg)
        workspace = Workspace(self.robot, self.specification.workspace.build())
        slack = workspace.slack_within(plan.q, resolution * ~self.robot.slides)
        outside = (slack < FEASIBLE).any(axis=1)
        if outside.any():
            row = int(outside.argmax())
            broken = "; ".join(map(str, workspace.violations(slack[row])))
            raise UserError(
                f"the pose violates {broken}", where=path_of(path), key=f"row {row + 1}"
            )
        return plan


def friction_of(
    study: StudyObjects, share: float, loads: JointLoads | None = None
) -> Friction | None:
    """What friction of the unknown joints may hold of their loads.

    Usual loads are means over feasible poses.

    Args:
        study: The study.
        share: Standard deviation of what each joint holds of its usual load.
        loads: What loads the joints (m, n) in poses under wrenches; by default the study's model.

    Returns:
        The friction; None for no share, without unknown joints, or of a study about geometry whose
        loads are not given.

    Raises:
        UserError: No pose is feasible, or the study guesses no compliance of a joint.
    """
    if not share or not study.unknown:
        return None
    if loads is None and study.specification.parameters:
        return None
    k = guessed_compliances(study)[list(study.unknown)]
    try:
        space = study.space_under(study.specification.build_load())
        x = CandidateSource(space, 0, workers=1).take(POSES).x
    except EmptyFeasibleSetError as error:
        raise study.error(error.key, str(error)) from error
    plan = space.plan(x, np.ones(len(x), dtype=int))
    if loads is None:
        torque = study.model.torque_of(study.model.frames(plan.q), plan.wrench)
    else:
        torque = loads(plan.q, plan.wrench).T
    load = np.abs(torque[list(study.unknown)]).mean(axis=1)
    # Of a joint that nothing loads friction holds nothing, and it has no load for a unit.
    return Friction(k, np.where(load > 0, load, 1.0), share)


def _of_sheet(study: StudyObjects, path: Table, made: bool) -> Plan | None:
    """The experiments of a measurement sheet; None for a plan.

    Rows of one visit are one experiment.

    Args:
        study: The study.
        path: The sheet, or a plan.
        made: Whether only rows that are filled in count.

    Raises:
        UserError: Names the file and the row or column; or no row is filled in.
    """
    table = PoseTable.read(path, "plan")
    if not is_sheet(study, table):
        return None
    return _counted(*study.kind.visits(study, path, table, made))


def is_sheet(study: StudyObjects, table: PoseTable) -> bool:
    """Whether a table has columns for measurements; a plan has none."""
    own = {*pose_columns(study.robot), *WRENCH_COLUMNS, *LOAD_COLUMNS, REPEATS}
    header = with_own_headers([str(name) for name in table.cells], study.robot, SHEET_COLUMNS)
    return REPEATS not in table and not set(header) <= own


def firsts(number: Indices, *columns: Array) -> tuple[Array, ...]:
    """The first rows of each number (m,) of columns (m, c)."""
    first = np.unique(number, return_index=True)[1]
    return tuple(column[first] for column in columns)


def _counted(q: Array, wrench: Array) -> Plan:
    """A plan in which each pose and load is there once, with its repetitions."""
    number = row_numbers(q, wrench)
    poses, loads = firsts(number, q, wrench)
    return Plan(poses, loads, np.bincount(number))
