"""Certificates of studies of geometry: written, verified another way, found out if forged."""

import copy
import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arm import ROBOT
from click.testing import CliRunner
from loaded_arm import LOAD, STUDY
from plain_checker import KIND, RejectedError, check

import edtk
from edtk.calibration.geometry_question import GeometryQuestion
from edtk.certificate.recompute.setting import Setting
from edtk.certificate.verify_certificate import verify_certificate
from edtk.cli import main
from edtk.study.study import Study
from edtk.system.errors import UserError

Content = dict[str, Any]
POSE = {"q_deg": [10, -60], "tool": {"position_mm": [500, 0, 0]}, "load": {"F_N": [0, 0, -50]}}
# Everything that a certificate of geometry can hold: markers, weights of links and of a payload
# beside the load, joints that do not repeat, several test poses.
RICH = Study(
    robot=ROBOT
    | {"joints": [{**j, "mass_kg": 7, "center_m": [0.2, 0, 0.1]} for j in ROBOT["joints"]]},
    tool={"position_mm": [500, 0, 0]},
    load={"list_F_N": [[0, 0, -100], [40, 0, -60]]},
    payload={"mass_kg": 3, "center_mm": [20, 0, 40]},
    marker=[{"name": "A", "position_mm": [0, 30, 10]}, {"name": "B", "position_mm": [-60, 0, 50]}],
    noise={"repeatability_deg": [0.01, 0.02]},
    measurement={"sigma_mm": 0.1},
    parameters={"geometry": "all", "compliance": ["q1", "q2"], "base": True},
    test_pose=[POSE, {**POSE, "q_deg": [-30, 20], "weight": 3}],
    candidates=200,
)


def written(study: Study, criterion: str, path: Path, continuous: bool = False) -> Content:
    """The certificate of a relaxation, as a file holds it."""
    edtk.relax(study, criterion, certificate=path, continuous=continuous)
    return json.loads(path.read_text())  # type: ignore[no-any-return]


@pytest.fixture(scope="module")
def rich(tmp_path_factory: pytest.TempPathFactory) -> Content:
    """The certificate of a study with everything."""
    return written(RICH, "rho0", tmp_path_factory.mktemp("rich") / "c.json")


@pytest.mark.parametrize("criterion", ["A", "D", "E", "G", "O1", "O2", "O4", "O5", "rho_max"])
def test_all_criteria_are_verified(criterion: str, tmp_path: Path) -> None:
    """The second implementation finds every number that the relaxation states."""
    content = written(RICH, criterion, tmp_path / "c.json")
    found = edtk.verify(content, RICH)
    assert found.valid, found.summary()
    assert {"value", "bound", "gap", "study"} <= {claim.claim for claim in found.claims}


@pytest.mark.parametrize("criterion", ["D", "rho0"])
def test_full_poses_are_verified(criterion: str, tmp_path: Path) -> None:
    """Orientations count with their own noise, and tasks are about positions."""
    full = RICH.replace(measurement={"sigma_mm": 0.1, "rows": "pose", "sigma_deg": 0.02})
    found = edtk.verify(written(full, criterion, tmp_path / "c.json"), full)
    assert found.valid, found.summary()


@pytest.mark.parametrize("criterion", ["D", "rho0"])
def test_differences_and_markers_on_links_are_verified(criterion: str, tmp_path: Path) -> None:
    """A marker on a link, and visits that are read loaded less unloaded where a load is on."""
    link = {"name": "link", "joint": "q1", "position_mm": [60, 20, 10]}
    mixed = RICH.replace(
        measurement={"sigma_mm": 0.1, "reference": "unloaded"},
        marker=[{"name": "A", "position_mm": [0, 30, 10]}, link],
    )
    content = written(mixed, criterion, tmp_path / "c.json")
    found = edtk.verify(content, mixed)
    assert found.valid, found.summary()
    assert content["setting"]["geometry"].pop("changes")
    assert not edtk.verify(content).valid


@pytest.mark.cell("`[noise] model_error_percent`, of what springs do", "parameters")
@pytest.mark.parametrize("reads", [{}, {"reference": "unloaded"}], ids=["positions", "changes"])
def test_what_springs_leave_out_is_verified(reads: dict[str, str], tmp_path: Path) -> None:
    """A share of what springs do lessens the information, by positions and by changes."""
    wire = {"anchor_mm": [2000, 500, 0], "marker": "A"}
    noise = {"repeatability_deg": 0.01, "model_error_percent": 8, "discrepancy_mm": 0.02}
    study = RICH.replace(
        measurement={"sigma_mm": 0.1, **reads},
        distance=[wire],
        noise=noise,
        simulation={"compliance_rad_per_Nm": {"q1": 3e-5, "q2": 5e-5}},
    )
    content = written(study, "D", tmp_path / "c.json")
    found = edtk.verify(content, study)
    assert found.valid, found.summary()
    content["setting"]["noise"]["model_error"]["anywhere"] *= 0.9
    assert not edtk.verify(content).valid


def test_a_search_over_all_poses_is_repeated(tmp_path: Path) -> None:
    """Another search finds no pose of larger sensitivity, and the stated bound holds."""
    content = written(STUDY, "rho0", tmp_path / "c.json", continuous=True)
    found = edtk.verify(content, STUDY)
    assert found.valid, found.summary()
    assert {"bound_searched", "search"} <= {claim.claim for claim in found.claims}


def test_what_is_of_interest_is_named(tmp_path: Path) -> None:
    """Criteria of the springs alone are verified, and said to be of them."""
    study = RICH.replace(interest={"parameters": ["compliance"]}, optimise=["A"], criteria=["A"])
    found = edtk.verify(written(study, "A", tmp_path / "c.json"), study)
    assert found.valid, found.summary()
    assert found.label == "A of k_q1, k_q2"


def test_rows_are_differences_of_positions(rich: Content) -> None:
    """The checker's rows are those of small errors in the nonlinear model, and of their noise."""
    question = GeometryQuestion.of(RICH)
    setting = Setting.from_dict(rich["setting"])
    rng = np.random.default_rng(0)
    q = rng.uniform(*RICH.robot.limits, (5, 2))
    wrench = question.wrenches[rng.integers(0, 3, 5)]
    model, loads = question.model, question.setting.loads
    assert loads is not None
    torque = loads(q, wrench)

    def positions(theta: np.ndarray) -> np.ndarray:
        return model.see(theta * model.scales, q, torque, False).points.reshape(5, -1)

    h = 1e-3
    steps = h * np.eye(model.p)
    differences = [(positions(e) - positions(-e)) / (2 * h) for e in steps]
    A = np.stack(differences, axis=-1)
    nudges = h * np.eye(2)
    motion = np.stack(
        [
            model.see(np.zeros(model.p), q + e, None, False).points.reshape(5, -1)
            - model.see(np.zeros(model.p), q - e, None, False).points.reshape(5, -1)
            for e in nudges
        ],
        axis=-1,
    ) / (2 * h)
    variances = np.square(np.deg2rad([0.01, 0.02]))
    V = 1e-8 * np.eye(6) + (motion * variances) @ np.swapaxes(motion, 1, 2)
    expected = np.swapaxes(A, 1, 2) @ np.linalg.solve(V, A)
    rows = setting.whitened_rows(q, wrench)
    found = np.swapaxes(rows, 1, 2) @ rows
    size = np.sqrt(np.diagonal(expected, axis1=1, axis2=2))
    assert np.abs(found - expected).max() < 1e-5 * (size[:, :, None] * size[:, None]).max()


def as_problem(content: Content, study: Study, criterion: Content) -> tuple[Content, np.ndarray]:
    """The same claims about a problem of arrays, and the rows (n, r, p) of all its candidates."""
    question = GeometryQuestion.of(study)
    relaxed = edtk.relax(study, criterion["name"])
    x = np.concatenate([relaxed.x, relaxed.source.take(relaxed.candidates).x])
    plan = question.space.plan(x, np.ones(len(x), dtype=int))
    L = np.diag(np.full(3 * len(question.model.markers), 1 / 0.1))
    A = np.ascontiguousarray(L @ question.rows(plan.q, plan.wrench))
    digest = hashlib.sha256(f"rows {A.shape[0]} {A.shape[1]} {A.shape[2]}\n".encode())
    digest.update(A.astype("<f8").tobytes())
    weights = [row["weight"] for row in content["experiments"]]
    Z = np.array(content["proof"]["multipliers"])
    return {
        "kind": KIND,
        "criterion": criterion,
        "candidates": {
            "number": len(A),
            "parameters": list(question.space.parameters),
            "sha256": digest.hexdigest(),
        },
        "weights": {"candidate": list(range(len(weights))), "weight": weights},
        "multipliers": ((Z + np.swapaxes(Z, 1, 2)) / 2).tolist(),
        **content["claims"],
    }, A


def test_the_plain_checker_agrees(tmp_path: Path) -> None:
    """Rows, weights and multipliers prove the claims by plain numpy, too; forged ones do not."""
    content = written(STUDY, "rho0", tmp_path / "c.json")
    target = GeometryQuestion.of(STUDY).target
    assert target is not None
    about = {"name": "rho0", "target": target.tolist()}
    problem, A = as_problem(content, STUDY, about)
    check(problem, A)
    for claim, factor in (("value", 0.999), ("bound", 1.001), ("gap", 2.0)):
        with pytest.raises(RejectedError, match=claim):
            check(problem | {claim: problem[claim] * factor + 1e-6}, A)
    with pytest.raises(RejectedError):
        check(problem, A * 1.001)


def _at(content: Content, *keys: str | int) -> Any:
    for key in keys:
        content = content[key]  # type: ignore[index]
    return content


FORGERIES: dict[str, Callable[[Content], None]] = {
    "value": lambda c: c["claims"].update(value=0.999 * c["claims"]["value"]),
    "bound": lambda c: c["claims"].update(bound=1.001 * c["claims"]["bound"]),
    "gap": lambda c: c["claims"].update(gap=c["claims"]["gap"] + 1e-3),
    "weight": lambda c: c["experiments"][0].update(weight=c["experiments"][0]["weight"] / 2),
    "pose": lambda c: c["experiments"][0]["q"].__setitem__(0, c["experiments"][0]["q"][0] + 0.01),
    "wrench": lambda c: c["experiments"][0]["wrench"].__setitem__(2, -321.0),
    "multiplier": lambda c: c["proof"]["multipliers"][0][0].__setitem__(0, 1e-3),
    "marker": lambda c: _at(c, "setting", "physics", "sensors", 0, "offset").__setitem__(0, 0.3),
    "link": lambda c: _at(c, "setting", "physics", "weights", 0).update(mass=70.0),
    "payload": lambda c: _at(c, "setting", "geometry", "payload", 0).update(mass=30.0),
    "load": lambda c: _at(c, "setting", "load", "wrenches", 1).__setitem__(2, -900.0),
    "sigma": lambda c: c["setting"].update(sigma=[1e-5] * 6),
    "repeatability": lambda c: _at(c, "setting", "noise").update(repeatability=[0.0, 0.0]),
    "joint": lambda c: _at(c, "setting", "geometry", "parameters", -1).update(of=0),
    "component": lambda c: _at(c, "setting", "geometry", "parameters", 0).update(component=4),
    "test pose": lambda c: _at(c, "setting", "test_pose", 0).update(weight=9.0),
}


@pytest.mark.parametrize("forgery", FORGERIES)
def test_forged_certificates_are_rejected(forgery: str, rich: Content) -> None:
    """A number of a certificate that is changed makes it invalid, without the study at hand."""
    content = copy.deepcopy(rich)
    FORGERIES[forgery](content)
    assert content != rich
    assert not verify_certificate(content).valid


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"place": "moon"}, "expected one of 'base', 'joint', 'tool', 'compliance'"),
        ({"of": 7}, "expected a whole number from 0 to"),
        ({"component": 6}, "expected a whole number from 0 to"),
        ({"name": "q1\nvalid: all"}, "name: expected a name"),
        ({"more": 1}, "unknown key 'more'"),
    ],
)
def test_what_is_no_parameter(change: Content, reason: str, rich: Content) -> None:
    """A parameter that the robot cannot have is no certificate, and is said so in one line."""
    content = copy.deepcopy(rich)
    _at(content, "setting", "geometry", "parameters", 0).update(change)
    with pytest.raises(UserError, match=reason):
        edtk.verify(content)


def test_another_study_is_told(rich: Content) -> None:
    """With the study beside it, a certificate of other markers or of other unknowns fails."""
    other = RICH.replace(parameters={"geometry": ["zeros"], "compliance": ["q1", "q2"]})
    found = edtk.verify(rich, other)
    assert found.failed == ("study",)
    assert "the study has another geometry" in found.summary()
    assert edtk.verify(rich, RICH).valid


def test_a_plan_and_the_visits_beside_it(tmp_path: Path) -> None:
    """The certificate of a plan counts the visits that were made already."""
    kept = edtk.Plan(np.deg2rad([[30.0, 40.0]]), np.array([LOAD], dtype=float), np.array([2]))
    path = tmp_path / "c.json"
    found = edtk.plan(STUDY, 6, keep=kept, budget=1.0, certificate=path)
    assert edtk.verify(path, STUDY).failed == ("question",)
    proved = edtk.verify(path, STUDY, keep=kept)
    assert proved.valid, proved.summary()
    assert proved.kept == 2
    stated = {claim.claim: claim.stated for claim in proved.claims}
    assert stated["value"] == pytest.approx(found.value, rel=1e-12)


@pytest.mark.cell("certificates, and `verify --study`", "parameters")
def test_verify_as_a_command(tmp_path: Path) -> None:
    """`edtk relax --certificate` and `edtk verify --study` fit together; forgeries have code 1."""
    study = tmp_path / "study.toml"
    STUDY.to_toml(study)
    path = tmp_path / "c.json"
    run = CliRunner().invoke(main, ["relax", str(study), "--certificate", str(path)])
    assert run.exit_code == 0, run.output
    good = CliRunner().invoke(main, ["verify", str(path), "--study", str(study)])
    assert good.exit_code == 0
    assert "valid: all 8 claims hold" in good.output
    path.write_text(path.read_text().replace('"value": ', '"value": 1'))
    bad = CliRunner().invoke(main, ["verify", str(path)])
    assert bad.exit_code == 1
