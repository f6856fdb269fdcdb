"""What the plans of a run promise in each of several test poses."""

import json
from pathlib import Path

import pandas as pd
from kr270 import REQUIRED, TEST_POSE

from edtk.study.run_study import random_case
from edtk.study.study import Study
from edtk.study.study_run import Case, StudyRun

OTHER = TEST_POSE | {"q_deg": [0, -60, 90, 10, 45, 30], "load": {"F_N": [300, -200, 100]}}


def run_of(test_pose: object) -> StudyRun:
    """Two plans of five experiments, as if one had been optimised."""
    study = Study(**REQUIRED, test_pose=test_pose, sizes=[5])
    best = random_case(study, 5, 0).plan
    cases = (
        random_case(study, 5, 1),
        Case("optimised", "rho0", 5, plan=best),
        Case("distinct", "rho0", 5, distinct=3, reason="too few"),
    )
    return StudyRun(study, pd.DataFrame({"plan": ["a"]}), {}, cases, Path("out"))


def test_the_main_plan_comes_first() -> None:
    """Other plans of its size stand beside it, by name, and JSON has them all."""
    run = run_of([TEST_POSE, OTHER])
    assert list(run.accuracies) == ["optimised for rho0", "random"]
    assert len(run.accuracies["random"].error) == 2
    content = json.loads(json.dumps(run.to_dict()))
    assert content["tasks"]["random"][1]["error"] == run.accuracies["random"].error[1]


def test_a_single_pose_has_none() -> None:
    """Its lines are those that it had."""
    run = run_of(TEST_POSE)
    assert run.accuracies == {}
    assert "tasks" not in run.to_dict()
