"""Bounds that are proved for all points of a region: textbook optima, and laws."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial, chebyshev, legendre

import criteria
import edtk
from edtk.design.bound import BoundKind
from edtk.design.candidate_source import Candidates
from edtk.design.enclosure.cover import cover
from edtk.design.enclosure.prove_region import prove_region
from edtk.design.enclosure.region_functions import RegionPolynomials
from edtk.design.region import Region
from edtk.design.relaxation import relax_region
from edtk.design.relaxation.proof import normalised
from edtk.design.relaxation.search_continuum import LargestSensitivities
from edtk.system.errors import ArgumentError
from edtk.system.time_limit import time_limit

pytestmark = pytest.mark.slow

GAP = 1e-9
ROUNDING = 1e-11


def powers(degree):
    """Powers of one variable."""
    return lambda x: np.vander(x[:, 0], degree + 1, increasing=True)


def quadratic(x):
    """A full quadratic in any number of variables."""
    d = x.shape[1]
    squares = [x[:, i] * x[:, j] for i in range(d) for j in range(i, d)]
    return np.stack([np.ones_like(x[:, 0]), *x.T, *squares], axis=-1)


def plane(x):
    """A plane."""
    return np.stack([np.ones_like(x[:, 0]), *x.T], axis=-1)


def disc(x):
    """Inside the unit circle."""
    return 1 - (x**2).sum(axis=1)


def check(region, criterion, cost, points=None, eps=GAP):
    """Cost and proved bound enclose the optimum to the gap, and rest on these points."""
    found = edtk.relax(region, criterion, prove=eps)
    assert found.kind is BoundKind.PROVED
    assert found.gap <= eps
    assert found.cost == pytest.approx(cost, rel=eps)
    assert found.cost >= cost * (1 - ROUNDING)
    assert found.continuum_bound.cost <= cost * (1 + ROUNDING)
    assert found.continuum_bound.cost <= found.searched_bound.cost
    assert f"{BoundKind.PROVED.value} gap" in found.headline()
    if points is not None:
        expected = np.asarray(points, dtype=float).reshape(len(points), -1)
        np.testing.assert_allclose(found.points, expected, atol=3e-5)
    return found


@pytest.mark.parametrize("degree", [2, 5])
def test_d_optimal_polynomials(degree):
    """D on [-1, 1] rests on the roots of (1 - x^2) P'(x), of Legendre's polynomial (Guest 1958)."""
    inner = legendre.Legendre.basis(degree).deriv().roots().real
    support = np.sort(np.concatenate([[-1, 1], inner]))
    log_det = 2 * np.linalg.slogdet(np.vander(support))[1] / (degree + 1)
    check(Region(powers(degree), -1, 1), "D", (degree + 1) * np.exp(-log_det), support)


def test_e_and_c_optimal_polynomials_of_degree_five():
    """E, and the value beyond the end, rest on the extrema of Chebyshev's polynomial.

    E is one over its sum of squared coefficients (Pukelsheim and Studden 1993), the variance at 1.2
    its square there (Hoel and Levine 1964).
    """
    region = Region(powers(5), -1, 1)
    wave = chebyshev.Chebyshev.basis(5)
    extrema = -np.cos(np.pi * np.arange(6) / 5)
    c = wave.convert(kind=Polynomial).coef
    check(region, "E", c @ c, extrema)
    beyond = criteria.create("c", c=list(1.2 ** np.arange(6)))
    check(region, beyond, wave(1.2) ** 2, extrema)


@pytest.mark.parametrize("name", ["A", "G", "O5", "I"])
def test_degree_five_by_other_criteria(name):
    """A gap of 1e-9 for every criterion with a closed polar; 1e4 points are no more sensitive."""
    given = {"W": np.diag(1 / np.arange(1.0, 7))} if name == "I" else {}
    region = Region(powers(5), -1, 1)
    found = prove_region(region, criteria.create(name, **given), GAP)
    assert found.gap <= GAP
    x = np.linspace(-1, 1, 10_001)[:, None]
    problem = normalised(found.judged.region.problem(x), found.judged.criterion)
    largest = problem.sensitivities(found.covering.multipliers).max(axis=1)
    assert (largest <= found.covering.upper).all()


def test_the_quadratic_on_the_square():
    """D: weights 0.1458, 0.08015 and 0.0962 at corners, midpoints and centre (Fedorov 1972)."""
    found = check(Region(quadratic, [-1, -1], [1, 1]), "D", 2.107065181197508)
    order = np.abs(found.points).sum(axis=1).round(6)
    sums = [found.weights[order == far].sum() for far in (2, 1, 0)]
    np.testing.assert_allclose(sums, [0.5832, 0.3206, 0.0962], atol=1e-4)


def test_the_quadratic_on_the_cube():
    """D: cost and bound enclose det(M) of three levels, by symmetry a program of two moments.

    With moments u = E x^2 = E x^4 and v = E x^2 y^2 the determinant is
    ``u^3 v^3 (u - v)^2 (u + 2v - 3u^2)`` (Kono 1962), at its largest here by a search.
    """
    from scipy.optimize import minimize

    def minus(moments):
        u, v = moments
        return -(3 * np.log(u * v) + 2 * np.log(u - v) + np.log(u + 2 * v - 3 * u * u))

    best = minimize(minus, [0.79, 0.65], method="Nelder-Mead", options={"xatol": 1e-12}).fun
    check(Region(quadratic, [-1] * 3, [1] * 3), "D", np.exp(best / 10))


@pytest.mark.parametrize(("name", "cost"), [("D", 2 ** (2 / 3)), ("A", 5.0), ("E", 2.0)])
def test_the_plane_on_the_disc(name, cost):
    """M = diag(1, 1/2, 1/2): all points of the circle are equally sensitive."""
    check(Region(plane, [-1, -1], [1, 1], constraints=disc), name, cost, eps=1e-6)


def test_the_quadratic_on_the_disc():
    """D: a sixth in the centre and the rest on the circle, all of which is equally sensitive.

    With s = 5/6 the determinant is ``(s/2)^2 (s/8) (s/4) (s/2 - s^2/2)`` (Kiefer 1960). The product
    of the constraint with its rest closes boxes along the circle, some hundred instead of 1e5.
    """
    s = 5 / 6
    det = (s / 2) ** 2 * (s / 8) * (s / 4) * (s / 2 - s**2 / 2)
    region = Region(quadratic, [-1, -1], [1, 1], constraints=disc)
    assert check(region, "D", det ** (-1 / 6), eps=1e-6).covering.boxes < 1000


def test_a_scaled_variable_far_from_the_origin():
    """A parabola over the years 2000 to 2030: powers are told in other parameters."""
    check(Region(powers(2), 2000, 2030), "D", 3 * (15.0**3 * 2) ** (-2 / 3), [2000, 2015, 2030])


def test_a_narrow_box_far_from_the_origin():
    """A line over [1e6, 1e6 + 1]: nothing of the box's place is rounded where it is covered."""
    far = 1e6
    found = check(Region(lambda x: x - far + 1.0, far, far + 1), "D", 0.25, [far + 1])
    assert found.covering.coverings[0].place == far + 1


def test_a_stated_degree_does_as_well():
    """A function that takes nothing but floats, with its degree."""

    def floats(x):
        return powers(2)(np.asarray(x, dtype=float))

    region = Region(floats, -1, 1)
    with pytest.raises(ArgumentError, match="rows: it runs neither on polynomials nor on interv"):
        edtk.relax(region, prove=GAP)
    check(Region(floats, -1, 1, degree=2), "D", 3 * 4 ** (-1 / 3), [-1, 0, 1])


def test_a_prior_counts():
    """With prior information on the slope alone, the proof is about both together."""
    region = Region(powers(1), -1, 1, prior=np.diag([0.0, 3.0]))
    check(region, "D", 4**-0.5)


def narrow(u, place, n):
    """A polynomial of degree 2n that is one at its place, and small a distance 3/n from there."""
    c = np.cos(np.arange(n + 1) * np.arccos(place))
    return (chebyshev.chebval(u, c) / (c @ c)) ** 2


def test_a_narrow_peak_is_found_from_far_away():
    """Of degree (16, 16), by boxes alone: nothing but the other corner is known."""

    def rows(x):
        u, v = x.T
        peak = narrow(u, 0.53, 4) * narrow(v, -0.47, 4)
        return np.stack([np.ones_like(u), u, v, 10 * peak], axis=-1)

    region = Region(rows, [-1, -1], [1, 1])
    Z = np.diag([1.0, 1.0, 1.0, 1.0])
    enclosed = RegionPolynomials.of(region).enclosed(Z, criteria.create("D"))
    found = cover(enclosed, 1e-6, np.array([[-1.0, 1.0]]))
    np.testing.assert_allclose(found.place, [0.53, -0.47], atol=0.1)
    near = found.place + np.random.default_rng(0).uniform(-1e-3, 1e-3, (10_000, 2))
    largest = region.problem(near).sensitivities(Z).max()
    assert largest <= found.upper <= largest * (1 + 1e-5)


def blind(grid, criterion, multipliers, known, margin=0.0):
    """A search without any ascent."""
    x = np.concatenate([grid.x, known])
    values = grid.region.problem(x).sensitivities(multipliers)
    return LargestSensitivities.of(values, x), Candidates(known, grid.region.problem(known))


def test_a_blind_search_is_led_by_the_proof(monkeypatch):
    """Without any ascent, places that boxes find refute each bound that is too good."""
    monkeypatch.setattr(relax_region, "search_region", blind)
    found = prove_region(Region(powers(3), -1, 1), criteria.create("D"), 1e-5, candidates=4)
    support = np.array([-1, -np.sqrt(0.2), np.sqrt(0.2), 1])
    cost = 4 * np.exp(-np.linalg.slogdet(np.vander(support))[1] / 2)
    assert found.gap <= 1e-5
    assert found.continuum_bound.cost <= cost * (1 + ROUNDING)
    assert found.searched_bound.cost <= cost * (1 + 1e-5)


def test_a_search_that_is_refuted_in_its_last_round_tells_what_is_known(monkeypatch):
    """Its design and the proved bound stay, and the searched one is not the refuted one."""
    monkeypatch.setattr(relax_region, "search_region", blind)
    monkeypatch.setattr(relax_region, "REGION_ROUNDS", 1)
    found = prove_region(Region(powers(3), -1, 1), criteria.create("D"), 1e-5, candidates=4)
    assert found.gap > 1e-5
    assert 0 < found.continuum_bound.cost <= found.searched_bound.cost < found.cost * (1 - 1e-5)
    assert found.largest.values == pytest.approx(found.covering.lower)


def pieces(x):
    """Not negative in two ovals, a hundredth of a range wide."""
    first = ((x - [0.3, 0.2]) ** 2).sum(axis=1)
    second = ((x - [-0.5, -0.4]) ** 2).sum(axis=1)
    return 1e-4 - first * second


def test_constraints_that_leave_small_pieces():
    """Two ovals, 2e-4 of the square: a plane rests on both, and no point of them is above."""
    region = Region(plane, [-1, -1], [1, 1], constraints=pieces)
    found = edtk.relax(region, "D", prove=1e-4)
    assert found.gap <= 1e-4
    near = np.random.default_rng(0).uniform(-0.02, 0.02, (2, 10_000, 2))
    x = (near + np.array([[[0.3, 0.2]], [[-0.5, -0.4]]])).reshape(-1, 2)
    x = x[pieces(x) >= 0]
    assert len(x) > 1000
    problem = found.judged.region.problem(x)
    assert problem.sensitivities(found.covering.multipliers).max() <= found.covering.upper[0]
    np.testing.assert_allclose(np.unique(np.sign(found.points[:, 0])), [-1, 1])


@pytest.mark.parametrize("seed", range(8))
def test_no_point_of_a_random_model_is_above(seed):
    """Random points and climbing ones of random polynomials, with and without constraints."""
    rng = np.random.default_rng(seed)
    d = 1 + seed % 3
    degree = int(rng.integers(1, 6 if d < 3 else 3))
    exponents = np.indices((degree + 1,) * d).reshape(d, -1).T
    C = rng.normal(size=(2, 4, len(exponents)))

    def rows(x):
        powers = np.stack([np.prod(x**own, axis=1) for own in exponents], axis=-1)
        return np.einsum("rpk,nk->nrp", C, powers)

    ball = (lambda x: 0.7 - ((x - 0.2) ** 2).sum(axis=1),) if seed % 2 else ()
    region = Region(rows, -np.ones(d), np.ones(d), constraints=ball)
    B = rng.normal(size=(4, 4))
    Z = B @ B.T
    enclosed = RegionPolynomials.of(region).enclosed(Z, criteria.create("D"))
    found = cover(enclosed, 1e-4)
    x = rng.uniform(-1, 1, (20_000, d))
    for radius in 0.3 ** np.arange(1, 12):
        x = x[region.at(x).feasible]
        values = region.problem(x).sensitivities(Z)
        best = x[np.argsort(values)[-200:]]
        near = best[:, None] + radius * rng.normal(size=(len(best), 40, d))
        x = np.concatenate([best, np.clip(near, -1, 1).reshape(-1, d)])
    assert values.max() <= found.upper <= values.max() * (1 + 1e-3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"prove": 0}, "prove 0: expected a relative gap between 0 and 1"),
        ({"prove": 1}, "prove 1: expected a relative gap between 0 and 1"),
        ({"prove": True}, "prove: expected a number, not bool"),
        ({"prove": "0.1"}, "prove: expected a number, not str"),
    ],
)
def test_wrong_gaps_are_refused(options, message):
    """One line says what is expected."""
    with pytest.raises(ArgumentError, match=message):
        edtk.relax(Region(powers(2), -1, 1), **options)


def test_time_that_is_up_leaves_an_honest_bound():
    """Without time for boxes the bound is the one of the whole box, lower and still proved."""
    with time_limit(0.0):
        found = prove_region(Region(powers(5), -1, 1), criteria.create("D"), GAP)
    assert found.kind is BoundKind.PROVED
    assert 0 < found.continuum_bound.cost < 0.99 * found.cost


def test_plans_are_told_beside_the_proved_bound():
    """Three points of a parabola: as many experiments at each are the best of all plans."""
    plan = edtk.plan(Region(powers(2), -1, 1), 6, "D", prove_bound=GAP)
    assert plan.kind is BoundKind.PROVED
    assert plan.counts.tolist() == [2, 2, 2]
    assert 1 - GAP <= plan.efficiency <= 1
    assert BoundKind.PROVED.value in plan.headline()


def test_flat_ridges_are_halved_along_every_axis():
    """Where the penalised sensitivity is constant, rounding does not choose the axis for ever."""
    region = Region(plane, [-1, -1], [1, 1], constraints=disc)
    enclosed = RegionPolynomials.of(region).enclosed(np.diag([0, 0.5, 0.5]), criteria.create("E"))
    found = cover(enclosed, 1e-7, np.array([[1.0, 0.0]]))
    assert found.upper <= 0.5 * (1 + 2e-7)
    assert found.boxes < 5000


def test_the_summary_has_all_three_bounds():
    """The proved one comes first, with its boxes."""
    found = edtk.relax(Region(powers(2), -1, 1), "D", prove=1e-6)
    text = found.summary()
    assert "over the region (proved on the continuum), relative gap" in text
    assert "(searched)" in text
    assert "(proved on candidates)" in text
    assert found.bound_proved == found.bound >= found.bound_searched
