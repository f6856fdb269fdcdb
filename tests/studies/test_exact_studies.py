"""Studies of exact plans: what their pages promise, and that rows are computed as they say."""

from pathlib import Path

import pytest

STUDIES = Path(__file__).parents[2] / "studies"


def cells(page: str) -> list[list[str]]:
    """Cells of the tables of a page."""
    lines = (STUDIES / page).read_text(encoding="utf-8").splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if "|" in line]


def test_published_optima_are_reached_and_proved() -> None:
    """Every row holds, and two thirds of the plans are proved to be the best."""
    rows = [row for row in cells("proved_optima.md") if row[-1] in ("yes", "no")]
    assert {row[-1] for row in rows} == {"yes"}
    plans = [row for row in rows if len(row) == 14]
    assert len(plans) >= 25
    assert sum(row[9] == "the best" for row in plans) >= 2 * len(plans) / 3


def test_no_proof_is_false_beside_all_plans() -> None:
    """Of the 200 problems whose plans were all computed each is proved, and none wrongly."""
    rows = [row for row in cells("brute_forced_plans.md") if len(row) == 7 and row[1].isdigit()]
    assert sum(int(row[1]) for row in rows) == 200
    for row in rows:
        assert row[1] == row[2]
        assert row[3] == "0"


def test_plans_of_the_papers_example_are_proved() -> None:
    """Plans of 2 to 12 of 100,000 poses, where weights leave 0.4 to 14 %, are proved."""
    rows = {(row[0], row[1]): row for row in cells("proved_plans.md") if row[1].isdigit()}
    assert len(rows) == 20
    assert sum(row[3] == "the best" for row in rows.values()) >= 19
    for name in ("rho0", "D"):
        assert rows[name, "2"][3] == "the best"
        assert float(rows[name, "2"][4]) > 10


@pytest.mark.slow
def test_a_row_is_proved_and_checked(script) -> None:
    """The script itself proves a weighing design, and the second implementation agrees."""
    study = script("proved_optima.py")
    case = study.Case("two pans", study.signs(5), 5, "D", 48 ** (2 / 5), "Hadamard")
    row = study.prove(case, 30.0)
    assert row.proved
    assert row.holds
    wrong = study.Case("two pans", study.signs(5), 5, "D", 50 ** (2 / 5), "nobody")
    assert not study.prove(wrong, 0.0).holds
