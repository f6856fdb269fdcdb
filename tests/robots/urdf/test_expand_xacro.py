"""Robots from xacro files: what is expanded, and that nothing in them is run, read or endless."""

import os
import time

import numpy as np
import pytest
from urdf_text import ARM

from edtk.robots.load_robot import load_robot
from edtk.robots.robot_file import RobotFileError
from edtk.robots.urdf.xacro import expand_xacro
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
        ('<xacro:arg name="reach" default="1.5"/>', "", "$(arg reach)"),
        ("macros.xacro", "none.xacro", "there is no file 'none.xacro' to include"),
        ("macros.xacro", "$(find elsewhere)/a.xacro", "no package 'elsewhere' holds the file"),
        ("</robot>", "", "not valid XML"),
        ('<robot name="arm"', '<!DOCTYPE robot [<!ENTITY a "b">]><robot name="arm"', "DOCTYPE"),
        ("${length}", "${1 / 0}", "division by zero"),
        ("xacro:segment", "xacro:part", "there is no macro 'part'"),
        ('parent="base"', 'parents="base"', "has no parameter 'parents'"),
        ('<xacro:if value="${length > 0}">', '<xacro:if value="soft">', "neither true nor false"),
    ],
)
def test_what_cannot_be_expanded_is_one_line(tmp_path, capfd, old, new, words):
    """The line names the file, its line and what is wrong; nothing else is printed."""
    path = package(tmp_path)
    path.write_text(path.read_text().replace(old, new))
    message = refusal(path)
    assert words in message
    assert "arm.urdf.xacro" in message
    assert "XML" in message or "DOCTYPE" in message or "line " in message
    assert "\n" not in message
    assert len(message) <= 500
    assert capfd.readouterr() == ("", "")


def refusal(path):
    """The line with which a file is refused."""
    with pytest.raises(RobotFileError) as caught:
        load_robot(path)
    return str(caught.value)


def in_expression(tmp_path, expression):
    """A file with one expression."""
    path = tmp_path / "arm.xacro"
    path.write_text(f'<robot name="a" {NAMESPACE}><link name="${{{expression}}}"/></robot>')
    return path


CLASSES = "().__class__.__base__.__subclasses__()"


@pytest.mark.parametrize(
    "expression",
    [
        "__import__(&apos;os&apos;).system(&apos;touch RAN&apos;)",
        f"[c for c in {CLASSES} if c.__name__ == &apos;Popen&apos;][0](&apos;touch RAN&apos;)",
        f"{CLASSES}[-1]",
        "&apos;&apos;.__class__.__mro__",
        "&apos;{0.__class__}&apos;.format(1)",
        "&apos;%s&apos; % pi",
        "math.sin.__self__.__loader__",
        "python.vars()",
        "python.type(1)",
        "open(&apos;/etc/passwd&apos;)",
        "load_yaml(&apos;/etc/passwd&apos;)",
        "xacro.load_yaml(&apos;/etc/passwd&apos;)",
        "eval(&apos;1&apos;)",
        "lambda: 1",
        "[1, 2]",
        "{1: 2}",
        "(1, 2)",
        "(x := 1)",
        "f&apos;{pi}&apos;",
        "max(*(1, 2))",
        "round(number=1)",
        "1 if pi else",
        "1j",
        "...",
    ],
)
def test_what_is_no_arithmetic_is_refused(tmp_path, monkeypatch, expression):
    """Calls, attributes, lists and all else that is not known has no value, and nothing is run."""
    monkeypatch.chdir(tmp_path)
    message = refusal(in_expression(tmp_path, expression))
    assert "if you trust the file, expand it by ROS: `xacro arm.xacro > robot.urdf`" in message
    assert [file.name for file in tmp_path.iterdir()] == ["arm.xacro"]


@pytest.mark.parametrize(
    "word", ["env PATH", "optenv PATH no", "eval open('/etc/passwd')", "cwd", "anon a", "arg x"]
)
def test_the_surroundings_are_not_read(tmp_path, word):
    """Neither the environment nor anything else outside of the files has a name."""
    path = tmp_path / "arm.xacro"
    path.write_text(f'<robot name="a" {NAMESPACE}><link name="$({word})"/></robot>')
    message = refusal(path)
    assert os.environ["PATH"] not in message
    assert "is not understood" in message


@pytest.mark.unix
def test_files_elsewhere_are_not_read(tmp_path):
    """Neither by a path, nor through a link, nor as a package of another name, nor from a pipe."""
    (tmp_path / "secret.xacro").write_text('<robot><link name="secret"/></robot>')
    folder = tmp_path / "downloads"
    folder.mkdir()
    (folder / "linked.xacro").symlink_to(tmp_path / "secret.xacro")
    os.mkfifo(folder / "pipe.xacro")
    path = folder / "arm.xacro"
    elsewhere = ("../secret.xacro", str(tmp_path / "secret.xacro"), "linked.xacro", "/etc/passwd")
    for name in (*elsewhere, "$(find downloads)/arm.xacro", "pipe.xacro", "."):
        path.write_text(f'<robot {NAMESPACE}><xacro:include filename="{name}"/></robot>')
        assert "arm.xacro: line 1: " in refusal(path)
        if name in elsewhere:
            assert "is not below the folder" in refusal(path)


DOUBLED = "".join(
    f'<xacro:property name="a{i + 1}" value="${{a{i}}}${{a{i}}}"/>' for i in range(40)
)
TWICE = "".join(
    f'<xacro:macro name="m{i + 1}"><xacro:m{i}/><xacro:m{i}/></xacro:macro>' for i in range(30)
)


@pytest.mark.parametrize(
    "content",
    [
        '<link name="${9**9**9}"/>',
        '<link name="${round(1, -10**9)}"/>',
        '<link name="${9**9**9**9}"/>',
        '<link name="${(10**15 * 10**15)**99}"/>',
        """<link name="${'a' * 10**9}"/>""",
        '<link name="${1e308 * 10}"/>',
        '<link name="${%s1}"/>' % ("-" * 290),
        '<link name="${' + "(" * 140 + "1" + ")" * 140 + '}"/>',
        '<link name="%s"/>' % ("${" * 5000),
        '<link name="%s"/>' % ("$" * 100_000),
        '<xacro:property name="a" value="${a}"/><link name="${a}"/>',
        '<xacro:property name="a" value="${b}"/><xacro:property name="b" value="${a}"/>'
        '<link name="${a}"/>',
        f'<xacro:property name="a0" value="ha"/>{DOUBLED}<link name="${{a40}}"/>',
        '<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>',
        f'<xacro:macro name="m0"><link name="a"/></xacro:macro>{TWICE}<xacro:m30/>',
        '<xacro:include filename="arm.xacro"/>',
        '<xacro:macro name="m" params="%s"/>' % ("a:='" * 400),
    ],
)
def test_nothing_is_endless(tmp_path, content):
    """Powers of powers, circles and doublings are refused in a second, as are files in circles."""
    path = tmp_path / "arm.xacro"
    path.write_text(f'<robot name="a" {NAMESPACE}>{content}</robot>')
    since = time.process_time()
    with pytest.raises(RobotFileError):
        load_robot(path)
    assert time.process_time() - since < 3


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("2 ** 3 ** 2 - 7 // 2", "509"),
        ("-2 ** 2", "-4"),
        ("1 / 4 + 7 % 4", "3.25"),
        ("math.radians(180) == pi and not False", "True"),
        ("radians(90) if 2 &lt; 1 else max(1, 2, 0.5)", "2"),
        ("0 or 3", "3"),
        ("0 and 1 / 0", "0"),
        ("&apos;left&apos; + &apos;_&apos; + str(7)", "left_7"),
        ("round(2.567, 1)", "2.6"),
        ("round(1250, -2) + round(7.5)", "1208"),
        ("round(10**15, -10**15)", "0"),
        ("atan2(0, -1) * 2", "6.283185307179586"),
    ],
)
def test_values_are_those_of_python(tmp_path, expression, value):
    """Precedence, whole numbers and digits are those that the package of ROS gives."""
    root = expand_xacro(in_expression(tmp_path, expression), "arm")
    assert root.children[0].attributes["name"] == value


def test_properties_blocks_and_defaults(tmp_path):
    """A property has its value where it is first used; blocks come whole or as their content."""
    path = tmp_path / "arm.xacro"
    path.write_text(f"""<robot name="a" {NAMESPACE}>
      <xacro:property name="twice" value="${{2 * once}}"/>
      <xacro:property name="once" value="0.25"/>
      <xacro:property name="heavy"><mass value="$${{no}}"/></xacro:property>
      <xacro:macro name="part" params="name:='a b' size:=${{twice}} *first **rest">
        <link name="${{name}}"><xacro:insert_block name="first"/>
        <xacro:insert_block name="rest"/></link>
        <xacro:unless value="${{size == 0.5}}"><link name="never"/></xacro:unless>
        <visual><geometry name="${{unknown}}"/></visual>
      </xacro:macro>
      <xacro:part><origin xyz="${{once}} 0 0"/><any><mass value="${{twice}}"/></any></xacro:part>
      <link name="b"><xacro:insert_block name="heavy"/></link>
    </robot>""")
    first, seen, second = expand_xacro(path, "arm").children
    assert first.attributes == {"name": "a b"}
    assert [child.attributes for child in first.children] == [{"xyz": "0.25 0 0"}, {"value": "0.5"}]
    assert (seen.tag, seen.children) == ("visual", [])
    assert second.children[0].attributes == {"value": "${no}"}


def test_a_package_beside_the_own_one_is_found(tmp_path):
    """Robots of one maker share files in a package beside theirs."""
    path = package(tmp_path, "$(find maker_resources)/macros.xacro")
    shared = tmp_path / "maker_resources"
    shared.mkdir()
    (shared / "macros.xacro").write_text(MACROS)
    assert "no package 'maker_resources'" in refusal(path)
    (shared / "package.xml").write_text("<package/>")
    assert load_robot(path).joint_names == ("to_upper", "to_fore")


def test_a_file_that_is_not_there(tmp_path):
    """It is one line, too."""
    with pytest.raises(RobotFileError, match="no such file"):
        load_robot("arm.urdf.xacro", tmp_path)
