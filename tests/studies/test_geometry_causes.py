"""Frames that moved and weights that nobody told: the page says that sound days are not doubted."""

from pathlib import Path

PAGE = Path(__file__).parents[2] / "studies" / "geometry_causes.md"


def test_the_page_says_what_is_named() -> None:
    """No sound day of 200 is doubted, and half a millimetre is found nearly always."""
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    rows = {row[0]: row[1:] for row in cells if len(row) == 5 and row[1].isdigit()}
    sound = [row for name, row in rows.items() if name.startswith("sound")]
    assert sum(int(row[0]) for row in sound) >= 200
    assert {row[1] for row in sound} == {row[3] for row in sound} == {"0 %"}
    assert float(rows["moved by 0.5 mm"][1].split()[0]) >= 95


def test_a_day_is_judged(script) -> None:
    """The script itself, with one day whose frame moved by a millimetre, finds it there."""
    study = script("geometry_causes.py")
    named, beside, bent = study.day(3000, "moved", 1.0)
    assert (named, bent) == (1, 0)
    assert abs(beside) <= 1
