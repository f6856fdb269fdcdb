"""Loads at several sizes and places: laws of the mechanics, and of what they tell."""

from pathlib import Path

import numpy as np
import pytest
from arm import arm
from geometry_sheets import run
from loaded_arm import STUDY

import edtk
from edtk.calibration.geometry_question import GeometryQuestion
from edtk.design.plan import Plan
from edtk.findings.causes.scene import turned_by
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import torque_and_derivative
from edtk.robots.frames import BodyPoint, all_wrenches, load_turns
from edtk.robots.load_robot import load_robot
from edtk.robots.weights import Loading
from edtk.study.study import Study
from edtk.system.errors import UserError

ROBOT = load_robot("kuka_kr270")
RNG = np.random.default_rng(0)
Q = RNG.uniform(-1, 1, (5, 6))
FORCE = np.hstack([RNG.normal(size=(5, 3)) * 1000, RNG.normal(size=(5, 3)) * 100])
LEVERS = RNG.normal(size=(5, 3)) * 0.3
WRENCH = np.hstack([FORCE, LEVERS])
FORCES = [[0, 0, -100], [0, 0, -50], [0, 0, -100]]
PLACES = [[0, 0, 0], [0, 0, 0], [0, 300, 0]]


def moved_by_hand() -> np.ndarray:
    """The same wrenches as torques about the tool point: ``T + R d x F``."""
    R = ROBOT.forward(Q)[:, :3, :3]
    moment = np.cross(np.einsum("kij,kj->ki", R, LEVERS), FORCE[:, :3])
    return np.hstack([FORCE[:, :3], FORCE[:, 3:] + moment])


@pytest.mark.parametrize("rows", ["position", "pose"])
def test_a_load_beside_the_tool_is_a_force_and_its_torque(rows: str) -> None:
    """Rows are those of the same force at the tool point with the torque of its lever."""
    model = ElastostaticModel(ROBOT, rows=rows)
    A = model.regressor(Q, WRENCH)
    np.testing.assert_allclose(A, model.regressor(Q, moved_by_hand()), rtol=1e-9, atol=1e-9)
    every = all_wrenches(FORCE, WRENCH)
    both = model.regressor(np.vstack([Q, Q]), every)
    np.testing.assert_allclose(both, np.vstack([model.regressor(Q, FORCE), A]), atol=1e-9)


def test_loads_that_turn_keep_their_places() -> None:
    """Derivatives by a turn of the loads about the world's axes are those of turned ones."""
    model = ElastostaticModel(ROBOT)
    h = 1e-5
    for e, found in zip(np.eye(3), load_turns(WRENCH), strict=True):
        ahead, behind = (
            np.hstack([*(turned_by(s * h * e, W) for W in (FORCE[:, :3], FORCE[:, 3:])), LEVERS])
            for s in (1, -1)
        )
        rows = (model.regressor(Q, ahead) - model.regressor(Q, behind)) / (2 * h)
        np.testing.assert_allclose(model.regressor(Q, found), rows, rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize("rows", ["position", "pose"])
def test_slopes_of_a_load_that_turns_with_the_tool(rows: str) -> None:
    """They are those of central differences, and so is the derivative of the joints' loads."""
    model = ElastostaticModel(ROBOT, rows=rows)
    B = np.random.default_rng(1).normal(size=(5, model.row_count, 6))
    slope = model.regressor_slope(Q, WRENCH, B)
    _, H = torque_and_derivative(ROBOT, Q, WRENCH, Loading(BodyPoint()))
    h = 1e-6
    for j, e in enumerate(h * np.eye(6)):
        ahead, behind = (model.regressor(Q + s * e, WRENCH) for s in (1, -1))
        expected = ((ahead - behind) * B).sum(axis=(1, 2)) / (2 * h)
        np.testing.assert_allclose(slope[:, j], expected, rtol=1e-5, atol=1e-3)
        tau = [torque_and_derivative(ROBOT, Q + s * e, WRENCH)[0] for s in (1, -1)]
        np.testing.assert_allclose(H[:, :, j], (tau[0] - tau[1]) / (2 * h), atol=1e-4)


def question(load: dict[str, object], springs: list[str], **keys: object) -> GeometryQuestion:
    """What a small arm with these springs tells under these loads."""
    parameters = {"geometry": [], "springs": springs, "base": False, "tool": False}
    return GeometryQuestion.of(STUDY.replace(load=load, parameters=parameters, **keys))


def test_a_load_at_two_sizes_tells_a_cubic_spring() -> None:
    """In one pose a spring and its cube turn alike under one load, and not under two."""
    held = {"unknown": ["q1", "q2"], "fixed_deg": {"q1": 10, "q2": -60}}
    springs = ["q2", "q2.cubic"]
    one = {"list_F_N": [[0, 0, -100]]}
    two = {"list_F_N": [[0, 0, -100], [0, 0, -50]]}
    assert question(one, springs, joints=held).space.parameters == ("k_q1", "k_q2")
    told = question(two, springs, joints=held).space.parameters
    assert told == ("k_q1", "k_q2", "k_q2.cubic")


def test_a_load_beside_the_tool_tells_lateral_springs() -> None:
    """An arm in a plane is not twisted by a load in the plane; one beside the plane twists it."""
    springs = ["q1", "q2", "q2.rx"]
    within = {"list_F_N": [[0, 0, -100]]}
    beside = {"list_F_N": [[0, 0, -100]] * 2, "list_at_mm": [[0, 0, 0], [0, 300, 0]]}
    assert "k_q2.rx" not in question(within, springs).space.parameters
    found = question(beside, springs)
    assert found.space.parameters == ("k_q1", "k_q2", "k_q2.rx")
    plan = edtk.plan(found.study, 6, "D", workers=1)
    assert (plan.whole.wrench[:, 7] == 0.3).any()


@pytest.mark.slow
@pytest.mark.cell("listed loads at several places", "parameters")
def test_positions_under_loads_at_several_places(tmp_path: Path) -> None:
    """A day among sizes and places: its certificate holds, and its sheet tells the true springs."""
    springs = ["q1", "q2", "q2.rx"]
    study = STUDY.replace(
        load={"list_F_N": FORCES[1:], "list_at_mm": PLACES[1:]},
        parameters={"geometry": [], "springs": springs, "base": False, "tool": False},
        costs={"visit": 1, "load_change": 4, "budget": 10},
        measurement={"sigma_mm": 0.01},
    )
    study.to_toml(tmp_path / "study.toml")
    plan, proof, sheet = (tmp_path / name for name in ("plan.csv", "proof.json", "sheet.csv"))
    found = edtk.plan(study, criterion="D", workers=1, out=plan, certificate=proof)
    assert found.spent <= 10
    assert edtk.verify(proof, study).valid
    read = Plan.from_csv(plan, study.robot, {}, np.zeros(9))
    np.testing.assert_array_equal(read.wrench, found.whole.wrench)
    evaluated = edtk.evaluate(study, plan)
    assert evaluated.to_dict()["criteria"]["D"] == pytest.approx(found.value, rel=1e-9)
    assert "N at (0, 300, 0) mm" in found.summary()
    table = edtk.template(study, plan)
    k = np.array([3e-6, 5e-6, 4e-6])
    asked = found.question
    order = [
        np.flatnonzero((np.abs(asked.model.robot.shown(read.q) - q) < 1e-9).all(axis=1))[0]
        for q in np.deg2rad(table[["q1_deg", "q2_deg"]].to_numpy())
    ]
    q, wrench = read.q[order], table_wrench(table)
    rows = asked.rows(q, wrench)
    seen = study.robot.forward(q)[:, :3, 3] + 1e-3 * rows @ (k * 1e6)
    table[["x_mm", "y_mm", "z_mm"]] = 1e3 * seen
    table.to_csv(sheet, index=False, float_format="%.9f")
    told = edtk.identify(study, sheet, as_is=True)
    fitted = told.fit.fitted
    assert tuple(one.name for one in fitted.model.parameters) == asked.space.parameters
    np.testing.assert_allclose(fitted.values * fitted.model.scales, k, rtol=2e-2)
    code, _, err = run("evaluate", tmp_path / "study.toml", without_places(plan))
    assert (code, err.strip().count("\n")) == (2, 0)
    assert "'load_x_mm' is missing, and the study has loads at several places" in err


def table_wrench(table: object) -> np.ndarray:
    """The wrenches of a sheet with their places."""
    names = ["Fx_N", "Fy_N", "Fz_N", "Tx_Nm", "Ty_Nm", "Tz_Nm"]
    places = table[["load_x_mm", "load_y_mm", "load_z_mm"]].to_numpy() / 1e3
    return np.hstack([table[names].to_numpy(float), places])


def without_places(plan: Path) -> Path:
    """A copy of a plan that does not say where its loads act."""
    lines = [line.rsplit(",", 3)[0] for line in plan.read_text().splitlines()]
    path = plan.with_name("no_places.csv")
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.slow
@pytest.mark.cell("listed loads at several places", "springs")
def test_displacements_under_loads_at_several_places(tmp_path: Path) -> None:
    """Plan, certificate, sheet and fit of springs by displacements, at the loaded equilibrium."""
    study = arm(load={"list_F_N": FORCES, "list_at_mm": PLACES}, candidates=100)
    dear = study.replace(costs={"visit": 1, "load_change": 2, "budget": 9})
    day = edtk.plan(dear, criterion="D", workers=1, certificate=tmp_path / "day.json")
    assert day.spent <= 9
    assert edtk.verify(tmp_path / "day.json", dear).valid
    plan, proof, sheet = (tmp_path / name for name in ("plan.csv", "proof.json", "sheet.csv"))
    found = edtk.plan(study, 6, "D", workers=1, out=plan, certificate=proof)
    assert edtk.verify(proof, study).valid
    assert edtk.evaluate(study, plan).to_dict()["criteria"]["D"] == pytest.approx(found.value)
    relaxed = edtk.relax(study, "D", certificate=tmp_path / "relaxed.json")
    assert relaxed.gap < 1e-6
    assert edtk.verify(tmp_path / "relaxed.json", study).valid
    table = edtk.template(study, plan)
    k = np.array([3e-6, 5e-6])
    read = Plan.from_frame(table.iloc[:, : table.columns.get_loc("load_z_mm") + 1], study.robot)
    moved = study.model.regressor(read.q, read.wrench) @ k
    table[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * moved
    table.to_csv(sheet, index=False)
    told = edtk.identify(study, sheet, as_is=True, linear=True)
    np.testing.assert_allclose(told.fit.k, k, rtol=1e-9)
    code, _, err = run("evaluate", tmp_study(study, tmp_path), without_places(plan))
    assert (code, err.strip().count("\n")) == (2, 0)
    assert "'load_x_mm' is missing" in err


def tmp_study(study: Study, folder: Path) -> Path:
    """The study's file."""
    study.to_toml(folder / "study.toml")
    return folder / "study.toml"


@pytest.mark.parametrize(
    ("load", "said"),
    [
        ({"list_F_N": FORCES, "list_at_mm": PLACES[:2]}, "a place for each of list_F_N"),
        ({"F_N": FORCES[0], "list_at_mm": PLACES[:1]}, "a place for each of list_F_N"),
        (
            {"list_F_N": FORCES, "list_at_mm": PLACES, "at_mm": [1, 0, 0]},
            "one of at_mm and list_at_mm",
        ),
    ],
)
def test_places_belong_to_forces(load: dict[str, object], said: str) -> None:
    """Anything else is one line."""
    with pytest.raises(UserError, match=said):
        arm(load=load)
