"""What is known beforehand counts in designs: plans, bounds, evaluations and certificates."""

import json
from pathlib import Path

import numpy as np
import pytest

from edtk.certificate.certificate import certificate
from edtk.certificate.verify_certificate import verify_certificate
from edtk.design.exact.find_plan import SearchOptions, find_plan
from edtk.design.plan import Plan
from edtk.design.relaxation.relax_poses import relax_poses
from edtk.study.plan_study import planning_space, relax_study, source_of
from edtk.study.study import load_study
from edtk.system.errors import UserError
from edtk.verbs.evaluate import evaluate
from edtk.verbs.verify import verify

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml").replace(
    candidates=300, sizes=[2]
)
NAMES = STUDY.specification.joints.unknown
PLAN = STUDY.published_plans()["table_4_3"]
KEPT = Plan(PLAN.q[:2], PLAN.wrench[:2], np.array([1, 2]))


def earlier(information):
    """The same study, with an earlier calibration of this information that counts in designs."""
    covariance = np.linalg.inv(information).tolist()
    mean = dict.fromkeys(NAMES, 1e-7)
    prior = {"earlier": {"mean_rad_per_Nm": mean, "covariance": covariance}, "in_design": True}
    return STUDY.replace(prior=prior)


KNOWS = earlier(STUDY.space.information(KEPT))
MARGINAL = STUDY.replace(
    prior={
        "in_design": True,
        "all": {"kind": "half-normal", "scale_rad_per_Nm": 1e-6},
        "joints": {"q2": {"kind": "log-normal", "median_rad_per_Nm": 4e-7, "factor": 2.0}},
    }
)


def test_information_of_priors():
    """An earlier calibration has its inverse covariance, densities those of Gaussians near them."""
    M = STUDY.space.information(KEPT)
    np.testing.assert_allclose(KNOWS.prior_information, M, rtol=1e-6, atol=1e-9 * M.max())
    expected = np.diag([(4e-7 * np.log(2)) ** -2, *[1e12] * 4])
    np.testing.assert_allclose(MARGINAL.prior_information, expected, rtol=1e-12)


def test_a_prior_counts_only_if_it_is_asked_to():
    """A study with a prior has its old numbers until in_design is set."""
    prior = {"all": {"kind": "half-normal", "scale_rad_per_Nm": 1e-6}}
    old = STUDY.replace(prior=prior)
    assert old.prior_information is None
    assert planning_space(old, 2) is old.space
    np.testing.assert_array_equal(old.information(PLAN), STUDY.space.information(PLAN))
    assert evaluate(old, PLAN).criteria == evaluate(STUDY, PLAN).criteria


@pytest.mark.cell("`[prior] in_design`, and `relax --size`", "springs")
@pytest.mark.slow
@pytest.mark.parametrize("name", ["rho0", "D"])
def test_plans_with_a_prior_are_those_with_kept_experiments(name):
    """The same information, from an earlier calibration or from kept experiments: one plan."""
    found = []
    for study, kept in ((KNOWS, None), (STUDY, KEPT)):
        space = planning_space(study, 2, kept)
        criterion = study.criterion(name)
        relaxed = relax_poses(source_of(study, 0, space), 300, criterion)
        plan = find_plan(relaxed, 2, kept=kept, options=SearchOptions(starts=16))
        found.append((relaxed, plan))
        whole = study.information(plan.whole)
        assert criterion.value(whole) == pytest.approx(plan.value, rel=1e-9)
    (relaxed, plan), (other, same) = found
    assert relaxed.value == pytest.approx(other.value, rel=1e-7)
    assert relaxed.bound == pytest.approx(other.bound, rel=1e-7)
    assert plan.value == pytest.approx(same.value, rel=1e-6)
    # A wrist has two ways to the same measurement, and rounding may choose either.
    M = STUDY.space.information(plan.plan)
    expected = STUDY.space.information(same.plan)
    np.testing.assert_allclose(M, expected, rtol=1e-3, atol=1e-4 * M.max())


def test_evaluation_adds_the_prior():
    """The covariance is that of prior and measurements together, and the text says so."""
    found = evaluate(MARGINAL, KEPT)
    M = STUDY.space.information(KEPT) + MARGINAL.prior_information
    cov = np.linalg.inv(M)
    np.testing.assert_allclose(found.covariance, cov, rtol=1e-8, atol=1e-8 * cov.max())
    assert found.criteria["A"] == pytest.approx(np.trace(cov))
    assert found.with_prior
    assert found.to_dict()["with_prior"]


def test_a_sharp_prior_is_a_known_compliance():
    """The surer a compliance is, the nearer is the study that states it as known."""
    information = np.zeros((5, 5))
    information[4, 4] = 1e30
    sharp = earlier(information + 1e-3 * np.eye(5))
    keys = STUDY.to_dict()["joints"]
    exact = {"q6": {"value": 1e-7, "std": 0.0}}
    known = STUDY.replace(joints=keys | {"unknown": list(NAMES[:4]), "known_rad_per_Nm": exact})
    value = evaluate(sharp, PLAN).std[:4]
    np.testing.assert_allclose(value, evaluate(known, PLAN).std, rtol=1e-6)


@pytest.mark.slow
def test_one_experiment_is_a_plan_and_its_bound_holds():
    """With a prior on every compliance a single pose is enough, and the size scales the prior."""
    for size in (1, 3):
        found = relax_study(MARGINAL, "A", size=size)
        assert found.space.sharing == size
        M = found.space.model.regressor(found.plan.q, found.plan.wrench) / STUDY.sigma[:, None]
        weights = np.sort(found.weights)[::-1]
        own = np.einsum("k,kri,krj->ij", weights, M, M)
        cost = np.trace(np.linalg.inv(own + MARGINAL.prior_information / size))
        assert found.value == pytest.approx(cost, rel=1e-9)
        assert abs(found.gap) < 1e-6
    relaxed = relax_poses(source_of(MARGINAL, 0, planning_space(MARGINAL, 1)), 300, found.criterion)
    plan = find_plan(relaxed, 1, options=SearchOptions(starts=16))
    assert evaluate(MARGINAL, plan.plan).criteria["A"] == pytest.approx(plan.value)


@pytest.mark.slow
def test_certificates_carry_the_prior():
    """Value and bound are recomputed with it; without it, or with another one, they fail."""
    for found in (relax_study(MARGINAL, "D", size=3), relax_study(MARGINAL, "rho0", size=3)):
        content = json.loads(json.dumps(certificate(MARGINAL, found)))
        assert content["sharing"] == 3
        checked = verify(content, MARGINAL, size=3)
        assert checked.valid, checked.failed
        assert checked.prior
        assert verify(content, STUDY, size=3).failed == ("study",)
        other = json.loads(json.dumps(content))
        other["sharing"] = 2
        assert "value" in verify_certificate(other).failed
        other["setting"]["prior"] = [[1.0] * 4]
        with pytest.raises(ValueError, match=r"setting\.prior"):
            verify_certificate(other)
        del other["setting"]["prior"]
        with pytest.raises(ValueError, match="sharing: expected none"):
            verify_certificate(other)
    relaxed = relax_poses(source_of(MARGINAL, 0, planning_space(MARGINAL, 1)), 300, found.criterion)
    plan = find_plan(relaxed, 1, options=SearchOptions(starts=16))
    content = json.loads(json.dumps(certificate(MARGINAL, plan)))
    assert verify_certificate(content).valid


def test_what_makes_no_sense_is_one_line():
    """A prior that says nothing, and a size where nothing is shared."""
    with pytest.raises(UserError, match=r"prior\.in_design: the prior says nothing"):
        relax_study(STUDY.replace(prior={"in_design": True}))
    with pytest.raises(UserError, match="has no effect without a prior in the design"):
        relax_study(STUDY, size=3)
