"""The accuracy that a plan promises in each of several test poses."""

from dataclasses import replace

import numpy as np
import pytest
from readings import PLAN, STUDY

import edtk
from edtk.calibration.planned import SpringDesigns
from edtk.design.plan import Plan
from edtk.verbs.evaluate import evaluate

POSE = STUDY.to_dict()["test_pose"]
POSES = [POSE, POSE | {"q_deg": [0, -60, 90, 10, 45, 30], "weight": 3}]
SEVERAL = STUDY.replace(test_pose=POSES, published=None)


def test_errors_are_those_of_an_evaluation_and_totals_those_of_each_budget():
    """One pose by itself has the same total, and their squares make up that of all."""
    found = SpringDesigns(SEVERAL).totals(PLAN)
    np.testing.assert_array_equal(found.error, evaluate(SEVERAL, PLAN).tasks.error)
    alone = [
        SpringDesigns(STUDY.replace(test_pose=pose)).error_budget(PLAN).total for pose in POSES
    ]
    np.testing.assert_allclose(found.total, alone, rtol=1e-12)
    assert found.mean_of(found.total) == pytest.approx(
        SpringDesigns(SEVERAL).error_budget(PLAN).total
    )


def test_without_compliances_there_are_errors_by_noise_alone():
    """Totals need [simulation]; one pose has its lines already; an open plan promises nothing."""
    assert SpringDesigns(SEVERAL.replace(simulation=None)).totals(PLAN).total is None
    assert SpringDesigns(STUDY).totals(PLAN) is None
    assert (
        SpringDesigns(SEVERAL).totals(Plan(PLAN.q[:1], PLAN.wrench[:1], PLAN.repeats[:1])) is None
    )


def test_a_plan_tells_them_as_data():
    """`edtk.plan` has them, and its JSON has a table for each pose."""
    found = edtk.plan(SEVERAL.replace(candidates=200), size=4, budget=0.01)
    tables = found.to_dict()["tasks"]
    assert [table["pose"] for table in tables] == [1, 2]
    assert tables[1]["total"] == found.tasks.total[1]
    assert "tasks" not in replace(found, tasks=None).to_dict()
