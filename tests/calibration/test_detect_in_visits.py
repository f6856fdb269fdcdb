"""What a plan of visits would notice: faults as differences, powers as frequencies, refusals."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from loaded_arm import LOAD, STUDY

import edtk
from edtk.calibration.detect import Promised, detect, sized_faults
from edtk.calibration.geometry_plan import visited
from edtk.calibration.geometry_question import GeometryQuestion
from edtk.calibration.template import visit_order
from edtk.cli import main
from edtk.design.detection import Detection, Separation
from edtk.findings.causes.faults import FAULTS
from edtk.fit.distributions import chi_square_quantile
from edtk.system.errors import UserError

K = np.array([3e-6, 5e-6])
SPRINGS = {"compliance_rad_per_Nm": {"q1": K[0], "q2": K[1]}}
KNOWN = STUDY.replace(simulation=SPRINGS, marker=[{"name": "A"}, {"name": "B"}])
QUESTION = GeometryQuestion.of(KNOWN)
RNG = np.random.default_rng(0)
Q = RNG.uniform(*KNOWN.robot.limits, (12, 2))
W = np.array(LOAD, dtype=float) * (np.arange(12) > 3)[:, None]
PLAN = edtk.Plan(Q, W, np.ones(12, dtype=int))
VISITS = visited(QUESTION, Q, W, np.linspace(0, 1, 12))
H = 1e-4


def positions(q: np.ndarray = Q, wrench: np.ndarray = W, **moved: Any) -> np.ndarray:
    """Markers (m, 6) [mm] by the nonlinear model, whose springs are K."""
    loads = QUESTION.setting.loads
    assert loads is not None
    bent = q + loads(Q, wrench) * K
    points = QUESTION.model.see(np.zeros(QUESTION.model.p), bent, None, False).points
    tips = QUESTION.model.see(np.zeros(QUESTION.model.p), bent, None, False).turns[:, 0]
    points = points + np.einsum("mij,j->mi", tips, moved.get("tool", np.zeros(3)))[:, None]
    points = points + np.asarray(moved.get("shift", np.zeros((1, 3))))[:, None]
    turn = np.asarray(moved.get("turn", np.zeros(3)))
    points = points + np.cross(turn, points)
    return 1e3 * points.reshape(len(q), -1)


def turned(angle: np.ndarray) -> np.ndarray:
    """The loads, turned a little about axes of the world."""
    return np.hstack([W[:, :3] + np.cross(angle, W[:, :3]), W[:, 3:]])


TIME = VISITS.time[:, None]
LOADS = QUESTION.setting.loads
assert LOADS is not None
TORQUE = LOADS(Q, W)
BY_SIGN = np.sign(TORQUE) * np.array([1.0, 0.0])
DIFFERENCES = {
    "tool_x": lambda h: positions(tool=np.array([h, 0, 0])),
    "tool_z": lambda h: positions(tool=np.array([0, 0, h])),
    "frame_rotation": lambda h: positions(turn=np.array([h, 0, 0])),
    "frame_moved": lambda h: positions(shift=np.array([[h, 0, 0]]) * (TIME > 0.5)),
    "drift": lambda h: positions(shift=np.array([[h, 0, 0]]) * TIME),
    "load_size": lambda h: positions(wrench=(1 + h) * W),
    "backlash": lambda h: positions(Q + h * BY_SIGN),
    "torque_sign": lambda h: positions(Q + h * BY_SIGN * TORQUE * K),
    "friction": lambda h: positions(Q - 1e3 * h * BY_SIGN * K) / 1e3,
    "joint_zero": lambda h: positions(Q + h * np.array([1.0, 0.0])),
}


@pytest.mark.parametrize("name", DIFFERENCES)
def test_a_fault_is_a_difference_of_the_nonlinear_model(name: str) -> None:
    """One SI unit of its first parameter adds what the model with such a fault shows."""
    fault = next(FAULTS[name].models(VISITS))
    found = 0.1 * fault.derivative_at_zero(VISITS.k)[..., 0]  # whitened by 0.1 mm
    expected = (DIFFERENCES[name](H) - DIFFERENCES[name](-H)) / (2 * H)
    # About the drawing, not about the bent arm: the springs give way by half a milliradian.
    assert found == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())


def test_a_load_that_is_askew() -> None:
    """Its two parameters span the turns of the load about axes that are not its own."""
    fault = next(FAULTS["load_direction"].models(VISITS))
    assert fault.dims == 2
    for axis in np.eye(3):
        h = 1e-4 * axis
        change = (positions(wrench=turned(h)) - positions(wrench=turned(-h))) / 2e-4
        columns = 0.1 * fault.derivative_at_zero(VISITS.k).reshape(-1, 2)
        left = change.ravel() - columns @ np.linalg.lstsq(columns, change.ravel(), rcond=None)[0]
        assert np.linalg.norm(left) < 1e-2 * max(np.linalg.norm(change), 1e-3)


def found_in(
    question: GeometryQuestion, plan: edtk.Plan, given: dict[str, str]
) -> tuple[tuple[Detection, ...], tuple[Separation, ...]]:
    """What a plan shows of faults."""
    faults = sized_faults(question.study, given, positions=True)
    return detect(Promised.visits(question, plan), faults)


def residual(A: np.ndarray, D: np.ndarray) -> np.ndarray:
    """What is left of columns D beside the columns A."""
    return D - A @ np.linalg.lstsq(A, D, rcond=None)[0]


def stacked(plan: edtk.Plan) -> np.ndarray:
    """Whitened rows (N, p) of a plan in the order of its sheet."""
    order = visit_order(KNOWN, plan)
    rows = QUESTION.rows(plan.q[order], plan.wrench[order]) / 0.1
    return rows.reshape(-1, QUESTION.model.p)


def test_the_power_is_the_share_of_noisy_days_that_show_it() -> None:
    """Of 4000 simulated days with a frame that moved, so many exceed the threshold of the test."""
    ((found,), _) = found_in(QUESTION, PLAN, {"frame_moved": "0.1mm"})
    A = stacked(PLAN)
    shift = np.tile(np.eye(3), (12, 2, 1)).reshape(12, 6, 3) / 0.1
    shift = shift * (np.linspace(0, 1, 12) > 0.5)[:, None, None]
    D = residual(A, shift.reshape(-1, 3))
    U, s, _ = np.linalg.svd(D, full_matrices=False)
    basis = U[:, s > 1e-9 * s[0]]
    change = D @ np.full(3, 0.1 / np.sqrt(3))
    noise = np.random.default_rng(1).normal(size=(4000, len(A)))
    statistic = np.square((noise + change) @ basis).sum(axis=1)
    share = (statistic > chi_square_quantile(0.99, 3)).mean()
    assert basis.shape[1] == 3
    assert 0.2 < found.power < 0.95
    assert share == pytest.approx(found.power, abs=4 * np.sqrt(0.25 / 4000))


def test_what_parameters_take_up_is_never_noticed() -> None:
    """An unknown tool takes up a tool point that is off; a known one shows it."""
    asked = {"tool_x": "1mm"}
    plan = edtk.Plan(Q, W, np.ones(12, dtype=int))
    ((never,), _) = found_in(QUESTION, plan, asked)
    assert never.never
    fixed = KNOWN.replace(parameters={**KNOWN.to_dict()["parameters"], "tool": False})
    question = GeometryQuestion.of(fixed)
    ((seen,), _) = found_in(question, plan, asked)
    assert seen.power > 0.99


def test_a_larger_fault_and_a_longer_day_are_noticed_sooner() -> None:
    """Powers grow with the size of the fault and with repeated visits, from the false alarms."""
    powers = []
    for size, repeats in (("1e-9mm", 1), ("0.2mm", 1), ("0.3mm", 1), ("0.3mm", 2)):
        plan = edtk.Plan(Q, W, np.full(12, repeats))
        ((one,), _) = found_in(QUESTION, plan, {"drift": size})
        powers.append(one.power)
        assert one.power_with >= one.power
    assert powers[0] == pytest.approx(0.01, abs=1e-6)
    assert powers == sorted(powers)


@pytest.mark.cell("`plan --detect`, and faults told apart", "parameters")
def test_two_faults_are_told_apart() -> None:
    """A frame that moved looks unlike one that was turned, and much like a drift."""
    asked = {"frame_moved": "1mm", "frame_rotation": "1deg", "drift": "1mm"}
    found, apart = found_in(QUESTION, PLAN, asked)
    shares = {tuple(fault.fault for fault in one.faults): one.right for one in apart}
    assert set(shares) == {
        ("frame_moved", "frame_rotation"),
        ("frame_moved", "drift"),
        ("frame_rotation", "drift"),
    }
    assert shares["frame_moved", "frame_rotation"] > 0.95
    assert all(0.45 <= share <= 1 for share in shares.values())
    assert [one.fault for one in found] == list(asked)


@pytest.mark.parametrize(
    ("asked", "reason"),
    [
        ({"magic": "1mm"}, "no fault 'magic'; expected one of load_size, load_direction, "),
        ({"drift": "1deg"}, "drift=1deg: expected a number with its unit, mm"),
        ({"load": "10%"}, "simulation: expected a table with compliances"),
    ],
)
def test_what_cannot_be_asked(asked: dict[str, str], reason: str) -> None:
    """Faults and units that are unknown, and springs that nobody told, in one line."""
    with pytest.raises(UserError, match="expected") as error:
        sized_faults(STUDY, asked, positions=True)
    assert reason in str(error.value)


def test_loads_that_show_in_no_spring() -> None:
    """Without unknown springs no fault of a load shows; drift needs none, and no [simulation]."""
    rigid = STUDY.replace(parameters={"geometry": ["zeros"], "base": False}, load=None)
    assert sized_faults(rigid, {"drift": "1mm"}, positions=True)[0].size == 1.0
    with pytest.raises(UserError, match="backlash shows in springs, and this study has none"):
        sized_faults(rigid, {"backlash": "1deg"}, positions=True)


def test_the_command(tmp_path: Path) -> None:
    """`edtk plan --detect` prints the chances, and JSON has the keys of other plans."""
    path = tmp_path / "study.toml"
    STUDY.to_toml(path)
    words = ["plan", str(path), "--size", "6", "--budget", "1"]
    words += ["--detect", "frame_moved=0.5mm,tool_x=1mm,drift=0.2mm"]
    text = CliRunner().invoke(main, words)
    assert text.exit_code == 0, text.output
    assert "tool_x 1 mm: never noticed, the parameters take it up" in text.stdout
    assert "frame_moved 0.5 mm or drift 0.2 mm: told apart with" in text.stdout
    found = json.loads(CliRunner().invoke(main, [*words, "--json"]).stdout)
    assert [one["fault"] for one in found["detect"]] == ["frame_moved", "tool_x", "drift"]
    assert found["told_apart"][0]["faults"] == ["frame_moved", "drift"]
