"""Robots from xacro files, whose macros ROS's own package expands."""

import sys

import numpy as np
import pytest
from urdf_text import ARM

from edtk.model.load_robot import load_robot
from edtk.model.robot_from_dict import RobotFileError
from edtk.study.study import Study

NAMESPACE = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
MACROS = f"""<robot {NAMESPACE}>
  <xacro:property name="length" value="${{2 * 0.35}}"/>
  <xacro:macro name="segment" params="name parent *origin">
    <link name="${{name}}"/>
    <joint name="to_${{name}}" type="revolute">
      <xacro:insert_block name="origin"/>
      <parent link="${{parent}}"/><child link="${{name}}"/>
      <axis xyz="0 1 0"/><limit lower="${{-pi / 2}}" upper="$(arg reach)"/>
    </joint>
  </xacro:macro>
</robot>
"""
MAIN = f"""<?xml version="1.0"?>
<robot name="arm" {NAMESPACE}>
  <xacro:arg name="reach" default="1.5"/>
  <xacro:include filename="INCLUDED"/>
  <link name="base"/>
  <xacro:segment name="upper" parent="base"><origin xyz="0 0 0.4"/></xacro:segment>
  <xacro:segment name="fore" parent="upper"><origin xyz="0 0 ${{length}}"/></xacro:segment>
  <xacro:if value="${{length > 0}}"><link name="tip"/>
    <joint name="plate" type="fixed">
      <origin xyz="0.3 0 0"/><parent link="fore"/><child link="tip"/>
    </joint>
  </xacro:if>
</robot>
"""


def package(folder, included="macros.xacro"):
    """The file of a package, and another one that it includes."""
    urdf = folder / "arm_description" / "urdf"
    urdf.mkdir(parents=True)
    (urdf.parent / "package.xml").write_text("<package/>")
    (urdf / "macros.xacro").write_text(MACROS)
    path = urdf / "arm.urdf.xacro"
    path.write_text(MAIN.replace("INCLUDED", included))
    return path


@pytest.mark.parametrize(
    "included", ["macros.xacro", "$(find arm_description)/urdf/macros.xacro"], ids=["near", "found"]
)
def test_macros_arguments_and_included_files_are_expanded(tmp_path, included):
    """The robot is that of the expressions' values, and its study names the file."""
    path = package(tmp_path, included)
    robot = load_robot(path)
    assert robot.joint_names == ("to_upper", "to_fore")
    np.testing.assert_allclose(robot.limits, [[-np.pi / 2] * 2, [1.5] * 2])
    np.testing.assert_allclose(robot.joints[1].origin[:3, 3], [0, 0, 0.7])
    np.testing.assert_allclose(robot.flange[:3, 3], [0.3, 0, 0])
    study = Study(
        robot=str(path),
        tool={"position_mm": [100, 0, 0]},
        load={"F_N": [0, 0, -100]},
        measurement={"sigma_mm": 0.1},
        joints={"unknown": ["to_upper", "to_fore"]},
    )
    assert path in study.reads


def test_a_file_without_macros_is_the_urdf(tmp_path):
    """All numbers are those of the same text in a file that ends in .urdf."""
    (tmp_path / "arm.xacro").write_text(ARM.replace("gazebo:plugin", "plugin"))
    (tmp_path / "arm.urdf").write_text(ARM)
    expanded = load_robot(tmp_path / "arm.xacro", tip="flange")
    plain = load_robot(tmp_path / "arm.urdf", tip="flange")
    q = np.array([0.3, -0.2, 0.2])
    np.testing.assert_array_equal(expanded.forward(q), plain.forward(q))
    assert [link.mass for link in expanded.links] == [link.mass for link in plain.links]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("${length}", "${lengths}", "'lengths' is not defined"),
        ('<xacro:arg name="reach" default="1.5"/>', "", "reach"),
        ("macros.xacro", "none.xacro", "none.xacro"),
        (
            "macros.xacro",
            "$(find elsewhere)/a.xacro",
            "expanded: no package 'elsewhere' in the folders",
        ),
        ("</robot>", "", "not valid XML"),
        ('<robot name="arm"', '<!DOCTYPE robot [<!ENTITY a "b">]><robot name="arm"', "DOCTYPE"),
        ("${length}", "${[].__class__}", "invalid name"),
        ("${length}", "${1 / 0}", "division by zero"),
    ],
)
def test_what_cannot_be_expanded_is_one_line(tmp_path, capfd, old, new, words):
    """The line names the file and what is wrong; nothing else is printed."""
    path = package(tmp_path)
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(RobotFileError) as caught:
        load_robot(path)
    message = str(caught.value)
    assert words in message
    assert "arm.urdf.xacro" in message
    assert "\n" not in message
    assert capfd.readouterr() == ("", "")


def test_without_the_extra_one_line_says_how_to_have_it(tmp_path, monkeypatch):
    """The package is looked for only where a file needs it."""
    path = package(tmp_path)
    monkeypatch.setitem(sys.modules, "xacro", None)
    with pytest.raises(RobotFileError, match=r"needs the extra edtk\[xacro\]"):
        load_robot(path)
    (tmp_path / "arm.urdf").write_text(ARM)
    load_robot(tmp_path / "arm.urdf", tip="flange")


def test_a_file_that_is_not_there(tmp_path):
    """It is one line, too."""
    with pytest.raises(RobotFileError, match="no such file"):
        load_robot("arm.urdf.xacro", tmp_path)
