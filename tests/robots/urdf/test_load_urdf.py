"""Robots from URDF files: the chain that they describe, and one line for what is wrong."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from urdf_text import ARM, written

from edtk.robots.load_robot import load_robot
from edtk.robots.robot_file import RobotFileError, robot_from_dict, robot_to_dict
from edtk.robots.rotations import transform

DATA = Path(__file__).parents[2] / "data"


def arm(folder, *changes, **keys):
    """The robot of the file."""
    return load_robot(str(written(folder, *changes)), **({"tip": "flange"} | keys))


def refusal(folder, *changes, **keys):
    """The message of the error, asserted to be one line that names the file."""
    with pytest.raises(RobotFileError) as caught:
        arm(folder, *changes, **keys)
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    assert "arm.urdf" in message
    return message


def turned(axis, angle):
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(angle * np.array(axis)).as_matrix()
    return T


def test_the_chain_is_the_product_of_its_transforms(tmp_path):
    """Fixed joints are merged, axes default to x and are normalised, frames are turned by rpy."""
    robot = arm(tmp_path)
    assert robot.name == "arm"
    assert robot.joint_names == ("turn", "bend", "slide")
    assert [joint.kind for joint in robot.joints] == ["revolute", "revolute", "prismatic"]
    assert robot.continuous.tolist() == [True, False, False]
    np.testing.assert_array_equal(robot.limits, [[-np.pi, -1, 0.1], [np.pi, 2, 0.4]])
    expected = (
        transform([0, 0, 0.5], [0, 0, np.pi / 2])
        @ transform([0, 0, 0.2])
        @ turned([0, 0, 1], 0.7)
        @ transform([1, 0, 0], [0.1, -0.2, 0.3])
        @ turned([1, 0, 0], -0.4)
        @ transform([0, 0.1, -0.25])
        @ transform([0, 0, 0.3], [0, 0.5, 0])
    )
    np.testing.assert_allclose(robot.forward([0.7, -0.4, 0.25]), expected, atol=1e-15)


def test_base_and_tip_choose_the_chain(tmp_path):
    """The base link is the world, and tools are given in the tip's frame."""
    robot = arm(tmp_path, base="arm", tip="camera")
    assert robot.joint_names == ("bend", "slide")
    whole = arm(tmp_path, tip="camera").forward([0, 0.3, 0.2])
    stand = transform([0, 0, 0.7], [0, 0, np.pi / 2])
    np.testing.assert_allclose(stand @ robot.forward([0.3, 0.2]), whole, atol=1e-15)
    tool = transform([0.1, 0.2, 0.3], [0.3, 0.2, 0.1])
    np.testing.assert_allclose(
        robot.with_tool(tool).forward([0.3, 0.2]), robot.forward([0.3, 0.2]) @ tool, atol=1e-15
    )


def test_masses_are_lumped_into_the_bodies_that_move(tmp_path):
    """Fixed links and branches count where they are; what the base carries does not move."""
    links = arm(tmp_path).links
    assert [link.mass for link in links] == [20, 0, 4]
    np.testing.assert_allclose(links[0].center, [0.5, 0, 0])
    # hand, camera, finger at its lower limit along x, and flange
    parts = [2 * np.array([0, 0, 0.1]), [0, 0.1, 0], 0.5 * np.array([0.02, 0, 0]), [0, 0, 0.15]]
    np.testing.assert_allclose(links[2].center, np.sum(parts, axis=0) / 4)
    np.testing.assert_allclose(arm(tmp_path, base="arm").links[1].center, links[2].center)


def test_without_inertia_the_bodies_are_unknown(tmp_path):
    """A file without masses of moving links gives none, which is not the same as zero."""
    assert load_robot(str(DATA / "kr150_2.urdf")).links == ()


def test_the_kr150_is_that_of_its_toml():
    """URDF and TOML of the same robot have the same kinematics bit by bit, and the same limits."""
    urdf = load_robot(str(DATA / "kr150_2.urdf"))
    toml = load_robot(str(DATA / "kr150_2.toml"))
    assert urdf.joint_names == toml.joint_names
    np.testing.assert_allclose(urdf.limits, toml.limits, rtol=1e-15)
    q = np.random.default_rng(0).uniform(*urdf.limits, size=(100, 6))
    np.testing.assert_array_equal(urdf.forward(q), toml.forward(q))
    np.testing.assert_array_equal(urdf.jacobian(q), toml.jacobian(q))
    tool = transform([0.1, 0, 0.2])
    np.testing.assert_array_equal(urdf.with_tool(tool).forward(q), toml.with_tool(tool).forward(q))


def test_it_is_written_as_a_table_and_read_again(tmp_path):
    """All that a URDF gives is plain data: continuous joints, masses and the flange."""
    robot = arm(tmp_path)
    again = robot_from_dict(robot_to_dict(robot))
    assert again.continuous.tolist() == robot.continuous.tolist()
    assert robot_to_dict(again) == robot_to_dict(robot)
    np.testing.assert_array_equal(again.forward([1, 0.5, 0.3]), robot.forward([1, 0.5, 0.3]))


def test_given_limits_take_the_place_of_the_files(tmp_path):
    """Also where the file has none; a continuous joint that is limited is an ordinary one."""
    change = ('<limit lower="-1" upper="2" effort="1" velocity="1"/>', "")
    robot = arm(tmp_path, change, limits={"bend": (-0.5, 0.5), "turn": (0.0, 9.0)})
    np.testing.assert_array_equal(robot.limits, [[0, -0.5, 0.1], [9, 0.5, 0.4]])
    assert not robot.continuous.any()
    with pytest.raises(RobotFileError, match="no joint 'twist'; it has turn, bend, slide"):
        arm(tmp_path, limits={"twist": (0.0, 1.0)})


LIMIT = 'lower="-1" upper="2"'
OPEN = "the file has no range for bend; expected limits from the study, as [joints] limits_deg ="
WRONG = {
    "no limit": (f"<limit {LIMIT} effort", "<unlimited effort", OPEN),
    "one side": (LIMIT, 'upper="2"', OPEN),
    "equal": (LIMIT, 'lower="1" upper="1"', OPEN),
    "boundless": (LIMIT, 'lower="-inf" upper="1e16"', OPEN),
    "swapped": (
        LIMIT,
        'lower="2" upper="-1"',
        "joint bend: the lower limit 2 lies above the upper",
    ),
    "limit": (LIMIT, 'lower="a" upper="2"', "joint bend: limit: lower: is 'a'; expected a number"),
    "axis": ('xyz="0 0 2"', 'xyz="0 0 0"', "joint turn: the axis is 0 0 0; expected a vector"),
    "short": ('xyz="0 0 2"', 'xyz="0 0"', "joint turn: axis: xyz is '0 0'; expected three numbers"),
    "words": ('xyz="0 0 0.2"', 'xyz="0 0 1_0"', "joint turn: origin: xyz is '0 0 1_0'"),
    "nan": ('rpy="0 0.5 0"', 'rpy="0 nan 0"', "joint plate: origin: rpy is '0 nan 0'"),
    "kind": ('type="continuous"', 'type="screw"', "joint turn: the type is 'screw'; expected one"),
    "floating": (
        'type="continuous"',
        'type="floating"',
        "joint turn: is floating; expected fixed,",
    ),
    "planar": ('type="prismatic"', 'type="planar"', "joint slide: is planar; expected fixed,"),
    "no type": (' type="continuous"', "", "joint turn: has no type"),
    "no name": ('<joint name="turn"', "<joint", "<joint> in line 19: has no name"),
    "no parent": ('<parent link="arm"/>', "", "joint bend: has no <parent>"),
    "no child": ('<child link="elbow"/>', "<child/>", "joint bend: child: has no link"),
    "absent": ('<child link="elbow"/>', '<child link="e"/>', "joint bend: there is no link 'e'"),
    "twice": (
        '<child link="mark"/>',
        '<child link="arm"/>',
        "link arm: is moved by joint 'note' and",
    ),
    "same name": ('name="bend"', 'name="turn"', "joint turn: stands in line 19 and in line 22"),
    "same link": ('<link name="mark"/>', '<link name="arm"/>', "link arm: stands in line 5 and in"),
    "no mass": ('<mass value="20"/>', "", "link arm: its <inertial> has no <mass>"),
    "mass": ('value="20"', 'value="-1"', "link arm: the mass is -1 kg; expected a number from 0"),
    "hash": ('name="bend"', 'name="be#nd"', "joint name 'be#nd': expected 1 to 64 letters"),
    "xacro": (
        "<transmission",
        "<xacro:if/><transmission",
        "is a xacro file; expected a name that ends in .xacro",
    ),
    "root": ("<robot", "<sdf", "not valid XML: mismatched tag"),
    "sdf": (ARM, "<sdf/>", "the root element is <sdf>; expected <robot>"),
    "empty": (ARM, "<robot/>", "has no link 'flange'; its links are"),
    "ring": ('<parent link="world"/>', '<parent link="elbow"/>', "link elbow: is in a ring"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_file_is_one_line_that_says_where(tmp_path, case):
    """Each kind of error gives one line with the file, the joint or link, and what was expected."""
    old, new, expected = WRONG[case]
    assert expected in refusal(tmp_path, (old, new))


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"tip": None}, "tip_link: has 3 leaves below 'world'; expected one of camera, finger, fl"),
        ({"tip": "arm", "base": "hand"}, "tip_link: has 'arm', but not below the base 'hand'; its"),
        ({"tip": "gripper"}, "tip_link: has no link 'gripper'; its links are world, base,"),
        ({"base": "floor"}, "base_link: has no link 'floor'; its links are world, base,"),
        ({"tip": "mark"}, "link mark: 0 joints move it; expected 1 to 100"),
        ({"tip": "arm", "base": "arm"}, "link arm: 0 joints move it; expected 1 to 100"),
        ({"tip": None, "base": "flange"}, "no joint moves a link below 'flange'"),
    ],
)
def test_wrong_links_are_one_line_that_lists_what_there_is(tmp_path, keys, expected):
    """Several leaves, links that are not there, and a tip that is not below the base."""
    assert expected in refusal(tmp_path, **keys)


def test_two_roots_are_one_line_unless_the_tip_says_which(tmp_path):
    """The root is that above the tip; without a tip it has to be named."""
    second = '<link name="a"/><link name="b"/><joint name="c" type="continuous">'
    second += '<parent link="a"/><child link="b"/></joint>'
    change = ("</robot>", f"{second}</robot>")
    assert arm(tmp_path, change, tip="b").joint_names == ("c",)
    assert "base_link: has 2 roots; expected one of world, a" in refusal(tmp_path, change, tip=None)


CHILD = {"turn": "arm", "bend": "elbow", "slide": "hand", "grip": "finger"}


def tied(joint, master, factor=1.0, offset=0.0):
    """The change of the file that lets a joint follow another one."""
    child = f'<child link="{CHILD[joint]}"/>'
    tie = f'<mimic joint="{master}" multiplier="{factor}" offset="{offset}"/>'
    return child, child + tie


def test_a_joint_that_follows_another_one_has_no_variable(tmp_path):
    """Poses are those of the free chain with the tie put in, and limits are those of both."""
    free = arm(tmp_path)
    robot = arm(tmp_path, tied("slide", "bend", 0.1, 0.2))
    assert robot.joint_names == ("turn", "bend")
    assert robot.body_names == ("turn", "bend", "slide")
    # slide from 0.1 to 0.4 is bend from -1 to 2
    np.testing.assert_allclose(robot.limits[:, 1], [-1, 2])
    np.testing.assert_allclose(
        robot.forward([0.3, 0.5]), free.forward([0.3, 0.5, 0.25]), atol=1e-15
    )
    J = free.jacobian([0.3, 0.5, 0.25])
    folded = np.column_stack([J[:, 0], J[:, 1] + 0.1 * J[:, 2]])
    np.testing.assert_allclose(robot.jacobian([0.3, 0.5]), folded, atol=1e-15)
    assert [link.mass for link in robot.links] == [20, 0, 4]
    narrow = arm(tmp_path, tied("slide", "bend", -0.2, 0.2))
    np.testing.assert_allclose(narrow.limits[:, 1], [-1, 0.5])


def test_a_chain_of_ties_ends_at_a_free_joint(tmp_path):
    """A joint may follow one that follows; the master may lie behind, or outside the chain."""
    changes = (tied("bend", "grip", 2.0, 0.1), tied("slide", "bend", 0.1, 0.2))
    robot = arm(tmp_path, *changes)
    assert robot.joint_names == ("turn", "bend")
    np.testing.assert_allclose(robot.ties.matrix, [[1, 0], [0, 1], [0, 0.1]])
    np.testing.assert_allclose(robot.ties.offset, [0, 0, 0.2])
    # grip from 0.02 to 0.05 is bend from 0.14 to 0.2
    np.testing.assert_allclose(robot.limits[:, 1], [0.14, 0.2])
    finger = arm(tmp_path, *changes, tip="finger")
    assert finger.joint_names == ("turn", "grip")
    np.testing.assert_allclose(finger.ties.matrix, [[1, 0], [0, 2], [0, 0.2], [0, 1]])
    np.testing.assert_allclose(finger.ties.offset, [0, 0.1, 0.21, 0])


def test_a_joint_that_follows_what_does_not_move_is_fixed(tmp_path):
    """With the factor zero, or a fixed master, it stays at the offset."""
    expected = arm(tmp_path).forward([0.3, 0.5, 0.25])
    for change in (tied("slide", "bend", 0, 0.25), tied("slide", "note", 3, 0.25)):
        robot = arm(tmp_path, change)
        assert robot.joint_names == ("turn", "bend")
        assert robot.tied == ()
        np.testing.assert_allclose(robot.forward([0.3, 0.5]), expected, atol=1e-15)
        assert robot.links[1].mass == 4


def test_a_joint_with_followers_turns_on_if_all_of_them_do(tmp_path):
    """After one turn the arm has to be where it was; else its limits are asked for."""
    change = ('name="bend" type="revolute"', 'name="bend" type="continuous"')
    assert arm(tmp_path, change, tied("bend", "turn", -2)).continuous.tolist() == [True, False]
    message = refusal(tmp_path, change, tied("bend", "turn", 0.5))
    assert "the file has no range for turn" in message
    robot = arm(tmp_path, tied("bend", "turn", 0.5))
    np.testing.assert_allclose(robot.limits[:, 0], [-2, 4])


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ([tied("bend", "twist")], "joint bend: follows 'twist' (mimic), which is no joint"),
        ([tied("bend", "bend")], "joint bend: follows 'bend' (mimic), which follows it; expected"),
        (
            [tied("bend", "slide"), tied("slide", "bend")],
            "joint slide: follows 'bend' (mimic), which",
        ),
        (
            [tied("bend", "turn", 1e-9)],
            "joint bend: moves by 1e-09 for one unit of 'turn', which it",
        ),
        ([tied("bend", "turn", "a")], "joint bend: mimic: multiplier is 'a'; expected a number"),
        (
            [tied("slide", "bend", 0.1, 5)],
            "limits: the limits of bend and of slide, which moves with",
        ),
    ],
)
def test_wrong_ties_are_one_line(tmp_path, changes, expected):
    """A tie to a joint that is not there, in a circle, absurd, or without a common range."""
    assert expected in refusal(tmp_path, *changes)


@pytest.mark.parametrize(
    ("links", "expected"),
    [
        ("", "has no <link>; expected a tree of links"),
        ('<link name="a"/>', "no joint moves a link below 'a'; expected a revolute or"),
        ('<link name="a"/><link name="b"/>{ab}{ba}', "every link is moved by a joint; expected a"),
    ],
)
def test_a_file_without_a_chain_is_one_line(tmp_path, links, expected):
    """No links, one link, and a ring of links."""
    joint = '<joint name="{0}{1}" type="continuous"><parent link="{0}"/><child link="{1}"/></joint>'
    text = links.format(ab=joint.format("a", "b"), ba=joint.format("b", "a"))
    (tmp_path / "arm.urdf").write_text(f"<robot>{text}</robot>")
    with pytest.raises(RobotFileError, match=expected):
        load_robot(tmp_path / "arm.urdf")


def test_links_go_with_a_urdf(tmp_path):
    """A robot that has no links is asked for none."""
    with pytest.raises(RobotFileError, match="tip_link: has no links; 'x' goes with a URDF file"):
        load_robot("kuka_kr270", tip="x")
    with pytest.raises(RobotFileError, match="no such file"):
        load_robot("arm.urdf", tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("text", [ARM, ARM.replace(*tied("slide", "bend", 0.1, 0.2))])
def test_a_changed_file_is_an_answer_or_one_line(tmp_path, text):
    """Whatever bytes, numbers, names or elements are changed: a robot, or one line."""
    rng = np.random.default_rng(0)
    path = tmp_path / "arm.urdf"
    answers = 0
    for _ in range(150):
        path.write_bytes(mutated(text.encode(), rng))
        message = ""
        try:
            robot = load_robot(path, tip="flange")
            assert np.isfinite(robot.jacobian(robot.limits[0])).all()
            assert robot_to_dict(robot_from_dict(robot_to_dict(robot))) == robot_to_dict(robot)
            answers += 1
        except RobotFileError as error:
            message = str(error)
        assert len(message.splitlines()) <= 1
        assert len(message) <= 290
    assert 10 < answers < 140


NASTY = (
    b"0", b"-1", b"1e-300", b"1e300", b"-0.0", b"nan", b"inf", b"1 2", b"0 0 0", b"1e5 -1e5 0", b"",
    b"a", b"\xff", b"&#10;", b"&lt;", b"continuous", b"fixed", b"prismatic", b"bend", b"hand",
)  # fmt: skip


def mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """The bytes with one to three changes: of values between quotes, of lines, and of bytes."""
    for _ in range(rng.integers(1, 4)):
        kind = rng.integers(10)
        words = content.split(b'"')
        lines = content.split(b"\n")
        place = 2 * int(rng.integers(len(words) // 2)) + 1
        line = int(rng.integers(len(lines)))
        if kind < 3:
            words[place] = NASTY[rng.integers(len(NASTY))]
            content = b'"'.join(words)
        elif kind < 6:
            words[place] = words[2 * int(rng.integers(len(words) // 2)) + 1]
            content = b'"'.join(words)
        elif kind < 7:
            content = b"\n".join(lines[:line] + lines[line + 1 :])
        elif kind < 8:
            moved = lines.pop(line)
            lines.insert(int(rng.integers(len(lines) + 1)), moved)
            content = b"\n".join(lines)
        elif kind < 9:
            content = b"\n".join([*lines[: line + 1], *lines[line:]])
        else:
            at = int(rng.integers(len(content)))
            content = content[:at] + rng.bytes(1) + content[at + 1 :]
    return content
