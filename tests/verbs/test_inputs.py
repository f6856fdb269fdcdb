"""Verbs take what other verbs return, and sheets that are filled in by half."""

import inspect
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from geometry_sheets import STUDY as GEOMETRY
from geometry_sheets import by_marker, truth

import edtk
from edtk.cli import main
from edtk.design.plan import Plan
from edtk.system.arguments import is_plain
from edtk.system.errors import Note

PATH = Path(__file__).parents[2] / "studies" / "kr270_milling.toml"
STUDY = edtk.load_study(PATH)
K = {"q2": 3e-7, "q3": 4e-7, "q4": 2.8e-6, "q5": 2.8e-6, "q6": 2.1e-6}
PLAN = STUDY.published_plans()["table_4_6"]
CHANGES = ["dx_mm", "dy_mm", "dz_mm"]


def filled() -> pd.DataFrame:
    """The sheet of a published plan with what the linear model says, and noise."""
    sheet = edtk.template(STUDY, PLAN)
    q = np.deg2rad(sheet.iloc[:, :6].to_numpy())
    A = STUDY.model.regressor(q, sheet.iloc[:, 6:12].to_numpy())
    noise = np.random.default_rng(1).normal(0, 0.03, (len(sheet), 3))
    sheet[CHANGES] = 1e3 * A @ np.array([*K.values()]) + noise
    return sheet


@pytest.fixture
def half() -> tuple[pd.DataFrame, list[int]]:
    """A sheet with some rows yet to be measured, and those that are."""
    sheet = filled()
    made = [0, 1, 3, 4]
    sheet.loc[[row for row in range(len(sheet)) if row not in made], CHANGES] = np.nan
    return sheet, made


@pytest.mark.slow
def test_a_half_filled_sheet_is_that_of_its_rows(half, tmp_path):
    """Rows to come are left out, with a note; the others tell what they tell by themselves."""
    sheet, made = half
    with pytest.warns(Note, match="4 of 6 rows are filled in.*counted without them"):
        part = edtk.identify(STUDY, sheet)
    assert part.k == edtk.identify(STUDY, sheet.loc[made]).k
    sheet.to_csv(tmp_path / "half.csv", index=False)
    done = CliRunner().invoke(main, ["identify", str(PATH), str(tmp_path / "half.csv")])
    assert done.exit_code == 0
    assert "4 of 6 rows are filled in" in done.stderr
    with pytest.raises(edtk.UserError, match="no row is filled in; expected measurements in dx_mm"):
        edtk.identify(STUDY, edtk.template(STUDY, PLAN))


def test_rows_that_lack_a_coordinate_are_still_refused(half):
    """A row that is filled in by half is a mistake, and no row to come."""
    sheet, _ = half
    sheet.loc[1, "dy_mm"] = np.nan
    with pytest.warns(Note), pytest.raises(edtk.UserError, match="row 2, column dy_mm"):
        edtk.identify(STUDY, sheet)


def test_what_is_made_of_a_sheet_is_kept(half):
    """Its filled rows are the kept experiments; an empty sheet keeps nothing, and is refused."""
    sheet, made = half
    with pytest.warns(Note, match="4 of 6 rows"):
        kept = STUDY.load_plan(sheet, made=True)
    whole = STUDY.load_plan(sheet)
    assert (kept.experiments, whole.experiments) == (4, 6)
    rows = np.deg2rad(sheet.iloc[made, :6].to_numpy())
    np.testing.assert_allclose(np.unique(kept.q, axis=0), np.unique(rows, axis=0), atol=1e-12)
    with pytest.raises(edtk.UserError, match="no row is filled in"):
        edtk.plan(STUDY, size=8, keep=edtk.template(STUDY, PLAN))


def test_rows_of_a_visit_are_one_experiment():
    """Readings of several markers in a visit are one visit of the plan that they come from."""
    sheet = edtk.template(STUDY, PLAN.repeated(2), markers=3)
    again = STUDY.load_plan(sheet)
    assert len(sheet) == 3 * again.experiments == 36
    assert sorted(again.repeats) == sorted(PLAN.repeated(2).repeats)


@pytest.mark.slow
def test_half_a_day_of_positions_is_fitted_and_kept(tmp_path):
    """Of a sheet of positions the visits that have one count, and the number is said."""
    q, x = truth(25)
    sheet = pd.read_csv(by_marker(tmp_path / "sheet.csv", q, x))
    sheet.loc[sheet.index >= 20 * 3, ["x_mm", "y_mm", "z_mm"]] = np.nan
    found = edtk.identify(GEOMETRY, sheet)
    assert "20 of 25 visits are filled in, the others left out" in [d.words for d in found.findings]
    with pytest.warns(Note, match="20 of 25 visits are filled in"):
        kept = GEOMETRY.load_plan(sheet, made=True)
    np.testing.assert_allclose(kept.q, np.deg2rad(q[:20]), atol=1e-9)
    predicted = edtk.predict(
        GEOMETRY, found, Plan(np.deg2rad(q[20:]), np.zeros((5, 6)), np.ones(5, int))
    )
    apart = predicted.values - x[20:].reshape(-1, 3) / 1e3
    assert np.abs(apart).max() < 3e-4


@pytest.mark.slow
def test_verbs_take_what_verbs_return(half):
    """Plans, results with a plan, data frames and compliances by joint need no file."""
    plan = edtk.plan(STUDY, size=4, seed=1, budget=0.5)
    table = plan.whole.to_frame(STUDY.robot)
    value = edtk.evaluate(STUDY, plan).criteria["rho0"]
    of_table = edtk.evaluate(STUDY, table).criteria["rho0"]
    assert value == pytest.approx(of_table, rel=1e-6)
    # A template has another order of visits: sums are rounded otherwise, by eps times the condition
    # number of a plan, which is some hundreds.
    of_template = edtk.evaluate(STUDY, edtk.template(STUDY, table)).criteria["rho0"]
    assert of_template == pytest.approx(of_table, rel=1e-12)
    commands = edtk.compensate(STUDY, K, plan)
    np.testing.assert_array_equal(commands.desired, plan.whole.q)
    assert commands.remaining is None
    again = edtk.compensate(STUDY, {"k": K}, table)
    np.testing.assert_allclose(again.command, commands.command, atol=1e-9)


@pytest.mark.parametrize(
    "verb", [name for name, home in edtk._HOME.items() if home.startswith("edtk.verbs.")]
)
def test_every_argument_of_every_verb_has_a_type(verb):
    """What is no path, text, number, switch or list is named before any work, in one line.

    Whole numbers, and what may stand in a file, the verbs read themselves: the next test.
    """
    call = getattr(edtk, verb)
    if isinstance(call, type):
        return
    parameters = inspect.signature(call).parameters.values()
    plain = {one.name for one in parameters if is_plain(one.annotation)}
    assert plain >= {one.name for one in parameters} & {"out", "certificate", "progress", "limits"}
    for name in plain:
        with pytest.raises(edtk.UserError, match=f"^{name}: expected .*, not object$"):
            call(**{name: object()})


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: edtk.compensate(STUDY, {"q2": 3e-7}), "compliances: q3: expected the compliance"),
        (lambda: edtk.compensate(STUDY, 3), "compliances: expected a calibration"),
        (lambda: edtk.compensate(STUDY, K, 5), "task: expected the path of a CSV file, or a data"),
        (lambda: edtk.compensate(STUDY, PLAN), "compliances: expected a calibration, compliances"),
        (lambda: edtk.predict(STUDY, PLAN, PLAN), "result: expected a result of this study, not P"),
        (lambda: edtk.identify(STUDY, 3), "measurements: expected the path of a CSV file, or a"),
        (lambda: edtk.evaluate(STUDY, [1, 2]), "plan: expected the path of a CSV file, or a data"),
        (lambda: edtk.template(STUDY, None), "not NoneType"),
        (lambda: edtk.plan(STUDY, "a"), "size a: expected a whole number, 1 or more"),
        (lambda: edtk.plan(STUDY, 4, seed="x"), "seed x: expected a whole number, 0 or more"),
        (lambda: edtk.plan(STUDY, 4, workers=0.5), "workers 0.5: expected a whole number"),
        (lambda: edtk.plan(STUDY, 4, workers="x"), "workers x: expected a whole number"),
        (lambda: edtk.run(STUDY, workers=[1]), "workers [1]: expected a whole number"),
        (lambda: edtk.plan(STUDY, 4, keep=4), "keep: expected the path of a CSV file"),
        (lambda: edtk.plan(STUDY, 4, cost_budget="x"), "cost_budget: expected numbers"),
        (lambda: edtk.plan(STUDY, 4, cost_budget=[1, 2]), "cost_budget: expected one number"),
        (lambda: edtk.template(STUDY, PLAN, markers=0.5), "markers 0.5: expected a whole number"),
        (lambda: edtk.predict(STUDY, K, PLAN, tool_rows="x"), "tool_rows x: expected a whole"),
        (lambda: edtk.bayes(STUDY, PLAN, nu="x"), "nu x: expected a number from 0.1 to 1e6, 'nor"),
        (lambda: edtk.evaluate(STUDY, pd.DataFrame({"a": [1]})), "data frame: unknown column 'a'"),
        (
            lambda: edtk.evaluate(STUDY, Plan(np.zeros((2, 3)), np.zeros((2, 6)), np.ones(2, int))),
            "plan: has poses of 3 joints; expected the 6 of the study",
        ),
    ],
)
def test_wrong_types_are_one_line(call, said):
    """What no verb can use is named by its argument."""
    with pytest.raises(edtk.UserError) as error:
        call()
    assert said in str(error.value)
    assert "\n" not in str(error.value)


ROWS = np.array([[1.0, x, x * x] for x in np.linspace(-1, 1, 21)])[:, None, :]
LINE = edtk.Region(lambda x: np.stack([np.ones(len(x)), x[:, 0]], axis=1), [-1], [1])
DECAY = {"f": "a + exp(-b*t)", "theta": {"a": 1.0, "b": 2.0}, "candidates": [0.0, 1.0, 2.0]}
BOX = {"a": (0.0, 0.8), "b": (0.0, 0.8), "c": (0.0, 0.8)}

WRONG_ARRAYS = [
    (lambda: edtk.Problem(ROWS, sigma="3"), "sigma: expected numbers"),
    (lambda: edtk.Problem(ROWS, sigma=True), "sigma: expected numbers"),
    (lambda: edtk.Problem(ROWS, sigma=np.datetime64("2020-01-01")), "sigma: expected numbers"),
    (lambda: edtk.Problem(ROWS, parameters=()), "parameters: 0 names for 3 parameters"),
    (lambda: edtk.Region(LINE.rows_at, [-1], [1], sigma=[[1], [1, 2]]), "sigma: expected numbers"),
    (lambda: edtk.Region(LINE.rows_at, [-1], [1], variables=()), "no names; expected 1 different"),
    (lambda: edtk.relax(LINE, np.ones(3)), "expected a criterion, its name or a table"),
    (lambda: edtk.Region(LINE.rows_at, [-1], [1], degree=[[1], [1, 2]]), "expected a number"),
    (lambda: edtk.plan(edtk.Problem(ROWS), 6, most=[[1], [1, 2]]), "most: expected a whole"),
    (lambda: edtk.plan(edtk.Problem(ROWS), 6, least=1e100), "least: candidate 0: asks for more"),
    (
        lambda: edtk.plan(edtk.Problem(ROWS), 6, least=1e300),
        "least: expected finite numbers, at most",
    ),
    (lambda: edtk.plan(edtk.Problem(ROWS), 6, least=[1 + 2j] * 21), "least: expected numbers"),
    (lambda: edtk.Problem(ROWS, sigma=1 + 2j), "sigma: expected numbers"),
    (lambda: edtk.next(edtk.Problem(ROWS), [[1], [1, 2]]), "keep: expected indices of candidates"),
    (
        lambda: edtk.Problem.of_model(**DECAY | {"candidates": {"t": [0.0, 1.0]}}),
        "candidates: expected numbers, a row for each candidate, or a data frame",
    ),
    (
        lambda: edtk.Problem.of_model(**DECAY, variables="x"),
        r"f: 'a \+ exp\(-b\*t\)' has 't'; expected parameters \(a, b\) and variables \(x\)",
    ),
    (
        lambda: edtk.candidates.extreme_vertices(BOX, present=(1, 2, 3)),
        "expected two numbers: the least and the largest of components that are present",
    ),
    (
        lambda: edtk.relax(edtk.Problem(ROWS), {"name": "I", "points": [[0.0]]}),
        "points: expected finite regressors .* not all zero: what the model's p parameters",
    ),
]


@pytest.mark.parametrize(("call", "said"), WRONG_ARRAYS)
def test_wrong_arrays_are_named_with_what_was_expected(
    call: Callable[[], object], said: str
) -> None:
    """Lists of lists, texts, dates and switches in place of numbers: no library's own words."""
    with pytest.raises((edtk.UserError, edtk.criteria.CriterionError), match=said):
        call()
