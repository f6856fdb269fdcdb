"""Plans of runs whose errors hang together: brute force, published cases, bounds, wrong input."""

from itertools import combinations_with_replacement, product

import mpmath
import numpy as np
import pandas as pd
import pytest

import edtk
from criteria.linalg.inverse import EPS
from edtk.design.exact.arranged.arranged_search import MOVE_SWEEPS, ArrangedSearch
from edtk.design.problem import RankDeficientError
from edtk.system.errors import UserError

pytestmark = pytest.mark.slow

LEVELS = [-1.0, 0.0, 1.0]
FRAME = pd.DataFrame(list(product(LEVELS, LEVELS)), columns=["w", "s"])
FULL = "1 + w + s + w:s + I(w**2) + I(s**2)"
Errors = edtk.Errors


def quadratic() -> edtk.Problem:
    """A full quadratic of two factors at three levels."""
    return edtk.Problem.from_frame(FRAME, FULL)


def line() -> edtk.Problem:
    """A straight line of five places."""
    return edtk.Problem.from_frame(pd.DataFrame({"x": np.linspace(-1, 1, 5)}), "1 + x")


def dense(plan: edtk.ArrangedPlan, V: np.ndarray, N: np.ndarray | None = None) -> np.ndarray:
    """Information of generalised least squares, with nuisance N as more parameters."""
    X = plan.problem.factors(plan.places)[:, 0]
    p = X.shape[1]
    if N is None:
        return X.T @ np.linalg.solve(V, X)
    whole = np.hstack([X, N])
    cov = np.linalg.inv(whole.T @ np.linalg.solve(V, whole))
    return np.linalg.inv(cov[:p, :p])


def grouped(m: int, number: int) -> np.ndarray:
    """Covariance of m runs in equal groups of variance one."""
    labels = np.repeat(np.arange(number), m // number)
    return np.eye(m) + (labels[:, None] == labels)


@pytest.mark.parametrize("criterion", ["D", "A", "E"])
def test_split_plot_is_the_best_of_all(criterion: str) -> None:
    """Of two whole plots of two runs all arrangements are tried, and none is better or bounded."""
    frame = pd.DataFrame(list(product([-1.0, 1.0], LEVELS)), columns=["w", "s"])
    problem = edtk.Problem.from_frame(frame, "1 + s + w:s")
    plan = edtk.plan(problem, 4, criterion, errors=Errors.split_plot("w", 2, 0.7))
    labels = np.repeat([0, 1], 2)
    V = np.eye(4) + 0.7 * (labels[:, None] == labels)
    rows = problem.factors()[:, 0]
    own = [list(combinations_with_replacement(np.flatnonzero(frame.w == w), 2)) for w in (-1, 1)]
    blocks = [*own[0], *own[1]]
    X = np.array([rows[[*a, *b]] for a in blocks for b in blocks])
    costs = plan.criterion.cost(np.swapaxes(X, 1, 2) @ np.linalg.inv(V) @ X)
    assert plan.cost == pytest.approx(costs.min(), rel=1e-9)
    assert plan.lower_bound.cost <= plan.cost * (1 + 1e-12)


@pytest.mark.parametrize(
    ("errors", "V", "N"),
    [
        (
            Errors.autoregressive(0.5),
            0.5 ** np.abs(np.subtract.outer(np.arange(5), np.arange(5))),
            None,
        ),
        (Errors.trend(1), np.eye(5), np.arange(-2.0, 3.0)[:, None]),
        (
            Errors.spatial([0, 1, 3, 4, 7], 2.0, nugget=0.25),
            0.25 * np.eye(5)
            + 0.75 * np.exp(-np.abs(np.subtract.outer([0, 1, 3, 4, 7], [0, 1, 3, 4, 7])) / 2),
            None,
        ),
    ],
    ids=["series", "trend", "places"],
)
def test_an_order_is_the_best_of_all(
    errors: edtk.Errors, V: np.ndarray, N: np.ndarray | None
) -> None:
    """Of five runs of a line all orders are tried: the plan is the best, the bound is below."""
    plan = edtk.plan(line(), 5, "D", errors=errors)
    rows = plan.problem.factors()[:, 0]
    X = rows[np.array(list(product(range(5), repeat=5)))]
    W = np.linalg.inv(V)
    if N is not None:
        W = W - W @ N @ np.linalg.solve(N.T @ W @ N, N.T @ W)
    best = np.linalg.det(np.swapaxes(X, 1, 2) @ W @ X).max() ** 0.5
    assert plan.value == pytest.approx(best, rel=1e-9)
    assert plan.bound >= best * (1 - 1e-9)
    np.testing.assert_allclose(plan.information, dense(plan, V, N), atol=1e-9)


def test_series_that_has_begun_goes_on_best() -> None:
    """Beside two runs that are made, and with two of each at most, all orders are tried."""
    problem = line()
    plan = edtk.plan(problem, 6, "A", errors=Errors.autoregressive(0.5), keep=[2, 0], most=2)
    rows = problem.factors()[:, 0]
    orders = np.array([(2, 0, *rest) for rest in product(range(5), repeat=4)])
    counts = (orders[:, :, None] == np.arange(5)).sum(axis=1)
    orders = orders[(counts <= 2).all(axis=1)]
    V = 0.5 ** np.abs(np.subtract.outer(np.arange(6), np.arange(6)))
    X = rows[orders]
    best = plan.criterion.cost(np.swapaxes(X, 1, 2) @ np.linalg.inv(V) @ X).min()
    assert plan.cost == pytest.approx(best, rel=1e-9)
    assert plan.places[:2].tolist() == [2, 0]
    assert plan.counts.max() == 2
    assert plan.kept.tolist() == [1, 0, 1, 0, 0]
    assert plan.basis.endswith("; kept runs and largest counts set aside")


def test_whole_plots_that_are_made_keep_their_setting() -> None:
    """A whole plot that has begun goes on with its oven, and is within what each may be used."""
    problem = quadratic()
    errors = Errors.split_plot("w", 4)
    plan = edtk.plan(problem, 12, errors=errors, keep=[0, 1, 2, 3], most=2, starts=24)
    assert plan.places[:4].tolist() == [0, 1, 2, 3]
    assert plan.to_frame().groupby("whole plot").w.nunique().eq(1).all()
    assert plan.counts.max() == 2
    free = edtk.plan(problem, 12, errors=errors, starts=24)
    assert plan.value <= free.value * (1 + 1e-12)


WRONG_RUNS = {
    "two settings": ({"keep": [0, 3]}, "runs 1 and 2 are of one group with different settings"),
    "all made": ({"keep": [0] * 12}, "12 runs are made, expected fewer than 12"),
    "too few": ({"most": 1}, "allows 9 more runs, expected 12 or more"),
    "others": ({"keep": quadratic()}, "expected the candidates of the first runs in order"),
    "least": ({"least": 1}, "not for plans with a structure of errors"),
    "constraints": ({"constraints": []}, "not for plans with a structure of errors"),
}


@pytest.mark.parametrize("case", sorted(WRONG_RUNS))
def test_runs_that_do_not_fit_are_named(case: str) -> None:
    """One line says which runs, or which option, do not go with the structure."""
    options, words = WRONG_RUNS[case]
    with pytest.raises(UserError) as error:
        edtk.plan(quadratic(), 12, errors=Errors.split_plot("w", 4), **options)
    assert words in str(error.value)


def test_bound_of_series_is_near() -> None:
    """Mixtures of sequences bound the plans of an AR(1) series far below what independence says."""
    plan = edtk.plan(quadratic(), 12, "D", errors=Errors.autoregressive(0.5), starts=48)
    assert plan.efficiency > 0.95
    assert plan.basis == "mixtures of sequences"


def test_whole_plots_keep_their_setting() -> None:
    """In each whole plot the hard factor has one setting; the table has runs in order."""
    plan = edtk.plan(quadratic(), 12, "D", errors=Errors.split_plot("w", 4), starts=24)
    table = plan.to_frame()
    assert (table.groupby("whole plot").w.nunique() == 1).all()
    assert list(table.columns) == ["whole plot", "w", "s"]
    assert table.index.tolist() == list(range(1, 13))
    np.testing.assert_allclose(plan.information, dense(plan, grouped(12, 4)), atol=1e-9)
    assert plan.value == pytest.approx(np.linalg.det(plan.information) ** (1 / 6))
    assert 0.96 < plan.efficiency < 1
    assert "whole plot" in plan.summary()
    again = edtk.plan(quadratic(), 12, "D", errors=Errors.split_plot("w", 4), starts=24)
    assert (again.places == plan.places).all()


def test_strips_keep_both_settings() -> None:
    """In a strip plot rows keep one factor, and columns the other one."""
    plan = edtk.plan(quadratic(), criterion="A", errors=Errors.strip_plot("w", "s", 3, 4), starts=8)
    table = plan.to_frame()
    assert (table.groupby("row").w.nunique() == 1).all()
    assert (table.groupby("column").s.nunique() == 1).all()
    rows, columns = np.repeat(np.arange(3), 4), np.tile(np.arange(4), 3)
    V = np.eye(12) + (rows[:, None] == rows) + (columns[:, None] == columns)
    np.testing.assert_allclose(plan.information, dense(plan, V), atol=1e-9)


def test_blocks_are_the_smallest_case() -> None:
    """Strata without hard factors give what `blocks` gives, of random and of fixed effects."""
    x = np.linspace(-1, 1, 9)
    slopes = edtk.Problem(np.stack([x, x**2], axis=-1)[:, None, :])
    for variance in (0.5, np.inf):
        blocks = edtk.plan(slopes, blocks=(4, 4), block_variance=variance)
        strata = edtk.plan(slopes, 8, errors=Errors.strata({"block": 2}, variance), starts=24)
        assert strata.cost == pytest.approx(blocks.cost, rel=1e-9)
        assert strata.bound == pytest.approx(blocks.bound, rel=1e-4)


def test_nested_strata_with_a_trend() -> None:
    """Structures are added: days, whole plots in them and a trend are nuisance together."""
    errors = Errors.strata({"day": 2, "batch": 6}, {"day": np.inf, "batch": 0.5}, {"batch": "w"})
    problem = edtk.Problem.from_frame(FRAME, "0 + w + s + w:s")
    plan = edtk.plan(problem, 12, "A", errors=errors + Errors.trend(), starts=24)
    days = np.repeat(np.eye(2), 6, axis=0)
    N = np.column_stack([days, np.arange(12.0)])
    V = np.eye(12) + 0.5 * (grouped(12, 6) - np.eye(12))
    np.testing.assert_allclose(plan.information, dense(plan, V, N), atol=1e-9)
    assert plan.to_frame().groupby("batch").w.nunique().max() == 1
    assert "in 2 days (fixed), 6 batches (variance 0.5) with one w each" in plan.headline()


def test_pyoptex_finds_no_better_one() -> None:
    """Pyoptex's quick start, 5 whole plots of 4 runs: it reached 8.432135863585366 with 100 tries
    (version 1.2.1, the same coding of effects).
    """
    frame = pd.DataFrame(list(product([0, 1, 2], LEVELS, LEVELS)), columns=["A", "B", "C"])
    codes = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]])
    frame["a1"], frame["a2"] = codes[frame.A].T
    formula = "1 + a1 + a2 + B + C + (a1 + a2):B + (a1 + a2):C + B:C + I(B**2) + I(C**2)"
    problem = edtk.Problem.from_frame(frame, formula)
    plan = edtk.plan(problem, 20, "D", errors=Errors.split_plot("A", 5, 0.1), starts=24)
    assert plan.value >= 8.432135863585366 * (1 - 1e-9)


@pytest.mark.parametrize("variance", [1e-8, 1.0, 1e4, 1e8, np.inf])
def test_effects_of_any_size_are_beside_what_is_told(variance):
    """``(1 + v c c')^-1 = 1 - c c'/(1/v + c'c)``, to rounding."""
    runs = Errors.trend(1, variance).of_runs(6)
    c = runs.trends[0]
    expected = np.eye(6) - c @ c.T / (1.0 / variance + c.T @ c)
    np.testing.assert_allclose(runs.precision, expected, atol=1e-14)


@pytest.mark.parametrize("variance", [1e-8, 1.0, 1e4, 1e8])
def test_what_differs_between_groups_is_told_to_all_digits(variance):
    """A contrast z of whole plots of n runs has the information ``z'z / (1 + n v)``, also where it
    is next to nothing; W has it to the rounding of its entries.
    """
    runs = Errors.split_plot("w", 4, variance).of_runs(12)
    z = np.repeat([1.0, -1.0, 1.0, -1.0], 3)
    exact = z @ z / (1.0 + 3.0 * variance)
    np.testing.assert_allclose(np.square(runs.whitening @ z).sum(), exact, rtol=1e-13)
    np.testing.assert_allclose(z @ runs.precision @ z, exact, atol=100 * EPS)


def test_the_largest_variance_of_effects_tells_all_parameters():
    """Six whole plots of variance 1e8: X has full rank, and D is that of ``X' V^-1 X`` in 50
    digits, well within the accuracy that the plan states.
    """
    plan = edtk.plan(quadratic(), 12, "D", errors=Errors.split_plot("w", 6, 1e8), starts=2)
    X = quadratic().factors(plan.places)[:, 0]
    assert np.linalg.matrix_rank(X) == X.shape[1]
    same = (grouped(12, 6) - np.eye(12)).tolist()
    with mpmath.workdps(50):
        V = mpmath.eye(12) + 10**8 * mpmath.matrix(same)
        M = mpmath.matrix(X.T.tolist()) * V**-1 * mpmath.matrix(X.tolist())
        exact = float(mpmath.det(M) ** (mpmath.mpf(1) / X.shape[1]))
    assert plan.accuracy < 1e-4
    assert plan.value == pytest.approx(exact, rel=min(plan.accuracy, 1e-8))


@pytest.mark.parametrize("correlation", [1 - 1e-10, 1e-10 - 1])
def test_noise_that_is_nearly_the_same_in_all_runs_is_definite(correlation):
    """Of the largest correlations that are taken, no eigenvalue of many runs is rounding."""
    noise = Errors.autoregressive(correlation).of_runs(60).noise
    assert np.linalg.eigvalsh(noise)[0] == pytest.approx(5e-11, rel=0.01)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Errors.trend(1, 1e-50), "at least 2e-16 of the noise's"),
        (lambda: Errors.trend(1, 1e12), "at most 1e+08 of the noise's, or inf for fixed effects"),
        (lambda: Errors.covariance(1e-300 * np.eye(2)), "expected variances of at least 1e-150"),
        (lambda: Errors.covariance(1e300 * np.eye(2)), "at most 1e+150"),
        (lambda: edtk.plan(quadratic(), 12, errors=Errors.split_plot("v", 4)), "no factor 'v'"),
        (lambda: edtk.plan(quadratic(), 12, errors=Errors.split_plot("w", 5)), "12 runs do not"),
        (lambda: edtk.plan(quadratic(), 11, errors=Errors.split_plot("w", (4, 4))), "of 8 runs"),
        (lambda: edtk.plan(quadratic(), errors=Errors.trend()), "number of runs"),
        (lambda: edtk.plan(quadratic(), 12, errors="AR"), "structure of errors"),
        (lambda: edtk.plan(quadratic(), 12, errors=Errors.trend(), most=1), "most"),
        (lambda: Errors.autoregressive(1.0), "between -1 and 1"),
        (lambda: Errors.autoregressive(1 - 1e-15), "at least 1e-10 away from both"),
        (lambda: Errors.autoregressive(np.nan), "expected a number, not nan"),
        (lambda: Errors.covariance([[1, 2], [2, 1]]), "not positive definite"),
        (lambda: Errors.spatial([0, 0, 1], 1.0), "nugget"),
        (lambda: Errors.strata({"day": 2}, -1.0), "above 0"),
        (lambda: Errors.strata({"day": 2}, hard={"week": "w"}), "no stratum 'week'"),
        (lambda: Errors.strata({"day": "two"}), "whole number"),
        (lambda: Errors.strata({"day": [[1, 2], 3]}), "day: expected a number of groups"),
        (lambda: Errors.strata({"day": [None, 1, 2]}), "day: expected a number of groups"),
        (lambda: Errors.strata({"day": [np.nan, 1, 2]}), "day: expected a number of groups"),
        (lambda: Errors.trend(series=[[1], [2, 3]]), "series: expected a number of groups"),
        (lambda: Errors.autoregressive(0.3, 2.5), "series 2.5: expected a whole number"),
        (lambda: Errors.split_plot(5, 4), "names of factors"),
        (
            lambda: edtk.plan(
                quadratic(), 12, errors=Errors.strata({"day": 3, "pair": [0, 1] * 6}, np.inf)
            ),
            "nothing tells Intercept",
        ),
        (lambda: Errors.autoregressive(0.1) + Errors.covariance(np.eye(2)), "both say"),
        (
            lambda: edtk.plan(quadratic(), 12, errors=Errors.strata({"day": 3}, np.inf)),
            "nothing tells Intercept",
        ),
        (lambda: edtk.plan(quadratic(), 5, errors=Errors.trend()), "more are needed"),
        (
            lambda: edtk.plan(quadratic(), 12, errors=Errors.split_plot("w", 2)),
            "2 settings of w at most: enough for 2 of 3 parameters",
        ),
        (
            lambda: edtk.plan(quadratic(), 10, errors=Errors.split_plot(["w", "s"], 5)),
            "5 settings of w and s at most: enough for 5 of 6 parameters",
        ),
    ],
)
def test_wrong_input_is_one_line(make, words: str) -> None:
    """Each mistake is told in one line that names it."""
    with pytest.raises((UserError, RankDeficientError)) as told:
        make()
    assert words in str(told.value)
    assert "\n" not in str(told.value)


def test_roundings_of_singular_plans_are_no_improvements(monkeypatch) -> None:
    """Two settings of w tell no three slopes of s: each descent ends after a few sweeps."""
    swept = []
    turn = ArrangedSearch._exchange
    monkeypatch.setattr(
        ArrangedSearch, "_exchange", lambda self, *args: swept.append(1) or turn(self, *args)
    )
    problem = edtk.Problem.from_frame(FRAME, "0 + s + s:w + s:I(w**2)")
    with pytest.raises(UserError, match=r"no plan of 12 runs in 2 whole plots .* was found"):
        edtk.plan(problem, 12, errors=Errors.split_plot("w", 2), starts=24)
    moves = 2 + 12
    assert len(swept) < 2 * moves * MOVE_SWEEPS / 4


def test_factorials_free_of_a_trend() -> None:
    """Three factors in eight runs have an order whose main effects no linear trend touches (Daniel
    and Wilcoxon 1966; Cheng and Jacroux 1988): nothing is lost to it, and that is proved.
    """
    frame = pd.DataFrame(list(product([-1.0, 1.0], repeat=3)), columns=["a", "b", "c"])
    problem = edtk.Problem.from_frame(frame, "1 + a + b + c")
    plan = edtk.plan(problem, 8, "D", errors=Errors.trend(1))
    assert plan.value == pytest.approx(8.0)
    assert plan.efficiency == pytest.approx(1.0, abs=1e-6)


def test_first_order_split_plot() -> None:
    """Easy factors that are orthogonal in each whole plot lose nothing; constant and hard factor
    lose ``1 + k v`` (Goos and Vandebroek 2001): both closed forms are reached and proved.
    """
    frame = pd.DataFrame(list(product([-1.0, 1.0], repeat=2)), columns=["w", "s"])
    problem = edtk.Problem.from_frame(frame, "1 + w + s")
    plan = edtk.plan(problem, 16, "D", errors=Errors.split_plot("w", 4, 0.75), starts=8)
    assert plan.value == pytest.approx((16 * (16 / (1 + 4 * 0.75)) ** 2) ** (1 / 3))
    assert plan.efficiency == pytest.approx(1.0, abs=1e-6)


def test_signs_alternate_in_a_series() -> None:
    """Of correlated runs of a line the slope is told best by ends in turn."""
    plan = edtk.plan(
        line(), 6, {"name": "Ds", "interest": ["x"]}, errors=Errors.autoregressive(0.6)
    )
    x = plan.to_frame().x.to_numpy()
    assert (np.abs(x) == 1).all()
    assert (x[1:] == -x[:-1]).all()
