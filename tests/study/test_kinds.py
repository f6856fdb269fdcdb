"""What a study says otherwise where its unknowns are of another kind."""

import numpy as np
import pytest
from small_arm import ROBOT

from edtk.study.study import Study
from edtk.system.errors import UserError

GEOMETRY = Study(
    robot=ROBOT,
    measurement={"sigma_mm": 0.05},
    parameters={"geometry": "all", "compliance": ["q1", "q2"]},
    load={"F_N": [0, 0, -100]},
    marker=[{"name": "A", "position_mm": [90, 10, 50]}],
)
SPRINGS = Study(
    robot=ROBOT,
    tool={"position_mm": [100, 0, 50]},
    measurement={"sigma_mm": 0.05},
    joints={"unknown": ["q1", "q2"]},
    load={"F_N": [0, 0, -100]},
)
ON_BASE = {"name": "floor", "joint": "base", "position_mm": [500, 0, 0]}


def test_points_on_the_base_are_for_absolute_positions():
    """Differences of two visits do not see the base: points on it are of geometry alone."""
    markers = [{"name": "A", "position_mm": [90, 10, 50]}, ON_BASE]
    assert GEOMETRY.replace(marker=markers).kind.bodies(GEOMETRY.robot)[-1] == "base"
    with pytest.raises(UserError, match=r"marker\.1\.joint.*no joint 'base'"):
        SPRINGS.replace(marker=markers)


def test_each_kind_says_what_is_unknown():
    """A line about a study counts its springs, and names the geometry."""
    assert "geometry and 2 unknown compliances" in GEOMETRY.headline()
    assert "about" in SPRINGS.headline()
    assert "geometry" not in SPRINGS.headline()
    assert GEOMETRY.kind.key == "parameters"
    assert GEOMETRY.kind.parameters(GEOMETRY).compliance == ("q1", "q2")


def test_what_a_kind_does_not_know_names_the_table():
    """Both refusals are lines at the key that decides which kind a study is of."""
    with pytest.raises(UserError, match=r"parameters.*without"):
        GEOMETRY.require_compliances_alone()
    with pytest.raises(UserError, match=r"parameters.*with a table \[parameters\]"):
        SPRINGS.kind.parameters(SPRINGS)


def test_poses_without_a_load_have_the_only_one_or_none():
    """The only load of springs; of geometry none, as visits are made with and without one."""
    np.testing.assert_array_equal(SPRINGS.kind.wrench_of_pose(SPRINGS), [0, 0, -100, 0, 0, 0])
    assert not np.any(GEOMETRY.kind.wrench_of_pose(GEOMETRY))
    several = SPRINGS.replace(load={"list_F_N": [[0, 0, -100], [0, 50, 0]]})
    assert several.kind.wrench_of_pose(several) is None
