"""A study of geometry of a plane arm of two joints, whose springs are unknown: the smallest one."""

from typing import Any

from arm import ROBOT

from edtk.calibration.evaluate_geometry import GeometryDesigns
from edtk.calibration.geometry_plan import GeometryPlan
from edtk.study.plan_study import plan_study
from edtk.study.study import Study

LOAD = [0, 0, -100, 0, 0, 0]
STUDY = Study(
    robot=ROBOT,
    tool={"position_mm": [500, 0, 0]},
    load={"F_N": LOAD[:3]},
    measurement={"sigma_mm": 0.1},
    parameters={"geometry": ["zeros"], "compliance": ["q1", "q2"], "base": False},
    test_pose={
        "q_deg": [10, -60],
        "load": {"F_N": [0, 0, -50]},
    },
    candidates=100,
)


def plan_geometry(
    study: Study, size: int | None = None, criterion: str | None = None, **given: Any
) -> GeometryPlan:
    """The plan of visits that a study of geometry asks for, see `plan_study`."""
    found = plan_study(study, size, criterion, sought=GeometryDesigns, **given)
    assert isinstance(found, GeometryPlan)
    return found
