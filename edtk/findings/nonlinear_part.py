"""What the loaded equilibrium and known joints add to the linear model."""

from dataclasses import replace

import numpy as np

from edtk.findings.match_plan import some_poses
from edtk.fit.equilibrium import linearise
from edtk.fit.identify import Identification
from edtk.fit.least_squares import SingularPlanError, Whitened, estimate
from edtk.fit.measurements import Measurements
from edtk.measure.equilibrium import NoEquilibriumError, Rest
from edtk.measure.task import all_compliances
from edtk.study.study import Study
from edtk.system.typing import Array

BIAS = 0.1  # of the linear model, in standard deviations, from which the equilibrium is fitted


def known_part(study: Study, data: Measurements) -> Array | float:
    """Compute the displacements that the known compliances make, by the linear model, Eq. (4).

    Args:
        study: Says which compliances are known.
        data: Poses, loads and markers.

    Returns:
        Displacements (m, rows) [m, rad]; zero where no compliance is known.
    """
    if not study.known:
        return 0.0
    model = replace(study.model, unknown=tuple(study.known))
    return data.regressor(model) @ np.array(list(study.known.values()))


def nonlinear_part(study: Study, data: Measurements, k: Array, A: Array | None = None) -> Array:
    """Compute the displacement at rest less that of the linear model, Eq. (2).

    Joints of known compliance bend in both.

    Args:
        study: The model.
        data: Poses, loads and markers.
        k: Compliances (p,), not negative [rad/(N m)].
        A: Regressors (m, rows, p) of the measurements, if they are at hand.

    Returns:
        Differences (m, rows) [m, rad].

    Raises:
        NoEquilibriumError: A robot of such compliances does not come to rest.
    """
    if A is None:
        A = data.regressor(study.model)
    one = data[np.unique(data.pose, return_index=True)[1]]
    # Rows of one pose, such as those of several markers, share its equilibrium.
    every_k = all_compliances(study.model, k, study.known)
    rest = Rest.of(study.model, one.q, one.wrench, every_k)
    return data.changes(study.model, rest) - A @ k - known_part(study, data)


def bends_much(study: Study, data: Measurements, A: Array, fit: Identification) -> bool:
    """Tell whether the linear fit is biased by more than a tenth of a standard deviation.

    The bias is the first step of the fit of the equilibrium, over some of very many poses.

    Args:
        study: The model.
        data: The measurements.
        A: Their regressors (m, rows, p).
        fit: The linear fit.
    """
    rows = some_poses(data.pose)
    some = data[rows]
    k = all_compliances(study.model, fit.unbounded, study.known)
    try:
        linear = linearise(study.model, some, k)
        whitened = Whitened.of(linear.A, some.noise, study.model.parameters)
    except (NoEquilibriumError, SingularPlanError):
        return False
    linear_part = A[rows] @ fit.unbounded + known_part(study, some)
    curved = linear.constant + linear.A @ fit.unbounded - linear_part
    bias = np.abs(whitened.solve(curved)) / fit.std
    return bool(bias.max() > BIAS)


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
