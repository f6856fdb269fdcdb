"""Plans as arrays and as CSV files, and every way in which such a file can be wrong."""

import json

import numpy as np
import pandas as pd
import pytest

from edtk.design.plan import Plan
from edtk.measure.pose_table import PoseFileError
from edtk.robots.joint import Joint
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform
from edtk.system.errors import UserError

KR270 = load_robot("kuka_kr270")
MIXED = Robot(
    "mixed",
    (
        Joint("turn", transform(), np.array([0, 0, 1]), (-3, 3)),
        Joint("slide", transform(), np.array([1, 0, 0]), (0, 2), "prismatic"),
    ),
)
WRENCH = np.array([0.0, 0.0, -2500.0, 0.0, 0.0, 0.0])
HEAD = "q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"


def plan_of(robot, k=4, seed=0):
    rng = np.random.default_rng(seed)
    return Plan(
        rng.uniform(*robot.limits, size=(k, robot.n)),
        rng.normal(size=(k, 6)) * 1e3,
        np.arange(1, k + 1),
    )


@pytest.fixture
def read(tmp_path):
    def from_text(text, fixed=None):
        path = tmp_path / "plan.csv"
        path.write_text(text, encoding="utf-8")
        return Plan.from_csv(path, KR270, {0: 0.25} if fixed is None else fixed, WRENCH)

    return from_text


@pytest.mark.parametrize(
    ("given", "words"), [([1.0, 3.0], ""), ([1.5, 2], "whole"), ([1e10, 1], "1e9")]
)
def test_repetitions_are_whole_numbers(given, words):
    """Whole numbers may be given as floats; others are refused in a line."""
    if words:
        with pytest.raises(UserError, match=words):
            Plan(np.zeros((2, 6)), np.zeros((2, 6)), np.array(given))
    else:
        plan = Plan(np.zeros((2, 6)), np.zeros((2, 6)), np.array(given))
        assert plan.repeats.tolist() == [1, 3]
        assert plan.repeats.dtype == int


@pytest.mark.parametrize("robot", [KR270, MIXED], ids=["KR 270", "prismatic"])
def test_round_trip(robot, tmp_path):
    """A plan comes back from its file to the ten digits written."""
    plan = plan_of(robot)
    plan.to_csv(tmp_path / "a" / "plan.csv", robot)
    back = Plan.from_csv(tmp_path / "a" / "plan.csv", robot, {}, np.zeros(6))
    np.testing.assert_allclose(back.q, plan.q, rtol=1e-9)
    np.testing.assert_allclose(back.wrench, plan.wrench, rtol=1e-9)
    np.testing.assert_array_equal(back.repeats, plan.repeats)
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["plan.csv"]


@pytest.mark.parametrize("robot", [KR270, MIXED], ids=["KR 270", "prismatic"])
def test_round_trip_by_frame(robot):
    """A plan comes back from its table to the rounding of units, whatever the table's index."""
    plan = plan_of(robot)
    frame = plan.to_frame(robot).set_index(pd.Index([7, 7, 1, 0]))
    back = Plan.from_frame(frame, robot)
    np.testing.assert_allclose(back.q, plan.q, rtol=4e-16)
    np.testing.assert_array_equal(back.wrench, plan.wrench)
    np.testing.assert_array_equal(back.repeats, plan.repeats)


def test_round_trip_by_dict():
    """A plan comes back from its plain numbers bit by bit, also by way of JSON."""
    plan = plan_of(KR270)
    back = Plan.from_dict(json.loads(json.dumps(plan.to_dict())))
    for name in ("q", "wrench", "repeats"):
        np.testing.assert_array_equal(getattr(back, name), getattr(plan, name))
        assert getattr(back, name).dtype == getattr(plan, name).dtype


def test_wrong_frame():
    """A table that is no plan's is rejected in one line that names row and column."""
    frame = plan_of(KR270).to_frame(KR270)
    with pytest.raises(PoseFileError, match=r"^data frame: row 2, column repeats: 0 is not"):
        Plan.from_frame(frame.assign(repeats=[1, 0, 1, 1]), KR270)
    with pytest.raises(PoseFileError, match=r"^data frame: the plan has no rows$"):
        Plan.from_frame(frame.iloc[:0], KR270)


def test_units_of_a_prismatic_joint(tmp_path):
    """A prismatic joint is written in millimetres under NAME_mm, a revolute one in degrees."""
    Plan(np.array([[np.pi / 2, 0.125]]), np.zeros((1, 6)), np.array([1])).to_csv(
        tmp_path / "p.csv", MIXED
    )
    header, row = (tmp_path / "p.csv").read_text().splitlines()
    assert header.split(",")[:3] == ["turn_deg", "slide_mm", "repeats"]
    assert row.split(",")[:3] == ["90", "125", "1"]


def test_defaults(read):
    """Fixed joints, wrench and repetitions may be left out; a column overrides one component."""
    plan = read(f"# a note\n{HEAD},Fx_N\n-90, 0,10,20,30,7\n-80,1,2,3,4,-7\n")
    np.testing.assert_array_equal(plan.q[:, 0], 0.25)
    np.testing.assert_allclose(plan.q[0, 1:], np.deg2rad([-90, 0, 10, 20, 30]), rtol=1e-15)
    np.testing.assert_array_equal(plan.wrench[:, 0], [7, -7])
    np.testing.assert_array_equal(plan.wrench[:, 1:], np.tile(WRENCH[1:], (2, 1)))
    assert plan.repeats.tolist() == [1, 1]
    assert plan.experiments == 2


GOOD = "-90,0,10,20,30"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (f"{HEAD}\n{GOOD}\n-90,NaN,1,2,3\n", ["row 2", "q3_deg"]),
        (f"{HEAD}\n{GOOD}\n-90,,1,2,3\n", ["row 2", "q3_deg"]),
        (f"{HEAD}\n-90,0,1,2\n", ["row 1", "4 cells; expected 5"]),
        (f"{HEAD}\n-90,0,1,2,inf\n", ["row 1", "q6_deg"]),
        (f"{HEAD}\n{GOOD}\n{GOOD}\n-90,0,many,2,3\n", ["row 3", "q4_deg", "many"]),
        (f"{HEAD},q7_deg\n{GOOD},1\n", ["unknown column", "q7_deg"]),
        (f"{HEAD},q2_deg\n{GOOD},1\n", ["q2_deg", "is there twice"]),
        ("q2_deg,q3_deg,q4_deg,q5_deg\n1,2,3,4\n", ["q6_deg", "missing"]),
        (f"{HEAD},repeats\n{GOOD},0\n", ["row 1", "repeats"]),
        (f"{HEAD},repeats\n{GOOD},1\n{GOOD},1.5\n", ["row 2", "repeats", "1.5"]),
        (f"{HEAD},repeats\n{GOOD},-1\n", ["row 1", "repeats"]),
        (f"{HEAD},repeats\n{GOOD},\n", ["row 1", "repeats"]),
        (f"{HEAD},Fz_N\n{GOOD},heavy\n", ["row 1", "Fz_N"]),
        (f"{HEAD}\n{GOOD}\n{GOOD},5\n", []),
        (f"{HEAD}\n{GOOD},5\n{GOOD}\n", []),
        (f"{HEAD},repeats\n{GOOD},1e300\n", ["row 1", "repeats"]),
        ("", []),
        ("# only a note\n", []),
        (f"{HEAD}\n", ["no rows"]),
        ('q2_deg,q3_deg\n"1,2\n', []),
    ],
    ids=[
        "NaN",
        "empty cell",
        "short row",
        "inf",
        "text",
        "unknown column",
        "column twice",
        "missing column",
        "repeats 0",
        "repeats 1.5",
        "repeats -1",
        "repeats empty",
        "wrench text",
        "long row",
        "long first row",
        "repeats 1e300",
        "empty file",
        "comment only",
        "header only",
        "open quote",
    ],
)
def test_wrong_file(read, tmp_path, text, named):
    """A wrong file is rejected in a single line that names the file and the row or column."""
    with pytest.raises(PoseFileError) as caught:
        read(text)
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'plan.csv'}: ")
    assert "\n" not in message
    for word in named:
        assert word in message


def test_unfixed_joint_is_missing(read):
    """A joint that the study does not fix must be in the file."""
    with pytest.raises(PoseFileError, match="'q1_deg' is missing"):
        read(f"{HEAD}\n{GOOD}\n", fixed={})


def test_no_file(tmp_path):
    """A file that does not exist, a folder and a file of bytes are rejected by name."""
    (tmp_path / "bytes.csv").write_bytes(b"q2_deg\n\xff\xfe\x00\n")
    for name in ("none.csv", "", "bytes.csv"):
        with pytest.raises(UserError) as caught:
            Plan.from_csv(tmp_path / name, KR270, {}, WRENCH)
        assert str(caught.value).startswith(f"{tmp_path / name}: ")
        assert "\n" not in str(caught.value)


def test_repeated():
    """A plan that is carried out several times has as many times the repetitions."""
    plan = plan_of(KR270, k=3)
    assert plan.experiments == 6
    assert plan.repeated(4).experiments == 24
    np.testing.assert_array_equal(plan.repeated(4).q, plan.q)


def test_sum():
    """These experiments come first, with their wrenches and repetitions, then the others."""
    a = plan_of(KR270, k=2)
    b = plan_of(KR270, k=3, seed=1)
    both = a + b
    for name in ("q", "wrench", "repeats"):
        np.testing.assert_array_equal(getattr(both, name)[:2], getattr(a, name))
        np.testing.assert_array_equal(getattr(both, name)[2:], getattr(b, name))
    assert both.experiments == a.experiments + b.experiments


def test_a_load_that_the_study_leaves_open_must_be_in_the_file(tmp_path):
    """Without a default wrench each force must have a column; missing torques are zero."""
    path = tmp_path / "plan.csv"
    columns = ("Fx_N", "Fy_N", "Fz_N")
    for n in range(3):
        path.write_text(f"{HEAD}{''.join(f',{c}' for c in columns[:n])}\n{GOOD}{',1' * n}\n")
        with pytest.raises(
            PoseFileError, match=f"'{columns[n]}' is missing, and the study leaves the load open"
        ):
            Plan.from_csv(path, KR270, {0: 0.25}, None)
    path.write_text(f"{HEAD},{','.join(columns)}\n{GOOD},1,2,3\n")
    np.testing.assert_array_equal(
        Plan.from_csv(path, KR270, {0: 0.25}, None).wrench, [[1, 2, 3, 0, 0, 0]]
    )


@pytest.mark.parametrize(
    ("q", "wrench", "repeats"),
    [
        (np.zeros((0, 6)), np.zeros((0, 6)), np.zeros(0, int)),
        (np.zeros(6), np.zeros((6, 6)), np.ones(6, int)),
        (np.zeros((2, 6)), np.zeros((1, 6)), np.ones(2, int)),
        (np.zeros((2, 6)), np.zeros((2, 6)), np.ones(3, int)),
        (np.zeros((2, 6)), np.zeros((2, 6)), np.array([1, 0])),
        (np.full((2, 6), np.nan), np.zeros((2, 6)), np.ones(2, int)),
        (np.zeros((2, 6)), np.full((2, 6), np.inf), np.ones(2, int)),
    ],
    ids=["empty", "flat q", "wrench", "repeats", "zero", "nan q", "inf wrench"],
)
def test_wrong_arrays(q, wrench, repeats):
    """Arrays that are no plan are rejected."""
    with pytest.raises(ValueError, match="a plan"):
        Plan(q, wrench, repeats)
