"""`edtk.relax` within limits on counts: against another solver, and as certificates."""

import copy

import numpy as np
import pytest

import edtk
from edtk.design.problem import RankDeficientError

RNG = np.random.default_rng(5)
N, P, SIZE = 14, 3, 6
A = RNG.normal(size=(N, P))
PROBLEM = edtk.Problem(A[:, None, :])
C = RNG.normal(size=(2, N))
LEVEL = C.mean(axis=1) * SIZE


def _by_cvxpy(name, least, most, size, rows):
    """The best value of counts within limits, by a solver of cones."""
    import cvxpy as cp

    x = cp.Variable(N)
    M = A.T @ cp.diag(x) @ A
    obeyed = [x >= least, x <= most, *(c @ x <= high for c, high in rows)]
    if size is not None:
        obeyed.append(cp.sum(x) == size)
    if name == "A":
        return cp.Problem(cp.Minimize(cp.tr_inv(M)), obeyed).solve(solver="CLARABEL")
    best = cp.log_det(M) / P if name == "D" else cp.lambda_min(M)
    found = cp.Problem(cp.Maximize(best), obeyed).solve(solver="CLARABEL")
    return np.exp(found) if name == "D" else found


@pytest.mark.parametrize("name", ["D", "A", "E"])
def test_weights_are_those_of_a_solver_of_cones(name):
    """Counts of one size within least, most and constraints cost as little as can be."""
    least = np.where(np.arange(N) < 3, 0.2, 0.0)
    found = edtk.relax(
        PROBLEM,
        name,
        size=SIZE,
        least=least,
        most=1,
        constraints=[(C[0], None, LEVEL[0] - 0.5), (C[1], LEVEL[1] + 0.5, None)],
    )
    rows = [(C[0], LEVEL[0] - 0.5), (-C[1], -LEVEL[1] - 0.5)]
    value = _by_cvxpy(name, least, 1.0, SIZE, rows)
    each = value * SIZE if name == "A" else value / SIZE
    assert found.value == pytest.approx(each, rel=1e-6)
    assert 0 <= found.gap < 1e-6
    assert found.counts.sum() == pytest.approx(SIZE)
    assert (found.counts >= least - 1e-9).all()
    assert (found.counts <= 1 + 1e-9).all()
    assert edtk.verify(found.to_dict(), PROBLEM).valid


@pytest.mark.slow
def test_budgets_without_a_size_decide_on_the_number():
    """Two budgets buy what tells the most, and the value is that of all experiments."""
    costs = 1 + RNG.uniform(size=(2, N))
    found = edtk.relax(PROBLEM, "D", costs=costs, cost_budget=[9.0, 8.0], most=2)
    value = _by_cvxpy("D", 0.0, 2.0, None, [(costs[0], 9.0), (costs[1], 8.0)])
    assert found.value == pytest.approx(value, rel=1e-6)
    assert found.experiments == pytest.approx(found.counts.sum())
    assert (costs @ found.counts <= np.array([9.0, 8.0]) * (1 + 1e-9)).all()
    assert edtk.verify(found.to_dict(), PROBLEM).valid
    plan = edtk.plan(PROBLEM, costs=costs, cost_budget=[9.0, 8.0], most=2, starts=2)
    assert plan.value <= found.bound * (1 + 1e-12)


@pytest.mark.slow
def test_limits_that_do_not_bind_change_nothing():
    """Weights within wide limits are those without any, with a prior and of interest too."""
    for problem in (PROBLEM, PROBLEM.with_prior(0.1 * np.eye(P))):
        for criterion in ("D", {"name": "c", "c": [1, 0, 0]}):
            free = edtk.relax(problem, criterion)
            held = edtk.relax(problem, criterion, most=1)
            assert held.value == pytest.approx(free.value, rel=1e-6)
            assert held.bound == pytest.approx(free.bound, rel=1e-6)


def test_relaxation_of_a_certificate_is_that_within_its_limits():
    """What is read from a certificate has the limits, their bound and their counts."""
    found = edtk.relax(PROBLEM, "D", size=SIZE, most=1)
    again = type(found).from_dict(found.to_dict(), PROBLEM)
    assert again.bound == pytest.approx(found.bound, rel=1e-9)
    assert np.allclose(again.counts, found.counts)
    assert found.certify(PROBLEM)[1] == pytest.approx(found.proved_bound.cost, rel=1e-9)
    said = edtk.verify(found.to_dict(), PROBLEM).summary()
    assert "with limits by the file's own word; the bound is proved on its" in said.splitlines()[0]
    assert "obey the limits of the certificate" in said


LIES = {
    "a tighter limit": lambda c: c["limits"].update(most=[0.3] * N),
    "another size": lambda c: c["limits"].update(size=5.0),
    "a constraint that counts break": lambda c: c["limits"]["constraints"][0].update(largest=-9.0),
    "a constraint left out": lambda c: c["limits"].update(constraints=[]),
    "no limits": lambda c: [c.pop(k) for k in ("limits", "experiments", "limit_multipliers")],
    "some of their keys": lambda c: c.pop("experiments"),
    "multipliers of a sum without a limit": lambda c: c.update(limit_multipliers=[[-1e-3]]),
    "a better bound": lambda c: c.update(bound=c["bound"] * 0.99),
    "more experiments": lambda c: c.update(experiments=7.0),
}
REFUSED = ("a constraint left out", "some of their keys")


@pytest.mark.parametrize("lie", sorted(LIES))
def test_certificate_that_lies_about_limits_is_not_valid(lie):
    """Whatever is changed about the limits, the check sees it."""
    found = edtk.relax(PROBLEM, "D", size=SIZE, most=1, constraints=[(C[0], None, LEVEL[0] - 1.0)])
    content = copy.deepcopy(found.to_dict())
    assert edtk.verify(content, PROBLEM).valid
    LIES[lie](content)
    if lie in REFUSED:
        with pytest.raises(edtk.UserError, match="not a certificate: limit"):
            edtk.verify(content, PROBLEM)
    else:
        assert not edtk.verify(content, PROBLEM).valid


IMPOSSIBLE = {
    "most": ({"most": 0.01}, "allows 0.14 in all, expected 1 or more"),
    "least": ({"least": 0.5}, "asks for 7 in all, expected 1 or less"),
    "both": ({"least": 0.3, "most": 0.2}, "candidate 0: 0.3 or more, but 0.2 at most"),
    "budget": ({"size": 9, "costs": [1] * N, "cost_budget": 8}, "cost_budget[0] and size"),
    "rows": ({"constraints": [([1] * N, None, 0.5)]}, "constraints[0] and size together"),
    "degree": ({"criterion": "O2", "most": 1}, "O2 has no bound under limits"),
    "all": ({"costs": [1] * N, "cost_budget": 1e-170}, "buys 1e-170 experiments"),
    "told": ({"most": [1, 1] + [0] * (N - 2)}, "within the limits no experiments tell"),
}


@pytest.mark.parametrize("case", sorted(IMPOSSIBLE))
def test_impossible_limits_are_named(case):
    """One line says which limits leave nothing, or nothing that can be bounded."""
    options, words = IMPOSSIBLE[case]
    with pytest.raises((edtk.UserError, RankDeficientError)) as error:
        edtk.relax(PROBLEM, **options)
    assert words in str(error.value)


def test_prior_needs_a_size_beside_a_budget():
    """What a prior counts for depends on the number of experiments."""
    for problem, criterion in (
        (PROBLEM.with_prior(np.eye(P)), "D"),
        (PROBLEM, {"name": "bayes_A", "precision": np.eye(P).tolist()}),
    ):
        with pytest.raises(edtk.UserError, match="a prior counts per experiment"):
            edtk.relax(problem, criterion, costs=np.ones(N), cost_budget=5)
