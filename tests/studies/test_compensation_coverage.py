"""The study of the band of a compensation."""

from pathlib import Path

import numpy as np
import pytest

from edtk import load_study

STUDIES = Path(__file__).parents[2] / "studies"


@pytest.fixture(scope="module")
def study(script):
    return script("compensation_coverage.py")


def test_the_band_covers_the_error_of_the_linear_model(study):
    """In a few calibrations the band covers errors of which one without the bias misses many."""
    kr270 = load_study(STUDIES / "kr270_milling.toml")
    found = study.compensation_coverage(kr270, 12, 5, np.random.default_rng(0))
    assert found.ratio.max() > 1.5
    assert found.covered.mean() >= 0.9
    assert found.without.mean() < 0.8
