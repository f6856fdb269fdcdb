"""The restricted master problem: its multiplier, its reuse, and how it fails."""

import cvxpy as cp
import numpy as np
import pytest
from cvxpy.reductions.solvers.solving_chain import SolvingChain
from matrices import semidefinite
from relaxations import BASES, EPS, GAP, KINDS, SMOOTH, TARGET, UNITS, every

import criteria
from criteria.linalg.inverse import whitener
from edtk.design.problem import Problem
from edtk.design.relaxation.restricted_master import (
    CHAIN,
    POLISH,
    PRUNE,
    SOLVERS,
    RelaxationError,
    RestrictedMaster,
)

pytestmark = pytest.mark.slow

# The first solver on every program, the second on one of each kind.
PROGRAMS = [*((name, "CLARABEL") for name in BASES), *((name, "SCS") for name in KINDS)]


def criterion_of(name):
    """The criterion; of a family the second member, a line through both of its terms."""
    criterion = criteria.create(name, target=TARGET)
    member = criterion.subproblem(np.empty((0, 4, 4)), np.empty(0), np.diag([4.0, 3.0, 2.0, 1.0]))
    if member is criterion:
        return criterion
    return criterion.subproblem(
        np.stack([np.eye(4), np.diag([1.0, 1, 1, -1])]), np.array([5.0, 3.0]), np.eye(4)
    )


def blocks_of(name, seed=0, n=12):
    """Information of rows with a direction in common; of unit trace for O2."""
    rows = np.random.default_rng(seed).normal(size=(n, 2, 4)) + np.array([1.0, 0.5, 0.0, 0.0])
    problem = Problem(rows)
    return (problem.with_unit_trace() if name == "O2" else problem).blocks()


def space(weights, blocks):
    """Information (p, p) of weights."""
    return np.tensordot(weights, blocks, axes=1)


def bound(criterion, Z, blocks, M):
    """The lower bound that a multiplier proves near M, without its inaccurate negative part."""
    Z = semidefinite(Z, M) if criterion.monotone else Z
    return criterion.lower_bound(Z[None], np.einsum("ij,nij->n", Z, blocks).max(keepdims=True), M)


@pytest.mark.parametrize("solver", CHAIN)
@every
def test_answer_proves_itself(name, solver):
    """Weights are a design, and the multiplier proves that none is better, to the gap of 1e-6."""
    if solver == POLISH and name not in SMOOTH:
        with pytest.raises(RelaxationError, match=r"SLSQP: .* is not smooth"):
            RestrictedMaster(criterion_of(name), np.eye(4), 12).solve(blocks_of(name), solver)
        return
    criterion = criterion_of(name)
    blocks = blocks_of(name)
    weights, Z = RestrictedMaster(criterion, blocks.mean(axis=0), 12).solve(blocks, solver)
    assert weights.shape == (12,)
    assert (weights >= 0).all()
    assert weights.sum() == pytest.approx(1, abs=16 * EPS)
    np.testing.assert_allclose(Z, Z.T, atol=64 * EPS * np.abs(Z).max())
    M = space(weights, blocks)
    cost = float(criterion.cost(M))
    # A multiplier is semidefinite to the solver's tolerance only.
    assert (1 - GAP) * cost <= bound(criterion, Z, blocks, M) <= (1 + GAP) * cost


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", SMOOTH)
def test_multiplier_is_the_gradient(name, solver):
    """A smooth criterion's multiplier is minus its gradient times a number, to the gap's root."""
    criterion = criterion_of(name)
    blocks = blocks_of(name)
    weights, Z = RestrictedMaster(criterion, blocks.mean(axis=0), 12).solve(blocks, solver)
    M = space(weights, blocks)
    S = np.linalg.inv(whitener(M))
    Z = S @ Z @ S.T
    G = -S @ criterion.gradient(M) @ S.T
    np.testing.assert_allclose(Z / np.linalg.norm(Z), G / np.linalg.norm(G), atol=np.sqrt(GAP))


@pytest.mark.parametrize(("name", "solver"), PROGRAMS)
def test_whitening_matters_to_no_answer(name, solver):
    """Whatever design of the candidates the program is whitened by, the optimum is the same."""
    criterion = criterion_of(name)
    blocks = blocks_of(name)
    weights, _ = RestrictedMaster(criterion, blocks.mean(axis=0), 12).solve(blocks, solver)
    best = float(criterion.cost(space(weights, blocks)))
    for around in np.random.default_rng(3).dirichlet(np.full(12, 0.5), size=3):
        weights, _ = RestrictedMaster(criterion, space(around, blocks), 12).solve(blocks, solver)
        assert float(criterion.cost(space(weights, blocks))) == pytest.approx(best, rel=GAP)


@pytest.mark.parametrize("name", ["D", "O1"])
@pytest.mark.parametrize("solver", CHAIN)
def test_units(name, solver):
    """A criterion free of units has the same weights in any units, to the root of the gap."""
    criterion = criterion_of(name)
    blocks = blocks_of(name)
    other = blocks * np.outer(UNITS, UNITS)
    plain, _ = RestrictedMaster(criterion, blocks.mean(axis=0), 12).solve(blocks, solver)
    scaled, _ = RestrictedMaster(criterion, other.mean(axis=0), 12).solve(other, solver)
    np.testing.assert_allclose(scaled, plain, atol=np.sqrt(GAP))


@pytest.mark.parametrize(("name", "solver"), PROGRAMS)
def test_program_is_used_again(name, solver):
    """One program for one set after another, of fewer candidates too, is as good as new ones."""
    criterion = criterion_of(name)
    first = blocks_of(name)
    program = RestrictedMaster(criterion, first.mean(axis=0), 12)
    for seed, n in ((0, 12), (1, 7), (2, 12), (0, 12)):
        blocks = blocks_of(name, seed, n)
        weights, Z = program.solve(blocks, solver)
        assert weights.shape == (n,)
        fresh, _ = RestrictedMaster(criterion, blocks.mean(axis=0), n).solve(blocks, solver)
        cost = float(criterion.cost(space(weights, blocks)))
        assert cost == pytest.approx(float(criterion.cost(space(fresh, blocks))), rel=GAP)
        assert bound(criterion, Z, blocks, space(weights, blocks)) == pytest.approx(
            cost, rel=2 * GAP
        )


def test_suits():
    """A program suits no more candidates than it has places for, and only nearly white designs."""
    program = RestrictedMaster(criterion_of("A"), np.diag(UNITS**2), 12)
    assert program.suits(np.diag(UNITS**2), 12)
    assert program.suits(3 * np.diag([1.0, 2.0, 3.0, 4.0] * UNITS**2), 1)
    assert not program.suits(np.diag(UNITS**2), 13)
    assert not program.suits(np.eye(4), 1)
    assert not program.suits(1e6 * np.diag(UNITS**2), 1)
    assert not program.suits(1e-6 * np.diag(UNITS**2), 1)


@every
def test_weights_that_are_as_good_as_none_are_dropped(name):
    """No weight is below 1e-7 of the largest, and hardly any information gets no weight at all."""
    criterion = criterion_of(name)
    blocks = np.concatenate([blocks_of(name), 1e-3 * blocks_of(name)])
    weights, _ = RestrictedMaster(criterion, blocks.mean(axis=0), 24).solve(blocks, "CLARABEL")
    assert (weights[weights > 0] >= 0.99 * PRUNE * weights.max()).all()
    if name != "O2":  # to which the amount of information is nothing
        assert not weights[12:].any()
        assert 1 < np.count_nonzero(weights) < 12


@pytest.mark.parametrize("solver", CHAIN)
def test_optimum_that_leaves_a_direction_open(solver):
    """A singular best design is approached by a little weight on every candidate."""
    criterion = criteria.create("rho0", target=np.array([[1.0, 0.0]]))
    blocks = np.array([np.diag([1.0, 0.0]), np.diag([0.0, 1.0]), np.diag([0.5, 0.5])])
    weights, _ = RestrictedMaster(criterion, blocks.mean(axis=0), 3).solve(blocks, solver)
    assert weights.sum() == pytest.approx(1, abs=16 * EPS)
    assert 1 <= float(criterion.cost(space(weights, blocks))) <= 1 + GAP


@pytest.mark.parametrize(
    ("name", "solver"),
    [("A", "SCS"), *((name, solver) for name in SMOOTH for solver in ("CLARABEL", POLISH))],
)
def test_candidates_without_a_regular_design(name, solver):
    """Candidates that leave a direction open have no design: the error names the solver."""
    blocks = blocks_of(name)
    blocks[:, :, 2] = blocks[:, 2, :] = 0.0
    criterion = criteria.create(name, target=np.eye(4))
    with pytest.raises(RelaxationError, match=f"^{solver}: "):
        RestrictedMaster(criterion, np.eye(4), 12).solve(blocks, solver)


@pytest.mark.parametrize("solver", SOLVERS)
def test_failure_is_told_in_the_words_of_the_solver(monkeypatch, solver):
    """A failure of the solver is an error with its name and its words on one line."""

    def solve_via_data(self, *args, **options):
        raise cp.SolverError("numerical\n  trouble")

    monkeypatch.setattr(SolvingChain, "solve_via_data", solve_via_data)
    with pytest.raises(RelaxationError, match=f"^{solver}: numerical trouble$"):
        RestrictedMaster(criterion_of("A"), np.eye(4), 12).solve(blocks_of("A"), solver)


@pytest.mark.parametrize("name", BASES)
def test_inaccurate_answer_is_an_answer(monkeypatch, name):
    """A solver that runs out of iterations gives a design; its certificate tells its worth."""
    monkeypatch.setitem(SOLVERS, "CLARABEL", {"max_iter": 5})
    criterion = criterion_of(name)
    blocks = blocks_of(name)
    weights, Z = RestrictedMaster(criterion, blocks.mean(axis=0), 12).solve(blocks, "CLARABEL")
    assert (weights >= 0).all()
    assert weights.sum() == pytest.approx(1, abs=16 * EPS)
    cost = float(criterion.cost(space(weights, blocks)))
    assert np.isfinite(cost)
    assert np.isfinite(Z).all()
    monkeypatch.undo()
    weights, _ = RestrictedMaster(criterion, blocks.mean(axis=0), 12).solve(blocks, "CLARABEL")
    assert cost >= float(criterion.cost(space(weights, blocks))) * (1 - GAP)
