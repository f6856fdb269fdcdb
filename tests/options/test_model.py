"""One model for all readings: on any body, absolute or differences, in one sheet and one fit."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from mixed_sheets import (
    ALL,
    JOINTS,
    LOAD,
    LOADS,
    MARKERS,
    MIXED,
    ON_LINK,
    SIGMA,
    SPRINGS,
    TOOL,
    Array,
    K,
    readings,
    sheet,
    study_of,
    truth_of,
)
from small_arm import ROBOT

import edtk
from edtk.calibration.geometric_calibration import GeometricCalibration
from edtk.fit.equilibrium import fit_equilibrium
from edtk.fit.fitted_geometry import loading_of
from edtk.fit.marker_positions import MarkerPositions
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry
from edtk.system.errors import UserError


def study_of_springs(**more: object) -> Study:
    """The same springs by displacements of the tool point, without [parameters]."""
    return Study(
        robot=ROBOT,
        tool=TOOL,
        joints={"unknown": list(K)},
        measurement={"sigma_mm": SIGMA * np.sqrt(2)},
        load={"F_N": LOAD},
        **more,
    )


def springs_of(found: GeometricCalibration) -> Array:
    """Compliances of the joints that a study asks for."""
    fitted = found.fit.fitted
    return fitted.compliances[[found.study.robot.joint_names.index(name) for name in K]]


@pytest.mark.parametrize("beside", [False, True])
def test_springs_alone_are_those_of_a_study_of_springs(beside: bool) -> None:
    """Differences of one marker at the tool point: the same compliances, deviations and verdict.

    Both are least squares of the loaded equilibrium; a study of springs takes the linear model
    where that is as good, and is led to the end here.
    """
    general = study_of(SPRINGS, [], measurement={"reference": "unloaded"})
    every = np.ones(12, dtype=bool)
    data = readings(general, np.array(list(K.values())), 12, every, every, SIGMA)
    plain = study_of_springs(test_pose={"q_deg": [0] * 6, "load": {"F_N": LOAD}, "tool": TOOL})
    tool_points = plain.robot.forward(data.q)[:, :3, 3]
    table = sheet(data, tool_points if beside else None).drop(columns=["marker", "visit"])
    expected = edtk.identify(plain, table)
    found = edtk.identify(general, table)
    start = np.zeros(6)
    start[list(plain.unknown)] = list(expected.k.values())
    settled = fit_equilibrium(plain.model, expected.data, start)[1]
    np.testing.assert_allclose(springs_of(found), settled.unbounded, rtol=1e-8)
    std = np.array(list(expected.std.values()))
    np.testing.assert_allclose(1e-6 * found.fit.fitted.std, settled.std, rtol=1e-6)
    # The linear model is reported where its bias is small beside the noise.
    assert (np.abs(springs_of(found) - list(expected.k.values())) < 0.5 * std).all()
    assert found.verdict == expected.verdict


@pytest.fixture
def two_studies() -> dict[str, Study]:
    """Springs by displacements of the tool point, and the same springs among parameters."""
    plain = study_of_springs()
    general = study_of(SPRINGS, [], measurement={"reference": "unloaded"})
    return {"springs": plain, "parameters": general}


@pytest.fixture
def displaced(two_studies: dict[str, Study]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The same day as displacements, and as positions without and with load."""
    every = np.ones(12, dtype=bool)
    general, plain = two_studies["parameters"], two_studies["springs"]
    data = readings(general, np.array(list(K.values())), 12, every, every, SIGMA)
    unloaded = plain.robot.forward(data.q)[:, :3, 3]
    tables = (sheet(data), sheet(data, unloaded))
    changes, pairs = (table.drop(columns=["marker", "visit"]) for table in tables)
    return changes, pairs


def springs_by(study: Study, table: pd.DataFrame) -> Array:
    """Compliances by joint, whatever else the study asks for."""
    found = edtk.identify(study, table)
    if isinstance(found, GeometricCalibration):
        return springs_of(found)
    return np.array(list(found.k.values()))


@pytest.mark.cell("displacements beside positions without and with load, in one sheet")
@pytest.mark.parametrize("kind", ["springs", "parameters"])
def test_rows_are_displacements_or_pairs_of_positions(
    two_studies: dict[str, Study], displaced: tuple[pd.DataFrame, pd.DataFrame], kind: str
) -> None:
    """Each row may have either: the compliances are those of a sheet of displacements alone."""
    changes, pairs = displaced
    mixed = pd.concat([changes[:5], pairs[5:]], ignore_index=True)
    expected = springs_by(two_studies[kind], changes)
    np.testing.assert_allclose(springs_by(two_studies[kind], mixed), expected, rtol=1e-8)


@pytest.mark.parametrize("kind", ["springs", "parameters"])
@pytest.mark.parametrize(
    ("rows", "change", "message"),
    [
        ("changes", {"x0_mm": 1.0}, "row 1: a reading and a change, columns 'dx_mm' and 'x0_mm'"),
        ("changes", {"Fz_N": 0.0}, r"row 1, columns Fx_N to Tz_Nm: a displacement without a load"),
        ("changes", {"change_mm": 1.0}, "change_mm"),
        (
            "pairs",
            {"x_mm": 9e3},
            r"row 1, columns x0_mm, .* moved by .* mm under load; are columns",
        ),
        ("pairs", {"y0_mm": None}, "row 1, column y0_mm: an empty or NaN cell is not a finite"),
    ],
)
def test_wrong_rows_are_refused_alike(
    two_studies: dict[str, Study],
    displaced: tuple[pd.DataFrame, pd.DataFrame],
    kind: str,
    rows: str,
    change: dict[str, float],
    message: str,
) -> None:
    """One line, the same for both kinds of study."""
    table = dict(zip(("changes", "pairs"), displaced, strict=True))[rows]
    if "Fz_N" in change:
        table = table.assign(Fx_N=0.0, Fy_N=0.0)
    with pytest.raises(UserError, match=message):
        edtk.identify(two_studies[kind], table.assign(**change))


@pytest.mark.parametrize("kind", ["springs", "parameters"])
def test_the_nominal_robot_stands_for_the_unloaded_one(
    two_studies: dict[str, Study], displaced: tuple[pd.DataFrame, pd.DataFrame], kind: str
) -> None:
    """A sheet whose study counts from the nominal robot has no positions without load."""
    joints = [joint | {"mass_kg": 20.0, "center_m": [0.1, 0, 0.1]} for joint in ROBOT["joints"]]
    measurement = {"sigma_mm": SIGMA, "reference": "nominal"}
    heavy = ROBOT | {"joints": joints}
    study = two_studies[kind].replace(robot=heavy, measurement=measurement)
    with pytest.raises(UserError, match="column 'x0_mm': the study counts from the nominal robot"):
        edtk.identify(study, displaced[1])


def test_a_row_of_a_distance_has_no_position() -> None:
    """Numbers in columns of another kind are one line, as in sheets of springs."""
    study = study_of(ALL, **MIXED)
    every = np.ones(6, dtype=bool)
    table = sheet(readings(study, np.zeros(len(truth_of(study, 0.0))), 6, ~every, every))
    wire = int((table["marker"] == "wire").to_numpy().argmax())
    table.loc[wire, ["x_mm", "y_mm", "z_mm"]] = 1.0
    with pytest.raises(UserError, match=f"row {wire + 1}, column x_mm: expected an empty cell"):
        edtk.identify(study, table)


def test_displacements_from_the_nominal_robot_are_those_of_a_study_of_springs() -> None:
    """They see the weights of the links, too: the same compliances at the loaded equilibrium."""
    joints = [joint | {"mass_kg": 20.0, "center_m": [0.1, 0, 0.1]} for joint in ROBOT["joints"]]
    keys = {
        "robot": ROBOT | {"joints": joints},
        "tool": TOOL,
        "load": {"F_N": LOAD},
    }
    general = Study(
        parameters=SPRINGS, measurement={"sigma_mm": SIGMA, "reference": "nominal"}, **keys
    )
    every = np.ones(12, dtype=bool)
    data = readings(general, np.array(list(K.values())), 12, ~every, every, SIGMA)
    drawn = StudyGeometry.of(general).model.see(np.zeros(3), data.q, derivatives=False).points
    moved = replace(data, measured=data.measured - drawn, differs=every)
    table = sheet(moved).drop(columns=["marker", "visit"])
    plain = Study(
        joints={"unknown": list(K)},
        measurement={"sigma_mm": SIGMA, "reference": "nominal"},
        test_pose={"q_deg": [0] * 6, "load": {"F_N": LOAD}, "tool": TOOL},
        **keys,
    )
    expected = edtk.identify(plain, table)
    start = np.zeros(6)
    start[list(plain.unknown)] = list(expected.k.values())
    settled = fit_equilibrium(plain.model, expected.data, start)[1]
    found = edtk.identify(general, table)
    np.testing.assert_allclose(springs_of(found), settled.unbounded, rtol=1e-8)


@pytest.mark.cell("positions and displacements in one sheet", "parameters")
@pytest.mark.parametrize("markers", [MARKERS, [*MARKERS, ON_LINK]], ids=["tool", "any body"])
def test_one_afternoon_is_one_fit(markers: list[dict]) -> None:
    """Visits read absolutely, without load and under it, and differences: the truth comes back."""
    study = study_of(ALL, markers)
    theta = truth_of(study, 0.5)
    loaded = np.arange(40) % 2 == 1
    differs = np.arange(40) % 4 == 1
    found = edtk.identify(study, sheet(readings(study, theta, 40, differs, loaded)))
    assert found.fit.data.is_difference.sum() == 10
    # Under the load of a pose the springs have given way but for what three substitutions leave.
    assert found.fit.rms < 1e-9
    np.testing.assert_allclose(springs_of(found), list(K.values()), rtol=1e-6)
    q = np.deg2rad(np.random.default_rng(9).uniform(-100, 100, (5, 6)))
    expected = StudyGeometry.of(study).model.see(theta, q, derivatives=False).points
    np.testing.assert_allclose(found.fit.fitted.predict(q).points, expected, rtol=0, atol=1e-8)


@pytest.mark.cell("positions and full poses in one sheet", "parameters")
@pytest.mark.cell("`[[distance]]`", "parameters")
def test_mixed_rows_are_one_fit(tmp_path: Path) -> None:
    """Poses, positions and distances, on tool and links, some of them differences: the truth.

    A distance does not depend on where the robot stands. What was fitted predicts every kind.
    """
    study = study_of(ALL, **MIXED)
    theta = truth_of(study, 0.5)
    loaded = np.arange(44) % 2 == 1
    table = sheet(readings(study, theta, 44, np.arange(44) % 4 == 1, loaded))
    day, tests = table[table["visit"] <= 36], table[table["visit"] > 36]
    found = edtk.identify(study, day)
    assert found.fit.rms < 1e-9
    np.testing.assert_allclose(springs_of(found), list(K.values()), rtol=1e-6)
    path = tmp_path / "k.json"
    path.write_text(json.dumps(found.to_dict()))
    predicted = edtk.predict(study, path, tests)
    assert predicted.tests.all()
    assert predicted.max_mm < 1e-5
    frame = predicted.to_frame()
    assert frame.loc[frame["marker"] == "wire", "x_mm"].isna().all()
    for name, scale in (("distance_mm", 1e3), ("change_mm", 1.0), ("dx_mm", 1.0)):
        own = tests[name].notna().to_numpy()
        assert own.any()
        expected = tests.loc[own, name]
        np.testing.assert_allclose(frame.loc[own, name], expected, rtol=0, atol=1e-8 * scale)


def test_a_sound_day_of_mixed_rows_is_good() -> None:
    """Noise alone is no cause, though positions do not tell all that was fitted."""
    study = study_of(ALL, **MIXED)
    loaded = np.arange(36) % 2 == 1
    data = readings(study, truth_of(study, 0.5), 36, np.arange(36) % 4 == 1, loaded, SIGMA, 500)
    found = edtk.identify(study, sheet(data))
    assert found.findings == ()
    assert found.verdict == "good"
    table = found.residuals()
    is_wire = table["marker"].isin(["wire", "other"])
    assert is_wire.sum() == 2 * 36
    for name in ("residual", "left_out"):
        assert table[f"{name}_mm"].notna().equals(is_wire)
        assert table[f"{name}_x_mm"].isna().equals(is_wire)
    assert table["residual_mm"].std() < 3 * 0.1


def test_commands_carry_the_markers_on_the_tool(tmp_path: Path) -> None:
    """Wires and markers on links have no say, and one marker's orientation tells the tool's."""
    study = study_of(ALL, **MIXED)
    loaded = np.arange(36) % 2 == 1
    data = readings(study, truth_of(study, 0.5), 36, loaded & False, loaded, SIGMA)
    path = tmp_path / "k.json"
    path.write_text(json.dumps(edtk.identify(study, sheet(data)).to_dict()))
    poses = tmp_path / "poses.csv"
    sheet(data)[JOINTS].iloc[::5].iloc[:4].to_csv(poses, index=False)
    found = edtk.compensate(study, path, poses)
    assert found.left.max() < 0.05 * found.uncompensated.max()
    assert found.rotation is not None
    # What is not known of the orientation is some thousandths of a degree, as its readings err.
    assert (np.rad2deg(found.rotation) > 1e-3).all()


def test_mixed_rows_have_plans_and_certificates(tmp_path: Path) -> None:
    """A relaxation is verified by the second implementation, and a plan has a sheet to fill in."""
    parameters = ALL | {"geometry": ["zeros", "lengths"]}
    study = study_of(parameters, candidates=150, **MIXED)
    edtk.relax(study, "D", certificate=tmp_path / "c.json")
    content = json.loads((tmp_path / "c.json").read_text())
    verified = edtk.verify(content, study)
    assert verified.valid, verified.summary()
    content["setting"]["physics"]["sensors"][3]["anchor"][0] += 0.1
    assert not edtk.verify(content).valid
    plan = edtk.plan(study, size=14, criterion="D", seed=0, budget=0.5)
    table = edtk.template(study, plan)
    assert {"x_mm", "rx_deg", "distance_mm"} <= set(table)
    assert list(table["marker"][:5]) == ["A", "B", "elbow", "wire", "other"]


@pytest.mark.cell("markers on any body", "parameters")
def test_errors_behind_a_marker_do_not_move_it() -> None:
    """A marker before the wrist says nothing of the wrist, and its place is told beside others."""
    study = study_of({"compliance": [], "geometry": "all", "base": True, "tool": True}, [ON_LINK])
    model = StudyGeometry.of(study).model
    q = np.random.default_rng(0).uniform(-1, 1, (8, 6))
    J = model.see(np.zeros(model.p), q).jacobian
    still = [
        one.name for one, c in zip(model.parameters, np.abs(J).max((0, 1, 2)), strict=True) if not c
    ]
    assert {name.partition(".")[0] for name in still} == {"q4", "q5", "q6"}
    assert len(still) == 18
    assert "on q3" in model.parameters[6].words


def test_a_plan_of_differences_has_a_sheet_and_a_fit(tmp_path: Path) -> None:
    """Visits under the load are read loaded less unloaded: planned, filled in, fitted, verified."""
    study = study_of(
        ALL | {"geometry": ["zeros"]}, measurement={"reference": "unloaded"}, candidates=200
    )
    plan = edtk.plan(study, size=12, criterion="D", seed=0, budget=0.5)
    table = edtk.template(study, plan)
    assert {"x_mm", "dx_mm"} <= set(table)
    loaded = table["Fz_N"].to_numpy() != 0
    assert loaded.any()
    assert not loaded.all()
    theta = truth_of(study, 0.5)
    setting = StudyGeometry.of(study)
    q = np.deg2rad(table[JOINTS].to_numpy())
    wrench = np.zeros((len(q), 6))
    wrench[:, :3] = table[LOADS]
    row = np.zeros((len(q), 3), dtype=int)
    empty = MarkerPositions(
        q, wrench, np.zeros((len(q), 3, 3)), row, setting.markers, differs=loaded
    )
    torque = loading_of(setting.model.bending(theta), empty, setting.loads)
    x = 1e3 * setting.model.see(theta, q, torque, derivatives=False).points
    own = x[np.arange(len(q)), [setting.markers.index(name) for name in table["marker"]]]
    for axis, name in enumerate(("x_mm", "y_mm", "z_mm")):
        table.loc[~loaded, name] = own[~loaded, axis]
        table.loc[loaded, f"d{name}"] = own[loaded, axis]
    found = edtk.identify(study, table)
    np.testing.assert_allclose(springs_of(found), list(K.values()), rtol=1e-5)


def test_differences_ask_for_compliances_and_a_load(tmp_path: Path) -> None:
    """A sheet of displacements is refused where they tell nothing, in one line."""
    study = study_of(ALL | {"compliance": []})
    every = np.ones(6, dtype=bool)
    data = readings(study, np.zeros(51), 6, np.zeros(6, dtype=bool), every)
    changes = sheet(
        MarkerPositions(data.q, data.wrench, data.measured, data.row, data.markers, differs=every)
    )
    with pytest.raises(UserError, match="tell compliances alone, and the study asks for none"):
        edtk.identify(study, changes)
    with pytest.raises(UserError, match="a displacement without a load"):
        edtk.identify(study_of(ALL), changes.assign(Fx_N=0.0, Fy_N=0.0, Fz_N=0.0))
    both = changes.assign(x_mm=1.0, y_mm=2.0, z_mm=3.0)
    with pytest.raises(UserError, match="row 1: a reading and a change"):
        edtk.identify(study_of(ALL), both)
    with pytest.raises(UserError, match=r"measurement\.reference.*compliances alone"):
        study_of(ALL | {"compliance": []}, measurement={"reference": "unloaded"})
    with pytest.raises(UserError, match=r"measurement\.reference.*base = false"):
        study_of(ALL, measurement={"reference": "nominal"})
