"""Before the day: plans of so few visits that base and tool alone are better are named."""

import numpy as np
import pytest
from geometry_sheets import STUDY

import edtk
from edtk.calibration.evaluate_geometry import poor_left_out
from edtk.calibration.geometry_question import GeometryQuestion


@pytest.mark.parametrize(
    ("visits", "discrepancy_mm", "named"),
    [(12, 2.0, True), (12, 0.1, False), (60, 2.0, False), (12, 0.0, False)],
)
def test_few_visits_of_a_robot_that_errs_much(
    visits: int, discrepancy_mm: float, named: bool
) -> None:
    """More visits help, and so does a robot that its model describes; nothing stated, no word."""
    study = STUDY.replace(noise={"discrepancy_mm": discrepancy_mm})
    q = np.random.default_rng(0).uniform(-1.7, 1.7, (visits, 6))
    plan = edtk.Plan(q, np.zeros((visits, 6)), np.ones(visits, dtype=int))
    said = poor_left_out(GeometryQuestion.of(study), plan)
    assert len(said) == named
    assert all("So few visits pay only where these are above" in one.words for one in said)


def test_evaluate_says_it() -> None:
    """Among its warnings."""
    study = STUDY.replace(noise={"discrepancy_mm": 2.0})
    q = np.random.default_rng(0).uniform(-1.7, 1.7, (12, 6))
    plan = edtk.Plan(q, np.zeros((12, 6)), np.ones(12, dtype=int))
    (said,) = map(str, edtk.evaluate(study, plan).warnings)
    assert "plan more visits, or ask for fewer parameters" in said
