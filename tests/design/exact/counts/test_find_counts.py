"""Plans by counts: what a criterion needs, where its value does not depend on all of it."""

from itertools import combinations_with_replacement

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
