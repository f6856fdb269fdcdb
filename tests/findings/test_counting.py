"""How a sheet counts joints is told by all visits, also where a joint stands still in most."""

from dataclasses import replace

import numpy as np
from geometry_sheets import OFFSETS, PLACE, STUDY

from edtk.findings.counting import find_counting
from edtk.fit.marker_positions import MarkerPositions
from edtk.robots.load_robot import load_robot
from edtk.study.study_geometry import StudyGeometry


def test_three_visits_in_which_a_joint_moves_count() -> None:
    """q1 stands still in 21 of 24 visits: a way that fits these alone leaves three sound ones."""
    rng = np.random.default_rng(0)
    model = replace(StudyGeometry.of(STUDY).model, offsets=OFFSETS, start=PLACE)
    theta = rng.normal(0, 2.0, model.p) * model.scales
    q = rng.uniform(-1.2, 1.2, (24, 6))
    q[:, 0] = np.pi / 4
    q[20:23, 0] = np.deg2rad([35, 55, 30])
    x = model.see(theta, q, derivatives=False).points
    row = np.arange(24)[:, None] * np.ones(3, dtype=int)
    shown = q * np.array([-1, -1, 1, 1, 1, 1])
    data = MarkerPositions(shown, np.zeros((24, 6)), x, row, tuple("ABC"))
    found = find_counting(model.robot, data)
    assert found is not None
    assert found.words == "q1, q2 count the other way"


def test_a_link_of_another_length_is_no_other_counting_where_markers_are_known() -> None:
    """45 mm for -55 mm at the elbow fits better if four joints turn, with markers elsewhere."""
    rng = np.random.default_rng(0)
    robot = load_robot("kuka_kr270")
    joints = list(robot.joints)
    origin = joints[3].origin.copy()
    origin[2, 3] += 0.1
    joints[3] = replace(joints[3], origin=origin)
    longer = replace(robot, joints=tuple(joints))
    q = rng.uniform(*np.clip(robot.limits, -2.6, 2.6), (30, 6))
    row = np.arange(90).reshape(30, 3)
    signs = np.array([1, -1, -1, 1, 1, 1])
    for true, shown, words in ((longer, q, None), (robot, q * signs, "q2, q3 count the other way")):
        there = PLACE @ true.forward(q)
        x = np.einsum("mij,kj->mki", there[:, :3, :3], OFFSETS) + there[:, None, :3, 3]
        data = MarkerPositions(shown, np.zeros((30, 6)), x, row, tuple("ABC"))
        found = find_counting(robot, data, OFFSETS)
        assert (found.words if found else None) == words
    x = np.einsum("mij,kj->mki", longer.forward(q)[:, :3, :3], OFFSETS)
    data = replace(data, q=q, measured=x + longer.forward(q)[:, None, :3, 3])
    assert find_counting(robot, data) is not None
