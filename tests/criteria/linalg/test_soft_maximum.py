"""Smooth criteria a little above those with kinks: how far above, and that they are smooth where the others are not."""

import numpy as np
import pytest
from matrices import EPS, candidates, make, positive, sensitivities, slip, symmetric, with_spectrum

import criteria
from criteria.linalg.soft_maximum import soft_maximum
from criteria.linalg.spectrum import conjugate

BUILTINS = ("A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0")
KINKED = ("E", "G", "O2", "O3", "O4")
# maxima in the cost: exponents of the soft maxima of M's or cov's eigenvalues or diagonal, added up
EXPONENT = {"E": 1.0, "G": 1.0, "O2": 1.0, "O3": 0.5, "O4": 1.5}

with_kinks = pytest.mark.parametrize("name", KINKED)
sharpnesses = pytest.mark.parametrize("sharpness", [2.0, 8.0, 50.0, 1e4])


def kinks(p=4):
    """Information at which eigenvalues, variances or both are multiple, at either end of the spectrum."""
    rng = np.random.default_rng(0)
    return [
        np.eye(p),
        5 * np.eye(p),
        with_spectrum(rng, np.array([1.0, 1.0, 3.0, 3.0])),
        np.diag([1.0, 1.0, 2.0, 3.0]),
        np.diag([1.0, 2.0, 3.0, 3.0]),
    ]


@sharpnesses
def test_soft_maximum_is_a_little_above_the_maximum(sharpness):
    """``max x <= f <= n^(1/s) max x``, with equality on the right for equal numbers, along the last axis of stacks."""
    rng = np.random.default_rng(0)
    x = 10 ** rng.uniform(-3, 3, size=(5, 7, 6))
    f, u = soft_maximum(x, sharpness)
    top = x.max(axis=-1)
    assert f.shape == (5, 7)
    assert u.shape == x.shape
    assert (f >= top).all()
    assert (f <= 6 ** (1 / sharpness) * top * (1 + 8 * EPS)).all()
    equal, _ = soft_maximum(np.full(6, 3.0), sharpness)
    assert equal == pytest.approx(6 ** (1 / sharpness) * 3, rel=8 * EPS)


@pytest.mark.parametrize("sharpness", [2.0, 8.0, 50.0])
def test_derivatives_of_the_soft_maximum(sharpness, derivative):
    """They match finite differences, equal numbers included, and add up as homogeneity asks: f = sum u_i x_i.

    Truncation grows with the fifth power of the sharpness, so the step of 1e-3 shrinks with it; rounding then is
    1e-11 at the sharpest.
    """
    for x in (np.array([1.0, 2.0, 3.0]), np.array([2.0, 2.0, 1.0]), np.ones(4)):
        f, u = soft_maximum(x, sharpness)
        numeric = derivative(lambda y: soft_maximum(y, sharpness)[0], x, 1e-3 * 2 / sharpness)
        np.testing.assert_allclose(u, numeric, rtol=0, atol=1e-9)
        assert u @ x == pytest.approx(f, rel=64 * sharpness * EPS)


def test_the_maximum_itself():
    """For infinite sharpness it is the maximum, with the derivative of one largest entry, also among equals."""
    f, u = soft_maximum(np.array([[1.0, 3.0, 2.0], [2.0, 2.0, 2.0]]), np.inf)
    assert f.tolist() == [3.0, 2.0]
    assert u.tolist() == [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]


@pytest.mark.parametrize("scale", [1e-200, 1e200])
def test_soft_maximum_neither_overflows_nor_underflows(scale):
    """Powers are taken of ratios to the largest number, so that size does no harm."""
    x = np.array([1.0, 0.9, 1e-30])
    f, u = soft_maximum(scale * x, 1e4)
    assert f == pytest.approx(scale, rel=8 * EPS)
    np.testing.assert_allclose(u, soft_maximum(x, 1e4)[1], rtol=1e4 * 8 * EPS)


def test_conjugate():
    """``V diag(d) V'``, also of stacks."""
    rng = np.random.default_rng(0)
    V, d = rng.normal(size=(3, 4, 4)), rng.normal(size=(3, 4))
    for found, v, x in zip(conjugate(V, d), V, d, strict=True):
        np.testing.assert_allclose(
            found, v @ np.diag(x) @ v.T, rtol=0, atol=64 * EPS * np.abs(found).max()
        )


@pytest.mark.parametrize("name", [n for n in BUILTINS if n not in KINKED])
def test_smooth_criteria_are_their_own_smoothing(name):
    """A criterion that is smooth is left as it is."""
    c = make(name, 3)
    assert c.smooth
    assert c.smoothed(8.0) is c


@with_kinks
def test_smoothing_says_so_and_leaves_the_original(name):
    """The smoothed criterion is declared smooth, of the same name, sense and degree; the original keeps its kinks."""
    c = criteria.create(name)
    smooth = c.smoothed(8.0)
    assert smooth.smooth
    assert not c.smooth
    assert not criteria.get(name).smooth
    for declared in ("name", "sense", "degree", "monotone", "convex"):
        assert getattr(smooth, declared) == getattr(c, declared)
    M = positive(np.random.default_rng(0), 4)
    assert c.smoothed(np.inf).cost(M) == c.cost(M)


@sharpnesses
@with_kinks
def test_smoothed_cost_is_a_little_above(name, sharpness):
    """No smoothed cost is below the original; it is above by p^(1/s) at most, to the power of the maxima in it."""
    rng, c = np.random.default_rng(1), make(name, 4)
    M = np.stack([*(positive(rng, 4, 1e3) for _ in range(20)), *kinks()])
    ratio = c.smoothed(sharpness).cost(M) / c.cost(M)
    assert (ratio >= 1 - slip(M)).all()
    assert (ratio <= 4 ** (EXPONENT[name] / sharpness) * (1 + slip(M))).all()


@with_kinks
def test_sharper_is_closer(name):
    """The smoothed cost falls towards the original as the sharpness grows."""
    M = positive(np.random.default_rng(2), 4)
    costs = [float(make(name, 4).smoothed(s).cost(M)) for s in (2.0, 4.0, 8.0, 16.0, 32.0, np.inf)]
    assert (np.diff(costs) <= slip(M) * costs[0]).all()
    assert costs[0] > costs[-1] * (1 + 1e-3)


@with_kinks
def test_smoothed_gradient_at_kinks(name):
    """Where the original has a kink, <G, H> of the smoothed is the derivative to both sides.

    Fourth-order differences with h = 1e-3 and sharpness 8 err by (8 h)^4/30, about 1e-10 of the cost. At the identity
    the one-sided differences of the original differ.
    """
    rng, h, c = np.random.default_rng(3), 1e-3, make(name, 4)
    smooth = c.smoothed(8.0)
    for M in [*kinks(), positive(rng, 4)]:
        for _ in range(5):
            H = symmetric(rng, 4)
            f = smooth.cost(M + h * np.array([-2, -1, 1, 2])[:, None, None] * H)
            numeric = (f @ [1, -8, 8, -1]) / (12 * h)
            assert abs(np.sum(smooth.gradient(M) * H) - numeric) < 1e-8 * smooth.cost(M)
    H = np.diag([1.0, -1.0, 0.5, -0.5])
    before, at, after = c.cost(np.eye(4) + 1e-3 * np.array([-1, 0, 1])[:, None, None] * H)
    assert before - 2 * at + after > 1e-4


@with_kinks
def test_smoothed_cost_is_homogeneous(name):
    """cost(c M) = c**-degree * cost(M) and <G, M> = -degree * cost, smoothed too."""
    rng, c = np.random.default_rng(4), make(name, 4).smoothed(8.0)
    for M in [*kinks(), positive(rng, 4)]:
        for factor in (1e-8, 1e8):
            assert c.cost(factor * M) == pytest.approx(factor**-c.degree * c.cost(M), rel=slip(M))
        assert abs(np.sum(c.gradient(M) * M) + c.degree * c.cost(M)) <= 8 * slip(M) * c.cost(M)


@pytest.mark.parametrize("name", ["E", "G", "O3"])
def test_smoothed_cost_is_convex_and_monotone(name):
    """cost(N) >= cost(M) + <G(M), N - M> for all pairs, and added information does not raise the smoothed cost."""
    rng, c = np.random.default_rng(5), make(name, 4).smoothed(8.0)
    samples = np.array([*(positive(rng, 4, 1e3) for _ in range(10)), *kinks()])
    costs = c.cost(samples)
    for M, cost, G in zip(samples, costs, c.gradient(samples), strict=True):
        terms = G * (samples - M)
        rounding = slip(samples) * (costs + cost + np.abs(terms).sum(axis=(1, 2)))
        assert (costs - cost - terms.sum(axis=(1, 2)) >= -rounding).all()
        B = rng.normal(size=(4, 2))
        assert c.cost(M + B @ B.T) <= cost * (1 + slip(M))


@pytest.mark.parametrize("name", ["E", "G", "O3", "O2"])
def test_smoothed_gradients_prove_bounds_of_the_original(name):
    """Minus a smoothed gradient is a multiplier of the original: its floor is below every design, not far below M's.

    With t = <Z, M> the floor is made of Lehmer means, ``sum x^s / sum x^(s-1)``, of what the cost has the maxima of.
    These are no less than the power means of order s (Hoelder), and those no less than p^(-1/s) times the maxima.
    """
    rng, c = np.random.default_rng(6), make(name, 4)
    blocks = candidates(rng, 12, 4)
    blocks /= np.trace(blocks, axis1=1, axis2=2)[:, None, None]
    X = np.tensordot(rng.dirichlet(np.full(12, 0.3), size=300), blocks, axes=1)
    costs = c.cost(X)
    for M in X[:10]:
        for sharpness in (4.0, 32.0):
            Z = -c.smoothed(sharpness).gradient(M)[None]
            least = X[costs.argmin()]
            assert c.lower_bound(Z, sensitivities(Z, blocks), M) <= costs.min() * (1 + slip(least))
            here = c.lower_bound(Z, np.einsum("rij,ij->r", Z, M), M)
            assert (
                4 ** (-EXPONENT[name] / sharpness) * (1 - slip(M))
                <= here / c.cost(M)
                <= 1 + slip(M)
            )
