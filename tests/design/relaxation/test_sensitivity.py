"""Sensitivities of experiments and their derivatives."""

from dataclasses import replace

import numpy as np
import pytest
from designs import DESIGNS, KR270, LOADED

from edtk.design.candidate_source import sample_feasible
from edtk.design.relaxation.proof import experiment_blocks
from edtk.design.relaxation.search_continuum import sensitivity_and_slope
from edtk.robots.loads.fixed_load import FixedLoad

both = pytest.mark.parametrize("per_trace", [False, True], ids=["plain", "per trace"])
BESIDE = {
    f"{name} {how}": d
    for name, space in DESIGNS.items()
    for how, d in (
        ("alone", space),
        ("beside others", space.with_kept(space.problem(sample_feasible(space, 9, 8)).mean, 3)),
    )
}
with_prior_or_not = pytest.mark.parametrize("space", BESIDE.values(), ids=BESIDE)


def sensitivities(space, x, Z, per_trace=False):
    """Sensitivities (n,) and slopes (n, v) of experiments (n, v) to one multiplier (p, p)."""
    value, slope = sensitivity_and_slope(space.at(x[None]), Z[None], per_trace)
    return value[0], slope[0]


def multiplier(space, seed=0):
    """D's multiplier near a random design: it is positive definite."""
    q = sample_feasible(space, 30, (seed, 9))
    return np.linalg.inv(space.problem(q).mean)


def indefinite(space, seed=0):
    """A multiplier as criteria have that are not monotone: it is indefinite."""
    V = np.linalg.cholesky(multiplier(space, seed))
    return V @ np.diag((-1.0) ** np.arange(len(V))) @ V.T


either = pytest.mark.parametrize("Z_of", [multiplier, indefinite])


def differences(f, x, h):
    """Central differences of fourth order (n, v) of a function of experiments (n, v)."""
    n, v = x.shape
    steps = h * np.eye(v)
    near = [(x[:, None] + shift * steps).reshape(-1, v) for shift in (1, -1, 2, -2)]
    ahead, behind, far_ahead, far_behind = f(np.concatenate(near)).reshape(4, n, v)
    return (8 * (ahead - behind) - (far_ahead - far_behind)) / (12 * h)


@either
@both
@with_prior_or_not
def test_sensitivity_is_the_inner_product_with_the_information(space, per_trace, Z_of):
    """The sensitivity is <Z, M>, M with its prior, and per trace it is divided by that of M.

    It does not depend on other experiments. Rounding is eps times the sum of the absolute products,
    with some ten additions in a row.
    """
    Z = Z_of(space)
    x = sample_feasible(space, 50, 1)
    M = experiment_blocks(space.problem(x), np.arange(len(x)))
    size = np.trace(M, axis1=1, axis2=2) if per_trace else 1.0
    value = sensitivities(space, x, Z, per_trace)[0]
    error = 64 * np.finfo(float).eps * np.einsum("ij,kij->k", np.abs(Z), np.abs(M)) / size
    assert (np.abs(value - np.einsum("ij,kij->k", Z, M) / size) <= error).all()
    assert abs(sensitivities(space, x[7:8], Z, per_trace)[0][0] - value[7]) <= error[7]


@both
def test_rows_have_their_own_multipliers(per_trace):
    """Each row of experiments has the sensitivity to its own multiplier."""
    x = sample_feasible(KR270, 12, 1).reshape(3, 4, 6)
    Z = np.array([multiplier(KR270, s) for s in range(3)])
    value, slope = sensitivity_and_slope(KR270.at(x), Z, per_trace)
    for i in range(3):
        alone = sensitivities(KR270, x[i], Z[i], per_trace)
        np.testing.assert_allclose(value[i], alone[0], rtol=1e-12)
        np.testing.assert_allclose(slope[i], alone[1], rtol=0, atol=1e-12 * np.abs(slope[i]).max())


@either
@both
@pytest.mark.parametrize(
    "name", [*BESIDE, "kr270 bounded", "kr270 free", "odd bounded", "odd free"]
)
def test_gradient(name, per_trace, Z_of):
    """The derivative by every joint and load variable is the finite difference.

    Prismatic and fixed joints are included.
    """
    space = (BESIDE | LOADED)[name]
    Z = Z_of(space)
    x = sample_feasible(space, 6, 2)
    slope = sensitivities(space, x, Z, per_trace)[1]
    assert slope.shape == x.shape
    numeric = differences(lambda y: sensitivities(space, y, Z, per_trace)[0], x, h=5e-4)
    np.testing.assert_allclose(numeric, slope, rtol=0, atol=1e-8 * np.abs(slope).max())


@both
def test_sensitivities_are_linear_in_the_multiplier(per_trace):
    """Sensitivities and slopes of a sum of multipliers are the sums of theirs."""
    x = sample_feasible(KR270, 20, 3)
    Y = multiplier(KR270, 1)
    Z = indefinite(KR270, 2)
    one, other, both_of = (sensitivities(KR270, x, z, per_trace) for z in (Y, Z, Y + 2 * Z))
    for value, a, b in zip(both_of, one, other, strict=True):
        size = np.abs(np.r_[a, b]).max()
        np.testing.assert_allclose(value, a + 2 * b, rtol=0, atol=1e-11 * size)


def test_per_trace_the_amount_of_information_does_not_matter():
    """Ten times the load is a hundred times the information: per trace nothing changes."""
    strong = replace(KR270, load=FixedLoad(10 * KR270.load.always))
    x = sample_feasible(KR270, 20, 4)
    Z = multiplier(KR270)
    for per_trace, factor in ((True, 1), (False, 100)):
        more = sensitivities(strong, x, Z, per_trace)[0]
        less = sensitivities(KR270, x, Z, per_trace)[0]
        np.testing.assert_allclose(more, factor * less, rtol=1e-11)
