"""A study in Python: the same keys, messages and numbers as in a file, and back again."""

import copy
import inspect
import os
import pickle
import subprocess
import sys
import tomllib
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest
from kr270 import REQUIRED, TEST_POSE

from edtk.design.plan import Plan
from edtk.robots.joint import Joint
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform
from edtk.study.schema import Specification
from edtk.study.study import Study, load_study
from edtk.study.study_toml import toml_text
from edtk.system.errors import UserError

STUDIES = Path(__file__).parents[2] / "studies"
PAPER = load_study(STUDIES / "kr270_milling.toml")
GANTRY = """
name = "gantry"
source = "made up for this test"
[[joints]]
name = "slide"
kind = "prismatic"
origin_m = [0, 0, 1.0]
axis = [0, 1, 0]
limits_m = [-1.0, 1.0]
[[joints]]
name = "arm"
origin_m = [0.2, 0, 0]
axis = [0, 0, 1]
limits_deg = [-150, 150]
"""
POSES = "q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n-103.4,100.0,-147.9,105.8,93.2\n"


def written(keys: dict, path: Path) -> Path:
    """A study file with these keys."""
    path.write_text(toml_text(keys))
    return path


def assert_same_numbers(one: Study, other: Study) -> None:
    """Two studies compute with the same keys, poses, loads and targets, bit by bit."""
    assert one.specification == other.specification
    x = one.space.draw(np.random.default_rng(0).random((20, len(one.space.drawn))))
    ours = one.space.at(x)
    theirs = other.space.at(x)
    np.testing.assert_array_equal(ours.packed, theirs.packed)
    np.testing.assert_array_equal(ours.slack, theirs.slack)
    np.testing.assert_array_equal(one.space.limits, other.space.limits)
    assert (one.target is None) == (other.target is None)
    if one.target is not None:
        np.testing.assert_array_equal(one.target, other.target)


def test_only_what_is_needed_is_required():
    """Five keys are enough; title, criteria and sizes have defaults that fit them."""
    study = Study(**REQUIRED)
    assert study.specification.title == "Calibration of KUKA KR 270"
    assert study.specification.optimise == study.specification.criteria == ("D",)
    assert study.specification.sizes == (4,)
    assert study.path is None
    assert study.folder == Path()


def test_defaults_with_a_test_pose():
    """With a test pose the study is about the accuracy in it; given criteria are kept."""
    study = Study(**REQUIRED, test_pose=TEST_POSE)
    assert study.specification.optimise == study.specification.criteria == ("rho0",)
    assert study.replace(criteria=["A"]).specification.optimise == ("rho0",)
    assert study.replace(optimise=["A"]).specification.criteria == ("A",)


def test_a_file_may_leave_out_the_same_keys(tmp_path):
    """A file with the five required keys is the same study as the one in Python."""
    read = load_study(written(REQUIRED, tmp_path / "study.toml"))
    assert_same_numbers(read, Study(**REQUIRED))


def test_keys_of_a_file_in_python():
    """The paper's study in Python has the numbers of its file, and so have arrays and paths."""
    keys = tomllib.loads(PAPER.path.read_text(encoding="utf-8"))
    assert_same_numbers(Study(**keys, folder=STUDIES), PAPER)
    keys["tool"] = {"position_mm": np.array([611.5, 0, -460])}
    keys["sizes"] = np.array(keys["sizes"])
    keys["published"] = [STUDIES / name for name in keys["published"]]
    keys["workspace"]["tilt_max_deg"] = np.float64(30)
    study = Study(**keys)
    assert study.published_plans().keys() == PAPER.published_plans().keys()
    assert_same_numbers(study.replace(published=PAPER.specification.published), PAPER)


WRONG = [
    {"sead": 3},
    {"robot": "kuka_kr271"},
    {"robot": 5},
    {"robot": None},
    {"load": None},
    {"criteria": ["D", "O6"]},
    {"optimise": ["O6"]},
    {"optimise": ["rho0"]},
    {"optimise": []},
    {"sampling": "grid"},
    {"sizes": [3, 2, 3]},
    {"sizes": [0]},
    {"measurement": {"sigma_mm": -0.03}},
    {"measurement": {"sigma_mm": float("nan")}},
    {"seed": True},
    {"seed": "7"},
    {"candidates": True},
    {"starts": True},
    {"sizes": [True]},
    {"costs": {"visit": 1.0, "load_changes": True}},
    {"measurement": {"sigma_mm": True}},
    {"measurement": {"sigma_mm": "0.03"}},
    {"test_pose": {**TEST_POSE, "q_deg": [True, 2, 3, 4, 5, 6]}},
    {"measurement": {"sigma_mm": 0.03, "rows": "pose"}},
    {"measurement": {}},
    {"joints": {"unknown": ["q9"]}},
    {"joints": {"unknown": ["q2", "q2"]}},
    {"joints": {"unknown": ["q2"], "fixed_mm": {"q1": 0}}},
    {"joints": {"unknown": ["q2"], "fixed_deg": {"q1": 999}}},
    {"test_pose": {**TEST_POSE, "q_deg": [1, 2]}},
    {"test_pose": {**TEST_POSE, "tool": {}}},
    {"workspace": {"excluded_within_deg": 0}},
    {"load": {"F_N": [0, 0, 1], "F_max_N": 2500}},
    {"load": {"F_max_N": 2500, "T_Nm": [1, 0, 0]}},
    {"load": {"list_F_N": [[0, 0]]}},
    {"prior": {"all": {"kind": "log-normal", "factor": 2}}},
    {"prior": {"nu": "odd"}},
]


@pytest.mark.parametrize("change", WRONG, ids=str)
def test_messages_are_those_of_a_file(tmp_path, monkeypatch, change):
    """A wrong key gives the line that a file gives, with "Study" in place of the file's name."""
    keys = {key: value for key, value in (REQUIRED | change).items() if value is not None}
    monkeypatch.chdir(tmp_path)  # of a long path a message is shortened
    path = written(keys, Path("study.toml"))
    with pytest.raises(UserError) as in_file:
        load_study(path)
    with pytest.raises(UserError) as in_python:
        Study(**(REQUIRED | change))
    with pytest.raises(UserError) as replaced:
        Study(**REQUIRED).replace(**change)
    assert str(in_file.value).startswith(f"{path}: ")
    assert str(in_python.value) == str(in_file.value).replace(str(path), "Study")
    assert str(replaced.value) == str(in_python.value)
    assert "\n" not in str(in_python.value)


def test_the_example_of_a_message():
    """A joint that the robot does not have is named with those that it has."""
    with pytest.raises(UserError) as caught:
        Study(**(REQUIRED | {"joints": {"unknown": ["q9"]}}))
    names = "q1, q2, q3, q4, q5, q6"
    assert str(caught.value) == f"Study: joints.unknown: no joint 'q9'; this robot has {names}"


LOADS = [
    {"F_N": [100, -200, -2500.5], "T_Nm": [1e-3, 0, 7]},
    {"F_max_N": 1800},
    {"F_max_N": 1800, "direction": [0, 1, -3]},
    {"list_F_N": [[0, 0, -2500], [1500, 0, 0], [0, 1500, 1 / 3]]},
]
PRIORS = [
    {"all": {"kind": "half-normal", "scale_rad_per_Nm": 1e-6}, "sigma_factor": float("inf")},
    {
        "joints": {
            "q2": {"kind": "log-normal", "median_rad_per_Nm": 3e-7, "factor": 1.7},
            "q3": {"kind": "flat"},
        },
        "nu": "sampled",
    },
    {
        "earlier": {
            "mean_rad_per_Nm": {"q2": 3e-7, "q3": 4e-7, "q4": 1e-6, "q5": 2e-6, "q6": 2e-6},
            "covariance": (1e-14 * (np.eye(5) + 1 / 3)).tolist(),
        },
        "nu": 4.5,
    },
    {"earlier_file": "somewhere/k.json", "sigma_factor": 1.25},
]
MORE = [
    {"workspace": {"height_min_mm": 800, "radius_min_mm": 600, "tilt_max_deg": 30}},
    {"measurement": {"rows": "pose", "sigma_mm": 0.05, "sigma_deg": 0.01}},
    {"test_pose": TEST_POSE, "optimise": ["A", "rho0"], "criteria": ["E", "O2"]},
    {"title": 'a "title"\\ in <b>', "candidates": 7, "starts": 3, "seed": 12, "sizes": [2, 9]},
    {"sampling": "sobol", "simulation": {"compliance_rad_per_Nm": {"q2": 1e-7 / 3}}},
]


@pytest.mark.parametrize(
    "change", [*({"load": load} for load in LOADS), *({"prior": prior} for prior in PRIORS), *MORE]
)
def test_toml_round_trip(tmp_path, change):
    """What is written is read as the same study with the same digest, whatever it holds."""
    study = Study(**(REQUIRED | change))
    path = tmp_path / "study.toml"
    assert path.write_text(study.to_toml(), encoding="utf-8")
    read = load_study(path)
    assert_same_numbers(study, read)
    assert read.digest == study.digest
    assert read.to_toml() == study.to_toml()
    assert_same_numbers(Study(**study.to_dict()), study)


@pytest.mark.parametrize("name", ["kr270_milling", "kr270_six_compliances"])
def test_file_round_trip(tmp_path, name):
    """A study file that is written elsewhere has the same numbers, plans included."""
    study = load_study(STUDIES / f"{name}.toml")
    path = tmp_path / "folder" / "copy.toml"
    text = study.to_toml(path)
    assert path.read_text(encoding="utf-8") == text
    read = load_study(path)
    names = read.specification.published
    assert_same_numbers(read.replace(published=study.specification.published), study)
    assert [Path(name).name for name in names] == [
        Path(name).name for name in study.specification.published
    ]
    for name, plan in study.published_plans().items():
        np.testing.assert_array_equal(read.published_plans()[name].q, plan.q)


def test_files_beside_the_study_are_found_from_elsewhere(tmp_path, monkeypatch):
    """Robot, plans, excluded poses and earlier results are found from wherever it is written."""
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "gantry.toml").write_text(GANTRY)
    (folder / "poses.csv").write_text("slide_mm,arm_deg\n250,20\n")
    study = Study(
        robot=Path("gantry.toml"),
        tool={"position_mm": [100, 0, 0]},
        load={"F_N": [0, 100, 0]},
        measurement={"sigma_mm": 0.05},
        joints={"unknown": ["arm"], "fixed_mm": {"slide": 250}},
        workspace={"excluded": "poses.csv"},
        published=["poses.csv"],
        prior={"earlier_file": "k.json"},
        folder=folder,
    )
    study.to_toml(tmp_path / "elsewhere" / "study.toml")
    read = load_study(tmp_path / "elsewhere" / "study.toml")
    assert [path.resolve() for path in read.reads[1:]] == [path.resolve() for path in study.reads]
    assert {path.name for path in study.reads} == {"gantry.toml", "poses.csv", "k.json"}
    np.testing.assert_array_equal(
        read.published_plans()["poses"].q, study.published_plans()["poses"].q
    )
    monkeypatch.chdir(folder)
    here = Study(**study.to_dict())
    assert_same_numbers(here, study)
    with pytest.raises(UserError, match=r"^Study: robot: robot file .*gantry.toml: no such file"):
        here.replace(folder=tmp_path)


def test_a_prismatic_joint_is_fixed_in_its_own_unit(tmp_path):
    """Messages about units of joints have the name of the key in place of a file."""
    (tmp_path / "gantry.toml").write_text(GANTRY)
    keys = REQUIRED | {"robot": "gantry.toml", "joints": {"unknown": ["arm"]}}
    study = Study(**keys, folder=tmp_path)
    with pytest.raises(UserError, match=r"^Study: joints.fixed_deg.slide: the joint is prismatic"):
        study.replace(joints={"unknown": ["arm"], "fixed_deg": {"slide": 2}})


def test_excluded_poses_of_every_origin(tmp_path):
    """Poses are excluded by the study, by a file besides, or as a plan; files are written."""
    (tmp_path / "one.csv").write_text(POSES)
    (tmp_path / "two.csv").write_text(POSES.replace("-103.4", "-93.4"))
    one = Study(**REQUIRED, workspace={"excluded": "one.csv"}, folder=tmp_path)
    both = one.replace(workspace={"excluded": ["one.csv", "two.csv"]})
    besides = one.excluding(tmp_path / "two.csv")
    counts = [len(study.space.labels) for study in (Study(**REQUIRED), one, both, besides)]
    assert counts == [0, 1, 2, 2]
    read = load_study(written(both.to_dict(), tmp_path / "study.toml"))
    assert_same_numbers(read, both)
    assert besides.to_toml(tmp_path / "besides.toml") == both.to_toml()
    assert besides.replace(seed=1).excluded == besides.excluded
    assert besides.excluding(None).to_toml() == one.to_toml()

    plan = Plan.from_csv(tmp_path / "two.csv", one.robot, one.fixed, np.zeros(6))
    in_memory = one.excluding(plan)
    x = both.space.draw(np.random.default_rng(0).random((5, len(both.space.drawn))))
    np.testing.assert_array_equal(in_memory.space.at(x).slack, both.space.at(x).slack)
    with pytest.raises(UserError, match=r"^Study: workspace.excluded: .* in memory"):
        in_memory.to_toml()


def test_a_study_does_not_change():
    """Attributes cannot be set; `replace` makes another study, and None takes a key back."""
    study = Study(**REQUIRED, seed=3)
    with pytest.raises(FrozenInstanceError):
        study.robot = None
    other = study.replace(seed=4, title="Other")
    assert (study.specification.seed, other.specification.seed) == (3, 4)
    assert (study.specification.title, other.specification.title) == (
        "Calibration of KUKA KR 270",
        "Other",
    )
    assert other.replace(seed=3, title=None).digest == study.digest != other.digest
    with pytest.raises(UserError, match=r"^Study: load: this key is required: Loads that"):
        study.replace(load=None)


def test_given_keys_are_copied():
    """A change of the dictionary that a study was built from does not change the study."""
    keys = copy.deepcopy(REQUIRED)
    study = Study(**keys)
    keys["joints"]["unknown"].append("q1")
    keys["joints"]["fixed_deg"]["q1"] = 90
    assert study.replace(seed=1).specification.joints == Study(**REQUIRED).specification.joints


def test_a_replaced_file_study_is_no_longer_its_file():
    """A study that differs from its file has no file, but finds the plans beside it."""
    other = PAPER.replace(sizes=[3])
    assert other.path is None
    assert other.digest != PAPER.digest
    assert other.published_plans().keys() == PAPER.published_plans().keys()


def test_digest_is_of_the_content():
    """The same keys have the same digest, in any order and form; a file's is of its bytes."""
    study = Study(**REQUIRED)
    again = Study(**dict(reversed(REQUIRED.items())), seed=0, workspace={})
    assert study.digest == again.digest
    assert len(bytes.fromhex(study.digest)) == 6
    assert study.replace(seed=1).digest != study.digest
    assert PAPER.digest == "9cc59acac3a4"


def test_main_criterion():
    """A study is about rho0 if it is optimised, wherever it stands, else about the first."""
    study = Study(**REQUIRED, test_pose=TEST_POSE)
    for optimise, main in ((["A", "rho0"], "rho0"), (["A", "D"], "A"), (["rho0"], "rho0")):
        assert study.replace(optimise=optimise).main_criterion == main


def test_a_study_shows_itself():
    """It is one line in a console, a few lines of text, and a small table in a notebook."""
    text = repr(PAPER)
    assert "\n" not in text
    for word in ("<Study: ", "KUKA KR 270, robot-based milling", "5 unknown", "rho0"):
        assert word in text
    rows = PAPER.summary().splitlines()
    assert rows[0] == PAPER.specification.title
    for start in ("  robot ", "  unknown ", "  workspace ", "  task ", "  experiments "):
        assert [line for line in rows if line.startswith(start)]
    assert "height p_z > 800 mm" in PAPER.summary()
    odd = Study(**REQUIRED, title="a < b")._repr_html_()
    assert odd.startswith("<table><caption>a &lt; b</caption>")
    assert "task" not in odd


@pytest.mark.slow
def test_reading_a_study_is_light():
    """Neither tables, pictures, solvers, samplers nor statistics are imported to read a study."""
    script = (
        "import sys\nfrom edtk.study.study import load_study\n"
        f"load_study({str(PAPER.path)!r}).published_plans()\n"
        "heavy = {'pandas', 'cvxpy', 'matplotlib', 'scipy', 'emcee', 'joblib', 'arviz', 'tqdm'}\n"
        "sys.exit(', '.join(heavy & set(sys.modules)) or 0)"
    )
    env = {**os.environ, "PYTHONPATH": str(STUDIES.parent)}
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=env)
    assert done.returncode == 0, done.stderr


def test_signature_lists_the_keys():
    """Editors see every key of the schema, the required ones without a default."""
    parameters = inspect.signature(Study).parameters
    assert set(parameters) == {*Specification.model_fields, "folder"}
    required = {name for name, p in parameters.items() if p.default is p.empty}
    assert required == set(REQUIRED) - {"tool", "load"}  # a payload can stand in for these


def test_a_study_travels_to_other_processes():
    """A pickled study has the same numbers."""
    assert_same_numbers(pickle.loads(pickle.dumps(PAPER)), PAPER)


def test_schema_describes_every_key():
    """Every key of every table has a description, and numbers of a physical quantity their unit."""

    def walk(schema, name):
        for key, field in schema.get("properties", {}).items():
            assert field.get("description"), f"{name}.{key}"
            for suffix in ("_mm", "_deg", "_N", "_Nm", "_rad_per_Nm"):
                if key.endswith(suffix):
                    assert "[" in field["description"], f"{name}.{key} has no unit"

    schema = Specification.model_json_schema()
    walk(schema, "study")
    for name, table in schema["$defs"].items():
        walk(table, name)


def test_a_robot_object_or_table_is_part_of_the_study(tmp_path):
    """A robot in memory is written as a table, and is the same robot when it is read again."""
    (tmp_path / "gantry.toml").write_text(GANTRY)
    keys = REQUIRED | {"joints": {"unknown": ["arm"], "fixed_mm": {"slide": 250}}}
    named = Study(**(keys | {"robot": "gantry.toml"}), folder=tmp_path)
    for robot in (load_robot("gantry.toml", tmp_path), tomllib.loads(GANTRY)):
        study = Study(**(keys | {"robot": robot}))
        assert study.robot.joint_names == ("slide", "arm")
        read = load_study(written(study.to_dict(), tmp_path / "study.toml"))
        for other in (read, study.replace(seed=0)):
            assert_same_numbers(study, other)
        x = named.space.draw(np.random.default_rng(0).random((9, len(named.space.drawn))))
        np.testing.assert_array_equal(study.space.at(x).packed, named.space.at(x).packed)
        assert study.reads == ()


def test_a_random_robot_keeps_every_bit(tmp_path):
    """Frames, axes and limits of any robot survive the file, also a turned base and tilted axes."""
    rng = np.random.default_rng(3)

    def frame():
        return transform(rng.normal(size=3), rng.normal(size=3))

    joints = tuple(
        Joint(f"j{i}", frame(), rng.normal(size=3), (-1 - rng.random(), 1 + rng.random()))
        for i in range(5)
    )
    robot = Robot("random", joints, base=frame())
    study = Study(**(REQUIRED | {"robot": robot, "joints": {"unknown": ["j1", "j4"]}}))
    study.to_toml(tmp_path / "study.toml")
    read = load_study(tmp_path / "study.toml")
    assert_same_numbers(study, read)
    q = rng.normal(size=(7, 5))
    expected = robot.with_tool(study.specification.tool.build()).forward(q)
    np.testing.assert_array_equal(read.robot.forward(q), expected)


def test_a_wrong_robot_table_is_rejected():
    """A table that is no robot is rejected with the key inside it."""
    table = tomllib.loads(GANTRY)
    del table["joints"][1]["axis"]
    with pytest.raises(
        UserError, match=r"^Study: robot: joints.1.axis: this key is required: Direction"
    ):
        Study(**(REQUIRED | {"robot": table}))
