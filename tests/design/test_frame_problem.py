"""Candidates from data frames: formulas, names, experiments of several rows, and results back."""

import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

import criteria
import edtk
from edtk.system.errors import UserError

pytest.importorskip("formulaic")

X = np.linspace(-1, 1, 21)
FRAME = pd.DataFrame({"x": X, "group": ["a", "b", "a"] * 7}, index=[f"row {i}" for i in range(21)])


def test_formula_is_the_model_matrix():
    """The rows are those of the formula, and the columns name the parameters."""
    problem = edtk.Problem.from_frame(FRAME, "1 + x + I(x**2)", sigma=0.5)
    assert problem.parameters == ("Intercept", "x", "I(x ** 2)")
    expected = edtk.Problem(np.vander(X, 3, increasing=True)[:, None, :], sigma=0.5)
    np.testing.assert_allclose(problem.mean, expected.mean, rtol=1e-14)
    assert edtk.relax(problem, "D").value == pytest.approx(edtk.relax(expected, "D").value)


def test_results_come_back_as_rows_of_the_frame():
    """The rows that carry weight keep their columns and their names."""
    problem = edtk.Problem.from_frame(FRAME, "1 + x + I(x**2)")
    found = edtk.relax(problem, "D").to_frame()
    assert found.index.tolist() == ["row 0", "row 10", "row 20"]
    assert found.columns.tolist() == ["x", "group", "weight"]
    np.testing.assert_allclose(found["weight"], 1 / 3, atol=1e-6)
    counts = np.bincount([0, 0, 10], minlength=21)
    assert problem.to_frame(counts, "repeats")["repeats"].tolist() == [2, 1]
    named = edtk.Problem.from_frame(FRAME.assign(weight=3.0), "1 + x")
    assert edtk.relax(named, "D").to_frame()["weight_"].sum() == pytest.approx(1)


def test_counts_are_of_the_weights_that_were_found():
    """Within limits, a column of the frame that is called weight or count is left as it is."""
    named = edtk.Problem.from_frame(FRAME.assign(weight=3.0, count=7.0), "1 + x")
    within = edtk.relax(named, "D", size=8, most=3)
    found = within.to_frame()
    assert (found["weight"] == 3.0).all()
    assert (found["count"] == 7.0).all()
    np.testing.assert_allclose(found["count_"], within.counts[within.support])
    np.testing.assert_allclose(found["count_"], 8 * found["weight_"])


def test_texts_show_the_rows_of_the_frame():
    """Beside the number of a candidate stands what it is, in relaxations and in plans."""
    problem = edtk.Problem.from_frame(FRAME, "x + C(group)")
    for found in (edtk.relax(problem, "D"), edtk.plan(problem, 4, starts=2)):
        header, first, *_ = found.summary().splitlines()[-1 - len(found.to_frame()) :]
        assert header.split()[:3] == ["candidate", "x", "group"]
        row = FRAME.iloc[int(first.split()[0])]
        assert first.split()[1:3] == [f"{row['x']:.6g}", row["group"]]


def test_without_a_frame_results_are_numbers_of_candidates():
    """Candidates are counted from zero."""
    problem = edtk.Problem(np.vander(X, 2, increasing=True)[:, None, :])
    found = edtk.relax(problem, "D").to_frame()
    assert found.index.name == "candidate"
    assert found.index.tolist() == [0, 20]


def test_powers_that_mean_something_are_left_alone():
    """A power inside of I, and the interactions of a sum."""
    assert edtk.Problem.from_frame(FRAME, "x + I((x)**2) + I(x**3)").p == 4
    assert edtk.Problem.from_frame(FRAME, "(x + group)**2").p == 4


def test_categories_and_interactions():
    """A factor takes a column for each level but the first."""
    problem = edtk.Problem.from_frame(FRAME, "x * C(group)")
    assert problem.parameters == ("Intercept", "x", "C(group)[T.b]", "x:C(group)[T.b]")


def test_rows_of_one_experiment():
    """Rows with the same value belong together; a shorter experiment has fewer measurements."""
    frame = pd.DataFrame({"run": [7, 3, 7, 3, 3], "x": [1.0, 2, 3, 4, 5]})
    problem = edtk.Problem.from_frame(frame, "0 + x", experiment="run")
    np.testing.assert_allclose(problem.blocks().ravel(), [1 + 9, 4 + 16 + 25])
    assert problem.frame["run"].tolist() == [7, 3]


def test_regressors_at_other_places():
    """The model at other rows is what a prediction variance is taken over, levels included."""
    problem = edtk.Problem.from_frame(FRAME, "x + C(group)")
    places = pd.DataFrame({"x": [5.0, 6.0], "group": ["b", "b"]})
    np.testing.assert_allclose(problem.regressors(places), [[1, 5, 1], [1, 6, 1]])
    c = criteria.create("I", points=problem.regressors(places))
    assert edtk.relax(problem, c).gap < 1e-6


@pytest.mark.parametrize(
    ("frame", "formula", "expected"),
    [
        (FRAME, "1 + z", "formula: .*`z` is not present.* The frame has x, group"),
        (FRAME, "1 + I(x", "formula: Formula ended before"),
        (FRAME, "y ~ x", "right-hand side of a formula alone"),
        (FRAME, " ", "right-hand side of a formula alone"),
        (
            FRAME.iloc[:, [0, 1, 0]],
            "1 + x",
            f"frame: column '{FRAME.columns[0]}' is there twice; expected each once",
        ),
        (FRAME, 3, "formula: expected text, not int"),
        (FRAME, "1 + x + x^2", r"x\^2 is crossing .* a power is I\(x\*\*2\)"),
        (FRAME, "I(x**3) + x ** 2", r"x\*\*2 is crossing"),
        (FRAME, "0", "formula: the formula has no terms"),
        (FRAME.assign(x=np.nan), "x", "contains null values"),
        (FRAME, "np.log(x + 1)", "is not finite in row row 0"),
        (FRAME.iloc[:0], "x", "frame: expected a data frame with rows, not an empty one"),
        ([1, 2], "x", "frame: expected a data frame with rows, not list"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero")
def test_wrong_frames_and_formulas_are_one_line(frame, formula, expected):
    """The line names the argument and what was expected."""
    with pytest.raises(UserError, match=expected) as caught:
        edtk.Problem.from_frame(frame, formula)
    assert "\n" not in str(caught.value)
    assert "\x1b" not in str(caught.value)


@pytest.mark.parametrize("experiment", ["runs", "gaps"])
def test_wrong_column_of_experiments(experiment):
    """It is there, and has a value in each row."""
    frame = FRAME.assign(gaps=[np.nan, *range(20)])
    with pytest.raises(UserError, match=r"experiment .*expected a column without gaps"):
        edtk.Problem.from_frame(frame, "x", experiment=experiment)


def test_names_of_the_calling_code_mean_nothing():
    """A formula sees columns only."""
    hidden = X  # noqa: F841, the formula must not see it
    with pytest.raises(UserError, match="`hidden` is not present"):
        edtk.Problem.from_frame(FRAME, "hidden")


@pytest.mark.slow
def test_without_formulaic_one_line_says_what_to_install():
    """It is an extra, which nothing else needs."""
    code = (
        "import sys; sys.modules['formulaic'] = None\n"
        "import edtk, pandas as pd\n"
        "try: edtk.Problem.from_frame(pd.DataFrame({'x': [1.0]}), 'x')\n"
        "except edtk.UserError as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip().endswith("pip install 'edtk[frames]'")


def test_a_column_has_the_noise():
    """Each row has its own, and so have runs of another frame that are kept."""
    frame = FRAME.assign(sd=np.linspace(1.0, 2.0, len(X)))
    noisy = edtk.Problem.from_frame(frame, "1 + x", sigma="sd")
    rows = np.vander(X, 2, increasing=True)[:, None, :]
    np.testing.assert_allclose(noisy.factors(), rows / frame["sd"].to_numpy()[:, None, None])
    kept = edtk.plan(noisy, size=3, keep=frame.iloc[[4]])
    alike = edtk.plan(edtk.Problem(noisy.factors()), size=3, keep=[4])
    assert kept.cost == pytest.approx(alike.cost, rel=1e-12)
    with pytest.raises(UserError, match=r"^sigma: 'noise' is no column"):
        edtk.Problem.from_frame(frame, "1 + x", sigma="noise")
    with pytest.raises(UserError, match=r"'noise' is no column; .* one of x, group, 3$"):
        edtk.Problem.from_frame(FRAME.assign(**{"3": X}).rename(columns={"3": 3}), "1 + x", "noise")


def test_a_level_that_no_candidate_has_is_named():
    """It would count as the first level, silently, where experiments at hand have a slip."""
    problem = edtk.Problem.from_frame(FRAME, "x + group")
    made = FRAME.iloc[:2].assign(group="slip")
    with pytest.raises(UserError, match=r"group is slip in a row; expected "):
        problem.regressors(made)
    with pytest.raises(UserError, match=r"group is slip in a row"):
        edtk.next(problem, made, 3)
    assert len(edtk.Problem.from_frame(FRAME, "1 + x").regressors(made)) == 2
    with pytest.raises(UserError, match=r"null values"):
        problem.regressors(FRAME.iloc[:2].assign(group=None))


@pytest.mark.parametrize("value", [4, 1.5])
def test_a_number_that_is_no_level_of_a_factor_is_named(value):
    """A factor of numbers has the levels of its candidates, as one of words has."""
    frame = pd.DataFrame({"k": [1, 2, 3] * 2, "x": np.arange(6.0)})
    problem = edtk.Problem.from_frame(frame, "C(k) + x + C(x > 2)")
    assert problem.coded == {"k"}
    np.testing.assert_array_equal(problem.regressors(frame), problem.factors()[:, 0])
    with pytest.raises(UserError, match=rf"k is {value} in a row; expected 1, 2, 3$"):
        problem.regressors(frame.iloc[:1].assign(k=value))
