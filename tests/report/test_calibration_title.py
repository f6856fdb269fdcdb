"""The heading of a report of a calibration."""

from pathlib import Path

import pytest

from edtk.report.calibration_report import calibration_title
from edtk.study.study import load_study

TABLES = """robot = "kuka_kr270"
[parameters]
geometry = "all"
[measurement]
sigma_mm = 0.05
"""


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        ('title = "Milling"\n', "Calibration: Milling"),
        ('title = "Calibration of cell 3"\n', "Calibration of cell 3"),
        ("", "Calibration of KUKA KR 270"),
    ],
)
def test_the_word_stands_once(tmp_path: Path, given: str, shown: str) -> None:
    """The heading says that it is of a calibration, and says it once."""
    path = tmp_path / "study.toml"
    path.write_text(given + TABLES, encoding="utf-8")
    assert calibration_title(load_study(path)) == shown
