"""rho_max, beyond the laws that it shares with all criteria: several tasks, and their weights."""

import tracemalloc

import numpy as np
import pytest
from matrices import candidates, positive, sensitivities, slip

import criteria
from criteria.linalg.inverse import whitener
from criteria.worst_task_accuracy import WorstTaskAccuracy

TARGETS = np.random.default_rng(0).normal(size=(7, 3, 4))


def test_it_is_the_largest_rho0():
    """The value is the largest rho0 of the tasks, each by itself."""
    rng = np.random.default_rng(1)
    c = criteria.create("rho_max", targets=TARGETS)
    for _ in range(5):
        M = positive(rng, 4)
        each = [float(criteria.create("rho0", target=A).value(M)) for A in TARGETS]
        assert c.value(M) == pytest.approx(max(each), rel=slip(M))


def test_a_task_that_is_given_twice_changes_no_bit():
    """Costs, smoothed costs, gradients and bounds are those without the copy, in any order."""
    rng = np.random.default_rng(2)
    M = np.array([positive(rng, 4) for _ in range(3)])
    once = WorstTaskAccuracy(TARGETS)
    twice = WorstTaskAccuracy(np.concatenate([TARGETS, TARGETS[2:5]])[::-1])
    for sharpness in (np.inf, 8.0):
        np.testing.assert_array_equal(
            twice.smoothed(sharpness).cost(M), once.smoothed(sharpness).cost(M)
        )
        np.testing.assert_array_equal(
            twice.smoothed(sharpness).gradient(M), once.smoothed(sharpness).gradient(M)
        )
    Z = -once.gradient(M[0])
    assert twice.polar(Z, M[0]) == pytest.approx(once.polar(Z, M[0]), rel=1e-14)


def test_tasks_without_harm_do_not_count():
    """A task of zero rows is never the worst, also where the maximum is smoothed."""
    M = positive(np.random.default_rng(3), 4)
    with_zero = WorstTaskAccuracy(np.concatenate([np.zeros((2, 3, 4)), TARGETS]))
    for sharpness in (np.inf, 2.0):
        assert with_zero.smoothed(sharpness).cost(M) == (
            WorstTaskAccuracy(TARGETS, sharpness)
        ).cost(M)
    Z = -with_zero.gradient(M)
    assert not with_zero.dual_weights(Z, M)[:2].any()


@pytest.mark.parametrize("targets", [np.zeros((2, 3, 2)), [1.0, 2.0], [[[np.nan, 1.0]]]])
def test_targets_that_are_no_matrices_are_refused(targets):
    """Zero, flat or non-finite targets are a ValueError."""
    with pytest.raises(ValueError, match="targets must be finite matrices"):
        criteria.create("rho_max", targets=targets)


def test_any_weights_of_the_tasks_prove_a_bound():
    """The polar is below the cost of every X with ``<Z, X> = 1``, and is that of its weights."""
    rng = np.random.default_rng(4)
    c = WorstTaskAccuracy(TARGETS)
    for _ in range(5):
        Z = positive(rng, 4, 1e2)
        M = positive(rng, 4, 1e2)
        weights = c.dual_weights(Z, M)
        assert (weights >= 0).all()
        assert weights.sum() == pytest.approx(1, abs=1e-12)
        target = (np.sqrt(weights)[:, None, None] * TARGETS).reshape(-1, 4)
        assert c.polar(Z, M) == pytest.approx(
            criteria.create("rho0", target=target).polar(Z, M), rel=1e-9
        )


def test_weights_of_an_optimum_close_the_gap():
    """Where ``Z = cov L cov`` with L a mean of equally bad tasks, the bound is the cost of M."""
    rng = np.random.default_rng(5)
    for _ in range(5):
        M = positive(rng, 4)
        cov = np.linalg.inv(M)
        errors = np.sqrt(np.einsum("tri,ij,trj->t", TARGETS, cov, TARGETS))
        c = WorstTaskAccuracy(TARGETS / errors[:, None, None])
        weights = rng.dirichlet(np.ones(7)) * (rng.uniform(size=7) > 0.4) + 1e-3 * np.eye(7)[0]
        L = np.einsum("t,tri,trj->ij", weights / weights.sum(), c.targets, c.targets)
        Z = cov @ L @ cov
        assert c.polar(Z, M) == pytest.approx(c.cost(M) * np.sqrt(np.sum(Z * M)), rel=1e-10)


def test_relaxation_over_many_tasks_is_proved():
    """Over random candidates and 200 tasks the multiplier of the program proves 1e-6."""
    from matrices import optimum

    rng = np.random.default_rng(6)
    c = WorstTaskAccuracy(rng.normal(size=(200, 3, 4)))
    blocks = candidates(rng, 12, 4)
    M, Z = optimum(c, blocks)
    bound = c.lower_bound(Z[None], sensitivities(Z[None], blocks), M)
    assert 0 <= 1 - bound / c.cost(M) <= 1e-6
    weights = c.dual_weights(Z, M)
    T = whitener(M)
    errors = np.linalg.norm((c.targets @ T).reshape(200, -1), axis=1)
    assert errors[weights > 1e-6].min() >= (1 - 1e-4) * errors.max()


@pytest.mark.slow
def test_weights_of_many_tasks_take_memory_for_each_and_not_for_each_pair():
    """Of 20,000 tasks a matrix of pairs would have three gigabytes."""
    targets = np.random.default_rng(0).normal(size=(20_000, 1, 2))
    c = criteria.create("rho_max", targets=targets)
    tracemalloc.start()
    weights = c.dual_weights(np.eye(2), np.eye(2))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e8
    assert weights.sum() == pytest.approx(1.0)
