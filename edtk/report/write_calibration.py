"""The files of a calibration: numbers, residuals, and a page to read."""

from pathlib import Path

from edtk.calibration.calibrate import Calibration
from edtk.report.calibration_report import calibration_report
from edtk.system.atomic_file import atomic_path, require_writable, write_text
from edtk.system.json_text import json_text

WRITTEN = ("k.json", "residuals.csv", "report.html")


def write_calibration(calibration: Calibration, folder: Path) -> None:
    """Write `k.json`, `residuals.csv` and `report.html`, each atomically.

    Args:
        calibration: The result.
        folder: Where to write; made where it does not exist.

    Raises:
        OSError: A file cannot be written.
    """
    for name in WRITTEN:
        require_writable(folder / name)
    with atomic_path(folder / "residuals.csv") as temporary:
        calibration.residuals().to_csv(temporary, index=False, float_format="%.10g")
    write_text(folder / "k.json", json_text(calibration.to_dict()) + "\n")
    write_text(folder / "report.html", calibration_report(calibration))
