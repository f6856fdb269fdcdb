"""Ranges of theta and rivals: published optima, brute force over the ranges, bounds, bad input."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import linprog, minimize_scalar
from scipy.stats import binom, gamma, norm, poisson

import edtk
from edtk.design.bound import BoundKind
from edtk.design.families import FAMILIES, Response
from edtk.design.relaxation.relax import relax
from edtk.design.theta_box import EfficiencyBox, Shares
from edtk.system.errors import ArgumentError
from edtk.system.time_limit import no_progress
from edtk.verbs.robust import _Ranges

ENZYME = "V * x / (K + x)"
PARABOLA = "a + b * x + c * x^2"
LINE = {"p": (-10, 10), "q": (-10, 10)}


def enzyme(K, x=None, **options):
    """Michaelis and Menten's model over doses up to one, with a range of K."""
    x = np.linspace(0, 1, 101) if x is None else x
    return edtk.Problem.of_model(ENZYME, {"V": 2.0, "K": K}, x, robust="maximin", **options)


def d_efficiency(design, K):
    """D-efficiency of weights at each K (k,), against a half at K/(2 K + 1) and at one."""
    x = design.problem.frame["x"].to_numpy()[:, None]
    rows = np.stack([x / (K + x), -2 * x / (K + x) ** 2], axis=-1)
    M = np.einsum("n,nkp,nkq->kpq", design.weights, rows, rows)
    ideal = K / (2 * K + 1)
    best = ideal * (1 - ideal) / ((K + ideal) ** 2 * (K + 1) ** 2)
    return np.sqrt(np.linalg.det(M)) / best


@pytest.mark.slow
def test_a_narrow_range_has_the_design_of_two_points():
    """A half at one, and a half where both ends of the range are equally efficient.

    The root of det is ``x (1 - x) V/((K + x)^2 (K + 1)^2)`` for a half at x and at one. It is
    largest at x = K/(2 K + 1), so that both ends are alike where ``(K + x)/sqrt(K (K + 1))`` are
    (standardised maximin, Dette and Biedermann, JASA 98, 2003).
    """
    low, high = 0.5, 1.0
    a, b = (1 / np.sqrt(K * (K + 1)) for K in (low, high))
    best = (high * b - low * a) / (a - b)
    x = np.union1d(np.linspace(0, 1, 101), [low / (2 * low + 1), best, high / (2 * high + 1)])
    design = edtk.relax(enzyme((low, high), x))
    assert x[design.weights > 1e-4] == pytest.approx([best, 1.0], abs=1e-12)
    assert design.weights[design.weights > 1e-4] == pytest.approx([0.5, 0.5], abs=1e-4)
    efficiency = 4 * low * (low + 1) * best * (1 - best) / (low + best) ** 2
    assert design.worst.value == pytest.approx(efficiency, rel=1e-5)


X = np.linspace(0.05, 1, 20)
SIGMA = 0.2 + X**2
OF_COLUMN = pd.DataFrame({"x": X, "s": SIGMA})
RIVAL = ("a + b * x + x^3", {"a": 1.0, "b": 1.0}, "p + q * x", LINE)


def ranged(formula, places, **options):
    """Michaelis and Menten's model with a range of K."""
    theta = {"V": 2.0, "K": (0.2, 1.0)}
    return edtk.Problem.of_model(formula, theta, places, robust="maximin", **options)


def rivals(formula, places, **options):
    """A cubic and a line, each in the place of V * x / (K + x) in a formula."""
    f, theta, g, limits = RIVAL
    f, g = (formula.replace(ENZYME, f"({one})") for one in (f, g))
    return edtk.Problem.of_rivals(f, theta, g, limits, places, **options)


OF_CANDIDATES = pytest.mark.parametrize(
    ("places", "sigma"),
    [(X, SIGMA), (X, SIGMA[:, None]), (OF_COLUMN, "s"), (X, lambda x: 0.2 + x**2)],
    ids=["n", "n, 1", "column", "function"],
)


def assert_same_rows(one, other):
    """Problems that have the same rows at any theta of their ranges."""
    boxes = [problem.robust.box for problem in (one, other)]
    thetas = boxes[1].at(boxes[1].tried[:9])
    np.testing.assert_allclose(*(box.listed(list(thetas)).factors() for box in boxes), rtol=1e-12)


@pytest.mark.parametrize("kind", [ranged, rivals])
@pytest.mark.parametrize(
    ("places", "sigma"),
    [(X, SIGMA), (X, SIGMA[:, None]), (OF_COLUMN, "s"), (X, lambda x: 0.2 + x**2)],
    ids=["n", "n, 1", "column", "function"],
)
def test_noise_of_candidates_divides_the_model(kind, places, sigma):
    """The rows are those of the model, or of both rivals, in parts of a variable sigma."""
    noisy, divided = kind(ENZYME, places, sigma=sigma), kind(f"({ENZYME}) / s", OF_COLUMN)
    assert_same_rows(noisy, divided)
    if kind is rivals:
        boxes = [problem.robust.box for problem in (noisy, divided)]
        thetas = boxes[0].at(boxes[0].tried[:9])
        values = [
            box.values(thetas, Shares.of(box.sites.trial, np.ones(20), box.sites.noise), None, None)
            for box in boxes
        ]
        np.testing.assert_allclose(*values, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [ranged, rivals])
def test_noise_of_candidates_finds_the_design(kind):
    """The worst theta, or rival, is that of the models in parts of the noise; plans, too."""
    noisy, divided = kind(ENZYME, X, sigma=SIGMA), kind(f"({ENZYME}) / s", OF_COLUMN)
    found, expected = edtk.relax(noisy), edtk.relax(divided)
    assert found.worst.value == pytest.approx(expected.worst.value, rel=1e-6)
    assert found.weights == pytest.approx(expected.weights, abs=2e-3)
    if kind is ranged:
        plans = [edtk.plan(problem, 6).worst.value for problem in (noisy, divided)]
        assert plans[0] == pytest.approx(plans[1], rel=1e-6)


@pytest.mark.parametrize("kind", [ranged, rivals])
def test_constant_noise_of_candidates_is_one_number(kind):
    """The same sigma everywhere, as a number and for each candidate, has the same rows."""
    number, each = (kind(ENZYME, X, sigma=s) for s in (0.5, np.full(len(X), 0.5)))
    assert_same_rows(each, number)
    assert_same_rows(each, kind(f"({ENZYME}) / 0.5", X))


def test_noise_of_candidates_may_be_one_for_each_response():
    """Two responses of ranged models, each in parts of its own sigma at each candidate."""
    both = [ENZYME, "V * x / (K + x)^2"]
    noise = np.stack([SIGMA, 0.5 - 0.2 * X], axis=1)
    table = pd.DataFrame({"x": X, "s": noise[:, 0], "t": noise[:, 1]})
    divided = [f"({one}) / {name}" for one, name in zip(both, "st", strict=True)]
    expected = ranged(divided, table, variables=("x", "s", "t"))
    assert_same_rows(ranged(both, X, sigma=noise), expected)


def test_rivals_of_a_region_may_have_a_noise_of_points():
    """A function of x: the rows are those of the same rivals in parts of it."""
    f, theta, g, limits = RIVAL
    noisy = edtk.Region.of_rivals(f, theta, g, limits, (-1, 1), sigma=lambda x: 1 + 0.5 * x**2)
    f, g = (f"({one}) / (1 + 0.5 * x^2)" for one in (f, g))
    divided = edtk.Region.of_rivals(f, theta, g, limits, (-1, 1))
    np.testing.assert_allclose(noisy.rows_at(X[:, None]), divided.rows_at(X[:, None]), rtol=1e-12)


@pytest.mark.slow
def test_the_worst_theta_is_that_of_a_fine_grid():
    """No K of 2,001 is worse than what the search says, and no design beats the bound.

    Candidates are a grid, so that the efficiency of the grid's best weights is a little above that
    against the best dose of all.
    """
    limits = (0.2, 0.9)
    design = edtk.relax(enzyme(limits, np.linspace(0, 1, 401)))
    least = d_efficiency(design, np.linspace(*limits, 2001)).min()
    assert least == pytest.approx(design.worst.value, rel=2e-3)
    assert least <= design.worst.value * (1 + 1e-9)
    assert design.worst.value == pytest.approx(1 / design.bound, rel=2e-5)
    assert design.worst.value <= 1 / design.bound * (1 + 1e-9)


def test_theta_around_a_peak_are_joined_by_their_parts():
    """A quarter at 0.4 and three at 0.6 stand for 0.55; one far away does not count."""
    box = enzyme((0.0, 1.0)).robust.box
    listed = [np.array([2.0, K]) for K in (0.4, 0.6, 1.0)]
    between = box.between(np.array([2.0, 0.5]), listed, np.array([1.0, 3.0, 9.0]))
    np.testing.assert_allclose(between, [2.0, 0.55], rtol=1e-15)


def test_work_over_ranges_is_told_and_done_once():
    """Every theta that is tried alone tells that, and none of a grid is relaxed again."""
    told = []
    options = {"robust": "maximin"}
    dose = edtk.Region.of_model(ENZYME, {"V": 2.0, "K": (0.2, 1.0)}, {"x": (0, 1)}, **options)
    found = edtk.relax(dose, progress=lambda line, number: told.append((line, number)))
    alone = [number for line, number in told if line == "theta alone"]
    assert alone == list(range(1, len(alone) + 1))
    assert len(alone) < 33 + 33 // 2  # the levels of the grid, and few beside it
    assert [line for line, _ in told if line.endswith("together")][-1] == (
        f"{len(found.worst.thetas)} theta together"
    )


@pytest.mark.slow
def test_the_design_for_ranges_is_that_of_a_long_list():
    """Twenty theta in a box have a design that is hardly better at its worst of them."""
    box = {"top": 1.0, "b": (0.5, 2.0), "c": (0.2, 0.4)}
    x = np.linspace(0, 8, 41)
    formula = "top * exp(-c * x) - top * exp(-(b + c) * x)"
    design = edtk.relax(edtk.Problem.of_model(formula, box, x, robust="maximin"))
    thetas = [[1.0, b, c] for b in np.geomspace(0.5, 2.0, 5) for c in np.linspace(0.2, 0.4, 4)]
    listed = edtk.Problem.of_model(formula, thetas, x, parameters=tuple(box), robust="maximin")
    long = edtk.relax(listed)
    of_list = long.criterion.cost(listed.information(design.weights))
    assert 1 / of_list >= design.worst.value * (1 - 1e-5)
    assert 1 / long.value >= design.worst.value * (1 - 1e-5)


@pytest.mark.slow
def test_a_plan_over_ranges_is_as_good_as_all_plans():
    """Of all plans of four experiments on seven doses, by the least efficiency on a fine grid."""
    from itertools import combinations_with_replacement

    x = np.array([0.05, 0.1, 0.2, 0.3, 0.45, 0.7, 1.0])
    plan = edtk.plan(enzyme((0.1, 2.0), x), 4)
    grid = np.linspace(0.1, 2.0, 41)
    best = [edtk.relax(edtk.Problem.of_model(ENZYME, {"V": 2.0, "K": K}, x)).value for K in grid]

    def least(chosen):
        doses = x[list(chosen)][:, None]
        rows = np.stack([doses / (grid + doses), -2 * doses / (grid + doses) ** 2], axis=-1)
        M = np.einsum("nkp,nkq->kpq", rows, rows) / 4
        return (np.sqrt(np.maximum(np.linalg.det(M), 0)) / best).min()

    values = [least(chosen) for chosen in combinations_with_replacement(range(7), 4)]
    assert least(plan.experiments) == pytest.approx(max(values), rel=1e-9)
    assert plan.worst.value == pytest.approx(max(values), rel=1e-3)
    assert max(values) * 4 <= 1 / plan.bound * 4**2 * (1 + 1e-9)


@pytest.mark.slow
def test_the_least_deviance_is_the_square_of_the_best_approximation():
    """Of a rival that is linear in its parameters (Dette and Titoff, Ann. Stat. 37, 2009)."""
    x = np.linspace(0.1, 5, 60)
    true = 2 * x / (1 + x)
    rivals = edtk.Problem.of_rivals(ENZYME, {"V": 2.0, "K": 1.0}, "p + q * x", LINE, x)
    columns = np.stack([np.ones_like(x), x], axis=-1)
    ones = np.ones((len(x), 1))
    error = linprog(
        [0, 0, 1],
        A_ub=np.block([[columns, -ones], [-columns, -ones]]),
        b_ub=np.concatenate([true, -true]),
        bounds=[(None, None)] * 2 + [(0, None)],
    ).fun
    assert edtk.relax(rivals).worst.value == pytest.approx(error**2, rel=2e-5)


@pytest.mark.slow
def test_the_equivalence_theorem_of_rivals():
    """At the rival's fitted parameters no candidate has more deviance than the design."""
    x = np.linspace(0.1, 5, 50)
    rivals = edtk.Problem.of_rivals(
        "V * x / (K + x) + F * x",
        {"V": 1.0, "K": 1.0, "F": 0.1},
        ENZYME,
        {"V": (0.1, 10), "K": (0.1, 20)},
        x,
    )
    design = edtk.relax(rivals)
    V, K = design.worst.theta.values()
    each = np.square(x / (1 + x) + 0.1 * x - V * x / (K + x))
    assert design.weights @ each == pytest.approx(design.worst.value, rel=1e-9)
    assert each.max() == pytest.approx(design.worst.value, rel=0.02)
    assert 1 / design.bound >= design.worst.value * (1 - 1e-9)
    assert 1 / design.bound <= design.worst.value * (1 + 2e-5)


@pytest.mark.slow
def test_nested_models_have_the_design_of_ds():
    """A parabola is told from a line by a quarter, a half and a quarter."""
    x = np.linspace(-1, 1, 41)
    design = edtk.relax(
        edtk.Problem.of_rivals(
            "a + b * x + c * x^2", {"a": 1, "b": 2, "c": 3}, "p + q * x", LINE, x
        )
    )
    parabola = edtk.Problem.of_model(PARABOLA, {"a": 1, "b": 2, "c": 3}, x)
    of_c = edtk.relax(parabola, {"name": "Ds", "interest": ["c"]})
    assert design.weights == pytest.approx(of_c.weights, abs=2e-3)
    assert design.worst.value == pytest.approx(9 / 4, rel=2e-5)


SUMS = np.arange(400)
DIVERGENCES = {
    "normal": lambda m, n: norm(n).logpdf(m) * -2 + norm(m).logpdf(m) * 2,
    "binomial": lambda m, n: 2 * _summed(binom(1, m), binom(1, n), np.arange(2)),
    "Poisson": lambda m, n: 2 * _summed(poisson(m), poisson(n), SUMS),
    "gamma": lambda m, n: (
        2
        * gamma(1, scale=m).expect(
            lambda y: gamma(1, scale=m).logpdf(y) - gamma(1, scale=n).logpdf(y)
        )
    ),
}


def _summed(own, other, y):
    told = own.pmf(y) > 0
    return (own.pmf(y) * (own.logpmf(y) - other.logpmf(y)))[told].sum()


@pytest.mark.parametrize("name", FAMILIES)
def test_a_deviance_is_twice_the_divergence(name):
    """Summed or integrated over the responses; its root keeps its digits where means are alike."""
    response = Response.of(name, "identity")
    m, n = np.array([0.7]), np.array([0.4])
    assert response.deviance_roots(m, n)[0] ** 2 == pytest.approx(DIVERGENCES[name](0.7, 0.4))
    assert response.deviance_roots(n, m)[0] < 0
    step = 1e-9
    near = response.deviance_roots(m + step, m)[0]
    variance = response.family.variance(m, 1 - m)[0]
    assert near == pytest.approx(step / np.sqrt(variance), rel=1e-6)


@pytest.mark.slow
def test_counts_are_told_from_a_constant():
    """Two points; the rival's best constant is the mean, and one weight is left to choose."""
    x = np.linspace(-1, 1, 41)
    options = {"theta": {"a": 0.0, "b": 1.0}, "rival": "p", "rival_theta": {"p": (-5, 5)}}
    design = edtk.relax(
        edtk.Problem.of_rivals("a + b * x", candidates=x, family="Poisson", **options)
    )

    def lost(w):
        means = np.exp([-1.0, 1.0])
        shares = np.array([1 - w, w])
        return -2 * shares @ (means * np.log(means / (shares @ means)))

    best = minimize_scalar(lost, bounds=(0, 1), method="bounded", options={"xatol": 1e-10})
    assert design.worst.value == pytest.approx(-best.fun, rel=2e-5)
    assert design.weights[[0, -1]] == pytest.approx([1 - best.x, best.x], abs=5e-3)


@pytest.mark.slow
def test_a_plan_tells_rivals():
    """Eight experiments on a line: two, four and two; its certificate is that of the list."""
    x = np.linspace(-1, 1, 11)
    plan = edtk.plan(edtk.Problem.of_rivals("a * x^2", {"a": 1.0}, "p + q * x", LINE, x), 8)
    assert plan.counts[[0, 5, 10]].tolist() == [2, 4, 2]
    assert plan.worst.value == pytest.approx(0.25)
    assert "least deviance 0.25 at p = 0.5" in plan.headline()


@pytest.mark.slow
def test_a_certificate_is_about_the_list(tmp_path):
    """It holds for the problem of the design, which is that of the list."""
    path = tmp_path / "proof.json"
    design = edtk.relax(enzyme((0.2, 0.9)), certificate=path)
    assert edtk.verify(path, design.problem).valid
    assert len(design.problem.each) == len(design.worst.thetas)


def in_region(K, **options):
    """Michaelis and Menten's model over all doses up to one, with a range of K."""
    theta = {"V": 2.0, "K": K}
    return edtk.Region.of_model(ENZYME, theta, (0, 1), robust="maximin", **options)


def rivals_in_region(rival="p + q * x", **options):
    """A parabola that is told from a rival between -1 and 1."""
    return edtk.Region.of_rivals("a * x^2", {"a": 1.0}, rival, LINE, (-1, 1), **options)


@pytest.mark.slow
def test_a_narrow_range_in_a_region_has_the_design_of_two_points():
    """That of the first test, of which the dose is found; its bound over all doses is proved."""
    low, high = 0.5, 1.0
    a, b = (1 / np.sqrt(K * (K + 1)) for K in (low, high))
    dose = (high * b - low * a) / (a - b)
    efficiency = 4 * low * (low + 1) * dose * (1 - dose) / (low + dose) ** 2
    design = edtk.relax(in_region((low, high)), prove=1e-4)
    assert design.points.ravel() == pytest.approx([dose, 1.0], abs=1e-5)
    assert design.weights == pytest.approx([0.5, 0.5], abs=1e-5)
    assert design.worst.value == pytest.approx(efficiency, rel=1e-6)
    assert design.kind is BoundKind.PROVED
    assert efficiency <= 1 / design.bound * (1 + 1e-9)
    assert design.gap <= 1e-4


@pytest.mark.slow
def test_a_region_and_a_fine_grid_have_the_same_worst_theta():
    """Five hundred doses are as good as all of them; no K of a fine grid is worse than told."""
    design = edtk.relax(in_region((0.05, 2.0)))
    grid = edtk.relax(enzyme((0.05, 2.0), np.linspace(0, 1, 501)))
    assert design.worst.value == pytest.approx(grid.worst.value, rel=1e-4)
    K = np.linspace(0.05, 2.0, 2001)
    rows = np.stack(
        [design.points / (K + design.points), -2 * design.points / (K + design.points) ** 2],
        axis=-1,
    )
    M = np.einsum("n,nkp,nkq->kpq", design.weights, rows, rows)
    ideal = K / (2 * K + 1)
    best = ideal * (1 - ideal) / ((K + ideal) ** 2 * (K + 1) ** 2)
    least = (np.sqrt(np.linalg.det(M)) / best).min()
    assert least >= design.worst.value * (1 - 1e-6)
    assert design.worst.value == pytest.approx(1 / design.bound, rel=2e-5)


@pytest.mark.slow
def test_atkinson_and_fedorov_in_a_region():
    """Their first example without a grid: points and weights to the digits that they print."""
    limits = LINE | {"r": (-10, 10)}
    rivals = edtk.Region.of_rivals(
        "a + b * exp(x) + c * exp(-x)",
        {"a": 4.5, "b": -1.5, "c": -2.0},
        "p + q * x + r * x^2",
        limits,
        (-1, 1),
    )
    design = edtk.relax(rivals)
    assert design.points.ravel() == pytest.approx([-1, -0.669, 0.144, 0.957], abs=5e-4)
    assert design.weights == pytest.approx([0.253, 0.428, 0.247, 0.072], abs=6e-4)
    assert design.worst.value == pytest.approx(1.087e-3, abs=5e-7)


@pytest.mark.slow
def test_a_plan_in_a_region_tells_rivals():
    """Two, four and two experiments; where the model is linear the bound is proved, too."""
    plan = edtk.plan(rivals_in_region(), 8, prove_bound=1e-3)
    assert plan.points.ravel() == pytest.approx([-1, 0, 1], abs=1e-4)
    assert plan.counts.tolist() == [2, 4, 2]
    assert plan.worst.value == pytest.approx(0.25, rel=1e-6)
    assert plan.kind is BoundKind.PROVED
    assert "least deviance 0.25 at p = 0.5" in plan.headline()


def of_line(x=(0.0, 1.0, 2.0), **options):
    given = {"theta": {"a": 1.0}, "rival": "p + q * x", "rival_theta": LINE, "family": "normal"}
    return edtk.Problem.of_rivals("a * x^2", candidates=list(x), **(given | options))


@pytest.mark.slow
def test_a_rival_without_free_parameters_is_told_where_it_differs_most():
    """The deviance is linear in the weights, so that all experiments are at its largest value."""
    x = np.linspace(-1, 1, 21)
    rival = {"rival": "p + q * x", "rival_theta": {"p": 0.2, "q": 0.5}}
    options = {"theta": {"a": 2.0}, "sigma": 0.5} | rival
    most = np.square((2 * x**2 - 0.2 - 0.5 * x) / 0.5).max()
    design = edtk.relax(edtk.Problem.of_rivals("a * x^2", candidates=x, **options))
    assert 1 / design.cost == pytest.approx(most, rel=1e-9)
    assert x[design.weights > 0] == [-1.0]
    region = edtk.relax(edtk.Region.of_rivals("a * x^2", box=(-1, 1), **options))
    assert 1 / region.cost == pytest.approx(most, rel=1e-9)
    assert edtk.plan(edtk.Problem.of_rivals("a * x^2", candidates=x, **options), 3).counts[0] == 3


BAD = {
    "robust": (
        lambda: edtk.Problem.of_model(ENZYME, {"V": 1, "K": (1, 2)}, [1, 2]),
        r"^theta: has ranges; expected robust='maximin' beside them, or 'bayes'$",
    ),
    "weights of a mean": (
        lambda: edtk.Problem.of_model(
            ENZYME, {"V": 1, "K": (1, 2)}, [1, 2], robust="bayes", weights=[1]
        ),
        r"^weights: expected none beside ranges of theta, which count alike$",
    ),
    "too many": (
        lambda: edtk.Problem.of_model(
            " + ".join(f"{name} * x ^ {i}" for i, name in enumerate("abcdefg")),
            dict.fromkeys("abcdefg", (0, 1)),
            [1, 2],
            robust="bayes",
        ),
        r"^theta: has 7 ranges, too many for a mean; expected a list of theta$",
    ),
    "order": (lambda: enzyme((2, 1)), r"^theta: expected a number or \(low, high\), low below"),
    "three": (lambda: enzyme((1, 2, 3)), r"^theta: expected a number or \(low, high\)"),
    "prior": (lambda: enzyme((1, 2), prior=np.eye(2)), r"^prior: expected none beside ranges"),
    "weights": (lambda: enzyme((1, 2), weights=[1]), r"^weights: expected none beside ranges"),
    "not finite": (lambda: edtk.relax(enzyme((-1, 1))), r"^theta: at V = 2, K = -1 .* at x = 1$"),
    "region, not finite": (
        lambda: edtk.relax(in_region(K=(-1, 1))),
        r"^theta: at V = 2, K = -[0-9.]+ the model is not finite at x = [0-9.]+$",
    ),
    "region, same": (
        lambda: rivals_in_region("p + q * x^2"),
        r"^rival_theta: it is f at all points for p = .*, q = 1;",
    ),
    "blocks": (lambda: edtk.plan(enzyme((1, 2)), blocks=(3, 3)), r"^blocks: is not known beside"),
    "efficiency": (
        lambda: edtk.next(enzyme((1, 2)), [0], efficiency=0.9),
        r"^theta: has ranges, which edtk.relax and edtk.plan serve",
    ),
    "empty": (lambda: of_line(rival_theta={}), r"^rival_theta: expected a number or"),
    "itself": (
        lambda: of_line(rival="p * x^2", rival_theta={"p": 1}),
        r"^rival_theta: it is f at all points for p = 1; expected parameters without that$",
    ),
    "names": (lambda: of_line(rival_theta=[(0, 1)]), r"^rival_theta: expected a number or"),
    "rival": (lambda: of_line(rival="p + q * y"), r"^rival: the rival: f: 'p \+ q \* y' has 'y'"),
    "same": (
        lambda: of_line(rival="p + q * x^2"),
        r"^rival_theta: it is f at all points for",
    ),
    "sigma": (
        lambda: of_line(sigma=lambda x, t: x),
        r"^sigma: .*a function of x alone, which both",
    ),
    "mean": (
        lambda: edtk.relax(of_line(x=(1.0, 2.0), family="gamma", link="identity")),
        r"^rival.*gamma means are positive, and not at x = 1|^theta: at p = .* is not finite",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_ranges_are_refused_in_one_line(name):
    """The line names the argument, and theta where one of the ranges is at fault."""
    call, words = BAD[name]
    with pytest.raises(ArgumentError, match=words) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_theta_of_which_nothing_is_proved_have_equal_parts():
    """Multipliers of zero name no theta; all of the list then count alike."""
    dose = edtk.Region.of_model(
        ENZYME, {"V": 2.0, "K": (0.2, 1.0)}, {"x": (0, 1)}, robust="maximin"
    )
    found = edtk.relax(dose)
    nothing = replace(found, multipliers=0.0 * found.multipliers)
    ranges = _Ranges(dose.robust.box, None, "D", no_progress)
    thetas, parts = ranges.that_count(nothing)
    np.testing.assert_array_equal(thetas, found.worst.thetas)
    np.testing.assert_array_equal(parts, 1.0)


def test_a_list_without_efficiency_is_told_without_a_division_by_it(monkeypatch):
    """Where each theta has none, none is worse: the told number is zero."""
    monkeypatch.setattr(EfficiencyBox, "values", lambda self, thetas, *rest: np.zeros(len(thetas)))
    told = []
    ranges = _Ranges(enzyme((0.2, 1.0)).robust.box, None, "D", lambda *one: told.append(one))
    ranges.served(relax, [ranges.box.inside()])
    assert ("1 theta together", 0.0) in told
