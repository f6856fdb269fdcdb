"""The part of a calibration's report that shows the sampled posterior."""

import numpy as np
import pytest
from arm import arm

from edtk.calibration.planned import check_plan_posterior
from edtk.calibration.posterior_check import PosteriorCheck
from edtk.design.plan import Plan
from edtk.fit.noise import Noise
from edtk.fit.posterior import SamplingOptions
from edtk.fit.run_chain import Demand
from edtk.report.calibration_report import posterior_figures, posterior_section

pytestmark = pytest.mark.slow

LOAD = {"F_N": [0, 0, -50]}


@pytest.fixture(scope="module")
def check() -> PosteriorCheck:
    """The check of a plan in which two markers and a draw wire are measured."""
    study = arm(
        marker=[{"position_mm": [10 * i, 0, 50]} for i in range(2)],
        distance=[{"name": "wire", "anchor_mm": [3000, 0, 0]}],
        simulation={"compliance_rad_per_Nm": {"q1": 1e-6, "q2": 2e-6}},
        test_pose={"q_deg": [9, 40], "tool": {"position_mm": [400, 0, 0]}, "load": LOAD},
    )
    q = np.deg2rad([[-30.0, 60.0], [-60.0, 40.0]])
    plan = Plan(q, np.tile([0, 0, -100.0, 0, 0, 0], (2, 1)), np.ones(2, dtype=int))
    options = SamplingOptions(Demand(0.3, length=10.0))
    rng = np.random.default_rng(0)
    return check_plan_posterior(study, plan, rng, noise=Noise(1.5), options=options)


def test_posterior_report(check):
    """The part has a row for each compliance, the noise, the test pose, and three pictures."""
    text = posterior_section(check)
    for name in ("k1", "k2"):
        assert f"<td>{name}</td><td>rad/(N m)</td>" in text
    assert "Noise over the stated one: " in text
    assert "In the test pose the error after compensation is " in text
    assert text.count('<svg role="img"') == 3


def residuals(check):
    """The picture of the residuals."""
    return next(one for name, one, _ in posterior_figures(check) if name == "residuals.png")


def test_panels_have_the_names_of_the_instruments(check, monkeypatch):
    """Several markers beside a distance have a panel for each of their rows, with its own name; of
    very many rows the first are drawn, and the picture says how many there are.
    """
    names = [*(f"marker {i} {axis}" for i in (1, 2) for axis in "xyz"), "wire"]
    figure = residuals(check)
    assert [axis.get_ylabel() for axis in figure.axes] == [f"{name}\n[sigma]" for name in names]
    assert "coordinates" not in figure.get_suptitle()
    monkeypatch.setattr("edtk.report.calibration_report.MOST_PANELS", 2)
    figure = residuals(check)
    assert [axis.get_ylabel() for axis in figure.axes] == [f"{x}\n[sigma]" for x in names[:2]]
    assert "(first 2 of 7 coordinates)" in figure.get_suptitle()
