"""A prior tells compliances that measurements alone do not, and is doubted where they differ."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from readings import STUDY, measured

from edtk.calibration.calibrate import calibrate
from edtk.calibration.planned import check_plan_posterior
from edtk.calibration.spring_calibration import SpringCalibration
from edtk.design.plan import Plan
from edtk.findings.fitted_data import FittedData, HowFitted
from edtk.findings.prior import posterior_findings
from edtk.fit.least_squares import SingularPlanError
from edtk.fit.posterior import Posterior, SamplingOptions
from edtk.fit.prior import Flat, LogNormal, Normal, Prior, fit_with_prior
from edtk.fit.run_chain import Demand
from edtk.study.study_parts import study_prior

pytestmark = pytest.mark.slow

K0 = STUDY.compliances
NAMES = STUDY.model.parameters
ROUGH = SamplingOptions(Demand(accuracy=0.2, length=20.0))
LOG_NORMAL = {
    "all": {"kind": "log-normal", "median_rad_per_Nm": 1e-6, "factor": 3.0},
}
DATA = measured()
ONE = DATA[:1]


def test_gaussian_prior_is_exact():
    """Rows of a Gaussian prior add its precision to that of the measurements, and its mean."""
    C = np.diag((0.3 * K0) ** 2) + np.outer(0.1 * K0, 0.1 * K0)
    prior = Prior((Flat(),) * 5, Normal(0.9 * K0, C))
    A = ONE.regressor(STUDY.model)
    found = fit_with_prior(A, ONE.deflection, ONE.sigma, NAMES, prior)
    X = (A / ONE.sigma[..., None]).reshape(-1, 5) * K0
    precision = X.T @ X + np.linalg.inv(C / np.outer(K0, K0))
    weighted = X.T @ (ONE.deflection / ONE.sigma).ravel() + np.linalg.solve(
        C / np.outer(K0, K0), np.full(5, 0.9)
    )
    np.testing.assert_allclose(found.k / K0, np.linalg.solve(precision, weighted), rtol=1e-7)
    relative = found.covariance / np.outer(K0, K0)
    np.testing.assert_allclose(relative @ precision, np.eye(5), atol=1e-6)


def test_prior_that_says_nothing_is_no_help():
    """A flat prior leaves the fit without an answer."""
    with pytest.raises(SingularPlanError):
        fit_with_prior(ONE.regressor(STUDY.model), ONE.deflection, ONE.sigma, NAMES, Prior.flat(5))


@pytest.mark.cell("`[prior]`, which tells what the sheet does not", "springs")
def test_one_pose_and_a_prior():
    """One pose and a prior give the posterior's summary, which is said; JSON is whole."""
    study = STUDY.replace(prior=LOG_NORMAL)
    fitted = FittedData.with_prior(study, ONE, study_prior(study), ("k2", "k3"))
    bare = SpringCalibration(fitted, findings=(), path=Path("sheet.csv"))
    found = bare.sampled(np.random.default_rng(1), ROUGH)
    posterior = found.check.posterior
    np.testing.assert_allclose(list(found.k.values()), posterior.mean)
    np.testing.assert_allclose(list(found.std.values()), posterior.std, rtol=1e-6)
    assert found.verdict == "usable"
    assert "alone do not tell k2, k3" in found.findings[0].words
    assert "rests on the prior" in found.summary()
    answer = found.to_dict()
    assert answer["budget_mm"]["noise"] == pytest.approx(1e3 * answer["rho0"]["value"])
    assert np.isfinite(answer["rho0"]["value"])
    # The posterior is inside the prior, and right within its width.
    assert (np.abs(np.log(posterior.mean / K0)) < 3 * np.log(3)).all()


def test_calibrate_needs_to_be_asked(tmp_path):
    """Without a posterior that is to be sampled, a singular sheet is refused as before."""
    from edtk.measure.pose_table import pose_columns
    from edtk.system.errors import UserError

    study = STUDY.replace(prior=LOG_NORMAL)
    header = [*pose_columns(STUDY.robot), "dx_mm", "dy_mm", "dz_mm"]
    row = [*np.rad2deg(ONE.q[0]), *1e3 * ONE.deflection[0]]
    path = tmp_path / "sheet.csv"
    path.write_text(",".join(header) + "\n" + ",".join(f"{x:.9g}" for x in row) + "\n")
    with pytest.raises(UserError, match="cannot identify"):
        calibrate(study, path)
    assert calibrate(study, path, HowFitted(sampled=True)).fitted.untold


def test_plan_of_one_pose():
    """The posterior of a plan that is singular by itself is sampled under a proper prior."""
    study = STUDY.replace(prior=LOG_NORMAL)
    plan = Plan(ONE.q, ONE.wrench, np.ones(1, dtype=int))
    found = check_plan_posterior(study, plan, np.random.default_rng(0), options=ROUGH)
    assert found.untold
    assert "std_eq13" not in found.table
    assert "rests on the prior" in found.summary()


def kinds(prior, mean):
    """What is said about a fit of the data, a prior, and a posterior of that mean."""
    fitted = FittedData.of(STUDY, DATA)
    rng = np.random.default_rng(2)
    samples = mean + fitted.fit.std * rng.standard_normal((50, 8, 5))
    ones = np.ones(5)
    posterior = Posterior(samples, ones, 50, ones, np.zeros(0), np.zeros((50, 8, 0)))
    return {d.kind.upper(): d.words for d in posterior_findings(fitted, prior, posterior)}


@pytest.mark.cell("`[prior]` that the sheet contradicts is a finding", "springs")
@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("earlier", [False, True])
def test_prior_that_contradicts(far, earlier):
    """A prior under which the estimate is improbable is a doubt; one that fits is none."""
    centre = K0 * (5.0 if far else 1.02)
    if earlier:
        prior = Prior((Flat(),) * 5, Normal(centre, np.diag((0.05 * K0) ** 2)))
    else:
        prior = Prior(tuple(LogNormal(k, 1.1) for k in centre))
    k = FittedData.of(STUDY, DATA).fit.k
    found = kinds(prior, k)
    assert ("PRIOR_CONTRADICTED" in found) == far
    assert "POSTERIOR_DIFFERS" not in found
    if far:
        pulled = kinds(prior, 1.5 * k)
        assert "believe neither" in pulled["POSTERIOR_DIFFERS"]


def test_posterior_that_knows_more():
    """Where the prior says much more than the measurements, the posterior is to be believed."""
    vague = replace(DATA, sigma=100 * DATA.sigma)
    fitted = FittedData.of(STUDY, vague)
    rng = np.random.default_rng(3)
    shifted = fitted.fit.k + 0.5 * fitted.fit.std
    samples = shifted + 0.05 * fitted.fit.std * rng.standard_normal((50, 8, 5))
    ones = np.ones(5)
    posterior = Posterior(samples, ones, 50, ones, np.zeros(0), np.zeros((50, 8, 0)))
    (found,) = posterior_findings(fitted, Prior.flat(5), posterior)
    assert "believe the posterior" in found.words
    assert found.severity == 0
