"""The report of a calibration, verdict first, in one HTML file; and the files beside it."""

from pathlib import Path

from edtk.calibration.calibration import Calibration
from edtk.calibration.geometric_calibration import GeometricCalibration
from edtk.calibration.spring_calibration import SpringCalibration
from edtk.measure.cells import csv_text
from edtk.report.calibration_sections import extension_section, facts_section
from edtk.report.geometry_report import (
    evaluated_geometry,
    geometry_sections,
    measured_positions,
)
from edtk.report.page import (
    Page,
)
from edtk.report.posterior_report import posterior_report
from edtk.report.show.page import page_html
from edtk.report.show.plate import PAGE, poses_section
from edtk.report.show.stage import stage_of_calibration
from edtk.report.spring_report import evaluated_facts, measured_facts, spring_sections
from edtk.report.views.calibration import (
    EXTENDED,
)
from edtk.study.study import Study
from edtk.study.study_toml import toml_in
from edtk.system.files import Content
from edtk.system.parsing import json_text

WORD = "Calibration"
NAMES = ("k.json", "residuals.csv", "report.html", PAGE)
MANY_RESIDUALS = 30_000  # residuals from which their file is to be small:
FEW_DIGITS = 6  # a residual is a difference, of which no reading has more digits
DIGITS = 10


def calibration_title(study: Study) -> str:
    """The study's title, which says that it is of a calibration."""
    title = study.specification.title
    return title if title.startswith(WORD) else f"{WORD}: {title}"


def calibration_report(found: Calibration) -> str:
    """The text of `report.html`."""
    if isinstance(found, GeometricCalibration):
        sections = geometry_sections(found)
        facts = measured_positions(found), evaluated_geometry(found)
    else:
        assert isinstance(found, SpringCalibration)
        sections = spring_sections(found)
        facts = measured_facts(found), evaluated_facts(found)
    parts = [
        *sections,
        poses_section(stage_of_calibration(found)),
        *extension_section(found.extension),
        *([] if found.check is None else [posterior_report(found.check)]),
        facts_section(found, *facts),
    ]
    return Page(calibration_title(found.study), tuple(parts)).html()


def calibration_files(found: Calibration, folder: Path) -> dict[Path, Content]:
    """The contents of `k.json`, `residuals.csv`, `report.html` and `poses.html`, by path.

    Args:
        found: The result.
        folder: Folder of the files.
    """
    residuals = found.residuals()
    contents = (
        json_text(found.to_dict()) + "\n",
        csv_text(residuals, FEW_DIGITS if len(residuals) > MANY_RESIDUALS else DIGITS),
        calibration_report(found),
        page_html(stage_of_calibration(found)),
    )
    files = {folder / name: content for name, content in zip(NAMES, contents, strict=True)}
    return files | extension_files(found, folder)


def extension_files(found: Calibration, folder: Path) -> dict[Path, Content]:
    """The study of the chosen model, which `compensate` and `predict` need; none if it is given."""
    if found.extension is None or not found.extension.chosen.pieces:
        return {}
    return {folder / EXTENDED: toml_in(found.extension.study, folder)}
