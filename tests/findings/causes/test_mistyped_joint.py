"""A mistyped joint is found although the other poses leave the compliances uncertain."""

import numpy as np
from readings import PLAN, STUDY

from edtk.findings.causes.wrong_pose import mistyped_joint
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
