"""Third parties' criteria that write nothing but a cvxpy expression.

Cost, gradient, polar and program follow from it, and obey the laws.
"""

import cvxpy as cp
import numpy as np
import pytest
from matrices import (
    EPS,
    candidates,
    make,
    optimum,
    orthogonal,
    positive,
    sensitivities,
    slip,
    solve,
    symmetric,
    units,
    with_spectrum,
)

from criteria import ConvexCriterion, Relaxable, create
from criteria.linalg.inverse import whitener

pytestmark = pytest.mark.slow

GAP = 1e-6  # that a relaxation stops at
SAFETY = 1e-7  # of a solver's word, by which polars are lowered


class ThirdParty(ConvexCriterion):
    """What is common to the criteria below."""

    title = "Third party's"
    formula = ""
    sense = "min"
    degree = 1.0


def selected(M, T):
    """The sum of the variances of the first two parameters."""
    rows = np.eye(M.shape[0]) if T is None else T
    return cp.matrix_frac(rows[:2].T, M)


def least_two(M, T):
    """The sum of the two least eigenvalues."""
    if T is not None:
        S = np.linalg.inv(T)
        M = S.T @ M @ S
    return cp.lambda_sum_smallest(0.5 * (M + M.T), 2)


class Subset(ThirdParty):
    """Sum of the variances of the first two parameters: smooth."""

    name = "subset"

    def expression(self, M, T=None):
        """As the law of `ConvexCriterion` asks."""
        return selected(M, T)


class SubsetRoot(ThirdParty):
    """Root of that sum, of which only the square is a convex expression."""

    name = "subset root"
    degree = 0.5
    expression_power = 2.0

    def expression(self, M, T=None):
        """As the law of `ConvexCriterion` asks."""
        return selected(M, T)


class LeastTwo(ThirdParty):
    """One over the sum of the two least eigenvalues: it has kinks."""

    name = "least two"
    smooth = False

    def expression(self, M, T=None):
        """As the law of `ConvexCriterion` asks."""
        return cp.inv_pos(least_two(M, T))


class LeastTwoSquare(ThirdParty):
    """The square of that, known by its root."""

    name = "least two square"
    smooth = False
    degree = 2.0
    expression_power = 0.5

    def expression(self, M, T=None):
        """As the law of `ConvexCriterion` asks."""
        return cp.inv_pos(least_two(M, T))


class WorstHalf(ThirdParty):
    """The larger of two sums of variances; it has kinks.

    One sum is that of the first two parameters, the other that of the rest.
    """

    name = "worst half"
    smooth = False

    def expression(self, M, T=None):
        """As the law of `ConvexCriterion` asks."""
        rows = np.eye(M.shape[0]) if T is None else T
        return cp.maximum(selected(M, T), cp.matrix_frac(rows[2:].T, M))


def definition(name, M):
    """The cost by numpy alone."""
    variances = np.diag(np.linalg.inv(M))
    eigenvalues = np.linalg.eigvalsh(M)
    return {
        "subset": variances[:2].sum(),
        "subset root": np.sqrt(variances[:2].sum()),
        "least two": 1 / eigenvalues[:2].sum(),
        "least two square": 1 / eigenvalues[:2].sum() ** 2,
        "worst half": max(variances[:2].sum(), variances[2:].sum()),
    }[name]


CLASSES = (Subset, SubsetRoot, LeastTwo, LeastTwoSquare, WorstHalf)
COPIED = ("A", "D", "G", "O1", "rho0")

third_parties = pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.name)
smooth_ones = pytest.mark.parametrize(
    "cls", [c for c in CLASSES if c.smooth], ids=lambda cls: cls.name
)
with_kinks = pytest.mark.parametrize(
    "cls", [c for c in CLASSES if not c.smooth], ids=lambda cls: cls.name
)
copies = pytest.mark.parametrize("name", COPIED)


def copy_of(c):
    """A third party's criterion with nothing of a built-in one but declarations and expression."""
    declared = {
        key: getattr(c, key) for key in ("degree", "smooth", "expression_power", "unit_free")
    }
    body = {
        "name": f"copy of {c.name}",
        "expression": lambda self, M, T=None: c.expression(M, T),
        **declared,
    }
    return type("Copy", (ThirdParty,), body)()


def apart(rng, p=4):
    """Information of condition 10, with simple eigenvalues, far from every kink."""
    while True:
        M = with_spectrum(rng, np.geomspace(1, 10, p))
        variances = np.diag(np.linalg.inv(M))
        if abs(1 - variances[:2].sum() / variances[2:].sum()) > 0.1:
            return M


@third_parties
def test_cost_is_read_off_the_expression(cls):
    """The cost is the root of the expression, one by one and in stacks of any shape."""
    rng = np.random.default_rng(0)
    c = cls()
    M = np.array([positive(rng, 4, 1e3) for _ in range(6)])
    expected = np.array([definition(cls.name, m) for m in M])
    np.testing.assert_allclose(c.cost(M), expected, rtol=slip(M))
    np.testing.assert_allclose(c.value(M.reshape(2, 3, 4, 4)), expected.reshape(2, 3), rtol=slip(M))
    np.testing.assert_allclose([c.cost(m) for m in M], expected, rtol=slip(M))
    assert np.shape(c.cost(M[0])) == ()
    assert c.cost(M[:0]).shape == (0,)
    assert c.gradient(M[:0]).shape == (0, 4, 4)


@third_parties
def test_gradient_is_read_off_the_expression(cls):
    """<G, H> is the directional derivative away from kinks, and G is symmetric.

    Fourth-order differences with h = 1e-3 err by about 1e-9 of the cost, as for built-in criteria.
    """
    rng = np.random.default_rng(1)
    c = cls()
    h = 1e-3
    for _ in range(10):
        M = apart(rng)
        H = symmetric(rng, 4) / 10
        f = c.cost(M + h * np.array([-2, -1, 1, 2])[:, None, None] * H)
        G = c.gradient(M)
        assert abs(np.sum(G * H) - (f @ [1, -8, 8, -1]) / (12 * h)) < 1e-6 * c.cost(M)
        np.testing.assert_array_equal(G, G.T)
        np.testing.assert_allclose(c.gradient(np.stack([M, 2 * M]))[0], G, rtol=1e-12)


@third_parties
def test_expression_is_convex_and_whitened(cls):
    """The expression is convex by cvxpy's rules, with and without T.

    T changes the parameters, not the value.
    """
    rng = np.random.default_rng(2)
    c = cls()
    X = cp.Variable((4, 4), symmetric=True)
    for _ in range(5):
        M = positive(rng, 4)
        T = orthogonal(rng, 4) * 10 ** rng.uniform(-1, 1, size=4)
        assert c.expression(X).is_convex()
        assert c.expression(X, T).is_convex()
        X.value = 0.5 * (T.T @ M @ T + (T.T @ M @ T).T)
        expected = definition(cls.name, M) ** cls.expression_power
        np.testing.assert_allclose(c.expression(X, T).value, expected, rtol=slip(M, X.value))


@third_parties
def test_homogeneity_as_declared(cls):
    """cost(c M) = c**-degree * cost(M), and <G, M> = -degree * cost, at kinks too."""
    rng = np.random.default_rng(3)
    c = cls()
    for M in [*(positive(rng, 4) for _ in range(5)), np.eye(4)]:
        for factor in (1e-8, 0.3, 1e8):
            np.testing.assert_allclose(
                c.cost(factor * M), factor**-c.degree * c.cost(M), rtol=slip(M)
            )
        assert np.sum(c.gradient(M) * M) == pytest.approx(-c.degree * c.cost(M), rel=slip(M))


@third_parties
def test_convexity_and_monotony_as_declared(cls):
    """cost(N) >= cost(M) + <G(M), N - M> for all pairs, and more information never costs more."""
    rng = np.random.default_rng(4)
    c = cls()
    samples = np.array(
        [*(positive(rng, 4, 1e3) for _ in range(8)), np.eye(4), np.diag([1.0, 1.0, 1.0, 9.0])]
    )
    costs = c.cost(samples)
    gradients = c.gradient(samples)
    for M, cost, G in zip(samples, costs, gradients, strict=True):
        terms = G * (samples - M)
        rounding = slip(samples) * (costs + cost + np.abs(terms).sum(axis=(1, 2)))
        assert (costs - cost - terms.sum(axis=(1, 2)) >= -rounding).all()
        B = rng.normal(size=(4, 2))
        assert c.cost(M + B @ B.T) <= cost * (1 + slip(M))


@third_parties
def test_singular_and_missing_information(cls):
    """Singular M costs infinity and NaN costs NaN, and neither reaches the expression."""
    c = cls()
    M = np.stack([np.eye(4), np.diag([1.0, 1.0, 1.0, 0.0]), np.full((4, 4), np.nan)])
    np.testing.assert_array_equal(c.cost(M)[1:], [np.inf, np.nan])
    assert np.isfinite(c.gradient(M)).all(axis=(1, 2)).tolist() == [True, False, False]


@copies
def test_a_copy_by_expression_equals_the_original(name):
    """Cost and gradient read off a built-in criterion's expression equal its closed forms."""
    for p in (1, 2, 4):
        rng = np.random.default_rng(p)
        c = make(name, p)
        M = np.stack([positive(rng, p, 1e3) for _ in range(4)])
        np.testing.assert_allclose(copy_of(c).cost(M), c.cost(M), rtol=slip(M))
        G = c.gradient(M)
        accuracy = slip(M) * np.abs(G).max(axis=(1, 2), keepdims=True)
        assert (np.abs(copy_of(c).gradient(M) - G) <= accuracy).all()


@copies
def test_polar_of_a_copy_is_that_of_the_original(name):
    """At minus a gradient the polar read off the expression is the closed one.

    They agree up to a solver's tolerance.
    """
    for p in (2, 4):
        rng = np.random.default_rng(p)
        c = make(name, p)
        for _ in range(3):
            M = positive(rng, p)
            Z = -c.gradient(M)
            polar = copy_of(c).polar(-copy_of(c).gradient(M), M)
            assert -slip(M, M @ M) <= 1 - polar / c.polar(Z, M) <= 2 * SAFETY * c.degree


@third_parties
def test_polar_is_tight_at_minus_a_gradient(cls):
    """With Z minus a gradient, M is the best of all X with <Z, X> <= <Z, M>.

    At kinks this holds up to a solver's tolerance.
    """
    rng = np.random.default_rng(5)
    c = cls()
    for _ in range(5):
        M = apart(rng)
        Z = -c.gradient(M)
        lower_bound = c.lower_bound(Z[None], np.array([np.sum(Z * M)]), M)
        lowered = 0.0 if cls.smooth else 2 * SAFETY / cls.expression_power
        assert -slip(M, M @ M) <= 1 - lower_bound / c.cost(M) <= lowered + slip(M, M @ M)


@third_parties
def test_polar_is_below_every_matrix(cls):
    """No X with <Z, X> = 1 costs less than the polar, for any Z and wherever it is taken."""
    rng = np.random.default_rng(6)
    c = cls()
    X = np.array([positive(rng, 4, 1e3) for _ in range(150)])
    costs = np.array([definition(cls.name, x) for x in X])
    for _ in range(4):
        M = positive(rng, 4)
        B = rng.normal(size=(4, 3))
        for Z in (positive(rng, 4, 1e2), B @ B.T, -c.gradient(M)):
            polar = c.polar(Z, M)
            best = (costs * np.einsum("ij,nij->n", Z, X) ** c.degree).min()
            here = definition(cls.name, M) * np.sum(Z * M) ** c.degree
            assert 0 <= polar <= min(best, here) * (1 + slip(M, M @ M))


def test_polar_of_the_two_least_eigenvalues_in_closed_form():
    """The polar is ``min(trace(Z)/2, trace(Z) - lambda_max(Z))``, by cvxpy too, for any Z.

    In the eigenvectors of Z the problem is linear: X is a multiple of the identity, or leaves Z's
    first direction.
    """
    rng = np.random.default_rng(7)
    c = LeastTwo()
    for decades in (0.0, 0.3, 0.6, 1.0, 1.5):
        for _ in range(3):
            z = 10 ** rng.uniform(-decades, decades, size=4)
            expected = min(z.sum() / 2, z.sum() - z.max())
            polar = c.polar(with_spectrum(rng, z), positive(rng, 4))
            assert 0 <= 1 - polar / expected <= 2 * SAFETY


@pytest.mark.parametrize("factor", [1e-6, 0.5, 3.0, 1e6])
@third_parties
def test_polar_is_homogeneous(cls, factor):
    """polar(c Z) = c**degree * polar(Z), to a solver's tolerance.

    So a multiplier proves the same whatever its length is.
    """
    rng = np.random.default_rng(8)
    c = cls()
    M = apart(rng)
    Z = -c.gradient(M)
    expected = factor**c.degree * c.polar(Z, M)
    assert expected > 0
    assert c.polar(factor * Z, M) == pytest.approx(expected, rel=2 * SAFETY)


@pytest.mark.parametrize("condition", [1e1, 1e3, 1e6])
@third_parties
def test_bound_survives_that_its_design_is_computed_anew(cls, condition):
    """A multiplier's bound is within the gap for the same design summed up in another order.

    A certificate is recomputed from the weights, which do not give the last bits of M.
    """
    rng = np.random.default_rng(9)
    c = cls()
    M = with_spectrum(rng, np.geomspace(1 / condition, 1, 4))
    again = np.tensordot(rng.dirichlet(np.ones(7)), np.repeat(M[None], 7, axis=0), axes=1)
    assert np.abs(again - M).max() <= 8 * EPS
    Z = -c.gradient(M)
    lower_bound = c.lower_bound(Z[None], np.array([np.sum(Z * again)]), again)
    assert -slip(M) <= 1 - lower_bound / c.cost(M) <= GAP


@pytest.mark.parametrize("seed", range(3))
@third_parties
def test_a_program_over_candidates_is_solved_and_proved(cls, seed):
    """Over candidates the optimum is a design, and a multiplier proves its cost to 1e-6.

    No design costs less. The multiplier is the solver's or, for a smooth criterion, minus the
    gradient at the optimum if that is better.
    """
    rng = np.random.default_rng(seed)
    c = cls()
    blocks = candidates(rng, 12, 4)
    mean = blocks.mean(axis=0)
    value, weights, _ = solve(c, blocks, mean, whitener(mean))
    M, Z = optimum(c, blocks)
    np.testing.assert_allclose(np.tensordot(weights, blocks, axes=1), M, rtol=0, atol=slip(M))
    assert value == pytest.approx((c.cost(M) / c.cost(mean)) ** c.expression_power, rel=GAP)
    Z = np.stack([Z, -c.gradient(M)] if cls.smooth else [Z])
    lower_bound = c.lower_bound(Z, sensitivities(Z, blocks), M)
    assert -slip(M) <= 1 - lower_bound / c.cost(M) <= GAP
    others = np.tensordot(rng.dirichlet(np.full(12, 0.3), size=200), blocks, axes=1)
    least = min(definition(cls.name, X) for X in (*others, *(0.99 * M + 0.01 * others)))
    assert lower_bound <= least * (1 + slip(M))
    assert c.cost(M) <= least * (1 + GAP)


@smooth_ones
def test_badly_scaled_parameters(cls):
    """With units from 1e-7 to 1e4 cost and bound keep their ratio.

    The cost sees only the first two parameters, whose units are alike, so that this unit is a
    common factor of the costs.
    """
    rng = np.random.default_rng(10)
    c = cls()
    for _ in range(5):
        M = positive(rng, 4)
        t = units(rng, 4)
        t[1] = t[0]
        scaled = np.outer(t, t) * M
        assert c.cost(scaled) == pytest.approx(c.cost(M) * t[0] ** (-2 * c.degree), rel=slip(M))
        Z = -c.gradient(scaled)
        lower_bound = c.lower_bound(Z[None], np.array([np.sum(Z * scaled)]), scaled)
        assert -slip(M, M @ M) <= 1 - lower_bound / c.cost(scaled) <= GAP


@with_kinks
def test_badly_scaled_parameters_of_criteria_with_kinks(cls):
    """With units from 1e-7 to 1e4 the bound of minus a gradient never exceeds the cost."""
    rng = np.random.default_rng(11)
    c = cls()
    for _ in range(5):
        M = apart(rng)
        t = units(rng, 4)
        scaled = np.outer(t, t) * M
        cost = definition(cls.name, scaled)
        assert c.cost(scaled) == pytest.approx(cost, rel=1e-9)
        Z = -c.gradient(scaled)
        assert (
            0
            <= c.lower_bound(Z[None], np.array([np.sum(Z * scaled)]), scaled)
            <= cost * (1 + slip(M, M @ M))
        )


@third_parties
def test_an_expression_is_a_convex_form(cls):
    """A criterion with an expression can be relaxed, and describes itself like any other."""
    assert issubclass(cls, Relaxable)
    assert cls.describe()["name"] == cls.name
    assert isinstance(create("D"), Relaxable)
