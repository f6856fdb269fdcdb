"""Targets that need only a part of the parameters, whose best designs may leave the rest open."""

import numpy as np
import pytest

import criteria
from edtk.design.problem import Problem
from edtk.design.relaxation.relax import relax

GAP = 1e-6
ROUNDING = 1e-8


def target_of(rng, s, p):
    """A target (s, p) that needs the first s parameters."""
    return np.concatenate([rng.normal(size=(s, s)), np.zeros((s, p - s))], axis=1)


def check(found, best):
    """The gap is closed on the optimum over the s parameters, which no regular design attains."""
    assert found.solver == "NEWTON"
    assert 0 <= found.gap <= GAP
    assert found.cost == pytest.approx(best.cost, rel=GAP)
    # No design is better: a lower cost would be rounding.
    assert found.cost >= best.cost * (1 - best.gap - ROUNDING)


@pytest.mark.parametrize(("p", "s", "n", "seed"), [(4, 3, 300, 1), (8, 6, 500, 0), (12, 9, 500, 3)])
def test_candidates_without_and_with_a_nuisance(p, s, n, seed):
    """Visits without a load tell s parameters, those with one the same, and springs besides.

    The springs are no part of the target; the best design has no visit with a load.
    """
    rng = np.random.default_rng(seed)
    told = rng.normal(size=(n, 2, s))
    springs = rng.normal(size=(n, 2, p - s))
    without = np.concatenate([told, 0 * springs], axis=2)
    rows = np.concatenate([without, np.concatenate([told, springs], axis=2)])
    target = target_of(rng, s, p)
    best = relax(Problem(told), criteria.create("rho0", target=target[:, :s]), GAP)
    found = relax(Problem(rows), criteria.create("rho0", target=target), GAP)
    check(found, best)
    assert found.iterations <= 10


@pytest.mark.parametrize(("p", "s", "n", "seed"), [(2, 1, 20, 0), (6, 3, 100, 1), (6, 3, 100, 3)])
@pytest.mark.parametrize("name", ["rho0", "rho_max"])
def test_open_direction_that_is_no_parameter(name, p, s, n, seed):
    """As above where the open directions are not along an axis: inverses have no small entries."""
    rng = np.random.default_rng(seed)
    inside = np.concatenate([rng.normal(size=(n, 1, s)), np.zeros((n, 1, p - s))], axis=2)
    sizes = np.where(np.arange(p) < s, 0.3, 0.9)
    rows = np.concatenate([inside, sizes * rng.normal(size=(n, 1, p))])
    turn = np.linalg.qr(rng.normal(size=(p, p)))[0]
    target = target_of(rng, s, p)
    if name == "rho_max":
        target = target[:, None, :]
    best = relax(Problem(inside[..., :s]), criteria.create(name, target=target[..., :s]), GAP)
    found = relax(Problem(rows @ turn), criteria.create(name, target=target @ turn), GAP)
    check(found, best)
