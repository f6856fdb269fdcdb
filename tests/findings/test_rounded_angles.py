"""Joint angles that were rounded, in sheets of springs."""

from dataclasses import replace

import numpy as np
import pytest
from readings import PLAN, STUDY, readings_of

from edtk.calibration.planned import planned_measurements
from edtk.findings.finding import Severity
from edtk.findings.fitted_data import FittedData, HowFitted
from edtk.findings.springs import spring_findings
from edtk.robots.robot_file import robot_to_dict


def rounded(data, step):
    """The same readings under angles that are rounded to a step [deg]."""
    shown = np.rad2deg(STUDY.robot.shown(data.q))
    return replace(data, q=STUDY.robot.of_shown(np.deg2rad(step * np.round(shown / step))))


def said(data, plan=None, study=STUDY):
    """Findings of rounded angles, and all kinds."""
    found = spring_findings(FittedData.of(study, data, HowFitted(plan=plan)))
    ours = [one for one in found if one.kind == "rounded_angles"]
    return ours, [one.kind for one in found]


@pytest.mark.parametrize("step", [10.0, 5.0])
def test_angles_that_were_rounded_are_named_by_their_step(step):
    """Residuals are those of rounding: nothing else is blamed; commands as coarse are no fault."""
    data = readings_of(PLAN.q, PLAN.wrench)
    ((one,), kinds) = said(rounded(data, step))
    assert one.severity is Severity.ALARM
    assert f"all joint angles are multiples of {step:g} deg" in one.words
    assert kinds == ["rounded_angles"]
    coarse = rounded(data, step)
    assert not said(readings_of(coarse.q, coarse.wrench))[0]


def test_what_does_not_matter_is_not_said():
    """Tenths of a degree err by less than the noise, where the plan has three decimals too."""
    assert not said(rounded(readings_of(PLAN.q, PLAN.wrench), 0.1), PLAN)[0]


def robot_with_links():
    """The robot with links of 100 kg."""
    content = robot_to_dict(STUDY.robot)
    for joint in content["joints"]:
        joint |= {"mass_kg": 100.0, "center_m": [0.1, 0.0, 0.0]}
    return content


def test_positions_under_rounded_angles_are_named_too():
    """Positions counted from the rigid robot are millimetres off by a degree, and a plan tells."""
    measurement = {"sigma_mm": 0.03, "reference": "nominal"}
    study = STUDY.replace(robot=robot_with_links(), measurement=measurement, published=None)
    data = planned_measurements(study, PLAN)
    k = study.compliances
    moved = data.regressor(study.model) @ k
    moved = moved + data.sigma * np.random.default_rng(0).standard_normal(data.sigma.shape)
    data = replace(data, deflection=moved)
    assert not said(data, PLAN, study)[0]
    other = rounded(data, 1.0)
    rigid = data.rigid(study.model) - other.rigid(study.model)
    other = replace(other, deflection=data.deflection + rigid)
    for plan in (None, PLAN):
        (one,) = said(other, plan, study)[0]
        assert one.data["rounding"] > 100
        assert ("those of the plan are not" in one.words) == (plan is not None)


def test_whole_degrees_that_err_by_less_than_the_noise_are_noted_or_told_by_the_plan():
    """No residual shows them: alone they are a note, and beside a plan of other digits doubted."""
    coarse = rounded(readings_of(PLAN.q, PLAN.wrench), 1.0)
    others, kinds = said(coarse)
    assert not others
    assert "coarse_angles" in kinds
    ((one,), kinds) = said(coarse, PLAN)
    assert one.severity is Severity.WARNING
    assert one.data["rounding"] < 1
    assert "coarse_angles" not in kinds
    own = replace(PLAN, q=coarse.q[: len(PLAN.q)])
    study = STUDY.replace(workspace={"plan_resolution_deg": 1.0})
    for known in (said(coarse, own), said(coarse, None, study)):
        assert "coarse_angles" not in known[1]


def test_a_marker_that_is_off_as_rounding_moves_it_is_no_other_robot():
    """Positions without load are centimetres off by half a degree in each joint."""
    data = rounded(readings_of(PLAN.q, PLAN.wrench), 1.0)
    flange = STUDY.robot.forward(readings_of(PLAN.q, PLAN.wrench).q)
    before = flange[:, :3, 3] + (flange[:, :3, :3] @ data.marker[..., None])[..., 0]
    found = spring_findings(FittedData.of(STUDY, replace(data, unloaded=before), HowFitted()))
    (words,) = [one.words for one in found if one.kind == "other_robot"]
    assert "as far as rounding to 1 deg moves it" in words
