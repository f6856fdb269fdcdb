"""Pictures of designs: each has the numbers of arithmetic done in another way."""

import itertools

import numpy as np
import pandas as pd
import pytest
from matplotlib import pyplot
from scipy.integrate import quad
from scipy.stats import chi2, norm, t

import edtk
from edtk.design.exact.model_design import ModelDesign
from edtk.system.errors import ArgumentError, UserError

pytestmark = pytest.mark.slow

X = np.linspace(-1.0, 1.0, 41)
PARABOLA = edtk.Problem(np.vander(X, 3)[:, None, :])
LEVELS = pd.DataFrame(itertools.product([-1.0, 1.0], repeat=5), columns=list("ABCDE"))
SCREEN = edtk.Problem.from_frame(LEVELS, "A + B + C + D + E")
ENZYME = edtk.Region.of_model("V * s / (K + s)", {"V": 2.0, "K": 1.0}, {"s": (0, 4)}, sigma=0.1)


class Hidden(edtk.criteria.Criterion):
    """A criterion that cannot be relaxed."""

    name = "hidden"
    title = "Hidden"
    formula = "trace(cov)"
    sense = "min"
    degree = 1.0

    def _cost(self, M, cov):
        return np.trace(cov, axis1=-2, axis2=-1)

    def _gradient(self, M, cov):
        return -cov @ cov


@pytest.fixture(scope="module")
def designs():
    """A design of each kind."""
    return {
        "plan": edtk.plan(PARABOLA, size=6, starts=2),
        "weights": edtk.relax(PARABOLA, "A"),
        "screen": edtk.plan(SCREEN, size=8, starts=4),
        "region": edtk.plan(ENZYME, size=5, starts=4),
        "relaxed": edtk.relax(ENZYME, "D"),
    }


@pytest.fixture(autouse=True)
def _closed():
    """No picture stays open."""
    yield
    pyplot.close("all")


def test_variance_over_a_factor_is_that_of_the_formula(designs):
    """The curve of a region is ``g' inv(M) g``, with the derivatives g of the model by hand."""
    plan = designs["region"]
    line = plan.plot(kind="variance").lines[0]
    s, shown = line.get_data()
    g = np.stack([s / (1 + s), -2 * s / (1 + s) ** 2], axis=-1) / 0.1
    p = plan.points[:, 0]
    rows = np.stack([p / (1 + p), -2 * p / (1 + p) ** 2], axis=-1) / 0.1
    cov = np.linalg.inv(rows.T @ (plan.counts[:, None] * rows))
    np.testing.assert_allclose(shown, np.einsum("ip,pq,iq->i", g, cov, g), rtol=1e-7)


def test_variance_over_a_frame_goes_between_its_rows(designs):
    """Between the levels of a screening design the variance is ``(1 + sum of squares) / 8``."""
    ax = designs["screen"].plot(kind="variance", factors="B", at={"A": 0.5})
    b, shown = ax.lines[0].get_data()
    np.testing.assert_allclose(shown, (1 + 0.25 + b**2) / 8, rtol=1e-12)
    assert ax.get_xlabel().endswith("\nat A = 0.5, C = 0, D = 0, E = 0")
    assert designs["screen"].plot(kind="variance", factors=("A", "E")).get_ylabel() == "E"


def test_variances_of_weights_are_those_of_one_experiment(designs):
    """Of arrays they are drawn over what is given for x, times the number of experiments."""
    found = designs["weights"]
    x, shown = found.plot(kind="variance", x=X).lines[0].get_data()
    cov = np.linalg.inv(PARABOLA.information(found.weights))
    rows = np.vander(x, 3)
    np.testing.assert_allclose(shown, np.einsum("ip,pq,iq->i", rows, cov, rows), rtol=1e-9)


@pytest.mark.parametrize(("name", "freedom"), [("screen", 2), ("region", 3)])
def test_power_is_that_of_the_t_test(designs, name, freedom):
    """It is the mean, over the estimate of the noise, of both tails of a normal estimate."""
    seen = ModelDesign.of(designs[name])
    deviations = np.sqrt(np.diag(seen.covariance))
    assert seen.freedom == freedom
    edge = t.isf(0.025, freedom)

    def both_tails(v, edge, shift):
        limit = edge * np.sqrt(v / freedom)
        return (norm.sf(limit - shift) + norm.cdf(-limit - shift)) * chi2.pdf(v, freedom)

    for line, deviation in zip(
        designs[name].plot(kind="power").lines, deviations[: seen.p], strict=True
    ):
        effect, power = line.get_data()
        shift = effect[60] / deviation
        mean, _ = quad(both_tails, 0, 99, args=(edge, shift), epsabs=1e-12, epsrel=1e-11)
        assert power[60] == pytest.approx(mean, abs=1e-9)


def test_parameters_of_one_power_share_a_name_in_the_legend(designs):
    """All six of an orthogonal design have one curve; both of an enzyme's have their own."""
    texts = {
        name: [text.get_text() for text in designs[name].plot(kind="power").get_legend().texts]
        for name in ("screen", "region")
    }
    assert texts == {"screen": ["Intercept\nA\nB\nC\nD\nE"], "region": ["V", "K"]}


def test_power_without_freedom_takes_the_noise_for_known():
    """Three experiments of a parabola leave nothing for the noise: the test is that of Gauss."""
    seen = ModelDesign.of(edtk.plan(PARABOLA, size=3, starts=1))
    assert seen.freedom == 0
    deviation = np.sqrt(seen.covariance[0, 0])
    both = norm.sf(1.959963984540054 - 2 / deviation) + norm.cdf(-1.959963984540054 - 2 / deviation)
    assert seen.powers(np.array([2.0]))[0, 0] == pytest.approx(both, rel=1e-12)
    assert seen.powers(np.array([0.0]))[0, 0] == 0.05


def test_aliases_of_a_fraction_are_its_words(designs):
    """A quarter of 2^5 in eight runs: each product is a factor, another product, or nothing."""
    plan = designs["screen"]
    names, bias = ModelDesign.of(plan).aliases()
    runs = LEVELS.to_numpy()[plan.experiments]
    by_hand = np.stack(
        [
            [
                np.mean(column * runs[:, i] * runs[:, j])
                for i, j in itertools.combinations(range(5), 2)
            ]
            for column in [np.ones(8), *runs.T]
        ]
    )
    np.testing.assert_allclose(bias, by_hand, atol=1e-12)
    assert names[0] == "A B"
    told, sizes = ModelDesign.of(plan).correlations()
    assert told == (*"ABCDE", *names)
    np.testing.assert_allclose(np.abs(sizes[:5, 5:]), np.abs(by_hand[1:]), atol=1e-12)
    assert plan.plot(kind="correlation").images[0].get_array().shape == (15, 15)
    assert plan.plot(kind="alias").images[0].get_array().shape == (6, 10)


def test_terms_beyond_may_be_given(designs):
    """Beside a parabola at -1, 0 and 1 a cube looks like a slope."""
    _, bias = ModelDesign.of(designs["weights"]).aliases({"x^3": X**3})
    np.testing.assert_allclose(bias[:, 0], [0.0, 1.0, 0.0], atol=1e-6)
    _, of_region = ModelDesign.of(designs["region"]).aliases(lambda s: s**0)
    assert of_region.shape == (2, 1)


def test_products_with_a_factor_are_beyond_a_model_of_main_effects():
    """Each level but the first has its products, and a text that is in no model has none."""
    runs = edtk.candidates.full_factorial({"x": [-1.0, 1.0], "z": [-1.0, 1.0], "oven": [*"lrt"]})
    labelled = runs.assign(label=[f"run {i}" for i in runs.index])
    problem = edtk.Problem.from_frame(labelled, "x * z + oven")
    plan = edtk.plan(problem, size=8, starts=4)
    names, bias = ModelDesign.of(plan).aliases()
    assert names == ("x oven[r]", "x oven[t]", "z oven[r]", "z oven[t]")
    X = problem.factors(plan.experiments)[:, 0]
    chosen = runs.iloc[plan.experiments]
    Z = chosen[["x"]].to_numpy() * (chosen[["oven"]].to_numpy() == ["r", "t"])
    np.testing.assert_allclose(bias[:, :2], np.linalg.lstsq(X, Z, rcond=None)[0], atol=1e-12)
    assert plan.plot(kind="alias").images[0].get_array().shape == (6, 4)


@pytest.mark.parametrize("sigma", [0.1, np.linspace(0.1, 3, len(X))])
def test_a_bias_is_in_units_of_its_term_whatever_the_noise(sigma):
    """Weighted least squares of the term itself, where sigma is not one."""
    columns = np.stack([X**0, X, X**2], axis=-1)
    plan = edtk.plan(edtk.Problem(columns[:, None, :], sigma=sigma), size=5, starts=4)
    weights = np.sqrt(plan.counts)[:, None] / np.reshape(sigma, (-1, 1))
    expected = np.linalg.lstsq(weights * columns, weights * X[:, None] ** 3, rcond=None)[0]
    found = ModelDesign.of(plan).aliases({"x^3": X**3})[1]
    np.testing.assert_allclose(found, expected, atol=1e-9)
    names, own = ModelDesign.of(plan).aliases()
    assert names == ("k2 k3",)
    np.testing.assert_allclose(own, expected, atol=1e-9)


def test_a_bias_over_a_region_is_in_units_of_its_term():
    """A cube beside a parabola is a slope, whatever the noise."""
    region = edtk.Region(lambda x: [1, x, x**2], -1, 1, sigma=0.1)
    _, bias = ModelDesign.of(edtk.relax(region)).aliases(lambda x: x**3)
    np.testing.assert_allclose(bias[:, 0], [0, 1, 0], atol=1e-6)


@pytest.fixture(scope="module")
def split():
    """A split plot: four whole plots with one temperature each."""
    levels = {"temp": [-1, 0, 1], "A": [-1, 1], "cat": [*"xyz"]}
    problem = edtk.Problem.from_frame(
        edtk.candidates.full_factorial(levels), "temp * A + I(temp**2) + cat"
    )
    errors = edtk.Errors.split_plot(["temp"], whole_plots=4, variance=1.0)
    return edtk.plan(problem, size=12, errors=errors, starts=2)


def test_split_plots_are_compared_by_experiment(split):
    """Twice as many runs in twice as many plots are about as good, and not twice."""
    again = edtk.Errors.split_plot(["temp"], whole_plots=8, variance=1.0)
    twice = edtk.plan(split.problem, size=24, errors=again, starts=2)
    one = edtk.relax(split.problem)
    found = edtk.compare({"split": split, "twice": twice, "one": one}, criteria=["D", "A"])
    assert "by experiment, each under the errors of its own runs" in found.basis
    costs = [ModelDesign.of(one).cost(edtk.criteria.create("A")) for one in (split, twice, one)]
    per = np.array([12, 24, 1]) * costs
    np.testing.assert_allclose(found.efficiencies[:, 1], per.min() / per, rtol=1e-12)
    assert found.efficiencies[0].max() < 1
    assert found.efficiencies[0, 0] > 0.8 * found.efficiencies[1, 0]


def test_products_of_a_frame_are_of_what_the_formula_uses():
    """Levels are in their order, other columns may be of any kind, and there may be no product."""
    levels = itertools.product([-1.0, 1.0], ["low", "mid", "high"])
    frame = pd.DataFrame(levels, columns=["x", "dose"]).assign(notes=[[1]] * 6)
    ordered = pd.Categorical(frame["dose"], ["low", "mid", "high"], ordered=True)
    problem = edtk.Problem.from_frame(frame.assign(dose=ordered), "x + dose")
    names, _ = ModelDesign.of(edtk.plan(problem, size=6, starts=1)).aliases()
    assert names == ("x dose[mid]", "x dose[high]")
    errors = edtk.Errors.split_plot(["x"], whole_plots=4, variance=1.0)
    whole = edtk.Problem.from_frame(frame.drop(columns="notes"), "x * dose")
    plan = edtk.plan(whole, size=12, errors=errors, starts=1)
    assert ModelDesign.of(plan).aliases()[1].shape == (6, 0)
    with pytest.raises(ArgumentError, match="leaves out no product"):
        plan.plot(kind="alias")


SURFACE = ("a + b * x + c * y + d * x * y", {"a": 1.0, "b": 0.5, "c": 0.3, "d": 0.2})


@pytest.mark.parametrize("kind", [edtk.Problem, edtk.Region])
@pytest.mark.parametrize(
    "options",
    [
        {"sigma": 0.5},
        {"sigma": lambda x: 1 + x[:, 0] ** 2},
        {"family": "poisson"},
        {"family": "binomial", "sigma": lambda x: 1 + x[:, 0] ** 2},
    ],
)
def test_a_column_of_a_nonlinear_model_is_its_own_alias(kind, options):
    """Whatever weighs its rows, and no product of its variables is beyond it."""
    grid = pd.DataFrame(itertools.product(np.linspace(-1, 1, 5), repeat=2), columns=["x", "y"])
    where = grid if kind is edtk.Problem else {"x": (-1, 1), "y": (-1, 1)}
    seen = ModelDesign.of(edtk.relax(kind.of_model(*SURFACE, where, **options)))
    product = lambda x: (x[:, 0] * x[:, 1])[:, None]  # noqa: E731
    beyond = {"xy": product(grid.to_numpy())[:, 0]} if kind is edtk.Problem else product
    np.testing.assert_allclose(seen.aliases(beyond)[1][:, 0], [0, 0, 0, 1], atol=1e-9)
    assert seen.aliases()[0] == ()


def test_terms_keep_the_noise_beside_a_prior():
    """And have none where the noise tells about theta itself, or models are several."""
    columns = np.stack([np.ones(41), X], axis=-1)[:, None]
    sigma = np.linspace(0.1, 1, 41)
    told = [
        ModelDesign.of(edtk.relax(problem)).aliases({"x": X})[1][:, 0]
        for problem in (
            edtk.Problem(columns, sigma=sigma),
            edtk.Problem(columns, sigma=sigma).with_prior(1e-12 * np.eye(2)),
        )
    ]
    np.testing.assert_allclose(told, [[0, 1]] * 2, atol=1e-9)
    of_theta = edtk.Problem.of_model(
        "a + b * x", {"a": 1.0, "b": 0.5}, X, sigma=lambda x, t: t[0] + x[:, 0] ** 2
    )
    both = edtk.several_models([edtk.Problem(columns, sigma=0.1)] * 2)
    for problem in (of_theta, both):
        with pytest.raises(UserError, match="terms beyond a model have no rows where"):
            edtk.relax(problem).plot(kind="alias")


def test_a_term_of_the_model_is_its_own_alias_in_a_split_plot(split):
    """Generalised least squares of a column of the model finds it, and nothing else."""
    column = split.problem.frame.temp.to_numpy()
    _, bias = ModelDesign.of(split).aliases({"temp": column})
    own = [float(name == "temp") for name in split.problem.parameters]
    np.testing.assert_allclose(bias[:, 0], own, atol=1e-9)


def test_a_split_plot_is_not_held_against_bounds_of_independent_errors(split):
    """Its own bound says 95 %; that of independent runs would say 51."""
    with pytest.raises(UserError, match="a bound of the plan's own criterion alone"):
        split.plot(kind="efficiencies")
    found = edtk.compare([split])
    assert (found.efficiencies == 1).all()
    assert found.basis.startswith("of the best of these designs by experiment")
    assert found.headline().startswith("1 design under 6 criteria")


def test_variances_of_a_mixture_are_of_mixtures():
    """The third share is what two leave of one; where nothing is left there is no prediction."""
    shares = edtk.candidates.simplex_lattice(3, 3)
    plan = edtk.plan(edtk.Problem.from_frame(shares, "0 + A + B + C + A:B"), size=8, starts=2)
    axes = plan.plot(kind="variance", factors=("A", "B"))
    assert axes.get_xlabel().endswith("at C as the others leave room")
    corner = edtk.criteria.create("c", c=[0, 0, 1, 0]).cost(plan.problem.information(plan.counts))
    line = plan.plot(kind="variance", factors="A", at={"B": 0.0}).lines[0]
    assert line.get_ydata()[0] == pytest.approx(corner, rel=1e-9)
    beyond = plan.plot(kind="variance", factors="A", at={"B": 0.5}).lines[0]
    x, y = beyond.get_data()
    assert (np.isnan(y) == (x > 0.5 + 1e-9)).all()


def test_columns_that_no_model_uses_move_nothing():
    """A number of runs, names that are no texts and a block of one value leave the curve alone."""
    grid = pd.DataFrame(itertools.product([-1.0, 0.0, 1.0], repeat=2), columns=["a", "b"])
    more = grid.assign(run=range(9), block=1, notes=[[1]] * 9)
    more[7] = 1.0
    for factors in ("a", ("a", "b")):
        shown = []
        for frame in (grid, more):
            problem = edtk.Problem.from_frame(frame, "a * b + I(a**2)")
            axes = edtk.plan(problem, size=8, starts=1).plot(kind="variance", factors=factors)
            assert "room" not in axes.get_xlabel()
            drawn = axes.lines[0].get_ydata() if factors == "a" else axes.collections[0].levels
            shown.append(drawn)
        np.testing.assert_array_equal(*shown)


def test_two_shares_that_determine_each_other_have_no_map():
    """One has a curve; of a third that is held two are left with no room of their own."""
    share = np.linspace(0, 1, 11)
    two = pd.DataFrame({"d": share, "e": 1 - share})
    plan = edtk.plan(edtk.Problem.from_frame(two, "0 + d + e + d:e"), size=8, starts=1)
    with pytest.raises(ArgumentError, match="d and e cannot be chosen freely, as"):
        plan.plot(kind="variance")
    assert np.isfinite(plan.plot(kind="variance", factors="d").lines[0].get_ydata()).all()
    both = edtk.candidates.simplex_lattice(3, 3).merge(two.iloc[::5], how="cross")
    plan = edtk.plan(edtk.Problem.from_frame(both, "0 + A + B + C + d:A + e:B"), size=9, starts=1)
    for factors, at in ((("d", "e"), {}), (("A", "B"), {"C": 0.2}), ("A", {"B": 0.2, "C": 0.2})):
        with pytest.raises(ArgumentError, match="cannot be chosen freely"):
            plan.plot(kind="variance", factors=factors, at=at)
    with pytest.raises(ArgumentError, match="leave no room"):
        plan.plot(kind="variance", factors="A", at={"d": 0.9, "e": 0.9})


def test_a_model_is_asked_inside_of_a_mixture_only():
    """A logarithm of the share that is left is nothing where none is."""
    shares = edtk.candidates.simplex_lattice(3, 10)
    problem = edtk.Problem.from_frame(shares[shares["C"] >= 0.1], "0 + A + B + C + np.log(C)")
    axes = edtk.plan(problem, size=8, starts=1).plot(kind="variance", factors=("A", "B"))
    assert np.isfinite(axes.collections[0].levels).all()


def test_a_factor_of_numbers_is_held_at_a_level():
    """Between its levels a formula knows nothing."""
    frame = pd.DataFrame({"k": [1, 2, 4] * 4, "x": np.linspace(0, 1, 12)})
    plan = edtk.plan(edtk.Problem.from_frame(frame, "C(k) + x"), size=8, starts=1)
    assert plan.plot(kind="variance").get_xlabel().endswith("at k = 1")
    with pytest.raises(ArgumentError, match="expected one or two of x"):
        plan.plot(kind="variance", factors="k")


def test_efficiencies_are_bounds_over_costs(designs):
    """Of a plan under D, A and the largest variance: against relaxations and Kiefer's p."""
    plan = designs["plan"]
    seen = ModelDesign.of(plan)
    told = {name: seen.efficiency(one) for name, one in seen.other_criteria().items()}
    cov = np.linalg.inv(PARABOLA.information(plan.counts))
    assert told["D"] == pytest.approx(plan.efficiency, rel=1e-9)
    assert told["A"] == pytest.approx(edtk.relax(PARABOLA, "A").bound / 6 / np.trace(cov), rel=1e-9)
    rows = np.vander(X, 3)
    largest = np.einsum("ip,pq,iq->i", rows, cov, rows).max()
    assert told["prediction_G"] == pytest.approx(3 / 6 / largest, rel=1e-9)
    bars = plan.plot(kind="efficiencies", criteria=["A", "E"]).patches
    assert bars[0].get_width() == pytest.approx(100 * told["A"])
    assert [name for name, e in told.items() if not 0 < e <= 1 + 1e-9] == []


def test_the_curve_over_sizes_has_plans_above_bounds(designs):
    """For the cost: three experiments of D reach the bound, four do not."""
    for name in ("plan", "region", "weights"):
        bounds, values, *own = designs[name].plot(kind="sizes", sizes=[3, 4, 6]).lines
        sign = 1 if name == "weights" else -1
        assert (sign * values.get_ydata() >= sign * bounds.get_ydata() * (1 - sign * 1e-9)).all()
        assert len(own) == (name != "weights")
    kept = edtk.next(PARABOLA, [7, 7], 3, criterion="A")
    assert kept.plot(kind="sizes", sizes=[4, 5]).lines[1].get_ydata()[1] == pytest.approx(
        kept.value
    )


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("plan", {"kind": "pie"}, "kind pie: expected one of counts, fds, variance, power"),
        ("relaxed", {"kind": "pie"}, "kind pie: expected one of theorem, fds"),
        ("plan", {"kind": "fds", "factors": "x"}, "factors: this picture takes no further"),
        ("region", {"kind": "variance", "factors": "t"}, "factors t: expected one or two of s"),
        ("region", {"kind": "variance", "at": {"t": 1}}, "at t: expected values of s"),
        ("screen", {"kind": "variance", "at": {"t": 1}}, "at t: expected values of A, B"),
        ("plan", {"kind": "variance", "x": [1, 2]}, "x: expected one number or two for each of 41"),
        ("weights", {"kind": "power"}, "size: weights stand for a number"),
        ("plan", {"kind": "power", "parameters": ["z"]}, "parameters z: expected some of k1"),
        ("plan", {"kind": "power", "level": 2}, "level 2: expected between 0 and 1"),
        ("plan", {"kind": "alias", "beyond": [[1.0]]}, r"beyond: expected columns \(n, q\) of 41"),
        (
            "region",
            {"kind": "alias"},
            "beyond: the model leaves out no product",
        ),
        (
            "plan",
            {"kind": "efficiencies", "criteria": [Hidden()]},
            "criteria: hidden has no convex form",
        ),
        ("plan", {"kind": "sizes", "sizes": [0]}, "sizes 0: expected a whole number, 1 or more"),
    ],
)
def test_what_makes_no_sense_is_refused(designs, name, options, words):
    """One line names the argument."""
    with pytest.raises(ArgumentError, match=words):
        designs[name].plot(**options)


def test_blocks_have_no_such_pictures():
    """Their effects would have to be known."""
    slopes = edtk.Problem(np.stack([X, X**2], axis=-1)[:, None, :])
    plan = edtk.plan(slopes, blocks=(3, 3), starts=1)
    with pytest.raises(UserError, match="blocks and experiments kept elsewhere"):
        plan.plot(kind="fds")


def test_what_is_drawn_is_seen(designs):
    """Equal variances are below the frame, small biases are no zeros, candidates are whole."""
    corners = pd.DataFrame(itertools.product([-1.0, 1.0], repeat=3), columns=list("ABC"))
    problem = edtk.Problem.from_frame(corners, "A + B + C")
    alike = edtk.relax(problem)
    line = alike.plot(kind="fds")
    assert line.get_ylim()[1] > line.lines[0].get_ydata().max() * 1.05
    assert all(tick == round(tick) for tick in alike.plot().get_xticks())
    assert "area by weight" in designs["relaxed"].plot(kind="variance").get_xlabel()
    assert "area by number" in designs["region"].plot(kind="variance").get_xlabel()
    small = 1e-4 * corners.A.to_numpy() * corners.B.to_numpy() * corners.C.to_numpy()
    half = edtk.plan(problem, size=4, starts=4)
    cells = [text.get_text() for text in half.plot(kind="alias", beyond={"e": small}).texts]
    assert sorted(cells)[-1] in ("0.0001", "1e-04") or "-0.0001" in cells
    assert "0.00" not in cells
