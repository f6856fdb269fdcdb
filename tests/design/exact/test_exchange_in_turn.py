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


@pytest.mark.parametrize("name", ["D", "A", "E"])
def test_saturated_plans_of_one_row_are_exchanged_without_an_inverse_for_each_candidate(
    monkeypatch, name
):
    """From singular starts, with as many places as parameters, no single exchange is left over."""
    X = np.array(np.meshgrid(*[[-1.0, 1.0]] * 7)).reshape(7, -1).T
    problem = Problem(np.column_stack([np.ones(128), X])[:, None, :])
    criterion = create(name)
    start = np.random.default_rng(0).integers(0, 128, (6, 8))
    start[0] = 5
    asked = []
    cost_of = type(criterion).cost
    monkeypatch.setattr(
        type(criterion), "cost", lambda self, M: asked.append(len(M)) or cost_of(self, M)
    )
    places, costs = exchange(problem, criterion, start)
    assert sum(asked) < 128
    monkeypatch.undo()
    M = problem.plan_information(places, np.ones((6, 8)))
    np.testing.assert_allclose(criterion.cost(M), costs, rtol=1e-12)
    blocks = problem.blocks()
    for own, plan, cost in zip(M, places, costs, strict=True):
        tried = own - blocks[plan][:, None] + blocks
        assert criterion.cost(tried).min() >= cost * (1 - 1e-9)


def quadratic_in_three():
    """Blocks (125, 1, 10) of a quadratic model on a grid of three factors, and a size."""
    x = np.stack(np.meshgrid(*[np.linspace(-1, 1, 5)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    pairs = [x[:, i] * x[:, j] for i in range(3) for j in range(i, 3)]
    return np.column_stack([np.ones(len(x)), x, *pairs])[:, None], 15


def corners_of_five():
    """Blocks (32, 1, 6) of a plane over the corners of a cube, and a size."""
    x = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 5, indexing="ij"), axis=-1).reshape(-1, 5)
    return np.column_stack([np.ones(len(x)), x])[:, None], 8


def with_a_second_row():
    """The corners (32, 2, 6), each seen again from the other side of the first factor."""
    blocks, size = corners_of_five()
    return np.concatenate([blocks, 0.5 * blocks * [1, -1, 1, 1, 1, 1]], axis=1), size


@pytest.mark.parametrize(
    ("name", "model"),
    [
        *[(name, quadratic_in_three) for name in "DA"],
        *[(name, corners_of_five) for name in "EG"],
        *[(name, with_a_second_row) for name in "DAEG"],
    ],
)
def test_equal_exchanges_are_decided_by_order_and_not_by_last_digits(name, model):
    """Rows that differ by some roundings have the same plans, though many trades tie."""
    blocks, size = model()
    rng = np.random.default_rng(0)
    starts = rng.integers(len(blocks), size=(60, size))
    rounded = blocks * (1 + 1e-15 * rng.normal(size=blocks.shape))
    criterion = criteria.create(name)
    found = [exchange(Problem(each), criterion, starts)[0] for each in (blocks, rounded)]
    np.testing.assert_array_equal(*found)
