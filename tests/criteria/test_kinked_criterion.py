"""Smooth criteria a little above those with kinks.

They are smooth where the originals are not, and above them by a known amount.
"""

import numpy as np
import pytest
from matrices import candidates, make, positive, sensitivities, slip, symmetric, with_spectrum

import criteria

BUILTINS = ("A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0", "rho_max")
KINKED = ("E", "G", "O2", "O3", "O4", "rho_max")
# Maxima in the cost: exponents of the soft maxima of eigenvalues or diagonals, added up.
EXPONENT = {"E": 1.0, "G": 1.0, "O2": 1.0, "O3": 0.5, "O4": 1.5, "rho_max": 1.0}

with_kinks = pytest.mark.parametrize("name", KINKED)
sharpnesses = pytest.mark.parametrize("sharpness", [2.0, 8.0, 50.0, 1e4])


def kinks(p=4):
    """Information with multiple eigenvalues or variances, at either end of the spectrum."""
    rng = np.random.default_rng(0)
    return [
        np.eye(p),
        5 * np.eye(p),
        with_spectrum(rng, np.array([1.0, 1.0, 3.0, 3.0])),
        np.diag([1.0, 1.0, 2.0, 3.0]),
        np.diag([1.0, 2.0, 3.0, 3.0]),
    ]


@pytest.mark.parametrize("name", [n for n in BUILTINS if n not in KINKED])
def test_smooth_criteria_are_their_own_smoothing(name):
    """A criterion that is smooth is left as it is."""
    c = make(name, 3)
    assert c.smooth
    assert c.smoothed(8.0) is c


@with_kinks
def test_smoothing_says_so_and_leaves_the_original(name):
    """The smoothed criterion is declared smooth, and otherwise like the original.

    The original keeps its kinks.
    """
    c = make(name, 4)
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
    """No smoothed cost is below the original, and it is above by p^(1/s) at most.

    That is said of each maximum, to its power in the cost.
    """
    rng = np.random.default_rng(1)
    c = make(name, 4)
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

    Fourth-order differences with h = 1e-3 and sharpness 8 err by (8 h)^4/30, about 1e-10 of the
    cost. At the identity the one-sided differences of the original differ.
    """
    rng = np.random.default_rng(3)
    h = 1e-3
    c = make(name, 4)
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
    rng = np.random.default_rng(4)
    c = make(name, 4).smoothed(8.0)
    for M in [*kinks(), positive(rng, 4)]:
        for factor in (1e-8, 1e8):
            assert c.cost(factor * M) == pytest.approx(factor**-c.degree * c.cost(M), rel=slip(M))
        assert abs(np.sum(c.gradient(M) * M) + c.degree * c.cost(M)) <= 8 * slip(M) * c.cost(M)


@pytest.mark.parametrize("name", ["E", "G", "O3", "rho_max"])
def test_smoothed_cost_is_convex_and_monotone(name):
    """cost(N) >= cost(M) + <G(M), N - M> for all pairs, and more information never costs more."""
    rng = np.random.default_rng(5)
    c = make(name, 4).smoothed(8.0)
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
    """Minus a smoothed gradient at M proves a bound of the original, not far below the cost of M.

    With t = <Z, M> the bound is made of Lehmer means, ``sum x^s / sum x^(s-1)``, of the numbers
    whose maxima are in the cost. These are no less than the power means of order s (Hoelder), and
    those no less than p^(-1/s) times the maxima.
    """
    rng = np.random.default_rng(6)
    c = make(name, 4)
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
