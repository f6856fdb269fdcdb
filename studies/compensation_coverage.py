"""How often the band of `edtk compensate` covers the error of a robot at rest under its load."""

from dataclasses import dataclass, replace

import numpy as np

from edtk import Plan, Study
from edtk.calibration.calibrated_springs import CalibratedSprings
from edtk.calibration.compensate import compensate
from edtk.findings.nonlinear_part import linear_model_bias
from edtk.fit.equilibrium import equilibrium_deflection
from edtk.fit.identify import identify
from edtk.fit.measurements import Measurements
from edtk.measure.compliances import Compliances
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.expected_error import remaining_error
from edtk.measure.task import all_compliances
from edtk.system.typing import Array

# Measurements of a plan, each so many times: the more, the more the linear model's bias counts.
REPEATS = {"table_4_12, once": 1, "table_4_12, four times": 4, "table_4_12, twelve times": 12}
RIGID = 1e-15  # compliance of a joint that does not bend [rad/(N m)]


@dataclass(frozen=True, eq=False)
class Coverage:
    """Shares of calibrations whose 95 % band covers the error in each task pose.

    Attributes:
        covered: With the bias of the linear model in the band (t,).
        without: With the covariance of the noise alone (t,).
        ratio: Error of the linear model over that of the noise (t,), on average.
    """

    covered: Array
    without: Array
    ratio: Array


def compensation_coverage(
    study: Study, repeats: int, runs: int, rng: np.random.Generator
) -> Coverage:
    """Simulate calibrations of a robot at rest under its load, and compensate some poses.

    The robot is measured in the poses of table_4_12 and identified with the linear model. It is
    commanded in the test pose, and in five poses of the plan under the plan's load. Its joint 1
    does not bend.

    Args:
        study: The KR 270, its plans and its test pose.
        repeats: How many times each pose of the plan is measured.
        runs: Number of calibrations.
        rng: Source of randomness.
    """
    study = study.replace(uncertainty={"rigid_rad_per_Nm": {"q1": RIGID}})
    plan = study.published_plans()["table_4_12"]
    q = np.repeat(plan.q, repeats, axis=0)
    W = np.repeat(plan.wrench, repeats, axis=0)
    sigma = np.tile(study.sigma, (len(q), 1))
    k = all_compliances(study.model, study.compliances)
    clean = equilibrium_deflection(study.model, q, W, k)
    task = _task(study, plan)
    data = Measurements(q, W, clean, sigma, np.zeros((len(q), 3)))
    A = data.regressor(study.model)
    rows = []
    for _ in range(runs):
        measured = clean + sigma * rng.standard_normal(clean.shape)
        fit = identify(A, measured, sigma, study.model.parameters)
        bias = linear_model_bias(study, data, A, fit.k)
        joints = study.specification.joints.unknown
        known = Compliances(joints, fit.k, fit.unbounded, fit.covariance, bias=bias)
        rows.append(_one(study, known, task))
    return Coverage(*np.mean(rows, axis=0))


def _task(study: Study, plan: Plan) -> Plan:
    """The test pose with its load, and five poses of the plan with the plan's."""
    q = np.vstack([study.task.q, plan.q[:5]])
    return Plan(q, np.vstack([study.task.wrench, plan.wrench[:5]]), np.ones(6, dtype=int))


def _one(study: Study, known: Compliances, task: Plan) -> tuple[Array, Array, Array]:
    """Whether both bands cover (t,), and the ratio of the two errors (t,), for one calibration."""
    model = ElastostaticModel(study.task.model.robot, study.model.joints)
    errors = remaining_error(model, task.q, task.wrench, known.k, study.compliances)
    size = np.linalg.norm(errors, axis=-1)
    found = compensate(CalibratedSprings(study, known), task, "task")
    without = compensate(CalibratedSprings(study, replace(known, bias=None)), task, "task")
    return _within(size, found.band), _within(size, without.band), found.linear / without.remaining


def _within(size: Array, band: Array) -> Array:
    """Whether errors (t,) are within bands (t, 2)."""
    return (band[:, 0] <= size) & (size <= band[:, 1])
