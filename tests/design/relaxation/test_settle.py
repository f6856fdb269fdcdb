"""Poses and weights of a relaxed design move together to the optimum nearby."""

import numpy as np
import pytest

from criteria import create
from edtk.design.region import Region
from edtk.design.relaxation.settle import settle

NEAR = 1e-4


def powers(x):
    """Rows of a parabola."""
    return np.stack([np.ones(len(x)), x[:, 0], x[:, 0] ** 2], axis=-1)


def settled(region, criterion, points, weights):
    """The points (l,) of a design of one variable after a descent."""
    x = np.array(points)[:, None]
    blocks = region.problem(x).blocks()
    found = settle(region, criterion, x, np.array(weights), blocks)
    return None if found is None else np.sort(found[:, 0])


def test_a_parabola():
    """D rests on both ends and the middle, wherever a design near it begins; so does A."""
    region = Region(powers, -1.0, 1.0)
    for name in ("D", "A"):
        found = settled(region, create(name), [-0.8, 0.2, 0.9], [0.2, 0.5, 0.3])
        np.testing.assert_allclose(found, [-1.0, 0.0, 1.0], atol=NEAR)


def test_michaelis_and_menten():
    """D of ``V s/(K + s)`` on [0, 4] at K = 1 rests on 4 and on ``4/(2 + 4)``."""

    def rows(x):
        s = x[:, 0]
        return np.stack([s / (1 + s), -2 * s / (1 + s) ** 2], axis=-1)

    found = settled(Region(rows, 0.0, 4.0), create("D"), [0.4, 3.0], [0.4, 0.6])
    np.testing.assert_allclose(found, [2 / 3, 4.0], atol=NEAR)


def test_points_that_tell_the_same_become_one():
    """Of points side by side one moves."""
    region = Region(powers, -1.0, 1.0)
    points = [-1.0, -0.999, 0.0, 0.001, 1.0]
    found = settled(region, create("D"), points, [0.2, 0.1, 0.2, 0.2, 0.3])
    np.testing.assert_allclose(found, [-1.0, 0.0, 1.0], atol=NEAR)


def test_beside_a_prior():
    """Beside a prior that knows nothing of the slope, D of a parabola still ends at both bounds."""
    prior = np.diag([0.0, 0.0, 5.0])
    region = Region(powers, -1.0, 1.0, prior=prior)
    found = settled(region, create("D"), [-0.8, 0.2, 0.9], [0.4, 0.2, 0.4])
    np.testing.assert_allclose(found[[0, -1]], [-1.0, 1.0], atol=NEAR)


@pytest.mark.parametrize("name", ["E", "O4"])
def test_kinks_have_no_such_descent(name):
    """Criteria with kinks are left to the search alone."""
    region = Region(powers, -1.0, 1.0)
    assert settled(region, create(name), [-1.0, 0.0, 1.0], [0.3, 0.4, 0.3]) is None


def line(x):
    """Rows of a straight line."""
    return np.stack([np.ones(len(x)), x[:, 0]], axis=-1)


def test_no_design_hangs_on_almost_no_weight():
    """The intercept alone is known best at zero, with hardly a weight on the slope, and no plan of
    whole experiments is like that. On both sides of zero a design without such a weight is as good.
    """
    criterion = create("rho0", np.array([[1.0, 0.0]]))
    assert settled(Region(line, 0.0, 1.0), criterion, [0.1, 0.9], [0.9, 0.1]) is None
    around = settled(Region(line, -1.0, 1.0), criterion, [-0.5, 0.4], [0.4, 0.6])
    assert around[0] < 0 < around[1]
