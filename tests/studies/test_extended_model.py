"""`identify --extend` finds what a robot simulated apart from edtk has beside ideal springs."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

import edtk
from edtk.cli import main
from edtk.robots.load_robot import load_robot
from edtk.study.study_geometry import StudyGeometry
from edtk.system.errors import UserError

ROBOT = load_robot("kuka_kr270_compensator")
JOINTS = ["q2", "q3", "q4", "q5", "q6"]
K = np.array([0, 3e-7, 4e-7, 2.8e-6, 2.8e-6, 2.1e-6])
TOOL = {"position_mm": [611.5, 0, -460]}
SIGMA = 0.01  # [mm]
STUDY = edtk.Study(
    robot="kuka_kr270",
    tool=TOOL,
    load={"list_F_N": [[0, 0, -2500], [0, 1500, 0], [0, 0, -1000]]},
    measurement={"sigma_mm": SIGMA},
    joints={"unknown": JOINTS, "fixed_deg": {"q1": 0}},
    test_pose={
        "q_deg": [0, -57, 89, 45, 76, 57],
        "tool": {"position_mm": [986, 0, 0]},
        "load": {"F_N": [0, 280, -180]},
    },
)
POSES = np.random.default_rng(5).uniform(*ROBOT.limits, size=(24, 6)) * [0, 1, 1, 1, 1, 1]
LOADS = np.tile(np.pad([[0, 0, -2500.0], [0, 1500, 0], [0, 0, -1000]], ((0, 0), (0, 3))), (8, 1))


@pytest.fixture(scope="module")
def plain(ideal_arm):
    """A KR 270 of ideal springs, of which joint 1 is rigid."""
    return ideal_arm(STUDY.robot, K)


def tips(simulation, arm, q, wrench=None):
    """Tool points (m, 3) of a bent arm; of a rigid one without a wrench."""
    rest = None if wrench is None else arm.rest(q, wrench)
    return arm.points(q, [simulation.Point()], rest)[:, 0]


def sheet_of(moved, seed=0):
    """A sheet of displacements [m], with noise."""
    noise = SIGMA * np.random.default_rng(seed).standard_normal(moved.shape)
    table = pd.DataFrame(np.rad2deg(POSES), columns=[f"q{j}_deg" for j in range(1, 7)])
    table[["Fx_N", "Fy_N", "Fz_N"]] = LOADS[:, :3]
    table[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * moved + noise
    return table


def day(simulation, arm, seed=0):
    """A sheet of loaded less unloaded positions."""
    before = tips(simulation, arm, POSES, np.zeros_like(LOADS))
    return sheet_of(tips(simulation, arm, POSES, LOADS) - before, seed)


@pytest.mark.slow
@pytest.mark.cell("`identify --extend`", "springs")
def test_the_true_model_is_found_and_its_springs(simulation, plain):
    """Of a bearing that bends and a spring that stiffens both are found, with their sizes."""
    stiffer = simulation.Law(1, "cubic", -4e-15)
    arm = plain.replace(compliance=np.append(K, 1.2e-7), elastic=((2, "rx"),), laws=(stiffer,))
    found = edtk.identify(STUDY, day(simulation, arm), extend=True)
    models = found.extension
    assert set(models.chosen.pieces) == {"q3.rx", "q2.cubic"}
    assert models.chosen.weight > 0.5
    assert sum(one.weight for one in models.models) <= 1 + 1e-9
    own = found.parameters
    for name, true in {"k_q3.rx": 0.12, "k_q2.cubic": -4e-3, "k_q2": 0.3}.items():
        assert own[name]["value"] == pytest.approx(true, abs=4 * own[name]["std"])
    ideal = next(one for one in models.models if not one.pieces)
    assert ideal.left_out > 3 * models.chosen.left_out
    assert models.chosen.left_out == pytest.approx(found.fit.loo_rms, rel=0.3)
    # Commands by the chosen model: the simulated arm errs by what is expected, or less.
    task = STUDY.tasks[0]
    commands = edtk.compensate(models.study, found)
    at_tool = arm.replace(tool=task.placed.tool)
    there = tips(simulation, at_tool, np.atleast_2d(commands.command), task.wrench[None])
    wanted = task.placed.forward(task.q)[:3, 3]
    assert np.linalg.norm(there[0] - wanted) < 2.5 * models.expected
    assert models.undecided < models.expected


@pytest.mark.slow
def test_ideal_springs_are_enough_for_ideal_springs(simulation, plain):
    """The plain model is chosen, and the error of the headline has what remains undecided."""
    sheet = day(simulation, plain)
    found = edtk.identify(STUDY, sheet, extend=True)
    alone = edtk.identify(STUDY, sheet)
    assert found.extension.chosen.pieces == ()
    assert found.extension.chosen.weight > 0.5
    np.testing.assert_array_equal(found.fit.k, alone.fit.k)
    total = np.hypot(alone.budget.total, found.extension.undecided)
    assert found.budget.total == pytest.approx(total)


@pytest.mark.slow
def test_files_of_an_extended_result_command_the_robot(simulation, plain, tmp_path):
    """A sheet of positions needs a compensator: its files say so, and commands are right by it."""
    masses = tuple(
        simulation.Mass(link.mass, simulation.Point(j, link.center))
        for j, link in enumerate(ROBOT.links)
    )
    (pull,) = ROBOT.pulls
    given = pull.given
    spring = simulation.Compensator(
        pull.place, given.before, given.behind, given.preload, given.stiffness
    )
    arm = plain.replace(masses=masses, compensators=(spring,))
    bare = replace(ROBOT, compensators=())
    study = STUDY.replace(robot=bare, measurement={"sigma_mm": SIGMA, "reference": "nominal"})
    moved = tips(simulation, arm, POSES, LOADS) - tips(simulation, arm, POSES)
    study.to_toml(tmp_path / "study.toml")
    sheet_of(moved).to_csv(tmp_path / "day.csv", index=False)
    out = tmp_path / "out"
    words = ["identify", tmp_path / "study.toml", tmp_path / "day.csv", "--extend", "--out", out]
    shown = CliRunner().invoke(main, [*map(str, words)])
    assert shown.exit_code == 0, shown.output
    assert "which model the sheet needs" in shown.output
    assert "Which model does the sheet need?" in (out / "report.html").read_text()
    said = json.loads((out / "k.json").read_text())["extension"]
    assert "compensator.q2" in said["chosen"]
    assert {"models", "tried", "inclusion", "undecided", "undecided_mm", "expected_mm"} < set(said)
    assert said["models"][0]["weight"] >= said["models"][1]["weight"]
    task = STUDY.tasks[0]
    commands = edtk.compensate(out / "extended.toml", out / "k.json")
    at_tool = arm.replace(tool=task.placed.tool)
    there = tips(simulation, at_tool, np.atleast_2d(commands.command), task.wrench[None])
    off = np.linalg.norm(there[0] - task.placed.forward(task.q)[:3, 3])
    assert 1e3 * off < 2.5 * said["expected_mm"]
    assert off < 1e-4  # the plain model leaves 0.8 mm


VISITS = STUDY.replace(
    parameters={"springs": JOINTS, "geometry": [], "base": False, "tool": False},
    joints={"fixed_deg": {"q1": 0}},
    marker=[{"name": "A"}],
    measurement={"sigma_mm": SIGMA / np.sqrt(2), "reference": "unloaded"},
    uncertainty={"load_percent": 0, "load_direction_deg": 0, "tool_mm": 0}
    | {"rigid_rad_per_Nm": {"q1": 1e-15}},
)


@pytest.mark.slow
@pytest.mark.cell("`identify --extend`", "parameters")
@pytest.mark.parametrize("pieces", [(), ("q3.rx",)], ids=["ideal", "bending"])
def test_a_study_with_parameters_weighs_the_same_models(simulation, plain, tmp_path, pieces):
    """Of the same day it finds the same pieces, as likely, with the same errors to expect.

    Rows are those where the arm rests by the fit without pieces, of which both kinds of study
    linearise by themselves: what is told of pieces differs by a few per cent.
    """
    soft = plain.replace(compliance=np.append(K, 1.2e-7), elastic=((2, "rx"),))
    table = day(simulation, soft if pieces else plain)
    out = tmp_path / "out"
    found = edtk.identify(VISITS, table.assign(marker="A"), extend=True, out=out)
    own, other = found.extension, edtk.identify(STUDY, table, extend=True).extension
    assert own.chosen.pieces == other.chosen.pieces == pieces
    assert own.chosen.weight == pytest.approx(other.chosen.weight, abs=0.1)
    scores, others = (
        {one.pieces: one.weighed.score for one in models.models} for models in (own, other)
    )
    if pieces:
        gained = others[()] - others[pieces]
        assert scores[()] - scores[pieces] == pytest.approx(gained, rel=0.05)
    else:
        assert scores[()] == pytest.approx(others[()], rel=2e-3)
    assert own.chosen.left_out == pytest.approx(other.chosen.left_out, rel=0.02)
    assert own.chosen.left_out == pytest.approx(found.fit.loo_rms, rel=0.1)
    assert own.chosen.expected == pytest.approx(other.chosen.expected, rel=0.1)
    direct = edtk.compensate(own.study, found).command
    if pieces:
        read = edtk.compensate(out / "extended.toml", out / "k.json").command
        np.testing.assert_allclose(read, direct, rtol=1e-9)


@pytest.mark.parametrize(
    "asked", [{"compliance": JOINTS}, {"springs": "joints"}, {"springs": ["lateral", "q2.cubic"]}]
)
def test_springs_that_are_asked_for_stay(simulation, plain, asked):
    """However they are named, the study of the chosen model has them, and each once."""
    table = day(simulation, plain.replace(laws=(simulation.Law(1, "square", 3e-11),)))
    others = {"geometry": [], "base": False, "tool": False}
    study = VISITS.replace(parameters=asked | others)
    extended = edtk.identify(study, table.assign(marker="A"), extend=True).extension
    before, after = (
        {one.name for one in StudyGeometry.of(one).model.parameters}
        for one in (study, extended.study)
    )
    assert after == before | {f"k_{name}" for name in extended.chosen.pieces}


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"springs": None, "geometry": ["q2.rz"]}, "no spring is told"),
        ({"springs": JOINTS, "geometry": []}, "leave known values and"),
    ],
)
def test_what_no_pieces_stand_beside_is_said(simulation, plain, keys, words):
    """Where nothing is told of a spring, or known before of one, it is one line."""
    asked = {"base": False, "tool": False} | {k: v for k, v in keys.items() if v is not None}
    known = {"known_rad_per_Nm": {"q1": {"value": 1e-7, "std": 1e-8}}} if keys["springs"] else {}
    study = STUDY.replace(
        parameters=asked,
        joints={"fixed_deg": {"q1": 0}, **known},
        marker=[{"name": "A"}],
        measurement={"sigma_mm": SIGMA},
    )
    table = day(simulation, plain).assign(marker="A")
    if not keys["springs"]:
        table[["x_mm", "y_mm", "z_mm"]] = 1e3 * tips(simulation, plain, POSES)
        table = table.drop(columns=["dx_mm", "dy_mm", "dz_mm"])
    with pytest.raises(UserError, match=words):
        edtk.identify(study, table, extend=True)
