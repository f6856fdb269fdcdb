"""The report of a calibration of geometry: verdict first, then tables and pictures."""

import numpy as np

from edtk.calibration.geometric_calibration import GeometricCalibration
from edtk.findings.finding import rows_in_words
from edtk.fit.fitted_geometry import lengths, root_mean_square
from edtk.measure.parameters import TITLES, Parameter
from edtk.report.calibration_sections import (
    ROWS_SHOWN,
    Facts,
    budget_section,
    task_section,
    verdict_box,
)
from edtk.report.draw.residuals import left_out_errors, marker_residuals
from edtk.report.figures import new_figure
from edtk.report.page import (
    PICTURE_WIDTH,
    QUALITY,
    paragraph,
    picture,
    section,
    sentence,
    table,
)
from edtk.report.shown import left_out_sentence, places_of
from edtk.report.views.calibration import (
    ADVICE_OF_VISITS,
    MOST_MARKERS,
    of_the_total,
    robot_stands,
    total_expected,
)
from edtk.robots.frames import MM
from edtk.study.schema import describe_noise
from edtk.system.typing import Array

PICTURE_HEIGHT = 2.9
MOST_PICTURES = 8  # of markers


def measured_positions(found: GeometricCalibration) -> Facts:
    """What is in the file."""
    fit = found.fit
    left_out = len(found.left_out)
    return [
        ("Positions", f"{fit.data.count} in {len(fit.data)} visits of {fit.data.poses} poses"),
        ("Left out", f"{left_out} visits" if left_out else ""),
        ("Markers", ", ".join(fit.data.markers)),
        ("On the base", ", ".join(found.setting.references)),
        ("Stated noise", _stated(found)),
        ("Loads", _loads(fit.data.wrench)),
        ("Assumed", "; ".join(found.assumed)),
    ]


def _stated(found: GeometricCalibration) -> str:
    """The noise of the study, in words."""
    stated = found.setting.noise
    if stated.tracker is None:
        return f"{stated.reading:.3g} mm a coordinate"
    return describe_noise(found.setting.study.specification)


def evaluated_geometry(found: GeometricCalibration) -> Facts:
    """The place of the robot, and the options."""
    loss = (
        "poses that fit badly count less, as with t errors" if (found.fit.weights < 1).any() else ""
    )
    fit = f"nonlinear least squares, variances by restricted likelihood; {loss}".rstrip("; ")
    return [
        ("Robot in the instrument's frame", robot_stands(found.base)),
        ("Joints count", found.counting.words or "as the study says"),
        ("Known", found.study.specification.joints.known_in_words("\N{PLUS-MINUS SIGN}")),
        ("Known before", _told_before(found)),
        ("Fit", fit),
    ]


def _told_before(found: GeometricCalibration) -> str:
    """How much the prior tells; empty without one."""
    told = found.fit.told_before
    if told is None:
        return ""
    return f"tells as much as {told.count:.3g} of the {found.rank} parameters"


def _loads(wrench: Array) -> str:
    """How many poses are loaded."""
    loaded = int(wrench.any(axis=1).sum())
    return f"{loaded} of {len(wrench)} visits" if loaded else ""


def geometry_sections(found: GeometricCalibration) -> list[str]:
    """What a report says of the result, the verdict first."""
    return [
        _verdict(found),
        section(
            "How well are poses predicted?",
            paragraph(_prediction(found)),
            _quality(found),
            _left_out(found),
            paragraph("The poses that the others predict least:"),
            _worst(found),
        ),
        *_budget(found),
        *([] if found.tasks is None else [task_section(found.tasks)]),
        section("Residuals of the markers", paragraph(_noise(found)), *_residuals(found)),
        *_parameters(found),
        section("What can be told apart?", *_rank(found)),
    ]


def _verdict(found: GeometricCalibration) -> str:
    """The box at the top, the most important line first."""
    level = found.verdict
    first = QUALITY[level]
    if level != "bad":
        first = f"{first} {_expected(found)}"
    of_tasks = []
    if found.budget is not None:
        of_tasks = [
            total_expected(found.budget, found.in_tasks),
            *of_the_total(found.budget, of_visits=True),
        ]
    promise = [first, *(of_tasks if level != "bad" else ())]
    if not (found.findings or found.study.warnings):
        promise.append("Nothing is wrong: all that was asked for is told, and no pose surprises.")
    return verdict_box(found, promise, [sentence(one.words) for one in found.findings])


def _expected(found: GeometricCalibration) -> str:
    """The error to expect."""
    expected = f"Expect errors of {found.loo_rms_mm:.2g} mm (rms) in poses like these"
    if np.isnan(found.fit.placed):
        return f"{expected}."
    return f"{expected}, instead of {MM * found.fit.placed:.2g} mm by the drawing."


def _budget(found: GeometricCalibration) -> list[str]:
    """What makes up the error in the tasks; nothing without tasks."""
    if found.budget is None:
        return []
    model = "what the residuals show that the parameters do not explain"
    return [budget_section(found, found.budget, _stated(found), model, ADVICE_OF_VISITS)]


def _prediction(found: GeometricCalibration) -> str:
    """What the numbers of the table mean."""
    text = left_out_sentence(found.fit.share_inside)
    turns = found.fit.turns
    if turns is not None:
        rms = np.rad2deg(root_mean_square(turns.left_out))
        text += f" Orientations were {rms:.2g} deg (rms) off."
    if found.rho0_mm is None:
        return text
    return (
        f"{text} Wrong parameters leave {found.rho0_mm:.2g} mm (rho0) of {found.in_tasks.subject} "
        f"{found.in_tasks.place}; what the model leaves out comes on top of it."
    )


def _quality(found: GeometricCalibration) -> str:
    """Distances of measured from predicted positions."""
    fit = found.fit
    distance = MM * lengths(fit.left_out)
    rows = [
        *_placed(fit.placed),
        ["all parameters", *_distances(MM * lengths(fit.residual))],
        ["each pose by the others", *_distances(distance)],
    ]
    return table(["fitted", "rms [mm]", "mean [mm]", "largest [mm]"], rows)


def _placed(size: float) -> list[list[str]]:
    """The row of the drawing; none where differences of readings place nothing."""
    return [] if np.isnan(size) else [["base, markers alone", f"{MM * size:.3g}", "", ""]]


def _distances(values: np.ndarray) -> list[str]:
    """Root mean square, mean and largest."""
    known = values[np.isfinite(values)]
    return [f"{x:.3g}" for x in (np.sqrt((known**2).mean()), known.mean(), known.max())]


def _left_out(found: GeometricCalibration) -> str:
    """The picture of poses that were left out."""
    figure = new_figure(PICTURE_WIDTH, PICTURE_HEIGHT)
    left_out_errors(found.fit, figure.add_subplot())
    return picture(figure, "Distance of each marker from where the other poses predict it.")


def _worst(found: GeometricCalibration) -> str:
    """A table of the poses that the others predict least."""
    fit = found.fit
    distance = MM * lengths(fit.left_out)
    largest = np.nanmax(np.where(np.isfinite(distance), distance, -1.0), axis=1)
    rows = []
    for pose in np.argsort(-largest, kind="stable")[:ROWS_SHOWN]:
        i = int(np.nanargmax(np.where(np.isfinite(distance[pose]), distance[pose], -1.0)))
        apart = [f"{x:+.3f}" if np.isfinite(x) else "" for x in MM * fit.left_out[pose, i]]
        coordinates = int(fit.data.means.rows_seen[pose].sum())
        surprise = f"{fit.surprise[pose] / max(coordinates, 1):.2f}"
        named = rows_in_words(fit.data.rows_of_pose(int(pose))).partition(" ")[2]
        rows.append(
            [pose + 1, named, fit.data.markers[i], *apart, f"{largest[pose]:.3f}", surprise]
        )
    axes = [f"{axis} [mm]" for axis in "xyz"]
    header = ["pose", "rows", "marker", *axes, "distance [mm]", "squared error over expected"]
    return table(header, rows, full=True)


def _noise(found: GeometricCalibration) -> str:
    """What the errors of a pose are made of."""
    noise = found.fit.fitted.noise
    repeats = "as the study states"
    if noise.unknown:
        repeats = "as the residuals tell, with what the model leaves out of it"
    if noise.repeats:
        repeats = f"by {noise.repeats} differences of repeated readings"
    joints = float(np.max(noise.model_joints, initial=0.0))
    reading = float(np.max(noise.joints, initial=0.0))
    common = f", and joints repeat to {reading:.2g} mrad" if reading else ""
    turned = "" if noise.turn is None else f" and by {_degrees(noise.turn)} in orientation"
    text = (
        f"A reading scatters by {found.fit.reading:.2g} mm a coordinate{turned}{common}, {repeats}."
    )
    if not joints and not noise.model_white and not noise.model_turn:
        return f"{text} The residuals show nothing beyond that."
    sizes = {
        f"joints erred by up to {joints:.2g} mrad": joints,
        f"each coordinate by {noise.model_white:.2g} mm": noise.model_white,
        f"orientations by {_degrees(noise.model_turn or 0.0)}": noise.model_turn,
    }
    return (
        f"{text} The model leaves out more: it is as if "
        f"{' and '.join(words for words, size in sizes.items() if size)}, differently in each "
        "pose. Bands of predictions include it."
    )


def _degrees(mrad: float) -> str:
    """An angle [mrad] in degrees."""
    return f"{np.rad2deg(1e-3 * mrad):.2g} deg"


def _residuals(found: GeometricCalibration) -> list[str]:
    """A picture for each marker."""
    pictures = []
    names = found.fit.data.markers
    for i, name in enumerate(names[:MOST_PICTURES]):
        figure = new_figure(PICTURE_WIDTH, PICTURE_HEIGHT)
        marker_residuals(found.fit, i, figure.add_subplot())
        pictures.append(
            picture(figure, f"Residuals of marker {name}; the band is twice their usual size.")
        )
    more = len(names) - MOST_PICTURES
    if more > 0:
        pictures.append(paragraph(f"The residuals of {more} more markers are in residuals.csv."))
    return pictures


def _parameters(found: GeometricCalibration) -> list[str]:
    """A section for each kind of parameter."""
    parameters = found.fit.fitted.model.parameters
    named = found.fit.data.markers[:MOST_MARKERS]
    sections = []
    for place, title in TITLES.items():
        own = [one for one in parameters if one.place == place]
        listed = [one for one in own if one.place != "tool" or one.of in named]
        more = len({one.of for one in own}) - len({one.of for one in listed})
        rest = [paragraph(f"The places of {more} more markers are in k.json.")] if more else []
        if own:
            sections.append(section(title, _table(found, listed), *rest))
    return sections


def _table(found: GeometricCalibration, parameters: list[Parameter]) -> str:
    """Values and standard deviations, in their units."""
    rows = []
    for one in parameters:
        value = found.parameters[one.name]
        std = float(value["std"])
        places = places_of(std)
        shown = [f"{value['value']:+.{places}f}", f"{std:.{places}f}", one.unit]
        rows.append([one.name, *shown, one.words])
    return table(["parameter", "value", "std", "unit", "meaning"], rows, words=1, full=True)


def _rank(found: GeometricCalibration) -> list[str]:
    """The rank, what no pose could tell, and what these poses do not."""
    fit = found.fit
    text = f"{fit.rank} parameters can be told apart"
    if fit.open:
        text += f", of {fit.structural} that better poses would tell"
    parts = [
        paragraph(
            f"{text}. Others were asked for, and move the markers as these do: a minimal set is "
            "kept, and no prediction depends on which."
        )
    ]
    if fit.open:
        parts.append(paragraph("These poses leave open, and others would tell:"))
        parts.append(table(["not told by these poses"], [[one] for one in fit.open], 1, full=True))
    if fit.redundant:
        parts.append(
            table(["told by no pose"], [[one] for one in fit.redundant], words=1, full=True)
        )
    return parts
