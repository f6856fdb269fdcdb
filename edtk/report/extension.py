"""Which model a sheet needs: a table of models, for terminals and reports."""

from pathlib import Path
from typing import TYPE_CHECKING

from edtk.calibration.extension import Extension
from edtk.report.page import paragraph, section, table
from edtk.report.tables import percent, text_table
from edtk.study.study_toml import toml_in
from edtk.system.files import Content

if TYPE_CHECKING:
    from edtk.calibration.calibration import Judged

HEADER = ["model", "log evidence", "weight", "left out [mm]"]
IN_TASKS = "expected [mm]"
NAME = "extended.toml"  # the study of the chosen model


def extension_lines(found: Extension | None) -> list[str]:
    """Lines for terminals; none where nobody asked for models."""
    if found is None:
        return []
    header, rows = _table(found)
    return [
        f"which model the sheet needs, of {found.tried} that were weighed",
        text_table(header, rows),
        *_sentences(found),
    ]


def extension_section(found: Extension | None) -> list[str]:
    """A section of a report; none likewise."""
    if found is None:
        return []
    weighed = f"{found.tried} models were weighed: those that count, the likeliest first."
    header, rows = _table(found)
    lines = [paragraph(f"{line[0].upper()}{line[1:]}.") for line in _sentences(found)]
    return [
        section("Which model does the sheet need?", paragraph(weighed), table(header, rows), *lines)
    ]


def extension_files(found: "Judged", folder: Path) -> dict[Path, Content]:
    """The study of the chosen model, which `compensate` and `predict` need; none if it is given."""
    if found.extension is None or not found.extension.chosen.pieces:
        return {}
    return {folder / NAME: toml_in(found.extension.study, folder)}


def _table(found: "Extension") -> tuple[list[str], list[list[str]]]:
    """A header, and a row for each model."""
    tells = found.expected == found.expected
    rows = [
        [
            one.words,
            f"{-one.weighed.score / 2:.1f}",
            percent(one.weight),
            f"{1e3 * one.left_out:.3g}",
            *([f"{1e3 * one.expected:.2g}"] if tells else []),
        ]
        for one in found.shown
    ]
    return HEADER + [IN_TASKS] * tells, rows


def _sentences(found: "Extension") -> list[str]:
    """What remains undecided, what that costs, and which study has the chosen model."""
    sentences = []
    if found.open:
        pieces = ", ".join(f"{name} ({percent(found.inclusion[name])})" for name in found.open)
        sentences.append(f"undecided, with the probability that it is there: {pieces}")
    if found.expected == found.expected:
        sentences.append(
            f"expected error {1e3 * found.expected:.2g} mm {found.study.tasks.place}, with "
            f"{1e3 * found.undecided:.2g} mm that remain undecided between the models"
        )
    if found.chosen.pieces:
        sentences.append(
            f"this is the result of the first model; {NAME} beside k.json is its study, for "
            "predictions and commands"
        )
    return sentences
