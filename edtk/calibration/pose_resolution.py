"""How far a measured pose may be from the planned one and still be the same."""

from edtk.study.study import Study

LEAST = 1e-3  # [deg, mm]: a file's digits, where a study says that its plans are not rounded
ROUNDING = 1e-9  # relative: a pose at the very limit counts as within


def pose_resolution(study: Study) -> float:
    """The study's `plan_resolution_deg` [deg, mm]: the digits that a plan is printed with."""
    return max(study.specification.workspace.plan_resolution_deg, LEAST) * (1 + ROUNDING)
