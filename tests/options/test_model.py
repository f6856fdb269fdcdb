"""One model for all readings: on any body, absolute or differences, in one sheet and one fit."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from small_arm import ROBOT

import edtk
from edtk.calibration.geometry.geometric_calibration import GeometricCalibration
from edtk.fit.equilibrium import fit_equilibrium
from edtk.fit.geometry.fitted_geometry import loading_of
from edtk.fit.geometry.marker_positions import MarkerPositions
from edtk.robots.rotations import rotation, rotation_vectors
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry
from edtk.system.errors import UserError

Array = NDArray[np.float64]
JOINTS = [f"q{i}_deg" for i in range(1, 7)]
LOADS = ["Fx_N", "Fy_N", "Fz_N"]
TOOL = {"position_mm": [10, 20, 100]}
LOAD = [300.0, -200.0, -800.0]
K = {"q2": 4e-6, "q3": 8e-6, "q5": 3e-5}
SIGMA = 0.02
SPRINGS = {"compliance": list(K), "geometry": [], "base": False, "tool": False}
ALL = {"compliance": list(K), "geometry": "all", "base": True, "tool": True}
MARKERS = [
    {"name": "A", "position_mm": [90, 10, 50]},
    {"name": "B", "position_mm": [-30, 70, 40]},
    {"name": "C", "position_mm": [0, -60, 100]},
]
ON_LINK = {"name": "elbow", "joint": "q3", "position_mm": [40, 30, 200]}


# A pose, a position, a marker on a link, and two wires: one ends at a marker, one on a link.
MIXED = {
    "markers": [MARKERS[0] | {"rows": "pose"}, MARKERS[1], ON_LINK],
    "measurement": {"sigma_deg": 0.01},
    "distance": [
        {"name": "wire", "anchor_mm": [1500, 200, -100], "marker": "B", "sigma_mm": 0.1},
        {"name": "other", "anchor_mm": [-300, 900, 50], "joint": "q4", "position_mm": [20, 0, 60]},
    ],
}


def study_of(parameters: dict, markers: Sequence[dict] = MARKERS, **keys: object) -> Study:
    """A study of the small arm under a load."""
    measurement = {"sigma_mm": SIGMA} | keys.pop("measurement", {})
    return Study(
        robot=ROBOT,
        tool=TOOL,
        parameters=parameters,
        measurement=measurement,
        load={"F_N": LOAD},
        marker=list(markers),
        **keys,
    )


def readings(
    study: Study,
    theta: Array,
    visits: int,
    differs: Array,
    loaded: Array,
    sigma_mm: float = 0.0,
    seed: int = 0,
) -> MarkerPositions:
    """What is read of an arm with these parameters in some visits; errors of each reading alike."""
    setting = StudyGeometry.of(study)
    model = setting.model
    rng = np.random.default_rng(seed)
    q = np.deg2rad(np.round(rng.uniform(-100, 100, (visits, 6)), 3))
    wrench = np.zeros((visits, 6))
    wrench[loaded, :3] = LOAD
    shape = (visits, len(model.markers))
    row = np.arange(visits * shape[1]).reshape(shape)
    empty = MarkerPositions(q, wrench, np.zeros((*shape, 3)), row, model.markers, differs=differs)
    torque = loading_of(model.compliances(theta), empty, setting.loads)
    seen = model.see(theta, q, torque, derivatives=False)
    size = sigma_mm * 1e-3 * np.where(differs, np.sqrt(2), 1.0)[:, None, None]
    ratios = setting.noise.ratios
    size = size if ratios is None else size * ratios[:, None]
    x = seen.points + size * rng.normal(size=seen.points.shape)
    x = np.where(model.present[:, :3], x, np.nan)
    turns = None
    if setting.full_poses:
        turned = rng.normal(0, np.deg2rad(0.01) * (sigma_mm > 0), seen.points.shape)
        turns = rotation(turned * np.where(differs, np.sqrt(2), 1.0)[:, None, None]) @ seen.turns
    kinds = model.kinds if setting.distances else ()
    return MarkerPositions(q, wrench, x, row, model.markers, turns, differs, kinds)


def sheet(data: MarkerPositions, beside: bool = False) -> pd.DataFrame:
    """A sheet with a marker a row; differences as such, or beside a position without load."""
    lines = []
    offset = np.array([900.0, 100.0, 200.0])
    for visit, marker in np.ndindex(data.measured.shape[:2]):
        x = 1e3 * data.measured[visit, marker]
        line = dict(zip(JOINTS, np.rad2deg(data.q[visit]), strict=True))
        line |= dict(zip(LOADS, data.wrench[visit, :3], strict=True))
        line |= {"marker": data.markers[marker], "visit": visit + 1}
        absolute = ["x_mm", "y_mm", "z_mm"]
        rows = data.present[marker].sum()
        if rows == 6:
            names = [f"{'d' * int(data.is_difference[visit])}r{axis}_deg" for axis in "xyz"]
            vector = np.rad2deg(rotation_vectors(data.turns[visit, marker]))
            line |= dict(zip(names, vector, strict=True))
        if rows == 1:
            line |= {"change_mm" if data.is_difference[visit] else "distance_mm": x[0]}
        elif not data.is_difference[visit]:
            line |= dict(zip(absolute, x, strict=True))
        elif beside:
            line |= dict(zip(["x0_mm", "y0_mm", "z0_mm"], offset, strict=True))
            line |= dict(zip(absolute, x + offset, strict=True))
        else:
            line |= dict(zip(["dx_mm", "dy_mm", "dz_mm"], x, strict=True))
        lines.append(line)
    return pd.DataFrame(lines)


def truth_of(study: Study, size: float, seed: int = 5) -> Array:
    """Errors of a drawing of some size, and the compliances of the arm."""
    model = StudyGeometry.of(study).model
    theta = np.random.default_rng(seed).normal(0, size, model.p) * model.scales
    return np.array(
        [
            K[one.of] if one.place == "compliance" else value
            for one, value in zip(model.parameters, theta, strict=True)
        ]
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
    table = sheet(data, beside).drop(columns=["marker", "visit"])
    plain = Study(
        robot=ROBOT,
        tool=TOOL,
        joints={"unknown": list(K)},
        measurement={"sigma_mm": SIGMA * np.sqrt(2)},
        load={"F_N": LOAD},
        test_pose={"q_deg": [0] * 6, "load": {"F_N": LOAD}, "tool": TOOL},
    )
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
    torque = loading_of(setting.model.compliances(theta), empty, setting.loads)
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
