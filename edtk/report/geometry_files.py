"""The files of a calibration of geometry: numbers, residuals, and a page to read."""

from pathlib import Path

from edtk.calibration.geometry.geometric_calibration import GeometricCalibration
from edtk.report.calibration_files import NAMES
from edtk.report.geometry_report import geometry_report
from edtk.system.atomic_file import Content
from edtk.system.json_text import json_text
from edtk.tables.csv_text import csv_text


def geometry_files(found: GeometricCalibration, folder: Path) -> dict[Path, Content]:
    """The contents of `k.json`, `residuals.csv` and `report.html`, by path.

    Args:
        found: The result.
        folder: Folder of the files.
    """
    contents = (
        json_text(found.to_dict()),
        csv_text(found.residuals()),
        geometry_report(found),
    )
    return {folder / name: content for name, content in zip(NAMES, contents, strict=True)}
