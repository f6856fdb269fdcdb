"""The report of a calibration, and of its posterior, in one HTML file; the files beside it."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from edtk.calibration.calibration import Calibration
from edtk.calibration.geometric_calibration import GeometricCalibration
from edtk.calibration.posterior_check import PoseError, PosteriorCheck
from edtk.calibration.spring_calibration import SpringCalibration
from edtk.measure.cells import csv_text
from edtk.report.calibration_sections import extension_section, facts_section
from edtk.report.draw.posterior import (
    MOST_PANELS,
    LabelledSamples,
    PredictiveResiduals,
    corner,
    predictive_residuals,
    trace,
)
from edtk.report.figures import new_figure, png
from edtk.report.geometry_report import evaluated_geometry, geometry_sections, measured_positions
from edtk.report.page import Page, paragraph, picture, section, sentence, table
from edtk.report.show.page import page_html
from edtk.report.show.plate import PAGE, poses_section
from edtk.report.show.stage import stage_of_calibration
from edtk.report.shown import displacement_in_words, with_digits
from edtk.report.spring_report import evaluated_facts, measured_facts, spring_sections
from edtk.report.views.calibration import EXTENDED
from edtk.study.study import Study
from edtk.study.study_toml import toml_in
from edtk.system.files import Content
from edtk.system.parsing import json_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure


PANEL = 1.55  # side of a panel of the corner [inch]
ROOM_BESIDE = 1.6  # beside the panels [inch]
# Captions of the pictures of a posterior, by the names of their files.
PICTURES = {
    "corner.png": "The sampled posterior: each parameter, and each pair of them.",
    "trace.png": "The chain after burn-in: it should look like noise, without drift.",
    "residuals.png": "Posterior-predictive residuals, in units of the noise.",
}
NOISE = {"sigma_ratio": "Noise over the stated one", "nu": "Degrees of freedom of Student's t"}


def posterior_figures(check: PosteriorCheck) -> "Iterator[tuple[str, Figure, str]]":
    """Name of the file, picture and caption of each picture of a posterior."""
    shown = LabelledSamples.of(check)
    yield _captioned("corner.png", _corner(check, shown))
    yield _captioned("residuals.png", _residuals(check))
    if check.posterior.weights is None:  # else draws are independent
        yield _captioned("trace.png", _trace(check, shown))


def _captioned(name: str, figure: "Figure") -> "tuple[str, Figure, str]":
    return name, figure, PICTURES[name]


def _corner(check: PosteriorCheck, shown: LabelledSamples) -> "Figure":
    """Histograms and pairwise clouds."""
    d = len(shown.labels)
    figure = new_figure(ROOM_BESIDE + PANEL * d, ROOM_BESIDE + PANEL * d)
    figure.set_layout_engine("constrained", hspace=0.02, wspace=0.02)
    corner(shown, figure.subplots(d, d, sharex="col", squeeze=False))
    title = f"Posterior, with contours that hold 39 % and 86 %; lines: {check.reference}"
    figure.suptitle(f"{title}\n{shown.some}" if shown.some else title, fontsize=11)
    return figure


def _trace(check: PosteriorCheck, shown: LabelledSamples) -> "Figure":
    """Walkers by step."""
    d = len(shown.labels)
    figure = new_figure(9.0, 0.8 + 1.3 * d)
    trace(shown, check.posterior.steps, figure.subplots(d, 1, sharex=True, squeeze=False)[:, 0])
    title = f"Walkers (blue), their mean (black) and {check.reference} (orange)"
    figure.suptitle(title, fontsize=11)
    return figure


def _residuals(check: PosteriorCheck) -> "Figure":
    """Residuals in bands."""
    found = PredictiveResiduals.of(check)
    rows = found.residual.shape[1]
    panels = min(rows, MOST_PANELS)
    figure = new_figure(9.0, 1.0 + 1.7 * panels)
    predictive_residuals(found, figure.subplots(panels, 1, sharex=True, squeeze=False)[:, 0])
    some = f" (first {panels} of {rows} coordinates)" if panels < rows else ""
    title = f"Residuals{some}, and where 95 % of new measurements would fall"
    figure.suptitle(f"{title}: {100 * found.inside:.0f} % are inside", fontsize=11)
    return figure


def posterior_pictures(check: PosteriorCheck, folder: Path) -> dict[Path, Content]:
    """The contents of corner.png, trace.png and residuals.png, by path.

    Args:
        check: The posterior.
        folder: Folder of the pictures.
    """
    return {folder / name: png(figure) for name, figure, _ in posterior_figures(check)}


def posterior_section(check: PosteriorCheck) -> str:
    """A table, its meaning in the test pose, and the pictures."""
    parts = [paragraph(sentence(check.posterior.quality)), _parameters(check)]
    if check.rest:
        parts.append(paragraph(sentence(check.rest)))
    if check.ratio_to_expect != 1:
        ratio = f"{check.ratio_to_expect:.3f}"
        parts.append(paragraph(f"As sigma was estimated, a ratio of {ratio} is to be expected."))
    for name, (median, low, high) in check.noise_intervals.items():
        text = f"{NOISE[name]}: {median:.3g}, between {low:.3g} and {high:.3g} (95 %)."
        parts.append(paragraph(text))
    if check.pose is not None:
        parts.append(paragraph(_test_pose(check.pose)))
    parts += [picture(figure, caption) for _, figure, caption in posterior_figures(check)]
    return section("What does the posterior say?", *parts)


def _parameters(check: PosteriorCheck) -> str:
    """A table with a row for each parameter."""
    column, label = check.compared
    rows = []
    for record in check.table.to_dict(orient="records"):
        std = record["std_posterior"]
        rows.append(
            [
                record["parameter"],
                record["unit"],
                with_digits(record["mean"], std),
                f"{std:.3g}",
                f"{record[column]:.3g}",
                f"{record['ratio']:.3f} \u00b1 {record['ratio_error']:.3f}",
                f"{with_digits(record['low_95'], std)} .. {with_digits(record['high_95'], std)}",
            ]
        )
    return table(
        ["parameter", "unit", "mean", "std", label, "ratio", "95 % interval"], rows, full=True
    )


def _test_pose(pose: PoseError) -> str:
    """Error and displacement in the test pose [mm]."""
    place = f"{pose.place[:1].upper()}{pose.place[1:]}"
    text = (
        f"{place} the error after compensation is {1e3 * pose.rho0:.3g} mm (root mean "
        f"square; {1e3 * pose.rho0_fit:.3g} mm by the fit, Eq. (20)), and with 95 % probability "
        f"below {1e3 * pose.error_95:.3g} mm."
    )
    if pose.displacement_95 is None:
        return text
    axes, which = displacement_in_words(pose.displacement_95, pose.displaced)
    return f"{text} Displacement under the task's load{which}, 95 % intervals in mm: {axes}."


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
        *([] if found.check is None else [posterior_section(found.check)]),
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
