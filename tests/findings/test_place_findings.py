"""Positions without load tell a robot of other lengths, which displacements do not."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from readings import PLAN, STUDY, readings_of

import edtk
from edtk.measure.pose_table import LOADED_COLUMNS, UNLOADED_COLUMNS, pose_columns
from edtk.robots.rotations import transform


def sheet(links, longer_mm, plan=PLAN, aside_mm=0):
    """Positions in the frame of a tracker, of a robot some of whose links are longer."""
    robot = STUDY.robot
    joints = list(robot.joints)
    for j in links:
        origin = joints[j].origin.copy()
        origin[:3, 3] *= 1 + 1e-3 * longer_mm / np.linalg.norm(origin[:3, 3])
        joints[j] = replace(joints[j], origin=origin)
    other = replace(robot, joints=tuple(joints))
    data = readings_of(plan.q, plan.wrench)
    # World and tracker have the same axes, as displacements need.
    flange = other.forward(data.q)
    before = flange[:, :3, 3] + 1e-3 * aside_mm * flange[:, :3, 0]
    before = before + transform((3.0, -2.0, 0.5))[:3, 3]
    table = dict(zip(pose_columns(robot), np.rad2deg(robot.shown(data.q)).T, strict=True))
    table |= dict(zip(("Fx_N", "Fy_N", "Fz_N"), data.wrench.T, strict=False))
    table |= dict(zip(UNLOADED_COLUMNS, 1e3 * before.T, strict=True))
    table |= dict(zip(LOADED_COLUMNS, 1e3 * (before + data.deflection).T, strict=True))
    return pd.DataFrame(table)


@pytest.mark.parametrize(
    ("links", "longer", "named"),
    [((), 0, False), ((1, 2, 4), 1, False), ((1, 2, 4), 100, True), ((2,), 100, True)],
)
def test_links_of_another_length_are_a_finding(links, longer, named):
    """100 mm of one link or of all are said with their size; a millimetre is any robot's."""
    found = edtk.identify(STUDY, sheet(links, longer)).findings
    said = [one for one in found if one.kind == "other_robot"]
    assert bool(said) == named
    if named:
        assert 0.01 < said[0].data["off"] < 0.1
        assert "mm (root mean square) from where the study's robot has it" in said[0].words


@pytest.mark.parametrize("name", ["table_4_2", "table_4_6"])
def test_few_poses_suffice(name):
    """Two poses have a distance; no place of the base brings a robot of other links there."""
    plan = STUDY.published_plans()[name]
    for longer in (0, 1, 100):
        found = edtk.identify(STUDY, sheet((1, 2, 4), longer, plan)).findings
        assert any(one.kind == "other_robot" for one in found) == (longer == 100)


def test_a_marker_elsewhere_is_a_finding():
    """Its lever is another one than that of the displacements which the study predicts."""
    found = edtk.identify(STUDY, sheet((), 0, aside_mm=150)).findings
    (said,) = [one for one in found if one.kind == "other_robot"]
    assert "is the marker where the study has it?" in said.words
