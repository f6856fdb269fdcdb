"""Of readings whose errors hang together only the one that is off is an outlier."""

import numpy as np
import pytest

from edtk.fit.identify import identify
from edtk.fit.least_squares import Whitened
from edtk.fit.measurements import simulate
from edtk.fit.noise import visit_covariance
from edtk.fit.outliers import find_outliers
from tests.support.visits import MODEL, STUDY, motion_of, visited

DATA = visited(poses=8, visits=2)
A = DATA.regressor(MODEL)
JOINTS = 3e-5  # [rad]: markers of a visit move together by ten times the tracker's noise
NOISE = visit_covariance(DATA, DATA.sigma, motion_of(DATA, JOINTS), np.zeros_like(DATA.sigma))


def readings(seed, off):
    """Simulated readings of which some rows are off by so much along y [m]."""
    moved = simulate(A, STUDY.compliances, NOISE, np.random.default_rng(seed))[0]
    for row, size in off.items():
        moved[row, 1] += size
    return moved


def outliers(seed, off, robust=False):
    fit = identify(A, readings(seed, off), NOISE, MODEL.parameters, robust)
    return fit.outliers.tolist()


@pytest.mark.parametrize("robust", [False, True])
def test_neighbours_of_an_outlier_are_none(robust):
    """Other readings of its visit seem to be off as well, and are not named."""
    seeming = 0
    for seed in range(4):
        off = {5: 3e-4}
        assert outliers(seed, off, robust) == [5]
        whitened = Whitened.of(A, NOISE, MODEL.parameters)
        z = whitened.residual(readings(seed, off))
        total = float((z**2).sum())
        dof = z.size - MODEL.p
        seeming += len(find_outliers(*whitened.deletable(z), dof, total=total)) > 1
    assert seeming


def test_outliers_of_two_visits_are_both_named():
    """Each is one without the other."""
    for seed in range(4):
        assert outliers(seed, {5: 3e-4, 20: -2e-4}) == [5, 20]


def test_good_readings_have_none():
    """Errors that hang together are no outliers: at 1 % one of twenty sheets may have one."""
    assert sum(bool(outliers(seed, {})) for seed in range(20)) <= 2
