"""What the report says, from a table and relaxations made up for it."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from edtk.report.write_comparison import write_comparison
from edtk.study.relax_study import relax_study
from edtk.study.study import load_study
from edtk.study.study_run import StudyRun

PATH = Path(__file__).parents[2] / "studies" / "kr270_milling.toml"


@pytest.fixture(scope="module")
def relaxed():
    return {name: relax_study(load_study(PATH), name, candidates=200) for name in ("E", "rho0")}


def report(folder, relaxed, optimise, E=(np.nan, 5e14), rho0=(np.nan, 7e-6)):
    """The report of a study that compares E and rho0 and optimises one of them, in 1 and 3 experiments."""
    text = PATH.read_text().replace(
        '["rho0", "A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5"]', f'["{optimise}"]'
    )
    text = text.replace(
        '["A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0"]', '["E", "rho0"]'
    )
    path = folder / "study.toml"
    path.write_text(text.replace("sizes = [2, 3, 4, 6, 12]", "sizes = [1, 3]"))
    kinds, chosen = ["optimised", "random"] * 2, [optimise, ""] * 2
    table = pd.DataFrame({"kind": kinds, "optimised_for": chosen, "experiments": [1, 1, 3, 3]})
    table["distinct_at_most"], table["poses"] = table["experiments"], table["experiments"]
    table["plan"] = [f"{k}_m{m}" for k, m in zip(kinds, table["experiments"], strict=True)]
    table["E"], table["rho0"] = (
        np.repeat(E, 2) * [1, 1, 1, 0.5],
        np.repeat(rho0, 2) * [1, 1, 1, 2.0],
    )
    table["reason"] = ["too few" if np.isnan(v) else "" for v in table["E"]]
    table["efficiency_E"], table["efficiency_rho0"], table["edtk"] = 0.8, 0.9, "1.2"
    write_comparison(StudyRun(load_study(path), table, relaxed, (), folder))
    return (folder / "report.md").read_text(encoding="utf-8")


def test_verdict_where_the_criterion_is_minimised(tmp_path, relaxed):
    """The plan of the largest size is judged by value, efficiency and ratio to a random plan."""
    text = report(tmp_path, relaxed, "rho0")
    assert "## Which plan is best in the test pose?" in text
    assert "With 3 experiments the plan optimised for rho0 reaches rho0 = 7 (1e-3 mm)" in text
    assert "efficiency of 90.0 %" in text
    assert "For the random plan rho0 is 2.000 times that value." in text


def test_verdict_is_on_a_criterion_that_was_optimised(tmp_path, relaxed):
    """A study that only compares rho0 and optimises E is judged by E, and is not told that no plan exists."""
    text = report(tmp_path, relaxed, "E")
    assert "With 3 experiments the plan optimised for E reaches E = 5e+14" in text
    assert "efficiency of 80.0 %" in text
    assert "For the random plan E is 0.500 times that value (larger is better)." in text


def test_verdict_where_no_size_suffices(tmp_path, relaxed):
    """Without any plan the report says so instead, and shows the reason in every row and for every size."""
    text = report(tmp_path, relaxed, "rho0", E=(np.nan, np.nan), rho0=(np.nan, np.nan))
    assert "No size allows a plan that identifies all parameters." in text
    assert text.count("too few") == 4 + 2


def test_relaxation_table_has_value_and_bounds_of_every_criterion(tmp_path, relaxed):
    """One row a criterion, rho0 in 1e-3 mm: value, both bounds, number of poses and solver."""
    section = report(tmp_path, relaxed, "rho0").split("## The relaxation")[1]
    rows = [
        [c.strip() for c in line.split("|")[1:-1]]
        for line in section.splitlines()
        if line.startswith("| ")
    ]
    assert rows[0][:4] == ["criterion", "value", "bound, proved", "bound, searched"]
    for row, (name, r), factor in zip(rows[1:], relaxed.items(), (1.0, 1e6), strict=True):
        assert row[0] == name
        bounds = factor * r.bound, factor * r.best_bound.value
        np.testing.assert_allclose(
            [float(c) for c in row[1:4]], [factor * r.value, *bounds], rtol=5e-6
        )  # six digits
        assert row[-2:] == [str(len(r.x)), r.solver]


def test_report_states_its_figure_its_study_and_every_plan(tmp_path, relaxed):
    """The figure lies beside the report; digest, seed and version are there; so is every plan."""
    text = report(tmp_path, relaxed, "rho0")
    assert (tmp_path / "comparison.png").read_bytes().startswith(b"\x89PNG")
    assert "(comparison.png)" in text
    assert f"Seed 2026, study {load_study(tmp_path / 'study.toml').digest}, edtk 1.2." in text
    assert all(
        f"| {plan} " in text for plan in ("optimised_m3", "random_m3", "optimised_m1", "random_m1")
    )


def comparison(folder, relaxed):
    """The report on plans of 3 and 4 experiments for rho0 and for E, with fewer distinct poses for rho0."""
    text = PATH.read_text().replace(
        '["rho0", "A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5"]', '["rho0", "E"]'
    )
    text = text.replace(
        '["A", "D", "E", "G", "O1", "O2", "O3", "O4", "O5", "rho0"]', '["E", "rho0"]'
    )
    path = folder / "study.toml"
    path.write_text(text.replace("sizes = [2, 3, 4, 6, 12]", "sizes = [3, 4]"))
    rows = [
        ("optimised", "rho0", 3, 3, 6.0e-6),
        ("optimised", "rho0", 4, 4, 5.0e-6),
        ("optimised", "E", 3, 3, 9.0e-6),
        ("optimised", "E", 4, 4, 10.0e-6),
        ("distinct", "rho0", 3, 2, 6.03e-6),
        ("distinct", "rho0", 4, 2, 5.5e-6),
        ("distinct", "rho0", 4, 3, 5.6e-6),
        ("published", "", 4, 4, 6.0e-6),
    ]
    table = pd.DataFrame(
        rows, columns=["kind", "optimised_for", "experiments", "distinct_at_most", "rho0"]
    )
    table["plan"] = [f"plan_{i}" for i in range(len(rows))]
    table["E"], table["reason"], table["edtk"], table["poses"] = (
        5e14,
        "",
        "1.2",
        table["distinct_at_most"],
    )
    table["efficiency_E"], table["efficiency_rho0"] = 0.5, 4.8e-6 / table["rho0"]
    write_comparison(StudyRun(load_study(path), table, relaxed, (), folder))
    return (folder / "report.md").read_text(encoding="utf-8")


def rows_of(section):
    """Cells of the first table of a section, by the first cell of each row."""
    lines = [line for line in section.splitlines() if line.startswith("| ")]
    return {
        cells[0]: cells[1:]
        for cells in ([c.strip() for c in line.split("|")[1:-1]] for line in lines)
    }


def test_what_other_criteria_cost(tmp_path, relaxed):
    """Each plan's loss in rho0 against ours of its size, and the least and the largest in words."""
    section = (
        comparison(tmp_path, relaxed)
        .split("## What plans for other criteria cost in rho0")[1]
        .split("##")[0]
    )
    assert "between 50 % (E, 3 experiments) and 100 % (E, 4 experiments)" in section
    rows = rows_of(section)
    assert rows["optimised for E"] == ["+50.0 %", "+100.0 %"]
    assert rows["published"] == ["-", "+20.0 %"]


def test_fewer_distinct_poses(tmp_path, relaxed):
    """Losses against any number of poses; a plan of fewer poses counts for more; the least k within 1 % is named."""
    section = comparison(tmp_path, relaxed).split("## Fewer distinct poses")[1].split("##")[0]
    assert "Enough for a loss below 1 %: 2 for m = 3, 4 for m = 4." in section
    rows = rows_of(section)
    assert rows["3"] == ["6.03 (+0.50 %)", "6 (+0.00 %)", "6", "2"]
    assert rows["4"] == ["5.5 (+10.00 %)", "5.5 (+10.00 %)", "5", "4"]


def test_efficiencies_are_drawn(tmp_path, relaxed):
    """Every size has its table and its heat map, and pictures of sizes that are gone are removed."""
    (tmp_path / "efficiency_m7.png").write_bytes(b"old")
    text = comparison(tmp_path, relaxed)
    assert sorted(path.name for path in tmp_path.glob("*.png")) == [
        "comparison.png",
        "efficiency_m3.png",
        "efficiency_m4.png",
    ]
    section = text.split("### 4 experiments")[1].split("###")[0]
    rows = rows_of(section)
    assert rows["optimised for rho0"] == ["50.0 %", "96.0 %"]
    assert rows["published"] == ["50.0 %", "80.0 %"]
