"""What friction holds of joints' loads: its columns and slopes, and the plans that count it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from arm import arm
from short_search import short_search

from edtk.calibration.evaluate_geometry import GeometryDesigns
from edtk.calibration.geometry_question import GeometryQuestion
from edtk.certificate.certificate import certificate, setting_to_dict
from edtk.certificate.recompute.setting import Setting
from edtk.certificate.verify_certificate import verify_certificate
from edtk.design.plan import Plan
from edtk.measure.friction import GIVES, PLANNED, SPREAD_OF_SHARES, Friction, correlated, together
from edtk.study.plan_study import plan_study
from edtk.study.study_objects import friction_of
from edtk.verbs.evaluate import evaluate

K = {"q1": 3e-6, "q2": 5e-6}
STUDY = arm(
    measurement={"sigma_mm": 0.01},
    load={"list_F_N": [[0, 0, -100], [100, 0, 0]]},
    simulation={"compliance_rad_per_Nm": K},
    test_pose={
        "q_deg": [10, 40],
        "tool": {"position_mm": [400, 0, 0]},
        "load": {"F_N": [0, 0, -50]},
    },
    optimise=["rho0"],
)
ERRING = STUDY.replace(noise={"model_error_percent": 10})


def poses(count):
    """Random poses, and a load each."""
    q = np.random.default_rng(2).uniform(-1.4, 1.4, (count, 2))
    return q, np.array([100.0, 0, 0, 0, 0, 0]) * np.ones((count, 1))


def test_columns_are_what_is_held_of_a_usual_load():
    """A column is the joint's motion times ``k m``, by its load's sign; less if that is small."""
    model = ERRING.designed.model
    friction = model.friction
    q, wrench = poses(50)
    torque = model.torque_of(model.frames(q), wrench)
    share = torque / friction.load[:, None]
    assert (np.abs(share) < GIVES).any()
    assert (np.abs(share) > GIVES).any()
    turned = (friction.k * friction.load)[:, None] * share / np.hypot(share, GIVES)
    expected = np.moveaxis(model.motion_of(model.frames(q)) * turned[:, None], (0, 1), (-1, -2))
    A = model.regressor(q, wrench)
    assert A.shape[-1] == model.p == 4
    assert model.parameters == ("k1", "k2", "friction of q1", "friction of q2")
    np.testing.assert_allclose(A[..., 2:], expected, rtol=1e-9, atol=1e-15)
    np.testing.assert_array_equal(A[..., :2], STUDY.model.regressor(q, wrench))


def test_what_is_held_has_no_bend():
    """Slopes hardly change over a small change of the load, where ascents would else stop."""
    friction = Friction(np.array([2e-6]), np.array([50.0]), 0.1)
    torque = np.linspace(-2.0, 2.0, 40001)[None] * GIVES * friction.load
    held = friction.factors(torque) * torque
    np.testing.assert_allclose(held[0, [0, -1]], [-8.944e-5, 8.944e-5], rtol=1e-4)
    by_load = friction.slopes(torque) * torque + friction.factors(torque)
    np.testing.assert_allclose(by_load[0], np.gradient(held[0], torque[0]), rtol=2e-4, atol=1e-12)
    assert np.abs(np.diff(by_load)).max() < 1e-3 * np.abs(by_load).max()


@pytest.mark.parametrize("size", [100.0, 3.0])
def test_slopes_are_derivatives_of_the_rows(size):
    """Slopes of whitened rows agree with differences, where friction holds all and where a part."""
    space = ERRING.designed.space
    rng = np.random.default_rng(0)
    q, wrench = poses(6)
    wrench = wrench * size / 100
    B = rng.standard_normal((6, 3, 4)) * [1, 1, 1e-6, 1e-6]
    model = space.model

    def value(at):
        return (B * model.regressor(at, wrench)).sum(axis=(1, 2))

    step = 1e-6
    slopes = model.regressor_slope(q, wrench, B)
    for j in range(2):
        moved = step * np.eye(2)[j]
        difference = (value(q + moved) - value(q - moved)) / (2 * step)
        np.testing.assert_allclose(slopes[:, j], difference, rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize("spread", [SPREAD_OF_SHARES, PLANNED])
def test_shares_that_go_together(spread):
    """The root by which columns go together has the mean products of correlated shares."""
    root = together(np.eye(5), spread)
    np.testing.assert_allclose(root @ root.T, correlated(5, spread), atol=1e-14)
    drawn = 1 + spread * np.random.default_rng(0).standard_normal((400_000, 5))
    drawn = drawn / np.sqrt(1 + spread**2)
    np.testing.assert_allclose(drawn.T @ drawn / len(drawn), correlated(5, spread), atol=0.01)


def test_plans_know_shares_that_are_correlated_by_a_half():
    """What is known of them beforehand is the inverse of their mean products."""
    known = Friction(np.ones(5), np.ones(5), 0.2).information
    half = 0.04 * (np.eye(5) + 1) / 2
    np.testing.assert_allclose(np.linalg.inv(known), half, rtol=1e-12)


@pytest.mark.cell("`[noise] model_error_percent`, friction of the joints in plans", "parameters")
def test_parameters_have_no_friction_but_a_gap():
    """A study with [parameters] has the springs that it names, and no friction beside them.

    What friction holds counts in the promise of one without a gap, as springs alone count it.
    """
    springs = {"springs": ["q1", "q2", "q2.gap"], "geometry": [], "base": False, "tool": False}
    named = arm(
        parameters=springs,
        marker=[{"name": "A"}],
        measurement={"sigma_mm": 0.01, "reference": "unloaded"},
        simulation={"compliance_rad_per_Nm": K},
        noise={"model_error_percent": 10},
        joints={"unknown": []},
        test_pose={"q_deg": [10, 40], "load": {"F_N": [0, 0, -50]}},
    )
    assert named.designed.friction is None
    assert friction_of(named, 0.1) is None
    plan = Plan(poses(8)[0], np.tile([0, 0, -50.0, 0, 0, 0], (8, 1)), np.full(8, 2))
    plain = named.replace(parameters=springs | {"springs": ["q1", "q2"]})
    with_gap, without = (GeometryDesigns.of(one) for one in (named, plain))
    assert without.left_out(without.tasks, plan) > with_gap.left_out(with_gap.tasks, plan) > 0
    assert [one.name for one in GeometryQuestion.of(named).model.parameters][-1] == "k_q2.gap"


@pytest.mark.cell("`[noise] model_error_percent`, friction of the joints in plans", "springs")
@pytest.mark.slow
def test_a_plan_that_counts_friction_tells_it():
    """Its error in the task is below that of the plan for the noise alone, friction counted."""
    with short_search():
        plain, counted = (plan_study(one, 6) for one in (STUDY, ERRING))
    values = [evaluate(ERRING, one.whole).criteria["rho0"] for one in (plain, counted)]
    assert values[1] == pytest.approx(counted.value, rel=1e-9)
    assert values[1] < 0.8 * values[0]
    assert counted.efficiency <= 1 + 1e-9
    torque = STUDY.model.torque_of(STUDY.model.frames(counted.plan.q), counted.plan.wrench)
    sizes = np.abs(torque) / np.abs(torque).max(axis=1, keepdims=True)
    assert sizes.min() < 0.7  # loads of several sizes
    # Estimates, and studies that say nothing, know no friction.
    assert ERRING.model.friction is None
    assert STUDY.designed is STUDY


@pytest.mark.slow
def test_a_certificate_counts_friction():
    """The second implementation has the same rows, target and value."""
    designed = ERRING.designed
    plain = setting_to_dict(ERRING, designed.space, ERRING.main_criterion)
    setting = Setting.from_dict(json.loads(json.dumps(plain)))
    q, wrench = poses(5)
    A = setting.whitened_rows(q, wrench)
    M = np.einsum("kri,krj->ij", A, A)
    plan = Plan(q, wrench, np.ones(5, dtype=int))
    alone = replace(designed.space, noise=designed.noise.alone)
    np.testing.assert_allclose(M, alone.information(plan), rtol=1e-9)
    target = setting.tasks.targets("rho0")[0]
    np.testing.assert_allclose(target.T @ target, designed.target.T @ designed.target, rtol=1e-9)
    with short_search():
        content = certificate(ERRING, plan_study(ERRING, 4, "rho0"))
    assert verify_certificate(json.loads(json.dumps(content))).valid
    content["setting"]["friction"]["load"][0] *= 1.5
    assert not verify_certificate(json.loads(json.dumps(content))).valid
