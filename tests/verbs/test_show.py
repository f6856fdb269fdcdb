"""`edtk show`: what it takes, what it tells of each pose, and what it refuses in one line."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from geometry_sheets import STUDY as GEOMETRY
from geometry_sheets import by_pose, truth
from kr270 import REQUIRED, TEST_POSE

import edtk
from edtk.calibration.timetable import day_of
from edtk.cli import main
from edtk.study.study import Study

pytestmark = pytest.mark.slow

STUDIES = Path(__file__).parents[2] / "studies"
PATH = STUDIES / "kr270_milling.toml"
PLAN = STUDIES / "plans" / "table_4_12.csv"
K = np.array([3e-7, 4e-7, 2.8e-6, 2.8e-6, 2.1e-6])
MOVED = ["dx_mm", "dy_mm", "dz_mm"]


def printed(*words: object) -> tuple[int, str]:
    """Exit code and messages of a command."""
    answer = CliRunner().invoke(main, [*map(str, words)])
    return answer.exit_code, answer.stderr


@pytest.fixture(scope="module")
def measured() -> tuple[Study, pd.DataFrame]:
    """A study, and a filled-in sheet of its published plan with one bad reading."""
    study = edtk.load_study(PATH)
    plan = study.load_plan(PLAN)
    sheet = edtk.template(study, plan)
    q = np.deg2rad(sheet.iloc[:, :6].to_numpy())
    rng = np.random.default_rng(4)
    rows = study.model.regressor(q, np.tile(plan.wrench[0], (len(q), 1))) @ K
    sheet[MOVED] = 1e3 * (rows + rng.normal(0, 3e-5, rows.shape))
    sheet.loc[7, "dy_mm"] += 0.4
    return study, sheet


@pytest.mark.cell("`show`", "springs")
def test_poses_of_a_plan_stand_in_the_order_of_its_sheet() -> None:
    """Angles are those of the template, row by row, and shares of information add up to one."""
    study = edtk.load_study(PATH)
    stage = edtk.show(study, PLAN).stage
    sheet = edtk.template(study, PLAN).iloc[:, :6].drop_duplicates().to_numpy()
    assert stage.shown == pytest.approx(sheet, abs=1e-9)
    (shade,) = stage.shades
    assert shade.values.sum() == pytest.approx(100, rel=1e-9)
    # For rho0 it is the trace of what a pose adds to the information, weighted by the slope.
    M = study.information(study.load_plan(PLAN))
    slope = study.criterion("rho0").gradient(M)
    own = study.information(edtk.Plan(stage.q[:1], stage.wrench[:1], stage.repeats[:1]))
    expected = 100 * np.sum(slope * own) / np.sum(slope * M)
    assert shade.values[0] == pytest.approx(expected, rel=1e-6)


def test_a_sheet_and_its_result_show_the_same_residuals(
    measured: tuple[Study, pd.DataFrame], tmp_path: Path
) -> None:
    """The worst pose is that of the bad reading, from the sheet, the result and its k.json."""
    study, sheet = measured
    found = edtk.identify(study, sheet, out=tmp_path)
    pages = [edtk.show(study, one) for one in (sheet, found, tmp_path / "k.json")]
    for page in pages:
        residual = next(one for one in page.stage.shades if one.name == "residual [mm]")
        assert page.stage.shown[residual.values.argmax()] == pytest.approx(
            sheet.iloc[7, :6].to_numpy(dtype=float)
        )
        assert residual.values == pytest.approx(pages[0].stage.shades[0].values)
        assert "identified" in page.stage.springs
    row = found.fit.residual[7]
    worst = pages[0].stage.shades[0].values.max()
    assert worst == pytest.approx(1e3 * np.sqrt((row**2).sum()), rel=1e-9)


def test_an_empty_sheet_shows_its_poses(tmp_path: Path) -> None:
    """A template that nobody has filled in yet has poses, and no residuals."""
    sheet = tmp_path / "sheet.csv"
    edtk.template(PATH, PLAN, out=sheet)
    stage = edtk.show(PATH, sheet).stage
    assert len(stage.q) == 12
    assert [one.name for one in stage.shades] == ["share of information [%]"]


@pytest.mark.cell("`show`", "parameters")
def test_positions_are_shown_with_their_residuals(tmp_path: Path) -> None:
    """A sheet of positions has poses, markers by name, and the distance of each from the fit."""
    q, x = truth(20)
    found = edtk.identify(GEOMETRY, by_pose(tmp_path / "day.csv", q, x), out=tmp_path)
    stage = edtk.show(GEOMETRY, tmp_path / "k.json").stage
    assert [mark.name for mark in stage.marks] == ["A", "B", "C"]
    distance = np.sqrt((found.fit.residual**2).sum(axis=-1))
    rms = 1e3 * np.sqrt((distance**2).mean(axis=1))
    assert stage.shades[0].values == pytest.approx(rms, rel=1e-9)
    assert stage.shown == pytest.approx(q)


def test_without_poses_it_shows_those_of_the_study() -> None:
    """Test poses where there are some, bent by springs of a file; else the robot near zero."""
    study = Study(**REQUIRED | {"test_pose": TEST_POSE})
    stage = edtk.show(study, {"k": {"q2": 3e-7}}).stage
    assert stage.shown == pytest.approx(np.array([TEST_POSE["q_deg"]]))
    assert len(edtk.show(Study(**REQUIRED)).stage.q) == 1


def test_a_notebook_gets_the_page_in_a_frame() -> None:
    """What a notebook shows is the whole page, and no text of it ends the frame."""
    page = edtk.show(PATH, PLAN)
    frame = page._repr_html_()
    assert frame.startswith('<iframe srcdoc="&lt;!DOCTYPE html&gt;')
    assert frame.count('"') == 6
    assert "12 poses" in repr(page)


def test_the_command_writes_the_page(tmp_path: Path) -> None:
    """The file is what the call makes, and the command says nothing."""
    out = tmp_path / "page.html"
    assert printed("show", PATH, PLAN, "--out", out) == (0, "")
    assert out.read_text(encoding="utf-8") == edtk.show(PATH, PLAN).html


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("q1_deg,q2_deg\n1,2\n", "column 'q3_deg' is missing"),
        ("", "is no CSV table"),
        ("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n", "the plan has no rows"),
        ('{"poses": []}', "no such joint"),
        ('{"k": {"axis_1": 1e-7}}', "axis_1"),
        ('{"k": {"q2": 1e-7}, "poses": []}', "poses: expected a table for each pose"),
        ('{"k": {"q2": 1e-7}, "poses": [{"q": [1]}]}', "poses[1]: expected a table"),
    ],
)
def test_wrong_files_are_refused_in_one_line(content: str, said: str, tmp_path: Path) -> None:
    """Plans of other robots, empty ones and results of others: one line, and no page."""
    path = tmp_path / ("k.json" if content.startswith("{") else "plan.csv")
    path.write_text(content)
    out = tmp_path / "page.html"
    code, message = printed("show", PATH, path, "--out", out)
    assert code == 2
    assert said in message
    assert message.count("\n") == 1
    assert not out.exists()


def test_a_result_of_another_robot_is_refused(tmp_path: Path) -> None:
    """Poses of seven joints are none of a robot of six."""
    row = {"q": [0.0] * 7, "wrench": [0.0] * 6, "repeats": 1, "residual_mm": 0.1}
    path = tmp_path / "k.json"
    path.write_text(json.dumps({"k": {"q2": 1e-7}, "poses": [row]}))
    code, message = printed("show", PATH, path, "--out", tmp_path / "page.html")
    assert (code, "has 7 joints; expected the 6" in message) == (2, True)


@pytest.mark.parametrize("out", ["", "plan.csv/page.html", "plan.csv"])
def test_a_path_that_cannot_be_written_is_refused(out: str, tmp_path: Path) -> None:
    """A folder, a file in a file, and the plan itself are no places for the page."""
    plan = tmp_path / "plan.csv"
    plan.write_bytes(PLAN.read_bytes())
    code, message = printed("show", PATH, plan, "--out", tmp_path / out)
    assert code == 2
    assert message.count("\n") == 1
    assert plan.read_bytes() == PLAN.read_bytes()


SCENE = {
    "margin_mm": 10,
    "box": [{"name": "table", "size_mm": [600, 600, 300], "position_mm": [1500, 0, 150]}],
    "hanging": {"name": "weight", "rope_mm": 300, "radius_mm": 100, "height_mm": 200},
}


def test_a_cell_is_there_with_how_far_it_is_and_from_what() -> None:
    """Bodies are those of the cell; a pose that touches is named, with the nearest two bodies."""
    study = Study(**REQUIRED, scene=SCENE)
    q = np.deg2rad([[0, -90, 90, 0, 0, 0], [0, -30, 110, 0, -20, 0]])
    plan = edtk.Plan(q, np.zeros((2, 6)), np.ones(2, dtype=int))
    page = edtk.show(study, plan)
    assert study.cell is not None
    assert "No free way was found to" in page.html
    (shade,) = page.stage.shades
    order = [int(np.abs(q - pose).sum(axis=1).argmin()) for pose in page.stage.q]
    assert shade.values == pytest.approx(1e3 * study.cell.clearance(q).least[order])
    touching = [name for name, mm in zip(page.stage.names, shade.values, strict=True) if mm < 0]
    assert len(touching) == 1
    assert f"Something touches in pose {touching[0]}." in page.html
    kinds = {part.name: part.kind for part in page.stage.parts}
    assert (kinds["table"], kinds["weight"], kinds["forearm"]) == ("around", "load", "link")


def test_results_show_themselves(measured: tuple[Study, pd.DataFrame]) -> None:
    """A plan that was found, a plan of a file, a calibration and a robot have pages of their own.

    What hangs on the poses of the first one is what the verb says of it.
    """
    study, sheet = measured
    found = edtk.plan(study, size=3, criterion="D")
    page = found.show()
    assert len(page.stage.q) == len(found.whole.q)
    (own,) = page.stage.shades
    assert own.values.sum() == pytest.approx(100)
    assert len(study.load_plan(PLAN).show(study).stage.q) == 12
    assert edtk.identify(study, sheet).show().stage.shades[0].name == "residual [mm]"
    assert len(study.robot.show().stage.q) == 1
    with pytest.raises(TypeError, match="a Study has no poses to show"):
        study.show()


def test_the_arm_goes_by_the_via_poses_of_the_day() -> None:
    """Between two poses of a day in a cell it passes where the day's way does, and it is seen there
    which marker nobody reads.
    """
    column = [{"name": "column", "radius_mm": 200, "height_mm": 4000, "position_mm": [1500, 0, 0]}]
    tracker = {"tracker_position_mm": [5000, 0, 1000], "along": [10, 5], "across": [15, 6]}
    markers = [{"name": "A", "position_mm": [0, 0, 0], "normal": [0, 0, 1]}, {"name": "B"}]
    markers[1] |= {"position_mm": [0, 50, 0]}
    keys = REQUIRED | {"joints": {"unknown": ["q2", "q3"]}}
    study = Study(**keys, scene={"cylinder": column}, noise=tracker, marker=markers)
    q = np.deg2rad([[45, -60, 90, 0, 30, 0], [-45, -60, 90, 0, 30, 0]])
    plan = edtk.Plan(q, np.zeros((2, 6)), np.ones(2, dtype=int))
    stage = edtk.show(study, plan).stage
    day = day_of(study, edtk.Plan(q, plan.wrench, plan.repeats))
    (last,) = (step for step in day.steps if step.visit == 2)
    assert last.way is not None
    assert stage.ways[0] == pytest.approx(last.way.via)
    assert len(stage.ways[0]) > 0
    assert study.sight is not None
    assert [name for name, _ in stage.eyes] == [eye.name for eye in study.sight.eyes]
    read = study.sight.seen(stage.q)
    assert [[not words for words in pose] for pose in stage.hidden] == read.tolist()
    assert (~read).any()
