"""A plan's worth, by the definitions."""

import json
from pathlib import Path

import numpy as np
import pytest

from edtk.design.plan import Plan
from edtk.fit.least_squares import SingularPlanError
from edtk.study.study import load_study
from edtk.study.study_run import Designs

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")
SIGMA = 0.03e-3


@pytest.fixture(scope="module", params=["table_4_3", "table_4_12"])
def plan(request):
    found = STUDY.published_plans()[request.param]
    return Plan(found.q, found.wrench, 1 + np.arange(len(found.q)) % 3)


def test_definitions(plan):
    """Criteria are those of Table 1, from the stacked regressor's singular values and inverse."""
    A = (
        np.repeat(STUDY.model.regressor(plan.q, plan.wrench), plan.repeats, axis=0).reshape(-1, 5)
        / SIGMA
    )
    s = np.linalg.svd(A, compute_uv=False)
    cov = np.linalg.inv(A.T @ A)
    expected = {
        "A": np.trace(cov),
        "D": np.prod(s ** (2 / 5)),
        "E": s[-1] ** 2,
        "G": cov.diagonal().max(),
        "O1": np.prod(s ** (1 / 5)),
        "O2": s[0] / s[-1],
        "O3": s[-1],
        "O4": s[-1] ** 2 / s[0],
        "O5": (1 / s).sum(),
        "rho0": np.sqrt(np.trace(STUDY.target @ cov @ STUDY.target.T)),
        "rho_max": np.sqrt(np.trace(STUDY.target @ cov @ STUDY.target.T)),
    }
    found = Designs(STUDY).evaluate(plan)
    assert found.criteria == pytest.approx(expected, rel=1e-9)
    np.testing.assert_allclose(found.covariance, cov, rtol=1e-9, atol=1e-9 * cov.max())
    np.testing.assert_allclose(found.std, np.sqrt(cov.diagonal()), rtol=1e-9)
    assert found.experiments == plan.repeats.sum()


def test_observability_without_sigma(plan):
    """Without sigma, O1, O3 and O4 are sigma times theirs, O5 is a sigma-th, O2 is the same."""
    found = Designs(STUDY).evaluate(plan)
    for name, power in {"O1": 1, "O2": 0, "O3": 1, "O4": 1, "O5": -1}.items():
        assert found.observability_unscaled[name] == pytest.approx(
            SIGMA**power * found.criteria[name], rel=1e-9
        )
    assert len(found.observability_unscaled) == 5


def test_json(plan):
    """The JSON form has these keys, standard deviations by joint, and survives a round trip."""
    found = Designs(STUDY).evaluate(plan)
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert list(data) == [
        "criteria",
        "observability_unscaled",
        "std",
        "covariance",
        "parameters",
        "experiments",
        "expected_error",
        "budget_mm",
        "skipped",
        "warnings",
    ]
    assert data["budget_mm"] is None  # designs alone know nothing of calibrations
    assert list(data["std"]) == ["q2", "q3", "q4", "q5", "q6"]
    assert data["parameters"] == ["k2", "k3", "k4", "k5", "k6"]
    assert data["criteria"] == found.criteria
    np.testing.assert_array_equal(data["covariance"], found.covariance)


def test_table(plan):
    """The table has a row for each criterion with the same value, and its sense."""
    found = Designs(STUDY).evaluate(plan)
    frame = found.to_frame()
    assert frame["value"].to_dict() == found.criteria
    assert frame.loc["rho0", "sense"] == "min"
    assert frame.loc["O4", "sense"] == "max"


def test_repetition(plan):
    """Four times the experiments halve every standard deviation and rho0."""
    once = Designs(STUDY).evaluate(plan)
    four = Designs(STUDY).evaluate(plan.repeated(4))
    np.testing.assert_allclose(four.std, once.std / 2, rtol=1e-12)
    assert four.criteria["rho0"] == pytest.approx(once.criteria["rho0"] / 2, rel=1e-12)


def test_singular_plan_names_its_parameters():
    """A plan of one pose, however often repeated, is rejected with the open parameters' names."""
    q = STUDY.published_plans()["table_4_2"].q[:1]
    with pytest.raises(SingularPlanError, match=r"k\d"):
        Designs(STUDY).evaluate(STUDY.space.plan(q, np.array([5])))


def test_parameter_that_no_pose_excites_is_named():
    """In poses that leave only joint 6 without torque, k6 alone is named."""
    q = np.deg2rad([[0, -90 + 7 * i, 10 * i, 0, 0, 0] for i in range(6)])
    torque = np.abs(STUDY.model.robot.jacobian(q)[:, 2]).max(axis=0)
    assert torque[5] < 1e-12 < 1e-3 < torque[1]
    with pytest.raises(SingularPlanError) as caught:
        Designs(STUDY).evaluate(STUDY.space.plan(q, np.ones(6, dtype=int)))
    assert "k6" in str(caught.value)
    assert "k2" not in str(caught.value)
