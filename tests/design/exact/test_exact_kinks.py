"""Multipliers of nodes by the least eigenvalue: they are near the best, and never too low."""

from dataclasses import replace

import numpy as np
import pytest
from test_exact_weights import N, node_of

from edtk.design.exact.exact_kinks import _Game, spectral_multipliers
from edtk.design.exact.exact_nodes import NEAR_AT_KINKS, Merits, Nodes
from edtk.system.typing import Array


def solved(merits: Merits, nodes: Nodes, least: float = 0.0) -> tuple[Array, Array]:
    """Multipliers that bound merits, and weights, from a first multiplier of one."""
    one = np.eye(merits.p)[None]
    start = merits.scaled(one, one)
    Z, weights = spectral_multipliers(merits, nodes, np.zeros(N), start, least)
    scaled = merits.scaled(merits.unpacked(Z), one)
    scaled[:, merits.q :] = Z[:, merits.q :]
    return scaled, weights


@pytest.mark.parametrize("budget", [False, True])
def test_multiplier_and_weights_prove_each_other_best(budget: bool) -> None:
    """Weights sum to the counts and obey the funds; the bound is near what they reach."""
    for seed in range(6):
        merits, nodes, costs = node_of("E", seed, budget, None)
        Z, weights = solved(merits, nodes)
        assert (weights >= 0).all()
        assert np.add.reduceat(weights, nodes.heads) == pytest.approx(nodes.counts, rel=1e-5)
        assert not budget or weights @ costs <= 4.2 * (1 + 1e-5)
        bound = merits.tell(nodes, Z).merit[0]
        reached = merits.merits(replace(nodes, weights=weights))[0]
        assert reached * (1 - 1e-5) <= bound <= reached * (1 + 2 * NEAR_AT_KINKS)


def test_the_best_weights_begin_where_they_end() -> None:
    """From the best weights and their multiplier few steps are left; from equal ones more."""
    for seed in range(6):
        merits, nodes, _ = node_of("E", seed, False, None)
        Z, weights = solved(merits, nodes)
        chosen, known = nodes.spread(np.zeros(N))
        game = _Game.of(merits, nodes, chosen, known)
        bound = merits.tell(nodes, Z).merit
        begun = game.begun(merits, Z, bound, weights[chosen])
        assert game.merit(begun) == pytest.approx(begun.t)
        assert begun.w @ np.ones(N) == pytest.approx(nodes.counts.sum(), rel=1e-12)
        assert (np.linalg.eigvalsh(begun.S) > 0).all()
        assert begun.t > 0.6 * bound
        assert begun.t < game.merit(game.stepped(begun)) <= bound * (1 + 1e-9)


def test_a_budget_lowers_what_weights_reach() -> None:
    """The funds of the test above bind: without them the same node has a larger merit."""
    for seed in range(6):
        of = [node_of("E", seed, budget, None)[:2] for budget in (False, True)]
        free, bound = (
            merits.tell(nodes, solved(merits, nodes)[0]).merit[0] for merits, nodes in of
        )
        assert bound < free


def test_nodes_that_leave_something_open_disturb_no_others() -> None:
    """Two candidates of two rows tell three parameters; two copies of one row, and none, do not.

    The bound of the node that tells is the same beside others, and those have a merit of nothing.
    """
    merits, nodes, _ = node_of("E", 0, False, None)
    copied = merits.F.copy()
    copied[20:30] = copied[20]
    copied[30:] = 0.0
    merits = replace(merits, F=copied)
    parts = [np.arange(10), np.arange(20, 30), np.arange(30, N)]
    first = np.zeros(1, dtype=int)
    one = replace(nodes, weights=np.zeros(10), heads=first, counts=np.array([4]), numbers=first)
    alone = [replace(one, candidates=own) for own in parts]
    start = merits.scaled(np.eye(3)[None], np.eye(3)[None])
    z = np.zeros(10)
    Z, _ = spectral_multipliers(merits, alone[0], z, start, 0.0)
    every = Nodes.joined(alone)
    together, _ = spectral_multipliers(
        merits, every, np.zeros(30), np.repeat(start, 3, axis=0), 0.0
    )
    assert np.isfinite(together).all()
    assert together[0] == pytest.approx(Z[0], rel=1e-6, abs=1e-9)
    bounds = merits.tell(every, together).merit
    assert bounds[1] < 1e-2 * bounds[0]
    assert abs(bounds[2]) < 1e-9 * bounds[0]
