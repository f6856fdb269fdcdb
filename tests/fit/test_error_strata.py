"""Residuals of visits, split by what moves together."""

import numpy as np
import pytest

from edtk.fit.estimate_noise import ErrorStrata, Visited, estimate_noise
from edtk.fit.least_squares import Whitened
from edtk.fit.measurements import simulate
from edtk.fit.noise import visit_covariance
from tests.support.readings import STUDY
from tests.support.visits import MODEL, TRACKER, motion_of, visited

pytestmark = pytest.mark.slow

JOINTS = 3e-5  # [rad], which moves markers by about 50 um
DISCREPANCY = 3e-5  # [m]


def seen_of(data, measured):
    """The residuals of measured deflections (m, 3), fitted with the tracker's noise."""
    whitened = Whitened.of(data.regressor(MODEL), data.sigma, MODEL.parameters)
    unit = np.eye(3) / data.sigma[:, :, None]
    motion = motion_of(data) / data.sigma[..., None]
    z = whitened.residual(measured)
    return Visited(z, whitened.Q, motion, data.pose, data.visits, data.places, unit)


def strata_of(data, measured):
    return ErrorStrata.of(seen_of(data, measured))


def draw(data, joints, discrepancy, runs, seed=0):
    """Deflections (runs, m, 3) with such errors."""
    d = np.full((len(data), 3), discrepancy)
    noise = visit_covariance(data, data.sigma, motion_of(data, joints), d)
    A = data.regressor(MODEL)
    return simulate(A, STUDY.compliances, noise, np.random.default_rng(seed), runs)


def test_degrees_of_freedom():
    """Three markers show six motions and three coordinates more; the model takes five of the 48."""
    data = visited(poses=8, visits=3)
    found = strata_of(data, draw(data, JOINTS, DISCREPANCY, 1)[0])
    dof = [found.tracker.dof, found.shape.dof, found.visits.dof, found.poses.dof]
    assert dof == [8 * 3 * 2, 8 * 3, 8 * 6 * 2, 8 * 6 - 5]
    once = strata_of(visited(visits=1), draw(visited(visits=1), JOINTS, 0.0, 1)[0])
    assert [once.tracker.dof, once.shape.dof, once.visits.dof] == [0, 24, 0]
    single = visited(visits=3, markers=1)
    assert [s.dof for s in strata_of(single, draw(single, JOINTS, 0.0, 1)[0]).all] == [48, 19]
    again = visited(visits=2, markers=1, readings=2)
    assert [s.dof for s in strata_of(again, draw(again, JOINTS, 0.0, 1)[0]).all] == [48, 24, 19]


def test_every_square_is_in_one_stratum():
    """The sums of squares add up to chi-square."""
    data = visited()
    measured = draw(data, JOINTS, DISCREPANCY, 1)[0]
    found = strata_of(data, measured)
    whitened = Whitened.of(data.regressor(MODEL), data.sigma, MODEL.parameters)
    chi2 = float((whitened.residual(measured) ** 2).sum())
    assert sum(stratum.squares for stratum in found.all) == pytest.approx(chi2, rel=1e-10)


def test_a_gap_in_the_sheet():
    """Where markers and visits are missing the strata are chi-squares still: 60 simulations."""
    data = visited()
    data = data[np.delete(np.arange(len(data)), [1, 7, 8, 30, 40, 41, 42])]
    found = [strata_of(data, one) for one in draw(data, 0.0, 0.0, 60)]
    for name in ("tracker", "shape", "visits", "poses"):
        squares = np.array([getattr(one, name).squares for one in found])
        dof = getattr(found[0], name).dof
        assert abs(squares.mean() - dof) < 4.5 * np.sqrt(2 * dof / 60), name


def test_variances_are_estimated():
    """Of 30 data sets the mean estimates are the true variances, and their spread is as said."""
    data = visited()
    found = [estimate_noise(seen_of(data, one)) for one in draw(data, JOINTS, DISCREPANCY, 30)]
    assert all(one.p < 1e-6 and all(one.told) for one in found)
    for name, true, i in (
        ("tracker", 1.0, 0),
        ("joints", JOINTS, 1),
        ("discrepancy", DISCREPANCY, 2),
    ):
        values = np.array([getattr(one, name) for one in found])
        std = np.median([one.std[i] for one in found])
        assert values.mean() == pytest.approx(true, abs=5 * std / np.sqrt(30))
        assert values.std() == pytest.approx(std, rel=0.5)


def test_level_of_the_test():
    """Where joints do not move, p is uniform: below 1 % and 50 % as often as that."""
    data = visited(poses=3, visits=1)
    p = np.array([estimate_noise(seen_of(data, one)).p for one in draw(data, 0.0, 0.0, 100)])
    assert np.mean(p < 0.01) < 0.05
    assert 0.35 < np.mean(p < 0.5) < 0.65


def test_what_cannot_be_told():
    """One visit of each pose does not tell joints from the model; one marker nothing at all."""
    data = visited(visits=1)
    found = estimate_noise(seen_of(data, draw(data, JOINTS, 0.0, 1)[0]))
    assert found.told == (True, True, False)
    assert not found.revisited
    assert found.joints == pytest.approx(JOINTS, rel=0.5)
    assert found.tracker == pytest.approx(1.0, rel=0.4)
    single = visited(markers=1, sigma=TRACKER)
    assert estimate_noise(seen_of(single, draw(single, JOINTS, 0.0, 1)[0])) is None
