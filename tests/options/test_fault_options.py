"""Plans beside sheets, causes and detection answer for springs and for geometry alike."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from geometry_sheets import NAMES, OFFSETS, PLACE, STUDY, run
from readings import STUDY as DISPLACEMENTS

import edtk
from edtk.calibration.detect import Promised, detect, sized_faults
from edtk.calibration.geometry_plan import visited
from edtk.calibration.geometry_question import GeometryQuestion
from edtk.calibration.geometry_space import PositionRows
from edtk.findings.causes.faults import FAULTS, cause_wording
from edtk.findings.finding import Finding
from edtk.findings.geometric_fit import geometric_findings
from edtk.fit.fit_geometry import fit_geometry
from edtk.fit.fitted_geometry import loading_in
from edtk.fit.marker_positions import MarkerPositions
from edtk.study.study_geometry import StudyGeometry, planned_noise
from edtk.system.errors import UserError
from edtk.system.typing import Array

LOADED = STUDY.replace(
    parameters={"compliance": ["q2", "q3"], "geometry": "all"}, load={"F_N": [0, 0, -50]}
)
K = np.array([0, 3e-6, 4e-6, 0, 0, 0])


def planned(count: int, loaded: int) -> edtk.Plan:
    """Poses of which the last are under a load."""
    rng = np.random.default_rng(3)
    q = np.deg2rad(np.round(rng.uniform(-100, 100, (count, 6)), 3))
    wrench = np.zeros((count, 6))
    wrench[count - loaded :, 2] = -50.0
    return edtk.Plan(q, wrench, np.ones(count, dtype=int))


def measured(plan: edtk.Plan) -> pd.DataFrame:
    """The sheet of a plan, as `edtk.template` makes it, filled in by an erring arm."""
    setting = StudyGeometry.of(LOADED)
    model = replace(setting.model, offsets=OFFSETS, start=PLACE)
    rng = np.random.default_rng(5)
    theta = rng.normal(0, 0.5, model.p) * model.scales
    sheet = edtk.template(LOADED, plan)
    q = np.deg2rad(sheet[NAMES].to_numpy())
    wrench = np.zeros((len(q), 6))
    wrench[:, 2] = sheet["Fz_N"]
    bent = q + K * setting.loads(q, wrench)
    x = model.see(theta, bent, derivatives=False).points
    marker = sheet["marker"].map("ABC".index).to_numpy()
    seen = x[np.arange(len(sheet)), marker] + rng.normal(0, 2e-5, (len(sheet), 3))
    return sheet.assign(**{f"{a}_mm": 1e3 * seen[:, i] for i, a in enumerate("xyz")})


@pytest.mark.cell("`identify --plan`", "parameters")
def test_a_sheet_of_geometry_is_compared_with_its_plan(tmp_path: Path) -> None:
    """A day as planned has no finding of it; a visit left out is named by its row of the plan."""
    plan = planned(30, 10)
    sheet = measured(plan)
    kinds = {"not_measured", "other_pose", "other_load", "force_unit"}
    whole = edtk.identify(LOADED, sheet, plan=plan)
    assert not kinds & {one.kind for one in whole.findings}
    q = np.deg2rad(sheet[NAMES].to_numpy())
    gone = np.abs(q - plan.q[7]).max(axis=1) < 1e-6
    assert gone.sum() == 3  # a row for each marker
    said = edtk.identify(LOADED, sheet[~gone], plan=plan).findings
    assert [one.rows for one in said if one.kind in kinds] == [(7,)]
    assert any(one.words == "row 8 of the plan: not measured" for one in said)


@pytest.mark.cell("`identify --as-is`", "parameters")
def test_a_visit_that_is_not_planned_is_refused_or_named(tmp_path: Path) -> None:
    """Another pose is an error with its row and column; with --as-is it is an alarm."""
    plan = planned(30, 10)
    sheet = measured(plan)
    q = sheet[NAMES].to_numpy()
    place = np.flatnonzero(np.abs(np.deg2rad(q) - plan.q[4]).max(axis=1) < 1e-6)
    sheet.loc[place, "q3_deg"] += 0.05
    LOADED.to_toml(tmp_path / "study.toml")
    plan.to_frame(LOADED.robot).to_csv(tmp_path / "plan.csv", index=False)
    sheet.to_csv(tmp_path / "day.csv", index=False)
    words = ["identify", tmp_path / "study.toml", tmp_path / "day.csv"]
    code, out, error = run(*words, "--plan", tmp_path / "plan.csv")
    assert (code, out) == (2, "")
    assert f"row {place[0] + 1}, column q3_deg: the pose is not in the plan" in error
    assert "row 5, is 0.05 deg away" in error
    assert "2 more rows are not either" in error
    found = edtk.identify(LOADED, sheet, plan=plan, as_is=True)
    (other,) = (one for one in found.findings if one.kind == "other_pose")
    assert found.verdict == "bad"
    assert other.rows == (int(place[0]),)


def test_a_load_that_is_not_the_planned_one_is_named() -> None:
    """Of visits in the right pose, those whose load was left away are named by their rows."""
    plan = planned(30, 10)
    sheet = measured(plan)
    loaded = np.flatnonzero(sheet["Fz_N"].to_numpy() < 0)[:3]
    sheet.loc[loaded, "Fz_N"] = 0.0
    said = edtk.identify(LOADED, sheet, plan=plan).findings
    assert [one.rows for one in said if one.kind == "other_load"] == [tuple(loaded.tolist())]


def test_kilonewtons_beside_a_plan_are_told(tmp_path: Path) -> None:
    """Forces in another unit are told from those of the plan."""
    plan = planned(30, 10)
    sheet = measured(plan)
    sheet["Fz_N"] = sheet["Fz_N"] / 1e3
    (unit,) = (
        one for one in edtk.identify(LOADED, sheet, plan=plan).findings if one.kind == "force_unit"
    )
    assert unit.words == (
        "columns Fx_N to Fz_N: the forces are 0.001 times those of the plan: are they in "
        "kilonewtons? expected newtons"
    )
    assert pytest.approx(0.001) == unit.data["ratio"]


GEARS = 2e-5  # [rad] of each of three waves a turn, in every joint
SOFT = np.array([0, 3e-5, 4e-5, 0, 0, 0])
SPRUNG = STUDY.replace(
    parameters={"compliance": ["q2", "q3"], "geometry": []},
    load={"F_N": [0, 0, -100]},
    test_pose={
        "q_deg": [20, -40, 50, 30, 60, 10],
        "tool": {"position_mm": [120, -60, 90]},
        "load": {"F_N": [0, 0, -60]},
    },
)


ARM = replace(StudyGeometry.of(STUDY).model, offsets=OFFSETS, start=PLACE)


def erring(fault: str, torque: Array) -> Array:
    """By how much loads (m, n) turn the joints of an arm with a fault."""
    bent = SOFT * torque
    if fault == "backlash":
        bent[:, 2] += 5e-4 * np.sign(torque[:, 2])
    if fault == "torque_sign":
        bent[:, 1] *= 1 + 0.4 * np.sign(torque[:, 1])
    if fault == "joint_zero":
        bent[:, 2] += 1e-3
    return bent


def positions_of(seed: int, fault: str) -> MarkerPositions:
    """A day of an arm as drawn, of which base, markers and springs are to be fitted."""
    rng = np.random.default_rng(seed)
    loads = StudyGeometry.of(SPRUNG).loads
    q = rng.uniform(-1.7, 1.7, (36, 6))
    wrench = np.zeros((36, 6))
    wrench[12:, 2] = -100.0
    applied = wrench.copy()
    if fault == "load_direction":
        applied[:, 0] = 0.3 * wrench[:, 2]
    bent = erring(fault, loads(q, applied))
    waves = np.arange(1, 4) * q[..., None] + rng.uniform(0, 2 * np.pi, (6, 3))
    there = q + bent + (rng.normal(0, GEARS, (6, 3)) * np.sin(waves)).sum(axis=-1)
    x = ARM.see(np.zeros(ARM.p), there, derivatives=False).points
    x += rng.normal(0, 2e-5, x.shape)
    if fault == "typed":
        q[7, 3] += 5e-3
    row = np.arange(36)[:, None] * np.ones(3, dtype=int)
    return MarkerPositions(q, wrench, x, row, tuple("ABC"))


def table_of(data: MarkerPositions) -> pd.DataFrame:
    """The sheet of a day."""
    each = [np.rad2deg(data.q)[:, None], 1e3 * data.measured, data.wrench[:, None, :3]]
    cells = [
        np.broadcast_to(one, (len(data), 3, one.shape[-1])).reshape(-1, one.shape[-1])
        for one in each
    ]
    columns = [*NAMES, "x_mm", "y_mm", "z_mm", "Fx_N", "Fy_N", "Fz_N"]
    table = pd.DataFrame(np.hstack(cells), columns=columns)
    return table.assign(marker=np.tile(list("ABC"), len(data)))


@cache
def day_of(seed: int, fault: str) -> tuple[list[Finding], Array]:
    """What is said of a day.

    With how far (3,) the arm is in the test pose from where the fit has it [m].
    """
    setting = StudyGeometry.of(SPRUNG)
    data = positions_of(seed, fault)
    fit = fit_geometry(setting.model, data, setting.noise, setting.loads)
    (task,) = setting.study.tasks
    loads, goal, load = setting.every_load_of(task), task.q[None], task.wrench[None]
    arm = replace(ARM.at_tool(task.tool), parameters=(), rows="position")
    true = arm.see(np.zeros(0), goal + erring(fault, loads(goal, load)), derivatives=False).points
    off = fit.fitted.at_tool(task.tool).predict(goal, load, loads).points - true
    return geometric_findings(fit, setting), off[0, 0]


def causes_of(seed: int, fault: str) -> list[Finding]:
    """What is said of such a day."""
    return day_of(seed, fault)[0]


@pytest.mark.cell("causes of what residuals show", "parameters")
@pytest.mark.parametrize(
    ("fault", "joint", "size"),
    [
        ("joint_zero", "q3", np.rad2deg(1e-3)),
        ("backlash", "q3", np.rad2deg(5e-4)),
        ("torque_sign", "q2", 40.0),
        ("load_direction", "", np.rad2deg(np.arctan(0.3))),
    ],
)
def test_a_fault_of_the_registry_is_the_cause_of_what_positions_leave(
    fault: str, joint: str, size: float
) -> None:
    """It is named with its joint, and with its size and its harm in the task within a fifth.

    The harm is what the same day without the fault has less.
    """
    said, off = day_of(0, fault)
    (found,) = (one for one in said if one.kind == "cause")
    cause = found.data["cause"]
    harm = float(np.linalg.norm(off - day_of(0, "none")[1]))
    assert cause.effect == pytest.approx(harm, rel=0.2)
    assert f"puts the test pose off by {1e3 * cause.effect:.2g} mm" in found.words
    assert (cause.cause, cause.joint) == (fault, joint)
    assert cause.size == pytest.approx(size, rel=0.2)
    assert cause.p < 1e-4
    assert cause_wording(cause) in found.words


def test_a_cause_of_a_sheet_is_in_its_result() -> None:
    """`identify` has it with what it does in the test pose, and its JSON too."""
    found = edtk.identify(SPRUNG, table_of(positions_of(0, "joint_zero")))
    (cause,) = found.causes
    (named,) = (one for one in day_of(0, "joint_zero")[0] if one.kind == "cause")
    assert cause.effect == pytest.approx(named.data["cause"].effect, rel=1e-6)
    assert found.to_dict()["causes"] == [cause.to_dict()]


def test_a_bearing_that_bends_is_the_cause_of_what_positions_leave() -> None:
    """A spring across joint 2 is named with its size, where loads from the side show it."""
    loads = {"list_F_N": [[0, 0, -100], [0, 80, -60]]}
    asked = {"springs": ["q2", "q3", "q2.rz"], "geometry": []}
    bent = StudyGeometry.of(SPRUNG.replace(load=loads, parameters=asked))
    model = replace(bent.model, offsets=OFFSETS, start=PLACE)
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.7, 1.7, (36, 6))
    wrench = np.zeros((36, 6))
    wrench[12:24, 2] = -100.0
    wrench[24:, 1:3] = [80.0, -60.0]
    theta = np.zeros(model.p)
    theta[-3:] = [3e-5, 4e-5, 2e-5]
    rest = loading_in(model.bending(theta), q, wrench, bent.loads, np.zeros(36, dtype=bool))
    x = model.see(theta, q, rest, derivatives=False).points
    row = np.arange(36)[:, None] * np.ones(3, dtype=int)
    data = MarkerPositions(q, wrench, x + rng.normal(0, 2e-5, x.shape), row, tuple("ABC"))
    setting = StudyGeometry.of(SPRUNG.replace(load=loads))
    fit = fit_geometry(setting.model, data, setting.noise, setting.loads)
    (found,) = (one for one in geometric_findings(fit, setting) if one.kind == "cause")
    cause = found.data["cause"]
    assert (cause.cause, cause.joint) == ("lateral", "q2.rz")
    assert cause.size == pytest.approx(2 / 3 * 100, rel=0.1)  # of what joint 2 gives way
    # Beside base, markers and springs it is the piece that the sheet needs.
    assert (
        "q2.rz" in edtk.identify(setting.study, table_of(data), extend=True).extension.chosen.pieces
    )


def test_a_sound_day_has_no_cause() -> None:
    """Gears that are not round are none of the faults."""
    assert not [one for one in causes_of(1, "none") if one.kind == "cause"]


def test_the_joint_that_was_typed_wrongly_is_named() -> None:
    """Of a pose that the others do not predict, with what the right value is less the written."""
    (found,) = (one for one in causes_of(0, "typed") if one.kind == "outliers")
    (cause,) = found.data["causes"]
    assert (found.rows, cause.rows, cause.joint) == ((7,), (7,), "q4")
    assert cause.size == pytest.approx(-np.rad2deg(5e-3), rel=0.1)
    assert "row 8: joint q4 looks -0.2" in found.words


def test_what_parameters_take_up_is_no_cause() -> None:
    """A zero of a joint that is fitted lies in the model; so does a tool point that is."""
    fitted = SPRUNG.replace(parameters={"compliance": ["q2"], "geometry": ["zeros"]})
    question = GeometryQuestion.of(fitted)
    plan = planned(20, 8)
    asked = {"joint_zero": "5deg", "tool_x": "5mm", "backlash": "0.1deg", "growth": "500um/m"}
    faults = sized_faults(fitted, asked, positions=True)
    found, _ = detect(Promised.visits(question, plan), faults)
    assert [one.never for one in found] == [True, True, False, False]


def test_growth_of_links_is_a_difference_of_drawings() -> None:
    """What `growth` adds to visits is what a drawing with longer links does, late in the day."""
    question = GeometryQuestion.of(SPRUNG)
    q = planned(6, 0).q
    time = np.linspace(0, 1, 6)
    scene = visited(question, q, np.zeros((6, 6)), time)
    (family,) = FAULTS["growth"].models(scene)
    found = 0.02 * family.derivative_at_zero(scene.k)[..., 0]  # whitened by 0.02 mm
    robot = question.model.robot
    h = 1e-6

    def points(scale: float) -> Array:
        longer = [
            replace(one, origin=one.origin * np.array([[1, 1, 1, scale]] * 3 + [[1, 1, 1, 1]]))
            for one in robot.joints
        ]
        model = replace(question.model, robot=replace(robot, joints=tuple(longer)))
        return model.see(np.zeros(model.p), q, derivatives=False).points.reshape(6, -1)

    expected = 1e3 * (points(1 + h) - points(1 - h)) / (2 * h) * time[:, None]
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize(("spring", "joint", "axis"), [("q3.rx", 2, 0), ("q2.rz", 1, 2)])
def test_a_lateral_spring_is_the_parameter_of_that_name(spring: str, joint: int, axis: int) -> None:
    """What the fault `lateral` adds to visits is the column of the spring across the joint."""
    asked = SPRUNG.replace(parameters={"springs": ["q2", "q3", spring], "geometry": []})
    setting = StudyGeometry.of(asked)
    q = planned(6, 0).q
    wrench = np.tile([0, 60.0, -100.0, 5.0, 0, 0], (6, 1))
    rows = PositionRows(setting.model, setting.loads, planned_noise(setting))(q, wrench)
    own = rows[..., -1] / setting.model.scales[-1]
    scene = visited(GeometryQuestion.of(SPRUNG), q, wrench, np.zeros(6))
    np.testing.assert_allclose(scene.across(joint, axis), own, rtol=0, atol=1e-9 * own.max())
    assert setting.model.parameters[-1].name == f"k_{spring}"


def test_displacements_show_no_motion_of_the_frame() -> None:
    """A fault that displacements cannot show is refused for that reason."""
    with pytest.raises(UserError, match="frame_moved shows in positions, and this study measures"):
        sized_faults(DISPLACEMENTS, {"frame_moved": "1mm"})
