"""Column generation: which candidates enter, and what happens when a solver fails."""

from functools import cache

import cvxpy as cp
import numpy as np
import pytest
from cvxpy.reductions.solvers.solving_chain import SolvingChain
from pairs import some_pairs
from relaxations import (
    BADLY,
    BASES,
    CASES,
    GAP,
    KINDS,
    SMOOTH,
    WELL,
    check,
    criterion_of,
    every_base,
    off_centre,
    solved,
    units_of,
)

import criteria
from edtk.design.problem import Problem
from edtk.design.relaxation.column_generation import _largest, entering_candidates
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.restricted_master import (
    CHAIN,
    NEWTON,
    SOLVERS,
    RelaxationError,
    SolverOptions,
)

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("batch", [1, 2, 8, 40])
@pytest.mark.parametrize("n", [30, 1000])
def test_entering_candidates(batch, n):
    """The best candidate enters first, none is active or twice there, and the order falls."""
    rng = np.random.default_rng(0)
    sensitivities = rng.normal(size=n)
    active = rng.choice(n, 20, replace=False)
    entering = entering_candidates(sensitivities, active, batch)
    rest = np.setdiff1d(np.arange(n), active)
    assert entering[0] == rest[sensitivities[rest].argmax()]
    assert 1 <= len(entering) <= batch
    assert len(entering) == min(batch, len(rest)) or n == 1000  # parts whose best is among the best
    assert len(np.unique(entering)) == len(entering)
    assert not np.isin(entering, active).any()
    assert (np.diff(sensitivities[entering]) <= 0).all()


def test_entering_candidates_are_spread():
    """In a long list whose best candidates stand together, most come from other parts."""
    sensitivities = np.linspace(0, 1, 4000)
    entering = entering_candidates(sensitivities, np.empty(0, dtype=int), 40)
    assert (entering >= 3990).sum() >= 10  # a quarter are the best of all
    assert len(np.unique(entering // 134)) >= 29  # and each of thirty parts has its best


@cache
def cost_of(name):
    """The least cost over two hundred candidates."""
    return relax(Problem(off_centre(8, 200)), criterion_of(name)).cost


@pytest.mark.parametrize(
    ("name", "batch"),
    [
        *((name, batch) for name in BASES if name != "O4" for batch in (1, 10)),
        *((name, batch) for name in KINDS for batch in (3, 400)),
    ],
)
def test_batch(name, batch):
    """However many candidates enter at a time, the gap is reached, and the optimum is the same."""
    problem = Problem(off_centre(8, 200))
    r = relax(problem, criterion_of(name), options=SolverOptions(rounds=1000, batch=batch))
    check(r, problem, name)
    assert r.gap <= GAP
    assert r.cost == pytest.approx(cost_of(name), rel=GAP)


@pytest.mark.parametrize(
    ("name", "case"), some_pairs(BASES, ["cubic", "off-centre", "uneven", *BADLY], 2)
)
def test_all_problems(name, case):
    """All solvers in turn tell the truth, and reach the gap of 1e-6 in good units.

    A common unit of all parameters is no bad scale.
    """
    r = solved(name, case)
    check(r, Problem(CASES[case]), name, units=units_of(case))
    assert r.gap <= GAP or (units_of(case) != 1).any()


ALONE = [
    ("SCS", "uneven"),  # CLARABEL is the first of all solvers, and answers there
    *((solver, case) for solver in (*SOLVERS, NEWTON) for case in list(BADLY)[::2]),
]


@pytest.mark.parametrize(("name", "alone"), some_pairs(BASES, ALONE, 2))
def test_one_solver(name, alone):
    """A single solver tells the truth about its design, or fails honestly, in any units."""
    solver, case = alone
    problem = Problem(CASES[case])
    units = units_of(case)
    criterion = criterion_of(name, units)
    failure = ""
    try:
        r = relax(problem, criterion, options=SolverOptions(solvers=(solver,)))
    except RelaxationError as error:
        failure = str(error)
    if failure:
        assert solver in failure
    else:
        check(r, problem, name, units=units)
        assert r.solver == solver


def unpack_then(change):
    """A stand-in for `cvxpy.Problem.unpack_results` that changes an answer of CLARABEL."""
    unpack = cp.Problem.unpack_results

    def stand_in(self, solution, chain, inverse_data):
        unpack(self, solution, chain, inverse_data)
        if chain.solver.name() == "CLARABEL":
            change(self)

    return stand_in


def weights_of(program):
    """The variable of the weights."""
    return next(v for v in program.variables() if v.ndim == 1 and v.is_nonneg())


def fail(program):
    """The solver gives up."""
    raise cp.SolverError("numerical trouble")


def no_answer(program):
    """The solver ends without weights."""
    weights_of(program).save_value(None)


def not_a_number(program):
    """The weights are not numbers."""
    w = weights_of(program)
    w.save_value(np.full(w.shape, np.nan))


def nothing(program):
    """The weights are zero."""
    w = weights_of(program)
    w.save_value(np.zeros(w.shape))


def equal_weights(program):
    """The weights are all equal, and the multiplier is zero."""
    w = weights_of(program)
    w.save_value(np.ones(w.shape))
    silence(program)


def silence(program):
    """The multiplier is zero."""
    for constraint in program.constraints:
        for dual in constraint.dual_variables:
            dual.save_value(np.zeros(dual.shape))


def noise(program):
    """Weights and multiplier are random."""
    rng = np.random.default_rng(0)
    w = weights_of(program)
    w.save_value(rng.normal(size=w.shape))
    for constraint in program.constraints:
        for dual in constraint.dual_variables:
            dual.save_value(rng.normal(size=dual.shape))


# An answer that cannot be used is dropped before the criterion matters; a wrong one that can be
# used comes as far as the criterion's own bound.
DROPPED = (fail, no_answer, not_a_number, nothing)
MISLEADING = (silence, equal_weights, noise)
UNUSABLE = [(name, fail) for name in ("O4", "E", "O2")] + [("A", change) for change in DROPPED]
USABLE = some_pairs((*KINDS, "G", "rho0"), MISLEADING)


@pytest.mark.parametrize(
    ("name", "change"), [*UNUSABLE, *USABLE], ids=lambda x: getattr(x, "__name__", x)
)
def test_broken_first_solver(monkeypatch, name, change):
    """Whatever the first solver answers, the gap is reached, and the result names who answered.

    Right weights without a multiplier (`silence`) prove themselves where the criterion is smooth.
    """
    problem = Problem(WELL["off-centre"])
    monkeypatch.setattr(cp.Problem, "unpack_results", unpack_then(change))
    r = relax(problem, criterion_of(name), options=SolverOptions(batch=10, solvers=CHAIN))
    check(r, problem, name)
    assert r.gap <= GAP
    assert r.cost == pytest.approx(solved(name, "off-centre").cost, rel=GAP)
    assert r.solver in CHAIN[1:] or change is silence


EARLY = {
    "short": {"max_iter": 3},
    "loose": {"tol_gap_rel": 0.1, "tol_gap_abs": 0.1, "tol_feas": 0.1},
}


@pytest.mark.parametrize(
    ("name", "early", "n"),
    [
        *((name, early, 30) for name, early in some_pairs(BASES, list(EARLY)) if name != "O4"),
        *((name, early, 300) for name, early in some_pairs(KINDS, list(EARLY))),
    ],
)
def test_inaccurate_first_solver(monkeypatch, name, early, n):
    """A first solver that stops early is followed by the next, however few are active."""
    problem = Problem(off_centre(13, n))
    monkeypatch.setitem(SOLVERS, "CLARABEL", EARLY[early])
    r = relax(problem, criterion_of(name), options=SolverOptions(solvers=CHAIN))
    check(r, problem, name)
    assert r.gap <= GAP


def no_solver(self, *args, **options):
    """A stand-in for `SolvingChain.solve_via_data` that never answers."""
    raise cp.SolverError(f"{self.solver.name()} is out of order")


@every_base
def test_no_solver_at_all(monkeypatch, name):
    """Without cvxpy's solvers smooth criteria are solved; others fail with each solver's words."""
    problem = Problem(off_centre(13, 12))
    monkeypatch.setattr(SolvingChain, "solve_via_data", no_solver)
    if name in SMOOTH:
        r = relax(problem, criterion_of(name), options=SolverOptions(solvers=CHAIN))
        check(r, problem, name)
        assert r.gap <= GAP
        assert r.solver == "SLSQP"
    else:
        words = r"CLARABEL is out of order.*SCS is out of order.*SLSQP.*not smooth"
        with pytest.raises(RelaxationError, match=words):
            relax(problem, criterion_of(name), options=SolverOptions(solvers=CHAIN))


@pytest.mark.parametrize(
    ("name", "case"),
    some_pairs([name for name in SMOOTH if name in BASES], ["many rows", "cubic"]),
)
def test_polish_alone(name, case):
    """Quadratic programming alone, from equal weights, solves smooth criteria to the gap."""
    problem = Problem(WELL[case][:: len(WELL[case]) // 12])
    r = relax(problem, criterion_of(name), options=SolverOptions(solvers=("SLSQP",)))
    check(r, problem, name)
    assert r.gap <= GAP
    assert r.solver == "SLSQP"
    assert r.cost == pytest.approx(relax(problem, criterion_of(name)).cost, rel=GAP)


def test_light_candidates_leave_their_share_of_the_proof():
    """Of candidates that are all but alike, those that are dropped are not missed by the bound."""
    rng = np.random.default_rng(0)
    centers = np.repeat([-1.0, -0.4, 0.0, 0.4, 1.0], 25)
    x = centers + 1e-3 * rng.normal(size=len(centers))
    problem = Problem(np.vander(x, 4, increasing=True)[:, None, :])
    found = relax(problem, criteria.create("D"), gap=1e-8)
    assert found.solver == "NEWTON"
    assert found.gap <= 1e-8


@pytest.mark.parametrize("size", [1, 30, 80])
@pytest.mark.parametrize("kind", ["normal", "sorted", "steps", "equal"])
def test_largest_of_a_long_list(kind, size):
    """However a long list of sensitivities looks, its largest are found, as by a whole sort."""
    rng = np.random.default_rng(0)
    found = rng.normal(size=50_000)
    sensitivities = {
        "normal": found,
        "sorted": np.sort(found),
        "steps": np.floor(3 * found),
        "equal": np.zeros(50_000),
    }[kind]
    largest = _largest(sensitivities, size)
    assert len(np.unique(largest)) == size
    np.testing.assert_array_equal(np.sort(sensitivities[largest]), np.sort(sensitivities)[-size:])


@pytest.mark.parametrize("name", ["E", "O2", "G"])
def test_few_support_points(name):
    """A criterion with kinks rests on no more candidates than Caratheodory's theorem asks for."""
    r = relax(Problem(off_centre(8, 300)), criterion_of(name))
    assert r.solver == NEWTON
    assert r.gap <= GAP
    weights = r.weights[r.support]
    assert len(weights) <= 11
    assert weights.min() > 1e-6
