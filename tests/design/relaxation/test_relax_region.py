"""The relaxation over a region: laws, the proof that it carries, and its pictures."""

import numpy as np
import pytest
from matplotlib import pyplot
from numpy.polynomial import legendre
from scipy import optimize

import criteria
import edtk
from edtk.design.bound import BoundKind
from edtk.design.problem import RankDeficientError
from edtk.design.region import Region
from edtk.design.relaxation.proof import normalised
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.search_region import ITERATIONS, onto_walls, polish
from edtk.system.errors import UserError


def decay(x):
    """Two sensors of a decay: rows (2, 2) at each time."""
    t = x[:, 0]
    first = np.stack([np.exp(-t), -t * np.exp(-t)], axis=-1)
    return np.stack([first, 0.5 * first[:, ::-1]], axis=1)


def parabola(x):
    """A full quadratic."""
    u, v = x.T
    return np.stack([np.ones_like(u), u, v, u**2, u * v, v**2], axis=-1)


def disc(x):
    """Inside the unit circle."""
    return 1 - (x**2).sum(axis=1)


@pytest.mark.parametrize("name", ["D", "A", "E", "O2", "O4", "O5"])
def test_no_denser_grid_is_better(name):
    """The relaxation over 1000 points, lies between cost and bound of the region."""
    region = Region(decay, 0, 6)
    r = relax_of(region, name)
    dense = relax(region.problem(np.linspace(0, 6, 1000)), r.criterion)
    assert dense.cost >= r.searched_bound.cost * (1 - 1e-8)
    assert r.cost <= dense.cost * (1 + 1e-7)
    assert r.gap <= 1e-6


def relax_of(region, name):
    """The relaxation by the front door."""
    return edtk.relax(region, name, candidates=400)


@pytest.mark.slow
def test_the_proof_stands_on_its_own():
    """Multipliers and largest sensitivities give the bound, and no point of the region is above."""
    region = Region(parabola, [-1, -1], [1, 1], constraints=disc)
    r = relax_of(region, "D")
    M = r.information
    bound = r.judged.criterion.lower_bound(r.multipliers, r.largest.values, M)
    assert bound == pytest.approx(r.searched_bound.cost, rel=1e-12)
    assert r.cost == pytest.approx(float(r.criterion.cost(M)), rel=1e-12)
    angle = np.random.default_rng(0).uniform(0, 2 * np.pi, 3000)
    radius = np.sqrt(np.random.default_rng(1).uniform(0, 1, 3000))
    x = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    assert r.sensitivities(x).max() <= 1
    problem = normalised(region.problem(r.points), r.criterion)
    own = problem.sensitivities(r.multipliers)[0]
    # The equivalence theorem: at the points of a D-optimum the variance is p.
    np.testing.assert_allclose(own / r.largest.values[0], 1, atol=1e-5)
    assert r.searched_bound.kind is BoundKind.SEARCHED
    assert r.grid_bound.kind is BoundKind.PROVED_ON_CANDIDATES
    assert r.grid_bound.cost >= r.searched_bound.cost


def test_another_scale_of_the_variable():
    """A variable in other units moves the points alone, and parameters in others the cost of D."""
    base = relax_of(Region(decay, 0, 6), "D")
    units = np.array([1e-3, 40.0])
    region = Region(lambda x: decay(x / 1e4) * units, 0, 6e4)
    r = relax_of(region, "D")
    np.testing.assert_allclose(r.points, 1e4 * base.points, atol=1e-6 * 6e4)
    np.testing.assert_allclose(r.weights, base.weights, atol=1e-5)
    assert r.cost * np.sqrt(units.prod()) ** 2 == pytest.approx(base.cost, rel=1e-8)


@pytest.mark.parametrize(("degree", "low", "high"), [(2, 2000, 2030), (3, 300, 310), (10, 0, 1)])
@pytest.mark.slow
def test_polynomials_far_from_the_origin(degree, low, high):
    """Squares of such rows have no digits; D is that of [-1, 1] times h^degree, h half the length.

    Its points are the roots of (1 - u^2) P'(u). The accuracy that rounding leaves is stated.
    """
    region = Region(lambda x: np.vander(x[:, 0], degree + 1, increasing=True), low, high)
    r = edtk.relax(region, "D", candidates=1000)
    inner = legendre.Legendre.basis(degree).deriv().roots().real
    u = np.sort(np.concatenate([[-1, 1], inner]))
    log_det = 2 * np.linalg.slogdet(np.vander(u, degree + 1))[1] / (degree + 1)
    h = (high - low) / 2
    value = h**degree * np.exp(log_det) / (degree + 1)
    assert r.gap <= 1e-6
    assert r.value == pytest.approx(value, rel=max(1e-8, r.accuracy))
    assert r.bound >= value * (1 - max(1e-9, r.accuracy))
    assert r.accuracy < 1e-3
    np.testing.assert_allclose((r.points[:, 0] - low) / h - 1, u, atol=1e-4)


def test_prior_information_counts():
    """With a prior the bound holds, and a direction that the prior tells needs no experiment."""
    prior = np.diag([0.0, 1e4])
    r = edtk.relax(Region(decay, 0, 6, prior=prior), "D")
    assert r.gap <= 1e-6
    t = np.linspace(0, 6, 2001)[:, None]
    alone = float(r.criterion.cost(r.region.problem(t[:1]).information([1.0])))
    assert r.cost <= alone
    # The first parameter alone is best measured where its row is longest: at the beginning.
    assert r.points[r.weights.argmax(), 0] < 0.5


def test_a_region_that_cannot_tell_a_parameter():
    """The open direction is named as for problems."""
    region = Region(lambda x: np.column_stack([x[:, 0], 2 * x[:, 0]]), 0, 1, parameters=("a", "b"))
    with pytest.raises(RankDeficientError, match="a"):
        edtk.relax(region)


def test_a_narrow_place_that_tells_a_parameter():
    """A bump between the points of the first grid is found by the finer one."""

    def rows(x):
        t = x[:, 0]
        bump = np.maximum(1 - ((t - 0.30002) / 2e-4) ** 2, 0.0) ** 2
        return np.stack([np.ones_like(t), bump], axis=-1)

    region = Region(rows, 0, 1)
    with pytest.raises(RankDeficientError):
        edtk.relax(region, "D", candidates=600)
    r = edtk.relax(region, "D")
    assert np.abs(r.points[:, 0] - 0.30002).min() < 1e-6
    assert r.cost == pytest.approx(2, rel=1e-6)


def test_walls_are_reached():
    """Points a hair off bounds and a curved constraint come to lie on them; others stay."""
    region = Region(parabola, [0, -1], [1, 1], constraints=disc)
    x = np.array([[1e-7, 0.3], [0.6 - 1e-7, 0.8], [0.3, 0.3], [1e-8, 1 - 1e-7]])
    moved = onto_walls(region, x)
    assert moved[0].tolist() == [0, 0.3]
    assert np.hypot(*moved[1]) == pytest.approx(1, abs=1e-14)
    assert moved[2].tolist() == [0.3, 0.3]
    assert moved[3].tolist() == [0, 1]


def test_polishing_brings_the_last_digits():
    """Points and weights nearby become the D-optimum of Michaelis and Menten, never worse."""

    def rows(x):
        s = x[:, 0]
        return np.stack([s / (1 + s), -s / (1 + s) ** 2], axis=-1)

    region = Region(rows, 0, 4)
    criterion = criteria.create("D")
    start = np.array([[0.6], [0.62], [3.9]])
    x, w, cost = polish(region, criterion, start, np.array([0.2, 0.2, 0.6]))
    np.testing.assert_allclose(x[:, 0], [2 / 3, 4], atol=1e-7)
    np.testing.assert_allclose(w, 0.5, atol=1e-7)
    assert cost < float(criterion.cost(region.problem(start).information([0.2, 0.2, 0.6])))
    again = polish(region, criterion, x, w)
    assert again[2] <= cost


def test_a_level_of_several_models_settles(monkeypatch):
    """A polish for the worst of six models ends by itself, and not after all iterations."""
    ends = []
    minimize = optimize.minimize

    def counted(*args, **options):
        found = minimize(*args, **options)
        ends.append(found.nit)
        return found

    monkeypatch.setattr(optimize, "minimize", counted)
    slow = np.linspace(0.1, 0.5, 6)
    models = [{"A": 1, "a": 3 - 4 * b, "B": 1, "b": b} for b in slow]
    formula = "A*exp(-a*t) + B*exp(-b*t)"
    region = Region.of_model(formula, models, {"t": (0, 10)}, robust="maximin")
    assert edtk.relax(region, criterion="D").gap < 1e-7
    assert max(ends) < ITERATIONS


@pytest.mark.parametrize("low", [0.0, 400.0], ids=["plain", "ill-conditioned"])
def test_the_grid_has_a_certificate(low, tmp_path):
    """What is proved on the grid is a certificate that `edtk.verify` checks; points are a CSV."""
    region = Region(lambda x: np.vander(x[:, 0], 4, increasing=True), low, low + 10)
    proof = tmp_path / "proof.json"
    out = tmp_path / "points.csv"
    r = edtk.relax(region, "D", candidates=200, out=out, certificate=proof)
    on_grid = r.on_grid()
    assert on_grid.cost == pytest.approx(r.cost, rel=1e-9)
    assert on_grid.proved_bound.cost == pytest.approx(r.grid_bound.cost, rel=1e-8)
    assert edtk.verify(proof, on_grid.problem).valid
    assert not edtk.verify(proof, region.problem(r.grid[:204] + 1e-3)).valid
    assert out.read_text(encoding="utf-8").splitlines()[0] == "x,weight"


@pytest.mark.slow
def test_it_can_be_read_and_drawn():
    """Text, table and notebook name points and both bounds; one or two variables have a picture."""
    line = edtk.relax(Region(decay, 0, 6, variables=("hours",)), "A", candidates=200)
    assert "searched" in line.summary()
    assert "proved on candidates" in line.summary()
    assert "hours" in line._repr_html_()
    assert list(line.to_frame().columns) == ["hours", "weight"]
    assert line.to_frame()["weight"].sum() == pytest.approx(1)
    assert "\n" not in repr(line)
    assert line.value == line.cost
    disc_design = relax_of(Region(parabola, [-1, -1], [1, 1], constraints=disc), "D")
    for design in (line, disc_design):
        axes = design.plot()
        assert "bound" in axes.get_title()
        pyplot.close("all")
    cube = Region(lambda x: np.column_stack([np.ones(len(x)), x]), [0] * 3, [1] * 3)
    with pytest.raises(UserError, match="3 variables has no picture"):
        edtk.relax(cube).plot()


def powers(degree):
    """A polynomial of one variable."""
    return lambda x: x ** np.arange(degree + 1)


def test_predictions_over_a_region_default_to_all_of_its_points():
    """I of a parabola on [-1, 1] is the published 1/4, 1/2, 1/4, as its moments are 1, 1/3, 1/5."""
    design = edtk.relax(edtk.Region(powers(2), -1, 1), "I")
    np.testing.assert_allclose(design.points[:, 0], [-1, 0, 1], atol=1e-5)
    np.testing.assert_allclose(design.weights, [0.25, 0.5, 0.25], atol=1e-5)


@pytest.mark.parametrize("degree", [1, 2, 5, 11])
def test_means_over_a_box_are_exact_for_polynomials(degree):
    """Moments of powers over [0, 2] x [1, 3], whatever the degree, and in parts of the noise."""

    def rows(x):
        return np.concatenate([powers(degree)(x[:, :1]), powers(degree)(x[:, 1:])], axis=1)

    A, weights = edtk.Region(rows, [0, 1], [2, 3], sigma=0.5).mean_over_points()
    M = 4 * np.einsum("k,krp,krq->pq", weights, A, A) / 16
    k = np.arange(degree + 1)
    first, second = 2.0**k / (k + 1), (3.0 ** (k + 1) - 1) / (k + 1) / 2
    np.testing.assert_allclose(M[: degree + 1, degree + 1 :], np.outer(first, second), rtol=1e-12)
    squares = np.add.outer(k, k)
    np.testing.assert_allclose(
        M[: degree + 1, : degree + 1], 2.0**squares / (squares + 1), rtol=1e-12
    )


def test_a_peak_between_nodes_is_not_passed_over():
    """Two rules that both miss a peak agree: the mean of its square is 0.0125, not nothing."""

    def rows(x):
        return np.column_stack([np.ones(len(x)), np.exp(-(((x[:, 0] - 0.3) / 0.01) ** 2))])

    region = edtk.Region(rows, 0, 1)
    A, weights = region.mean_over_points()
    M = np.einsum("k,krp,krq->pq", weights, A, A)
    np.testing.assert_allclose(M[1], [0.01 * np.sqrt(np.pi), 0.01 * np.sqrt(np.pi / 2)], rtol=1e-3)
    assert len(edtk.relax(region, "I").points) == 2


@pytest.mark.parametrize("size", [2, 3, 4, 5, 6])
def test_means_over_boxes_of_more_variables_are_exact_for_polynomials(size):
    """A rule has room for a second one that confirms it: ``1, x_1^2, x_d`` over a unit cube."""

    def rows(x):
        return np.column_stack([np.ones(len(x)), x[:, 0] ** 2, x[:, -1]])

    A, weights = edtk.Region(rows, [0] * size, [1] * size).mean_over_points()
    M = np.einsum("k,krp,krq->pq", weights, A, A)
    expected = [[1, 1 / 3, 1 / 2], [1 / 3, 1 / 5, 1 / 6], [1 / 2, 1 / 6, 1 / 3]]
    np.testing.assert_allclose(M, expected, rtol=1e-12)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_means_over_a_constrained_region_are_those_of_even_points(size):
    """Over a simplex the mean of a variable is 1/(d + 1), of its square 2/((d + 1)(d + 2))."""

    def rows(x):
        return np.column_stack([np.ones(len(x)), x])

    low, high = np.zeros(size), np.ones(size)
    region = edtk.Region(rows, low, high, constraints=lambda x: 1 - x.sum(axis=1))
    A, weights = region.mean_over_points()
    M = np.einsum("k,krp,krq->pq", weights, A, A)
    np.testing.assert_allclose(M[0, 1:], 1 / (size + 1), rtol=3e-3)
    np.testing.assert_allclose(np.diag(M)[1:], 2 / ((size + 1) * (size + 2)), rtol=3e-3)


def test_a_region_without_room_has_no_mean():
    """One line says what to give."""
    narrow = edtk.Region(powers(1), 0, 1, constraints=lambda x: 1e-6 - abs(x[:, 0] - 0.3))
    with pytest.raises(edtk.UserError, match=r"^constraints: leave so little room .*points$"):
        edtk.relax(narrow, "I")


@pytest.mark.parametrize(
    ("f", "digits"),
    [("V * x / (K + x)", 1e-9), (lambda x, t: t[0] * abs(x - 0.3) + t[1], 1e-4)],
    ids=["smooth", "kink"],
)
def test_means_of_a_nonlinear_model_are_those_of_many_places(f, digits):
    """A smooth one and one with a kink: the mean is that of 200,001 places."""
    region = edtk.Region.of_model(f, [2.0, 0.5], (0, 1), parameters=("V", "K"))
    A, weights = region.mean_over_points()
    x = np.linspace(0, 1, 200_001)
    ends = np.full(len(x), 1.0)
    ends[[0, -1]] = 0.5
    rows = region.rows_at(x[:, None])
    expected = np.einsum("k,krp,krq->pq", ends / ends.sum(), rows, rows)
    np.testing.assert_allclose(np.einsum("k,krp,krq->pq", weights, A, A), expected, rtol=digits)
