"""The part of a calibration's report that shows the sampled posterior."""

from pathlib import Path

import numpy as np
import pytest

from edtk.calibration.check_plan_posterior import check_plan_posterior
from edtk.inference.noise import Noise
from edtk.inference.run_chain import Demand
from edtk.inference.sample_posterior import SamplingOptions
from edtk.report.posterior_report import posterior_report
from edtk.study.study import load_study

pytestmark = pytest.mark.slow

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")


def test_posterior_report():
    """The part has a row for each compliance, the noise, the test pose, and three pictures."""
    plan = STUDY.published_plans()["table_4_4"]
    options = SamplingOptions(Demand(0.3, length=10.0))
    rng = np.random.default_rng(0)
    check = check_plan_posterior(STUDY, plan, rng, noise=Noise(1.5), options=options)
    text = posterior_report(check)
    for name, unit in zip(STUDY.model.parameters, STUDY.model.units, strict=True):
        assert f"<td>{name}</td><td>{unit}</td>" in text
    assert "Noise over the stated one: " in text
    assert "In the test pose the error after compensation is " in text
    assert text.count('<svg role="img"') == 3
