"""The sensitivity: prices of experiments, their gradients, and the ascent to the dearest one nearby."""

from dataclasses import replace

import numpy as np
import pytest
from designs import DESIGNS, KR270, LOADED
from scipy.optimize import nnls

from criteria import create
from edtk.design.relaxation.ascend import ascend
from edtk.design.relaxation.experiment_blocks import experiment_blocks
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.sensitivity import sensitivity_and_slope
from edtk.design.sample_feasible import sample_feasible
from edtk.model.loads.fixed_load import FixedLoad
from edtk.model.loads.free_load import FreeLoad

on_each = pytest.mark.parametrize("space", DESIGNS.values(), ids=DESIGNS)
on_every_load = pytest.mark.parametrize("space", LOADED.values(), ids=LOADED)
both = pytest.mark.parametrize("per_trace", [False, True], ids=["plain", "per trace"])
BESIDE = {
    f"{name} {how}": d
    for name, space in DESIGNS.items()
    for how, d in (
        ("alone", space),
        ("beside others", space.with_kept(space.problem(sample_feasible(space, 9, 8)).mean, 3)),
    )
}
beside_or_not = pytest.mark.parametrize("space", BESIDE.values(), ids=BESIDE)


def priced(space, x, Z, per_trace=False):
    """Prices (n,) and slopes (n, v) of experiments (n, v) by one multiplier (p, p)."""
    price, slope = sensitivity_and_slope(space.at(x[None]), Z[None], per_trace)
    return price[0], slope[0]


def uphill(space, x, Z, per_trace=False, unit=1.0, accuracy=1e-6):
    """Ends (n, v) of ascents from experiments (n, v) by one multiplier (p, p)."""
    return ascend(space, x, np.tile(Z, (len(x), 1, 1)), per_trace, unit, accuracy)


def multiplier(space, seed=0):
    """What D pays near a random design: every direction of the parameters has its price."""
    q = sample_feasible(space, 30, (seed, 9))
    return np.linalg.inv(space.problem(q).mean)


def indefinite(space, seed=0):
    """A multiplier as criteria have that are not monotone: some directions are paid for, others fined."""
    V = np.linalg.cholesky(multiplier(space, seed))
    return V @ np.diag((-1.0) ** np.arange(len(V))) @ V.T


either = pytest.mark.parametrize("Z_of", [multiplier, indefinite])


@either
@both
@beside_or_not
def test_price_is_the_inner_product_with_the_information(space, per_trace, Z_of):
    """The price of an experiment is <Z, M>, divided by the trace of M where asked, and independent of others; M is its
    information with the prior's.

    Rounding is eps times the sum of the absolute products, with some ten additions in a row.
    """
    Z, x = Z_of(space), sample_feasible(space, 50, 1)
    M = experiment_blocks(space.problem(x), np.arange(len(x)))
    size = np.trace(M, axis1=1, axis2=2) if per_trace else 1.0
    price = priced(space, x, Z, per_trace)[0]
    error = 64 * np.finfo(float).eps * np.einsum("ij,kij->k", np.abs(Z), np.abs(M)) / size
    assert (np.abs(price - np.einsum("ij,kij->k", Z, M) / size) <= error).all()
    assert abs(priced(space, x[7:8], Z, per_trace)[0][0] - price[7]) <= error[7]


@both
def test_rows_have_their_own_multipliers(per_trace):
    """Each row of experiments is priced by its own multiplier."""
    x, Z = (
        sample_feasible(KR270, 12, 1).reshape(3, 4, 6),
        np.array([multiplier(KR270, s) for s in range(3)]),
    )
    price, slope = sensitivity_and_slope(KR270.at(x), Z, per_trace)
    for i in range(3):
        alone = priced(KR270, x[i], Z[i], per_trace)
        np.testing.assert_allclose(price[i], alone[0], rtol=1e-12)
        np.testing.assert_allclose(slope[i], alone[1], rtol=0, atol=1e-12 * np.abs(slope[i]).max())


@either
@both
@pytest.mark.parametrize(
    "name", [*BESIDE, "kr270 bounded", "kr270 free", "odd bounded", "odd free"]
)
def test_gradient(name, per_trace, Z_of, derivative):
    """The derivative by every joint and load variable is the finite difference, prismatic and fixed joints included."""
    space = (BESIDE | LOADED)[name]
    Z, x = Z_of(space), sample_feasible(space, 6, 2)
    slope = priced(space, x, Z, per_trace)[1]
    assert slope.shape == x.shape
    for one, expected in zip(x, slope, strict=True):
        numeric = derivative(lambda y: priced(space, y[None], Z, per_trace)[0][0], one, h=5e-4)
        np.testing.assert_allclose(numeric, expected, rtol=0, atol=1e-8 * np.abs(slope).max())


@both
def test_prices_are_linear_in_the_multiplier(per_trace):
    """A sum of multipliers pays the sum of their prices, and has the sum of their slopes."""
    x, Y, Z = sample_feasible(KR270, 20, 3), multiplier(KR270, 1), indefinite(KR270, 2)
    one, other, sum_ = (priced(KR270, x, z, per_trace) for z in (Y, Z, Y + 2 * Z))
    for value, a, b in zip(sum_, one, other, strict=True):
        np.testing.assert_allclose(value, a + 2 * b, rtol=0, atol=1e-11 * np.abs(np.r_[a, b]).max())


def test_per_trace_is_blind_to_the_amount_of_information():
    """Tenfold load, hundredfold information: prices per trace stay, plain prices grow a hundredfold."""
    strong, x = (
        replace(KR270, load=FixedLoad(10 * KR270.load.always)),
        sample_feasible(KR270, 20, 4),
    )
    Z = multiplier(KR270)
    np.testing.assert_allclose(
        priced(strong, x, Z, True)[0], priced(KR270, x, Z, True)[0], rtol=1e-11
    )
    np.testing.assert_allclose(priced(strong, x, Z)[0], 100 * priced(KR270, x, Z)[0], rtol=1e-11)


def optimal(space, per_trace):
    """The multiplier of the optimum over some candidates: D's, or the condition number's per trace."""
    problem = space.problem(sample_feasible(space, 300, 9))
    return relax(problem, create("O2" if per_trace else "D")).multipliers[0]


@both
@on_every_load
def test_ascend_never_goes_down_and_stays_feasible(space, per_trace):
    """From a feasible experiment the ascent ends in a feasible one that is no cheaper; what does not move stays."""
    Z, starts = optimal(space, per_trace), sample_feasible(space, 6, 5)
    before = priced(space, starts, Z, per_trace)[0]
    unit = float(np.abs(before).max())
    ends = uphill(space, starts, Z, per_trace, unit)
    after = priced(space, ends, Z, per_trace)[0]
    assert space.at(ends).feasible.all()
    assert (after >= before - 1e-14 * unit).all()
    assert (after > before + 1e-3 * unit).sum() >= 4
    held = np.setdiff1d(np.arange(space.size), space.movable)
    np.testing.assert_array_equal(ends[:, held], starts[:, held])


@on_each
def test_each_start_climbs_by_its_own_multiplier(space):
    """Among ascents by other multipliers an experiment ends as dear as by itself, to twice the accuracy."""
    Z = np.array([multiplier(space, s) for s in range(4)])
    starts = sample_feasible(space, 4, 5)
    together = ascend(space, starts, Z)
    for start, end, z in zip(starts, together, Z, strict=True):
        alone = ascend(space, start[None], z[None])
        assert priced(space, alone, z)[0][0] == pytest.approx(
            priced(space, end[None], z)[0][0], abs=2e-6
        )


@both
@on_each
def test_no_pose_nearby_is_dearer_than_the_end_of_an_ascent(space, per_trace):
    """Around the end of an ascent no feasible pose among thousands at random is dearer by more than the accuracy."""
    Z, starts, accuracy = optimal(space, per_trace), sample_feasible(space, 4, 6), 1e-8
    unit, rng = (
        float(np.abs(priced(space, starts, Z, per_trace)[0]).max()),
        np.random.default_rng(0),
    )
    limits, tried = space.workspace.robot.limits[:, space.free], 0
    for end in uphill(space, starts, Z, per_trace, unit, accuracy):
        top = priced(space, end[None], Z, per_trace)[0][0]
        for radius in (1e-2, 1e-3):
            near = np.tile(end, (2000, 1))
            near[:, space.free] += rng.uniform(-radius, radius, size=(2000, len(space.free)))
            near[:, space.free] = np.clip(near[:, space.free], *limits)
            near = near[space.at(near).feasible]
            tried += len(near)
            assert priced(space, near, Z, per_trace)[0].max() <= top + accuracy * unit
    assert tried > 2000


@on_each
def test_an_ascent_ends_at_a_stationary_point(space):
    """At the end of an ascent the slope is a non-negative combination of the slopes of the active constraints.

    A step that gains no more than 1e-10 leaves a slope of sqrt(2 * 1e-10 * curvature), the latter below 50 units
    per squared radian.
    """
    Z, starts = optimal(space, per_trace=False), sample_feasible(space, 8, 7)
    unit = float(priced(space, starts, Z)[0].max())
    for end in uphill(space, starts, Z, unit=unit, accuracy=1e-10):
        slope = priced(space, end[None], Z)[1][0, space.free] / unit
        active = space.workspace.gradient(end)[space.workspace.slack(end) < 1e-6][:, space.free]
        assert nnls(np.vstack([active, np.zeros_like(slope)]).T, -slope)[1] < 1e-4


@on_each
def test_the_dearest_force_is_the_largest(space):
    """Prices grow with the square of a force: the way up over any force ends at the largest, whatever its direction.

    A force that is short by a share s could pay 2 s of its price more, and 1e-6 of the unit is the accuracy.
    """
    free = replace(space, load=FreeLoad(2500.0))
    Z, starts = optimal(free, per_trace=False), sample_feasible(free, 8, 3)
    unit = float(priced(free, starts, Z)[0].max())

    ends = uphill(free, starts, Z, unit=unit, accuracy=1e-6)
    short = 1 - ends[:, len(space.fixed)]
    assert (2 * short * priced(free, ends, Z)[0] <= 1e-6 * unit).all()
