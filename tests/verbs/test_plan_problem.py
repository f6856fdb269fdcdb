"""`edtk.plan` of problems of arrays: enumeration, textbook optima, limits, and wrong arguments."""

from itertools import combinations, combinations_with_replacement, product

import numpy as np
import pandas as pd
import pytest
from no_dual import NoDual

import criteria
import edtk
from edtk.design.relaxation.relax import RelaxationInterrupted, relax
from edtk.system.errors import UserError

RNG = np.random.default_rng(11)
NAMES = ("A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5")


def quadratic(levels: int, factors: int) -> np.ndarray:
    """Rows of the full quadratic model on a grid."""
    x = np.array(list(product(np.linspace(-1, 1, levels), repeat=factors)))
    pairs = [x[:, i] * x[:, j] for i, j in combinations(range(factors), 2)]
    return np.column_stack([np.ones(len(x)), x, x**2, *pairs])


def costs_of(problem, criterion, plans):
    """Costs of plans given as lists of candidates."""
    counts = np.array([np.bincount(plan, minlength=problem.n) for plan in plans])
    return np.array([criterion.cost(problem.information(own)) for own in counts])


@pytest.mark.parametrize("rows", [1, 2])
@pytest.mark.parametrize("name", NAMES)
def test_small_plans_are_the_best_of_all(name, rows):
    """For every criterion the plan is the best of all plans, and the bound is below it."""
    problem = edtk.Problem(np.random.default_rng(rows).normal(size=(7, rows, 3)))
    criterion = criteria.create(name)
    best = costs_of(problem, criterion, combinations_with_replacement(range(7), 4)).min()
    found = edtk.plan(problem, size=4, criterion=name, starts=8)
    assert found.cost == pytest.approx(best, rel=1e-9)
    assert found.counts.sum() == 4
    assert found.lower_bound.cost <= best * (1 + 1e-9)
    assert found.efficiency == pytest.approx(found.lower_bound.cost / best)
    assert found.value == pytest.approx(float(criterion.value(problem.information(found.counts))))


@pytest.mark.parametrize(
    ("levels", "factors", "size", "best"),
    [(5, 3, 15, 0.4594898), (3, 4, 15, 0.4250473), (3, 4, 24, 0.4723634)],
)
def test_best_known_quadratic_plans_are_reached(levels, factors, size, best):
    """Determinants of full quadratic models are those of the best plans that are known."""
    rows = quadratic(levels, factors)
    found = edtk.plan(edtk.Problem(rows[:, None, :]), size=size, seed=1, starts=48)
    assert found.value / size >= best - 5e-8
    assert found.bound >= found.value


@pytest.mark.slow
@pytest.mark.parametrize("k", [11, 12])
def test_hadamard_matrices_are_found_and_proved(k):
    """Twelve runs of eleven factors and a constant, and of twelve factors, reach the bound."""
    bits = (np.arange(2**k)[:, None] >> np.arange(k)) & 1
    rows = np.hstack([np.ones((2**k, 12 - k)), 2.0 * bits - 1.0])
    found = edtk.plan(edtk.Problem(rows[:, None, :]), size=12)
    assert found.value == pytest.approx(12.0, rel=1e-9)
    assert found.ended == "proved"
    assert found.efficiency == pytest.approx(1.0, abs=1e-9)


def test_without_replacement_and_with_limits():
    """Counts obey their limits, and the plan is the best of those that do."""
    problem = edtk.Problem(RNG.normal(size=(8, 1, 3)))
    criterion = criteria.create("D")
    once = edtk.plan(problem, size=5, most=1, starts=16)
    assert once.cost == pytest.approx(costs_of(problem, criterion, combinations(range(8), 5)).min())
    assert once.counts.max() == 1
    most = np.array([0, 2, 1, 0, 1, 2, 3, 1])
    plans = [
        plan
        for plan in combinations_with_replacement(range(8), 5)
        if (np.bincount(plan, minlength=8) <= most).all()
    ]
    found = edtk.plan(problem, size=5, most=most, starts=16)
    assert found.cost == pytest.approx(costs_of(problem, criterion, plans).min(), rel=1e-9)
    assert (found.counts <= most).all()
    assert found.lower_bound.cost <= found.cost * (1 + 1e-9)


def test_limits_make_a_sharper_bound():
    """Where the best weights break the limits, the bound is that of weights within them."""
    rows = quadratic(3, 2)
    problem = edtk.Problem(rows[:, None, :])
    free = edtk.plan(problem, size=8, starts=8)
    once = edtk.plan(problem, size=8, most=1, starts=8)
    assert once.basis == "weights within the limits"
    assert once.value <= once.bound < free.bound * 0.999
    best = costs_of(problem, criteria.create("D"), combinations(range(9), 8)).min()
    assert once.cost == pytest.approx(best)


@pytest.mark.parametrize("size", [None, 5])
def test_costs_and_a_budget(size):
    """The plan is the best of all that can be paid, whatever their size or of one size."""
    problem = edtk.Problem(RNG.normal(size=(6, 1, 2)))
    costs = np.array([1.0, 1.5, 2.0, 1.0, 3.0, 2.5])
    criterion = criteria.create("A")
    plans = [
        plan
        for m in (range(2, 8) if size is None else [size])
        for plan in combinations_with_replacement(range(6), m)
        if costs[list(plan)].sum() <= 7.5
    ]
    found = edtk.plan(problem, size, "A", costs=costs, cost_budget=7.5, starts=32)
    assert found.cost == pytest.approx(costs_of(problem, criterion, plans).min(), rel=1e-9)
    assert found.spent == pytest.approx(float(costs @ found.counts))
    assert found.spent <= 7.5
    assert found.lower_bound.cost <= found.cost * (1 + 1e-9)


def test_kept_experiments_count():
    """Kept candidates are part of the plan; as a problem of their own they tell the same."""
    problem = edtk.Problem(RNG.normal(size=(7, 1, 3)), prior=0.01 * np.eye(3))
    plans = [(2, 2, *plan) for plan in combinations_with_replacement(range(7), 3)]
    best = costs_of(problem, criteria.create("D"), plans).min()
    found = edtk.plan(problem, size=5, keep=[2, 2], starts=16)
    assert found.cost == pytest.approx(best, rel=1e-9)
    assert found.counts[2] >= 2
    assert found.counts.sum() == found.size == 5
    beside = edtk.plan(problem, size=5, keep=problem[np.array([2, 2])], starts=16)
    assert beside.cost == pytest.approx(best, rel=1e-9)
    assert beside.counts.sum() == 3
    assert beside.size == 5


def scatter(rows, blocks):
    """Information of rows beside fixed effects of blocks, by centring each block."""
    centred = [rows[list(block)] - rows[list(block)].mean(axis=0) for block in blocks]
    return sum(own.T @ own for own in centred)


@pytest.mark.slow
def test_blocks_are_the_best_of_all():
    """Six experiments in two blocks of three are the best of all such plans, with their bound."""
    rows = RNG.normal(size=(5, 2))
    each = list(combinations_with_replacement(range(5), 3))
    criterion = criteria.create("D")
    best = min(criterion.cost(scatter(rows, pair)) for pair in product(each, repeat=2))
    found = edtk.plan(edtk.Problem(rows[:, None, :]), blocks=(3, 3), starts=8)
    assert found.cost == pytest.approx(float(best), rel=1e-9)
    assert found.block_counts.sum(axis=1).tolist() == [3, 3]
    assert found.block_counts.sum(axis=0).tolist() == found.counts.tolist()
    assert found.lower_bound.cost <= found.cost


def test_given_experiments_are_divided_into_blocks():
    """A factorial of two levels falls into blocks that lose an interaction, and nothing else."""
    x = np.array(list(product((-1.0, 1.0), repeat=3)))
    problem = edtk.Problem(x[:, None, :])
    found = edtk.plan(problem, blocks=(4, 4), most=1, starts=16)
    assert found.counts.tolist() == [1] * 8
    assert found.value == pytest.approx(8.0)
    assert found.efficiency == pytest.approx(1.0, abs=1e-6)


@pytest.mark.slow
def test_random_blocks_cost_less_than_fixed_ones():
    """The variance of the effects leads from no blocks to fixed ones."""
    problem = edtk.Problem(quadratic(3, 2)[:, None, 1:])
    free = edtk.plan(problem, size=8, starts=8).value
    values = [
        edtk.plan(problem, blocks=(4, 4), block_variance=variance, starts=8).value
        for variance in (1e-9, 0.5, 10.0, np.inf)
    ]
    assert values[0] == pytest.approx(free, rel=1e-6)
    assert (np.diff(values) < 0).all()


def test_bayesian_plans_may_be_smaller_than_the_model():
    """A prior precision counts once for the whole plan, and makes few experiments enough."""
    problem = edtk.Problem(RNG.normal(size=(6, 1, 4)))
    criterion = criteria.create("bayes_D", precision=np.eye(4))
    plans = list(combinations_with_replacement(range(6), 2))
    best = costs_of(problem, criterion, plans).min()
    found = edtk.plan(problem, size=2, criterion=criterion, starts=8)
    assert found.cost == pytest.approx(best, rel=1e-9)
    assert found.lower_bound.cost <= best * (1 + 1e-9)


def test_the_same_seed_gives_the_same_plan():
    """A plan depends on the seed and on nothing else."""
    problem = edtk.Problem(quadratic(3, 3)[:, None, :])
    first, again, other = (edtk.plan(problem, 12, seed=s, starts=8) for s in (4, 4, 5))
    assert first.counts.tolist() == again.counts.tolist()
    assert first.value == again.value
    assert other.value == pytest.approx(first.value, rel=0.05)


def test_units_of_the_parameters_do_not_matter():
    """Parameters in other units, and a far origin, give the same plan."""
    x = np.linspace(-1, 1, 21)
    near = edtk.Problem(np.vander(x, 3, increasing=True)[:, None, :])
    far = edtk.Problem(np.vander(2015 + 15 * x, 3, increasing=True)[:, None, :])
    counts = [edtk.plan(problem, 7, starts=16).counts.tolist() for problem in (near, far)]
    assert sorted(counts[0])[-3:] == [2, 2, 3]
    assert np.flatnonzero(counts[0]).tolist() == np.flatnonzero(counts[1]).tolist() == [0, 10, 20]


def test_it_shows_itself():
    """A line, a text with the numbers, a table, a frame and a picture."""
    problem = edtk.Problem(quadratic(3, 2)[:, None, :])
    found = edtk.plan(problem, size=9, keep=[0], starts=4)
    assert repr(found).startswith("<ProblemPlan: D = ")
    assert "9 experiments" in found.headline()
    assert found.summary().startswith("D (det(M)^(1/p)): ")
    assert "starts led to a plan as good (as many as were asked for)" in found.summary()
    assert "<table" in found._repr_html_()
    frame = found.to_frame()
    assert frame["count"].sum() == 9
    assert frame["kept"].sum() == 1
    assert len(found.experiments) == 9


def test_candidates_from_a_data_frame_come_back_as_its_rows():
    """The plan is a frame of the candidates that are measured, with their counts."""
    pd = pytest.importorskip("pandas")
    pytest.importorskip("formulaic")
    frame = pd.DataFrame({"x": np.linspace(-1, 1, 5)}, index=list("abcde"))
    found = edtk.plan(edtk.Problem.from_frame(frame, "1 + x + I(x**2)"), size=6, keep=[0], starts=8)
    assert found.to_frame().index.tolist() == ["a", "c", "e"]
    assert found.to_frame()["count"].tolist() == [2, 2, 2]
    assert found.to_frame()["kept"].tolist() == [1, 0, 0]


PROBLEM = edtk.Problem(RNG.normal(size=(5, 1, 2)))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "size: expected the number of experiments, or costs and a cost_budget"),
        ({"size": 0}, "size 0: expected one or more"),
        ({"size": 2.5}, "size 2.5: expected one or more"),
        ({"cost_budget": 3.0}, "costs: expected beside cost_budget"),
        ({"size": 1}, "experiment identifies the 2 parameters; they tell 1 at most"),
        ({"size": 4, "starts": 0}, "starts 0: expected a whole number, 1 or more"),
        ({"size": 2, "keep": [1, 1]}, "expected one or more beside 2 kept experiments"),
        ({"size": 4, "keep": [5]}, "keep: expected indices of candidates, from 0 to 4"),
        ({"size": 9, "most": 1}, "most: allows 5 new experiments, expected 9 or more"),
        ({"size": 4, "most": [1, 2]}, "most: expected a whole number, or one for each of 5"),
        ({"size": 4, "most": 1, "keep": [0, 0]}, "candidate 0 is kept 2 times, which is more"),
        ({"size": 4, "costs": [1] * 5}, "cost_budget: expected beside costs"),
        ({"costs": [1, 1, 1, 1, 0], "cost_budget": 3.0}, "costs: expected a positive number"),
        ({"costs": [1] * 5, "cost_budget": 0.5}, "cost_budget 0.5: the cheapest candidate costs 1"),
        ({"size": 4, "costs": [1] * 5, "cost_budget": [3, 4]}, "expected one number; several"),
        ({"size": 4, "costs": [1] * 5, "cost_budget": 3}, "4 new experiments cost 4 or more"),
        ({"size": 5, "blocks": (2, 2)}, "blocks of 4 experiments in all, expected 5"),
        ({"blocks": (2, 0)}, "expected sizes of blocks, whole and positive"),
        ({"blocks": (2, 2), "keep": [0]}, "experiments cannot be kept where others are put in"),
        ({"blocks": (2, 2), "block_variance": 0.0}, "block_variance 0.0: expected above 0"),
        ({"blocks": (2, 2), "block_variance": 5e-324}, "block_variance 5e-324: expected above 0"),
        (
            {"costs": [1e-308] * 5, "cost_budget": 3},
            "cost_budget 3: buys 1.34827e+308 experiments; expected 1e-150 to 1e+150",
        ),
        (
            {"costs": [1, 1, 1e-200, 1, 1], "cost_budget": 3},
            "costs: candidate 2: the budget buys 3e+200 experiments; expected 1e-150 to 1e+150",
        ),
        ({"costs": [1] * 5, "cost_budget": 1e308}, "cost_budget: expected finite numbers, at most"),
        ({"size": 4, "constraints": [([1] * 5, 0, 10**400)]}, "expected a number, or None, as a"),
        ({"size": 4, "workers": 2}, "workers: not for plans of a problem of arrays"),
        ({"size": "4"}, "size 4: expected a whole number"),
        ({"size": 4, "seed": "a"}, "seed a: expected a whole number, 0 or more"),
        ({"size": 4, "starts": 1.5}, "starts 1.5: expected a whole number, 1 or more"),
        ({"size": 4, "costs": "a", "cost_budget": 1.0}, "costs: expected numbers"),
        ({"size": 4, "blocks": 2}, "blocks: expected sizes of blocks, whole and positive"),
        ({"size": 4, "block_variance": 1.0}, "block_variance: expected blocks beside it"),
        ({"size": 10**7}, "plans of more than 5000 experiments are not searched for"),
    ],
)
def test_wrong_arguments_are_one_line(options, message):
    """What cannot be done is named, and what was expected."""
    with pytest.raises(UserError) as error:
        edtk.plan(PROBLEM, **options)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_one_experiment_is_not_several():
    """One experiment tells a combination; where it does not, the criterion is named."""
    x = np.linspace(-1, 1, 5)
    parabola = edtk.Problem(np.vander(x, 3, increasing=True)[:, None, :])
    constant = edtk.plan(parabola, 1, {"name": "c", "c": [1, 0, 0]}, starts=2)
    assert "with 1 experiment," in repr(constant)
    assert "\n1 experiment; " in constant.summary()
    with pytest.raises(UserError, match=r"no plan of 1 new experiment .* what c of k3 needs; more"):
        edtk.plan(parabola, 1, {"name": "c", "c": [0, 0, 1]}, starts=2)


def test_nothing_may_be_kept():
    """An empty list of kept experiments is as good as none."""
    found = edtk.plan(PROBLEM, size=4, keep=[], starts=2)
    assert found.counts.sum() == 4


@pytest.mark.parametrize(
    ("question", "options", "message"),
    [
        (PROBLEM, {"candidates": 100}, "candidates: not for the relaxation of a problem"),
        (PROBLEM, {"size": 0}, "size 0: expected a whole number, 1 or more"),
        (np.eye(3), {}, "expected a study, or the path of one, not ndarray; arrays of regressors"),
    ],
)
def test_wrong_questions_for_a_relaxation_are_one_line(question, options, message):
    """What a relaxation cannot answer is named, and what was expected."""
    with pytest.raises(UserError) as error:
        edtk.relax(question, "D", **options)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_a_constant_is_lost_beside_fixed_blocks():
    """A constant cannot be told from effects of blocks, unless their variance is known."""
    problem = edtk.Problem(quadratic(3, 1)[:, None, :], parameters=("one", "x", "xx"))
    with pytest.raises(ValueError, match="beside fixed effects of blocks nothing tells one"):
        edtk.plan(problem, blocks=(3, 3))
    assert edtk.plan(problem, blocks=(3, 3), block_variance=1.0, starts=4).value > 0
    treatments = edtk.Problem(np.eye(3)[:, None, :])
    with pytest.raises(ValueError, match=r"nothing tells k1 \+ k2 \+ k3: leave"):
        edtk.plan(treatments, blocks=(3, 3))


def test_blocks_need_rows():
    """Packed information has lost the signs of its rows."""
    packed = edtk.Problem.of_information(PROBLEM.packed)
    with pytest.raises(UserError, match="blocks need the rows of all candidates"):
        edtk.plan(packed, blocks=(2, 2))
    filled = np.ones((4, 2, 3))
    filled[0, 1] = 0.0
    with pytest.raises(UserError, match="blocks need the rows of all candidates"):
        edtk.plan(edtk.Problem(filled), blocks=(2, 2))
    assert edtk.plan(packed, size=4, starts=4).cost == pytest.approx(
        edtk.plan(PROBLEM, size=4, starts=4).cost
    )


@pytest.mark.parametrize(("low", "high", "degree"), [(2000, 2030, 2), (10, 11, 6)])
def test_nearly_dependent_columns(low, high, degree):
    """Plans of a polynomial far from the origin are those of the same model in good parameters."""
    x = np.linspace(low, high, 61)
    u = np.linspace(-1, 1, 61)
    A = np.vander(x, degree + 1, increasing=True)
    B = np.polynomial.legendre.legvander(u, degree)
    given = edtk.Problem(A[:, None, :])
    found = edtk.plan(given, size=degree + 3, criterion="A", seed=1, starts=6)
    R = np.linalg.lstsq(B, A, rcond=None)[0]
    same = edtk.criteria.create("A").transformed(np.linalg.inv(R))
    M = edtk.Problem(B[:, None, :]).information(found.counts)
    slack = 1e-3 if degree == 6 else 1e-8
    assert found.value == pytest.approx(float(same.cost(M)), rel=slack)
    assert 0.9 < found.efficiency <= 1.0


def test_a_missing_bound_has_its_reason():
    """Where no relaxation bounds a plan, its headline says why."""
    rows = np.random.default_rng(2).normal(size=(7, 1, 2))
    found = edtk.plan(edtk.Problem(rows), blocks=(3, 3), criterion="O2", starts=4)
    assert found.basis == "no bound: in blocks O2 may be better with less information"
    assert found.headline().endswith(found.basis)
    assert found.bound == 0


@pytest.mark.parametrize("has_weights", [True, False])
def test_ctrl_c_while_a_bound_is_sought_leaves_a_plan(monkeypatch, has_weights):
    """The first plan that can be given comes, with the bound of the best weights so far, if any."""
    problem = edtk.Problem(np.random.default_rng(2).normal(size=(40, 1, 3)))
    best = relax(problem, edtk.criteria.create("A"), gap=0.1)

    def interrupted(*arguments):
        raise RelaxationInterrupted(best) if has_weights else KeyboardInterrupt

    monkeypatch.setattr("edtk.design.exact.counts.counts_bound.relax", interrupted)
    found = edtk.plan(problem, 6, "A", seed=1)
    assert found.ended == "interrupted"
    assert found.size == 6
    assert (found.bound > 0) == has_weights
    assert found.bound <= found.cost
    assert has_weights or found.basis == "no bound: interrupted before one was found"


@pytest.mark.slow
def test_a_word_is_marked():
    """A bound that believes a solver's optimum is told from a proved one."""
    problem = edtk.Problem(np.random.default_rng(2).normal(size=(7, 1, 2)))
    headline = edtk.plan(problem, 3, NoDual(), starts=4).headline()
    assert headline.endswith(" % by a solver's word")
    assert edtk.plan(problem, 3, "D", starts=4).headline().endswith(" %")


def test_plans_are_written(tmp_path):
    """A plan of a problem, and one of a region, is written as the table that it shows."""
    out = tmp_path / "plan.csv"
    found = edtk.plan(PROBLEM, size=4, starts=4, out=out)
    written = pd.read_csv(out)
    assert written["candidate"].tolist() == found.support.tolist()
    assert written["count"].sum() == 4
    region = edtk.Region(lambda x: np.column_stack([np.ones(len(x)), x]), -1, 1)
    edtk.plan(region, size=2, starts=2, out=tmp_path / "region.csv")
    assert (tmp_path / "region.csv").read_text() == "x,count\n-1,1\n1,1\n"
    with pytest.raises(OSError, match="is a folder"):
        edtk.plan(PROBLEM, size=4, out=tmp_path)


def test_units_that_are_eighteen_decades_apart():
    """A plan for one combination of parameters is the same in any units."""
    own = np.random.default_rng(3).normal(size=(12, 3))
    rows = own * 10.0 ** np.array([-9, 0, 9])
    found = edtk.plan(edtk.Problem(rows[:, None, :]), 5, {"name": "c", "c": rows[0]}, starts=8)
    same = edtk.plan(edtk.Problem(own[:, None, :]), 5, {"name": "c", "c": own[0]}, starts=8)
    assert found.value == pytest.approx(same.value, rel=1e-9)
    assert found.efficiency == pytest.approx(same.efficiency, rel=1e-6)


def test_a_combination_of_nearly_dependent_columns():
    """A combination of two candidates is told by these two, however alike the columns are."""
    own = np.random.default_rng(4).normal(size=(8, 3))
    rows = np.column_stack([own[:, 0], own[:, 1], own[:, 1] + 1e-6 * own[:, 2]])
    found = edtk.plan(
        edtk.Problem(rows[:, None, :]), 4, {"name": "c", "c": 2 * rows[3] + rows[0]}, starts=8
    )
    # One reading at the first and three at the other: 1/1 + 4/3; with weights (1 + 2)^2 / 4.
    assert found.counts[[0, 3]].tolist() == [1, 3]
    assert found.value == pytest.approx(1 + 4 / 3, rel=1e-8)
    assert found.bound == pytest.approx(9 / 4, rel=1e-6)


@pytest.mark.parametrize("size", [float("nan"), float("inf")])
def test_a_size_that_is_no_number(size):
    """It is named, whatever it is."""
    problem = edtk.Problem(RNG.normal(size=(8, 1, 3)))
    with pytest.raises(edtk.UserError, match=f"size {size}: expected a whole number"):
        edtk.plan(problem, size=size)


@pytest.mark.parametrize("scale", [1.0, 1e-100, 1e100])
@pytest.mark.slow
def test_a_plan_is_proved_to_be_the_best(scale):
    """The proof closes the gap that weights leave, in any units, and the plan says so."""
    x = np.linspace(-1, 1, 101)
    problem = edtk.Problem(scale * np.stack([np.ones(101), x, x**2], axis=-1)[:, None])
    found = edtk.plan(problem, size=7, criterion="A", prove=60)
    weighted = edtk.plan(problem, size=7, criterion="A", starts=4)
    assert found.proved_exact
    assert found.ended == "proved"
    assert found.efficiency == pytest.approx(1.0, abs=3e-9)
    assert weighted.efficiency < 1 - 1e-3
    assert found.cost == pytest.approx(weighted.cost, rel=1e-9)
    assert found.bound_exact == pytest.approx(found.value, rel=3e-9)
    assert "proved: no plan of these candidates is better" in str(found)


def test_without_a_proof_nothing_is_said_of_one():
    """A search alone has no bound of whole plans."""
    found = edtk.plan(edtk.Problem(quadratic(3, 2)[:, None]), size=8, starts=1)
    assert not found.proved_exact
    assert found.bound_exact is None


def test_a_proof_without_time_keeps_the_sharper_bound():
    """Without time the bound of whole plans is that of the root, and efficiency takes the best."""
    found = edtk.plan(edtk.Problem(quadratic(3, 2)[:, None]), size=8, criterion="A", prove=0)
    assert found.ended == "budget"
    assert not found.proved_exact
    assert found.bound_exact <= found.value
    assert found.efficiency == max(found.bound_exact, found.lower_bound.value) / found.value


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"prove": -1}, "prove"),
        ({"prove": True}, "prove"),
        ({"prove": 1, "criterion": "O4"}, "O4"),
        ({"prove": 1, "blocks": (4, 4)}, "blocks"),
    ],
)
def test_a_proof_that_there_is_not_says_why(more, said):
    """Wrong seconds, criteria and limits without a proof are one line."""
    with pytest.raises(UserError, match=said):
        edtk.plan(edtk.Problem(quadratic(3, 2)[:, None]), **{"size": 8, **more})


def test_a_proof_that_time_has_ended_has_a_summary():
    """What is printed of a plan says that the time was over."""
    rows = np.random.default_rng(0).normal(size=(60, 1, 6))
    found = edtk.plan(edtk.Problem(rows), 9, "A", prove=1e-3)
    assert found.ended == "budget"
    assert "the time was over" in found.summary()


@pytest.mark.parametrize("name", ["I", "prediction_G"])
@pytest.mark.slow
def test_predictions_are_at_all_candidates_unless_places_are_stated(name):
    """By the name alone, in plans, weights, comparisons and what comes next."""
    x = np.linspace(-1, 1, 21)
    problem = edtk.Problem(np.vander(x, 3)[:, None], sigma=0.5)
    stated = criteria.create(name, points=problem.factors())
    plan = edtk.plan(problem, size=6, criterion=name)
    assert plan.value == edtk.plan(problem, size=6, criterion=stated).value
    assert edtk.relax(problem, {"name": name}).value == edtk.relax(problem, stated).value
    assert edtk.next(problem, [0, 10], criterion=name).value == pytest.approx(
        edtk.next(problem, [0, 10], criterion=stated).value
    )
    table = edtk.compare({"one": plan}, problem, criteria=[name]).to_frame()
    assert table[name]["one"] == pytest.approx(plan.value)


def test_the_largest_variance_of_predictions_in_a_region_needs_places():
    """A mean over all of its points is known, a maximum over them is not."""
    with pytest.raises(criteria.CriterionError, match="points"):
        edtk.relax(edtk.Region(lambda x: [1, x], 0, 1), "prediction_G")
