"""Second derivatives of every criterion, as descents use them."""

import numpy as np
import pytest
from matrices import make, positive, symmetric, units

import criteria
from criteria.criterion import derivatives

every = pytest.mark.parametrize("name", criteria.available())


def smooth(name, p):
    """The criterion, or a smooth one above it."""
    return make(name, p) if make(name, p).smooth else make(name, p).smoothed(20.0)


def triangle(dM):
    """The upper triangle (q,) of a symmetric matrix, row by row."""
    return dM[np.triu_indices(len(dM))]


@every
@pytest.mark.parametrize("p", [1, 2, 5])
def test_curvature_along_any_direction(name, p, derivative):
    """Along any direction the first derivative is ``<G, dM>``, the second ``v' K v``."""
    rng = np.random.default_rng(p)
    criterion = smooth(name, p)
    for _ in range(5):
        M = positive(rng, p)
        H = symmetric(rng, p)
        cost, G, K = (part[0] for part in derivatives(criterion, M[None]))
        assert cost == pytest.approx(float(criterion.cost(M)), rel=1e-12)
        np.testing.assert_allclose(G, criterion.gradient(M), rtol=1e-12)
        v = triangle(H)
        curvature = derivative(
            lambda t, M=M, H=H: np.vdot(criterion.gradient(M + t[0] * H), H)[None], np.zeros(1)
        )[0, 0]
        assert v @ K @ v == pytest.approx(curvature, abs=1e-3 * np.abs(K).max() + 1e-9 * cost)
        np.testing.assert_array_equal(K, K.T)


@pytest.mark.parametrize(
    "name",
    [
        n
        for n in criteria.available()
        if criteria.get(n).unit_free and not criteria.get(n).needs_target
    ],
)
def test_units(name):
    """Parameters in units from 1e-7 to 1e4 have the curvature of unscaled ones.

    That is tried where units do not matter.
    """
    rng = np.random.default_rng(3)
    p = 3
    t = units(rng, p)
    M = positive(rng, p)
    tt = np.outer(t, t)
    cost, _, K = (part[0] for part in derivatives(smooth(name, p), M[None]))
    other, _, scaled = (part[0] for part in derivatives(smooth(name, p), (M * tt)[None]))
    weight = np.outer(triangle(tt), triangle(tt))
    np.testing.assert_allclose(
        scaled * weight / other, K / cost, rtol=0, atol=1e-4 * np.abs(K).max() / cost
    )


@every
def test_batches_and_singular_members(name):
    """Each member of a batch has its own derivatives.

    A singular one has infinite cost and no derivatives, and disturbs no other.
    """
    rng = np.random.default_rng(4)
    p = 3
    criterion = smooth(name, p)
    M = np.array([positive(rng, p), np.diag([1.0, 1.0, 0.0]), positive(rng, p)])
    cost, G, K = derivatives(criterion, M)
    assert cost[1] == np.inf
    assert np.isnan(G[1]).all()
    assert np.isnan(K[1]).any()
    for i in (0, 2):
        alone = derivatives(criterion, M[i : i + 1])
        for whole, part in zip((cost, G, K), alone, strict=True):
            np.testing.assert_allclose(
                whole[i], part[0], rtol=1e-9, atol=1e-9 * np.abs(part[0]).max()
            )


@pytest.mark.parametrize("name", [n for n in criteria.available() if criteria.get(n).convex])
def test_convex_criteria_bend_upwards(name):
    """Where the cost is convex, K is positive semidefinite, to what differences leave."""
    rng = np.random.default_rng(5)
    p = 4
    for _ in range(5):
        K = derivatives(smooth(name, p), positive(rng, p)[None])[2][0]
        assert np.linalg.eigvalsh(K)[0] >= -1e-4 * np.abs(K).max()


@pytest.mark.parametrize("name", ["compound", "minimax"])
def test_of_models_side_by_side(name):
    """By the entries of the blocks the derivatives are a part of those by all entries."""
    rng = np.random.default_rng(6)
    criterion = criteria.create(name, criteria=["D", "A", "D"], sizes=[2, 3, 2])
    criterion = criterion if criterion.smooth else criterion.smoothed(20.0)
    models = criterion.models
    M = np.array([models.diagonal([positive(rng, s) for s in models.sizes]) for _ in range(2)])
    rows, columns = np.triu_indices(models.p)
    own = np.flatnonzero(~models.outside[rows, columns])
    places = list(zip(rows[own].tolist(), columns[own].tolist(), strict=True))
    told = list(zip(*(part.tolist() for part in models.triangles), strict=True))
    order = own[[places.index(place) for place in told]]
    cost, G, whole = derivatives(criterion, M)
    of_blocks = derivatives(criterion, M, models)
    np.testing.assert_array_equal(of_blocks[0], cost)
    np.testing.assert_array_equal(of_blocks[1], G)
    size = 1e-9 * np.abs(whole).max()
    np.testing.assert_allclose(of_blocks[2], whole[:, order[:, None], order], rtol=1e-9, atol=size)
