"""The robot of a study: links of a URDF, and limits that take the place of the robot's own."""

import numpy as np
import pytest
from arm import arm
from urdf_text import written

import edtk
from edtk.study.study import Study
from edtk.system.errors import UserError

LIMITED = ('<limit lower="-1" upper="2" effort="1" velocity="1"/>', "")


def keys(**more):
    """A study of the URDF in its folder."""
    return {
        "robot": "arm.urdf",
        "tip_link": "flange",
        "tool": {"position_mm": [0, 0, 200]},
        "load": {"F_N": [30, 0, -100]},
        "measurement": {"sigma_mm": 0.1},
        "joints": {"unknown": ["turn", "bend"]},
        "candidates": 100,
        "starts": 1,
        "sizes": [2],
    } | more


def refusal(**more):
    with pytest.raises(UserError) as caught:
        Study(**keys(**more))
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


def test_a_study_of_a_urdf_plans_and_is_written_again(tmp_path):
    """Joints have their names, the tool sits on the tip, and the file reads as the same study."""
    written(tmp_path)
    study = Study(folder=tmp_path, **keys())
    assert study.robot.joint_names == ("turn", "bend", "slide")
    np.testing.assert_allclose(study.robot.tool[:3, 3], study.robot.flange[:3] @ [0, 0, 0.2, 1])
    study.to_toml(tmp_path / "study.toml")
    again = edtk.load_study(tmp_path / "study.toml")
    q = [0.1, 0.2, 0.3]
    np.testing.assert_array_equal(again.robot.forward(q), study.robot.forward(q))
    assert tmp_path / "arm.urdf" in again.reads


def test_a_study_keeps_the_path_of_its_urdf(tmp_path):
    """Written to another folder, it names the file from there."""
    written(tmp_path)
    (tmp_path / "below").mkdir()
    Study(folder=tmp_path, **keys()).to_toml(tmp_path / "below" / "study.toml")
    assert edtk.load_study(tmp_path / "below" / "study.toml").robot.n == 3


def test_limits_of_the_study_replace_those_of_the_robot(tmp_path):
    """They are asked for where the file has none, and taken in the unit of the key."""
    written(tmp_path, LIMITED)
    message = refusal(folder=tmp_path)
    assert message.startswith("Study: joints.limits_deg: the file has no range for bend; expected")
    joints = {
        "unknown": ["bend"],
        "limits_deg": {"bend": [-10, 20]},
        "limits_mm": {"slide": [0, 5]},
    }
    study = Study(folder=tmp_path, **keys(joints=joints))
    np.testing.assert_allclose(study.robot.limits[:, 1], np.deg2rad([-10, 20]))
    np.testing.assert_allclose(study.robot.limits[:, 2], [0, 0.005])
    narrow = arm(joints={"unknown": ["q1"], "limits_deg": {"q2": [-1, 1]}})
    np.testing.assert_allclose(narrow.robot.limits[:, 1], np.deg2rad([-1, 1]))


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        (
            {"tip_link": None},
            "Study: tip_link: robot arm.urdf has 3 leaves below 'world'; expected",
        ),
        ({"base_link": "x"}, "Study: base_link: robot arm.urdf has no link 'x'; its links are"),
        ({"robot": "kuka_kr270"}, "Study: tip_link: robot kuka_kr270 has no links; 'flange' goes"),
        ({"robot": arm().to_dict()["robot"]}, "Study: tip_link: goes with a URDF file; this robot"),
        ({"robot": "b.urdf"}, "Study: robot: robot file"),
    ],
)
def test_wrong_links_are_told_with_their_key(tmp_path, more, expected):
    """The line names the key of the study that has to be mended."""
    written(tmp_path)
    assert refusal(folder=tmp_path, **more).startswith(expected)


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ({"limits_deg": {"bend": [2, 1]}}, "bend: expected the lower limit before the upper one"),
        ({"limits_deg": {"bent": [1, 2]}}, "joints.limits_deg: robot arm: no joint 'bent'; it has"),
        (
            {"limits_deg": {"slide": [1, 2]}},
            "limits_deg.slide: the joint is prismatic; give its li",
        ),
        ({"limits_mm": {"bend": [1, 2]}}, "limits_mm.bend: the joint is revolute; give its limits"),
    ],
)
def test_wrong_limits_are_told_with_their_key(tmp_path, limits, expected):
    """Swapped limits, joints that are not there, and the wrong unit."""
    written(tmp_path)
    assert expected in refusal(folder=tmp_path, joints={"unknown": ["bend"], **limits})
