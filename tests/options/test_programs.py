"""Robot programs of plans: the rows of the sheet, driven to as the controller shows them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arm import KEYS, ROBOT, arm
from click.testing import CliRunner
from kr270 import REQUIRED, TEST_POSE
from program_readers import READERS
from small_arm import ROBOT as SMALL

import edtk
from edtk.cli import main
from edtk.design.plan import Plan
from edtk.measure.pose_table import pose_columns
from edtk.programs.program import ProgramError
from edtk.study.study import Study
from edtk.system.errors import UserError

ROOT = Path(__file__).parents[2]
STUDY = ROOT / "studies" / "kr270_milling.toml"
PLAN = ROOT / "studies" / "plans" / "table_4_3.csv"
SPRINGS = Study(**REQUIRED | {"test_pose": TEST_POSE})
LOADS = [[0, 0, 0, 0, 0, 0], [0, 0, -50, 0, 0, 0]]
SMALL_STUDY = Study(
    robot=SMALL,
    marker=[
        {"name": name, "position_mm": place}
        for name, place in (("A", [90, 0, 0]), ("B", [0, 80, 40]))
    ],
    load={"list_F_N": [load[:3] for load in LOADS]},
    measurement={"sigma_mm": 0.05},
    parameters={"geometry": ["zeros"], "compliance": ["q2", "q3"]},
)
ARM_BRANDS = sorted(READERS)


def random_plan(study: Study, seed: int, loads: list[list[float]]) -> Plan:
    """Poses anywhere in the limits, some of them measured again."""
    rng = np.random.default_rng(seed)
    lower, upper = study.robot.limits
    k = 6
    q = rng.uniform(lower, upper, (k, study.robot.n))
    wrench = np.array([loads[i % len(loads)] for i in range(k)], dtype=float)
    return Plan(q, wrench, rng.integers(1, 3, k))


def read(found: edtk.WrittenProgram) -> list[tuple[Any, ...]]:
    """The steps of a program, by the reader of its brand."""
    files = {Path(name).suffix: text for name, text in found.files.items()}
    return READERS[found.brand](files)[1]


def require_rows(found: edtk.WrittenProgram, sheet: Any, robot: edtk.Robot, marked: bool) -> None:
    """Check that each row of a sheet is read in the pose that the sheet has, and in its order."""
    steps = read(found)
    angles = sheet[list(pose_columns(robot))].to_numpy()
    seen = 0
    for before, step in zip([("",), *steps], steps, strict=False):
        if step[0] != "move" or before[0] != "rows":
            continue
        first, last = before[1:]
        assert (first, last) == (seen + 1, seen + 1 + marked)
        seen = last
        values = np.array(list(step[1].values()))
        np.testing.assert_allclose(angles[first - 1 : last], [values] * (1 + marked), atol=1e-9)
    assert seen == len(sheet) == found.rows


@pytest.mark.cell("`template --program`", "springs")
@pytest.mark.parametrize("brand", ARM_BRANDS)
def test_a_program_drives_through_the_rows_of_the_sheet(brand: str) -> None:
    """Angles are the sheet's to the printed digit; each displacement has both of its readings."""
    plan = random_plan(SPRINGS, 0, [[0, 0, -2500, 0, 0, 0]])
    found = edtk.program(SPRINGS, plan, brand)
    require_rows(found, edtk.template(SPRINGS, plan), SPRINGS.robot, False)
    stops = [step for step in read(found) if step[0] == "stop"]
    assert len(stops) == 2 * plan.experiments
    assert found.criterion == "rho0"
    assert found.efficiency == pytest.approx(1, abs=1e-4)
    assert 0 < found.rounding <= 0.5e-3 + 1e-6


@pytest.mark.cell("`template --program`", "parameters")
@pytest.mark.parametrize("brand", ARM_BRANDS)
def test_a_program_of_positions_changes_loads_between_visits(brand: str) -> None:
    """All markers of a visit are read at once; a load is changed once, at home."""
    plan = random_plan(SMALL_STUDY, 1, LOADS)
    home = [0, -30, 60, 0, 45, 0]
    found = edtk.program(SMALL_STUDY, plan, brand, home=home)
    require_rows(found, edtk.template(SMALL_STUDY, plan), SMALL_STUDY.robot, True)
    steps = read(found)
    assert len([step for step in steps if step[0] == "stop"]) == plan.experiments + 1
    moves = [list(step[1].values()) for step in steps if step[0] == "move"]
    homes = [i for i, move in enumerate(moves) if np.allclose(move, home, atol=1e-6)]
    assert len(homes) == 3
    assert (homes[0], homes[-1]) == (0, len(moves) - 1)


def test_repeats_are_driven_to_by_one_name() -> None:
    """A pose that is measured three times stands in the file once."""
    q = np.zeros((1, 6))
    q[0, 1] = -1.0
    found = edtk.program(SPRINGS, Plan(q, np.zeros((1, 6)), np.array([3])), "krl")
    assert list(found.program.targets.values()) == ["row1"]
    assert [step[1:] for step in read(found) if step[0] == "rows"] == [(1, 1), (2, 2), (3, 3)]


def test_the_controller_counts_the_angles() -> None:
    """Signs, zeros and couplings of the controller are in the program as they are in the sheet."""
    controller = {
        "sign": {"q1": -1},
        "zero_deg": {"q1": 12.345, "q2": -90},
        "follows": {"q2": "q1"},
    }
    study = arm(controller=controller)
    plan = Plan(np.deg2rad([[9.0, 40.0]]), np.array([[0, 0, -100.0, 0, 0, 0]]), np.array([1]))
    (move,) = edtk.program(study, plan, "krl").program.moves
    assert move.target == pytest.approx((3.345, -41.0), abs=1e-12)


def test_a_rail_is_written_as_an_external_axis() -> None:
    """Millimetres of a slide under an arm go to E1 by themselves; the arm's joints count from 1."""
    slide = {
        "name": "rail",
        "kind": "prismatic",
        "origin_m": [0, 0, 0],
        "axis": [0, 1, 0],
        "limits_m": [0, 3],
    }
    robot = SMALL | {"joints": [slide, *SMALL["joints"]]}
    study = Study(**KEYS | {"robot": robot, "joints": {"unknown": ["q2", "q3"]}})
    q = np.r_[1.23456789, np.deg2rad([10, 20, 30, 40, 50, 60])][None]
    plan = Plan(q, np.array([[0, 0, -100.0, 0, 0, 0]]), np.array([1]))
    for brand in ("krl", "rapid", "fanuc_ls"):
        (values,) = [
            step[1] for step in read(edtk.program(study, plan, brand)) if step[0] == "move"
        ]
        assert values["E1"] == 1234.568
        assert [round(x) for name, x in values.items() if name != "E1"] == [10, 20, 30, 40, 50, 60]
    with pytest.raises(ProgramError, match="E1 beside the robot; urscript has none"):
        edtk.program(study, plan, "urscript")


def test_no_angle_is_rounded_beyond_its_limit() -> None:
    """A limit with more digits than the controller takes is not overrun by half a step."""
    joints = [joint | {"limits_deg": [-119.9996, 119.9996]} for joint in ROBOT["joints"]]
    study = arm(robot=ROBOT | {"joints": joints})
    q = np.deg2rad([[119.9996, -119.9996]])
    plan = Plan(q, np.array([[0, 0, -100.0, 0, 0, 0]]), np.array([1]))
    (move,) = edtk.program(study, plan, "krl").program.moves
    assert move.target == (119.999, -119.999)
    beyond = Plan(np.deg2rad([[120.3, 0.0]]), plan.wrench, plan.repeats)
    with pytest.raises(ProgramError, match=r"row 1: q1 is 120.3 deg; its limits are -119\.9996 to"):
        edtk.program(study, beyond, "krl")


def test_coarse_angles_are_judged() -> None:
    """What rounding costs is said: a writer of whole degrees loses what its plan loses."""
    from edtk.calibration.robot_program import as_taken, program_axes
    from edtk.programs import writer

    class Coarse(writer.Writer):
        name = "coarse"
        title = "whole tens of degrees"
        suffixes = (".txt",)
        longest_name = 8

        def taken(self, shown, axes):
            return np.round(shown, -1) + 0.0

        def write(self, program):
            return {".txt": ""}

    study = edtk.load_study(STUDY)
    plan = study.load_plan(PLAN)
    try:
        writer.register(Coarse)
        found = edtk.program(study, plan, "coarse")
    finally:
        writer._registered.pop("coarse")
    coarse = as_taken(study.robot, Coarse(), program_axes(study.robot, None), plan)
    values = [edtk.evaluate(study, one).criteria["rho0"] for one in (plan, coarse)]
    assert found.efficiency == pytest.approx(values[0] / values[1], rel=1e-9)
    assert abs(found.efficiency - 1) > 1e-3
    assert found.rounding == pytest.approx(5, abs=0.2)


def run(*words: object) -> tuple[int, str, str]:
    """Exit code and output of the program."""
    result = CliRunner().invoke(main, ["template", *map(str, words)])
    return result.exit_code, result.stdout, result.stderr


def test_the_command_writes_both_files_and_says_what_they_do(tmp_path: Path) -> None:
    """KRL is two files, named after the program; JSON holds them in SI units."""
    out = tmp_path / "day1.src"
    options = ("--program", "krl", "--home", "0,-90,90,0,0,0", "--speed", 35, "--dwell", 0)
    code, shown, _ = run(STUDY, PLAN, *options, "--out", out)
    assert code == 0
    assert "% of the plan's efficiency by rho0" in shown
    assert out.read_text().splitlines()[2] == "DEF day1 ( )"
    assert "DEFDAT day1" in (tmp_path / "day1.dat").read_text()
    assert "BAS (#VEL_PTP,35 )" in out.read_text()
    assert "WAIT SEC" not in out.read_text()
    code, text, _ = run(STUDY, PLAN, *options, "--json")
    content = json.loads(text)
    assert content["targets"]["home"][1] == pytest.approx(-np.pi / 2)
    assert content["speed"] == 0.35
    assert set(content["files"]) == {"table_4_3.src", "table_4_3.dat"}
    code, printed, _ = run(STUDY, PLAN, *options)
    assert printed == "".join(content["files"].values())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--program", "kuka"), "unknown writer 'kuka'; available: "),
        (("--speed", 20), "--speed: is of programs; expected --program beside it"),
        (("--json",), "--json: is of programs; expected --program beside it"),
        (("--program", "krl", "--positions"), "--positions: is of sheets"),
        (("--program", "krl", "--home", "1,2"), "--home: 2 values; expected one for each joint"),
        (
            ("--program", "krl", "--home", "1,a"),
            "--home 1,a: expected numbers, separated by commas",
        ),
        (("--program", "krl", "--home", "0,9,0,0,0,0"), "home: q2 is 9 deg; its limits are"),
        (("--program", "krl", "--handshake", "1"), ": expected two signals: the output"),
        (("--program", "krl", "--handshake", "a,1"), "signal 'a': expected a number from 1"),
        (("--program", "krl", "--axes", "1,2"), "2 axes; expected one for each joint"),
        (
            ("--program", "krl", "--out", "day.mod"),
            "--out day.mod: expected a file that ends in .src",
        ),
        (("--program", "krl", "--out", "my day.src"), "program name 'my day': expected letters"),
        (("--program", "krl", "--markers", 0), "--markers"),
    ],
)
def test_bad_input_is_one_line(
    words: tuple[object, ...], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is written, and the line says what was expected."""
    monkeypatch.chdir(tmp_path)
    code, _, error = run(STUDY, PLAN, *words)
    assert code == 2
    assert said in error
    assert len(error.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_program_replaces_no_input_and_no_filled_sheet(tmp_path: Path) -> None:
    """A table of steps may end in .csv, as plans and sheets do."""
    study = edtk.load_study(STUDY)
    plan = tmp_path / "plan.csv"
    plan.write_text(PLAN.read_text())
    with pytest.raises(UserError, match="is read by this command"):
        edtk.program(study, plan, "csv", out=plan)
    sheet = tmp_path / "sheet.csv"
    filled = edtk.template(study, plan)
    filled[["dx_mm", "dy_mm", "dz_mm"]] = 0.1
    filled.to_csv(sheet, index=False)
    with pytest.raises(UserError, match="has measurements in it"):
        edtk.program(study, plan, "csv", out=sheet)


def test_no_program_drives_where_something_touches() -> None:
    """A pose in a wall has no free way, and its visit is named instead of a program."""
    rod = {"name": "rod", "joint": "q2", "from_mm": [0, 0, 0], "to_mm": [500, 0, 0]}
    wall = {"name": "wall", "size_mm": [400, 400, 400], "position_mm": [1200, 0, 1000]}
    study = arm(scene={"bodies": False, "capsule": [rod | {"radius_mm": 20}], "box": [wall]})
    q = np.deg2rad([[0.0, 0.0], [-60.0, 0.0]])
    plan = Plan(q, np.tile([0, 0, -100.0, 0, 0, 0], (2, 1)), np.array([1, 1]))
    with pytest.raises(ProgramError, match="no free way leads there"):
        edtk.program(study, plan, "csv")
    alone = Plan(q[1:], plan.wrench[1:], plan.repeats[1:])
    assert edtk.program(study, alone, "csv").visits == 2  # without the load, and with it
