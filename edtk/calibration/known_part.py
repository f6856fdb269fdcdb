"""What the joints of known compliance add to measurements."""

from dataclasses import replace

import numpy as np

from edtk.inference.measurements import Measurements
from edtk.study.study import Study
from edtk.system.typing import Array


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
