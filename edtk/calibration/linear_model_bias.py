"""The bias of compliances that a calibration identified with the linear model."""

from edtk.calibration.nonlinear_part import nonlinear_part
from edtk.calibration.some_poses import some_poses
from edtk.inference.least_squares import SingularPlanError, estimate
from edtk.inference.measurements import Measurements
from edtk.model.equilibrium import NoEquilibriumError
from edtk.study.study import Study
from edtk.system.typing import Array


def linear_model_bias(study: Study, data: Measurements, A: Array, k: Array) -> Array | None:
    """Measure by how far the linear model is off, if the robot has the identified compliances.

    The fit is linear in the measurements: what the equilibrium adds to them, fitted, is the bias.

    Args:
        study: The model.
        data: The measurements from which the compliances were identified.
        A: Their regressors (m, rows, p).
        k: The compliances (p,), not negative [rad/(N m)].

    Returns:
        The bias ``E(k_hat) - k`` (p,) [rad/(N m)]; None if such a robot would not come to rest.
    """
    rows = some_poses(data.pose)
    some = data[rows]
    # Poses stay contiguous, as the model makes them: another layout sums in another order.
    some_A = A.T.take(rows, axis=-1).T
    try:
        added = nonlinear_part(study, some, k, some_A)
        return estimate(some_A, added, some.noise, study.model.parameters).k
    except (NoEquilibriumError, SingularPlanError):
        return None
