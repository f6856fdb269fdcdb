"""Certificates of designs whose noise is not white, checked by the second implementation."""

import copy
import json

import numpy as np
import pytest
from arm import arm

from edtk.certificate.certificate import certificate, setting_to_dict
from edtk.certificate.recompute.setting import Setting
from edtk.certificate.verify_certificate import verify_certificate
from edtk.design.plan import Plan
from edtk.study.plan_study import plan_study

NOISE = {
    "tracker_position_mm": [4000, -3000, 1200],
    "along": [10, 5],
    "across": [15, 6],
    "repeatability_deg": 0.01,
    "discrepancy_mm": 0.2,
}
STUDY = arm(
    measurement={"sigma_deg": 0.01},
    marker=[{"position_mm": [0, 0, 0], "rows": "pose"}, {"position_mm": [30, 90, 10]}],
    distance=[{"anchor_mm": [2000, 0, 0], "sigma_mm": 0.02}],
    noise=NOISE,
)
SPRINGS = {"compliance_rad_per_Nm": {"q1": 3e-5, "q2": 5e-5}}
ERRING = STUDY.replace(
    noise=NOISE | {"model_error_percent": 8, "discrepancy_within_deg": 5}, simulation=SPRINGS
)


@pytest.mark.parametrize("study", [STUDY, ERRING], ids=["ideal springs", "springs that err"])
def test_same_information(study):
    """Both implementations whiten alike, repeats and near poses included."""
    plain = setting_to_dict(study, study.space, study.main_criterion)
    setting = Setting.from_dict(json.loads(json.dumps(plain)))
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (6, 2))
    q[1] = q[0] + 0.01
    repeats = np.array([1, 2, 3, 1, 1, 4])
    wrench = np.tile(study.space.load.wrench(np.zeros(0)), (6, 1))
    visits = setting.noise.visits(setting.chain, q, wrench, repeats)
    np.testing.assert_array_equal(visits[:2], 3)
    rows = setting.whitened_rows(q, wrench, visits) * np.sqrt(repeats)[:, None, None]
    M = np.einsum("kri,krj->ij", rows, rows)
    expected = study.designed.space.information(Plan(q, wrench, repeats))
    np.testing.assert_allclose(M, expected, rtol=1e-9)


@pytest.fixture(scope="module")
def content():
    """The certificate of a plan of four experiments in two poses of the plain arm."""
    study = arm(measurement={}, noise=NOISE)
    return certificate(study, plan_study(study, 4, "D", distinct=2))


@pytest.mark.slow
def test_valid(content):
    """The certificate of a plan holds in all claims, and with less noise in it no longer."""
    found = verify_certificate(content)
    assert found.valid, found.claims
    forged = copy.deepcopy(content)
    forged["setting"]["noise"]["discrepancy"] = [0.0] * 3
    assert not verify_certificate(forged).valid


@pytest.mark.slow
@pytest.mark.cell("`[noise] model_error_percent`, of what springs do", "springs")
def test_a_plan_with_a_stated_model_error_is_proved():
    """Its certificate holds, has a pose for each visit, and is forged by a smaller error."""
    study = arm(noise={"model_error_percent": 10}, simulation=SPRINGS)
    plan = plan_study(study, 6, "D")
    assert len(plan.plan.q) > len(plan_study(arm(), 6, "D").plan.q)
    proved = certificate(study, plan)
    assert verify_certificate(proved).valid
    for key in ("turn", "anywhere"):
        forged = copy.deepcopy(proved)
        forged["setting"]["noise"]["model_error"][key] *= 0.9
        assert not verify_certificate(forged).valid


@pytest.mark.parametrize(
    "change",
    [
        {"discrepancy": [0.0] * 2},
        {"discrepancy": [-1.0] * 3},
        {"readings": 3},
        {"within": None},
        {"more": 1},
        {"tracker": {"position": [0, 0, 0]}},
        {"model_error": {"k": [1e-6], "turn": 0.1, "anywhere": 0.1}},
        {"model_error": {"k": [1e-6, -1e-6], "turn": 0.1, "anywhere": 0.1}},
        {"model_error": {"k": [1e-6, 1e-6], "turn": 0.1}},
    ],
    ids=str,
)
def test_no_noise(content, change):
    """What is no noise is refused."""
    forged = copy.deepcopy(content)
    forged["setting"]["noise"] |= change
    with pytest.raises(ValueError, match=r"setting\.noise"):
        verify_certificate(forged)
