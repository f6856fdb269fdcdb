"""Loads: their wrenches, derivatives and bounds, and draws that are inside and even."""

import numpy as np
import pytest
from scipy.stats import chisquare, kstest

from edtk.robots.loads.bounded_load import BoundedLoad
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.loads.free_load import FreeLoad
from edtk.robots.loads.listed_load import ListedLoad

WRENCH = np.array([300.0, -200.0, 500.0, 40.0, -70.0, 90.0])
LOADS = {
    "fixed": FixedLoad(WRENCH),
    "bounded": BoundedLoad(WRENCH),
    "listed": ListedLoad(np.array([WRENCH, -WRENCH, 0.1 * WRENCH, 2 * WRENCH, 0 * WRENCH])),
    "free": FreeLoad(2500.0),
}
on_each = pytest.mark.parametrize("load", LOADS.values(), ids=LOADS)
UNLIKELY = 1e-6  # a fair sample is refused no more often


def drawn(load, n=5000, seed=0):
    """Variables (n, d) of random points of the unit cube."""
    return load.draw(np.random.default_rng(seed).random((n, load.limits.shape[1])))


@on_each
@pytest.mark.parametrize("batch", [(), (1,), (4,), (2, 3), (0,)])
def test_batches_equal_loops(load, batch):
    """Variables of any batch shape give the wrenches and derivatives that they give one by one."""
    u = (
        drawn(load, int(np.prod(batch))).reshape(*batch, -1)
        if np.prod(batch)
        else np.zeros((*batch, len(load.limits.T)))
    )
    d = u.shape[-1]
    answers = {load.wrench: (6,), load.derivative: (6, d)}
    for f, shape in answers.items():
        assert f(u).shape == (*batch, *shape)
        for i in np.ndindex(*batch):
            np.testing.assert_array_equal(f(u)[i], f(u[i]))


@pytest.mark.parametrize("kind", ["fixed", "bounded", "free"])
def test_derivatives_are_finite_differences(kind, derivative):
    """The derivative of the wrench is its finite difference, by size, elevation and azimuth."""
    load = LOADS[kind]
    for u in drawn(load, 20):
        if u.size:
            np.testing.assert_allclose(
                load.derivative(u), derivative(load.wrench, u), rtol=0, atol=1e-8 * 2500
            )
        else:
            assert load.derivative(u).shape == (6, 0)


def test_what_is_applied():
    """Each kind applies its wrenches: one, a part of the largest, one of a list, any force."""
    np.testing.assert_array_equal(LOADS["fixed"].wrench(np.zeros((2, 0))), [WRENCH, WRENCH])
    np.testing.assert_array_equal(
        LOADS["bounded"].wrench(np.array([[0.0], [0.25], [1.0]])), [0 * WRENCH, WRENCH / 4, WRENCH]
    )
    listed = LOADS["listed"]
    np.testing.assert_array_equal(listed.wrench(np.arange(5.0)[:, None]), listed.wrenches)
    down = np.array([[1.0, -np.pi / 2, 0.3], [0.6, 0.0, np.pi / 2], [0.6, np.pi, 0.0]])
    expected = [[0, 0, -2500, 0, 0, 0], [0, 1500, 0, 0, 0, 0], [-1500, 0, 0, 0, 0, 0]]
    np.testing.assert_allclose(LOADS["free"].wrench(down), expected, rtol=0, atol=1e-12 * 2500)


@on_each
def test_draws_are_inside(load):
    """Every point of the unit cube, its corners included, becomes variables within the bounds."""
    d = load.limits.shape[1]
    corners = (
        np.stack(np.meshgrid(*[[0.0, 1.0]] * d), axis=-1).reshape(-1, d) if d else np.zeros((1, 0))
    )
    lower, upper = load.limits
    for u in (drawn(load), load.draw(corners)):
        assert ((u >= lower) & (u <= upper)).all()


def test_sizes_are_drawn_uniformly():
    """The part of the largest wrench is uniform in [0, 1], by Kolmogorov's test."""
    assert kstest(drawn(LOADS["bounded"])[:, 0], "uniform").pvalue > UNLIKELY


def test_every_wrench_of_a_list_is_as_likely():
    """Whole indices come, each as often as the others, by Pearson's test."""
    u = drawn(LOADS["listed"])[:, 0]
    np.testing.assert_array_equal(u, np.rint(u))
    count = np.bincount(u.astype(int), minlength=5)
    assert len(count) == 5
    assert chisquare(count).pvalue > UNLIKELY


def test_forces_are_drawn_uniformly_in_the_ball():
    """Cubed length, coordinates of the direction and turn about z are uniform and unrelated.

    By Archimedes a coordinate of a uniform direction is uniform in [-1, 1]; a correlation of n
    independent pairs is below 5/sqrt(n) but for one in a million.
    """
    u = LOADS["free"].wrench(drawn(LOADS["free"]))[:, :3] / 2500
    r = np.linalg.norm(u, axis=1)
    turn = np.arctan2(u[:, 1], u[:, 0]) / (2 * np.pi) + 0.5
    uniform = [r**3, turn, *(0.5 + 0.5 * u.T / r)]
    assert min(kstest(x, "uniform").pvalue for x in uniform) > UNLIKELY
    C = np.corrcoef([r, *u.T / r])
    assert np.abs(C - np.eye(4)).max() < 5 / np.sqrt(len(u))


def test_the_limit_of_a_free_force():
    """The size of the force is its first variable times the largest, whatever the direction."""
    load = LOADS["free"]
    u = drawn(LOADS["free"], 50)
    np.testing.assert_allclose(np.linalg.norm(load.wrench(u), axis=1), 2500 * u[:, 0], rtol=1e-14)


def test_only_a_listed_load_does_not_move():
    """A descent may change the size and direction of a force, and not the index of a list."""
    assert [name for name, load in LOADS.items() if not load.moves] == ["listed"]
