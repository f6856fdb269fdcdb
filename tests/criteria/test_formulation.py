"""The convex programs model the costs, whatever whitens them and in whatever units.

The solver is asked for a relative accuracy of 1e-9 at matrices of condition up to 1e2, whence 1e-6,
which is also the gap at which a relaxation stops.
"""

import cvxpy as cp
import numpy as np
import pytest
from matrices import (
    SOLVER,
    balance,
    candidates,
    make,
    optimum,
    orthogonal,
    positive,
    sensitivities,
    solve,
    symmetric,
    units,
    with_spectrum,
)
from scipy.optimize import minimize_scalar

import criteria
from criteria import ConvexCriterion, Criterion, Relaxable
from criteria.linalg.inverse import whitener
from criteria.spectral_balance import SpectralBalance

pytestmark = pytest.mark.slow

ACCURACY = 1e-6
BUILTINS = ("A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0", "rho_max")
PROGRAMS = (*(name for name in BUILTINS if name != "O4"), "balance", "E by balance")

programs = pytest.mark.parametrize("name", PROGRAMS)
sizes = pytest.mark.parametrize("p", [1, 2, 3, 6])


def choose(name, N):
    """A criterion that has a program; members of O4's family are set by the design N."""
    return {"balance": lambda: balance(N), "E by balance": lambda: SpectralBalance(0.0, 1.0)}.get(
        name, lambda: make(name, len(N))
    )()


@pytest.mark.parametrize("scaled", [False, True], ids=["well-scaled", "badly-scaled"])
@sizes
@programs
def test_optimum_over_one_candidate_is_its_cost(name, p, scaled):
    """With one candidate the optimum is a power of its cost, in units of another design's.

    T is any whitener of that design, a rotated triangle; badly scaled parameters have units from
    1e-7 to 1e4.
    """
    rng = np.random.default_rng(p)
    t = units(rng, p) if scaled else np.ones(p)
    M = np.outer(t, t) * positive(rng, p)
    N = np.outer(t, t) * positive(rng, p)
    c = choose(name, N).in_units(np.diag(t))
    value, weights, _ = solve(c, M[None], N, whitener(N) @ orthogonal(rng, p))
    assert value == pytest.approx((c.cost(M) / c.cost(N)) ** c.expression_power, rel=ACCURACY)
    assert weights.tolist() == [1.0]


@programs
def test_optimum_over_two_candidates_is_the_least_cost_between_them(name):
    """Over two candidates the optimum is the least cost on the segment between them.

    Every cost here has a single valley on a segment. The search is quadratic in its tolerance of
    1e-8.
    """
    for seed in range(4):
        rng = np.random.default_rng(seed)
        blocks = np.stack([positive(rng, 3, 1e2), positive(rng, 3, 1e2)])
        N = positive(rng, 3)
        c = choose(name, N)
        found = minimize_scalar(
            lambda x, c=c, blocks=blocks: c.cost((1 - x) * blocks[0] + x * blocks[1]),
            bounds=(0, 1),
            method="bounded",
            options={"xatol": 1e-8},
        )
        best = min(found.fun, *c.cost(blocks))
        value, weights, _ = solve(c, blocks, N, whitener(N))
        assert value == pytest.approx((best / c.cost(N)) ** c.expression_power, rel=ACCURACY)
        assert c.cost(np.tensordot(weights, blocks, axes=1)) == pytest.approx(best, rel=ACCURACY)


@programs
def test_optimum_does_not_depend_on_what_whitens(name):
    """The same candidates give the same optimal cost, whichever design T and unit come from."""
    rng = np.random.default_rng(0)
    blocks = candidates(rng, 8, 4)
    c = choose(name, blocks.mean(axis=0))
    costs = []
    for N in np.tensordot(rng.dirichlet(np.ones(8), size=4), blocks, axes=1):
        value, _, _ = solve(c, blocks, N, whitener(N))
        costs.append(value ** (1 / c.expression_power) * c.cost(N))
    np.testing.assert_allclose(costs, costs[0], rtol=ACCURACY)


@sizes
@programs
def test_programs_are_convex_by_the_rules(name, p):
    """Every program is convex by cvxpy's own rules, so that no solver is handed another problem."""
    rng = np.random.default_rng(p)
    N = positive(rng, p)
    w = cp.Variable(3, nonneg=True)
    M = cp.Variable((p, p), symmetric=True)
    objective, constraints = choose(name, N).formulation(M, cp.sum(w), whitener(N), 2.0)
    assert objective.is_convex()
    assert all(constraint.is_dcp() for constraint in constraints)
    assert cp.Problem(cp.Minimize(objective), constraints).is_dcp()


def has_expression(name):
    """Whether a criterion gives an expression; a power gives the one of its base."""
    c = make(name, 2)
    if not isinstance(c, ConvexCriterion):
        return False
    try:
        c.expression(cp.Variable((2, 2), PSD=True))
    except NotImplementedError:
        return False
    return True


def test_which_convex_form_each_criterion_has():
    """All can be relaxed: five by an expression, five by their own program, O4 by a family."""
    assert all(issubclass(criteria.get(name), Relaxable) for name in BUILTINS)
    expressed = {name for name in BUILTINS if has_expression(name)}
    families = {name for name in BUILTINS if criteria.get(name).most_subproblems > 1}
    assert expressed == {"A", "D", "G", "O1", "rho0"}
    assert families == {"O4"}


def test_those_that_have_a_program_solve_themselves():
    """Any criterion but O4 is its own subproblem, whatever was proved before."""
    M = np.diag([1.0, 2.0])
    for name in BUILTINS:
        c = make(name, 2)
        assert (c.subproblem(M[None], np.ones(1), M) is c) == (name != "O4")


@pytest.mark.parametrize(("name", "named"), [("E", "E"), ("O3", "E"), ("O5", "O5")])
def test_a_missing_expression_is_refused(name, named):
    """A criterion without an expression says so by name, a power by the name of its base."""
    with pytest.raises(NotImplementedError, match=f"criterion {named} has no convex expression"):
        make(name, 2).expression(cp.Constant(np.eye(2)))


@pytest.mark.parametrize("name", ["O2", "O4"])
def test_criteria_that_are_not_convex_have_no_expression(name):
    """The interface of a criterion that is not convex offers no expression at all."""
    assert not hasattr(make(name, 2), "expression")


def test_a_family_has_no_program_of_its_own():
    """O4's formulation is rejected by name; the members of its family have one."""
    w = cp.Variable(3, nonneg=True)
    M = cp.Variable((2, 2), symmetric=True)
    with pytest.raises(NotImplementedError, match="criterion O4 has no program"):
        make("O4", 2).formulation(M, cp.sum(w), np.eye(2), 1.0)


class Bare(Criterion):
    """A criterion with cost and gradient only."""

    name = "bare"
    title = "Bare"
    formula = "1/trace(M)"
    sense = "min"
    degree = 1.0

    def _cost(self, M, cov):
        return 1 / np.trace(M, axis1=-2, axis2=-1)

    def _gradient(self, M, cov):
        return -(self._cost(M, cov)[..., None, None] ** 2) * np.eye(M.shape[-1])


class Incomplete(ConvexCriterion):
    """A criterion with neither expression nor anything else."""

    name = "incomplete"
    title = "Incomplete"
    formula = ""
    sense = "min"
    degree = 1.0


def test_a_criterion_without_convex_form():
    """Cost and gradient alone cannot be relaxed, and a convex criterion without them says so."""
    assert not isinstance(Bare(), Relaxable)
    M = cp.Variable((2, 2), symmetric=True)
    with pytest.raises(NotImplementedError, match="criterion incomplete has no convex expression"):
        Incomplete().formulation(M, cp.Variable(), np.eye(2), 1.0)
    with pytest.raises(NotImplementedError, match="criterion incomplete has no convex expression"):
        Incomplete().cost(np.eye(2))


@sizes
def test_the_family_of_the_noise_amplification_index(p):
    """A member costs ``a kappa + b s``, which is at least ``2 sqrt(a b)`` times O4.

    It is just that at the design that sets the member. This is the inequality of the means, with
    ``O4^2 = kappa s``.
    """
    rng = np.random.default_rng(p)
    o4 = make("O4", p)
    none = np.empty((0, p, p)), np.empty(0)
    for _ in range(20):
        M = positive(rng, p, 1e3)
        N = positive(rng, p, 1e3)
        member = o4.subproblem(*none, N)
        low, high = np.linalg.eigvalsh(M)[[0, -1]]
        assert member.cost(M) == pytest.approx(member.a * high / low + member.b / low, rel=1e-10)
        mean = 2 * np.sqrt(member.a * member.b)
        assert member.cost(M) >= mean * o4.cost(M) * (1 - 1e-10)
        assert member.cost(N) == pytest.approx(mean * o4.cost(N), rel=1e-10)


def test_members_of_the_family_are_quasiconvex():
    """No design between two others costs more than both, though it may cost more than the chord."""
    rng = np.random.default_rng(0)
    t = np.linspace(0, 1, 21)[:, None, None]
    above = False
    for _ in range(60):
        M = positive(rng, 3, 1e3)
        N = positive(rng, 3, 1e3)
        c = balance(positive(rng, 3), rng.uniform())
        costs = c.cost((1 - t) * M + t * N)
        ends = c.cost(np.stack([M, N]))
        assert (costs <= ends.max() * (1 + 1e-10)).all()
        above |= bool((costs > ((1 - t) * ends[0] + t * ends[1])[:, 0, 0] * (1 + 1e-3)).any())
    assert above


@sizes
def test_gradient_of_a_member(p):
    """<G, H> is the directional derivative of a member's cost, away from multiple eigenvalues."""
    rng = np.random.default_rng(p)
    h = 1e-3
    for _ in range(5):
        M = with_spectrum(rng, np.geomspace(1, 10, p))
        c = balance(positive(rng, p), rng.uniform())
        H = symmetric(rng, p) / 10
        f = c.cost(M + h * np.array([-2, -1, 1, 2])[:, None, None] * H)
        numeric = (f @ [1, -8, 8, -1]) / (12 * h)
        assert abs(np.sum(c.gradient(M) * H) - numeric) < 1e-6 * c.cost(M)


def test_monotone_member_is_declared_so():
    """Only the member without condition number is monotone, and it is E-optimality."""
    M = positive(np.random.default_rng(0), 3)
    assert SpectralBalance(0.0, 2.0).monotone
    assert not SpectralBalance(0.1, 2.0).monotone
    assert SpectralBalance(0.0, 2.0).cost(M) == pytest.approx(2 * make("E", 3).cost(M), rel=1e-14)


@pytest.mark.parametrize("seed", range(3))
def test_the_family_closes_the_gap_of_the_noise_amplification_index(seed):
    """Member after member, the bound rises to the least cost found, and never above it."""
    rng = np.random.default_rng(seed)
    c = make("O4", 3)
    blocks = candidates(rng, 12, 3)
    M = blocks.mean(axis=0)
    best = np.inf
    bounds = [0.0]
    Z = np.empty((0, 3, 3))
    t = np.empty(0)
    for _ in range(30):
        member = c.subproblem(Z, t, M)
        N, multiplier = optimum(member, blocks)
        Z = np.concatenate([Z, multiplier[None]])
        t = np.append(t, sensitivities(multiplier[None], blocks))
        if c.cost(N) < best:
            M = N
            best = float(c.cost(N))
        bounds.append(c.lower_bound(Z, t, M))
        if bounds[-1] >= (1 - ACCURACY) * best:
            break
    assert 0 <= 1 - bounds[-1] / best <= ACCURACY
    assert (np.diff(bounds) >= -SOLVER * best).all()
    weights = rng.dirichlet(np.full(12, 0.1), size=2000)
    assert c.cost(np.tensordot(weights, blocks, axes=1)).min() >= bounds[-1]
