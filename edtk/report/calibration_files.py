"""The files of a calibration: numbers, residuals, and a page to read."""

from pathlib import Path

from edtk.calibration.calibration import Calibration
from edtk.report.calibration_report import calibration_report
from edtk.system.atomic_file import Content
from edtk.system.json_text import json_text
from edtk.tables.csv_text import csv_text

NAMES = ("k.json", "residuals.csv", "report.html")

MANY = 10_000  # measurements from which the file of residuals is to be small:
FEW_DIGITS = 6  # a residual is a difference, of which no reading has more digits
DIGITS = 10


def calibration_files(calibration: Calibration, folder: Path) -> dict[Path, Content]:
    """The contents of `k.json`, `residuals.csv` and `report.html`, by path.

    Args:
        calibration: The result.
        folder: Folder of the files.
    """
    digits = FEW_DIGITS if len(calibration.data) > MANY else DIGITS
    contents = (
        json_text(calibration.to_dict()) + "\n",
        csv_text(calibration.residuals(), digits),
        calibration_report(calibration),
    )
    return {folder / name: content for name, content in zip(NAMES, contents, strict=True)}
