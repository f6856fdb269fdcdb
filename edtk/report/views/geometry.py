"""Calibrations of geometry."""

import numpy as np

from edtk.calibration.geometry.geometric_calibration import GeometricCalibration
from edtk.findings.finding import notes
from edtk.fit.geometry.fitted_geometry import root_mean_square
from edtk.report.extension import extension_lines
from edtk.report.geometry_report import MOST_MARKERS, robot_stands
from edtk.report.shown import expected_rho0, left_out_line, places_of
from edtk.report.tables import name_width
from edtk.report.views.calibration import budget_lines
from edtk.robots.frames import MM


def geometric_calibration_text(found: GeometricCalibration) -> str:
    """Parameters, how well poses are predicted that were left out, and the verdict."""
    fit = found.fit
    lines = [
        f"{fit.data.count} positions of {len(fit.data.markers)} markers in {fit.data.poses} poses"
        + (f", {len(found.left_out)} visits left out" if found.left_out else ""),
        f"{fit.rank} parameters can be told apart"
        + (f" of {fit.structural} that better poses would tell" if fit.open else "")
        + "; each is added to what the drawing, the study's markers",
        "or the place of the robot say",
        f"robot in the instrument's frame: {robot_stands(found.base)}",
        *_parameters(found),
        *_redundant(found),
        *_quality(found),
    ]
    lines += extension_lines(found.extension)
    lines += notes(found.findings)
    lines += [f"assumed: {line}" for line in found.assumed]
    if found.check is not None:
        lines += ["posterior", found.check.summary()]
    return "\n".join([*lines, f"verdict: {found.verdict}"])


def _parameters(found: GeometricCalibration) -> list[str]:
    """A line for each parameter, but of the places of many markers for those of the first few."""
    named = found.fit.data.markers[:MOST_MARKERS]
    every = found.fit.fitted.model.parameters
    parameters = [one for one in every if one.place != "tool" or one.of in named]
    width = name_width([one.name for one in parameters], 6)
    lines = []
    for one in parameters:
        own = found.parameters[one.name]
        places = places_of(own["std"])
        value = f"{own['value']:10.{places}f} +- {own['std']:.{places}f} {one.unit}"
        lines.append(f"  {one.name:{width}}{value}  {one.words}")
    others = [one for one in every if one not in parameters]
    if others:
        units = dict.fromkeys(one.unit for one in others)
        std = " and ".join(
            f"{max(found.parameters[o.name]['std'] for o in others if o.unit == unit):.2g} {unit}"
            for unit in units
        )
        count = len({one.of for one in others})
        lines.append(
            f"  and the places of {count} more markers, each known to +- {std} or better; "
            "--out or --json says where they are"
        )
    return lines


def _redundant(found: GeometricCalibration) -> list[str]:
    """How many parameters are not fitted, since others do what they do."""
    count = len(found.fit.redundant)
    if not count:
        return []
    others = "1 other cannot" if count == 1 else f"{count} others cannot"
    return [f"{others} be told apart from these, and count as drawn; the report says which"]


def _turns(found: GeometricCalibration) -> list[str]:
    """How well orientations fit, where they were measured."""
    turns = found.fit.turns
    if turns is None:
        return []
    fit, left_out = (
        float(np.rad2deg(root_mean_square(part))) for part in (turns.residual, turns.left_out)
    )
    return [f"orientations: {fit:.3g} deg rms off in the fit, {left_out:.3g} deg left out"]


def _quality(found: GeometricCalibration) -> list[str]:
    """How well positions fit, and are predicted."""
    fit = found.fit
    noise = fit.fitted.noise
    joints = max(noise.model_joints.tolist(), default=0.0)
    sizes = {
        "each joint were off by {:.3g} mrad": joints,
        "each coordinate by {:.3g} mm": noise.model_white,
        "each orientation by {:.3g} deg": np.rad2deg(1e-3 * (noise.model_turn or 0.0)),
    }
    parts = " and ".join(text.format(size) for text, size in sizes.items() if size)
    left_out = f"errors that the model does not explain: as if {parts}, anew in each pose"
    if not parts:
        left_out = "the residuals show no errors that the model does not explain"
    if noise.unknown:
        size = f"the residuals tell the noise: a coordinate is off by {fit.reading:.3g} mm"
        beside = f"; besides as if {parts}, anew in each pose" if parts else ""
        left_out = f"{size}, with what the model leaves out of it{beside}"
    repeats = f"; repeats of readings scatter by {fit.reading:.3g} mm" if noise.repeats else ""
    if noise.repeats and noise.turn is not None:
        repeats += f" and {np.rad2deg(1e-3 * noise.turn):.3g} deg"
    alone = f"{MM * fit.placed:.4g} mm rms with base and tools fitted alone, "
    if np.isnan(fit.placed):
        alone = ""  # differences of readings place nothing
    return [
        f"distance of positions: {alone}{MM * fit.rms:.4g} mm rms with all fitted",
        left_out_line(found.loo_rms_mm, fit.share_inside),
        *_turns(found),
        *(
            [expected_rho0(found.rho0_mm, found.in_tasks), str(found.expected)]
            if found.rho0_mm is not None
            else []
        ),
        *budget_lines(found.budget, of_visits=True, planned=False),
        left_out + repeats,
    ]
