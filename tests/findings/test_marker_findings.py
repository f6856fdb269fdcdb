"""Markers that are elsewhere on the tool than the study has them, and those with swapped names."""

from pathlib import Path

import pytest
from geometry_sheets import OFFSETS, STUDY, Array, by_pose, truth

import edtk


def stated(offsets: Array) -> edtk.Study:
    """The study with places of its markers [m]."""
    places = [(1e3 * place).tolist() for place in offsets]
    markers = zip("ABC", places, strict=True)
    return STUDY.replace(marker=[{"name": n, "position_mm": p} for n, p in markers])


def said_of(study: edtk.Study, path: Path, order: tuple[int, ...] = (0, 1, 2)) -> list[str]:
    """What is said of a sound day in which markers are exchanged."""
    q, x = truth(30)
    found = edtk.identify(study, by_pose(path / "day.csv", q, x[:, list(order)]))
    return [doubt.words for doubt in found.findings if doubt.kind != "discrepancy"]


@pytest.mark.parametrize(
    ("order", "names"),
    [((1, 0, 2), "A and B"), ((2, 1, 0), "A and C"), ((1, 2, 0), "A and B and C")],
)
def test_markers_swapped_in_all_rows_are_named(
    tmp_path: Path, order: tuple[int, ...], names: str
) -> None:
    """No residual shows them; the places that the study has do."""
    (text,) = said_of(stated(OFFSETS), tmp_path, order)
    assert text.startswith(f"markers {names} look swapped in all rows")


def test_a_marker_far_from_where_the_study_has_it_is_named(tmp_path: Path) -> None:
    """With how far, and where it is."""
    elsewhere = OFFSETS.copy()
    elsewhere[0, 0] += 0.5
    (text,) = said_of(stated(elsewhere), tmp_path)
    assert text.startswith("marker A is ")
    assert "mm from where the study has it on the tool: at (" in text


def test_guesses_and_no_places_are_not_doubted(tmp_path: Path) -> None:
    """A guess may be centimetres off, and a place may be left out."""
    assert not said_of(stated(OFFSETS + 0.03), tmp_path)
    assert not said_of(STUDY, tmp_path, (1, 0, 2))
