"""The relaxation over candidates: laws that its weights and bounds obey, limits, interruptions."""

import os
import signal
from dataclasses import replace
from functools import cache

import cvxpy as cp
import numpy as np
import pytest
from cvxpy.reductions.solvers.solving_chain import SolvingChain
from designs import KR270, STUDY
from pairs import some_pairs
from relaxations import (
    BASES,
    CASES,
    GAP,
    KINDS,
    MONOTONE,
    NAMES,
    TARGET,
    UNITS,
    WELL,
    blocks_of,
    check,
    costs,
    criterion_of,
    every,
    every_base,
    off_centre,
    slip,
    slips,
    solved,
    units_of,
)

import criteria
from criteria import ConvexCriterion, Criterion, Relaxable
from edtk.design.candidate_source import CandidateSource
from edtk.design.problem import Problem, RankDeficientError
from edtk.design.relaxation import incumbent
from edtk.design.relaxation.relax import RelaxationInterrupted, relax
from edtk.design.relaxation.restricted_master import CHAIN, SolverOptions
from edtk.system.time_limit import out_of_time

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def kr270():
    """Two thousand poses of the KR 270 as candidates."""
    return CandidateSource(KR270, STUDY.specification.seed).take(2000).problem


@cache
def trial_information(case):
    """Information (600 + n, p, p) of random designs of a case, and of its single candidates."""
    problem = Problem(CASES[case])
    rng = np.random.default_rng(0)
    random = [rng.dirichlet(np.full(problem.n, c), size=200) for c in (0.05, 0.3, 3.0)]
    weights = np.concatenate([*random, np.eye(problem.n)])
    return np.tensordot(weights, problem.blocks(), axes=1)


@pytest.mark.parametrize(
    ("name", "case"),
    some_pairs(
        BASES,
        ["blocks of two", "cubic", "off-centre", "parameters x 1e-7 .. 1e4", "all x 1e-9"],
        2,
    ),
)
def test_no_design_beats_the_bound(name, case):
    """Neither random designs nor steps from the optimum towards any design cost less."""
    problem = Problem(CASES[case])
    r = solved(name, case)
    own = problem.information(r.weights)
    trials = trial_information(case)
    steps = [(1 - a) * own + a * trials for a in (1e-4, 1e-2, 0.1, 0.5)]
    M = np.concatenate([trials[: -problem.n], *steps])
    known = slips(M) < 1e-9
    assert known.sum() > 1000
    least = costs(name, M[known], TARGET * units_of(case)).min()
    assert least >= r.proved_bound.cost * (1 - 1e-9)


@every
def test_any_multiplier_proves_a_bound(name):
    """Whatever the multipliers, no optimum is below the bound that they prove.

    They are random (positive semidefinite where the criterion is monotone), or the relaxation's own
    with an error.
    """
    problem = Problem(WELL["off-centre"])
    r = solved(name, "off-centre")
    rng = np.random.default_rng(1)
    found = []
    for rank in (1, 2, 4) * 7:
        size = 10 ** rng.uniform(-1, 1, size=(2, 1, 4, 1))
        B = rng.normal(size=(2, len(r.multipliers), 4, rank)) * size
        Z = B[0] @ B[0].swapaxes(1, 2)
        if name not in MONOTONE:
            Z -= rng.uniform(0, 2) * B[1] @ B[1].swapaxes(1, 2)
        size = np.linalg.norm(r.multipliers, axis=(1, 2)) / np.linalg.norm(Z, axis=(1, 2))
        near = r.multipliers + rng.choice([1e-9, 1e-3, 0.3]) * size[:, None, None] * Z
        found += [replace(r, multipliers=y).certify(problem)[1] for y in (Z, near)]
    assert max(found) <= r.cost * (1 + slip(problem.information(r.weights)))
    assert max(found) > (1 - 1e-3) * r.cost  # some of them prove much
    assert min(found) < 0.95 * r.cost  # and some little


@pytest.mark.parametrize(("name", "case"), some_pairs(MONOTONE, [*WELL, "all x 1e-9"], 2))
def test_weight_rests_on_the_largest_sensitivities(name, case):
    """The equivalence theorem with a gap g.

    The mean shortfall from the largest sensitivity is below 1 - (1-g)^(1/degree), because
    ``cost(M) >= c <Z, M>^-degree`` where the bound is ``c t^-degree``, and <Z, M> is the mean.
    """
    problem = Problem(CASES[case])
    r = solved(name, case)
    sensitivities = np.einsum("ij,nij->n", r.multipliers[0], problem.blocks())
    shortfall = r.weights @ (1 - sensitivities / sensitivities.max())
    allowed = 1 - (1 - r.gap) ** (1 / r.criterion.degree)
    assert shortfall <= allowed + 2 * slip(problem.information(r.weights))


@pytest.mark.parametrize(("name", "factor"), some_pairs(BASES, [1e-20, 1e-8, 1e9]))
def test_unit_of_the_regressors(name, factor):
    """Regressors times c have the cost times c^(-2 degree), whatever the unit, and a true bound."""
    blocks = WELL["off-centre"]
    r = solved(name, "off-centre")
    other = relax(Problem(factor * blocks), criterion_of(name))
    scale = factor ** (2 * r.criterion.degree)
    assert -slip(Problem(blocks).information(other.weights)) <= other.gap <= GAP
    assert other.cost * scale == pytest.approx(r.cost, rel=GAP)
    assert other.proved_bound.cost * scale <= r.cost


@pytest.mark.parametrize("name", ["D", "O1", "rho0"])
def test_units_of_single_parameters(name):
    """A criterion free of units has the same optimum in units from 1e-7 to 1e4, times a number."""
    problem = Problem(WELL["blocks of two"])
    other = Problem(WELL["blocks of two"] * UNITS)
    criterion = criterion_of(name)
    r = solved(name, "blocks of two")
    s = relax(other, criterion.in_units(np.diag(UNITS)))
    check(s, other, name, units=UNITS)
    assert s.gap <= GAP
    assert float(criterion.cost(problem.information(s.weights))) == pytest.approx(r.cost, rel=GAP)


@pytest.mark.parametrize("case", ["blocks of two", "cubic", "off-centre"])
@pytest.mark.parametrize(("root", "square"), [("O1", "D"), ("O3", "E")])
def test_roots_of_one_another(root, square, case):
    """O1 is the root of D, and O3 of E: so are their optima and bounds, within the gaps."""
    problem = Problem(WELL[case])
    r = solved(root, case)
    s = solved(square, case)
    assert r.cost**2 == pytest.approx(s.cost, rel=2 * GAP)
    assert r.proved_bound.cost**2 <= s.cost * (1 + slip(problem.information(s.weights)))
    assert s.proved_bound.cost <= r.cost**2 * (1 + slip(problem.information(r.weights)))


@pytest.mark.parametrize(
    ("name", "case"),
    [*((name, "off-centre") for name in BASES), *((name, "cubic") for name in KINDS)],
)
def test_duplicate_candidates(name, case):
    """Every candidate three times, in turn or one after the other, changes no cost and no bound."""
    blocks = WELL[case]
    criterion = criterion_of(name)
    for copies, axis in ((np.repeat(blocks, 3, axis=0), 1), (np.tile(blocks, (3, 1, 1)), 0)):
        s = relax(Problem(copies), criterion)
        check(s, Problem(copies), name)
        assert s.gap <= GAP
        assert s.cost == pytest.approx(solved(name, case).cost, rel=GAP)
        shape = (len(blocks), 3) if axis else (3, len(blocks))
        M = Problem(blocks).information(s.weights.reshape(shape).sum(axis=axis))
        assert costs(name, M, TARGET) == pytest.approx(s.cost, rel=slip(M))


@pytest.mark.parametrize(("name", "case"), some_pairs(BASES, ["many rows", "cubic"]))
def test_order_of_the_candidates(name, case):
    """A permutation of the candidates permutes a design, and changes no cost and no bound."""
    blocks = WELL[case]
    order = np.random.default_rng(4).permutation(len(blocks))
    r = solved(name, case)
    s = relax(Problem(blocks[order]), criterion_of(name))
    back = np.empty_like(s.weights)
    back[order] = s.weights
    M = Problem(blocks).information(back)
    assert s.gap <= GAP
    assert costs(name, M, TARGET) == pytest.approx(s.cost, rel=slip(M))
    assert s.cost == pytest.approx(r.cost, rel=GAP)
    assert max(r.proved_bound.cost, s.proved_bound.cost) <= min(r.cost, s.cost) * (1 + slip(M))


@every
def test_candidates_without_information(name):
    """Candidates without information change nothing, and get no more weight than the gap allows."""
    blocks = WELL["off-centre"]
    padded = np.concatenate([np.zeros((5, 1, 4)), blocks[:10], np.zeros((5, 1, 4)), blocks[10:]])
    s = relax(Problem(padded), criterion_of(name))
    check(s, Problem(padded), name)
    assert s.gap <= GAP
    assert s.cost == pytest.approx(solved(name, "off-centre").cost, rel=GAP)


@every
def test_more_candidates_are_no_worse(name):
    """The bound over all candidates is not above the cost over a part of them."""
    blocks = WELL["many rows"]
    bound = solved(name, "many rows").proved_bound.cost
    for part in (slice(0, 300), slice(0, None, 7)):
        problem = Problem(blocks[part])
        assert bound <= relax(problem, criterion_of(name)).cost * (1 + slip(problem.mean))


@every
def test_twenty_thousand_candidates(name):
    """A set much larger than a restricted master problem is solved to the gap, in several steps."""
    problem = Problem(blocks_of(11, 20_000, 2))
    r = relax(problem, criterion_of(name), options=SolverOptions(batch=10))
    check(r, problem, name)
    assert r.gap <= GAP
    assert r.iterations > 1 or name == "O2"


@every
def test_few_candidates_and_few_parameters(name):
    """One candidate is the only design; of one parameter the most informative candidate is best."""
    single = Problem(blocks_of(0, 1, 6))
    r = relax(single, criterion_of(name))
    np.testing.assert_array_equal(r.weights, [1.0])
    check(r, single, name)
    lone = Problem(blocks_of(0, 30, 2, 1))
    r = relax(lone, criteria.create(name, target=np.eye(1)))
    assert r.gap <= GAP
    assert r.cost == pytest.approx(1 / lone.packed.max() ** r.criterion.degree, rel=GAP)


def test_direction_that_one_candidate_in_ten_thousand_excites():
    """A direction that a single candidate excites, which no sample holds, gets half the weight."""
    rows = np.zeros((10_001, 1, 2))
    rows[:, 0, 0] = 1
    rows[1, 0] = 0, 1
    r = relax(Problem(rows), criteria.create("D"))
    assert r.gap <= GAP
    assert r.weights[1] == pytest.approx(0.5, abs=np.sqrt(GAP))
    assert r.cost == pytest.approx(2, rel=GAP)


@pytest.mark.parametrize(("name", "factor"), some_pairs(["D", "E", "G", "rho0"], [100, 1e6]))
def test_strong_candidates_that_no_sample_holds(name, factor):
    """Eight of 20,000 candidates are far stronger, and only sensitivities can find them."""
    blocks = off_centre(1, 20_000)
    blocks[1:9] = factor * blocks_of(5, 8, 1)
    problem = Problem(blocks)
    r = relax(problem, criterion_of(name))
    check(r, problem, name)
    assert r.gap <= GAP


@every
def test_kr270(name, kr270):
    """Every criterion over poses of the KR 270 is solved to the gap, as numpy alone confirms."""
    criterion = STUDY.criterion(name)
    r = relax(kr270, criterion)
    check(r, kr270, name, STUDY.target)
    assert r.gap <= GAP
    assert r.cost <= float(criterion.cost(kr270.mean)) * (1 + slip(kr270.mean))


@pytest.mark.parametrize("name", ["D", "rho0"])
def test_kr270_in_other_units(name, kr270):
    """Units from 1e-7 to 1e4 give a design as good as SI units, within the gap."""
    T = np.array([1e-7, 1e4, 1e-3, 1.0, 1e2])
    criterion = STUDY.criterion(name)
    i, j = np.triu_indices(5)
    scaled = Problem.of_information(kr270.packed * (T[i] * T[j])[:, None])
    other = relax(scaled, criterion.in_units(np.diag(T)))
    assert other.gap <= GAP
    cost = float(criterion.cost(kr270.information(other.weights)))
    assert cost == pytest.approx(relax(kr270, criterion).cost, rel=GAP)


@pytest.mark.parametrize("name", ["A", "E", "G", "rho0"])
def test_gap_that_is_asked_for(name):
    """A coarser gap is honoured, too, in fewer steps, with a true bound."""
    problem = Problem(off_centre(12, 2000))
    options = SolverOptions(batch=5)
    fine, coarse = (relax(problem, criterion_of(name), gap, options) for gap in (GAP, 0.4))
    check(coarse, problem, name)
    assert GAP < coarse.gap <= 0.4
    assert coarse.iterations < fine.iterations
    assert coarse.proved_bound.cost <= fine.cost


@pytest.mark.parametrize("name", ["A", "D", "E", "O2", "rho0"])
def test_limit_of_rounds(name):
    """A design found in two rounds is certified, with the gap that it has."""
    problem = Problem(off_centre(12, 2000))
    r = relax(problem, criterion_of(name), options=SolverOptions(rounds=2, batch=2))
    check(r, problem, name)
    assert r.iterations == 2
    assert GAP < r.gap < 1


@every_base
def test_progress(name):
    """Progress is told after every step, counted from one, and the gap never grows."""
    calls = []
    problem = Problem(off_centre(12, 500))
    options = SolverOptions(batch=2)
    r = relax(
        problem, criterion_of(name), options=options, progress=lambda *call: calls.append(call)
    )
    iterations, gaps = zip(*calls, strict=True)
    assert iterations == tuple(range(1, r.iterations + 1))
    assert (np.diff(gaps) <= 0).all()
    assert gaps[-1] <= GAP


@cache
def off_centre_cost(name):
    """The least cost over two thousand candidates, and the bound."""
    r = relax(Problem(off_centre(12, 2000)), criterion_of(name))
    return r.cost, r.proved_bound.cost


@pytest.mark.parametrize(
    ("name", "k"), [*((name, 1) for name in KINDS), *((name, 3) for name in BASES)]
)
def test_interrupt_leaves_the_best_so_far(name, k):
    """Ctrl-C after k steps raises a KeyboardInterrupt that carries the best certified design."""
    problem = Problem(off_centre(12, 2000))

    def stop(iterations, gap):
        if iterations == k:
            raise KeyboardInterrupt

    with pytest.raises(RelaxationInterrupted) as caught:
        relax(problem, criterion_of(name), options=SolverOptions(batch=2), progress=stop)
    best = caught.value.best
    assert isinstance(caught.value, KeyboardInterrupt)
    assert best.iterations == k
    check(best, problem, name)
    bound = best.proved_bound.cost
    rounding = slip(problem.information(best.weights))
    assert best.certify(problem) == pytest.approx((best.cost, bound), rel=rounding)
    least, proved_bound = off_centre_cost(name)
    assert bound <= least * (1 + GAP)
    assert proved_bound <= best.cost * (1 + GAP)


def test_an_interrupt_asks_for_the_first_answer(monkeypatch):
    """After Ctrl-C the time is over for all that follows; a relaxation that ends has its own."""
    asked = []

    def weights(packed, given):
        asked.append(out_of_time())
        return given

    monkeypatch.setattr(incumbent, "sparse_weights", weights)
    problem = Problem(off_centre(12, 2000))

    def stop(iterations, gap):
        raise KeyboardInterrupt

    with pytest.raises(RelaxationInterrupted):
        relax(problem, criterion_of("D"), progress=stop)
    relax(problem, criterion_of("D"))
    assert asked == [True, False]


@pytest.mark.unix
@pytest.mark.parametrize("calls", [1, 2])
def test_interrupt_within_a_solver(monkeypatch, calls):
    """Ctrl-C within the first program is a plain interrupt; within the second it has a design."""
    solve = SolvingChain.solve_via_data
    left = [calls]

    def stand_in(self, *args, **options):
        left[0] -= 1
        if not left[0]:
            os.kill(os.getpid(), signal.SIGINT)
        return solve(self, *args, **options)

    monkeypatch.setattr(SolvingChain, "solve_via_data", stand_in)
    problem = Problem(off_centre(12, 2000))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt) as caught:
            relax(problem, criterion_of("A"), options=SolverOptions(batch=2, solvers=CHAIN))
    finally:
        signal.signal(signal.SIGINT, before)
    if calls == 1:
        assert not isinstance(caught.value, RelaxationInterrupted)
    else:
        assert caught.value.best.iterations == 1
        check(caught.value.best, problem, "A")


@every
def test_rank_deficient_candidates(name):
    """Candidates that leave directions open are rejected by the names of these."""
    x = np.linspace(-1, 1, 41)
    rows = np.column_stack([x, 2 * x, 0 * x, x**2])[:, None, :]
    with pytest.raises(RankDeficientError, match=r"no candidate excites c or a - 0\.5 b$"):
        relax(Problem(rows, parameters=("a", "b", "c", "d")), criterion_of(name))


class Formless(Criterion):
    """A cost that cvxpy does not know."""

    name = "formless"
    title = "Formless"
    formula = "1/trace(M)"
    sense = "min"
    degree = 1.0

    def _cost(self, M, cov):
        return 1 / np.trace(M, axis1=-2, axis2=-1)

    def _gradient(self, M, cov):
        return -(self._cost(M, cov)[..., None, None] ** 2) * np.eye(M.shape[-1])


def test_criterion_without_convex_form():
    """A criterion that has no convex form is rejected by its name; all built-in ones have one."""
    with pytest.raises(NotImplementedError, match="formless"):
        relax(Problem(WELL["cubic"]), Formless())
    assert not issubclass(Formless, Relaxable)
    assert all(issubclass(criteria.get(name), Relaxable) for name in NAMES)


class ExpressionA(ConvexCriterion):
    """The trace of the covariance, known by its expression alone."""

    name = "expression A"
    title = "A"
    formula = "trace(cov)"
    sense = "min"
    degree = 1.0

    def expression(self, M, T=None):
        """Convex in M."""
        return cp.matrix_frac(np.eye(M.shape[0]) if T is None else T.T, M)


class ExpressionG(ConvexCriterion):
    """The largest variance, known by its expression alone."""

    name = "expression G"
    title = "G"
    formula = "max diag(cov)"
    sense = "min"
    degree = 1.0
    smooth = False

    def expression(self, M, T=None):
        """Convex in M."""
        rows = np.eye(M.shape[0]) if T is None else T
        return cp.max(cp.hstack([cp.matrix_frac(row, M) for row in rows]))


class ExpressionRho(ConvexCriterion):
    """The accuracy in the target, known by the expression of its square alone."""

    name = "expression rho"
    title = "rho"
    formula = "sqrt(trace)"
    sense = "min"
    degree = 0.5
    expression_power = 2.0

    def expression(self, M, T=None):
        """Convex in M."""
        return cp.matrix_frac((TARGET if T is None else TARGET @ T).T, M)


@pytest.mark.parametrize(
    ("mine", "case"),
    some_pairs(
        [(ExpressionA, "A"), (ExpressionG, "G"), (ExpressionRho, "rho0")],
        ["blocks of two", "many rows", "cubic", "all x 1e-9"],
        2,
    ),
)
def test_criterion_known_by_its_expression(mine, case):
    """A criterion with a cvxpy expression and nothing else is as good as the built-in one."""
    mine, name = mine
    problem = Problem(CASES[case])
    r = relax(problem, mine(), options=SolverOptions(batch=10))
    native = solved(name, case)
    rounding = slip(problem.information(r.weights))
    bound = r.proved_bound.cost
    assert -rounding <= r.gap <= GAP
    # A solver's word, lowered by as much.
    assert r.certify(problem) == pytest.approx((r.cost, bound), rel=1e-7)
    assert r.cost == pytest.approx(native.cost, rel=GAP)
    assert bound <= native.cost * (1 + rounding)


@pytest.mark.parametrize("mine", [ExpressionA, ExpressionG, ExpressionRho])
def test_progress_of_an_expression_is_kept(mine):
    """Best design and best proof may come from different steps: the result has both."""
    problem = Problem(blocks_of(12, 2000, 1))
    criterion = mine()
    gaps = []
    for rounds in (2, 3, 4):
        r = relax(
            problem,
            criterion,
            options=SolverOptions(rounds=rounds, batch=2),
            progress=lambda iterations, gap: gaps.append(gap),
        )
        assert r.gap <= gaps[-1] + 1e-7  # a solver's word, lowered by as much


def test_family_from_earlier_multipliers():
    """O4 from the multipliers of a like problem proves its bound anew, over its own candidates."""
    blocks = WELL["off-centre"]
    first = solved("O4", "off-centre")
    more = Problem(np.concatenate([blocks, 1.5 * blocks[:3]]))
    again = relax(more, criterion_of("O4"), multipliers=first.multipliers)
    cold = relax(more, criterion_of("O4"))
    check(again, more, "O4")
    assert again.gap <= GAP
    assert again.cost == pytest.approx(cold.cost, rel=GAP)
    assert cold.cost < first.cost * (1 - 10 * GAP)


@pytest.mark.parametrize("name", KINDS)
def test_prior_information(name):
    """A prior is worth as much as candidates that each contain it, and the bound counts it."""
    blocks = WELL["off-centre"]
    prior = 0.3 * Problem(blocks_of(7, 5)).mean
    beside = Problem(blocks, prior=prior)
    root = np.linalg.cholesky(prior).T
    inside = Problem(np.concatenate([blocks, np.tile(root, (len(blocks), 1, 1))], axis=1))
    r = relax(beside, criterion_of(name))
    s = relax(inside, criterion_of(name))
    assert r.gap <= GAP
    assert r.cost == pytest.approx(s.cost, rel=GAP)
    assert r.cost == pytest.approx(
        float(criterion_of(name).cost(inside.information(r.weights))), rel=slip(inside.mean)
    )
    assert r.proved_bound.cost <= s.cost * (1 + slip(inside.mean))
    assert r.certify(beside) == pytest.approx((r.cost, r.proved_bound.cost), rel=1e-9)
