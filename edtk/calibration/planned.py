"""What a plan promises before anything is measured: its errors, their budget, and its bias."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import criteria
from criteria.linalg.inverse import root
from edtk.calibration.posterior_check import PosteriorCheck, check_posterior, first_estimate
from edtk.calibration.propagation import Propagation, root_of_difference, uncertainty_of
from edtk.calibration.template import measured_names
from edtk.design.plan import Plan
from edtk.findings.finding import Finding
from edtk.findings.moving_joints import stated_noise
from edtk.findings.prior import unstated, unstated_findings
from edtk.fit.correlated_noise import CorrelatedNoise, NoiseBlocks, RowNoise
from edtk.fit.equilibrium import Bias, linearisation_bias
from edtk.fit.least_squares import SingularPlanError, covariance
from edtk.fit.measurements import Measurements, simulate
from edtk.fit.noise import MOST_COORDINATES, Noise
from edtk.fit.posterior import SamplingOptions
from edtk.fit.prior import PriorRows
from edtk.fit.sheet import sheet_turns
from edtk.measure.equilibrium import NoEquilibriumError, why_no_rest
from edtk.measure.expected_error import (
    ErrorBudget,
    ExpectedError,
    TaskAccuracy,
    compensation_accuracy,
)
from edtk.measure.instruments.pose_marker import COORDINATES
from edtk.measure.model_error import ASSUMED
from edtk.measure.noise import VisitNoise, shared_visits
from edtk.measure.task import Tasks
from edtk.measure.whitening import only_seen
from edtk.study.study import Study
from edtk.study.study_model import payload_beside_load, promised_noise, study_sigma
from edtk.study.study_objects import friction_of
from edtk.study.study_run import Designs
from edtk.system.errors import UserError
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd


# [m, rad] of a reading that is not there, beside which any other has no error. So a plan has as
# many readings in each pose; errors are whitened by correlations, which such a reading has none of.
NOT_READ = 1e3


def plan_noise(study: Study, plan: Plan) -> RowNoise:
    """The noise of the mean of each experiment's repeats (m, rows) [m, rad].

    Repeats average out what is not shared: ``sigma^2 / r``, or ``V/r + D`` with the
    covariance V of a visit and that D of the model's errors.

    Args:
        study: The noise, and the rows that are measured.
        plan: The experiments.
    """
    if study.noise is None:
        return _as_read(study, plan, study.sigma / np.sqrt(plan.repeats)[:, None])
    scatter, shared = _parts(study, study.noise, plan)
    return CorrelatedNoise.by_row(scatter / plan.repeats[:, None, None] + shared)


def visits_noise(study: Study, plan: Plan) -> RowNoise:
    """The noise of every single visit (sum of repeats, rows), those of a pose one after another.

    Raises:
        UserError: Too many repeats of a pose share an error of the model.
    """
    visits = int(plan.repeats.sum())
    if study.noise is None:
        if study.sight is None:
            return np.broadcast_to(study.sigma, (visits, len(study.sigma)))
        each = _as_read(study, plan, np.tile(study.sigma, (len(plan.q), 1)))
        return np.repeat(each, plan.repeats, axis=0)
    scatter, shared = _parts(study, study.noise, plan)
    rows = scatter.shape[1]
    if not study.noise.shares:
        return CorrelatedNoise.by_row(np.repeat(scatter, plan.repeats, axis=0))
    most = MOST_COORDINATES // rows
    if plan.repeats.max() > most:
        raise study.error(
            "noise",
            f"{plan.repeats.max()} repeats of a pose share an error of the model; "
            f"expected {most} at most here",
        )
    first = np.cumsum(plan.repeats) - plan.repeats
    blocks = []
    for r in np.unique(plan.repeats):
        of_size = np.flatnonzero(plan.repeats == r)
        own = np.einsum("ij,gab->giajb", np.eye(r), scatter[of_size])
        whole = own + shared[of_size][:, None, :, None]
        members = first[of_size][:, None] + np.arange(r)
        blocks.append(NoiseBlocks(members, whole.reshape(len(of_size), r * rows, r * rows)))
    return CorrelatedNoise.of(blocks, (visits, rows))


def _parts(study: Study, noise: VisitNoise, plan: Plan) -> tuple[Array, Array]:
    """What repeats average out, and what they share (m, rows, rows) [m^2, rad^2]."""
    frames = study.model.frames(plan.q)
    scatter = np.moveaxis(noise.scatter_of(study.model, frames), -1, 0)
    visits = shared_visits(plan.q, plan.repeats, study.robot.slides, noise.within, plan.wrench)
    near = visits / plan.repeats
    shared = np.moveaxis(noise.shared_of(study.model, frames, plan.wrench), -1, 0)
    if study.sight is not None:
        read = study.sight.rows(plan.q)
        absent = np.eye(scatter.shape[1]) * (1.0 - read)[:, None]
        scatter = only_seen(scatter, read) + (NOT_READ**2 - 1.0) * absent
        shared = only_seen(shared, read) - absent
    return scatter, near[:, None, None] * shared


def _as_read(study: Study, plan: Plan, sigma: Array) -> Array:
    """Standard deviations (m, rows), next to infinite of rows that are not read."""
    if study.sight is None:
        return np.asarray(sigma)
    return np.where(study.sight.rows(plan.q), sigma, NOT_READ)


def planned_measurements(study: Study, plan: Plan) -> Measurements:
    """Poses, loads and noise of a plan: a row for each pose, and instrument if there are several.

    Repetitions count as one measurement of less noise, ``sigma / sqrt(repeats)``, so that very many
    are not expanded; of a discrepancy that they share they do not lessen.

    Args:
        study: Says which rows are measured, and their noise. Its instruments measure as many rows
            each.
        plan: The experiments.
    """
    if study.noise is not None:
        visits = _of_sensors(study, plan, np.ones_like(plan.repeats))
        return stated_noise(study, visits, _of_instruments(study, plan.repeats))
    if study.model.sensors:
        return _of_sensors(study, plan, plan.repeats)
    poses = len(plan.q)
    sigma = _as_read(study, plan, study.sigma / np.sqrt(plan.repeats[:, None].astype(float)))
    nothing = np.zeros((poses, len(study.sigma)))
    return Measurements(
        plan.q, plan.wrench, nothing, sigma, np.zeros((poses, 3)), absolute=study.is_absolute
    )


def _of_instruments(study: Study, values: Indices) -> Indices:
    """Values (poses,) for each instrument in each pose."""
    return np.repeat(values, len(study.model.instruments))


def _of_sensors(study: Study, plan: Plan, repeats: Indices) -> Measurements:
    """The same where markers or distances are measured: all of them in each pose."""
    sensors = study.model.instruments
    poses = len(plan.q)
    single = np.tile(study_sigma(study), (poses, 1))
    sigma = _as_read(study, plan, single).reshape(poses * len(sensors), -1)
    sigma = sigma / np.sqrt(_of_instruments(study, repeats))[:, None]
    offsets = [sensor.point.offset for sensor in sensors]
    index = np.tile(np.arange(len(sensors)), poses)
    return Measurements(
        np.repeat(plan.q, len(sensors), axis=0),
        np.repeat(plan.wrench, len(sensors), axis=0),
        np.zeros_like(sigma),
        sigma,
        np.tile(offsets, (poses, 1)),
        sensor=index,
        turn=sheet_turns(sensors, index),
        absolute=study.is_absolute,
    )


def plan_propagation(study: Study, plan: Plan) -> Propagation | None:
    """Propagate the circumstances of a calibration by a plan to its estimates.

    Args:
        study: The study; its [simulation] says how compliant the joints are.
        plan: All experiments.

    Returns:
        The shifts of the estimates; None without a [simulation], or if the plan leaves a compliance
        open.
    """
    if study.specification.simulation is None:
        return None
    noise = promised_noise(study, study.model)
    try:
        by_noise = _covariance_with(study, plan, None if noise is None else noise.exact)
    except SingularPlanError:
        return None
    found = Propagation.of(
        study.model,
        planned_measurements(study, plan),
        study.compliances,
        by_noise,
        uncertainty_of(study),
        np.repeat(plan.repeats, len(study.model.instruments)),
        _known_before(study),
        payload_beside_load(study),
    )
    if noise is None or not noise.shares:
        return found
    by_model = root_of_difference(_covariance_with(study, plan, noise), by_noise)
    below = np.pad(by_model, ((0, len(found.assumed)), (0, 0)))
    return replace(found, roots=found.roots | {"model": below})


def _known_before(study: Study) -> PriorRows | None:
    """What a study says that was known before, as rows ``R' R``; None where it does not count."""
    known = study.prior_information
    if known is None:
        return None
    return PriorRows(root(known), np.zeros(len(known)))


def _covariance_with(study: Study, plan: Plan, noise: VisitNoise | None) -> Array:
    """Covariance (p, p) of the estimates of a plan with some noise of its visits."""
    M = replace(study.space, noise=noise).information(plan)
    if study.prior_information is not None:
        M = M + study.prior_information
    return np.asarray(covariance(M, study.model.parameters))


@dataclass(frozen=True, eq=False)
class CalibratedDesigns(Designs, ABC):
    """Designs of calibrations, in which more is uncertain than the noise."""

    @abstractmethod
    def propagated(self, plan: Plan) -> Propagation | None:
        """What is uncertain in a calibration by a plan; None where nothing tells it."""

    def propagation(self, plan: Plan) -> Propagation | None:
        """The same, kept for the last plan: budget, totals and findings ask for it one by one."""
        last = vars(self).get("last")
        if last is None or last[0] is not plan:
            last = vars(self)["last"] = (plan, self.propagated(plan))
        return last[1]

    @abstractmethod
    def by_springs(self, tasks: Tasks) -> float:
        """Root mean square of what springs leave out of some tasks themselves [m]."""

    @abstractmethod
    def with_friction(self, tasks: Tasks, plan: Plan) -> tuple[Array, Array] | None:
        """The parameters, and shares of the joints' loads that friction may hold behind them.

        Returns:
            Rows (N, p + f) of a plan in units of their noise, with those of what is known besides;
            and how they move the tool in tasks (r, p + f) [m]. None where no friction counts.
        """

    def held(self, tasks: Tasks, plan: Plan) -> float:
        """Root mean square of what friction adds in tasks that it may hold a share of loads [m].

        It is in the tasks, and in estimates that a plan cannot tell from it. Rows factor as
        ``[A H] = Q R``, so that errors are ``R^-1 z`` of independent z of size one. As R is
        triangular, those of z that belong to A are the errors without friction; the others are what
        it adds, ``|T R^-1|`` over the columns of H, with the motions T in the tasks.
        """
        given = self.with_friction(tasks, plan)
        if given is None:
            return 0.0
        rows, target = given
        size = np.linalg.norm(rows, axis=0)
        R = np.asarray(np.linalg.qr(rows / size, mode="r"))
        moved = np.linalg.solve(R.T, (target / size).T)
        return float(np.linalg.norm(moved[-len(self.study.unknown) :]))

    def left_out(self, tasks: Tasks, plan: Plan) -> float:
        """Root mean square of what the model leaves out of some tasks of the study [m]."""
        return float(np.hypot(self.by_springs(tasks), self.held(tasks, plan)))

    def error_budget(self, plan: Plan) -> ErrorBudget | None:
        """Propagate what is uncertain in a calibration by a plan to the study's task.

        The nonlinear model will be fitted where it matters, so that the linear one adds nothing to
        the part of the model: that is what the study says that springs leave out, or what they
        likely do, which the budget says, in the estimates and in the task itself.

        Args:
            plan: All experiments.

        Returns:
            The budget; None without a test pose, where compliances are unknown without a
            [simulation], or if the plan leaves a parameter open.
        """
        tasks = self.study.tasks
        found = self.propagation(plan) if tasks else None
        if found is None:
            return None
        budget = found.budget(tasks, self.left_out(tasks, plan))
        table = self.study.specification.noise
        if not budget.model or (table is not None and table.says_of_model):
            return budget
        return replace(budget, assumed_share=ASSUMED)

    def rests_on_known(self, plan: Plan) -> tuple[Finding, ...]:
        """Known compliances on which the budget rests, and whose deviation nobody stated."""
        budget = self.error_budget(plan) if unstated(self.study) else None
        found = None if budget is None else self.propagation(plan)
        if budget is None or found is None:
            return ()
        errors = found.known_errors(self.study, self.study.tasks)
        return tuple(unstated_findings(self.study, errors, budget.total))

    def totals(self, plan: Plan) -> TaskAccuracy | None:
        """Find the errors to expect in each test pose, with the total of each where it is known.

        Args:
            plan: All experiments.

        Returns:
            The errors; None for a single test pose, without one, and if the plan leaves a parameter
            open.
        """
        each = self.accuracy(plan)
        found = None if each is None else self.propagation(plan)
        if each is None or found is None:
            return each
        left_out = [self.left_out(Tasks([task]), plan) for task in self.study.tasks]
        return replace(each, total=found.totals(self.study.tasks, np.array(left_out)))


@dataclass(frozen=True, eq=False)
class SpringDesigns(CalibratedDesigns):
    """The designs of a study of springs by displacements."""

    def propagated(self, plan: Plan) -> Propagation | None:
        """What is uncertain; None without a [simulation], or if the plan leaves any open."""
        return plan_propagation(self.study, plan)

    def warnings(
        self,
        plan: Plan,
        expected: ExpectedError | None,
        criterion: criteria.Criterion | None = None,
    ) -> tuple[Finding, ...]:
        """What is hard to believe, and what the promise rests on."""
        return (*super().warnings(plan, expected, criterion), *self.rests_on_known(plan))

    def by_springs(self, tasks: Tasks) -> float:
        """With the constant error of a pose, where the study states one."""
        noise = promised_noise(self.study, self.study.model)
        if noise is None or not noise.shares:
            return 0.0
        constant = np.sqrt(COORDINATES) * float(noise.discrepancy.max())
        if noise.error is None:
            return float(constant)
        columns = tasks.with_unknown(tuple(range(self.study.robot.n))).target
        return float(np.hypot(constant, noise.error.remaining(columns)))

    def with_friction(self, tasks: Tasks, plan: Plan) -> tuple[Array, Array] | None:
        """Compliances with shares, those of a design that counts them."""
        noise = promised_noise(self.study, self.study.model)
        share = 0.0 if noise is None or noise.error is None else noise.error.share
        friction = friction_of(self.study, share)
        if friction is None:
            return None
        counted = self.study.with_friction(friction)
        assert counted.prior_information is not None
        A = replace(counted.space, noise=noise).rows_of(plan)
        weighted = np.sqrt(plan.repeats)[:, None, None] * A
        known = root(counted.prior_information)
        rows = np.concatenate([weighted.reshape(-1, A.shape[-1]), known])
        return rows, tasks.with_friction(friction).target


@dataclass(frozen=True, eq=False)
class PlanBias(Presented):
    """A plan's bias, and its effect in the test pose.

    Attributes:
        bias: Bias and covariance of the compliances.
        joints: Names (p,) of their joints.
        parameters: Names (p,) of the parameters.
        experiments: Number of measurements.
        unit: Of the parameters.
        rho0: Error by the noise in the test pose, Eq. (20) [m]; None without a test pose.
        rho0_bias: Length of the mean error by the bias in the test pose [m]; None without one.
        poses: Number of test poses, over which both are roots of the mean of squares.
    """

    bias: Bias
    joints: tuple[str, ...]
    parameters: tuple[str, ...]
    experiments: int
    unit: str
    rho0: float | None
    rho0_bias: float | None
    poses: int = 1

    def headline(self) -> str:
        """The largest bias in standard deviations."""
        worst = int(np.abs(self.bias.in_std).argmax())
        return (
            f"linear model, {self.experiments} experiments: {self.parameters[worst]} is off by "
            f"{self.bias.in_std[worst]:+.3g} standard deviations at most"
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers in SI units; a per cent value that is infinite is null."""
        percent = [p if np.isfinite(p) else None for p in self.bias.percent.tolist()]
        return {
            "experiments": self.experiments,
            "true": self._by_joint(self.bias.true),
            "expected": self._by_joint(self.bias.expected),
            "bias": self._by_joint(self.bias.bias),
            "std": self._by_joint(self.bias.std),
            "bias_in_std": self._by_joint(self.bias.in_std),
            "bias_percent": dict(zip(self.joints, percent, strict=True)),
            "rho0": self.rho0,
            "rho0_bias": self.rho0_bias,
        }

    def to_frame(self) -> "pd.DataFrame":
        """A row for each compliance, SI units.

        Columns: `joint`, `parameter`, `true`, `expected`, `bias`, `std`, `bias_in_std` and
        `bias_percent`.
        """
        import pandas as pd

        return pd.DataFrame(
            {
                "joint": self.joints,
                "parameter": self.parameters,
                "true": self.bias.true,
                "expected": self.bias.expected,
                "bias": self.bias.bias,
                "std": self.bias.std,
                "bias_in_std": self.bias.in_std,
                "bias_percent": self.bias.percent,
            }
        )

    def _by_joint(self, values: Array) -> dict[str, float]:
        """Values (p,) by the names of the joints."""
        return dict(zip(self.joints, values.tolist(), strict=True))


def plan_bias(study: Study, plan: Plan, path: Path | str) -> PlanBias:
    """Carry out a plan on the robot of the study's [simulation] and identify with the linear model.

    Compliances that [simulation] gives for joints that are not unknown bend the robot too.

    Args:
        study: Model, noise, test pose and assumed true compliances.
        plan: The plan.
        path: Where the plan comes from, for the message.

    Raises:
        UserError: The study has no [simulation], or it lacks a joint or names an unknown one; or a
            pose of the plan has no equilibrium.
        SingularPlanError: The plan cannot identify all parameters; names them.
    """
    k = _assumed_compliances(study)
    # The mean of repetitions has all their information: counts need no rows.
    sigma = plan_noise(study, plan)
    try:
        found = linearisation_bias(study.model, plan.q, plan.wrench, sigma, k, study.known)
    except NoEquilibriumError as error:
        row = f"row {error.pose + 1}"
        why = why_no_rest(study.robot, plan.q[error.pose], k)
        message = f"no stable equilibrium under its load: {why}"
        raise UserError(message, where=path, key=row) from error
    A0 = study.target
    return PlanBias(
        bias=found,
        joints=study.specification.joints.unknown,
        parameters=study.model.parameters,
        experiments=plan.experiments,
        unit=study.model.unit,
        rho0=None if A0 is None else float(compensation_accuracy(A0, found.covariance)),
        rho0_bias=None if A0 is None else found.in_pose(A0),
        poses=len(study.tasks),
    )


def _assumed_compliances(study: Study) -> Array:
    """Compliances (n,) of all joints [rad/(N m)].

    They are from [simulation]; where it does not name a joint, known ones from [joints], else zero.

    Raises:
        UserError: The study has no [simulation], or it lacks a joint or names an unknown one.
    """
    simulation = study.specification.simulation
    if simulation is None:
        message = "expected a table with the assumed true compliances; the study has none"
        raise study.error("simulation", message)
    names = study.robot.joint_names
    for name in simulation.compliance_rad_per_Nm:
        if name not in names:
            message = f"no joint {name!r}; this robot has {', '.join(names)}"
            raise study.error("simulation.compliance_rad_per_Nm", message)
    k = np.array([simulation.compliance_rad_per_Nm.get(name, 0.0) for name in names])
    for j, compliance in study.known.items():
        k[j] = simulation.compliance_rad_per_Nm.get(names[j], compliance)
    k[study.model.joints] = study.compliances
    return k


def check_plan_posterior(
    study: Study,
    plan: Plan,
    rng: np.random.Generator,
    *,
    noise: Noise | None = None,
    options: SamplingOptions = SamplingOptions(),  # noqa: B008  (frozen)
) -> PosteriorCheck:
    """Simulate one calibration with normal errors, sample its posterior, and compare it.

    Args:
        study: Model, noise, priors and assumed true compliances.
        plan: The plan that is carried out.
        rng: Source of randomness, of the errors and of the sampler.
        noise: Assumptions about the noise; default to those of the study.
        options: How accurately, and where the chain is kept.

    Returns:
        Posterior standard deviations beside those of Eq. (13), and the samples; the reference is
        the assumed truth.

    Raises:
        SingularPlanError: The plan cannot identify all parameters, and the prior does not tell
            the others.
        UserError: The study assumes no true compliances, or its prior is not one.
        UnconvergedError: The chain does not converge.
        ImproperPosteriorError: Too few measurements for the unknowns.
        ChainFileError: The file is no chain, or of another problem.
    """
    A = np.repeat(study.model.regressor(plan.q, plan.wrench), plan.repeats, axis=0)
    sigma = visits_noise(study, plan)
    measured = simulate(A, study.compliances, sigma, rng)[0]
    fit, untold = first_estimate(study, A, measured, sigma)
    found = check_posterior(study, A, measured, sigma, fit, rng, noise=noise, options=options)
    table = found.table.assign(reference=study.compliances)
    if not untold:  # else Eq. (13) has no inverse
        table = table.rename(columns={"std_fit": "std_eq13"})
    names = measured_names(study.model)
    return replace(found, table=table, reference="assumed truth", coordinates=names)
