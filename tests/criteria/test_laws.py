"""The laws of `criteria.Criterion`, checked for every registered criterion.

Tolerances are derived, not tuned: a cost comes from an inverse, whose relative error is bounded by
a modest multiple of p * eps * cond(M); `slip` is that bound.
"""

import cvxpy as cp
import numpy as np
import pytest
from matrices import EPS, Array, make, orthogonal, positive, slip, slips, symmetric, with_spectrum

import criteria

NAMES = criteria.available()
SIZES = (1, 2, 3, 6, 9)

every = pytest.mark.parametrize("name", NAMES)
sizes = pytest.mark.parametrize("p", SIZES)
convex_ones = pytest.mark.parametrize("name", [n for n in NAMES if criteria.get(n).convex])
other_than_convex = pytest.mark.parametrize(
    "name", [n for n in NAMES if not criteria.get(n).convex]
)
monotone_ones = pytest.mark.parametrize("name", [n for n in NAMES if criteria.get(n).monotone])
other_than_monotone = pytest.mark.parametrize(
    "name", [n for n in NAMES if not criteria.get(n).monotone]
)
expressed_ones = pytest.mark.parametrize("name", ["A", "D", "G", "O1", "rho0"])
unit_free_ones = pytest.mark.parametrize("name", [n for n in NAMES if criteria.get(n).unit_free])
unit_bound_ones = pytest.mark.parametrize(
    "name", [n for n in NAMES if not criteria.get(n).unit_free]
)


def gap(ordered: Array) -> float:
    return 1.0 if len(ordered) < 2 else float(1 - ordered[-2] / ordered[-1])


def generic(rng: np.random.Generator, p: int, decades: float) -> Array:
    """A well conditioned matrix in units of 10**uniform(-decades, decades), far from every kink."""
    while True:
        T = 10 ** rng.uniform(-decades, decades, size=p)
        M = with_spectrum(rng, np.geomspace(1, 10, p)) * np.outer(T, T)
        cov = np.linalg.inv(M)
        spectra = (np.linalg.eigvalsh(M), np.linalg.eigvalsh(cov), np.sort(np.diag(cov)))
        if min(map(gap, spectra)) > 0.1:
            return M


def adversarial(rng: np.random.Generator, p: int) -> list[Array]:
    """Matrices that are hard on convexity: multiple eigenvalues, condition up to 1e12."""
    low = np.ones(p)
    high = np.ones(p)
    low[: (p + 1) // 2] = 0.1
    high[: p // 2] = 10.0
    Q = orthogonal(rng, p)
    ladder = np.geomspace(1e-12, 1, p) if p > 1 else np.array([1e-12])
    return [
        np.eye(p),
        1e-6 * np.eye(p),
        np.diag(low),
        with_spectrum(rng, low),
        with_spectrum(rng, high),
        (Q * low) @ Q.T,
        (Q * low[::-1]) @ Q.T,
        np.diag(ladder),
        np.diag(ladder[::-1]),
        with_spectrum(rng, ladder),
        with_spectrum(rng, np.where(np.arange(p) == 0, 1e-12, 1.0)),
        with_spectrum(rng, np.where(np.arange(p) == 0, 1.0, 1e-12)),
        generic(rng, p, 0.0),
        generic(rng, p, 2.0),
        positive(rng, p, 1e4),
    ]


@pytest.mark.parametrize("decades", [0.0, 2.0], ids=["well-scaled", "badly-scaled"])
@sizes
@every
def test_gradient_matches_finite_differences(name, p, decades):
    """Where no eigenvalue is multiple, <G, H> is the directional derivative, in any units.

    The direction is scaled as M is: fourth-order differences with h = 1e-3 err by about 1e-9 of the
    cost.
    """
    rng = np.random.default_rng(1)
    c = make(name, p)
    h = 1e-3
    for _ in range(5):
        M = generic(rng, p, decades)
        d = np.sqrt(np.diag(M))
        H = symmetric(rng, p) * np.outer(d, d) / 10
        f = c.cost(M + h * np.array([-2, -1, 1, 2])[:, None, None] * H)
        numeric = (f @ [1, -8, 8, -1]) / (12 * h)
        assert abs(np.sum(c.gradient(M) * H) - numeric) < 1e-6 * c.cost(M)


@sizes
@every
def test_gradient_is_symmetric_and_finite_even_at_kinks(name, p):
    """At multiple eigenvalues and at condition 1e12 the gradient is finite and symmetric."""
    for M in adversarial(np.random.default_rng(2), p):
        G = make(name, p).gradient(M)
        assert G.shape == (p, p)
        assert np.isfinite(G).all()
        np.testing.assert_array_equal(G, G.T)


@pytest.mark.parametrize("decades", [0.0, 2.0], ids=["well-scaled", "badly-scaled"])
@sizes
@every
def test_euler_identity_of_the_gradient(name, p, decades):
    """Homogeneity fixes the gradient in the direction of M itself: <G, M> = -degree * cost.

    An eigenvector is known to p * eps absolutely, which M amplifies by its spread of units, here up
    to 1e4.
    """
    rng = np.random.default_rng(3)
    c = make(name, p)
    for M in [generic(rng, p, decades) for _ in range(5)] + [np.eye(p), 7.0 * np.eye(p)]:
        assert abs(np.sum(c.gradient(M) * M) + c.degree * c.cost(M)) < 1e-8 * c.cost(M)


@sizes
@every
def test_cost_is_homogeneous_with_its_declared_degree(name, p):
    """cost(c M) = c**-degree * cost(M) over sixteen decades of c."""
    rng = np.random.default_rng(4)
    for M in adversarial(rng, p):
        for factor in (1e-8, 0.3, 1e8):
            c = make(name, p)
            np.testing.assert_allclose(
                c.cost(factor * M), factor**-c.degree * c.cost(M), rtol=slip(M)
            )


@sizes
@convex_ones
def test_convex_along_segments(name, p):
    """No point between two of the adversarial matrices costs more than the chord."""
    c = make(name, p)
    samples = np.array(adversarial(np.random.default_rng(5), p))
    first, second = np.tril_indices(len(samples), -1)
    t = np.array([0.1, 0.5, 0.9])[:, None]
    weight = t[..., None, None]
    costs = c.cost(samples)
    between = (1 - weight) * samples[first] + weight * samples[second]
    chord = (1 - t) * costs[first] + t * costs[second]
    ends = np.maximum(slips(samples)[first], slips(samples)[second])
    rounding = np.maximum(ends, slips(between).max(axis=0))
    assert (c.cost(between) <= chord * (1 + rounding)).all()


@sizes
@convex_ones
def test_subgradient_inequality(name, p):
    """cost(M2) >= cost(M1) + <G(M1), M2 - M1> for all pairs, at kinks M1 too."""
    c = make(name, p)
    samples = np.array(adversarial(np.random.default_rng(6), p))
    costs = c.cost(samples)
    accuracies = slips(samples)
    for M, G, cost, accuracy in zip(samples, c.gradient(samples), costs, accuracies, strict=True):
        terms = G * (samples - M)
        size = np.abs(terms).sum(axis=(1, 2))
        rounding = accuracy * (cost + size) + accuracies * costs
        assert (costs - cost - terms.sum(axis=(1, 2)) >= -rounding).all()


@other_than_convex
def test_declared_non_convexity_is_true(name):
    """A criterion that is declared not convex has a chord that lies below its midpoint."""
    M1 = np.eye(2)
    M2 = np.diag([100.0, 1.0])
    c = make(name, 2)
    assert c.cost((M1 + M2) / 2) > 1.1 * (c.cost(M1) + c.cost(M2)) / 2


@sizes
@monotone_ones
def test_more_information_never_costs(name, p):
    """Where monotone is declared, adding any positive semidefinite matrix does not raise the cost.

    The addition is up to 1000 times M, but leaves M's least eigenvalue representable in the sum.
    """
    rng = np.random.default_rng(7)
    c = make(name, p)
    for M in adversarial(rng, p):
        for rank in range(1, p + 1):
            most = max(1.0, min(1e3, 1e12 / np.linalg.cond(M)))
            B = rng.normal(size=(p, rank))
            size = np.linalg.norm(M, 2) * 10 ** rng.uniform(-3, np.log10(most))
            more = M + B @ B.T / np.linalg.norm(B @ B.T, 2) * size
            assert c.cost(more) <= c.cost(M) * (1 + slip(M, more))


@other_than_monotone
def test_declared_non_monotonicity_is_true(name):
    """Where declared, information in the strongest direction does raise the cost."""
    c = make(name, 3)
    assert c.cost(np.diag([100.0, 1.0, 1.0])) > 1.1 * c.cost(np.eye(3))


def singular_ones(p: int) -> dict[str, Array]:
    rng = np.random.default_rng(8)
    B = rng.normal(size=(p, p - 1))
    hole = np.eye(p)
    hole[0, 0] = 0.0
    return {
        "zero": np.zeros((p, p)),
        "low rank": B @ B.T,
        "zero row": hole,
        "ones": np.ones((p, p)),
    }


@pytest.mark.parametrize("p", [2, 3, 6])
@every
def test_singular_information_costs_infinity(name, p):
    """Singular M costs inf, and its value is 0 or inf by sense, without warning or error.

    That holds alone and in a batch.
    """
    c = make(name, p)
    rng = np.random.default_rng(9)
    worst = np.inf if c.sense == "min" else 0.0
    for M in singular_ones(p).values():
        assert c.cost(M) == np.inf
        assert c.value(M) == worst
        assert np.isnan(c.gradient(M)).all()
    good = positive(rng, p)
    mixed = np.stack([good, *singular_ones(p).values(), good])
    assert np.isinf(c.cost(mixed)).tolist() == [False, *[True] * 4, False]
    np.testing.assert_allclose(c.cost(mixed)[[0, -1]], c.cost(good), rtol=1e-12)
    assert (c.value(mixed)[1:-1] == worst).all()
    np.testing.assert_allclose(c.gradient(mixed)[-1], c.gradient(good), rtol=1e-10, atol=1e-12)


@every
def test_nan_information_costs_nan(name):
    """A NaN in M makes cost, value and gradient NaN, and leaves its neighbours unharmed."""
    c = make(name, 3)
    M = np.stack([np.eye(3), np.eye(3), np.eye(3)])
    M[1, 0, 2] = M[1, 2, 0] = np.nan
    assert np.isnan(c.cost(M)).tolist() == [False, True, False]
    assert np.isnan(c.value(M)).tolist() == [False, True, False]
    assert np.isnan(c.gradient(M)).all(axis=(1, 2)).tolist() == [False, True, False]
    assert np.isnan(c.cost(M[1]))


@pytest.mark.parametrize("p", [2, 3, 6])
@every
def test_order_of_the_parameters_is_irrelevant(name, p):
    """A permutation of the parameters, of the target's columns too, changes nothing."""
    rng = np.random.default_rng(10)
    target = np.random.default_rng(11).normal(size=(3, p))
    for M in adversarial(rng, p):
        order = rng.permutation(p)
        before = criteria.create(name, target=target).cost(M)
        after = criteria.create(name, target=target[:, order]).cost(M[np.ix_(order, order)])
        np.testing.assert_allclose(after, before, rtol=slip(M))


def ratios(name: str, p: int, seed: int) -> tuple[float, float]:
    """Ratio of the costs of two designs, as given and in other units k = T k' over 12 decades."""
    rng = np.random.default_rng(seed)
    M = positive(rng, p)
    best = positive(rng, p)
    t = 10 ** rng.uniform(-6, 6, size=p)
    c = make(name, p)
    rescaled = c.in_units(np.diag(t))
    TT = np.outer(t, t)
    return float(c.efficiency(M, best)), float(rescaled.efficiency(TT * M, TT * best))


@sizes
@unit_free_ones
def test_unit_free_ones_rank_alike_in_any_units(name, p):
    """Where declared, rescaling parameters by 10**uniform(-6, 6) keeps the ratio of two designs.

    The matrices are well conditioned but for their units (condition below 10).
    """
    for seed in range(10):
        before, after = ratios(name, p, seed)
        assert abs(after / before - 1) < 2 * 64 * p * EPS * 10


@unit_bound_ones
def test_the_others_do_depend_on_units(name):
    """Where not declared unit-free, rescaling changes the ratio of two designs."""
    changes = [
        abs(after / before - 1) for before, after in (ratios(name, 3, seed) for seed in range(10))
    ]
    assert max(changes) > 0.01


@pytest.mark.parametrize("batch", [(), (1,), (4,), (2, 3), (0,)])
@every
def test_batch_equals_loop(name, batch):
    """A stack of matrices gives what its members give one by one, in the shape of the stack."""
    rng = np.random.default_rng(12)
    c = make(name, 4)
    p = 4
    M = np.array([generic(rng, p, 1.0) for _ in range(int(np.prod(batch)))]).reshape(*batch, p, p)
    cost = c.cost(M)
    value = c.value(M)
    G = c.gradient(M)
    assert np.shape(cost) == np.shape(value) == batch
    assert G.shape == (*batch, p, p)
    for i in np.ndindex(*batch):
        np.testing.assert_allclose(cost[i], c.cost(M[i]), rtol=1e-12)
        np.testing.assert_allclose(value[i], c.value(M[i]), rtol=1e-12)
        np.testing.assert_allclose(
            G[i], c.gradient(M[i]), rtol=1e-9, atol=1e-12 * np.abs(G[i]).max()
        )


@sizes
@every
def test_value_cost_and_sense_agree(name, p):
    """The cost is the value or its reciprocal, by sense; efficiency is a ratio of costs."""
    rng = np.random.default_rng(13)
    c = make(name, p)
    M = np.stack([positive(rng, p) for _ in range(4)])
    assert c.sense in ("min", "max")
    np.testing.assert_allclose(
        c.value(M), c.cost(M) if c.sense == "min" else 1 / c.cost(M), rtol=1e-15
    )
    assert (c.cost(M) > 0).all()
    np.testing.assert_allclose(c.efficiency(M, M), 1.0, rtol=1e-15)
    np.testing.assert_allclose(c.efficiency(M, 2 * M), 2**-c.degree, rtol=1e-12)


@sizes
@every
def test_cost_where_the_inverse_is_at_hand(name, p):
    """Given M with its inverse, the cost is the one found without, to the error of the inverse."""
    rng = np.random.default_rng(15)
    c = make(name, p)
    M = np.array([positive(rng, p, 1e3) for _ in range(4)])
    cov = np.linalg.inv(M)
    np.testing.assert_allclose(c.cost_of_regular(M, cov), c.cost(M), rtol=slip(M))
    np.testing.assert_allclose(c.cost_of_regular(M[1], cov[1]), c.cost(M[1]), rtol=slip(M))


@sizes
@every
def test_cost_and_gradient_at_once(name, p):
    """Together they are what they are one by one, to the last bit, singular members included."""
    rng = np.random.default_rng(16)
    c = make(name, p)
    M = np.array([positive(rng, p, 1e3), np.zeros((p, p)), positive(rng, p)])
    cost, G = c.cost_and_gradient(M)
    np.testing.assert_array_equal(cost, c.cost(M))
    np.testing.assert_array_equal(G, c.gradient(M))


@sizes
@expressed_ones
def test_expression_is_the_cost(name, p):
    """A cvxpy expression is convex and has the value cost**expression_power."""
    rng = np.random.default_rng(14)
    c = make(name, p)
    assert c.expression(cp.Variable((p, p), PSD=True)).is_convex()
    for _ in range(5):
        M = positive(rng, p)
        T = orthogonal(rng, p) * 10 ** rng.uniform(-1, 1, size=p)
        expected = c.cost(M) ** c.expression_power
        whitened = T.T @ M @ T
        whitened = 0.5 * (whitened + whitened.T)
        assert c.expression(cp.Variable((p, p), PSD=True), T).is_convex()
        np.testing.assert_allclose(c.expression(cp.Constant(M)).value, expected, rtol=slip(M))
        np.testing.assert_allclose(
            c.expression(cp.Constant(whitened), T).value, expected, rtol=slip(M, whitened)
        )


@every
def test_description_is_what_is_declared(name):
    """`describe` gives the declared attributes, and the flags are booleans."""
    cls = criteria.get(name)
    described = cls.describe()
    assert described["name"] == name
    assert all(described[key] == getattr(cls, key) for key in described)
    assert {type(described[flag]) for flag in ("convex", "smooth", "monotone", "unit_free")} == {
        bool
    }
