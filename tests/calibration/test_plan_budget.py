"""The error budget before the day."""

import numpy as np
import pytest
from arm import arm
from readings import PLAN, STUDY

import edtk
from edtk.calibration.planned import SpringDesigns
from edtk.report.views.calibration import error_budget
from edtk.verbs.evaluate import evaluate


@pytest.mark.cell("the error budget of a plan", "springs")
def test_noise_is_rho0_and_repetitions_count():
    """The noise part is the plan's rho0; four times the repetitions halve it, and no other part."""
    one = SpringDesigns(STUDY).error_budget(PLAN)
    four = SpringDesigns(STUDY).error_budget(PLAN.repeated(4))
    assert one.noise == pytest.approx(evaluate(STUDY, PLAN).criteria["rho0"], rel=1e-9)
    assert four.noise == pytest.approx(one.noise / 2, rel=1e-9)
    assert four.load == pytest.approx(one.load, rel=1e-9)
    assert four.tool == pytest.approx(one.tool, rel=1e-9)


def test_a_model_error_is_in_the_estimates_and_in_the_task():
    """A share of 5 % leaves 5 % of what springs do in the task, and more by what they are taken."""
    study = STUDY.replace(noise={"model_error_percent": 5})
    own = 0.05 * np.linalg.norm(STUDY.target * STUDY.compliances)
    plain = SpringDesigns(STUDY.replace(noise={"model_error_percent": 0})).error_budget(PLAN)
    one, many = (SpringDesigns(study).error_budget(PLAN.repeated(times)) for times in (1, 10**6))
    of_estimates = np.sqrt(one.model**2 - own**2)
    rho0 = evaluate(study, PLAN).criteria["rho0"]
    assert np.hypot(one.noise, of_estimates) == pytest.approx(rho0, rel=1e-9)
    assert plain.model == 0 < of_estimates
    assert one.noise == pytest.approx(plain.noise, rel=1e-9)
    assert many.noise < 1e-2 * plain.noise
    assert many.model > own
    assert (plain.assumed_share, one.assumed_share) == (None, None)


def test_a_model_error_is_assumed_where_nothing_is_said_of_it():
    """A plan's error has a tenth of what springs do, says so, and leaves the poses as they are."""
    assumed, stated = (
        SpringDesigns(study).error_budget(PLAN)
        for study in (STUDY, STUDY.replace(noise={"model_error_percent": 10}))
    )
    assert assumed.model == pytest.approx(stated.model, rel=1e-9)
    assert assumed.model > 0.1 * np.linalg.norm(STUDY.target * STUDY.compliances)
    assert assumed.to_dict()["assumed_percent"] == 10
    assert "assumed_percent" not in stated.to_dict()
    assert (
        "which springs of joints leave out: assumed as 10 % of what the springs do"
        in error_budget(assumed)
    )
    assert "springs of joints leave out" not in error_budget(stated)
    assert STUDY.noise is None
    constant = SpringDesigns(STUDY.replace(noise={"discrepancy_mm": 0.02})).error_budget(PLAN)
    assert constant.assumed_share is None
    assert constant.model > np.sqrt(3) * 2e-5


def test_what_is_uncertain_is_propagated_once(monkeypatch):
    """Budget, totals and findings of a plan rest on one propagation; another plan has its own."""
    made = []
    own = SpringDesigns.propagated
    monkeypatch.setattr(
        SpringDesigns, "propagated", lambda self, plan: made.append(plan) or own(self, plan)
    )
    designs = SpringDesigns(STUDY)
    told = designs.judged(PLAN)
    assert designs.rests_on_known(PLAN) == ()
    assert made == [PLAN]
    assert told["error_budget"].total == designs.error_budget(PLAN).total
    designs.error_budget(PLAN.repeated(2))
    assert len(made) == 2


@pytest.mark.slow
def test_a_plan_says_what_a_wrong_guess_of_the_springs_costs():
    """Springs half as soft, or half as soft again, have bounds of their own to be compared with."""
    study = arm(
        noise={"model_error_percent": 10},
        simulation={"compliance_rad_per_Nm": {"q1": 3e-5, "q2": 5e-5}},
    )
    found = edtk.plan(study, 4, "D", seed=1)
    assert [one.factor for one in found.off_guess] == [0.5, 1.5]
    one = found.off_guess[1]
    other = study.with_guess_times(one.factor)
    bound = edtk.relax(other, "D", continuous=True, size=4).best_bound.scaled(4)
    designed = other.designed
    cost = designed.criterion("D").cost(designed.information(found.plan))
    assert one.efficiency == pytest.approx(bound.cost / cost, rel=1e-3)
    assert 0.5 < one.efficiency < 1 + 1e-6
    assert "guess       of the springs, [simulation]; the plan's efficiency is" in found.summary()
    assert found.to_dict()["off_guess"][0]["factor"] == 0.5
    # Without a model error rows and noise do not depend on the guess.
    exact = study.replace(noise={"model_error_percent": 0})
    assert not edtk.plan(exact, 4, "D", seed=1).off_guess


def test_repeatability_averages_out():
    """Motion between two readings averages out over repetitions; what all share does not."""
    study = STUDY.replace(uncertainty={"repeatability_mm": 0.03, "drift_mm": 0.03})
    one = SpringDesigns(study).error_budget(PLAN)
    four = SpringDesigns(study).error_budget(PLAN.repeated(4))
    # As large as sigma, it adds as much as the noise.
    assert one.repeatability == pytest.approx(one.noise, rel=1e-9)
    assert four.repeatability == pytest.approx(one.repeatability / 2, rel=1e-9)
    assert four.drift == pytest.approx(one.drift, rel=1e-9)


def test_the_studys_uncertainty_scales_the_parts():
    """A load that is known ten times as well leaves a tenth; rigid joints are those stated."""
    study = STUDY.replace(
        uncertainty={
            "load_percent": 0.1,
            "load_direction_deg": 0.1,
            "tool_mm": 0.1,
            "rigid_rad_per_Nm": {"q1": 1e-8},
        }
    )
    better = SpringDesigns(study).error_budget(PLAN)
    default = SpringDesigns(STUDY).error_budget(PLAN)
    assert better.load == pytest.approx(default.load / 10)
    assert better.tool == pytest.approx(default.tool / 10)
    expected = default.rigid_joints * 1e-8 / STUDY.compliances[0]  # q2 is the neighbour of q1
    assert better.rigid_joints == pytest.approx(expected)


def test_without_assumed_compliances_or_a_task_there_is_none():
    """Parts are of the displacement of a task by compliances, which must be assumed."""
    assert SpringDesigns(STUDY.replace(simulation=None)).error_budget(PLAN) is None
    other = STUDY.replace(test_pose=None, optimise=["D"], criteria=["D"])
    assert SpringDesigns(other).error_budget(PLAN) is None
