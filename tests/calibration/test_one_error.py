"""The error to expect is one number, in plan, evaluate, identify and compensate of both kinds."""

from functools import cache

import numpy as np
import pytest
from arm import arm

import edtk
from edtk.design.plan import Plan
from edtk.fit import pose_rows
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import Rest

K = np.array([2e-6, 5e-6])  # of q1, which counts as rigid, and of q2
TEST_POSE = {"q_deg": [10, 40], "tool": {"position_mm": [400, 0, 0]}, "load": {"F_N": [0, 0, -50]}}
SPRINGS = {"compliance": ["q2"], "geometry": [], "base": False, "tool": False}
EXACT = {"model_error_percent": 0}
KINDS = ["displacements", "visits"]
PLAN = Plan(
    np.round(np.random.default_rng(3).uniform(-1.5, 1.5, (12, 2)), 2),
    np.tile([0, 0, -100, 0, 0, 0.0], (12, 1)),
    np.ones(12, dtype=int),
)


def study(kind):
    """An arm of which one spring is asked for, by displacements or by visits that tell as much."""
    keys = {"joints": {"unknown": ["q2"]}, "measurement": {"sigma_mm": 0.02}}
    if kind == "visits":
        one = 0.02 / np.sqrt(2)
        measurement = {"sigma_mm": one, "reference": "unloaded"}
        keys = {"joints": {}, "measurement": measurement, "parameters": SPRINGS}
    return arm(
        **keys,
        simulation={"compliance_rad_per_Nm": {"q2": K[1]}},
        uncertainty={"rigid_rad_per_Nm": {"q1": K[0]}},
        noise=EXACT,
        test_pose=TEST_POSE,
        optimise=["rho0"],
    )


def readings(asked, k=(0.0, K[1])):
    """A sheet of a robot with some compliances, of q1 none by default."""
    model = ElastostaticModel(asked.robot, (0, 1))
    rest = Rest.of(model, PLAN.q, PLAN.wrench, np.array(k))
    ends = (asked.robot.forward(one)[:, :3, 3] for one in (rest.end, rest.start))
    table = PLAN.to_frame(asked.robot).drop(columns="repeats")
    table[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * np.subtract(*ends)
    return table


@cache
def calibrated(kind, k=(0.0, K[1])):
    """The study, and its calibration by such a robot."""
    asked = study(kind)
    return asked, edtk.identify(asked, readings(asked, k))


@pytest.mark.parametrize("kind", KINDS)
def test_every_verb_says_the_same(kind):
    """Plan and evaluation, calibration and commands have the total of the same parts."""
    asked, found = calibrated(kind)
    planned = edtk.evaluate(asked, PLAN).error_budget
    commands = edtk.compensate(asked, found)
    assert commands.remaining[0] == pytest.approx(found.budget.total, rel=1e-3)
    assert commands.uncompensated[0] == pytest.approx(found.budget.uncompensated, rel=1e-2)
    for part in ("noise", "load", "rigid_joints"):
        assert found.budget.parts[part] == pytest.approx(planned.parts[part], rel=0.3), part
    [(joint, error)] = commands.by_joints
    assert joint.name == "q1"
    assert error[0] == pytest.approx(found.budget.rigid_joints, rel=1e-3)


def test_texts_and_pages_say_it(tmp_path):
    """What is printed, and the page, have the total with what joint 1 makes of it, and no nan."""
    asked, found = calibrated("visits")
    edtk.identify(asked, readings(asked), out=tmp_path / "day")
    page = (tmp_path / "day" / "report.html").read_text(encoding="utf-8")
    total = f"{1e3 * found.budget.total:.2g} mm"
    assert f"total expected error {total}" in found.summary()
    assert f"Expect a total error of {total} in the test pose" in page
    for text in (found.summary(), page):
        assert "by q1, which counts as rigid" in text
        assert "nan mm" not in text


def test_exact_readings_are_fitted_in_few_steps(monkeypatch):
    """Squares that are rounding alone are not stepped about to the limit: three fits took 600."""
    steps = []
    at = pose_rows._Squares.at
    monkeypatch.setattr(pose_rows._Squares, "at", lambda *given: steps.append(1) or at(*given))
    asked = study("visits")
    assert edtk.identify(asked, readings(asked)).fit.rms < 1e-9
    assert len(steps) < 60


def test_both_kinds_say_the_same():
    """Springs by displacements are the smallest case of visits: parts are equal.

    Displacements alone count that the load acts at another tool point: thousandths of the total.
    """
    springs, visits = (calibrated(kind)[1].budget for kind in KINDS)
    near = {"rel": 1e-2, "abs": 3e-3 * springs.total}
    assert springs.parts == pytest.approx(visits.parts, **near)
    planned = [edtk.evaluate(study(kind), PLAN).error_budget.parts for kind in KINDS]
    assert planned[0] == pytest.approx(planned[1], **near)
    assert springs.uncompensated == pytest.approx(visits.uncompensated, rel=1e-2)


@pytest.mark.parametrize("kind", KINDS)
def test_the_error_told_is_the_error_made(kind):
    """Commands miss by as much as is told of a joint that counts as rigid, where it bends so."""
    asked, found = calibrated(kind, tuple(K))
    commands = edtk.compensate(asked, found)
    robot = asked.tasks[0].placed
    rest = Rest.of(ElastostaticModel(robot, (0, 1)), commands.command, commands.wrench, K)
    goal = robot.forward(commands.desired)[:, :3, 3]
    made = np.linalg.norm(robot.forward(rest.end)[:, :3, 3] - goal, axis=1)
    assert commands.by_joints[0][1] == pytest.approx(made, rel=1e-2)


def test_a_file_says_the_same(tmp_path):
    """What no reading tells is in the result: commands and predictions from a file are the same."""
    asked, found = calibrated("visits")
    again = edtk.compensate(asked, found.to_dict())
    assert again.remaining == pytest.approx(edtk.compensate(asked, found).remaining, rel=1e-9)
    poses = PLAN.to_frame(asked.robot).drop(columns="repeats")
    near, far = (edtk.predict(asked, one, poses) for one in (found, found.to_dict()))
    assert near.half == pytest.approx(far.half, rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("load", "words"), [(1.0, []), (1e-3, ["the forces of the file are 0.001 times those"])]
)
def test_predictions_doubt_loads_in_kilonewtons(kind, load, words):
    """Forces a thousand times smaller than those of the study are said, and sound ones are not."""
    asked, found = calibrated(kind)
    poses = Plan(PLAN.q, load * PLAN.wrench, PLAN.repeats).to_frame(asked.robot)
    said = edtk.predict(asked, found, poses.drop(columns="repeats")).findings
    assert [one.words[: len(words[0])] for one in said] == words


def test_predictions_doubt_compliances_in_other_units():
    """Compliances per kN m are a thousand times those that the study expects."""
    poses = PLAN.to_frame(study("displacements").robot).drop(columns="repeats")
    found = edtk.predict(study("displacements"), {"q2": 1e3 * K[1]}, poses)
    assert any("are they in rad/(kN m)?" in one.words for one in found.findings)
