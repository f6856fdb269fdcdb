"""What the loaded equilibrium adds to the displacements of the linear model."""

import numpy as np

from edtk.calibration.known_part import known_part
from edtk.inference.equilibrium_deflection import marker_motion
from edtk.inference.measurements import Measurements
from edtk.model.all_compliances import all_compliances
from edtk.model.equilibrium import equilibrium
from edtk.model.rest import Rest
from edtk.study.study import Study
from edtk.system.typing import Array


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
    model = study.model
    if data.sensor is not None or not model.is_plain or model.own_weights is not None:
        moved = data.changes(model, Rest.of(model, one.q, one.wrench, every_k))
        return moved - A @ k - known_part(study, data)
    at_rest = equilibrium(study.robot, one.q, one.wrench, every_k)
    moved = marker_motion(model, data.q, at_rest.displacement[data.pose], data.marker)
    return moved - A @ k - known_part(study, data)
