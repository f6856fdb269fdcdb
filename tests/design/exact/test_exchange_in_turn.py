"""Exchange of places and of repetitions in turn."""

import numpy as np
import pytest

import criteria
from criteria import create
from edtk.design.exact.apportion import apportion
from edtk.design.exact.exchange import exchange
from edtk.design.exact.refine import exchange_in_turn
from edtk.design.problem import Problem


@pytest.mark.parametrize("name", criteria.available())
def test_exchange_in_turn(name):
    """The exchange in turn keeps the sum, and is no worse than an exchange of places alone."""
    for seed in range(2):
        rng = np.random.default_rng(seed)
        problem = Problem(rng.normal(size=(15, 2, 3)))
        criterion = create(name, rng.normal(size=(2, 3)))
        start = rng.integers(0, 15, (4, 3))
        even = np.tile(apportion(np.ones(3), 8).astype(float), (4, 1))
        places, repeats = exchange_in_turn(problem, criterion, start, even)
        reached = criterion.cost(np.einsum("bk,bkij->bij", repeats, problem.blocks(places)))
        assert (repeats.sum(axis=1) == 8).all()
        assert (reached <= exchange(problem, criterion, start, even)[1] * (1 + 1e-9)).all()
        for move in (np.eye(3)[:, None] - np.eye(3)[None]).reshape(-1, 3):
            allowed = (repeats + move >= 0).all(axis=1)
            moved = np.einsum(
                "bk,bkij->bij", (repeats + move)[allowed], problem.blocks(places[allowed])
            )
            assert (criterion.cost(moved) >= reached[allowed] * (1 - 1e-8)).all()
        alone = [
            exchange_in_turn(problem, criterion, start[i : i + 1], even[i : i + 1])[0][0]
            for i in range(4)
        ]
        np.testing.assert_array_equal(places, alone)
