"""Sheets of positions as people bring them: good ones, and each kind of bad one, by name."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from geometry_sheets import (
    NAMES,
    OFFSETS,
    PLACE,
    STUDY,
    TEST_POSE,
    Array,
    by_marker,
    by_pose,
    run,
    truth,
)
from small_arm import ROBOT

import edtk
from edtk.measure.pose_table import BAND_COLUMNS, PART_COLUMNS
from edtk.robots.rotations import transform
from edtk.study.study_geometry import StudyGeometry

SPRUNG = STUDY.replace(parameters={"compliance": ["q2", "q3"]}, load={"F_N": [0, 0, -50]})
Edit = Callable[[Array, Array], None]


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """The study as a file."""
    path = tmp_path / "study.toml"
    STUDY.to_toml(path)
    return path


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The calibration of thirty sound poses, for tests that only read it."""
    return edtk.identify(STUDY, by_pose(tmp_path_factory.mktemp("sound") / "day.csv", *truth(30)))


def test_a_study_of_geometry_is_written_and_read(study: Path) -> None:
    """Its keys come back from the file, without load, tool and joints."""
    again = edtk.load_study(study)
    assert again.to_dict() == STUDY.to_dict()
    assert again.specification.parameters.geometry == "all"
    assert "geometry" in repr(again)
    assert again.warnings == ()


def test_both_forms_of_a_sheet_tell_the_same(study: Path, tmp_path: Path) -> None:
    """A row a pose and a row a marker are the same measurements, in Python and as a command."""
    q, x = truth(25)
    wide = edtk.identify(study, by_pose(tmp_path / "wide.csv", q, x))
    code, out, err = run("identify", study, by_marker(tmp_path / "long.csv", q, x), "--json")
    told = json.loads(out)
    assert (code, err) == (0, "")
    assert told["rank"] == wide.rank == 33
    assert told["loo_rms_mm"] == pytest.approx(wide.loo_rms_mm, rel=1e-6)
    assert 0.02 < told["loo_rms_mm"] < 0.1
    assert set(told["parameters"]) == set(wide.parameters)
    assert told["verdict"] == wide.verdict == "good"
    np.testing.assert_allclose(wide.base, PLACE, atol=2e-3)
    assert "robot in the instrument's frame: at (" in wide.summary()
    code, out, _ = run("identify", study, tmp_path / "long.csv")
    assert "33 parameters can be told apart" in out
    assert "each pose predicted without it" in out


@pytest.mark.cell("`predict`, and sets of tests", "parameters")
def test_predictions_are_compared_with_what_was_measured(study: Path, tmp_path: Path) -> None:
    """Other poses are where the result says, within bands that hold most of them."""
    q, x = truth(60)
    sheet = by_marker(tmp_path / "sheet.csv", q[:30], x[:30])
    (tmp_path / "result.json").write_text(run("identify", study, sheet, "--json")[1])
    tests = by_marker(tmp_path / "tests.csv", q[30:], x[30:])
    code, out, err = run("predict", study, tmp_path / "result.json", tests, "--json")
    told = json.loads(out)
    assert (code, err) == (0, "")
    assert told["errors"]["count"] == 90
    assert told["mean_mm"] < told["rms_mm"] < told["max_mm"] < 0.3
    assert 0.9 < told["share_inside"] < 0.99
    first = told["positions"][0]
    assert abs(first["x_mm"] - x[30, 0, 0]) < 0.3
    assert first["band_x_mm"] > 0
    python = edtk.predict(study, edtk.identify(study, sheet), tests)
    assert python.rms_mm == pytest.approx(told["rms_mm"], rel=1e-9)
    assert "inside" in python.summary()


def test_poses_alone_have_positions_of_all_markers(sound: Any, study: Path, tmp_path: Path) -> None:
    """A file of poses without positions is answered with all markers and no comparison."""
    poses = tmp_path / "poses.csv"
    poses.write_text("\n".join([",".join(NAMES), "10,20,30,-40,50,60", "0,0,0,0,0,0"]))
    told = edtk.predict(study, sound, poses).to_dict()
    assert [one["marker"] for one in told["positions"]] == list("ABCABC")
    assert told["mean_mm"] is told["share_inside"] is None


def test_markers_that_moved_on_the_tool_are_placed_anew(study: Path, tmp_path: Path) -> None:
    """The first row places them, and is no test."""
    q, x = truth(50)
    found = edtk.identify(study, by_pose(tmp_path / "sheet.csv", q[:30], x[:30]))
    model = found.fit.fitted
    tips = model.model.see(model.theta, np.deg2rad(q), derivatives=False).turns
    moved = x + tips @ np.array([3.0, -2.0, 1.0])
    tests = by_pose(tmp_path / "tests.csv", q[30:], moved[30:])
    assert edtk.predict(study, found, tests).mean_mm > 3
    placed = edtk.predict(study, found, tests, tool_rows=1)
    assert placed.mean_mm < 0.15
    assert placed.tests.sum() == 57
    assert placed.share_inside > 0.9


def swapped(q: Array, x: Array) -> None:
    x[[4, 9]] = x[[4, 9]][:, [1, 0, 2]]


def lost(q: Array, x: Array) -> None:
    x[6, 2] = 0


def moved(q: Array, x: Array) -> None:
    x[15:] += [1.0, 0.5, 0]


def wrong_pose(q: Array, x: Array) -> None:
    q[5, 2] += 12


def off(q: Array, x: Array) -> None:
    x[7, 1, 2] += 1.0


def signs(q: Array, x: Array) -> None:
    q[:, [1, 4]] *= -1


def follows(q: Array, x: Array) -> None:
    q[:, 2] -= q[:, 1]


def still(q: Array, x: Array) -> None:
    q[:], x[:] = q[:1], x[:1]


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (swapped, "rows 5, 10: markers A and B are swapped"),
        (lost, "row 7: 1 position of C is zero, as of a lost beam; it does not count"),
        (moved, "row 16: from here on positions are 1.1"),
        (wrong_pose, "row 6: positions are up to"),
        (off, "row 8: marker B or C is up to 0.58"),
        (signs, "fit if q2, q5 count the other way"),
        (follows, "fit if q3 turns with q2"),
    ],
)
def test_bad_rows_are_named(study: Path, tmp_path: Path, spoil: Edit, said: str) -> None:
    """What is wrong is one line with its rows, and the rest is calibrated where it can be."""
    q, x = truth(30)
    spoil(q, x)
    code, out, err = run("identify", study, by_pose(tmp_path / "sheet.csv", q, x))
    assert code == 0
    assert said in err
    assert "verdict: good" not in out
    assert "33 parameters" in out


def radians(q: Array, x: Array) -> None:
    q[:] = np.deg2rad(q)


def one_in_radians(q: Array, x: Array) -> None:
    q[:, 1] = np.deg2rad(q[:, 1])


def metres(q: Array, x: Array) -> None:
    x /= 1e3


@pytest.mark.parametrize(
    ("spoil", "poses", "said"),
    [
        (radians, 20, "joint angles are taken as radians; expected degrees"),
        (one_in_radians, 20, "the positions fit if q2 is taken as radians; expected degrees"),
        (metres, 20, "positions look as if in metres"),
        (None, 3, "27 measured coordinates for 33 parameters"),
    ],
)
def test_sheets_that_cannot_be_meant_are_refused(
    study: Path, tmp_path: Path, spoil: Edit | None, poses: int, said: str
) -> None:
    """Wrong units and too few poses are one line and exit code 2."""
    q, x = truth(poses)
    if spoil is not None:
        spoil(q, x)
    code, out, err = run("identify", study, by_pose(tmp_path / "sheet.csv", q, x))
    assert (code, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1


def test_open_directions_are_named(study: Path, tmp_path: Path) -> None:
    """Poses in which a joint stands still tell fewer parameters, and say which, wherever the sheet
    is.
    """
    q, _ = truth(30)
    q[:, 0] = 25.0
    model = replace(StudyGeometry.of(STUDY).model, offsets=OFFSETS)
    x = 1e3 * model.see(np.zeros(model.p), np.deg2rad(q), derivatives=False).points
    x = x + np.random.default_rng(0).normal(0, 0.02, x.shape)
    folder = tmp_path / "measurements" / ("of a long day " * 8)
    folder.mkdir(parents=True)
    sheet = by_pose(folder / "sheet.csv", q, x)
    code, out, err = run("identify", study, sheet)
    assert code == 0
    # The robot is as drawn: base and tool alone predict it better than a fit of its noise.
    begun = [line for line in err.splitlines() if not line.startswith("edtk:   ")]
    assert len(begun) == 2
    assert "sheet.csv: do not use: a pose left out is " in err
    assert "sheet.csv: 29 of 33 parameters can be told, as q1 stands still in all poses: " in err
    assert "of 33 that better poses would tell" in out
    result = edtk.identify(study, sheet)
    poses = tmp_path / "poses.csv"
    poses.write_text(",".join(NAMES) + "\n80,20,30,-40,50,60\n")
    assert edtk.predict(study, result, poses).open_rows == (0,)


def test_points_on_the_base_tell_what_moved(tmp_path: Path) -> None:
    """A beam on the wrong reflector is named; a frame that moved with all points is taken back."""
    names = ["A", "B", "C", "P", "Q", "R"]
    markers = [{"name": n, **({"joint": "base"} if n in "PQR" else {})} for n in names]
    study = STUDY.replace(marker=markers)
    q, x = truth(30)
    base = np.array([[900.0, 100, 0], [1500, 800, 10], [700, -600, 30]])
    points = np.tile(base, (30, 1, 1)) + np.random.default_rng(1).normal(0, 0.003, (30, 3, 3))
    points[3, 1] = x[3, 2]
    every = np.concatenate([x, points], axis=1)
    turn = transform((2.0, 1.0, 0), (0, 0, 0.002))
    every[20:25] = every[20:25] @ turn[:3, :3].T + turn[:3, 3]
    path = tmp_path / "sheet.csv"
    header = ",".join([*NAMES, *(f"{n}{axis}_mm" for n in names for axis in "xyz")])
    cells = np.hstack([q, every.reshape(30, -1)])
    np.savetxt(path, cells, delimiter=",", header=header, comments="")
    found = edtk.identify(study, path)
    text = " | ".join(doubt.words for doubt in found.findings)
    assert "row 4: the point Q on the base is where the marker C on the tool is" in text
    assert "rows 21 to 25: the frame of the instrument moved" in text
    assert found.loo_rms_mm < 0.1


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"parameters": {"geometry": ["q9"]}}, "parameters.geometry: no parameter 'q9'"),
        ({"parameters": {"geometry": "zero"}}, "parameters.geometry: no parameter 'zero'"),
        ({"parameters": {"geometry": 3}}, "parameters.geometry: expected 'all', or a list of"),
        ({"parameters": {"compliance": "q9"}}, "parameters.compliance: no joint 'q9'"),
        ({"parameters": {"compliance": ["q9"]}}, "parameters.compliance: no joint 'q9'"),
        (
            {
                "measurement": {"sigma_mm": 0.1, "rows": "pose", "sigma_deg": 1},
                "marker": [{"name": "A"}, {"name": "P", "joint": "base", "rows": "pose"}],
            },
            "marker.1.rows: points on the base",
        ),
        ({"marker": [{"name": "A", "rows": "pose"}]}, "sigma_deg|marker.0.rows"),
        ({"marker": [{"name": "A", "joint": "q9"}]}, "marker.0.joint"),
        ({"marker": [{"name": "P", "joint": "base"}]}, "expected one on the robot"),
        (
            {"parameters": {"geometry": [], "base": False, "tool": False}},
            "leaves nothing unknown",
        ),
        ({"interest": {"joints": ["q2"]}}, "interest.joints: a study with"),
        ({"prior": {"nu": 5}}, "prior.nu: .*does not heed"),
        ({"joints": {"unknown": ["q2"]}, "parameters": {"compliance": ["q3"]}}, "joints.unknown"),
    ],
)
def test_wrong_studies_of_geometry(keys: dict[str, object], said: str) -> None:
    """Keys that cannot be meant are one line that names them."""
    with pytest.raises(edtk.UserError, match=said):
        STUDY.replace(**keys)


def test_results_of_other_robots_are_refused(sound: Any, study: Path, tmp_path: Path) -> None:
    """A result of another drawing, and a file that is none, are one line."""
    by_pose(tmp_path / "sheet.csv", *truth(3))
    found = sound.to_dict()
    longer = {**ROBOT, "joints": [{**ROBOT["joints"][0], "origin_m": [0, 0, 0.3]}]}
    longer["joints"] = longer["joints"] + ROBOT["joints"][1:]
    with pytest.raises(edtk.UserError, match="another robot"):
        edtk.predict(STUDY.replace(robot=longer), found, tmp_path / "sheet.csv")
    with pytest.raises(edtk.UserError, match="expected what edtk identify"):
        edtk.predict(study, {"k": 1}, tmp_path / "sheet.csv")
    spoiled = {**found, "geometry": {**found["geometry"], "values": [1.0]}}
    with pytest.raises(edtk.UserError, match="values: expected 33 finite numbers"):
        edtk.predict(study, spoiled, tmp_path / "sheet.csv")


@pytest.mark.cell("`compensate`", "parameters")
@pytest.mark.cell("`compensate` and `predict` name radians, and loads in kilonewtons", "parameters")
def test_commands_bring_the_markers_where_the_drawing_has_them(
    sound: Any, study: Path, tmp_path: Path
) -> None:
    """The erring arm, commanded so, carries its markers where a perfect one would."""
    found = sound
    poses = tmp_path / "poses.csv"
    task = np.random.default_rng(8).uniform(-80, 80, (5, 6))
    np.savetxt(poses, task, delimiter=",", header=",".join(NAMES), comments="")
    out = tmp_path / "commands.csv"
    told = edtk.compensate(study, found, poses, out=out)
    fitted = found.fit.fitted
    drawing = replace(fitted.model, parameters=(), offsets=fitted.placed)
    goal = drawing.see(np.zeros(0), np.deg2rad(task), derivatives=False).points
    asked = StudyGeometry.of(STUDY).model
    true = replace(asked, offsets=OFFSETS, start=PLACE)
    theta = np.random.default_rng(5).normal(0, 0.7, true.p) * true.scales

    def distance(angles: Array) -> Array:
        there = true.see(theta, angles, derivatives=False).points
        return 1e3 * np.sqrt(((there - goal) ** 2).sum(axis=-1).mean(axis=-1))

    before = distance(np.deg2rad(task))
    after = distance(told.command)
    assert (after < 0.25 * before).all()
    # Markers that sit a little apart from where the drawing has them cannot all be brought there.
    floor = 1e3 * told.left
    assert (after < floor + 5e3 * told.remaining).all()
    header = out.read_text().splitlines()[0].split(",")
    assert header[:6] == NAMES
    assert header[-6:-4] == ["uncompensated_mm", "remaining_rms_mm"]
    assert header[-4:] == [*BAND_COLUMNS, *PART_COLUMNS]
    assert "error of the markers before [mm]  after, rms [mm]" in told.summary()
    low, high = told.band.T
    assert ((low < told.remaining) & (told.remaining < high)).all()
    assert json.loads(json.dumps(told.to_dict()))["remaining_band"] == told.band.tolist()
    assert told.plot().get_ylabel() == "error of the markers [mm]"
    assert "<table" in told._repr_html_()
    assert not told.findings
    radians = pd.DataFrame(np.deg2rad(task), columns=NAMES)
    assert [one.kind for one in edtk.compensate(study, found, radians).findings] == ["angle_unit"]
    with pytest.raises(edtk.UserError, match="expected poses"):
        edtk.compensate(study, found)


@pytest.mark.cell("`identify --robust`", "parameters")
def test_a_robust_fit_names_what_it_trusts_less(study: Path, tmp_path: Path) -> None:
    """One wrong pose moves a robust fit less than squares, and is named by both."""
    q, x = truth(60)
    q[7, 2] += 0.2
    sheet = by_pose(tmp_path / "sheet.csv", q[:30], x[:30])
    tests = by_pose(tmp_path / "tests.csv", q[30:], x[30:])
    squares = edtk.identify(study, sheet)
    robust = edtk.identify(study, sheet, robust=True)
    for found in (squares, robust):
        assert any(doubt.kind == "outliers" and 7 in doubt.rows for doubt in found.findings)
    errors = [edtk.predict(study, found, tests).rms_mm for found in (squares, robust)]
    assert errors[1] < errors[0]


def test_rho0_is_the_error_that_parameters_leave_in_the_test_poses(tmp_path: Path) -> None:
    """A study with test poses has rho0, which falls as the root of the number of poses."""
    study = STUDY.replace(test_pose=TEST_POSE)
    q, x = truth(80)
    few = edtk.identify(study, by_pose(tmp_path / "few.csv", q[:20], x[:20]))
    many = edtk.identify(study, by_pose(tmp_path / "many.csv", q, x))
    assert 1.3 < few.rho0_mm / many.rho0_mm < 4
    assert few.to_dict()["rho0_mm"] == few.rho0_mm
    assert "rho0" in few.summary()
    assert edtk.identify(STUDY, tmp_path / "few.csv").rho0_mm is None


def test_a_pose_that_tells_what_no_other_does_counts(tmp_path: Path) -> None:
    """Plans have such poses: far from the drawing, and from what the others can predict."""
    rng = np.random.default_rng(0)
    model = replace(StudyGeometry.of(STUDY).model, offsets=OFFSETS, start=PLACE)
    theta = rng.normal(0, 1.5, model.p) * model.scales
    q = np.array([10, -30, 40, 20, 50, -30]) + rng.uniform(-15, 15, (14, 6))
    q[13] = rng.uniform(-120, 120, 6)
    q = np.round(q, 3)
    x = 1e3 * model.see(theta, np.deg2rad(q), derivatives=False).points
    x += rng.normal(0, 0.02, x.shape)
    found = edtk.identify(STUDY, by_pose(tmp_path / "day.csv", q, x))
    assert found.left_out == ()
    q[4, 2] += 1
    found = edtk.identify(STUDY, by_pose(tmp_path / "typed.csv", q, x))
    assert found.left_out == (4,)
    assert any("as if q3 were typed wrongly" in doubt.words for doubt in found.findings)


def test_joints_whose_zeros_are_far_off_are_calibrated(study: Path, tmp_path: Path) -> None:
    """A controller that counts q2 from elsewhere makes no pose a wrong one, and is named."""
    q, x = truth(30)
    q[:, 1] += 90
    found = edtk.identify(study, by_pose(tmp_path / "sheet.csv", q, x))
    assert found.left_out == ()
    assert found.loo_rms_mm < 0.1
    assert any("the zero of joint q2" in doubt.words for doubt in found.findings)


@pytest.mark.parametrize(
    ("compliance", "load_N", "kind", "verdict"),
    [
        ([], -50.0, "no_springs", "usable"),
        (["q2", "q6"], 0.0, "springs", "usable"),
        (["q2", "q6"], -50.0, "springs", "good"),
    ],
)
def test_springs_and_loads_belong_together(
    compliance: list[str], load_N: float, kind: str, verdict: str, tmp_path: Path
) -> None:
    """Loads without springs, and springs that no load turns, are named; these have no value."""
    study = STUDY.replace(parameters={"compliance": compliance})
    q, x = truth(25)
    sheet = by_pose(tmp_path / "sheet.csv", q, x)
    header, *rows = sheet.read_text().splitlines()
    # The load acts at the tool point, which lies on the last axis.
    loads = [f"{line},{load_N * (i % 2)}" for i, line in enumerate(rows)]
    sheet.write_text("\n".join([f"{header},Fz_N", *loads]))
    found = edtk.identify(study, sheet)
    assert [one.kind for one in found.findings] == [kind]
    assert found.verdict == verdict
    k = found.to_dict()["k"]
    assert [name for name in compliance if k[name] is None] == compliance[load_N != 0 :]


def test_the_text_counts_what_stays_as_drawn(sound: Any) -> None:
    """What cannot be told apart is counted below the parameters."""
    count = len(sound.fit.redundant)
    assert count == 36 + 6 + 9 - 33
    assert f"{count} others cannot be told apart from these" in sound.summary()


@pytest.fixture(scope="module")
def loaded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The result of a study with springs."""
    q, x = truth(25)
    sheet = by_pose(tmp_path_factory.mktemp("loaded") / "sheet.csv", q, x)
    header, *rows = sheet.read_text().splitlines()
    loads = [f"{line},{-50 * (i % 2)}" for i, line in enumerate(rows)]
    sheet.write_text("\n".join([f"{header},Fz_N", *loads]))
    return edtk.identify(SPRUNG, sheet).to_dict()


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"controller": {"sign": {"q2": -1}}}, "geometry.study.shown: the study's controller"),
        ({"load": {"F_N": [0, 0, -50], "at_mm": [100, 0, 0]}}, "study.loads: the study's load"),
        ({"payload": {"mass_kg": 5}}, "study.loads: the study's load point, payload or masses"),
    ],
)
def test_a_study_that_was_changed_since_is_refused(
    loaded: dict[str, Any], keys: dict[str, object], said: str, tmp_path: Path
) -> None:
    """Signs of the controller, the load's place and a payload are those of the result."""
    poses = tmp_path / "poses.csv"
    poses.write_text(f"{','.join(NAMES)}\n10,20,30,-40,50,60\n")
    result = tmp_path / "result.json"
    result.write_text(json.dumps(loaded))
    assert len(edtk.predict(SPRUNG, loaded, poses).data) == 1
    with pytest.raises(edtk.UserError, match=said):
        edtk.predict(SPRUNG.replace(**keys), loaded, poses)
    with pytest.raises(edtk.UserError, match=said):
        edtk.compensate(SPRUNG.replace(**keys), result, poses)
    marks = {"shown": [1e400] * 6, "loads": "x"}
    for name, value in marks.items():
        spoiled = {**loaded, "geometry": {**loaded["geometry"], "study": {name: value}}}
        with pytest.raises(edtk.UserError, match=f"geometry.study.{name}: the study"):
            edtk.predict(SPRUNG, spoiled, poses)


def test_measured_positions_that_are_far_off_are_a_doubt(study: Path, tmp_path: Path) -> None:
    """A swapped marker is named by its row; where all are off, frame and units are asked for."""
    q, x = truth(30)
    found = edtk.identify(study, by_pose(tmp_path / "sheet.csv", q[:22], x[:22]))
    tests = by_pose(tmp_path / "tests.csv", q[22:], x[22:])
    assert edtk.predict(study, found, tests).findings == ()
    swapped = x.copy()
    swapped[25, [0, 1]] = x[25, [1, 0]]
    by_pose(tests, q[22:], swapped[22:])
    (line,) = map(str, edtk.predict(study, found, tests).findings)
    assert line.startswith("row 4: up to")
    by_pose(tests, q[22:], x[22:] + 5)
    code, out, err = run("identify", study, tmp_path / "sheet.csv", "--json")
    (tmp_path / "result.json").write_text(out)
    code, out, err = run("predict", study, tmp_path / "result.json", tests)
    assert code == 0
    assert "is the instrument where it was" in err
    code, out, err = run("predict", study, tmp_path / "result.json", tests, "--tool-rows", 9)
    assert (code, out) == (2, "")
    assert "--tool-rows 9:" in err


def test_poses_beyond_limits_are_named(sound: Any, study: Path, tmp_path: Path) -> None:
    """Predictions say so; commands leave them out, and are refused where none is left."""
    found = sound
    poses = tmp_path / "poses.csv"
    poses.write_text(f"{','.join(NAMES)}\n10,20,30,-40,50,60\n10,999,30,-40,50,60\n")
    assert [one.words for one in edtk.predict(study, found, poses).findings] == [
        "row 2: beyond the joints' limits"
    ]
    part = edtk.compensate(study, found, poses)
    reason = "the desired value 999 is outside the joint's limits -130 .. 130"
    assert part.rows.tolist() == [0]
    assert [row.text for row in part.refused] == [f"row 2, column q2_deg: {reason}"]
    assert part.to_dict()["left_out"][0]["row"] == 2
    assert part.to_frame()["row"].tolist() == [1]
    assert f"1 row left out: row 2, column q2_deg: {reason}" in part.summary()
    poses.write_text(f"{','.join(NAMES)}\n10,999,30,-40,50,60\n")
    with pytest.raises(edtk.UserError, match=f"row 1, column q2_deg: {reason}"):
        edtk.compensate(study, found, poses)


def test_geometry_that_nobody_asked_for_is_no_moved_frame(tmp_path: Path) -> None:
    """Where zeros alone are fitted the drawing is at fault, and a motion is still found."""
    study = STUDY.replace(parameters={"geometry": ["zeros"]})
    q, x = truth(30, 1)
    found = edtk.identify(study, by_pose(tmp_path / "sheet.csv", q, x))
    (doubt,) = [one for one in found.findings if one.kind != "worse_than_placed"]
    assert doubt.kind == "discrepancy"
    assert "the study does not ask for explain" in doubt.words
    x[18:] += [2.0, 1.0, 0.0]
    found = edtk.identify(study, by_pose(tmp_path / "sheet.csv", q, x))
    assert {doubt.kind: doubt.rows for doubt in found.findings}["frame_moved"] == (18,)


@pytest.mark.parametrize("value", ["", "0"])
def test_a_sheet_that_nobody_filled_in(value: str, study: Path, tmp_path: Path) -> None:
    """Empty cells, and zeros alone, are one line."""
    sheet = by_pose(tmp_path / "sheet.csv", *truth(3))
    header, *rows = sheet.read_text().splitlines()
    empty = [",".join([*row.split(",")[:6], *[value] * 9]) for row in rows]
    sheet.write_text("\n".join([header, *empty]))
    with pytest.raises(edtk.UserError, match="no position of a marker is filled in"):
        edtk.identify(study, sheet)


def test_too_few_poses_to_judge_by(sound: Any, study: Path, tmp_path: Path) -> None:
    """Where poses left out are far off nothing speaks for the fit, or they cannot be left out."""
    q, x = truth(30)
    six = edtk.identify(study, by_pose(tmp_path / "six.csv", q[:6], x[:6]))
    assert six.verdict == "bad"
    assert "and by the drawing" in six.findings[0].words
    five = edtk.identify(study, by_pose(tmp_path / "five.csv", q[:5], x[:5]))
    assert {"few_poses", "alone"} <= {doubt.kind for doubt in five.findings}
    assert sound.findings == ()


def test_poses_in_radians_are_doubted_where_nothing_is_measured(sound: Any) -> None:
    """Bands say nothing of a unit: radians for degrees are a warning, degrees are none."""
    q, _ = truth(25)
    for shown, count in ((np.deg2rad(q), 1), (np.deg2rad(q[:1]), 1), (q, 0), (q[:1], 0)):
        poses = pd.DataFrame(shown, columns=[f"q{i}_deg" for i in range(1, 7)])
        kinds = [one.kind for one in edtk.predict(STUDY, sound, poses).findings]
        assert kinds.count("angle_unit") == count


def test_a_fit_that_runs_away_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where a fit ends among parameters that do not differ, it says what may be wrong."""

    def runs_away(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError

    monkeypatch.setattr("edtk.calibration.calibrate_geometry.fit_geometry", runs_away)
    with pytest.raises(edtk.UserError, match="no geometry near the drawing fits: is it this robot"):
        edtk.identify(STUDY, by_pose(tmp_path / "sheet.csv", *truth(12)))
