"""The relaxation: its certificate against numpy alone, all solvers, all criteria, good and bad units, and failures.

Tolerances are those of `slip`, to which cost and bound are defined in rounding, and of the gap that was asked for.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import cvxpy as cp
import numpy as np
import pytest

import criteria
from criteria import ConvexCriterion, Criterion, Relaxable
from edtk.design.candidate_source import CandidateSource
from edtk.design.problem import Problem, RankDeficientError
from edtk.design.relaxation.relax import RelaxationInterrupted, relax
from edtk.design.relaxation.restricted_master import CHAIN, SOLVERS, RelaxationError
from edtk.design.relaxation.solver_options import SolverOptions
from edtk.study.study import load_study

GAP = 1e-6
EPS = np.finfo(float).eps
NAMES = criteria.available()
SMOOTH = tuple(name for name in NAMES if criteria.get(name).smooth)
MONOTONE = tuple(name for name in NAMES if criteria.get(name).monotone)
UNITS = np.array([1e-7, 1e-2, 1e1, 1e4])
TARGET = np.random.default_rng(9).normal(size=(3, 4))
every = pytest.mark.parametrize("name", NAMES)


def blocks_of(seed, n=60, size=2, p=4):
    return np.random.default_rng(seed).normal(size=(n, size, p))


def off_centre(seed, n):
    """Single rows that have a direction in common, so that equal eigenvalues are out of reach."""
    return blocks_of(seed, n, 1) + np.array([2.0, 1.0, 0.5, 0.0])


def cubic():
    return np.vander(np.linspace(-1, 1, 41), 4, increasing=True)[:, None, :]


def uneven():
    """Candidates whose information differs by twelve decades."""
    return blocks_of(3) * 10 ** np.random.default_rng(5).uniform(-3, 3, size=(60, 1, 1))


WELL = {
    "blocks of two": blocks_of(0),
    "many rows": blocks_of(1, 600, 1),
    "cubic": cubic(),
    "off-centre": off_centre(2, 30),
    "uneven": uneven(),
}
BADLY = {
    "parameters x 1e-7 .. 1e4": blocks_of(0, 16) * UNITS,
    "cubic x 1e4 .. 1e-7": cubic()[::4] * UNITS[::-1],
    "all x 1e-9": blocks_of(0, 16) * 1e-9,
}


def units_of(case):
    return {"parameters x 1e-7 .. 1e4": UNITS, "cubic x 1e4 .. 1e-7": UNITS[::-1]}.get(
        case, np.ones(4)
    )


def criterion_of(name, units=1.0):
    return criteria.create(name, target=TARGET * units)


def inverse(M):
    """Inverses (..., p, p) of M scaled to a unit diagonal, so that units lose nothing."""
    d = np.sqrt(np.diagonal(M, axis1=-2, axis2=-1))
    dd = d[..., :, None] * d[..., None, :]
    return np.linalg.inv(M / dd) / dd


def slips(M):
    """Relative errors (...) to which costs are defined: 64 p eps cond of M scaled to a unit diagonal."""
    d = np.sqrt(np.diagonal(M, axis1=-2, axis2=-1))
    return 64 * M.shape[-1] * EPS * np.linalg.cond(M / (d[..., :, None] * d[..., None, :]))


def slip(M, name=""):
    """That of one matrix; to the error of cov, relative to its largest eigenvalue, O5 is as sensitive as a root."""
    rounding = float(slips(M))
    if name != "O5":
        return rounding
    variances = np.maximum(np.linalg.eigvalsh(inverse(M)), 0.0)
    lost = rounding * variances[-1]
    return rounding + (np.sqrt(variances + lost) - np.sqrt(variances)).sum() / np.sqrt(
        variances[-1]
    )


def lost(M, name):
    """That of a bound; that of O2 and O4 is a difference of prices, and loses what is small beside the largest."""
    return 64 * len(M) * EPS * np.linalg.cond(M) if name in ("O2", "O4") else slip(M, name)


def costs(name, M, target):
    """Costs (...) of M (..., p, p) as Table 1 prints them or their reciprocals, by numpy alone."""
    cov, p = inverse(M), M.shape[-1]
    largest = np.linalg.eigvalsh(M)[..., -1]
    variances = np.maximum(np.linalg.eigvalsh(cov), 0.0)
    det = np.exp(-np.linalg.slogdet(M).logabsdet / p)
    return {
        "A": np.trace(cov, axis1=-2, axis2=-1),
        "D": det,
        "E": variances[..., -1],
        "G": np.diagonal(cov, axis1=-2, axis2=-1).max(axis=-1),
        "O1": np.sqrt(det),
        "O2": np.sqrt(largest * variances[..., -1]),
        "O3": np.sqrt(variances[..., -1]),
        "O4": np.sqrt(largest) * variances[..., -1],
        "O5": np.sqrt(variances).sum(axis=-1),
        "rho0": np.sqrt(np.trace(target @ cov @ target.T, axis1=-2, axis2=-1)),
    }[name]


def spectrum(Z):
    """Eigenvalues (p,) and -vectors of Z scaled to a unit diagonal, less what is lost in rounding; and the scale."""
    d = np.sqrt(np.abs(np.diag(Z)))
    d = np.where(d > 0, d, 1.0)
    z, V = np.linalg.eigh(Z / np.outer(d, d))
    return np.where(np.abs(z) > 16 * len(Z) * EPS * np.abs(z).max(), z, 0.0), V, d


def root_trace(Z, power=0.5):
    """``trace Z^power`` of a positive semidefinite Z, from the singular values of a root of it: good in any units."""
    z, V, d = spectrum(Z)
    root = np.sqrt(np.maximum(z, 0.0))[:, None] * V.T * d
    return (np.linalg.svd(root, compute_uv=False) ** (2 * power)).sum()


def proved(name, Z, blocks, M, target):
    """The lower bound that multipliers Z (r, p, p) prove over the information blocks (n, p, p), by numpy alone.

    Every design X obeys <Z, X> <= t, the dearest price. The bounds of A, D, G, O5 and rho0 are those of Hoelder's
    inequality for traces; of G for a weighted sum of the variances, whatever its weights.
    """
    t = np.einsum("rij,nij->rn", Z, blocks).max(axis=1)
    if name == "O4":
        return np.sqrt(least_product(Z, t))
    (Z,), (t,) = Z, t
    p = len(Z)
    if name == "O2":
        z = np.linalg.eigvalsh(Z - t * np.eye(p))
        return np.sqrt(max(1.0, z[z > 0].sum() / -z[z < 0].sum() if (z < 0).any() else 1.0))
    if name == "G":
        variance = np.diag(inverse(M))
        starts = np.maximum(np.diag(M @ Z @ M), 0.0), (variance == variance.max()).astype(float)
        return max(weighted_trace(Z, u) for u in starts) / t
    det = p * np.exp(np.linalg.slogdet(Z).logabsdet / p)
    return {
        "A": lambda: root_trace(Z) ** 2 / t,
        "D": lambda: det / t,
        "E": lambda: np.trace(Z) / t,
        "O1": lambda: np.sqrt(det / t),
        "O3": lambda: np.sqrt(np.trace(Z) / t),
        "O5": lambda: root_trace(Z, 1 / 3) ** 1.5 / np.sqrt(t),
        "rho0": lambda: root_trace(target @ Z @ target.T) / np.sqrt(t),
    }[name]()


def weighted_trace(Z, u):
    """``(trace K^(1/2))^2``, K = U^(1/2) Z U^(1/2) and U = diag(u)/sum u, the best of steps ``u <- diag K^(1/2)``."""
    found = []
    for _ in range(500):
        root = np.sqrt(u / u.sum())
        values, V = np.linalg.eigh(root[:, None] * Z * root)
        roots = np.sqrt(np.maximum(values, 0.0))
        found.append(roots.sum() ** 2)
        u = np.square(V) @ roots
    return max(found)


def least_product(Z, t):
    """The least s kappa where ``t_j s + b_j kappa >= a_j``, kappa >= 1 and s >= 0, a and b the traces of Z+ and Z-.

    At the least s of each kappa, which is piecewise linear and convex, the product is concave between two corners: it
    is least at one of them, or at the least kappa that lines of t <= 0 leave.
    """
    z = np.linalg.eigvalsh(Z)
    a, b = np.maximum(z, 0).sum(axis=1), np.maximum(-z, 0).sum(axis=1)
    b = np.where([(spectrum(y)[0] >= 0).all() for y in Z], 0.0, b)
    a, b, t = (x[(t > 0) | (b > 0)] for x in (a, b, t))
    steep = t <= 0
    start = max(1.0, (a[steep] / b[steep]).max(initial=1.0))
    a, b = a[~steep] / t[~steep], b[~steep] / t[~steep]
    with np.errstate(divide="ignore", invalid="ignore"):
        corners = np.concatenate([[start], ((a[:, None] - a) / (b[:, None] - b)).ravel(), a / b])
    kappa = corners[np.isfinite(corners) & (corners >= start)]
    return (kappa * np.maximum(0.0, a - b * kappa[:, None]).max(axis=1, initial=0.0)).min()


def check(r, problem, name, target=TARGET, units=1.0):
    """What a relaxation says of itself is true: weights, cost, bound and gap, by numpy alone."""
    M = np.tensordot(r.weights, problem.blocks(), axes=1)
    normalised = problem.blocks()
    if name == "O2":
        normalised = (
            normalised
            / np.maximum(np.trace(normalised, axis1=1, axis2=2), np.finfo(float).tiny)[
                :, None, None
            ]
        )
    rounding = slip(M, name)
    assert (r.weights >= 0).all()
    assert r.weights.sum() == pytest.approx(1, abs=1e-12)
    np.testing.assert_array_equal(r.support, np.flatnonzero(r.weights > 0))
    assert r.cost == pytest.approx(costs(name, M, target * units), rel=rounding)
    assert r.proved_bound.cost <= r.cost * (1 + rounding)
    assert r.gap == pytest.approx(1 - r.proved_bound.cost / r.cost, abs=4 * EPS)
    if r.proved_bound.cost > (1.0 if name == "O2" else 0.0):  # less is known of every design
        steps = 1e-8 if name == "G" else 0.0  # of the weights, which may converge slowly
        assert r.proved_bound.cost <= proved(name, r.multipliers, normalised, M, target * units) * (
            1 + lost(M, name) + steps
        )


@cache
def solved(name, case):
    """The relaxation of a case by the chain, once."""
    return relax(Problem((WELL | BADLY)[case]), criterion_of(name, units_of(case)))


def solve_then(change):
    """A stand-in for `cvxpy.Problem.solve` that solves and then changes the answer of CLARABEL."""
    solve = cp.Problem.solve

    def stand_in(self, *args, solver=None, **options):
        value = solve(self, *args, solver=solver, **options)
        if solver == "CLARABEL":
            change(self)
        return value

    return stand_in


@pytest.fixture(scope="module")
def study():
    return load_study(Path(__file__).parents[3] / "studies" / "kr270_milling.toml")


@pytest.fixture(scope="module")
def kr270(study):
    return CandidateSource(study.space, study.specification.seed).take(2000).problem


def attempt(problem, criterion, solvers):
    try:
        return relax(problem, criterion, options=SolverOptions(solvers=solvers))
    except RelaxationError as error:
        return error


@pytest.mark.parametrize(
    "solvers", [("CLARABEL",), ("SCS",), CHAIN], ids=["CLARABEL", "SCS", "chain"]
)
@pytest.mark.parametrize("case", ["cubic", "off-centre", "uneven", *BADLY])
@every
def test_all_solvers_on_all_problems(name, case, solvers):
    """Every solver and the chain, every criterion, good and bad units: the gap of 1e-6, or an honest failure.

    Well-scaled problems must reach the gap by the chain; a common unit of all parameters is no bad scale.
    """
    units = units_of(case)
    problem = Problem((WELL | BADLY)[case])
    demanded = solvers == CHAIN and (units == 1).all()
    r = solved(name, case) if demanded else attempt(problem, criterion_of(name, units), solvers)
    if isinstance(r, RelaxationError):
        assert not demanded
        assert all(solver in str(r) for solver in solvers)
    else:
        check(r, problem, name, units=units)
        assert r.solver in solvers
        assert r.gap <= GAP or not demanded


@pytest.mark.parametrize("case", [*WELL, *BADLY])
@every
def test_certify(name, case):
    """`certify` finds cost and bound from weights, multipliers and candidates, whatever the plan claims."""
    problem, r = Problem((WELL | BADLY)[case]), solved(name, case)
    M = problem.information(r.weights)
    claim = replace(
        r, cost=0.1 * r.cost, proved_bound=replace(r.proved_bound, cost=10 * r.proved_bound.cost)
    )
    for factor in (1, 2):  # of information of which no design knew
        cost, bound = claim.certify(Problem.of_information(factor * problem.packed))
        assert cost == pytest.approx(r.cost * factor**-r.criterion.degree, rel=slip(M, name))
        assert bound == pytest.approx(
            r.proved_bound.cost * factor**-r.criterion.degree, rel=lost(M, name)
        )


@pytest.mark.parametrize(
    "case", ["blocks of two", "cubic", "off-centre", "parameters x 1e-7 .. 1e4", "all x 1e-9"]
)
@every
def test_no_design_beats_the_bound(name, case):
    """Neither random designs, nor steps from the optimum towards them or towards one candidate, cost less."""
    problem, r = Problem((WELL | BADLY)[case]), solved(name, case)
    rng, n = np.random.default_rng(0), problem.n
    trials = np.concatenate(
        [rng.dirichlet(np.full(n, c), size=200) for c in (0.05, 0.3, 3.0)] + [np.eye(n)]
    )
    steps = [(1 - a) * r.weights + a * trials for a in (1e-4, 1e-2, 0.1, 0.5)]
    M = np.tensordot(np.concatenate([trials[:-n], *steps]), problem.blocks(), axes=1)
    known = slips(M) < 1e-9
    assert known.sum() > 1000
    assert costs(name, M[known], TARGET * units_of(case)).min() >= r.proved_bound.cost * (1 - 1e-9)


@every
def test_any_multiplier_proves_a_bound(name):
    """Whatever the multipliers (positive semidefinite where the criterion is monotone), no optimum is below the bound.

    They are random, alone or beside those of the relaxation, or the relaxation's with an error.
    """
    problem, r = Problem(WELL["off-centre"]), solved(name, "off-centre")
    rng, found = np.random.default_rng(1), []
    for rank in (1, 2, 4) * 20:
        B = rng.normal(size=(2, len(r.multipliers), 4, rank)) * 10 ** rng.uniform(
            -1, 1, size=(2, 1, 4, 1)
        )
        Z = B[0] @ B[0].swapaxes(1, 2)
        if name not in MONOTONE:
            Z -= rng.uniform(0, 2) * B[1] @ B[1].swapaxes(1, 2)
        size = np.linalg.norm(r.multipliers, axis=(1, 2)) / np.linalg.norm(Z, axis=(1, 2))
        near = r.multipliers + rng.choice([1e-9, 1e-3, 0.3]) * size[:, None, None] * Z
        found += [replace(r, multipliers=y).certify(problem)[1] for y in (Z, near)]
    assert max(found) <= r.cost * (1 + slip(problem.information(r.weights)))
    assert max(found) > (1 - 1e-3) * r.cost  # some of them prove much
    assert min(found) < 0.95 * r.cost  # and some little


@pytest.mark.parametrize("case", [*WELL, "all x 1e-9"])
@pytest.mark.parametrize("name", MONOTONE)
def test_weight_rests_on_the_dearest_candidates(name, case):
    """The equivalence theorem with a gap g: the mean shortfall from the dearest price is below 1 - (1-g)^(1/degree).

    For ``cost(M) >= c <Z, M>^-degree``, of which the bound is ``c t^-degree``, and <Z, M> is the mean price.
    """
    problem, r = Problem((WELL | BADLY)[case]), solved(name, case)
    sensitivities = np.einsum("ij,nij->n", r.multipliers[0], problem.blocks())
    rounding = slip(problem.information(r.weights))
    assert (
        r.weights @ (1 - sensitivities / sensitivities.max())
        <= 1 - (1 - r.gap) ** (1 / r.criterion.degree) + 2 * rounding
    )


@pytest.mark.parametrize("factor", [1e-20, 1e-8, 1e-3, 1e9])
@every
def test_unit_of_the_regressors(name, factor):
    """Regressors times c have the cost times c^(-2 degree), whatever the unit, and a bound that is one."""
    blocks = WELL["off-centre"]
    r, other = solved(name, "off-centre"), relax(Problem(factor * blocks), criterion_of(name))
    scale = factor ** (2 * r.criterion.degree)
    assert -slip(Problem(blocks).information(other.weights)) <= other.gap <= GAP
    assert other.cost * scale == pytest.approx(r.cost, rel=GAP)
    assert other.proved_bound.cost * scale <= r.cost


@pytest.mark.parametrize("name", ["D", "O1", "rho0"])
def test_units_of_single_parameters(name):
    """A criterion that is free of units has the same optimum in units from 1e-7 to 1e4, times a constant."""
    problem, other = Problem(WELL["blocks of two"]), Problem(WELL["blocks of two"] * UNITS)
    criterion = criterion_of(name)
    r, s = solved(name, "blocks of two"), relax(other, criterion.in_units(np.diag(UNITS)))
    check(s, other, name, units=UNITS)
    assert s.gap <= GAP
    assert float(criterion.cost(problem.information(s.weights))) == pytest.approx(r.cost, rel=GAP)


@pytest.mark.parametrize("case", ["blocks of two", "cubic", "off-centre"])
@pytest.mark.parametrize(("root", "square"), [("O1", "D"), ("O3", "E")])
def test_roots_of_one_another(root, square, case):
    """O1 is the root of D, and O3 of E: so are their optima and bounds, within the gaps."""
    problem = Problem(WELL[case])
    r, s = solved(root, case), solved(square, case)
    assert r.cost**2 == pytest.approx(s.cost, rel=2 * GAP)
    assert r.proved_bound.cost**2 <= s.cost * (1 + slip(problem.information(s.weights)))
    assert s.proved_bound.cost <= r.cost**2 * (1 + slip(problem.information(r.weights)))


@pytest.mark.parametrize("case", ["cubic", "off-centre"])
@every
def test_duplicate_candidates(name, case):
    """Every candidate three times, side by side or one list after another, changes neither cost nor bound."""
    blocks, criterion, r = WELL[case], criterion_of(name), solved(name, case)
    for copies, axis in ((np.repeat(blocks, 3, axis=0), 1), (np.tile(blocks, (3, 1, 1)), 0)):
        s = relax(Problem(copies), criterion)
        check(s, Problem(copies), name)
        assert s.gap <= GAP
        assert s.cost == pytest.approx(r.cost, rel=GAP)
        shape = (len(blocks), 3) if axis else (3, len(blocks))
        M = Problem(blocks).information(s.weights.reshape(shape).sum(axis=axis))
        assert costs(name, M, TARGET) == pytest.approx(s.cost, rel=slip(M))


@pytest.mark.parametrize("case", ["many rows", "cubic", "off-centre"])
@every
def test_order_of_the_candidates(name, case):
    """A permutation of the candidates permutes a design, and changes neither cost nor bound."""
    blocks, criterion = WELL[case], criterion_of(name)
    order = np.random.default_rng(4).permutation(len(blocks))
    r, s = solved(name, case), relax(Problem(blocks[order]), criterion)
    back = np.empty_like(s.weights)
    back[order] = s.weights
    M = Problem(blocks).information(back)
    assert s.gap <= GAP
    assert costs(name, M, TARGET) == pytest.approx(s.cost, rel=slip(M))
    assert s.cost == pytest.approx(r.cost, rel=GAP)
    assert max(r.proved_bound.cost, s.proved_bound.cost) <= min(r.cost, s.cost) * (1 + slip(M))


@every
def test_candidates_without_information(name):
    """Candidates that say nothing change nothing, and get no more weight than the gap allows."""
    blocks = WELL["off-centre"]
    padded = np.concatenate([np.zeros((5, 1, 4)), blocks[:10], np.zeros((5, 1, 4)), blocks[10:]])
    r, s = solved(name, "off-centre"), relax(Problem(padded), criterion_of(name))
    check(s, Problem(padded), name)
    assert s.gap <= GAP
    assert s.cost == pytest.approx(r.cost, rel=GAP)


@every
def test_more_candidates_are_no_worse(name):
    """The bound over all candidates is not above the cost over a part of them."""
    blocks, criterion = WELL["many rows"], criterion_of(name)
    r = solved(name, "many rows")
    for part in (slice(0, 300), slice(0, None, 7)):
        assert r.proved_bound.cost <= relax(Problem(blocks[part]), criterion).cost * (
            1 + slip(Problem(blocks[part]).mean)
        )


@pytest.mark.parametrize("batch", [1, 3, 10, 400])
@every
def test_batch(name, batch):
    """However many candidates join at a time, one at least, the gap is reached, and the optimum is the same."""
    problem = Problem(off_centre(8, 200))
    r = relax(problem, criterion_of(name), options=SolverOptions(batch=batch, rounds=1000))
    check(r, problem, name)
    assert r.gap <= GAP
    assert r.cost == pytest.approx(relax(problem, criterion_of(name)).cost, rel=GAP)


@every
def test_twenty_thousand_candidates(name):
    """A set much larger than a master is solved to the gap too, by several masters."""
    problem = Problem(blocks_of(11, 20_000, 2))
    r = relax(problem, criterion_of(name), options=SolverOptions(batch=10))
    check(r, problem, name)
    assert r.gap <= GAP
    assert r.iterations > 1 or name == "O2"


@every
def test_few_candidates_and_few_parameters(name):
    """One candidate, and one parameter: the design is the only one there is, or the most informative candidate."""
    single = Problem(blocks_of(0, 1, 6))
    r = relax(single, criterion_of(name))
    np.testing.assert_array_equal(r.weights, [1.0])
    check(r, single, name)
    lone = Problem(blocks_of(0, 30, 2, 1))
    r = relax(lone, criteria.create(name, target=np.eye(1)))
    assert r.gap <= GAP
    assert r.cost == pytest.approx(1 / lone.packed.max() ** r.criterion.degree, rel=GAP)


def test_direction_that_one_candidate_in_ten_thousand_excites():
    """A direction that a single candidate excites, which no sample holds, is found: half the weight goes there."""
    rows = np.zeros((10_001, 1, 2))
    rows[:, 0, 0] = 1
    rows[1, 0] = 0, 1
    r = relax(Problem(rows), criteria.create("D"))
    assert r.gap <= GAP
    assert r.weights[1] == pytest.approx(0.5, abs=np.sqrt(GAP))
    assert r.cost == pytest.approx(2, rel=GAP)


@pytest.mark.parametrize("factor", [100, 1e6])
@pytest.mark.parametrize("name", ["D", "E", "G", "rho0"])
def test_strong_candidates_that_no_sample_holds(name, factor):
    """Eight of 20,000 candidates are far stronger, and turn up in pricing only: the gap is reached nevertheless."""
    blocks = off_centre(1, 20_000)
    blocks[1:9] = factor * blocks_of(5, 8, 1)
    problem = Problem(blocks)
    r = relax(problem, criterion_of(name))
    check(r, problem, name)
    assert r.gap <= GAP


@every
def test_kr270(name, study, kr270):
    """2000 candidate poses of the KR 270: every criterion is solved to the gap, with the bound of numpy alone."""
    criterion = study.criterion(name)
    r = relax(kr270, criterion)
    check(r, kr270, name, getattr(criterion, "target", np.eye(5)))
    assert r.gap <= GAP
    assert r.cost <= float(criterion.cost(kr270.mean)) * (1 + slip(kr270.mean))


@pytest.mark.parametrize("name", ["D", "rho0"])
def test_kr270_in_other_units(name, study, kr270):
    """Parameters in units from 1e-7 to 1e4 give a design as good as in SI units, within the gap."""
    T = np.array([1e-7, 1e4, 1e-3, 1.0, 1e2])
    criterion, (i, j) = study.criterion(name), np.triu_indices(5)
    other = relax(
        Problem.of_information(kr270.packed * (T[i] * T[j])[:, None]),
        criterion.in_units(np.diag(T)),
    )
    assert other.gap <= GAP
    plain = relax(kr270, criterion)
    assert float(criterion.cost(kr270.information(other.weights))) == pytest.approx(
        plain.cost, rel=GAP
    )


@pytest.mark.parametrize("name", ["A", "E", "G", "rho0"])
def test_gap_that_is_asked_for(name):
    """A coarser gap is honoured too, in fewer masters, with a bound that is one."""
    problem = Problem(off_centre(12, 2000))
    fine, coarse = (
        relax(problem, criterion_of(name), gap=g, options=SolverOptions(batch=5))
        for g in (GAP, 0.4)
    )
    check(coarse, problem, name)
    assert GAP < coarse.gap <= 0.4
    assert coarse.iterations < fine.iterations
    assert coarse.proved_bound.cost <= fine.cost


@pytest.mark.parametrize("name", ["A", "D", "E", "O2", "rho0"])
def test_limit_of_rounds(name):
    """What is found in two rounds is certified, and its gap is what it is."""
    problem = Problem(off_centre(12, 2000))
    r = relax(problem, criterion_of(name), options=SolverOptions(rounds=2, batch=2))
    check(r, problem, name)
    assert r.iterations == 2
    assert GAP < r.gap < 1


@every
def test_progress(name):
    """Progress is told after every master, counted from one, and the gap never grows."""
    calls = []
    problem = Problem(off_centre(12, 2000))
    r = relax(
        problem,
        criterion_of(name),
        options=SolverOptions(batch=2),
        progress=lambda *call: calls.append(call),
    )
    iterations, gaps = zip(*calls, strict=True)
    assert iterations == tuple(range(1, r.iterations + 1))
    assert (np.diff(gaps) <= 0).all()
    assert gaps[-1] <= GAP


@pytest.mark.parametrize("k", [1, 3])
@pytest.mark.parametrize("name", ["A", "D", "E", "G", "O2", "O4", "O5", "rho0"])
def test_interrupt_leaves_the_best_so_far(name, k):
    """Ctrl-C after k masters raises a KeyboardInterrupt that carries the best design, certified like any other."""
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
    assert best.certify(problem) == pytest.approx(
        (best.cost, best.proved_bound.cost), rel=slip(problem.information(best.weights))
    )
    fine = relax(problem, criterion_of(name))
    assert best.proved_bound.cost <= fine.cost * (1 + GAP)
    assert fine.proved_bound.cost <= best.cost * (1 + GAP)


@pytest.mark.parametrize("calls", [1, 2])
def test_interrupt_within_a_solver(monkeypatch, calls):
    """Ctrl-C within the first master is a plain interrupt, without a design; within the second, one with a design."""
    solve, left = cp.Problem.solve, [calls]

    def stand_in(self, *args, **options):
        left[0] -= 1
        if not left[0]:
            raise KeyboardInterrupt
        return solve(self, *args, **options)

    monkeypatch.setattr(cp.Problem, "solve", stand_in)
    problem = Problem(off_centre(12, 2000))
    with pytest.raises(KeyboardInterrupt) as caught:
        relax(problem, criterion_of("A"), options=SolverOptions(batch=2))
    if calls == 1:
        assert not isinstance(caught.value, RelaxationInterrupted)
    else:
        assert caught.value.best.iterations == 1
        check(caught.value.best, problem, "A")


def weights_of(program):
    return next(v for v in program.variables() if v.ndim == 1 and v.is_nonneg())


def fail(program):
    raise cp.SolverError("numerical trouble")


def no_answer(program):
    weights_of(program).save_value(None)


def not_a_number(program):
    w = weights_of(program)
    w.save_value(np.full(w.shape, np.nan))


def nothing(program):
    w = weights_of(program)
    w.save_value(np.zeros(w.shape))


def equal_weights(program):
    w = weights_of(program)
    w.save_value(np.ones(w.shape))
    silence(program)


def silence(program):
    for constraint in program.constraints:
        for dual in constraint.dual_variables:
            dual.save_value(np.zeros(dual.shape))


def noise(program):
    rng, w = np.random.default_rng(0), weights_of(program)
    w.save_value(rng.normal(size=w.shape))
    for constraint in program.constraints:
        for dual in constraint.dual_variables:
            dual.save_value(rng.normal(size=dual.shape))


BREAKAGE = (fail, no_answer, not_a_number, nothing, silence, equal_weights, noise)


@pytest.mark.parametrize("breakage", BREAKAGE, ids=lambda f: f.__name__)
@every
def test_broken_first_solver(monkeypatch, name, breakage):
    """Whatever the first solver gives for an answer, the chain reaches the gap, and the result says who answered.

    Right weights without a multiplier (`silence`) prove themselves where the criterion is smooth.
    """
    problem = Problem(WELL["off-centre"])
    monkeypatch.setattr(cp.Problem, "solve", solve_then(breakage))
    r = relax(problem, criterion_of(name), options=SolverOptions(batch=10))
    check(r, problem, name)
    assert r.gap <= GAP
    assert r.cost == pytest.approx(solved(name, "off-centre").cost, rel=GAP)
    assert r.solver in CHAIN[1:] or breakage is silence


@pytest.mark.parametrize("n", [30, 300])
@pytest.mark.parametrize(
    "options",
    [{"max_iter": 3}, {"tol_gap_rel": 0.1, "tol_gap_abs": 0.1, "tol_feas": 0.1}],
    ids=["short", "loose"],
)
@every
def test_inaccurate_first_solver(monkeypatch, name, options, n):
    """A first solver that stops early is followed by the next one, whether or not all candidates are in the master."""
    problem = Problem(off_centre(13, n))
    monkeypatch.setitem(SOLVERS, "CLARABEL", options)
    r = relax(problem, criterion_of(name))
    check(r, problem, name)
    assert r.gap <= GAP


def no_solver(self, *args, solver=None, **options):
    raise cp.SolverError(f"{solver} is out of order")


@every
def test_no_solver_at_all(monkeypatch, name):
    """Without any cvxpy solver the polish answers for smooth criteria; others fail with the words of every solver."""
    problem = Problem(off_centre(13, 12))
    monkeypatch.setattr(cp.Problem, "solve", no_solver)
    if name in SMOOTH:
        r = relax(problem, criterion_of(name))
        check(r, problem, name)
        assert r.gap <= GAP
        assert r.solver == "SLSQP"
    else:
        with pytest.raises(
            RelaxationError,
            match=r"CLARABEL is out of order.*SCS is out of order.*SLSQP.*not smooth",
        ):
            relax(problem, criterion_of(name))


@pytest.mark.parametrize("case", ["blocks of two", "many rows", "cubic", "off-centre"])
@pytest.mark.parametrize("name", SMOOTH)
def test_polish_alone(name, case):
    """The polish alone, from equal weights, solves the smooth criteria to the gap, and the result names it."""
    problem = Problem(WELL[case][:: len(WELL[case]) // 12])
    r = relax(problem, criterion_of(name), options=SolverOptions(solvers=("SLSQP",)))
    check(r, problem, name)
    assert r.gap <= GAP
    assert r.solver == "SLSQP"
    assert r.cost == pytest.approx(relax(problem, criterion_of(name)).cost, rel=GAP)


@every
def test_rank_deficient_candidates(name):
    """Candidates that leave directions open are refused by the names of these."""
    x = np.linspace(-1, 1, 41)
    rows = np.column_stack([x, 2 * x, 0 * x, x**2])[:, None, :]
    with pytest.raises(RankDeficientError, match=r"no candidate excites c or a - 0\.5 b$"):
        relax(Problem(rows, parameters=("a", "b", "c", "d")), criterion_of(name))


class Formless(Criterion):
    """A cost and nothing that cvxpy knows."""

    name, title, formula, sense, degree = "formless", "Formless", "1/trace(M)", "min", 1.0

    def _cost(self, M, cov):
        return 1 / np.trace(M, axis1=-2, axis2=-1)

    def _gradient(self, M, cov):
        return -(self._cost(M, cov)[..., None, None] ** 2) * np.eye(M.shape[-1])


def test_criterion_without_convex_form():
    """A criterion that has no convex form is refused by its name; all built-in ones have one."""
    with pytest.raises(NotImplementedError, match="formless"):
        relax(Problem(cubic()), Formless())
    assert not issubclass(Formless, Relaxable)
    assert all(issubclass(criteria.get(name), Relaxable) for name in NAMES)


class ExpressionA(ConvexCriterion):
    """The trace of the covariance, known by its expression alone."""

    name, title, formula, sense, degree = "expression A", "A", "trace(cov)", "min", 1.0

    def expression(self, M, T=None):
        """Convex in M."""
        return cp.matrix_frac(np.eye(M.shape[0]) if T is None else T.T, M)


class ExpressionG(ConvexCriterion):
    """The largest variance, known by its expression alone."""

    name, title, formula, sense, degree, smooth = (
        "expression G",
        "G",
        "max diag(cov)",
        "min",
        1.0,
        False,
    )

    def expression(self, M, T=None):
        """Convex in M."""
        return cp.max(
            cp.hstack([cp.matrix_frac(t, M) for t in (np.eye(M.shape[0]) if T is None else T)])
        )


class ExpressionRho(ConvexCriterion):
    """The accuracy in the target, known by the expression of its square alone."""

    name, title, formula, sense, degree, expression_power = (
        "expression rho",
        "rho",
        "sqrt(trace)",
        "min",
        0.5,
        2.0,
    )

    def expression(self, M, T=None):
        """Convex in M."""
        return cp.matrix_frac((TARGET if T is None else TARGET @ T).T, M)


@pytest.mark.parametrize(
    "case", ["blocks of two", "many rows", "cubic", "off-centre", "all x 1e-9"]
)
@pytest.mark.parametrize(
    ("mine", "name"), [(ExpressionA, "A"), (ExpressionG, "G"), (ExpressionRho, "rho0")]
)
def test_criterion_known_by_its_expression(mine, name, case):
    """A criterion that gives a cvxpy expression and no more is relaxed to the gap: as good as the built-in one."""
    problem = Problem((WELL | BADLY)[case])
    r, native = relax(problem, mine(), options=SolverOptions(batch=10)), solved(name, case)
    rounding = slip(problem.information(r.weights))
    assert -rounding <= r.gap <= GAP
    assert r.certify(problem) == pytest.approx(
        (r.cost, r.proved_bound.cost), rel=1e-7
    )  # a solver's word, lowered by as much
    assert r.cost == pytest.approx(native.cost, rel=GAP)
    assert r.proved_bound.cost <= native.cost * (1 + rounding)


@pytest.mark.parametrize("mine", [ExpressionA, ExpressionG, ExpressionRho])
def test_progress_of_an_expression_is_kept(mine):
    """Best design and best proof may come from different masters: the result has both, no less than was told."""
    problem, gaps = Problem(blocks_of(12, 2000, 1)), []
    for rounds in (1, 2, 3, 4):
        r = relax(
            problem,
            mine(),
            options=SolverOptions(rounds=rounds, batch=2),
            progress=lambda iterations, gap: gaps.append(gap),
        )
        assert r.gap <= gaps[-1] + 1e-7  # a solver's word, lowered by as much


def test_family_from_earlier_multipliers():
    """O4 started from the multipliers of a like problem proves its bound anew, over the candidates that it has."""
    blocks = WELL["off-centre"]
    first = relax(Problem(blocks), criterion_of("O4"))
    more = Problem(np.concatenate([blocks, 1.5 * blocks[:3]]))
    again, cold = (
        relax(more, criterion_of("O4"), multipliers=first.multipliers),
        relax(more, criterion_of("O4")),
    )
    check(again, more, "O4")
    assert again.gap <= GAP
    assert again.cost == pytest.approx(cold.cost, rel=GAP)
    assert cold.cost < first.cost * (1 - 10 * GAP)
