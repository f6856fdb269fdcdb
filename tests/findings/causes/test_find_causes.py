"""Faults are named with their sizes, and good data are left alone."""

import math
from dataclasses import replace

import numpy as np
import pytest
from readings import STUDY

from edtk.findings.causes.family import Added, fit_families
from edtk.findings.causes.faults import families
from edtk.findings.causes.find_causes import find_causes
from edtk.findings.causes.try_faults import PlainFit
from edtk.fit.correlated_noise import whiten, whiten_columns
from edtk.fit.distributions import chi_square_tail
from edtk.fit.measurements import Measurements, simulate
from edtk.measure.equilibrium import torque_and_derivative
from edtk.robots.rotations import transform

pytestmark = pytest.mark.slow

MODEL = STUDY.model
# Random poses: an optimal plan has three clusters of poses, and confuses some faults by design.
POSES = np.random.default_rng(3).uniform(*MODEL.robot.limits, size=(12, 6))
Q = np.repeat(POSES, 3, axis=0)
WRENCH = np.tile([0, 0, -2500.0, 0, 0, 0], (len(Q), 1))
TYPED = (1, 2, 3, 4, 5)


def measured(seed, A=None, q=Q, extra=0.0, turn=None, noise=1.0):
    """The sheet of the plan, whose deflections were made by another model or with another noise."""
    A = MODEL.regressor(q, WRENCH) if A is None else A
    rng = np.random.default_rng(seed)
    moved = simulate(A, STUDY.compliances, noise * STUDY.sigma, rng)[0] + extra
    if turn is not None:
        moved = moved @ turn.T
    sigma = np.tile(STUDY.sigma, (len(Q), 1))
    return Measurements(Q, WRENCH, moved, sigma, np.zeros((len(Q), 3)))


def binomial_tail(count, trials, share):
    """Probability of so many successes or more."""
    return sum(
        math.comb(trials, n) * share**n * (1 - share) ** (trials - n)
        for n in range(count, trials + 1)
    )


def causes(data):
    """What explains the residuals."""
    return find_causes(MODEL, data, data.deflection, TYPED).named


def rotation(axis, degrees):
    """A rotation about a coordinate axis."""
    return transform([0, 0, 0], np.deg2rad(degrees) * np.eye(3)[axis])[:3, :3]


def load_direction(seed):
    """A load that is tilted by three degrees about x."""
    wrench = WRENCH.copy()
    wrench[:, :3] = WRENCH[:, :3] @ rotation(0, 3).T
    return measured(seed, MODEL.regressor(Q, wrench))


def tool_z(seed):
    """A tool point 20 mm further along the tool's z-axis."""
    tool = MODEL.robot.tool.copy()
    tool[:3, 3] += 0.02 * tool[:3, 2]
    other = replace(MODEL, robot=MODEL.robot.with_tool(tool))
    return measured(seed, other.regressor(Q, WRENCH))


def frame_rotation(seed):
    """A measuring frame that is turned by two degrees about z."""
    return measured(seed, turn=rotation(2, 2))


def drift(seed):
    """Every loaded reading is 0.05 mm off along y."""
    return measured(seed, extra=np.array([0, 0.05e-3, 0]))


def sigma(seed):
    """A noise that is twice the stated one."""
    return measured(seed, noise=2.0)


def pose(seed):
    """All repetitions of a pose were made with joint q3 ten degrees away from the written value."""
    q = Q.copy()
    q[6:9, 2] += np.deg2rad(10)
    return measured(seed, q=q)


def torque_sign(seed):
    """A joint q5 that is softer by 60 % under positive torques than under negative ones."""
    sign = np.sign(torque_and_derivative(MODEL.robot, Q, WRENCH)[0][:, 4])
    A = MODEL.regressor(Q, WRENCH)
    A[:, :, 3] *= 1 + 0.3 * sign[:, None]
    return measured(seed, A)


def backlash(seed):
    """Joint q5 gives way by 0.01 degrees, towards its load."""
    sign = np.sign(torque_and_derivative(MODEL.robot, Q, WRENCH)[0][:, 4])
    J = MODEL.robot.jacobian(Q)[:, :3, 4]
    return measured(seed, extra=np.deg2rad(0.01) * J * sign[:, None])


def joint_zero(seed):
    """Joint q3 is one degree further than written in all poses."""
    return measured(seed, q=Q + np.deg2rad([0, 0, 1, 0, 0, 0]))


def friction(seed):
    """Friction holds 500 N m of the load of joint q3."""
    torque = np.abs(torque_and_derivative(MODEL.robot, Q, WRENCH)[0][:, 2])
    A = MODEL.regressor(Q, WRENCH)
    A[:, :, 1] *= np.maximum(1 - 500 / torque, 0)[:, None]
    return measured(seed, A)


def link_length(seed):
    """The link before joint q3 is 100 mm longer than in the model."""
    joints = list(MODEL.robot.joints)
    joints[2] = replace(joints[2], origin=transform([1.35, 0, 0], [0, 0, 0]))
    other = replace(MODEL, robot=replace(MODEL.robot, joints=tuple(joints)))
    return measured(seed, other.regressor(Q, WRENCH))


def softer_everywhere(seed):
    """All joints are softer by 30 % under positive torques than under negative ones."""
    sign = np.sign(torque_and_derivative(MODEL.robot, Q, WRENCH)[0][:, 1:])
    return measured(seed, MODEL.regressor(Q, WRENCH) * (1 + 0.15 * sign[:, None]))


def test_a_fault_of_all_joints_is_in_none():
    """What the gears of all joints have in common is named without a joint."""
    found = [causes(softer_everywhere(seed))[0] for seed in range(3)]
    assert [(one.cause, one.joint) for one in found] == [("torque_sign", "")] * 3
    assert [one.size for one in found] == pytest.approx([15] * 3, abs=3)


def test_an_outlier_is_no_cause():
    """One reading that is off by 15 sigma is blamed on nothing that all readings share."""
    for seed in range(3):
        data = measured(seed)
        data.deflection[seed, 1] += 15 * STUDY.sigma[1]
        found = find_causes(MODEL, data, data.deflection, TYPED)
        assert found.named == ()
        assert found.outliers == (seed,)


def test_other_readings_are_looked_at_without_an_outlier():
    """Beside an outlier a fault is named with its own size, and noise is not blamed for it."""
    for seed in range(3):
        data = drift(seed)
        data.deflection[10 + seed, seed] -= 20 * STUDY.sigma[0]
        found = find_causes(MODEL, data, data.deflection, TYPED)
        assert found.outliers == (10 + seed,)
        assert found.named[0].cause == "drift"
        assert found.named[0].size == pytest.approx(0.05, abs=4 * found.named[0].std)


def test_two_outliers_are_rows_and_no_noise():
    """Two readings that are off by ten sigma are named, and no larger noise is, in 12 rows."""
    for seed in range(3):
        data = measured(seed)[np.arange(0, len(Q), 3)]
        data.deflection[[seed, 9 - seed], [0, 2]] += 10 * STUDY.sigma[0]
        found = find_causes(MODEL, data, data.deflection, TYPED)
        assert found.named == ()
        assert found.outliers == (seed, 9 - seed)


def test_rows_that_are_off_are_no_mistyped_joints():
    """Of 20 pairs of rows, off by 15 sigma in any direction, few are taken for anything else.

    One of six joints would explain a row by chance in every fifth of these sheets.
    """
    once = np.arange(0, len(Q), 3)
    others = 0
    for seed in range(20):
        data = measured(seed)[once]
        rng = np.random.default_rng((seed, 1))
        rows = rng.choice(len(once), 2, replace=False)
        off = rng.standard_normal((2, 3))
        data.deflection[rows] += 15 * STUDY.sigma * off / np.linalg.norm(off, axis=1)[:, None]
        found = find_causes(MODEL, data, data.deflection, TYPED)
        others += bool(found.named)
    assert others <= 40 / 20


@pytest.mark.parametrize(("degrees", "kind"), [(12, "pose"), (6, "outlier")])
def test_a_joint_of_a_row_is_told_or_possible(degrees, kind):
    """A joint that was mistyped by much in one row is the cause; by less, an outlier may be it."""
    right = 0
    for seed in range(5):
        q = Q.copy()
        q[3 * seed, 4] += np.deg2rad(degrees)
        data = measured(seed, q=q)[np.arange(0, len(Q), 3)]
        found = find_causes(MODEL, data, data.deflection, TYPED)
        seen = [(one.cause, one.joint, one.rows) for one in (*found.named, *found.typed)]
        right += seen == [(kind, "q5", (seed,))] and bool(found.outliers) == (kind == "outlier")
    assert right >= 3


def test_a_model_that_does_not_fit_is_no_fault():
    """Where links bend, no fault is named that would leave most of it: the model does not fit."""
    frames = MODEL.frames(Q)
    bent = 0.4e-3 * np.linalg.norm(frames.position, axis=0) * np.sin(3 * Q[:, 1])
    data = measured(0, extra=np.outer(bent, [1, 0.5, 0]))
    found = find_causes(MODEL, data, data.deflection, TYPED)
    assert found.unexplained
    assert found.named == ()
    assert found.outliers == ()


@pytest.mark.parametrize("seed", range(4))
def test_what_leaves_most_of_a_misfit_is_not_named(seed):
    """Where all springs vary as their joints turn, one fault explains most of it, or none does."""
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, 5)
    varied = 0.3 * np.sin(Q[:, 1:] + phase) * STUDY.compliances
    extra = np.einsum("mrp,mp->mr", MODEL.regressor(Q, WRENCH), varied)
    data = measured(seed, extra=extra)
    found = find_causes(MODEL, data, data.deflection, TYPED)
    assert found.unexplained or found.named
    assert all(one.explained >= 0.5 for one in found.named)


@pytest.mark.parametrize(("share", "named"), [(0.03, False), (0.5, True)])
def test_what_leaves_more_than_a_usual_error_stands_behind_the_model(share, named):
    """One spring that varies explains most, and others leave what only a stated error excuses."""
    phase = np.random.default_rng(1).uniform(0, 2 * np.pi, 5)
    varied = np.array([0.2, 0.2, 0.5, 0.2, 0.2]) * np.sin(Q[:, 1:] + phase) * STUDY.compliances
    extra = np.einsum("mrp,mp->mr", MODEL.regressor(Q, WRENCH), varied)
    data = measured(1, extra=extra)
    found = find_causes(MODEL, data, data.deflection, TYPED, share=share)
    first = found.named[0] if named else found.possible
    assert bool(found.named) == named
    assert found.unexplained != named
    assert first is not None
    assert first.explained >= 0.5


def test_what_is_left_is_judged_by_the_scatter_of_repetitions():
    """Residuals of three times the stated noise are no misfit where repetitions scatter as much."""
    data = measured(0, noise=3.0)
    plain = PlainFit.of(MODEL, data, data.deflection, {}, None)
    assert chi_square_tail(plain.chi2, plain.dof) < 1e-30
    assert plain.probability(plain.chi2, plain.dof) > 1e-3


def test_a_drift_that_grows_is_no_shift():
    """What moves from row to row is a drift of its whole size, and a shift grows nowhere."""
    slowly = np.linspace(0, 0.3e-3, len(Q))[:, None] * [0, 1, 0]
    for extra, grows, size in ((slowly, True, 0.3), (np.array([0, 0.1e-3, 0]), False, 0.1)):
        cause = causes(measured(0, extra=extra))[0]
        assert (cause.cause, cause.grows) == ("drift", grows)
        assert cause.size == pytest.approx(size, abs=4 * cause.std)


def test_many_outliers_are_none():
    """Where every third reading is off, none is set aside as the odd one."""
    data = measured(0)
    rng = np.random.default_rng(0)
    data.deflection[::3] += 15 * STUDY.sigma * rng.choice([-1, 1], (12, 3))
    assert find_causes(MODEL, data, data.deflection, TYPED).outliers == ()


def test_small_faults_are_those_that_are_usually_small():
    """A drift of 0.02 mm is not taken for a frame that is turned by a tenth of a degree."""
    found = [causes(measured(seed, extra=np.array([2e-5, 1e-5, 0]))) for seed in range(8)]
    assert sum(one[0].cause == "drift" for one in found if one) >= 0.8 * sum(map(bool, found))


@pytest.mark.cell("causes of what residuals show", "springs")
@pytest.mark.parametrize(
    ("fault", "size", "joint"),
    [
        (load_direction, 3, ""),
        (tool_z, 20, ""),
        (frame_rotation, 2, "q1"),
        (drift, 0.05, ""),
        (sigma, 2, ""),
        (pose, 10, "q3"),
        (torque_sign, 30, "q5"),
        (backlash, 0.01, "q5"),
        (joint_zero, 1, "q3"),
        (friction, 500, "q3"),
        (link_length, 100, "q3"),
    ],
)
def test_fault_is_named_first_with_its_size(fault, size, joint):
    """Of five sheets with the fault, it is named first in at least four, within four std."""
    found = [causes(fault(seed)) for seed in range(5)]
    right = [one[0] for one in found if one and one[0].cause == fault.__name__]
    assert len(right) >= 4
    for cause in right:
        assert cause.joint == joint
        assert cause.p < 0.01
        std = cause.std if cause.std is not None else 0.3
        # A length is not negative, and longer than its vector by chance.
        assert abs(abs(cause.size) - size) < 4 * std


def test_good_sheets_are_left_alone():
    """A cause is named in so few good sheets as happen to be, where 2 % are: but for 1 in 1000."""
    sheets = 60
    named = sum(bool(causes(measured(seed))) for seed in range(sheets))
    assert binomial_tail(named, sheets, 0.02) > 1e-3


def test_no_freedom_no_cause():
    """Two measurements for five compliances leave one degree of freedom, and none is too few."""
    data = measured(0)[np.array([0, 3])]
    assert len(causes(data)) <= 1


def test_json():
    """A cause is plain numbers, with rows from 1."""
    found = causes(pose(0))[0].to_dict()
    assert found["cause"] == "pose"
    assert found["rows"] == [7, 8, 9]
    assert found["unit"] == "deg"


@pytest.mark.parametrize("scale", [1.0, 1.2], ids=["sound", "springs beyond the noise"])
def test_faults_are_fitted_together_as_each_alone(scale):
    """Most take their first step together, and others go on by themselves: each as without others.

    Columns of no length and of what springs do have no fit either way.
    """
    sign = np.sign(Q[:, 2])[:, None, None]
    data = measured(0, A=MODEL.regressor(Q, WRENCH) * np.where(sign > 0, scale, 1.0))
    plain = PlainFit.of(MODEL, data, data.deflection, {}, None)
    every = [*families(plain.scene)]
    given = plain.whitened, plain.measured, plain.noise, plain.k
    together = fit_families(every, *given)
    assert {family.dims for family in every} == {1, 2, 3}
    assert sum(fit is None for fit in together) < len(every) / 2
    for family, fit in zip(every, together, strict=True):
        (alone,) = fit_families([family], *given)
        assert (fit is None) == (alone is None)
        if fit is not None:
            assert fit.chi2 == pytest.approx(alone.chi2, rel=1e-12)
            std = np.sqrt(np.diag(alone.covariance))
            np.testing.assert_allclose(fit.c, alone.c, rtol=1e-9, atol=1e-9 * std.max())
            np.testing.assert_allclose(fit.covariance, alone.covariance, rtol=1e-9, atol=1e-300)
        if fit is not None and isinstance(family.predict, Added):
            by_size = family.derivative_at_zero(plain.k)
            columns = np.concatenate([plain.data.regressor(MODEL), by_size], axis=-1)
            X = whiten_columns(columns, plain.noise).reshape(-1, columns.shape[-1])
            z = whiten(plain.measured, plain.noise).ravel()
            size = np.linalg.norm(X, axis=0)
            solved = np.linalg.lstsq(X / size, z)[0] / size
            assert fit.chi2 == pytest.approx(np.square(z - X @ solved).sum(), rel=1e-9)
            np.testing.assert_allclose(fit.c, solved[-family.dims :], 1e-7, 1e-7 * std.max())
