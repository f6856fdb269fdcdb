"""What is said of sheets, plans and studies: one class, a sentence a kind, one verdict."""

import ast
import importlib
from pathlib import Path

import pytest

from edtk.findings.finding import (
    EXPLAIN,
    SIZES,
    Finding,
    Severity,
    notes,
    row_names,
    rows_in_words,
    verdict,
    worst_first,
)

ROOT = Path(__file__).parents[2]
FILES = [
    path
    for path in sorted((ROOT / "edtk").rglob("*.py"))
    if "\nWORDING: Wording = {" in path.read_text(encoding="utf-8")
]
MAKERS = ("_say", "_of")  # that make findings of their file


def kinds_in(tree: ast.Module) -> set[str]:
    """The kinds of findings that a file makes, where it has them as text."""
    found = set()
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        maker = ast.unparse(node.func)
        place = 2 if maker == "Finding.of" else 1
        if maker in ("Finding.of", *MAKERS) and len(node.args) > place:
            kind = node.args[place]
            if isinstance(kind, ast.Constant):
                found.add(kind.value)
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_subject_has_a_sentence_for_each_kind(path: Path) -> None:
    """No finding is made without words."""
    module = importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
    kinds = kinds_in(ast.parse(path.read_text(encoding="utf-8")))
    assert kinds
    assert kinds <= set(module.WORDING)


def test_findings_are_made_in_the_words_of_a_subject() -> None:
    """No file makes them with words of its own, but for those that others have written."""
    own = [
        path.name
        for path in sorted((ROOT / "edtk").rglob("*.py"))
        if " Finding(" in path.read_text(encoding="utf-8")
    ]
    assert own == ["geometric_calibration.py"]  # what the sampler says of its chain


def test_the_verdict_is_that_of_the_worst() -> None:
    """No finding is good, a note too; a warning is usable; an alarm is bad, whatever else."""
    note, warning, alarm = (Finding(severity, "kind", "words") for severity in Severity)
    assert verdict([]) == verdict([note]) == "good"
    assert verdict([warning, note]) == "usable"
    assert verdict([note, alarm, warning]) == "bad"
    assert notes([note, alarm, warning]) == ["note: words"]


def test_rows_count_from_1_outside() -> None:
    """In words, and in the table for programs, whose keys are those of its readers."""
    wording = {"far": lambda data: f"{rows_in_words(data['rows'])}: {data['size']:g} mm off"}
    found = Finding.of(Severity.ALARM, wording, "far", rows=(2, 4, 5, 6), size=3.0)
    text = "rows 3, 5 to 7: 3 mm off"
    assert str(found) == text
    assert found.to_dict() == {
        "severity": "alarm",
        "kind": "far",
        "text": text,
        "rows": [3, 5, 6, 7],
    }


@pytest.mark.parametrize(
    ("rows", "one_by_one", "with_runs"),
    [
        ((4,), "row 5", "row 5"),
        ((0, 1), "rows 1, 2", "rows 1, 2"),
        (range(12), "rows 1, 2, 3, 4, 5, 6, 7, 8, 9, 10 and 2 more", "rows 1 to 12"),
        (
            range(0, 28, 2),
            "rows 1, 3, 5, 7, 9, 11, 13, 15, 17, 19 and 4 more",
            "rows 1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23 and 2 more",
        ),
    ],
)
def test_rows_are_named(rows: range, one_by_one: str, with_runs: str) -> None:
    """One by one, or with runs of three and more as one; of many the number is said."""
    assert row_names(rows) == one_by_one
    assert rows_in_words(rows) == with_runs


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("cause", EXPLAIN)
def test_what_explains_residuals_stands_before_their_size(cause: str, size: str) -> None:
    """Whatever their severities and their order are; others keep to theirs."""
    near_zero, alone = (
        Finding(Severity.WARNING, "near_zero", ""),
        Finding(Severity.NOTE, "alone", ""),
    )
    for mild, severe in ((Severity.WARNING, Severity.ALARM), (Severity.WARNING, Severity.WARNING)):
        given = (alone, near_zero, Finding(severe, size, ""), Finding(mild, cause, ""))
        for order in (given, given[::-1]):
            kinds = [one.kind for one in worst_first(order)]
            assert kinds.index(cause) < kinds.index(size)
            assert kinds[-1] == "alone"
            assert kinds.index(size) < kinds.index("near_zero") or severe is Severity.WARNING
