"""What the report says, from tables and relaxations made up for it."""

from dataclasses import replace

import numpy as np
import pytest
from comparisons import PATH, other_criteria, two_sizes

from edtk.report.comparison_report import comparison_report
from edtk.report.comparison_sections import Efficiencies
from edtk.study.plan_study import relax_study
from edtk.study.study import load_study


@pytest.fixture(scope="module")
def relaxed():
    study = load_study(PATH)
    return {name: relax_study(study, name, candidates=200) for name in ("E", "rho0")}


def text_of(run):
    """The text of the report."""
    sizes = sorted(run.study.specification.sizes)
    return comparison_report(run, [Efficiencies.of(run, size) for size in sizes])


def rows_of(section):
    """Cells of the first table of a section, by the first cell of each row."""
    lines = [line for line in section.splitlines() if line.startswith("| ")]
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    return {row[0]: row[1:] for row in cells}


def test_verdict_where_the_criterion_is_minimised(tmp_path, relaxed):
    """The largest plan is judged by value, efficiency and ratio to a random plan."""
    text = text_of(two_sizes(tmp_path, relaxed, "rho0"))
    assert "## Which plan is best in the test pose?" in text
    assert "**Measure the 3 experiments of `plans/optimised_m3.csv`.**" in text
    assert "They reach rho0 = 7 um: the error to expect in the test pose" in text
    assert "efficiency of 90.0 %" in text
    assert "rho0 of the random plan is 2.000 times as large." in text


def test_verdict_is_on_a_criterion_that_was_optimised(tmp_path, relaxed):
    """A study that only compares rho0 and optimises E is judged by E, for which a plan exists."""
    text = text_of(two_sizes(tmp_path, relaxed, "E"))
    assert "They reach E = 5e+14 (N m/rad)^2." in text
    assert "efficiency of 80.0 %" in text
    assert "E of the random plan is 0.500 times as large (larger is better)." in text


def test_verdict_where_no_size_suffices(tmp_path, relaxed):
    """Without any plan the report says so, and shows the reason in every row and for every size."""
    none = (np.nan, np.nan)
    text = text_of(two_sizes(tmp_path, relaxed, "rho0", E=none, rho0=none))
    assert "No size allows a plan that identifies all parameters." in text
    assert text.count("too few") == 4 + 2


def test_relaxation_table_has_value_and_bounds_of_every_criterion(tmp_path, relaxed):
    """One row a criterion, rho0 in um: value, both bounds, number of poses and solver."""
    section = text_of(two_sizes(tmp_path, relaxed, "rho0")).split("## How it was computed")[1]
    rows = rows_of(section)
    assert rows["criterion"][:3] == ["value", "bound, proved", "bound, searched"]
    for (name, plan), factor in zip(relaxed.items(), (1.0, 1e6), strict=True):
        values = [plan.value, plan.proved_bound.value, plan.best_bound.value]
        shown = [float(cell) for cell in rows[name][:3]]
        np.testing.assert_allclose(shown, np.multiply(factor, values), rtol=5e-6)  # six digits
        assert rows[name][-2:] == [str(len(plan.x)), "Newton"]


def test_report_states_its_figure_its_study_and_every_plan(tmp_path, relaxed):
    """The figure is shown; digest, seed and version are stated; every plan has a row."""
    run = two_sizes(tmp_path, relaxed, "rho0")
    text = text_of(run)
    assert "(comparison.png)" in text
    assert f"Seed 2026, study {run.study.digest}, edtk 1.2." in text
    plans = ("optimised_m3", "random_m3", "optimised_m1", "random_m1")
    assert all(f"| {plan} " in text for plan in plans)


def test_what_other_criteria_cost(tmp_path, relaxed):
    """Each plan's loss in rho0 against ours of its size, and the least and the largest in words."""
    text = text_of(other_criteria(tmp_path, relaxed))
    section = text.split("## What plans for other criteria cost in rho0")[1].split("##")[0]
    assert "between 50 % (E, 3 experiments) and 100 % (E, 4 experiments)" in section
    rows = rows_of(section)
    assert rows["optimised for E"] == ["+50.0 %", "+100.0 %"]
    assert rows["published"] == ["-", "+20.0 %"]


def test_fewer_distinct_poses(tmp_path, relaxed):
    """A plan of fewer poses counts for more poses, too; the least number within 1 % is named."""
    text = text_of(other_criteria(tmp_path, relaxed))
    section = text.split("## Fewer distinct poses")[1].split("##")[0]
    assert "Enough for a loss below 1 %: 2 for m = 3, 4 for m = 4." in section
    rows = rows_of(section)
    assert rows["3"] == ["6.03 (+0.50 %)", "6 (+0.00 %)", "6", "2"]
    assert rows["4"] == ["5.5 (+10.00 %)", "5.5 (+10.00 %)", "5", "4"]


def test_efficiencies(tmp_path, relaxed):
    """Every size has its table and its picture."""
    text = text_of(other_criteria(tmp_path, relaxed))
    section = text.split("### 4 experiments")[1].split("###")[0]
    assert "(efficiency_m4.png)" in section
    rows = rows_of(section)
    assert rows["optimised for rho0"] == ["50.0 %", "96.0 %"]
    assert rows["published"] == ["50.0 %", "80.0 %"]


def test_a_title_brings_no_html(tmp_path, relaxed):
    """Tags, links and pictures in a title are shown as they were written, and not followed."""
    run = two_sizes(tmp_path, relaxed, "rho0")
    odd = "<script>alert(1)</script> ![x](http://a.b) `c`"
    text = text_of(replace(run, study=run.study.replace(title=odd)))
    assert "<" not in text
    assert text.startswith("# &lt;script>alert(1)&lt;/script> !\\[x](http://a.b) \\`c\\`\n")


def test_a_plan_that_was_not_begun_has_no_efficiency(tmp_path, relaxed):
    """Where the time was over, cells are dashes, and nobody is told that sizes allow nothing."""
    run = other_criteria(tmp_path, relaxed)
    table = run.table.copy()
    gone = (table["kind"] == "distinct") | (table["plan"] == "plan_1")
    table.loc[gone, "reason"] = "the time was over before it was searched for"
    table.loc[gone, ["rho0", "E"]] = np.nan
    text = text_of(replace(run, table=table))
    best = rows_of(text.split("## Which plan is best")[1].split("##")[0])
    assert best["4"][:2] == ["-", "-"]
    assert "No plan of fewer distinct poses was found: the time was over before" in text
