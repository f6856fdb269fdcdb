"""A study of geometry of a plane arm of two joints, whose springs are unknown: the smallest one."""

from arm import ROBOT

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
