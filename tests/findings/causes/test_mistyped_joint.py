"""Poses that are off: by a mistyped joint among uncertain compliances, or by any shift."""

import numpy as np
import pytest
from readings import PLAN, STUDY

from edtk.findings.causes.evidence import FACTORS, WEIGHTS
from edtk.findings.causes.wrong_pose import mistyped_joint, shifted
from edtk.fit.least_squares import Estimate, Whitened
from edtk.fit.measurements import Measurements, simulate

MODEL = STUDY.model
TYPED = (1, 2, 3, 4, 5)


def sheet(seed, rows, joint, degrees):
    """Readings of the plan, some of whose rows were made with another value of a joint."""
    q = PLAN.q.copy()
    q[rows, joint] += np.deg2rad(degrees)
    A = MODEL.regressor(q, PLAN.wrench)
    moved = simulate(A, STUDY.compliances, STUDY.sigma, np.random.default_rng(seed))[0]
    sigma = np.tile(STUDY.sigma, (len(moved), 1))
    return Measurements(PLAN.q, PLAN.wrench, moved, sigma, np.zeros(moved.shape))


def without(data, rows):
    """The compliances of the other rows, and the sum of squares that they leave."""
    others = np.setdiff1d(np.arange(len(data)), rows)
    A = data[others].regressor(MODEL)
    whitened = Whitened.of(A, data.sigma[others], MODEL.parameters)
    rest = float((whitened.residual(data.deflection[others]) ** 2).sum())
    return Estimate(whitened.solve(data.deflection[others]), whitened.covariance), rest


def test_misfit_is_that_of_all_rows_refitted():
    """What the joint leaves, and the other rows, is the sum of squares of one fit of all."""
    rows = np.array([2, 3])
    data = sheet(0, rows, 3, 12.0)
    others, rest = without(data, rows)
    found = mistyped_joint(MODEL, data, data.deflection, others, rows, TYPED)
    q = data.q.copy()
    q[rows, found.joint] += found.change
    whitened = Whitened.of(MODEL.regressor(q, data.wrench), data.sigma, MODEL.parameters)
    together = float((whitened.residual(data.deflection) ** 2).sum())
    np.testing.assert_allclose(rest + found.misfit, together, rtol=1e-8)


def test_the_right_value_fits_though_the_others_know_little():
    """Of 20 poses that were mistyped, whose readings few others check, none is left unexplained."""
    few = slice(0, 4)
    for seed in range(20):
        data = sheet(seed, np.array([0]), 1 + seed % 5, 15.0)[few]
        others, _ = without(data, np.array([0]))
        found = mistyped_joint(MODEL, data, data.deflection, others, np.array([0]), TYPED)
        assert found is not None


@pytest.mark.parametrize("taken", [0, 1, 2])
def test_a_shift_costs_by_the_part_of_it_that_springs_leave(taken):
    """Score is -2 log of the mean likelihood of shifts of usual sizes, whatever springs take up.

    With the product G of what they leave of its columns, and b that with the readings, the mean
    over normal shifts of variance t^2 is ``det(I + t^2 G)^-1/2 exp(b' (G + I/t^2)^-1 b / 2)``.
    """
    rng = np.random.default_rng(taken)
    A = rng.standard_normal((8, 3, 4))
    pose = np.repeat(np.arange(4), 2)
    A[2:, :, :taken] = 0.0  # springs that move the first pose alone
    A[:2] = A[:1]
    measured = rng.standard_normal((8, 3))
    whitened = Whitened.of(A, np.full((8, 3), 0.1), tuple("abcd"))
    z = whitened.residual(measured)
    chi2 = float((z**2).sum())
    usual = np.array([0.3, 0.3, 0.1])
    found = next(iter(shifted(whitened, measured, chi2, pose, "pose", usual)))
    columns = np.zeros((3, 8, 3))
    columns[range(3), :2, range(3)] = usual[:, None]
    left = np.stack([whitened.residual(one).ravel() for one in columns])
    G, b = left @ left.T, left @ z.ravel()
    gain = [
        -np.linalg.slogdet(np.eye(3) + t**2 * G)[1] + b @ np.linalg.solve(G + np.eye(3) / t**2, b)
        for t in FACTORS
    ]
    assert found.dims == 3 - taken
    assert found.deviance + found.rarity == pytest.approx(
        chi2 - 2 * np.log(WEIGHTS @ np.exp(np.array(gain) / 2)), rel=1e-9
    )
