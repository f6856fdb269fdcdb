"""The loads under which poses of a study of geometry are visited."""

import numpy as np

from edtk.model.loads.fixed_load import FixedLoad
from edtk.model.loads.listed_load import ListedLoad
from edtk.study.study import Study
from edtk.system.typing import Array

NONE = np.zeros(6)


def wrenches_of(study: Study) -> Array:
    """The wrenches (s, 6) among which a visit chooses: none first, then those of the study.

    Without springs a load tells nothing, and none is alone.

    Raises:
        UserError: The study leaves the load free: a day of measurements changes few loads.
    """
    given = study.specification
    if not given.joints.unknown or (given.load is None and given.payload is None):
        return NONE[None]
    load = given.build_load()
    if isinstance(load, FixedLoad):
        own = load.always[None]
    elif isinstance(load, ListedLoad):
        own = load.wrenches
    else:
        raise study.error(
            "load",
            "plans of geometry visit poses without a load or with a given one; expected F_N or "
            "list_F_N",
        )
    own = np.unique(own[own.any(axis=1)], axis=0)
    return np.concatenate([NONE[None], own])
