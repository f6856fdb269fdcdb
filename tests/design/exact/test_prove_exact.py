"""Proofs that no plan of whole experiments is better, against all plans that there are."""

from dataclasses import replace
from fractions import Fraction
from itertools import combinations_with_replacement

import numpy as np
import pytest

import criteria
import edtk
from criteria import Relaxable
from edtk.certificate.problem_proofs import store_exact
from edtk.design.exact.counts.counts_bound import relaxed_counts
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.exact_nodes import Merits, Nodes
from edtk.design.exact.exact_tree import ExactTree
from edtk.design.exact.prove_exact import (
    ExactProof,
    UnprovableError,
    _Best,
    _Search,
    prove_exact,
)
from edtk.design.information import Rows, pack, sensitivity_rows, unpack
from edtk.design.problem import Problem
from edtk.system.typing import Array

pytestmark = pytest.mark.slow

NAMES = ("A", "D", "E", "G", "O1", "O3", "c", "Ds", "rho0")


def criterion_of(name: str, p: int, rng: np.random.Generator) -> Relaxable:
    """A criterion of p parameters."""
    own: dict[str, object] = {"name": name}
    if name == "c":
        own["c"] = rng.normal(size=p).tolist()
    if name == "Ds":
        own["interest"] = np.eye(p)[:, :1].tolist()
    if name == "rho0":
        own["target"] = rng.normal(size=(2, p)).tolist()
    found = criteria.from_dict(own)
    assert isinstance(found, Relaxable)
    return found


def least_cost(problem: Problem, criterion: Relaxable, limits: Limits) -> float:
    """The least cost of all plans."""
    plans = np.array(list(combinations_with_replacement(range(problem.n), limits.m)))
    return float(
        criterion.cost(problem.plan_information(plans, np.ones(plans.shape)) + limits.base).min()
    )


def drawn(seed: int) -> tuple[Problem, Limits, np.random.Generator]:
    """A small problem with several rows, every fourth with a prior, every third of two levels."""
    rng = np.random.default_rng(seed)
    p, r, n = rng.integers(2, 5), rng.integers(1, 4), rng.integers(5, 11)
    A = rng.normal(size=(n, r, p))
    B = rng.normal(size=(2, p)) if seed % 4 == 1 else np.zeros((1, p))
    problem = Problem(np.sign(A) if seed % 3 == 0 else A)
    return problem, Limits(int(rng.integers(p, 6)), B.T @ B), rng


@pytest.mark.parametrize("seed", range(9))
def test_what_is_proved_is_the_best_of_all_plans(seed: int) -> None:
    """The best plan is found and proved, and the bound is not above it."""
    problem, limits, rng = drawn(seed)
    criterion = criterion_of(NAMES[seed % len(NAMES)], problem.p, rng)
    best = least_cost(problem, criterion, limits)
    found = prove_exact(problem, criterion, limits, seconds=60)
    assert found.proved
    assert found.ended == "proved"
    assert found.counts.sum() == limits.m
    assert found.best == pytest.approx(best, rel=1e-9)
    assert best * (1 - 3e-9) <= found.cost <= best


@pytest.mark.parametrize("seed", [4, 7, 9])
def test_a_plan_that_fixing_leaves_alone_is_tried(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where no start, exchange or rounding finds a plan, the node that is this plan alone does."""
    rng = np.random.default_rng(seed)
    p, n = int(rng.integers(2, 4)), int(rng.integers(8, 16))
    m = rng.integers(p, 5)
    problem = Problem(rng.normal(size=(n, 1, p)))
    limits = Limits(int(m), np.zeros((p, p)))
    criterion = criterion_of("ADE"[seed % 3], p, rng)
    rounded = _Search._round

    def round_alone(self: _Search, nodes: Nodes) -> None:
        if (nodes.sizes == np.bincount(nodes.node_of_group)).all():
            rounded(self, nodes)

    none = np.zeros((0, m), dtype=int)
    monkeypatch.setattr(_Search, "_starts", lambda self, root, told: none)
    monkeypatch.setattr(_Search, "_exchange", lambda self, places: None)
    monkeypatch.setattr(_Search, "_round", round_alone)
    found = prove_exact(problem, criterion, limits, seconds=60)
    assert found.proved
    assert found.best == pytest.approx(least_cost(problem, criterion, limits), rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_limits_of_candidates_and_kept_experiments_are_heeded(seed: int) -> None:
    """With a limit for each candidate, beside kept experiments, the best plan within is proved."""
    problem, limits, rng = drawn(seed)
    most = rng.integers(0, 3, problem.n)
    most[:2] = 2
    limits = replace(limits, most=most, m=3, base=limits.base + 0.1 * np.eye(problem.p))
    criterion = criterion_of(NAMES[seed % 4], problem.p, rng)
    plans = np.array(list(combinations_with_replacement(range(problem.n), limits.m)))
    counts = np.array([np.bincount(plan, minlength=problem.n) for plan in plans])
    plans = plans[(counts <= most).all(axis=1)]
    M = problem.plan_information(plans, np.ones(plans.shape)) + limits.base
    found = prove_exact(problem, criterion, limits, seconds=60)
    assert found.proved
    assert (found.counts <= most).all()
    assert found.best == pytest.approx(criterion.cost(M).min(), rel=1e-9)


def test_candidates_that_leave_parameters_open_are_proved_for_the_others() -> None:
    """No candidate tells the last parameter: a contrast of the first two has its best plan."""
    rows = np.random.default_rng(3).normal(size=(9, 1, 3))
    rows[:, :, 2] = 0.0
    limits = Limits(3, np.zeros((3, 3)))
    criterion = criteria.from_dict({"name": "c", "c": [1.0, -1.0, 0.0]})
    assert isinstance(criterion, Relaxable)
    found = prove_exact(Problem(rows), criterion, limits)
    assert found.proved
    assert found.best == pytest.approx(least_cost(Problem(rows), criterion, limits), rel=1e-9)


@pytest.mark.parametrize("name", ["E", "O3", "G", "A"])
def test_polars_of_many_multipliers_are_those_of_each(name: str) -> None:
    """At once or one by one, in parameters as given or in others."""
    rng = np.random.default_rng(5)
    B, C, T = rng.normal(size=(3, 6, 3, 3))
    Z, M = B @ B.swapaxes(1, 2), C @ C.swapaxes(1, 2)
    plain = criterion_of(name, 3, rng)
    other = plain.transformed(T[0])
    assert isinstance(other, Relaxable)
    for criterion in (plain, other):
        alone = [criterion.lower_bound(z[None], np.ones(1), m) for z, m in zip(Z, M, strict=True)]
        np.testing.assert_allclose(criterion.polars(Z, M), alone, rtol=1e-9)


def parabola(n: int = 101) -> Problem:
    """Rows (1, x, x^2) of points from -1 to 1."""
    x = np.linspace(-1, 1, n)
    return Problem(np.stack([np.ones(n), x, x**2], axis=-1)[:, None])


def test_a_proof_without_time_bounds_all_plans() -> None:
    """No time is left after the root: the bound is that of weights, and not above the best plan."""
    limits = Limits(7, np.zeros((3, 3)))
    whole = prove_exact(parabola(), criteria.create("A"), limits)
    brief = prove_exact(parabola(), criteria.create("A"), limits, seconds=0.0)
    assert whole.proved
    assert brief.ended == "budget"
    assert not brief.proved
    assert 0.9 * whole.best < brief.cost < whole.best


def test_the_bound_begins_with_that_of_weights() -> None:
    """At a kink the best multiplier is that of the relaxation: the root is not below its bound."""
    problem = Problem(np.random.default_rng(2).normal(size=(40, 1, 4)))
    limits = Limits(7, np.zeros((4, 4)))
    criterion = criteria.create("E")
    assert isinstance(criterion, Relaxable)
    relaxed = relaxed_counts(problem, criterion, limits)
    found = prove_exact(problem, criterion, limits, seconds=0.0, relaxed=relaxed)
    assert found.cost >= relaxed.cost * (1 - 1e-6)


def test_multipliers_at_kinks_come_near_the_best() -> None:
    """From a multiplier that proves little, Newton's method comes to the bound of best weights."""
    problem = Problem(np.random.default_rng(2).normal(size=(60, 1, 4)))
    criterion = criteria.create("E")
    assert isinstance(criterion, Relaxable)
    limits = Limits(7, np.zeros((4, 4)))
    relaxed = relaxed_counts(problem, criterion, limits)
    search = _Search(problem, criterion, limits, relaxed, None)
    nodes = search.open[0].nodes
    poor = search.merits.scaled(np.eye(4)[None], np.eye(4)[None])
    before = search.merits.tell(nodes, poor)
    _, best = search._settled(nodes, _Best(before, poor, np.eye(4)[None]))
    assert search.merits.cost_of(float(before.merit[0])) < 0.9 * relaxed.cost
    assert search.merits.cost_of(float(best.told.merit[0])) > (1 - 1e-3) * relaxed.cost


@pytest.mark.parametrize("name", ["D", "E"])
def test_siblings_farther_out_take_the_multiplier_of_a_nearer_one(name: str) -> None:
    """One closes others of its parent, on its own side: more nodes are closed than multipliers."""
    problem = Problem(np.random.default_rng(4).normal(size=(60, 1, 3)))
    found = prove_exact(problem, criteria.create(name), Limits(7, np.zeros((3, 3))))
    tree = found.tree
    assert found.proved
    assert len(tree.multipliers) < 0.6 * tree.nodes
    own = np.flatnonzero(tree.multiplier != tree.multiplier[tree.parent])[1:]
    for parent in np.unique(tree.parent[own]):
        nodes = own[tree.parent[own] == parent]
        of = tree.multiplier[nodes[np.argsort(tree.count[nodes])]]
        assert len(np.unique(of)) == 1 + (np.diff(of) != 0).sum()


def test_an_interrupted_proof_keeps_its_bound() -> None:
    """Ctrl-C after some nodes leaves a bound that is sharper than that of the root."""
    limits = Limits(7, np.zeros((3, 3)))
    criterion = criteria.create("A")

    def interrupt(nodes: int, cost: float, bound: float) -> None:
        if nodes > 1:
            raise KeyboardInterrupt

    brief = prove_exact(parabola(), criterion, limits, seconds=0.0)
    found = prove_exact(parabola(), criterion, limits, progress=interrupt)
    whole = prove_exact(parabola(), criterion, limits)
    assert found.ended == "interrupted"
    assert brief.cost <= found.cost <= whole.best


def test_a_worse_incumbent_is_replaced() -> None:
    """A proof that begins with a bad plan finds the best one."""
    limits = Limits(6, np.zeros((3, 3)))
    bad = np.zeros(101, dtype=int)
    bad[[50, 51, 52]] = 2
    found = prove_exact(parabola(), criteria.create("D"), limits, bad)
    assert found.proved
    np.testing.assert_array_equal(np.flatnonzero(found.counts), [0, 50, 100])


def test_equal_candidates_stand_for_one_another() -> None:
    """Rows and their opposites tell the same: half of the candidates have a position."""
    rows = np.random.default_rng(1).normal(size=(20, 1, 3))
    limits = Limits(5, np.zeros((3, 3)))
    both = prove_exact(Problem(np.concatenate([rows, -rows])), criteria.create("D"), limits)
    assert len(both.tree.order) == 20
    assert both.best == pytest.approx(prove_exact(Problem(rows), criteria.create("D"), limits).best)


@pytest.mark.parametrize("name", ["E", "G"])
def test_weights_of_equal_candidates_are_one(name: str) -> None:
    """Where the relaxation weighs a copy that has no position, its weight begins the proof."""
    rows = np.array([[0, -1], [-1, -1], [1, 1], [1, -1], [0, 1], [0, 0], [1, 1], [-1, 1]], float)
    problem = Problem(rows[:, None])
    criterion, limits = criteria.create(name), Limits(2, np.zeros((2, 2)))
    best = least_cost(problem, criterion, limits)
    relaxed = relaxed_counts(problem, criterion, limits)
    copies = replace(relaxed, counts=np.array([0, 0, 0, 0, 0, 0, 1, 1.0]))
    plan = np.array([0, 1, 0, 1, 0, 0, 0, 0])
    found = prove_exact(problem, criterion, limits, plan, relaxed=copies, seconds=60)
    assert found.proved
    assert found.best == pytest.approx(best, rel=1e-9)


@pytest.mark.parametrize("name", ["O4", "O2"])
def test_a_criterion_without_a_proof_says_why(name: str) -> None:
    """Criteria that are not convex, or of degree zero, are refused in one line."""
    with pytest.raises(UnprovableError, match=name):
        prove_exact(parabola(), criteria.create(name), Limits(6, np.zeros((3, 3))))


@pytest.mark.parametrize("seed", [0, 1, 2, 5, 6])
@pytest.mark.parametrize("seconds", [60.0, 0.0])
def test_the_tree_can_be_recomputed(seed: int, seconds: float) -> None:
    """Nodes, groups and multipliers prove the bound by the rules that `ExactTree` states."""
    problem, limits, rng = drawn(seed)
    criterion = criterion_of(NAMES[seed % len(NAMES)], problem.p, rng)
    found = prove_exact(problem, criterion, limits, seconds=seconds)
    assert recomputed(found, problem, criterion, limits) >= found.cost


def test_a_tree_with_other_multipliers_proves_less() -> None:
    """Multipliers that leave plans open do not prove the bound."""
    problem, limits, _ = drawn(0)
    criterion = criteria.create("A")
    assert isinstance(criterion, Relaxable)
    found = prove_exact(problem, criterion, limits)
    found.tree.multipliers[:] = np.eye(problem.p)
    assert recomputed(found, problem, criterion, limits) < found.cost


def recomputed(found: ExactProof, problem: Problem, criterion: Relaxable, limits: Limits) -> float:
    """The bound of a tree, step by step as its docstring has it."""
    tree = found.tree
    z_of, u_of = sensitivities(tree, problem, criterion, limits)
    least = found.cost ** (-1 / criterion.degree)
    groups: dict[int, Array] = {-1: np.zeros(len(tree.order), dtype=int)}
    counts: dict[int, list[int]] = {-1: [limits.m]}
    merit = {-1: np.inf}
    parents = set(tree.parent.tolist())
    worst = 0.0
    for i in range(tree.nodes):
        parent = int(tree.parent[i])
        own = groups[parent].copy()
        number = list(counts[parent])
        if i:
            at = np.arange(len(own))
            own[(own == tree.group[i]) & (at >= tree.first[i]) & (at < tree.stop[i])] = len(number)
            number[tree.group[i]] -= tree.count[i]
            number.append(int(tree.count[i]))
        own[(own >= 0) & (np.array([*number, 0])[own] == 0)] = -1
        top = merit[parent]
        for k in [tree.multiplier[i]] if not i else [tree.multiplier[parent], tree.multiplier[i]]:
            z = z_of[k]
            tops = np.array([z[own == g].max(initial=-np.inf) for g in range(len(number))])
            u = u_of[k] + sum(c * t for c, t in zip(number, tops, strict=True) if c)
            top = min(top, u)
            inside = np.flatnonzero(own >= 0)
            own[inside[u - tops[own[inside]] + z[inside] <= least]] = -1
        if top > least:
            groups[i], counts[i], merit[i] = own, number, top
            chosen = np.flatnonzero(own >= 0)
            if len(chosen) == len(set(own[chosen])):  # one plan
                plan = np.bincount(tree.order[chosen], np.array(number)[own[chosen]], problem.n)
                cost = float(criterion.cost(problem.information(plan) + limits.base))
                top = cost ** (-1 / criterion.degree)
            worst = worst if i in parents else max(worst, top)
    return min(found.cost, worst**-criterion.degree if worst else np.inf)


def sensitivities(
    tree: ExactTree, problem: Problem, criterion: Relaxable, limits: Limits
) -> tuple[Array, Array]:
    """Sensitivities (r, n) of the positions, and those of what all plans have (r,)."""
    own = criterion.transformed(tree.T)
    assert isinstance(own, Relaxable)
    white = problem.in_units(tree.T)
    one = np.ones(1)
    polars = np.array([own.lower_bound(Z[None], one, white.mean) for Z in tree.multipliers])
    Z = tree.multipliers * (polars ** (-1 / criterion.degree))[:, None, None]
    K = tree.T.T @ limits.base @ tree.T
    return white.sensitivities(Z)[:, tree.order], np.einsum("kij,ij->k", Z, K)


def far_line(middle: float) -> Array:
    """Rows (1, x) of seven points about a middle far from the origin."""
    return np.stack([np.ones(7), middle + np.arange(-3.0, 4.0)], axis=-1)[:, None]


@pytest.mark.parametrize("middle", [0.0, 1e5, 1e7])
def test_nearly_dependent_parameters_are_proved_from_their_rows(middle: float) -> None:
    """The determinant of a line does not change with its middle, nor do plan and proof."""
    found = edtk.plan(Problem(far_line(middle)), size=4, criterion="D", prove=5)
    assert found.proved_exact
    np.testing.assert_array_equal(found.counts, [2, 0, 0, 0, 0, 0, 2])
    assert found.cost == pytest.approx(1 / 12, rel=1e-9)


def test_squares_of_nearly_dependent_rows_have_no_proof() -> None:
    """What squares have lost nothing brings back, so that nothing is said to be proved."""
    rows = far_line(1e5)
    problem = Problem.of_information(pack(np.swapaxes(rows, 1, 2) @ rows))
    with pytest.raises(UnprovableError, match=r"nearly dependent: .* condition number"):
        edtk.plan(problem, size=4, criterion="D", prove=5)


@pytest.mark.parametrize("seed", range(9))
def test_the_best_plan_within_a_budget_of_costs_is_proved(seed: int) -> None:
    """Costs whole or not, beside a size or in its place, with equal experiments of other costs."""
    problem, limits, rng = drawn(seed)
    criterion = criterion_of(NAMES[seed % len(NAMES)], problem.p, rng)
    base = limits.base + 0.1 * np.eye(problem.p)
    problem = Problem(np.concatenate([problem.factors()[:5], problem.factors()[:2]]))
    costs = rng.integers(1, 5, 7).astype(float) if seed % 2 else rng.uniform(1.0, 3.0, 7)
    m = 4
    sized = seed % 3 > 0
    funds = float(np.sort(costs)[:3].sum() + 1.0)
    if not sized:
        funds = min(funds, 4.9 * costs.min())
        m = int(funds / costs.min())
    limits = Limits(m, base, costs=costs, funds=max(funds, m * costs.min()), sized=sized)
    sizes = [m] if sized else range(m + 1)
    plans = [p for k in sizes for p in combinations_with_replacement(range(7), k)]
    counts = np.array([np.bincount(np.array(p, dtype=int), minlength=7) for p in plans])
    counts = counts[counts @ costs <= limits.funds * (1 + 1e-12)]
    best = min(criterion.cost(problem.information(own) + base) for own in counts)
    found = prove_exact(problem, criterion, limits, seconds=60)
    assert found.proved
    assert found.counts @ costs <= limits.funds * (1 + 1e-12)
    assert found.best == pytest.approx(best, rel=1e-9)
    assert best * (1 - 3e-9) <= found.cost <= best


@pytest.mark.parametrize("most", [None, np.full(6, 2)])
def test_merits_are_above_exact_ones_of_every_plan(most: Array | None) -> None:
    """What a multiplier tells is not below rational arithmetic, in sums of any signs.

    Without an allowance for rounding about every second one would be.
    """
    rng = np.random.default_rng(0)
    for _ in range(40):
        rows = rng.normal(size=(6, 2, 3))
        T = rng.normal(size=(3, 3)) * 10.0 ** rng.uniform(-3, 3, size=3)
        kept = Rows(rows).times(T)
        error = 2 * Rows(rows).rounding_of_times(T) * np.linalg.norm(kept.A, axis=(1, 2))
        criterion = criteria.create("D")
        assert isinstance(criterion, Relaxable)
        twice = sensitivity_rows(np.ones((3, 3)))
        F = np.ascontiguousarray(twice[:, None] * kept.packed()).T.copy()
        merits = Merits(criterion, F, np.zeros(6), float(error.max()), 4, most)
        alone = np.zeros(1, dtype=int)
        whole = Nodes(np.arange(6), np.full(6, 4 / 6), alone, np.array([4]), alone, alone, alone)
        B = rng.normal(size=(3, 3))
        Z = pack(B @ B.T)[None]
        told = merits.tell(whole, Z).merit[0]
        z = [exact_sensitivity(rows[i], T, unpack(Z[0])) for i in range(6)]
        times = 4 if most is None else 2
        best = sum(times * value for value in sorted(z, reverse=True)[: 4 // times])
        assert Fraction(float(told)) >= best


def exact_sensitivity(A: Array, T: Array, Z: Array) -> Fraction:
    """``<Z, T'A'A T>`` in rational numbers."""
    p = len(T)
    X = [
        [sum(Fraction(float(a[j])) * Fraction(float(T[j, k])) for j in range(p)) for k in range(p)]
        for a in A
    ]
    return sum(
        (Fraction(float(Z[j, k])) * x[j] * x[k] for x in X for j in range(p) for k in range(p)),
        Fraction(0),
    )


@pytest.mark.parametrize("size", [1e-100, 1e100])
@pytest.mark.parametrize("rows", [1.0, "alike"])
@pytest.mark.parametrize("name", ["rho0", "rho_max", "c", "I", "prediction_G", "Ds"])
def test_what_a_criterion_is_about_may_be_in_any_units(
    name: str, rows: float | str, size: float
) -> None:
    """Beside rows of order one, or in their units: a proof is found, and its certificate holds."""
    X = np.random.default_rng(1).normal(size=(4, 1, 2))
    given = {
        "rho0": {"target": X[0]},
        "rho_max": {"targets": X[:2]},
        "c": {"c": X[0, 0]},
        "I": {"points": X[:, 0]},
        "prediction_G": {"points": X[:2, 0]},
        "Ds": {"interest": X[0, 0]},
    }[name]
    about = {key: size * value for key, value in given.items()}
    problem = edtk.Problem(X * (size if rows == "alike" else 1.0))
    plan = edtk.plan(problem, 2, criteria.create(name, **about), prove=20)
    assert plan.proved_exact
    assert edtk.verify(store_exact(plan), problem).valid
