"""Plans by counts: what a criterion needs, where its value does not depend on all of it."""

from itertools import combinations, combinations_with_replacement, product

import numpy as np
import pytest

import criteria
import edtk

CANDIDATES = 9
TELLING = 3  # the last ones, and they alone tell the last parameter
DEAR = 1.4


def all_counts(sizes):
    """Counts of all plans of such sizes."""
    return np.array(
        [
            np.bincount(plan, minlength=CANDIDATES)
            for m in sizes
            for plan in combinations_with_replacement(range(CANDIDATES), m)
        ]
    )


@pytest.mark.parametrize("priced", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_a_parameter_that_counts_nothing(seed, priced):
    """The best plan tells a parameter that the task does not depend on: that of all plans."""
    rng = np.random.default_rng([77, seed])
    p, m = 3, 4
    rows = rng.normal(size=(CANDIDATES, 1, p))
    rows[:-TELLING, 0, -1] = 0.0
    rows[-TELLING:] *= 0.3
    target = rng.normal(size=(2, p))
    target[:, -1] = 0.0
    rho0 = criteria.from_dict({"name": "rho0", "target": target.tolist()})
    counts = all_counts(range(1, m + 1) if priced else [m])
    costs = np.where(np.arange(CANDIDATES) < CANDIDATES - TELLING, 1.0, DEAR)
    asked = {"costs": costs, "cost_budget": float(m)} if priced else {"size": m}
    if priced:
        counts = counts[counts @ costs <= m + 1e-9]
    tells_last = counts[:, -TELLING:].any(axis=1)
    information = np.einsum("kn,nra,nrb->kab", counts[tells_last], rows, rows)
    regular = np.linalg.eigvalsh(information)[:, 0] > 1e-9
    covariance = np.linalg.inv(information[regular])
    least = np.sqrt(np.einsum("ta,kab,tb->k", target, covariance, target).min())
    plan = edtk.plan(edtk.Problem(rows), criterion=rho0, seed=1, **asked)
    assert plan.counts[-TELLING:].any()
    assert plan.value == pytest.approx(least, rel=1e-9)


@pytest.mark.parametrize("name", "ADEG")
@pytest.mark.parametrize(("levels", "factors", "size"), [(2, 3, 7), (3, 2, 6), (2, 4, 11)])
def test_ties_are_decided_by_order_and_not_by_last_digits(name, levels, factors, size):
    """The best of saturated plans, which start singular, stays where rows differ by roundings."""
    x = np.array(list(product(np.linspace(-1.0, 1.0, levels), repeat=factors)))
    pairs = [x[:, i] * x[:, j] for i, j in combinations(range(factors), 2)]
    squares = [x[:, i] ** 2 for i in range(factors)] if levels > 2 else []
    rows = np.column_stack([np.ones(len(x)), x, *pairs, *squares])[:, None]
    rounded = rows * (1 + 1e-15 * np.random.default_rng(0).normal(size=rows.shape))
    asked = {"criterion": name, "size": size, "seed": 1, "starts": 64}
    plans = [edtk.plan(edtk.Problem(each), **asked) for each in (rows, rounded)]
    np.testing.assert_array_equal(*[plan.counts for plan in plans])


@pytest.mark.parametrize("name", ["D", "A", "E"])
@pytest.mark.slow
def test_what_blocks_leave_open_is_no_matter_for_an_interest(name):
    """Contrasts of treatments beside a constant, in blocks of two: the plan without a constant."""
    contrasts = np.eye(5)[:, 1:]
    with_constant = edtk.Problem(np.column_stack([np.ones(5), contrasts])[:, None])
    asked = {"name": name, "interest": list(with_constant.parameters[1:])}
    found = edtk.plan(with_constant, criterion=asked, blocks=[2] * 5, starts=32)
    alone = edtk.plan(edtk.Problem(contrasts[:, None]), criterion=name, blocks=[2] * 5, starts=32)
    assert found.value == pytest.approx(alone.value, rel=1e-9)
    assert found.efficiency == pytest.approx(alone.efficiency, rel=1e-6)


def test_a_parameter_without_a_regressor_is_no_matter_for_an_interest():
    """A column of zeros tells nothing, and nothing that is asked for needs it."""
    x = np.linspace(-1, 1, 9)
    line = np.column_stack([np.ones(9), x])
    wide = edtk.Problem(np.column_stack([line, np.zeros(9)])[:, None], parameters=("a", "b", "z"))
    found = edtk.plan(wide, 4, {"name": "A", "interest": ["a", "b"]})
    assert found.value == pytest.approx(edtk.plan(edtk.Problem(line[:, None]), 4, "A").value)
