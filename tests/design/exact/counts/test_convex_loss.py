"""Losses with tangents: slopes against differences, convexity, and values after exchanges."""

import numpy as np
import pytest

import criteria
from edtk.design.exact.counts.convex_loss import ConvexLoss, convex_loss

RNG = np.random.default_rng(5)
P = 5
TARGET = RNG.normal(size=(2, P))
NAMES = ("A", "D", "rho0")


def some_information(count: int) -> np.ndarray:
    """Regular information matrices (count, p, p)."""
    A = RNG.normal(size=(count, 2 * P, P))
    return np.swapaxes(A, 1, 2) @ A


def loss_of(name: str, scale: float = 1.0) -> ConvexLoss:
    """The loss of a criterion, for targets of any size."""
    found = convex_loss(criteria.create(name, scale * TARGET), np.eye(P))
    assert found is not None
    return found


@pytest.mark.parametrize("name", NAMES)
def test_costs_are_those_of_the_criterion(name):
    """The cost of a loss is the criterion's, in units as small as those of a calibration."""
    loss = loss_of(name, scale=1e-12)
    for M in some_information(3):
        cost = loss.cost(np.array([loss.tangent(M)[0]]))[0]
        assert cost == pytest.approx(float(loss.criterion.cost(M)), rel=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_slopes_against_differences(name):
    """Z is minus the derivative of the loss in any direction."""
    loss = loss_of(name)
    M, E = some_information(2)
    step = 1e-5
    difference = (loss.tangent(M + step * E)[0] - loss.tangent(M - step * E)[0]) / (2 * step)
    assert -np.sum(loss.tangent(M)[1] * E) == pytest.approx(difference, rel=1e-7)


@pytest.mark.parametrize("name", NAMES)
def test_a_tangent_is_below_everywhere(name):
    """At no information is the loss below a tangent."""
    loss = loss_of(name)
    matrices = some_information(12)
    for X in matrices:
        value, Z = loss.tangent(X)
        for M in matrices:
            assert loss.tangent(M)[0] >= value - np.sum(Z * (M - X)) - 1e-12


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("rank", [P, P - 2])
def test_costs_after_an_exchange(name, rank):
    """Rows that join a plan, or the singular rest of one, cost what their sum does."""
    loss = loss_of(name)
    A = RNG.normal(size=(rank, P))
    rest = A.T @ A
    U = RNG.normal(size=(20, 3, P))
    expected = loss.criterion.cost(rest + np.swapaxes(U, 1, 2) @ U)
    assert np.isfinite(expected).all()
    np.testing.assert_allclose(loss.joined_costs(rest, U), expected, rtol=1e-8)


def test_other_criteria_have_none():
    """A criterion of eigenvalues has kinks, and is of neither kind."""
    assert convex_loss(criteria.create("E"), np.eye(P)) is None
    assert convex_loss(criteria.create("O4"), np.eye(P)) is None
