"""The relaxation against textbook optima, the equivalence theorem, and bounds computed another way."""

from itertools import combinations, product
from pathlib import Path

import cvxpy as cp
import numpy as np
import pytest

import criteria
from edtk.design import Problem, RelaxationError, relax, sample_feasible
from edtk.study import load_study

STUDY = Path(__file__).parents[2] / "studies" / "kr270_milling.toml"
GRID = np.linspace(-1, 1, 41)
CHEBYSHEV = np.array([-1, -np.sqrt(0.5), 0, np.sqrt(0.5), 1])
CONVEX = ("A", "D", "E", "G", "O1", "O3")
GAP = 1e-6
EPS = np.finfo(float).eps


def polynomial(degree, x=GRID):
    return Problem(np.vander(x, degree + 1, increasing=True)[:, None, :])


def quadratic(factors):
    """All monomials up to degree two on the grid {-1, 0, 1}^factors."""
    x = np.array(list(product((-1.0, 0.0, 1.0), repeat=factors)))
    mixed = [x[:, i] * x[:, j] for i, j in combinations(range(factors), 2)]
    return Problem(np.column_stack([np.ones(len(x)), x, x**2, *mixed])[:, None, :])


def random_problem(seed, n=60, rows=2, p=4):
    rng = np.random.default_rng(seed)
    return Problem(rng.normal(size=(n, rows, p)), sigma=rng.uniform(0.5, 2.0, size=rows))


def slip(problem, relaxation):
    """Relative error to which a cost and a bound are defined in rounding: 64 p eps cond(M)."""
    return 64 * problem.p * EPS * np.linalg.cond(problem.information(relaxation.weights))


def gathered(weights, x):
    """Support and weights, rounded to where the cost itself is flat to the gap."""
    support = np.flatnonzero(weights > 1e-3)
    return x[support], weights[support]


@pytest.fixture(scope="module")
def study():
    return load_study(STUDY)


@pytest.fixture(scope="module")
def kr270(study):
    design = study.design
    rng = np.random.default_rng([study.file.seed, 0])
    return design.problem(sample_feasible(design.workspace, 2000, rng, design.free, design.fixed))


@pytest.mark.parametrize(
    ("name", "weights", "cost"),
    [
        ("D", [1 / 3, 1 / 3, 1 / 3], (4 / 27) ** (-1 / 3)),
        ("A", [1 / 4, 1 / 2, 1 / 4], 8.0),
        ("E", [1 / 5, 3 / 5, 1 / 5], 5.0),
    ],
)
def test_quadratic_regression(name, weights, cost):
    """Quadratic regression on [-1, 1] has the textbook weights at -1, 0, 1 and the textbook cost."""
    r = relax(polynomial(2), criteria.create(name))
    x, w = gathered(r.weights, GRID)
    np.testing.assert_allclose(x, [-1, 0, 1], atol=1e-15)
    np.testing.assert_allclose(w, weights, atol=np.sqrt(GAP))  # the cost is quadratic about its optimum
    assert r.cost == pytest.approx(cost, rel=GAP)


def test_quartic_e_optimum_lies_on_the_chebyshev_points():
    """Quartic regression has the E-optimum 1/129, the inverse square norm of the Chebyshev polynomial."""
    x = np.sort(np.concatenate([np.setdiff1d(np.round(GRID, 12), [-1, 0, 1]), CHEBYSHEV]))
    r = relax(polynomial(4, x), criteria.create("E"))
    assert 1 / r.cost == pytest.approx(1 / 129, rel=GAP)
    np.testing.assert_allclose(gathered(r.weights, x)[0], CHEBYSHEV, atol=1e-15)


@pytest.mark.parametrize(("factors", "value"), [(2, 0.474594), (3, 0.474478)])
def test_full_quadratic_on_the_grid(factors, value):
    """The full quadratic model on the square and on the cube has the tabulated det(M)^(1/p)."""
    r = relax(quadratic(factors), criteria.create("D"))
    assert 1 / r.cost == pytest.approx(value, abs=0.6e-6)


@pytest.mark.parametrize("problem", [polynomial(3), quadratic(2), random_problem(0)], ids=["cubic", "3x3", "random"])
def test_kiefer_wolfowitz(problem):
    """At a D-optimum the largest trace(cov M_i) over the candidates is p, and every support point attains it."""
    r = relax(problem, criteria.create("D"))
    cov = np.linalg.inv(problem.information(r.weights))
    variance = np.einsum("ij,nji->n", cov, problem.information_blocks)
    assert variance.max() == pytest.approx(problem.p, rel=GAP)
    assert r.weights @ variance == pytest.approx(problem.p, rel=1e-10)


@pytest.mark.parametrize("name", CONVEX)
@pytest.mark.parametrize("seed", range(3))
def test_bound_and_gap(name, seed):
    """Weights are a design, cost is theirs, and the bound lies below it by no more than the gap asked for."""
    problem, criterion = random_problem(seed), criteria.create(name)
    r = relax(problem, criterion)
    assert (r.weights >= 0).all()
    assert r.weights.sum() == pytest.approx(1, abs=1e-12)
    assert r.cost == pytest.approx(float(criterion.cost(problem.information(r.weights))), rel=1e-12)
    assert -slip(problem, r) <= r.gap <= GAP


@pytest.mark.parametrize("name", CONVEX)
@pytest.mark.parametrize("degree", range(1, 8))
def test_bound_of_ill_conditioned_regression(name, degree):
    """A bound is a bound: for monomials up to degree seven it exceeds the cost by rounding of M's inverse at most."""
    problem = polynomial(degree)
    r = relax(problem, criteria.create(name))
    assert -slip(problem, r) <= r.gap <= GAP


@pytest.mark.parametrize("name", CONVEX)
def test_no_weights_are_below_the_bound(name):
    """Neither random weights nor the uniform ones cost less than the bound, and the uniform not less than the best."""
    problem, criterion = random_problem(5), criteria.create(name)
    r = relax(problem, criterion)
    rng = np.random.default_rng(0)
    trials = rng.dirichlet(np.full(len(r.weights), 0.05), size=300)
    near = 0.9 * r.weights + 0.1 * trials
    costs = [float(criterion.cost(problem.information(w))) for w in (*trials, *near)]
    assert min(costs) >= r.bound * (1 - slip(problem, r))
    assert float(criterion.cost(problem.information(np.full(60, 1 / 60)))) >= r.cost


@pytest.mark.parametrize("name", ["A", "D", "O1"])
def test_bound_of_a_smooth_criterion_by_its_gradient(name):
    """Convexity along the ray through M gives a bound from gradients at the weights; relax proves at least that.

    By homogeneity ``cost(N) >= cost(M) (<Z, M>/<Z, N>)^degree`` with Z minus the gradient.
    """
    problem, criterion = random_problem(7), criteria.create(name)
    r = relax(problem, criterion)
    M = problem.information(r.weights)
    cov = np.linalg.inv(M)
    Z = cov @ cov if name == "A" else cov
    dearest = max(np.trace(Z @ N) for N in problem.information_blocks)
    mine = r.cost * (np.trace(Z @ M) / dearest) ** criterion.degree
    assert mine <= r.bound * (1 + slip(problem, r))
    assert r.cost * (1 - GAP) <= r.bound <= r.cost * (1 + slip(problem, r))


@pytest.mark.parametrize("problem", [polynomial(3), random_problem(3)], ids=["cubic", "random"])
def test_bound_of_e_by_its_dual(problem):
    """Any psd Z of trace one has lambda_min(M) <= max <Z, M_i>: the least such bound, found apart, is relax's."""
    r = relax(problem, criteria.create("E"))
    Z, t = cp.Variable((problem.p, problem.p), PSD=True), cp.Variable()
    rows = [cp.trace(Z @ N) <= t for N in problem.information_blocks]
    cp.Problem(cp.Minimize(t), [*rows, cp.trace(Z) == 1]).solve(solver="CLARABEL")
    values, V = np.linalg.eigh(Z.value)
    Y = (V * np.maximum(values, 0)) @ V.T
    ceiling = max(np.sum(Y * N) for N in problem.information_blocks) / np.trace(Y)
    assert 1 / r.cost <= ceiling * (1 + 1e-12)
    assert 1 / r.bound == pytest.approx(ceiling, rel=GAP)


@pytest.mark.parametrize("name", ["D", "rho0"])
def test_badly_scaled_parameters(name, study, kr270):
    """Parameters in units from 1e-7 to 1e4 give a design as good as in SI units, within the gap."""
    T = np.array([1e-7, 1e4, 1e-3, 1.0, 1e2])
    criterion = study.criterion(name)
    plain = relax(kr270, criterion)
    other = relax(Problem(kr270.blocks * T, kr270.sigma), criterion.in_units(np.diag(T)))
    assert other.gap <= GAP
    assert float(criterion.cost(kr270.information(other.weights))) == pytest.approx(plain.cost, rel=GAP)


@pytest.mark.parametrize("name", ["O2", "O4", "O5"])
def test_criterion_without_expression(name):
    """A criterion that has no convex expression is refused with its name."""
    with pytest.raises(NotImplementedError, match=name):
        relax(polynomial(2), criteria.create(name))


@pytest.mark.parametrize("name", ["A", "D", "E"])
def test_rank_deficient_candidates(name):
    """Candidates that leave a direction open together are refused."""
    x = np.column_stack([GRID, 2 * GRID, GRID**2])
    with pytest.raises(RelaxationError, match="cannot identify"):
        relax(Problem(x[:, None, :]), criteria.create(name))


@pytest.mark.parametrize("name", ["rho0", *CONVEX])
def test_kr270(name, study, kr270):
    """2000 candidate poses of the KR 270: every convex criterion is solved to a proved gap of 2e-6."""
    criterion = study.criterion(name)
    r = relax(kr270, criterion)
    assert r.gap <= GAP
    assert r.bound <= r.cost * (1 + slip(kr270, r))
    assert r.cost <= float(criterion.cost(kr270.information(np.full(2000, 1 / 2000))))


@pytest.mark.parametrize("name", ["A", "rho0"])
def test_gap_that_is_asked_for(name, study, kr270):
    """A coarser gap is honoured too, with a valid bound."""
    fine, coarse = (relax(kr270, study.criterion(name), gap=g) for g in (1e-6, 1e-2))
    assert coarse.gap <= 1e-2
    assert coarse.bound <= fine.cost
