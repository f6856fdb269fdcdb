"""Covariances of visits: what is common to which measurements."""

from dataclasses import replace

import numpy as np
import pytest

from edtk.fit.correlated_noise import CorrelatedNoise
from edtk.fit.least_squares import estimate
from edtk.fit.noise import TooManyVisitsError, visit_covariance
from tests.support.visits import MODEL, motion_of, visited

JOINTS = 3e-5
DISCREPANCY = 4e-5


def whole(noise):
    """The covariance of all coordinates, from the blocks."""
    m, rows = noise.shape
    found = np.zeros((m, rows, m, rows))
    for block in noise.blocks:
        for members, C in zip(block.members, block.covariance, strict=True):
            s = len(members)
            found[np.ix_(members, range(rows), members, range(rows))] = C.reshape(s, rows, s, rows)
    return found


def test_what_is_common_to_whom():
    """Visits share motions of the joints, all visits of a pose the discrepancy of each marker."""
    data = visited(poses=2, visits=2)
    data = data[np.random.default_rng(0).permutation(len(data))]
    M = motion_of(data, JOINTS)
    d = np.full((len(data), 3), DISCREPANCY)
    found = whole(visit_covariance(data, data.sigma, M, d))
    for i in range(len(data)):
        for j in range(len(data)):
            expected = np.zeros((3, 3))
            if (data.q[i] == data.q[j]).all() and data.visit[i] == data.visit[j]:
                expected += M[i] @ M[j].T
            if (data.q[i] == data.q[j]).all() and (data.marker[i] == data.marker[j]).all():
                expected += DISCREPANCY**2 * np.eye(3)
            if i == j:
                expected += data.sigma[0, 0] ** 2 * np.eye(3)
            np.testing.assert_allclose(found[i, :, j], expected, rtol=1e-12, atol=1e-22)


def test_tracker_alone_is_independent():
    """Without motions and discrepancy every measurement has the noise of its own, of any kind."""
    data = visited(poses=2)
    root = np.random.default_rng(1).standard_normal((len(data), 3, 3)) * 1e-5
    own = CorrelatedNoise.by_row(root @ np.swapaxes(root, 1, 2))
    none = np.zeros((len(data), 3))
    found = visit_covariance(data, own, np.zeros((len(data), 3, 6)), none)
    x = np.random.default_rng(2).standard_normal((len(data), 3))
    np.testing.assert_allclose((found.whiten(x) ** 2).sum(), (own.whiten(x) ** 2).sum(), rtol=1e-9)


def test_more_visits_do_not_average_out_the_discrepancy():
    """With many visits the covariance is that of one visit of the discrepancy alone."""
    bounds = []
    for visits, joints in ((1, 0.0), (40, JOINTS)):
        data = visited(poses=8, visits=visits, markers=1, sigma=1e-8 if visits == 1 else 1e-5)
        d = np.full((len(data), 3), DISCREPANCY)
        noise = visit_covariance(data, data.sigma, motion_of(data, joints), d)
        A = data.regressor(MODEL)
        bounds.append(estimate(A, data.deflection, noise, MODEL.parameters).std)
    assert np.all(bounds[1] > bounds[0])
    np.testing.assert_allclose(bounds[1], bounds[0], rtol=0.1)


def test_too_many_visits_are_refused():
    """A group whose matrix would take minutes is an error that names a row."""
    data = visited(poses=1, visits=600, markers=1)
    d = np.full((600, 3), DISCREPANCY)
    with pytest.raises(TooManyVisitsError, match="row 1: 600 measurements share an error"):
        visit_covariance(data, data.sigma, motion_of(data, JOINTS), d)


def test_visits_without_a_column():
    """Repetitions of a marker are visits of their own; different markers are of the same one."""
    data = visited(poses=2, visits=2)
    by_order = replace(data, visit=None)
    np.testing.assert_array_equal(by_order.visits, data.visits)
    order = np.random.default_rng(3).permutation(len(data))
    some = by_order[order][:9]
    assert len(np.unique(some.visits)) == len(np.unique(data.visits[order[:9]]))
