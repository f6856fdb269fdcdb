"""Simulated arms are recovered to their stated covariance: as the page says, and in a few runs."""

from pathlib import Path

PAGE = Path(__file__).parents[2] / "studies" / "recovered_geometry.md"


def test_the_page_says_that_covariances_are_right() -> None:
    """Chi-square a degree of freedom is one within three of its errors; ranks are as counted."""
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    rows = {f"{row[0]}, {row[1]}": row[1:] for row in cells if len(row) == 6 and "s of " in row[1]}
    assert {name: row[1] for name, row in rows.items()} == {
        "6R, positions of 2": "30",
        "SCARA, positions of 2": "20",
        "7R, positions of 2": "34",
        "6R, poses of 1": "30",
        "7R, poses of 1": "34",
    }
    for row in rows.values():
        square, error, ratio = map(float, row[2:])
        assert abs(square - 1) < 3 * error
        assert abs(ratio - 1) < 0.06


def test_few_runs_agree(script) -> None:
    """The script itself, with eight simulations of the SCARA, is within its chance."""
    study = script("recovered_geometry.py")
    rank, square, _, _ = study.simulate(study.arm(*study.ARMS["SCARA"]), 2, "position", 8)
    assert rank == 20
    # 96 numbers: beyond these bounds one time in ten thousand.
    assert 0.5 < square < 1.7
