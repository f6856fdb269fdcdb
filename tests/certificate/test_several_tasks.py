"""Certificates of studies with several tasks: true ones hold, weights that prove nothing do not."""

import copy
import json
from typing import Any

import pytest
from kr270 import REQUIRED, TEST_POSE

from edtk.certificate.certificate import certificate
from edtk.certificate.verify_certificate import verify_certificate
from edtk.study.plan_study import relax_study
from edtk.study.study import Study

Content = dict[str, Any]
OTHER = TEST_POSE | {"q_deg": [0, -60, 90, 10, 45, 30], "load": {"F_N": [700, -600, 300]}}
IDLE = TEST_POSE | {"q_deg": [0, -80, 70, 10, 45, 30], "weight": 0, "robust_deg": 5}
STUDY = Study(**REQUIRED, test_pose=[TEST_POSE | {"weight": 2}, OTHER, IDLE])


def made(name: str) -> Content:
    """The certificate of a relaxation over 100 candidates."""
    found = certificate(STUDY, relax_study(STUDY, name, candidates=100))
    return dict(json.loads(json.dumps(found)))


@pytest.fixture(scope="module")
def worst() -> Content:
    """That of rho_max."""
    return made("rho_max")


def failed(content: Content) -> set[str]:
    """Names of the claims that do not hold."""
    return {claim.claim for claim in verify_certificate(content).claims if not claim.holds}


def test_a_true_one_holds(worst: Content) -> None:
    """The second implementation confirms value, bound and gap, of rho0 as well."""
    assert not failed(worst)
    assert not failed(made("rho0"))
    assert worst["claims"]["gap"] <= 1e-6
    assert len(worst["proof"]["task_weights"][0]) == 3
    assert worst["proof"]["task_weights"][0][2] == 0


@pytest.mark.parametrize(
    "weights",
    [
        None,
        [],
        [[1.0, 1.0]],
        [[-0.5, 1.5, 0.0]],
        [[0.0, 0.0, 0.0]],
        [[0.5, 0.5, 0.5]],
        [[float("nan"), 1.0, 0.0]],
        "junk",
    ],
)
def test_weights_that_are_no_shares_prove_nothing(worst: Content, weights: Any) -> None:
    """Missing, negative, zero and wrong ones, and weight on a task that does not count."""
    content = copy.deepcopy(worst)
    content["proof"]["task_weights"] = weights
    assert "bound" in failed(content)


def test_other_weights_prove_another_bound(worst: Content) -> None:
    """The stated bound is that of the weights; a task that is harder changes value and bound."""
    content = copy.deepcopy(worst)
    content["proof"]["task_weights"] = [[0.5, 0.5, 0.0]]
    assert failed(content) >= {"bound"}
    content = copy.deepcopy(worst)
    for task in content["setting"]["test_pose"]:
        task["wrench"] = [2 * component for component in task["wrench"]]
    assert failed(content) >= {"value", "bound"}


def test_weights_of_the_study_are_checked(worst: Content) -> None:
    """Weights that are negative or all zero are no certificate."""
    for weights in ((-1.0, 1.0, 0.0), (0.0, 0.0, 0.0)):
        content = copy.deepcopy(worst)
        for task, weight in zip(content["setting"]["test_pose"], weights, strict=True):
            task["weight"] = weight
        with pytest.raises(ValueError, match="not negative, and not all zero"):
            verify_certificate(content)
