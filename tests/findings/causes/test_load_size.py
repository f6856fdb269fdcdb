"""A load of another size is seen where something is known of compliances, and only there."""

from dataclasses import replace

import numpy as np
import pytest
from readings import PLAN, STUDY

from edtk.findings.causes.faults import families
from edtk.findings.causes.find_causes import find_causes
from edtk.findings.causes.scene import Displacements
from edtk.findings.fitted_data import FittedData
from edtk.fit.measurements import Measurements, simulate
from edtk.fit.prior import LogNormal, Prior, PriorRows
from edtk.measure.elastostatic_model import ElastostaticModel

MODEL = STUDY.model
K = STUDY.compliances
WITHOUT_Q2 = ElastostaticModel(MODEL.robot, MODEL.joints[1:])
KNOWN = {MODEL.joints[0]: K[0]}


def sheet(seed, k=K, load=1.0):
    """Readings of the published plan, under a load of so many times the stated one."""
    A = MODEL.regressor(PLAN.q, load * PLAN.wrench)
    moved = simulate(A, k, STUDY.sigma, np.random.default_rng(seed))[0]
    sigma = np.tile(STUDY.sigma, (len(moved), 1))
    return Measurements(PLAN.q, PLAN.wrench, moved, sigma, np.zeros(moved.shape))


def known_to(factor, k=K):
    """What is known where each compliance is known to a factor."""
    return PriorRows.near(Prior(tuple(LogNormal(one, factor) for one in k)), K)


def test_nobody_sees_a_load_that_scales_all():
    """Without knowledge of compliances they take up the load in full."""
    data = sheet(0, load=1.1)
    assert find_causes(MODEL, data, data.deflection).named == ()


@pytest.mark.parametrize("load", [0.9, 1.1])
def test_a_known_joint_weighs_the_load(load):
    """What a known joint does less or more than it should is the load's size, within four std."""
    data = sheet(1, load=load)
    first = data.regressor(replace(MODEL, unknown=MODEL.joints[:1]))
    rest = data.deflection - first @ K[:1]
    cause = find_causes(WITHOUT_Q2, data, rest, known=KNOWN).named[0]
    assert cause.cause == "load_size"
    assert abs(cause.size - 100 * (load - 1)) < 4 * cause.std
    good = sheet(1)
    assert find_causes(WITHOUT_Q2, good, good.deflection - first @ K[:1], known=KNOWN).named == ()


def test_a_prior_weighs_the_load():
    """Compliances that all came out as much too large are a load; one that did is none."""
    data = sheet(2, load=1.1)
    cause = find_causes(MODEL, data, data.deflection, prior=known_to(1.02)).named[0]
    assert cause.cause == "load_size"
    assert abs(cause.size - 10) < 4 * cause.std
    good = sheet(2)
    assert find_causes(MODEL, good, good.deflection, prior=known_to(1.02)).named == ()
    changed = K * [1, 1, 1.5, 1, 1]
    assert find_causes(MODEL, good, good.deflection, prior=known_to(1.02, changed)).named == ()


def test_a_vague_prior_names_nothing():
    """A load that is 10 % off is no surprise where compliances are known to a factor of three."""
    data = sheet(3, load=1.1)
    assert find_causes(MODEL, data, data.deflection, prior=known_to(3.0)).named == ()


def test_faults_move_known_joints_too():
    """Predictions of unknown and known joints together are those of all joints at once."""
    data = sheet(4)
    whole = {f.cause: f for f in families(Displacements(MODEL, data, data.regressor(MODEL), K))}
    A = data.regressor(WITHOUT_Q2)
    parts = {f.cause: f for f in families(Displacements(WITHOUT_Q2, data, A, K[1:], KNOWN))}
    for cause in ("load_direction", "tool_x", "frame_rotation"):
        c = np.full(whole[cause].dims, 0.01)
        together = whole[cause].predict(c)[0] @ K
        unknown, rest = parts[cause].predict(c)
        before = data.regressor(MODEL)[..., :1] @ K[:1]
        np.testing.assert_allclose(unknown @ K[1:] + rest + before, together, atol=1e-15)


def test_the_study_tells_what_is_known():
    """A [prior] in the study is used without a posterior, and a contradiction is said."""
    known = {
        name: {"kind": "log-normal", "median_rad_per_Nm": float(k), "factor": 1.02}
        for name, k in zip(STUDY.specification.joints.unknown, K, strict=True)
    }
    fitted = FittedData.of(STUDY.replace(prior={"joints": known}), sheet(5, load=1.1))
    assert fitted.causes[0].cause == "load_size"
    assert FittedData.of(STUDY, sheet(5, load=1.1)).causes == ()
    missing = STUDY.replace(prior={"earlier_file": "not_yet.json"})
    assert FittedData.of(missing, sheet(5)).causes == ()
