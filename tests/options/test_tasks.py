"""Tasks of studies of geometry: harm by differences, springs alone, and the second checker."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from small_arm import ROBOT

import edtk
from edtk.calibration.evaluate_geometry import GeometryDesigns
from edtk.calibration.geometry_question import GeometryQuestion
from edtk.calibration.geometry_space import PositionRows
from edtk.calibration.planned import SpringDesigns
from edtk.design.plan import Plan
from edtk.measure.equilibrium import resting_load
from edtk.measure.parameters import Parameter
from edtk.measure.task import Task
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry
from edtk.system.typing import Array

MARKERS = [
    {"name": "A", "position_mm": [90, 10, 50]},
    {"name": "B", "position_mm": [-30, 70, 40]},
    {"name": "C", "position_mm": [0, -60, 100]},
]
POSE = {"q_deg": [10, 20, -30, 40, 50, 60], "load": {"F_N": [30, 0, -200], "T_Nm": [5, 0, 0]}}
TOOL = {"position_mm": [30, -20, 150], "rpy_deg": [10, 0, 20]}
PAYLOAD = {"mass_kg": 6, "center_mm": [15, 0, 80]}
STUDY = Study(
    robot=ROBOT
    | {"joints": [{**j, "mass_kg": 4, "center_m": [0.1, 0, 0]} for j in ROBOT["joints"]]},
    load={"F_N": [0, 0, -150], "at_mm": [0, 40, 20]},
    payload={"mass_kg": 3, "center_mm": [10, 5, 60]},
    measurement={"sigma_mm": 0.02},
    parameters={"compliance": ["q2", "q3"], "geometry": "all"},
    marker=MARKERS,
    candidates=200,
)
KINDS: dict[str, dict[str, Any]] = {
    "markers": {},
    "tool": {"tool": TOOL},
    "payload": {"payload": PAYLOAD},
    "everything": {"tool": TOOL, "payload": PAYLOAD, "lever_mm": 300},
    "turns of markers": {"lever_mm": 250},
}


def by_differences(question: GeometryQuestion, task: Task, keys: dict[str, Any]) -> Array:
    """The harm (p, p) of a task's parameters in its pose, by differences of what is seen."""
    model = question.model
    setting = question.setting
    tool = task.tool
    robot = model.robot if tool is None else model.robot.with_tool(tool)
    seen_by = replace(model, rows="pose")
    if tool is not None:
        seen_by = replace(seen_by, robot=robot, offsets=np.zeros((len(MARKERS), 3)))
    loads = setting.loads
    assert loads is not None
    q = task.q[None]
    torque = loads(q, task.wrench[None])
    if keys.get("tool") or keys.get("payload"):
        frames = robot.frames(q, tuple(range(6)))
        wrench = loads.by_wrench if tool is None else replace(loads.by_wrench, robot=robot)
        point = loads.by_wrench.load_point if tool is None else type(loads.by_wrench.load_point)()
        torque = replace(wrench, load_point=point).torque_of(frames, task.wrench[None]).T
        assert task.dead_weights is not None
        assert task.dead_weights.carried.max() >= PAYLOAD["mass_kg"] * bool(keys.get("payload"))
        torque = torque + task.dead_weights.torque(frames).T
    h = 1e-3
    k = len(MARKERS)

    def at(theta: Array) -> tuple[Array, Array]:
        moved = theta * model.scales
        if tool is not None:  # which is on the last joint, wherever markers are
            moved = moved * [one.place != "tool" for one in model.parameters]
        seen = seen_by.see(moved, q, torque, False)
        return seen.points[0], seen.turns[0, 0]

    rows = []
    for step in h * np.eye(model.p):
        (x1, R1), (x0, R0) = at(step), at(-step)
        turn = (R1 - R0) @ at(np.zeros(model.p))[1].T / (2 * h)
        w = np.array([turn[2, 1], turn[0, 2], turn[1, 0]])
        rows.append(np.append(np.ravel(x1 - x0) / (2 * h * np.sqrt(k)), task.lever * w))
    A = np.array(rows).T
    return np.asarray(A.T @ A)


@pytest.mark.cell("`lever_mm`, rotations of the tool", "parameters")
@pytest.mark.parametrize("name", KINDS)
def test_harm_is_that_of_differences(name: str) -> None:
    """Tool, payload, lever and markers: the target is that of differences of what is seen."""
    study = STUDY.replace(test_pose=POSE | KINDS[name])
    question = GeometryQuestion.of(study)
    task = question.tasks[0]
    expected = by_differences(question, task, KINDS[name])
    found = task.target.T @ task.target
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()


@pytest.mark.cell("`robust_deg`, a neighbourhood of poses", "parameters")
def test_a_neighbourhood_is_the_mean_over_its_poses() -> None:
    """The target of `robust_deg` is the mean of the harms in all poses of the neighbourhood."""
    study = STUDY.replace(test_pose=POSE | KINDS["everything"] | {"robust_deg": 20})
    question = GeometryQuestion.of(study)
    task = question.tasks[0]
    alone = [replace(task, q=q, within=0.0).target for q in task.poses]
    expected = np.mean([A.T @ A for A in alone], axis=0)
    found = task.target.T @ task.target
    assert len(alone) == 255
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())


LOAD = {"F_N": [0, 0, -200]}
SPRINGS = Study(
    robot=ROBOT,
    tool={"position_mm": [0, 0, 100]},
    load=LOAD,
    measurement={"sigma_mm": 0.05},
    joints={"unknown": ["q2", "q3", "q4"]},
    test_pose=[
        {"q_deg": [10, 20, -30, 40, 50, 60], "load": LOAD, "tool": TOOL, "lever_mm": 200},
        {"q_deg": [0, 40, 30, 0, 50, 0], "load": LOAD, "tool": TOOL, "weight": 2, "robust_deg": 9},
        {"q_deg": [0, 40, 30, 0, 50, 0], "tool": TOOL, "payload": PAYLOAD},
    ],
    candidates=300,
)
TWIN = SPRINGS.replace(
    joints=None,
    parameters={"compliance": ["q2", "q3", "q4"], "geometry": [], "base": False, "tool": False},
)


@pytest.mark.cell("several `[[test_pose]]`, and `rho_max`")
def test_springs_alone_have_one_target() -> None:
    """A study of springs and its twin with [parameters] have the same A0, rho0 and rho_max."""
    question = GeometryQuestion.of(TWIN)
    A0 = SPRINGS.target
    assert A0 is not None
    twin = question.target
    assert twin is not None
    scales = question.model.scales
    expected = scales[:, None] * (A0.T @ A0) * scales
    np.testing.assert_allclose(twin.T @ twin, expected, rtol=1e-12, atol=1e-25)
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (5, 6))
    plan = edtk.Plan(q, np.tile([0.0, 0, -200, 0, 0, 0], (5, 1)), np.ones(5, dtype=int))
    both = [edtk.evaluate(study, plan) for study in (SPRINGS, TWIN)]
    for name in ("rho0", "rho_max"):
        values = [found.criteria[name] for found in both]
        assert values[0] == pytest.approx(values[1], rel=1e-10)
    around = [(found.expected.mean, found.expected.largest) for found in both]
    assert around[0] == pytest.approx(around[1], rel=1e-10)
    np.testing.assert_allclose(both[0].tasks.error, both[1].tasks.error, rtol=1e-10)
    np.testing.assert_allclose(both[0].tasks.band, both[1].tasks.band, rtol=1e-8)


@pytest.mark.parametrize("criterion", ["rho0", "rho_max"])
def test_the_second_checker_finds_the_targets(criterion: str, tmp_path: Path) -> None:
    """`edtk verify` recomputes tools, payloads, levers and neighbourhoods, and finds a forgery."""
    poses = [POSE | keys | {"weight": i + 1} for i, keys in enumerate(KINDS.values())]
    poses[1] |= {"robust_deg": 15}
    study = STUDY.replace(test_pose=poses)
    path = tmp_path / "proof.json"
    edtk.relax(study, criterion, certificate=path)
    content = json.loads(path.read_text())
    found = edtk.verify(content, study)
    assert found.valid, found.summary()
    for key, value in (("lever", 0.31), ("within", 0.3)):
        forged = json.loads(path.read_text())
        place = 3 if key == "lever" else 1
        forged["setting"]["test_pose"][place][key] = value
        assert not edtk.verify(forged, study).valid


@pytest.mark.cell("`[task]`, a path from a file", "parameters")
def test_a_path_is_its_poses(tmp_path: Path) -> None:
    """A path from a file is as many test poses, for plans and for the expected error."""
    rows = [[10, 20, -30, 40, 50, 60], [20, 30, -20, 30, 40, 50]]
    header = ",".join(f"q{i}_deg" for i in range(1, 7))
    text = "\n".join([header, *(",".join(map(str, row)) for row in rows)])
    (tmp_path / "path.csv").write_text(text)
    keys = {"tool": TOOL, "payload": PAYLOAD, "lever_mm": 100}
    table = {"file": "path.csv", "load": POSE["load"], **keys}
    poses = [{"q_deg": row, "load": POSE["load"], **keys} for row in rows]
    path = GeometryQuestion.of(STUDY.replace(task=table, folder=tmp_path))
    several = GeometryQuestion.of(STUDY.replace(test_pose=poses))
    assert path.target is not None
    assert several.target is not None
    np.testing.assert_array_equal(path.target, several.target)


def visited(study: Study, seed: int) -> tuple[pd.DataFrame, Array]:
    """A day of one arm: its sheet, and the parameters that it has."""
    setting = StudyGeometry.of(study)
    model = GeometryQuestion.of(study).structural
    rng = np.random.default_rng(seed)
    theta = np.array(
        [rng.uniform(2, 9) if p.place == "compliance" else rng.normal() for p in model.parameters]
    )
    theta = theta * model.scales
    q = np.deg2rad(np.round(rng.uniform(-95, 95, (24, 6)), 3))
    wrench = np.tile([[0.0, 0, 0, 0, 0, 0], [0, 0, -150, 0, 0, 0]], (12, 1))
    torque = resting_load(model.bending(theta), q, wrench, setting.loads)
    x = 1e3 * model.see(theta, q, torque, derivatives=False).points
    x += rng.normal(0, 0.02, x.shape)
    table = Plan(q, wrench, np.ones(24, dtype=int)).to_frame(study.robot).drop(columns="repeats")
    for i, name in enumerate("ABC"):
        table[[f"{name}{axis}_mm" for axis in "xyz"]] = x[:, i]
    return table, theta


@pytest.mark.cell("`payload` in a test pose", "parameters")
def test_commands_bring_a_tool_where_the_drawing_has_it() -> None:
    """Tool and payload of the study's own poses: the true arm misses by what is promised."""
    stiff = {"rigid_rad_per_Nm": dict.fromkeys(["q1", "q4", "q5", "q6"], 1e-12)}
    exact = {"load_percent": 0, "load_direction_deg": 0} | stiff
    poses = [POSE | KINDS[name] for name in ("everything", "tool")]
    study = STUDY.replace(test_pose=poses, uncertainty=exact)
    sheet, theta = visited(study, 1)
    found = edtk.identify(study, sheet)
    told = edtk.compensate(study, found)
    assert told.rotation is not None
    assert told.left.max() < 1e-9
    setting = StudyGeometry.of(study)
    model = GeometryQuestion.of(study).structural
    moves = [one.place != "tool" for one in model.parameters]
    for i, task in enumerate(study.tasks):
        assert task.tool is not None
        drawn = found.fit.fitted.model.at_tool(task.tool).with_parameters(())
        goal = drawn.see(np.zeros(0), task.q[None], derivatives=False).points
        errors = []
        for q in (task.q[None], told.command[i][None]):
            k = model.bending(theta)
            torque = resting_load(k, q, task.wrench[None], setting.loads_of(task))
            arm = model.at_tool(task.tool)
            at = arm.see(theta[moves], q, torque, derivatives=False).points
            errors.append(float(np.linalg.norm(at - goal)))
        assert errors[1] < 0.1 * errors[0]
        assert errors[1] < 3 * told.remaining[i]
    # In the pose without a lever that is its rho0, and what the residuals show besides.
    accuracy = found.tasks
    assert accuracy is not None
    assert told.remaining[1] == pytest.approx(accuracy.error[1], rel=0.2)


def test_poses_of_a_file_need_one_tool() -> None:
    """Test poses of several tools are compensated themselves, and no others."""
    study = STUDY.replace(test_pose=[POSE | KINDS[name] for name in ("markers", "tool")])
    found = edtk.identify(study, visited(study, 2)[0])
    assert len(edtk.compensate(study, found).command) == 2
    poses = pd.DataFrame([POSE["q_deg"]], columns=[f"q{i}_deg" for i in range(1, 7)])
    with pytest.raises(edtk.UserError, match="the test poses have different tools"):
        edtk.compensate(study, found, poses)


SOFT = {"compliance_rad_per_Nm": {"q2": 3e-6, "q3": 4e-6, "q4": 5e-6}}
K_SOFT = np.array([3e-6, 4e-6, 5e-6])


def visits(repeats: int) -> Plan:
    """Eight loaded visits, each so often."""
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (8, 6))
    wrench = np.tile([0.0, 0, -200, 0, 0, 0], (8, 1))
    return Plan(q, wrench, np.full(8, repeats))


@pytest.mark.cell("the error budget of a plan", "parameters")
@pytest.mark.parametrize(
    "share", [0, 7, None], ids=["ideal springs", "springs that err", "nothing said"]
)
@pytest.mark.parametrize("known", [{}, {"q1": {"value": 2e-6, "std": 1e-6}}], ids=["", "known"])
def test_springs_alone_have_one_budget(share: float | None, known: dict[str, Any]) -> None:
    """Noise, load, model and joints that are not identified do the same in a study and its twin.

    In the twin a known compliance is a parameter of which something is known.
    """
    robot = STUDY.to_dict()["robot"]
    nominal = {"sigma_mm": 0.05, "reference": "nominal"}
    noise = {} if share is None else {"model_error_percent": share}
    given = {"known_rad_per_Nm": known}
    joints = {"unknown": ["q2", "q3", "q4"]} | given
    springs = SPRINGS.replace(
        joints=joints, simulation=SOFT, robot=robot, measurement=nominal, noise=noise
    )
    question = GeometryQuestion.of(
        TWIN.replace(joints=given, simulation=SOFT, robot=robot, noise=noise)
    )
    plan = visits(2)
    designs = SpringDesigns(springs), GeometryDesigns(question.study, question)
    expected, found = (one.error_budget(plan) for one in designs)
    assert expected is not None
    assert found is not None
    held = [one.held(one.study.tasks, plan) for one in designs]
    assert bool(held[0]) == (share != 0)
    assert held[1] == pytest.approx(held[0], rel=1e-9)
    assert found.assumed_share == expected.assumed_share == (0.1 if share is None else None)
    for name in ("noise", "model", "load", "rigid_joints", "known_joints", "uncompensated"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=1e-8, abs=1e-15)
    assert found.rigid_joints > 0 < found.load
    joints = [(one.joint.name, one.error, one.told) for one in found.joints]
    assert joints == [
        (one.joint.name, pytest.approx(one.error, rel=1e-8), pytest.approx(one.told, rel=1e-8))
        for one in expected.joints
    ]


@pytest.mark.cell("`[noise] discrepancy_mm`, the model's error, stated", "parameters")
def test_what_the_model_leaves_out_does_not_average_out() -> None:
    """Its part is that of all visits' errors together, of which those of a pose are shared."""
    d, sigma, r = 0.03, 0.02, 3
    noise = {"discrepancy_mm": d}
    study = STUDY.replace(noise=noise, simulation=SOFT, test_pose=POSE | KINDS["tool"])
    question = GeometryQuestion.of(study)
    rng = np.random.default_rng(1)
    wrench = np.tile([[0.0, 0, 0, 0, 0, 0], [0, 0, -150, 0, 0, 0]], (10, 1))
    plan = Plan(rng.uniform(-1.6, 1.6, (20, 6)), wrench, np.full(20, r))
    rows = question.rows(plan.q, plan.wrench)
    A = np.repeat(rows, r, axis=0).reshape(-1, question.model.p)
    shared = np.kron(np.eye(20), np.kron(np.ones((r, r)), np.eye(9)))
    A0 = question.tasks.target
    squares = []
    for size in (0.0, d):
        V = sigma**2 * np.eye(len(A)) + size**2 * shared
        squares.append(np.trace(A0 @ np.linalg.inv(A.T @ np.linalg.solve(V, A)) @ A0.T))
    found = GeometryDesigns(study, question).error_budget(plan)
    assert found is not None
    assert found.noise == pytest.approx(np.sqrt(squares[0]), rel=1e-6)
    model = np.sqrt(squares[1] - squares[0] + 3e-6 * d**2)
    assert found.model == pytest.approx(model, rel=1e-6)
    assert found.tool == 0.0  # an unknown place of a marker is found where it is


def test_known_markers_that_are_elsewhere_mislead() -> None:
    """Where markers count as known, the part of the tool is the bias of least squares."""
    parameters = {"compliance": ["q2", "q3"], "geometry": "all", "tool": False}
    given = {"tool_mm": 2.0, "load_percent": 0, "load_direction_deg": 0}
    keys = {"parameters": parameters, "uncertainty": given, "simulation": SOFT}
    wrench = np.tile([[0.0, 0, 0, 0, 0, 0], [0, 0, -150, 0, 0, 0]], (10, 1))
    q = np.random.default_rng(2).uniform(-1.6, 1.6, (20, 6))
    plan = Plan(q, wrench, np.ones(20, dtype=int))
    for name in ("tool", "markers"):
        question = GeometryQuestion.of(STUDY.replace(**keys, test_pose=POSE | KINDS[name]))
        found = GeometryDesigns(question.study, question).error_budget(plan)
        assert found is not None
        every = question.setting.model.with_parameters(
            tuple(Parameter("tool", m, axis) for m in "ABC" for axis in "xyz")
        )
        A = question.rows(plan.q, plan.wrench).reshape(-1, question.model.p)
        moved = PositionRows(every, question.setting.loads)(plan.q, plan.wrench)
        by_axis = moved.reshape(len(A), 3, 3).sum(axis=1)  # all markers together
        shifts = np.linalg.lstsq(A, 2.0 * by_axis, rcond=None)[0]
        there = question.setting.columns(question.tasks[0], every)(question.tasks[0].q, False)
        own = 2.0 * there.reshape(-1, 3, 3).sum(axis=1) if name == "markers" else 0.0
        error = question.tasks[0].target @ shifts - own
        assert found.tool == pytest.approx(np.linalg.norm(error), rel=1e-6)


@pytest.mark.cell("`bias` of the linear model", "parameters")
def test_a_bias_of_the_linear_model_is_of_springs_alone() -> None:
    """Geometry is fitted by no linear model, which is why there is no answer."""
    with pytest.raises(edtk.UserError, match="by no linear model that could be biased"):
        edtk.bias(TWIN.replace(simulation=SOFT), visits(1))


@pytest.mark.cell("`compensate`")
def test_springs_have_one_command() -> None:
    """Commands in closed form are those that a search finds, with the same tools and payloads."""
    rng = np.random.default_rng(3)
    wrench = np.tile([0, 0, -200.0, 0, 0, 0], (14, 1))
    q = np.round(rng.uniform(-1.4, 1.4, (14, 6)), 3)
    sheet = edtk.template(SPRINGS, Plan(q, wrench, np.ones(14, dtype=int)))
    moved = SPRINGS.model.regressor(np.deg2rad(sheet.iloc[:, :6].to_numpy()), wrench) @ K_SOFT
    sheet[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * (moved + rng.normal(0, 5e-5, moved.shape))
    result = edtk.identify(TWIN, sheet).to_dict()
    assert result["geometry"]["names"] == ["k_q2", "k_q3", "k_q4"]
    result["geometry"]["values"] = (1e6 * K_SOFT).tolist()
    searched = edtk.compensate(TWIN, result)
    closed = edtk.compensate(SPRINGS, dict(zip(("q2", "q3", "q4"), K_SOFT.tolist(), strict=True)))
    assert np.abs(closed.command - closed.desired).max() > 1e-4
    np.testing.assert_allclose(searched.command, closed.command, rtol=0, atol=1e-9)
    assert searched.left.max() < 1e-9
