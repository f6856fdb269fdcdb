"""Costs after an exchange, by updates, against the costs of the sums themselves."""

import numpy as np
import pytest

import criteria
from edtk.design.exact.exchange_costs import exchange_costs

EPS = np.finfo(float).eps


def slip(*matrices):
    """Relative error to which a cost is defined: 64 p eps cond, of the worst matrix."""
    return 64 * matrices[0].shape[-1] * EPS * max(np.linalg.cond(M).max() for M in matrices)


@pytest.mark.parametrize("name", criteria.available())
@pytest.mark.parametrize("rows", [1, 3])
def test_updates_equal_direct_costs(name, rows):
    """Updated costs are those of the matrices themselves, to rounding.

    The update of R by J subtracts from the inverse of R, which is exact to the condition of R at
    unit diagonal; what remains is smaller by the largest eigenvalue of ``R^-1 (R + J)``, and its
    relative error larger.
    """
    rng = np.random.default_rng(rows)
    p = 4
    unit = 10 ** rng.uniform(-3, 3, size=p) if criteria.get(name).unit_free else np.ones(p)
    criterion = criteria.create(name, rng.normal(size=(2, p)) * unit)
    for _ in range(10):
        B = rng.normal(size=(6, p))
        U = rng.normal(size=(50, rows, p))
        R = B.T @ B
        J = np.swapaxes(U, 1, 2) @ U
        lost = np.linalg.eigvals(np.linalg.solve(R, R + J)).real.max()
        scaled = R / np.sqrt(np.outer(np.diag(R), np.diag(R)))
        rest = R * np.outer(unit, unit)
        joined = J * np.outer(unit, unit)
        direct = criterion.cost(rest + joined)
        both = np.stack([U, U]) * unit
        once, twice = exchange_costs(criterion, np.array([rest, rest]), both, np.array([1.0, 2.0]))
        np.testing.assert_allclose(once, direct, rtol=slip(scaled) * lost)
        np.testing.assert_allclose(
            twice, criterion.cost(rest + 2 * joined), rtol=slip(scaled) * 2 * lost
        )


@pytest.mark.parametrize("name", criteria.available())
@pytest.mark.parametrize("left", [0.0, 1e-9, 1e-5])
def test_near_singular_rest(name, left):
    """Where the rest of a plan is nearly singular, costs are those of the matrices, bit by bit.

    A singular rest is told by its least eigenvalue at unit diagonal, here `left^2` to its order;
    the lemma would lose all digits.
    """
    rng = np.random.default_rng(7)
    p = 3
    B = rng.normal(size=(2, p))
    U = rng.normal(size=(20, 2, p))
    across = np.cross(*B)
    B = np.vstack([B, left * across / np.linalg.norm(across)])
    criterion = criteria.create(name, rng.normal(size=(2, p)))
    rest = B.T @ B
    joined = np.swapaxes(U, 1, 2) @ U
    direct = criterion.cost(rest + joined)
    assert np.isfinite(direct).all()
    regular = np.eye(p)
    both = exchange_costs(criterion, np.array([rest, regular]), np.stack([U] * 2), np.ones(2))
    assert both[0].tolist() == direct.tolist()
    np.testing.assert_allclose(both[1], criterion.cost(regular + joined), rtol=1e-12)


def test_exchange_beside_the_rounding_of_nothing():
    """A rest that excites a parameter by rounding alone is summed and inverted, not updated."""
    rest = np.array(
        [
            [1.957e14, 3.211e11, -5.452e3],
            [3.211e11, 2.803e13, 1.533e3],
            [-5.452e3, 1.533e3, 6.914e-7],
        ]
    )
    U = np.random.default_rng(0).normal(size=(50, 3, 3)) * 1e6
    criterion = criteria.create("A")
    costs = exchange_costs(criterion, rest[None], U[None], np.ones(1))[0]
    np.testing.assert_allclose(costs, criterion.cost(rest + np.swapaxes(U, -1, -2) @ U), rtol=1e-9)


@pytest.mark.parametrize("name", criteria.available())
@pytest.mark.parametrize("rows", [1, 2])
def test_rows_of_a_saturated_plan_are_traded(name, rows):
    """Where all rows are needed, costs with others in place of some are those of the matrices."""
    rng = np.random.default_rng(rows)
    p = 4
    B = rng.normal(size=(p, p))
    U = rng.normal(size=(30, rows, p))
    criterion = criteria.create(name, rng.normal(size=(2, p)))
    R = B[rows:].T @ B[rows:]
    joined = R + np.swapaxes(U, 1, 2) @ U
    told = np.linalg.cond(joined) < 1e6
    found = exchange_costs(criterion, R[None], U[None], np.ones(1), B[None, :rows])[0]
    np.testing.assert_allclose(found[told], criterion.cost(joined)[told], rtol=1e-8)
    assert told.sum() > 20
