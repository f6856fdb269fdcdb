"""What measurements tell of a study's compliances, where they leave some open."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import criteria
from criteria.linalg.combination import combination
from criteria.linalg.null_space import null_space
from edtk.inference.measurements import Measurements
from edtk.inference.whiten import whiten_columns
from edtk.study.plan_covariance import OpenInterestError
from edtk.study.study import Study


@dataclass(frozen=True, eq=False)
class ToldPart:
    """A study of as many compliances as measurements tell.

    Of each open direction one joint counts as rigid. What is of interest is estimable, and so the
    same whichever joint that is; an estimate that is open by itself stands for a combination.

    Attributes:
        asked: The study as it was given.
        study: The same, of the joints whose columns are independent.
        rigid: Joints that count as rigid instead.
        stands_for: What the estimates of other open joints are of, in words, by joint:
            "k2 + 0.5 k3".
    """

    asked: Study
    study: Study
    rigid: tuple[str, ...]
    stands_for: Mapping[str, str]

    @property
    def open(self) -> tuple[str, ...]:
        """Joints whose own compliances are not told."""
        unknown = self.asked.specification.joints.unknown
        return tuple(name for name in unknown if name in (*self.rigid, *self.stands_for))


def told_part(study: Study, data: Measurements) -> ToldPart:
    """Leave out what measurements leave open, where that is not of interest.

    Each open direction N_j has a joint of its own with the factor one, so that ``k - k_j N_j`` has
    none of it and makes the same displacements ``A k``, as ``A N_j = 0``.

    Args:
        study: The study; says what is of interest.
        data: The measurements, which do not tell all compliances.

    Raises:
        OpenInterestError: They do not tell what is of interest.
    """
    names = study.model.parameters
    rows = whiten_columns(data.regressor(study.model), data.noise).reshape(-1, len(names))
    M = rows.T @ rows
    missing = criteria.create("A", interest=study.interest).missing(M, names)
    if missing:
        raise OpenInterestError(tuple(missing))
    scaled, d = null_space(M)
    N = scaled / d[:, None]
    # In echelon form each direction has one entry of one that the others have not.
    single = np.isclose(np.abs(scaled).sum(axis=1), 1.0)
    own = [int(np.flatnonzero(single & np.isclose(column, 1.0))[0]) for column in scaled.T]
    N = N / N[own, range(len(own))]
    joints = study.specification.joints.unknown
    stands_for = {}
    for i in np.flatnonzero(N.any(axis=1)):
        if i not in own:
            factors = np.zeros(len(names))
            factors[i] = 1.0
            factors[own] = -N[i]
            stands_for[joints[i]] = combination(factors, names)
    rigid = tuple(joints[i] for i in own)
    return ToldPart(study, _without(study, rigid), rigid, stands_for)


def _without(study: Study, rigid: tuple[str, ...]) -> Study:
    """The study in which some unknown joints count as rigid; it asks for no posterior."""
    keys: dict[str, Any] = study.to_dict()
    unknown = [name for name in keys["joints"]["unknown"] if name not in rigid]
    changed = {"joints": keys["joints"] | {"unknown": unknown}, "interest": None, "prior": None}
    if study.specification.simulation is not None:
        given = study.specification.simulation.compliance_rad_per_Nm
        kept = {name: value for name, value in given.items() if name not in rigid}
        changed["simulation"] = {"compliance_rad_per_Nm": kept}
    return study.replace(**changed)
