"""`edtk new`: a study to begin with, for any robot."""

import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from urdf_text import written

import edtk
from edtk.cli import main

URDF = Path(__file__).parents[1] / "data" / "kr150_2.urdf"


def run(*words: object) -> tuple[int, str, str]:
    """Exit code and output of the program."""
    result = CliRunner().invoke(main, [*map(str, words)])
    return result.exit_code, result.stdout, result.stderr


def test_a_robots_file_is_named_beside_the_study(tmp_path: Path, monkeypatch) -> None:
    """The path of the robot is relative to the study, wherever the command is called."""
    (tmp_path / "robots").mkdir()
    (tmp_path / "work").mkdir()
    shutil.copy(URDF, tmp_path / "robots" / "arm.urdf")
    monkeypatch.chdir(tmp_path)
    code, shown, _ = run("new", "--robot", "robots/arm.urdf", "--out", "work/study.toml")
    assert code == 0
    text = Path("work/study.toml").read_text()
    assert tomllib.loads(text)["robot"] == "../robots/arm.urdf"
    lines = text.splitlines()
    marked = shown.rpartition("decide lines ")[2].split(", ")
    assert len(marked) == 7
    assert all("DECIDE:" in lines[int(number) - 1] for number in marked)
    assert edtk.load_study("work/study.toml").robot.n == 6


def test_links_of_a_urdf_go_into_the_study(tmp_path: Path) -> None:
    """Of several leaves one is named; the study names it too."""
    arm = written(tmp_path)
    code, _, error = run("new", "--robot", arm, "--out", tmp_path / "study.toml")
    assert code == 2
    assert "tip_link" in error
    assert " (--tip NAME)" in error
    assert not (tmp_path / "study.toml").exists()
    study = edtk.new(arm, tmp_path / "study.toml", tip="flange", base="base")
    assert study.specification.tip_link == "flange"
    assert study.specification.base_link == "base"


def test_a_gripper_is_no_part_of_the_arm(tmp_path: Path) -> None:
    """Its joints, and its fingers' many leaves, are left out; the study says which, unless told."""
    text = URDF.read_text().replace(
        "</robot>",
        """<link name="palm"/><link name="left"/><link name="right"/>
        <joint name="mount" type="fixed"><parent link="tool0"/><child link="palm"/></joint>
        <joint name="finger_1" type="prismatic"><parent link="palm"/><child link="left"/>
          <axis xyz="1 0 0"/><limit lower="0" upper="0.04" effort="9" velocity="1"/></joint>
        <joint name="finger_2" type="prismatic"><parent link="palm"/><child link="right"/>
          <axis xyz="-1 0 0"/><limit lower="0" upper="0.04" effort="9" velocity="1"/></joint>
        </robot>""",
    )
    arm = tmp_path / "arm.urdf"
    arm.write_text(text)
    study = edtk.new(arm, tmp_path / "study.toml")
    assert study.robot.n == 6
    assert study.specification.tip_link == "palm"
    assert "# Left out as the end effector's: finger_1, finger_2." in Path(
        tmp_path / "study.toml"
    ).read_text().split("\n")
    told = edtk.new(arm, tmp_path / "told.toml", tip="left")
    assert told.robot.n == 7


def test_the_payload_is_the_load(tmp_path: Path) -> None:
    """What is said is not exceeded; a mass that is none is one line."""
    out = tmp_path / "study.toml"
    code, _, _ = run("new", "--robot", URDF, "--payload", 150, "--out", out)
    assert code == 0
    force = edtk.load_study(out).specification.load.F_N
    assert force[2] == -1470
    assert "DECIDE: here 150 kg, as you say" in out.read_text()
    code, shown, error = run("new", "--robot", URDF, "--payload", 0, "--out", tmp_path / "b.toml")
    assert (code, shown, error.count("\n")) == (2, "", 1)
    with pytest.raises(edtk.UserError, match=r"payload 1000000\.0: expected a mass from"):
        edtk.new(URDF, tmp_path / "b.toml", payload=1e6)


def test_a_builtin_robot_by_name(tmp_path: Path) -> None:
    """Its name stands in the study."""
    study = edtk.new("kuka_kr270", tmp_path / "study.toml")
    assert study.specification.robot == "kuka_kr270"


@pytest.mark.parametrize("force", [False, True])
def test_what_exists_is_kept(tmp_path: Path, force: bool) -> None:
    """A file is replaced only if that is asked for."""
    path = tmp_path / "study.toml"
    path.write_text("mine")
    words = ["--force"] if force else []
    code, shown, error = run("new", "--robot", "kuka_kr270", "--out", path, *words)
    assert code == (0 if force else 2)
    assert (path.read_text() == "mine") == (not force)
    if not force:
        assert shown == ""
        assert "exists; expected a new file, or --force to replace it" in error


def test_the_robots_file_is_never_overwritten(tmp_path: Path) -> None:
    """Not even with --force."""
    arm = written(tmp_path)
    code, _, error = run("new", "--robot", arm, "--tip", "flange", "--out", arm, "--force")
    assert code == 2
    assert "is read by this command" in error
    assert "<robot" in arm.read_text()


def test_an_unknown_robot_is_one_line(tmp_path: Path) -> None:
    """The message lists what there is, and nothing is written."""
    code, shown, error = run("new", "--robot", "kuka", "--out", tmp_path / "study.toml")
    assert (code, shown) == (2, "")
    assert "kuka_kr270" in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_limits_that_a_file_leaves_open_are_given(tmp_path: Path) -> None:
    """Without them one line names the option; with them they stand in the study."""
    limit = '<limit lower="-1" upper="2" effort="1" velocity="1"/>'
    arm = written(tmp_path, (limit, ""), ('<limit lower="0.1" upper="0.4"/>', ""))
    words = ("new", "--robot", arm, "--tip", "flange", "--out", tmp_path / "study.toml")
    code, _, error = run(*words)
    assert code == 2
    assert "no range for bend, slide; expected --limit NAME LOWER UPPER" in error
    code, _, _ = run(*words, "--limit", "bend", -60, 90, "--limit", "slide", 100, 400)
    assert code == 0
    study = edtk.load_study(tmp_path / "study.toml")
    assert study.specification.joints.limits_deg == {"bend": (-60, 90)}
    assert study.specification.joints.limits_mm == {"slide": (100, 400)}
    bend = study.robot.joint_names.index("bend")
    assert np.rad2deg(study.robot.joints[bend].limits) == pytest.approx([-60, 90])


def test_a_study_in_the_controllers_angles(tmp_path: Path) -> None:
    """A table that is given stands in the study, whose poses are the same in its angles."""
    table = tmp_path / "controller.toml"
    table.write_text("[controller]\nsign = { q2 = -1 }\nzero_deg = { q2 = -90 }\n")
    plain = edtk.new("kuka_kr270", tmp_path / "plain.toml")
    study = edtk.new("kuka_kr270", tmp_path / "study.toml", controller=table)
    assert study.robot.controller is not None
    assert study.task is not None
    assert plain.task is not None
    own = np.array(plain.specification.test_pose.q_deg)
    shown = np.array(study.specification.test_pose.q_deg)
    assert shown == pytest.approx(np.where(np.arange(6) == 1, -90 - own, own))
    table.write_text("[controller]\nsign = { q9 = -1 }\n")
    words = ("new", "--robot", "kuka_kr270", "--out", tmp_path / "other.toml")
    code, _, error = run(*words, "--controller", table)
    assert code == 2
    assert "controller.sign: no joint 'q9'" in error
    table.write_text("sign = { q2 = -1 }\n")
    code, _, error = run(*words, "--controller", table)
    assert code == 2
    assert "has no table [controller]" in error
    assert not (tmp_path / "other.toml").exists()


@pytest.mark.unix
def test_names_of_files_with_odd_characters(tmp_path: Path) -> None:
    """A study's own name stands in a comment as a shell reads it; a robot's must be plain."""
    out = tmp_path / "a bell\x07.toml"
    assert run("new", "--robot", "kuka_kr270", "--out", out)[0] == 0
    assert "#   edtk run 'a bell?.toml'" in out.read_text()
    odd = tmp_path / "arm\udcff.urdf"
    shutil.copy(URDF, odd)
    code, shown, error = run("new", "--robot", odd, "--out", tmp_path / "study.toml")
    assert code == 2
    assert not shown
    assert "characters that a study cannot hold" in error
    assert not (tmp_path / "study.toml").exists()


def test_a_plan_that_counts_friction_is_two_marks_away(tmp_path: Path) -> None:
    """The commented lines on the model's error, read as they are, make a study that counts it."""
    out = tmp_path / "study.toml"
    assert run("new", "--robot", "kuka_kr270", "--out", out)[0] == 0
    plain = out.read_text()
    said = plain.replace("# [noise]", "[noise]").replace("# model_error", "model_error")
    assert said != plain
    out.write_text(said)
    assert edtk.load_study(out).specification.noise.model_error_percent == 10
