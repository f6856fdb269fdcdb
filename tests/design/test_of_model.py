"""Problems and regions of nonlinear models: derivatives, families, several theta, bad models."""

import math
import time

import numpy as np
import pandas as pd
import pytest

import edtk
from edtk.design import user_model
from edtk.design.families import CLOSED, FAMILIES, LINKS, Response
from edtk.design.formula import DERIVATIVES, Formula
from edtk.design.information import side_by_side
from edtk.system.errors import ArgumentError, Note, UserError

DOSE = np.linspace(0.0, 4.0, 401)
ENZYME = "V * x / (K + x)"
AT = {"V": 2.0, "K": 1.0}


@pytest.mark.parametrize("name", DERIVATIVES)
def test_each_function_of_a_formula_has_its_derivative(name):
    """A complex step through numpy's own function says the same."""
    (formula,) = Formula.of_each([f"a + {name}(a * x / 3) ^ 2 * x"], ("a",))
    x = np.linspace(0.3, 1.2, 5)[:, None]
    theta = 1.3 + 1e-30j
    of_numpy = theta + getattr(np, name)(theta * x[:, 0] / 3) ** 2 * x[:, 0]
    slope = formula.gradient(x, np.array([1.3]))[0]
    np.testing.assert_allclose(slope, np.imag(of_numpy) / 1e-30, rtol=1e-13)


def test_a_formula_at_several_theta_is_that_at_each():
    """Rows of four models at once are those of each, of families and powers by theta, too."""
    formula = "a * x ^ b / (c + x) + pi - exp(-c)"
    thetas = np.random.default_rng(0).uniform(0.5, 2.0, (4, 3))
    x = np.linspace(0.1, 3.0, 7)
    options = {"parameters": ("a", "b", "c"), "family": "Poisson"}
    together = edtk.Region.of_model(formula, thetas, (0.1, 3.0), robust="bayes", **options)
    each = [edtk.Region.of_model(formula, theta, (0.1, 3.0), **options) for theta in thetas]
    expected = side_by_side([one.rows_at(x[:, None]) for one in each])
    np.testing.assert_allclose(together.rows_at(x[:, None]), expected, rtol=1e-14)


def test_powers_quotients_and_signs_of_a_formula():
    """Exponents may be parameters; the constant pi is known, and a caret is a power."""
    (formula,) = Formula.of_each(["-a ** 2 / x ^ b + pi * (a - b) * 3 - +x"], ("a", "b"), ("x",))
    x, a, b = np.array([0.5, 2.0]), 1.7, 0.6
    gradient = formula.gradient(x[:, None], np.array([a, b]))
    np.testing.assert_allclose(gradient[0], -2 * a / x**b + 3 * np.pi, rtol=1e-14)
    np.testing.assert_allclose(gradient[1], a**2 / x**b * np.log(x) - 3 * np.pi, rtol=1e-13)
    value = -(a**2) / x**b + np.pi * (a - b) * 3 - x
    np.testing.assert_allclose(formula(x[:, None], np.array([a, b])), value, rtol=1e-14)


def by_points(x, theta):
    return theta[0] * x[:, 0] / (theta[1] + x[:, 0])


def by_numbers(x, theta):
    return theta[0] * x / (theta[1] + x)


def by_one_point(x, theta):
    return theta[0] * x[0] / (theta[1] + x[0])


def by_mathematics(x, theta):
    """It takes floats alone, and so no complex step."""
    return math.exp(math.log(float(theta[0]))) * x / (float(theta[1]) + x)


def by_sizes(x, theta):
    """It takes complex numbers, and has a wrong derivative by them."""
    return np.abs(theta[0]) * x / (np.abs(theta[1]) + x)


@pytest.mark.parametrize("f", [by_points, by_numbers, by_one_point, by_mathematics, by_sizes])
def test_a_function_may_be_called_in_several_ways(f):
    """Points together or one by one, by complex steps or differences: the rows are the same."""
    problem = edtk.Problem.of_model(f, [2.0, 1.0], DOSE, parameters=("V", "K"))
    rows = np.stack([DOSE / (1 + DOSE), -2 * DOSE / (1 + DOSE) ** 2], axis=-1)
    exact = f not in (by_mathematics, by_sizes)
    np.testing.assert_allclose(problem.factors()[:, 0], rows, atol=1e-14 if exact else 1e-10)


def test_a_formula_and_its_gradient_are_the_function():
    """Rows of the formula, of a stated gradient and of sigma agree; results show the variables."""
    formula = edtk.Problem.of_model(ENZYME, AT, DOSE, sigma=0.1)
    stated = edtk.Problem.of_model(
        by_numbers,
        [2.0, 1.0],
        DOSE,
        sigma=0.1,
        gradient=lambda x, t: np.stack([x / (t[1] + x), -t[0] * x / (t[1] + x) ** 2], axis=-1),
    )
    np.testing.assert_allclose(formula.factors(), stated.factors(), rtol=1e-13)
    assert formula.parameters == ("V", "K")
    design = edtk.relax(formula, "D").to_frame()
    assert design["x"].tolist() == [0.67, 4.0]  # the optimum is at 2/3
    counts = edtk.plan(formula, size=4).to_frame()
    assert counts["count"].tolist() == [2, 2]


def test_columns_of_a_frame_are_the_variables_of_a_formula():
    """Their order is that of the frame, whatever the formula's is."""
    import pandas as pd

    frame = pd.DataFrame({"u": [1.0, 2.0, 3.0], "v": [0.5, 0.1, 0.9]})
    problem = edtk.Problem.of_model("a * v + b * u", {"a": 1.0, "b": 2.0}, frame)
    np.testing.assert_allclose(problem.factors()[:, 0], frame[["v", "u"]].to_numpy())


@pytest.mark.parametrize(("family", "link"), CLOSED)
def test_closed_weights_are_those_of_the_formula(family, link):
    """``mu'/sqrt(V)`` of mean and variance says the same."""
    eta = np.linspace(-6, 6, 25)
    mean, slope = LINKS[link].mean(eta), LINKS[link].slope(eta)
    variance = FAMILIES[family].variance(mean, LINKS[link].complement(eta))
    weights = Response.of(family, link).root_weights(eta)
    np.testing.assert_allclose(weights, slope / np.sqrt(variance), rtol=1e-12)


@pytest.mark.parametrize("name", LINKS)
def test_each_link_has_its_slope_and_complement(name):
    """The slope is that of differences, and mean and complement add up to one."""
    link = LINKS[name]
    eta = np.linspace(-2.0, 2.0, 9)
    eta = eta[eta != 0]
    step = 1e-6
    by_differences = (link.mean(eta + step) - link.mean(eta - step)) / (2 * step)
    np.testing.assert_allclose(link.slope(eta), by_differences, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(link.mean(eta) + link.complement(eta), 1.0, rtol=1e-14)


@pytest.mark.parametrize(
    ("family", "link", "expected"),
    [
        ("binomial", "logit", [-1.5434, 1.5434]),  # Atkinson, Donev and Tobias 2007, section 22.4
        ("binomial", "probit", [-1.1381, 1.1381]),
        ("binomial", "cloglog", [-1.3377, 0.9796]),
        ("Poisson", "log", [8.0, 10.0]),  # two below the largest: exp(x) (10 - x)^2
        ("gamma", "log", [-10.0, 10.0]),
    ],
)
def test_generalised_linear_models_have_their_textbook_optima(family, link, expected):
    """Half of the experiments at each of two points of a line."""
    region = edtk.Region.of_model("a + b * x", {"a": 0.0, "b": 1.0}, (-10, 10), family, link=link)
    design = edtk.relax(region, "D")
    np.testing.assert_allclose(design.points[:, 0], expected, atol=2e-4)
    np.testing.assert_allclose(design.weights, [0.5, 0.5], atol=1e-6)


def test_a_mean_is_a_predictor_by_the_identity():
    """A logistic mean with the identity tells as much as its predictor with the logit."""
    theta = {"a": 0.3, "b": 1.2}
    x = np.linspace(-3, 3, 21)
    predictor = edtk.Problem.of_model("a + b * x", theta, x, "binomial")
    mean = edtk.Problem.of_model("1 / (1 + exp(-a - b * x))", theta, x, "binomial", link="identity")
    np.testing.assert_allclose(mean.factors(), predictor.factors(), rtol=1e-12)


def test_noise_that_depends_on_theta_tells_of_it():
    """Fisher's information of N(a, s^2) is diag(1, 2)/s^2, and noise by x alone adds no row."""
    problem = edtk.Problem.of_model(
        lambda x, t: t[0] + 0 * x, [1.0, 0.5], [0.0, 1.0], sigma=lambda x, t: t[1] + 0 * x
    )
    np.testing.assert_allclose(problem.information([0.5, 0.5]), np.diag([4.0, 8.0]), rtol=1e-12)
    plain = edtk.Problem.of_model("a * x", {"a": 1.0}, [1.0, 2.0], sigma=lambda x, t: x)
    np.testing.assert_allclose(plain.factors(), np.ones((2, 1, 1)), rtol=1e-12)


def test_responses_with_a_covariance():
    """The information is ``J' C^-1 J``."""
    C = np.array([[1.0, 0.6], [0.6, 2.0]])
    problem = edtk.Problem.of_model(
        lambda x, t: np.stack([t[0] * x, t[1] * x**2], axis=-1),
        [1.0, 2.0],
        [1.0, 3.0],
        covariance=C,
    )
    J = np.diag([3.0, 9.0])
    np.testing.assert_allclose(problem.blocks()[1], J.T @ np.linalg.solve(C, J), rtol=1e-12)


THETAS = [[2.0, 0.5], [2.0, 1.0], [2.0, 2.0]]
WEIGHTS = np.array([0.2, 0.5, 0.3])


def informations(design):
    """Information (3, 2, 2) of a design under each theta."""
    x = DOSE[:, None]
    found = []
    for V, K in THETAS:
        rows = np.hstack([x / (K + x), -V * x / (K + x) ** 2])
        found.append(np.einsum("n,np,nq->pq", design.weights, rows, rows))
    return np.array(found)


def test_bayesian_d_is_the_mean_of_logarithms():
    """The cost is ``exp(-mean log det(M_j) / p)``, and the bound shows that it is the least."""
    problem = edtk.Problem.of_model(
        ENZYME, THETAS, DOSE, parameters=("V", "K"), robust="bayes", weights=WEIGHTS
    )
    design = edtk.relax(problem, "D")
    logarithms = np.linalg.slogdet(informations(design))[1]
    assert design.cost == pytest.approx(np.exp(-WEIGHTS @ logarithms / 2), rel=1e-9)
    assert design.gap < 1e-6


def test_bayesian_a_is_the_mean_of_traces():
    """So is c, of a combination."""
    problem = edtk.Problem.of_model(
        ENZYME, THETAS, DOSE, parameters=("V", "K"), robust="bayes", weights=WEIGHTS
    )
    design = edtk.relax(problem, "A")
    inverse = np.linalg.inv(informations(design))
    traces = np.trace(inverse, axis1=1, axis2=2)
    assert design.cost == pytest.approx(WEIGHTS @ traces, rel=1e-9)
    assert design.gap < 1e-6
    of_k = edtk.relax(problem, {"name": "c", "c": {"K": 1.0}})
    variances = np.linalg.inv(informations(of_k))[:, 1, 1]
    assert of_k.cost == pytest.approx(WEIGHTS @ variances, rel=1e-9)


def test_maximin_is_the_best_least_efficiency():
    """The value is one over the least of the efficiencies, each against its own optimum."""
    problem = edtk.Problem.of_model(ENZYME, THETAS, DOSE, parameters=("V", "K"), robust="maximin")
    design = edtk.relax(problem, "D")
    found = np.sqrt(np.linalg.det(informations(design)))
    best = [
        edtk.relax(edtk.Problem.of_model(ENZYME, t, DOSE, parameters=("V", "K")), "D").value
        for t in THETAS
    ]
    assert 1 / design.value == pytest.approx((found / best).min(), rel=1e-6)
    assert design.gap < 1e-6


@pytest.mark.slow
def test_a_region_takes_several_theta_too():
    """Its design is that of a fine list of candidates."""
    options = {"parameters": ("V", "K"), "robust": "bayes"}
    region = edtk.Region.of_model(ENZYME, THETAS, (0.0, 4.0), **options)
    listed = edtk.Problem.of_model(ENZYME, THETAS, DOSE, **options)
    assert edtk.relax(region, "D").cost == pytest.approx(edtk.relax(listed, "D").cost, rel=1e-4)


@pytest.mark.slow
def test_a_maximin_design_of_a_region_has_few_points():
    """Twelve theta of Hill's model: points that are close to each other become one."""
    thetas = [{"e": 1.0, "k": k, "h": h} for k in (0.5, 1, 2, 4) for h in (1, 2, 3)]
    hill = edtk.Region.of_model("e*x^h/(k^h+x^h)", thetas, (0.01, 10), robust="maximin")
    design = edtk.relax(hill, "D")
    assert len(design.points) == 6
    assert design.gap < 1e-7


@pytest.mark.slow
def test_the_bound_of_a_formula_is_proved():
    """Formulas run on intervals: the optimum of Michaelis and Menten over all doses."""
    region = edtk.Region.of_model(ENZYME, AT, {"x": (0.0, 4.0)})
    design = edtk.relax(region, "D", prove=1e-6)
    assert design.proved_bound.cost >= design.cost * (1 - 1e-6)
    np.testing.assert_allclose(design.points[:, 0], [2 / 3, 4], atol=1e-4)


NOISE = 0.1 + 0.05 * DOSE


@pytest.mark.parametrize(
    "sigma", [NOISE, lambda x: 0.1 + 0.05 * x, lambda x, t: 0.1 + 0.05 * x], ids=["n", "x", "both"]
)
def test_noise_of_candidates_scales_their_rows(sigma):
    """One sigma for each candidate, a function of x, or of both: rows over sigma."""
    noisy = edtk.Problem.of_model(ENZYME, AT, DOSE, sigma=sigma)
    plain = edtk.Problem.of_model(ENZYME, AT, DOSE)
    np.testing.assert_allclose(noisy.factors(), plain.factors() / NOISE[:, None, None], rtol=1e-14)


@pytest.mark.parametrize("sigma", [np.exp, np.vectorize(np.exp), np.vectorize(lambda x: np.exp(x))])
def test_noise_may_be_a_function_of_numpy(sigma):
    """It takes more than x, and needs no more; one that is vectorised needs what it is made of."""
    noisy = edtk.Problem.of_model(ENZYME, AT, DOSE, sigma=sigma)
    stated = edtk.Problem.of_model(ENZYME, AT, DOSE, sigma=np.exp(DOSE))
    np.testing.assert_allclose(noisy.factors(), stated.factors(), rtol=1e-12)


def test_as_many_numbers_as_responses_are_of_responses():
    """Also where there are as many candidates, as in a problem of arrays."""
    formulas = ["V * x / (K + x)", "V * x"]
    two = edtk.Problem.of_model(formulas, AT, [1.0, 2.0], sigma=[1.0, 2.0])
    three = edtk.Problem.of_model(formulas, AT, [1.0, 2.0, 3.0], sigma=[1.0, 2.0])
    np.testing.assert_array_equal(two.factors(), three.factors()[:2])


def test_noise_may_be_a_column_of_the_candidates():
    """It is no variable of the model then, and has to be there."""
    frame = pd.DataFrame({"s": NOISE, "x": DOSE})
    stated = edtk.Problem.of_model(ENZYME, AT, DOSE, sigma=NOISE)
    np.testing.assert_array_equal(
        edtk.Problem.of_model(ENZYME, AT, frame, sigma="s").factors(), stated.factors()
    )
    one = edtk.Problem.of_model(ENZYME, AT, frame.iloc[[9]], sigma="s")
    np.testing.assert_array_equal(one.factors(), stated.factors()[[9]])
    with pytest.raises(edtk.UserError, match=r"^sigma: 'noise' is no column"):
        edtk.Problem.of_model(ENZYME, AT, frame, sigma="noise")
    with pytest.raises(edtk.UserError, match=r"^candidates: column 'lot' has no numbers"):
        edtk.Problem.of_model(ENZYME, AT, frame.assign(lot="a"), sigma="s")


def test_noise_of_candidates_is_a_factor_of_a_familys_own():
    """Of shares of k trials it is 1/sqrt(k), which may differ; so it is of a list of theta."""
    x = np.linspace(-2, 2, 5)
    trials = np.array([1, 2, 3, 4, 5])
    options = {"family": "binomial", "sigma": 1 / np.sqrt(trials)}
    shares = edtk.Problem.of_model("a + b * x", {"a": 0.0, "b": 1.0}, x, **options)
    one = edtk.Problem.of_model("a + b * x", {"a": 0.0, "b": 1.0}, x, family="binomial")
    np.testing.assert_allclose(shares.blocks(), one.blocks() * trials[:, None, None], rtol=1e-14)
    thetas = [{"a": 0.0, "b": 1.0}, {"a": 0.5, "b": 1.0}]
    of_x = options | {"sigma": lambda x: 1 / np.sqrt(x + 3)}
    told = edtk.Problem.of_model("a + b * x", {"a": 0.0, "b": 1.0}, x, **of_x)
    np.testing.assert_allclose(told.blocks(), shares.blocks(), rtol=1e-14)
    several = edtk.Problem.of_model("a + b * x", thetas, x, robust="bayes", **options)
    np.testing.assert_allclose(several.blocks()[:, :2, :2], shares.blocks(), rtol=1e-14)


def test_a_list_of_formulas_is_a_function_of_several_responses():
    """As one that stacks them, with a covariance; parameters need not be in each of them."""
    formulas = ["a * exp(-k * x)", "b * (1 - exp(-k * x))"]
    theta = {"a": 1.0, "k": 0.5, "b": 2.0}
    C = [[1.0, 0.3], [0.3, 2.0]]

    def both(x, t):
        fall = np.exp(-t[1] * x)
        return np.stack([t[0] * fall, t[2] * (1 - fall)], axis=-1)

    told = edtk.Problem.of_model(formulas, theta, DOSE, covariance=C)
    expected = edtk.Problem.of_model(both, list(theta.values()), DOSE, covariance=C)
    np.testing.assert_allclose(told.factors(), expected.factors(), rtol=1e-12, atol=1e-14)
    region = edtk.Region.of_model(formulas, theta, (0, 4), covariance=C)
    x = DOSE[::50, None]
    np.testing.assert_allclose(region.rows_at(x), told.factors()[::50], rtol=1e-12, atol=1e-14)
    thetas = [theta, theta | {"k": 1.0}]
    several = edtk.Region.of_model(formulas, thetas, (0, 4), covariance=C, robust="bayes")
    np.testing.assert_allclose(several.rows_at(x)[:, :2, :3], region.rows_at(x), rtol=1e-12)


@pytest.mark.parametrize(
    "make",
    [
        lambda theta, **options: edtk.Problem.of_model(ENZYME, theta, DOSE[::20], **options),
        lambda theta, **options: edtk.Region.of_model(ENZYME, theta, (0, 4), **options),
    ],
    ids=["problem", "region"],
)
def test_predictions_of_several_theta_are_about_the_places_of_each(make):
    """I of a list: the mean of the variances, or the worst efficiency, of theta by theta."""
    thetas, weights = [{"V": 2.0, "K": K} for K in (0.5, 2.0)], np.array([0.3, 0.7])
    each = [edtk.relax(make(theta), "I") for theta in thetas]
    mean = edtk.relax(make(thetas, robust="bayes", weights=weights), "I")
    worst = edtk.relax(make(thetas, robust="maximin"), "I")

    def costs(design):
        places = design.points if hasattr(design, "points") else None
        blocks = [one.problem if places is None else one.region.problem(places) for one in each]
        costs = [
            one.criterion.cost(problem.information(design.weights))
            for one, problem in zip(each, blocks, strict=True)
        ]
        return np.array(costs)

    assert mean.value == pytest.approx(weights @ costs(mean), rel=1e-9)
    best = np.array([one.value for one in each])
    assert 1 / worst.value == pytest.approx((best / costs(worst)).min(), rel=1e-6)
    assert mean.value <= weights @ costs(worst)


BAD = {
    "not finite": (lambda x, t: t[0] / x, [1.0], {}, r"^f: the value is not finite at x = 0$"),
    "kink": (lambda x, t: abs(x - t[0]), [2.0], {}, r"^f: no derivative by 'k1' at x = 2"),
    "jump": (lambda x, t: (x > t[0]) * 1.0, [2.0], {}, r"^f: no derivative by 'k1' at x = "),
    "ignored": (lambda x, t: t[0] * x, [1.0, 2.0], {}, r"^f: .*depend on 'k2' at any point$"),
    "fails": (lambda x, t: t[7] * x, [1.0], {}, r"^f: fails for points and theta: index 7"),
    "complex": (lambda x, t: t[0] * x + 1j, [1.0], {}, r"^f: fails for .* values are complex;"),
    "random": (
        lambda x, t: t[0] * np.random.default_rng().normal(size=np.shape(x)),
        [1.0],
        {},
        r"^f: fails for .*: a point asked for again has another value$",
    ),
    "text": (lambda x, t: "a", [1.0], {}, r"^f: fails for .*expected numbers"),
    "raises at a point": (
        lambda x, t: t[0] * float(x) if x != 0.03 else [][0],
        [1.0],
        {},
        r"^f: fails at x = 0.03: list index out of range$",
    ),
    "raises": (lambda x, t: 1 / 0, [1.0], {}, r"^f: fails for .*division by zero"),
    "digits": (f"a * x * {'9' * 400}", {"a": 1.0}, {}, r"^f: .* is no formula: int too large"),
    "zero": ("a * x / 0", {"a": 1.0}, {}, r"^f: the value is not finite at x = 0"),
    "ragged": ("a * x", [[1.0], [1.0, 2.0]], {"robust": "bayes"}, r"^theta: expected as many"),
    "words": ("a * x", {"a": 1.0}, {"covariance": "C"}, r"^covariance: expected a matrix"),
    "missing": ("a * x", [{"a": 1.0}, {"b": 1.0}], {"robust": "bayes"}, r"^theta: has b; expected"),
    "code": ("__import__('os')", [1.0], {}, r"^f: .* is no formula: there is no function"),
    "attribute": ("a.real * x", {"a": 1.0}, {}, r"^f: .* no formula: expected numbers, names"),
    "variables": ("a * x * y", {"a": 1.0}, {}, r"^variables: 'a \* x \* y' has x, y beside"),
    "unused": (
        "a * x",
        {"a": 1.0, "b": 2.0},
        {},
        r"^parameters: 'a \* x' has no parameter 'b'; it has a, x$",
    ),
    "names": ("a * x", [1.0], {"parameters": ("a", "b")}, r"^parameters: a, b; expected 1"),
    "theta": ("a * x", {"a": np.nan}, {}, r"^theta: expected a finite number"),
    "family": ("a * x", {"a": 1.0}, {"family": "beta"}, r"^family beta: expected one of normal"),
    "link": ("a * x", {"a": 1.0}, {"link": "logit"}, r"^link logit: expected one of identity"),
    "mean": ("a * x", {"a": 1.0}, {"family": "gamma", "link": "identity"}, r"at x = 0$"),
    "sigma": ("a * x", {"a": 1.0}, {"sigma": -1.0}, r"^sigma: expected a positive number"),
    "sigmas": ("a * x", {"a": 1.0}, {"sigma": [1, 2, 3]}, r"; noise of points is a function of x"),
    "list": (["a * x", 3], {"a": 1.0}, {}, r"^f 2: expected text, not int$"),
    "noise of theta": (
        "a * x",
        {"a": 1.0},
        {"sigma": lambda x, t: 1 + t[0] * x, "family": "Poisson"},
        r"^sigma: a function is for responses without a covariance, of theta for normal ones$",
    ),
    "empty": ([], {"a": 1.0}, {}, r"^f: expected a function, a formula, or a list of formulas$"),
    "short": ("a * x", {"a": 1.0}, {"sigma": np.ones(7)}, r"^sigma: expected a positive number"),
    "two columns": (
        "a * x",
        {"a": 1.0},
        {"sigma": lambda x: np.ones((len(x), 2))},
        r"^sigma: has 2 values at a point; expected one, or one for each of 1 responses$",
    ),
    "no column": ("a * x", {"a": 1.0}, {"sigma": "s"}, r"^sigma: expected numbers or a function"),
    "no theta": ("x", {}, {}, r"^theta: .*, of which there is one at least$"),
    "noise": ("a * x", {"a": 1.0}, {"sigma": lambda x, t: x}, r"^sigma: is not positive at x = 0"),
    "shape": ("a * x", {"a": 1.0}, {"covariance": np.eye(2)}, r"^covariance: expected a symm"),
    "several": ("a * x", [[1.0], [2.0]], {"parameters": ("a",)}, r"^theta: several of them"),
    "single": ("a * x", {"a": 1.0}, {"robust": "bayes"}, r"^theta: expected a list"),
    "robust": ("a * x", {"a": 1.0}, {"robust": "worst"}, r"^robust worst: expected bayes or"),
    "gradient": (
        by_numbers,
        [2.0, 1.0],
        {"gradient": lambda x, t: np.ones((len(x), 2))},
        r"^gradient: it is not the derivative of f",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_model_is_refused_in_one_line(name):
    """The line names the argument, and where there are any the point and the parameter."""
    f, theta, options, words = BAD[name]
    with pytest.raises(ArgumentError, match=words) as caught:
        edtk.Problem.of_model(f, theta, DOSE, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("make", [edtk.Problem.of_model, edtk.Region.of_model])
@pytest.mark.parametrize("prior", [np.eye(3), [1.0, 2.0], 1.0, -np.eye(2), [[1, 1], [0, 1]], "a"])
def test_a_bad_prior_is_refused_in_one_line(make, prior):
    """Of a wrong shape, of no information, or no numbers."""
    with pytest.raises(UserError, match=r"prior.* must be|prior: expected numbers") as caught:
        make(ENZYME, AT, (0.0, 4.0), prior=prior)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("theta", [(0.0, 1e12), (1e12, 1e-12), (1e12, 0.0), (0.0, 0.0)])
@pytest.mark.parametrize("number", [float, lambda value: value], ids=["differences", "complex"])
def test_sizes_of_theta_that_are_far_apart(theta, number):
    """A line has its two columns, whatever its parameters are: by differences and by complex steps.

    Steps of 1e-12 beside 1e12 change no digit; then a step of another size tells the derivative.
    """

    def line(x, t):
        return number(t[0]) + number(t[1]) * x

    problem = edtk.Problem.of_model(line, theta, DOSE)
    rows = np.stack([np.ones_like(DOSE), DOSE], axis=-1)
    np.testing.assert_allclose(problem.factors()[:, 0], rows, atol=1e-9)


@pytest.mark.parametrize("number", [float, lambda value: value], ids=["differences", "complex"])
def test_a_zero_beside_a_large_parameter(number):
    """Decay that begins with a rate of zero: steps of the other parameter's size would overflow."""

    def decay(x, t):
        return number(t[1]) * np.exp(-number(t[0]) * x)

    problem = edtk.Problem.of_model(decay, (0.0, 1e12), DOSE)
    rows = np.stack([-1e12 * DOSE, np.ones_like(DOSE)], axis=-1)
    np.testing.assert_allclose(problem.factors()[:, 0], rows, rtol=1e-9, atol=1e-9)


def test_constraints_of_a_region_are_functions() -> None:
    """A number in their place is one line that names the argument."""
    with pytest.raises(ArgumentError, match=r"^constraints: expected a function of points"):
        edtk.Region.of_model("a * x", {"a": 1.0}, {"x": (0, 1)}, constraints=3)  # type: ignore[arg-type]


def test_a_criterion_without_a_mean_is_refused():
    """E has no mean over several theta that is bounded."""
    problem = edtk.Problem.of_model(ENZYME, THETAS, DOSE, parameters=("V", "K"), robust="bayes")
    with pytest.raises(
        ArgumentError, match=r"criterion: the mean over several theta is known of D"
    ):
        edtk.relax(problem, "E")


def test_a_slow_model_is_told(monkeypatch):
    """One line says how long a point takes."""
    monkeypatch.setattr(user_model, "SLOW_MODEL", 1.0)

    def slow(x, theta):
        time.sleep(0.002 * len(x))
        return theta[0] * x

    with pytest.warns(Note, match=r"f: the model takes .* s a point"):
        edtk.Problem.of_model(slow, [1.0], [1.0, 2.0, 3.0])


def test_a_power_of_zero_has_a_derivative_by_its_exponent():
    """It is zero, so that the Hill model takes the dose 0."""
    theta = {"top": 2.0, "half": 1.5, "h": 2.5}
    hill = edtk.Problem.of_model("top * x^h / (half^h + x^h)", theta, DOSE)
    assert DOSE[0] == 0
    assert not hill.factors()[0].any()


def test_names_of_theta_count_and_not_their_order():
    """Beside parameters in another order, and in a list of several theta."""
    f, theta = "a * exp(-b * x)", {"a": 3.0, "b": 0.5}
    turned = dict(reversed(theta.items()))
    own = edtk.Problem.of_model(f, theta, DOSE).factors()
    other = edtk.Problem.of_model(f, theta, DOSE, parameters=("b", "a")).factors()
    np.testing.assert_allclose(other, own[..., ::-1], rtol=1e-15)
    both = edtk.Problem.of_model(f, [theta, turned], DOSE, robust="bayes")
    first, second = both.robust.models
    assert first.parameters == second.parameters
    np.testing.assert_array_equal(first.factors(), second.factors())


@pytest.mark.parametrize(
    ("make", "sites"), [(edtk.Problem.of_model, DOSE), (edtk.Region.of_model, (0.0, 4.0))]
)
def test_a_mean_over_ranges_is_that_of_a_uniform_prior(make, sites):
    """``det^(1/2)`` grows as V, whose logarithm has the mean ``2 log 2 - 1`` from one to two."""
    alone = edtk.relax(make(ENZYME, {"V": 1.0, "K": 1.0}, sites))
    mean = edtk.relax(make(ENZYME, {"K": 1.0, "V": (1, 2)}, sites, robust="bayes"))
    assert 1 / (mean.value * alone.value) == pytest.approx(4 / np.e, rel=1e-9)


@pytest.mark.slow
def test_a_mean_over_two_ranges_is_that_of_many_theta():
    """A product of rules agrees with another one of twice as many nodes a range."""
    ranges = {"V": (1.0, 2.0), "K": (0.5, 2.0)}
    found = edtk.relax(edtk.Problem.of_model(ENZYME, ranges, DOSE, robust="bayes"))
    x, w = np.polynomial.legendre.leggauss(16)
    theta = [(1.5 + a / 2, 1.25 + 0.75 * b) for a in x for b in x]
    weights = np.outer(w, w).ravel()
    rows = [np.stack([DOSE / (k + DOSE), -v * DOSE / (k + DOSE) ** 2], -1) for v, k in theta]
    M = [np.einsum("n,ni,nj->ij", found.weights, one, one) for one in rows]
    value = np.exp(weights @ np.linalg.slogdet(M).logabsdet / 4 / 2)
    assert found.value == pytest.approx(1 / value, rel=1e-6)
