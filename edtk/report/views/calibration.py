"""Calibrations of springs and of geometry, their posteriors and predictions."""

from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.model_left import SHARE
from edtk.findings.finding import notes, row_names, shown_probability
from edtk.fit.estimate_noise import NoiseEstimate
from edtk.fit.fitted_geometry import root_mean_square
from edtk.fit.identify import Identification
from edtk.fit.posterior import Posterior
from edtk.measure.expected_error import ErrorBudget, JointPart
from edtk.measure.pose_table import TURN_COLUMN, coordinate_columns
from edtk.measure.task import Tasks
from edtk.report.draw.bars import intervals
from edtk.report.draw.posterior import LabelledSamples, corner
from edtk.report.draw.residuals import ResidualPanel, residuals
from edtk.report.figures import panels
from edtk.report.show.page import ShownPage
from edtk.report.show.stage import stage_of_calibration
from edtk.report.shown import (
    SMALL,
    digits,
    displacement_in_words,
    expected_rho0,
    left_out_line,
    places_of,
    with_digits,
)
from edtk.report.tables import MOST_LINES, name_width, notebook_table, percent, text_table
from edtk.robots.frames import MM
from edtk.system.typing import Array

if TYPE_CHECKING:
    from edtk.calibration.calibration import Calibration, Extension
    from edtk.calibration.geometric_calibration import GeometricCalibration
    from edtk.calibration.posterior_check import PoseError, PosteriorCheck
    from edtk.calibration.prediction import Prediction
    from edtk.calibration.spring_calibration import SpringCalibration


ERRORS = ("error_mm", "error_deg")
# What the parts leave out where displacements are counted from the rigid robot.
NOT_IN_IT = "errors of the robot's geometry, and of its place in the measuring frame"
MOST_MARKERS = 12  # whose places are listed
# What makes each part smaller.
ADVICE = {
    "noise": "measure more experiments, or with less noise",
    "model": "look for the springs that the model lacks, with edtk identify --extend",
    "load": "weigh the load, and measure its direction",
    "tool": "measure where the tool point and the marker are",
    "rigid_joints": "identify the joints that count as rigid too, or bound their compliances",
    "known_joints": "identify the joints that count as known too, or state a smaller std",
    "drift": "measure unloaded and loaded readings shortly after each other",
    "repeatability": "repeat the measurements",
}
# Where a study lists the joints whose compliances it asks for.
SPRINGS = "joints.unknown"
SPRINGS_OF_VISITS = "parameters.compliance"
# Where nothing is known of what springs leave out.
UNSTATED = "plan with [noise] model_error_percent = {percent:g}, which tells friction from springs"
# What differs where visits tell geometry: nothing is linear, and joints miss the tasks themselves.
ADVICE_OF_VISITS = ADVICE | {
    "model": "ask for more parameters, as the model leaves that much out of a coordinate",
    "repeatability": "none by a calibration: the joints come back no better",
}

MODELS_HEADER = ["model", "log evidence", "weight", "left out [mm]"]
IN_TASKS = "expected [mm]"
EXTENDED = "extended.toml"  # the study of the chosen model


def error_budget(found: ErrorBudget, of_visits: bool = False, planned: bool = True) -> str:
    """The expected error in the task, with its parts; by displacements, or by visits.

    Before a day nothing is known of the drawing's errors: without compensation there is the load.
    """
    advice = ADVICE_OF_VISITS if of_visits else ADVICE
    if found.assumed_share and not of_visits:
        advice = advice | {"model": UNSTATED.format(percent=100 * found.assumed_share)}
    by = "by the load, " if of_visits and planned else ""
    parts = ", ".join(
        f"{name.replace('_', ' ')} {1e3 * part:.2g}" for name, part in found.parts.items() if part
    )
    without = f"  not in it: {NOT_IN_IT}\n" if found.absolute else ""
    joints = "".join(f"  {line}\n" for line in assumed_joints(found, of_visits))
    return (
        f"total expected error {1e3 * found.total:.2g} mm (root mean square), "
        f"{1e3 * found.uncompensated:.2g} mm {by}without compensation\n"
        f"  of it [mm]: {parts}\n{joints}{without}"
        f"  to improve first: {advice[found.largest]}"
    )


def budget_lines(
    found: ErrorBudget | None, of_visits: bool = False, planned: bool = True
) -> list[str]:
    """The same as lines; none where the budget is not known."""
    return [] if found is None else [error_budget(found, of_visits, planned)]


def assumed_joints(found: ErrorBudget, of_visits: bool) -> list[str]:
    """A sentence for each joint that is not identified, and for the model, with their parts."""
    key = SPRINGS_OF_VISITS if of_visits else SPRINGS
    counted = [part for part in found.joints if part.error > SHARE * found.total]
    lines = [assumed_joint(part, key) for part in counted]
    if found.assumed_share and found.model > SHARE * found.total:
        lines.append(
            f"{1e3 * found.model:.2g} mm by bearings, links and friction, which springs of joints "
            f"leave out: assumed as {100 * found.assumed_share:g} % of what the springs do; "
            "model_error_percent in [noise] states another share, or 0"
        )
    return lines


def assumed_besides(found: ErrorBudget, of_visits: bool = False) -> str:
    """What a report says of these beside what was measured; empty without any."""
    lines = assumed_joints(found, of_visits)
    return f"The rest is assumed: {'; '.join(lines)}" if lines else ""


def total_expected(found: ErrorBudget, tasks: Tasks) -> str:
    """The error to expect, in a sentence of a report."""
    return (
        f"Expect a total error of {1e3 * found.total:.2g} mm {tasks.place} after compensation, "
        f"instead of {1e3 * found.uncompensated:.2g} mm without."
    )


def of_the_total(found: ErrorBudget, of_visits: bool = False) -> list[str]:
    """What of the total was measured, and what rests on joints that nobody measured."""
    assumed = assumed_besides(found, of_visits).replace("+-", "\N{PLUS-MINUS SIGN}")
    if not assumed:
        return []
    made = f"{1e3 * found.measured:.2g} mm"
    return [f"The measurements, with their load and tool, make {made} of the total. {assumed}."]


def assumed_joint(part: JointPart, key: str = SPRINGS) -> str:
    """What is assumed of a joint, and what that makes of the error.

    Args:
        part: The joint.
        key: The key of a study that lists the joints to identify.
    """
    joint = part.joint
    error = f"{1e3 * part.error:.2g} mm"
    told = ""
    if part.told < joint.std:
        told = f"; the measurements tell it to {part.told:.1g}: list it in {key}"
    if joint.rigid:
        size = f"{joint.std:.2g} rad/(N m)"
        rigid = f"which counts as rigid: {size} assumed, {joint.source}"
        return f"{error} by {joint.name}, {rigid}{told}"
    known = f"{joint.compliance:.2g} +- {joint.std:.2g} rad/(N m)"
    return f"{error} by {joint.name}, which counts as known: {known}{told}"


def calibration_show(found: "Calibration") -> ShownPage:
    """The poses of the sheet, with the distances of their readings from the fit."""
    return ShownPage(stage_of_calibration(found))


def extension_lines(found: "Extension | None") -> list[str]:
    """Lines for terminals; none where nobody asked for models."""
    if found is None:
        return []
    header, rows = models_table(found)
    return [
        f"which model the sheet needs, of {found.tried} that were weighed",
        text_table(header, rows),
        *models_sentences(found),
    ]


def models_table(found: "Extension") -> tuple[list[str], list[list[str]]]:
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
    return MODELS_HEADER + [IN_TASKS] * tells, rows


def models_sentences(found: "Extension") -> list[str]:
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
            f"this is the result of the first model; {EXTENDED} beside k.json is its study, for "
            "predictions and commands"
        )
    return sentences


def spring_calibration_text(found: "SpringCalibration") -> str:
    """Compliances, how well they fit, the accuracy to expect, and the verdict."""
    lines = [*_compliances(found), *_fit(found), *_rows(found), *_accuracy(found)]
    lines += extension_lines(found.extension)
    if found.check is not None:
        lines += ["posterior", found.check.summary()]
    return "\n".join([*lines, *notes(found.findings), f"verdict: {found.verdict}"])


def _compliances(found: "SpringCalibration") -> list[str]:
    """Estimates with standard deviations, and their correlation."""
    fit = found.fit
    names = found.parameters
    m, rows = fit.residual.shape
    poses = found.data.pose.max() + 1
    width = name_width(names, 6)
    loss = ", Huber's loss" if fit.robust and not found.fitted.untold else ""
    loss += ", loaded equilibrium" if found.fitted.nonlinear else ", linear model"
    lines = [f"{m} measurements of {poses} poses, {m * rows} coordinates{loss}"]
    for name, k, std, unit in zip(names, fit.k, fit.std, found.study.model.units, strict=True):
        lines.append(f"  {name:{width}}{digits(k, std):>12} +- {std:.1e} {unit}")
    if found.part is not None:
        rigid = ", ".join(found.part.rigid)
        lines.append(f"  not told by the measurements, and taken as rigid: {rigid}")
    if found.assumed:
        lines.append(f"  {found.assumed}")
    if found.interest:
        lines.append("of interest")
        unit = found.asked.model.unit
        wide = name_width(tuple(found.interest), 6)
        for name, (value, std) in found.interest.items():
            lines.append(f"  {name:{wide}}{digits(value, std):>12} +- {std:.1e} {unit}")
    lines.append("correlation")
    for name, row in zip(names, fit.correlation, strict=True):
        lines.append(f"  {name:{width}}" + "".join(f"{c:8.3f}" for c in row))
    return lines


def _fit(found: "SpringCalibration") -> list[str]:
    """Chi-square and the noise."""
    fit = found.fit
    p = (
        ""
        if fit.p_value is None
        else f", probability of more {shown_probability(fit.p_value, 3).removeprefix('= ')}"
    )
    lines = [f"chi-square {fit.chi2:.5g} with {fit.dof} degrees of freedom{p}"]
    if np.isfinite(fit.scale):
        lines.append(f"sigma from the residuals {1e3 * found.sigma_hat:.4g} mm")
    out = found.fitted.left_out
    if out is not None and np.isfinite(out.rms):
        lines.append(left_out_line(1e3 * out.rms, out.share_with_model))
    if found.noise is not None:
        lines.append(_parts_of_noise(found.noise))
    return lines


def _parts_of_noise(noise: NoiseEstimate) -> str:
    """What visits and markers tell of tracker, joints and model."""
    parts = [
        f"tracker {noise.tracker:.3g} times the stated",
        f"joints return within {noise.joints:.2g} deg",
        f"the model is off by {1e3 * noise.discrepancy:.2g} mm",
    ]
    told = [part for part, known in zip(parts, noise.told, strict=True) if known]
    return f"noise by visits and markers: {', '.join(told)}"


def _accuracy(found: "SpringCalibration") -> list[str]:
    """The error to expect in the test pose; nothing without one."""
    lines = []
    if found.verdict == "bad":
        lines.append("if nothing else were wrong:")
    if found.study.target is not None:
        value, (low, high) = found.fitted.noise_fit.accuracy(found.study.target)
        interval = f", with 95 % between {1e3 * low:.5g} and {1e3 * high:.5g} mm"
        by = f"by the noise alone, {found.study.tasks.place}"
        lines.append(f"rho0 {1e3 * value:.5g} mm {by}{'' if low == high else interval}")
    if found.budget is not None:
        lines.append(error_budget(found.budget))
    if found.study.target is not None:
        lines.append(str(found.expected))
    if found.rho0_bias and not found.fitted.nonlinear:
        bias = f"{1e3 * found.rho0_bias:.3g} mm"
        lines.append(f"beside it the linear model leaves an error of {bias}")
    return lines


def _rows(found: "SpringCalibration") -> list[str]:
    """The pose that fits least, the row that counts most, and the outliers."""
    fit = found.fit
    pose = found.data.pose
    lengths = found.data.lengths
    squares = np.bincount(pose, np.where(lengths, fit.residual**2, 0.0).sum(axis=1))
    of_pose = squares / np.maximum(np.bincount(pose, lengths.sum(axis=1)), 1)
    worst = int(of_pose.argmax())
    size = f"{1e3 * np.sqrt(of_pose[worst]):.4g} mm"
    i, j = np.unravel_index(fit.leverage.argmax(), fit.leverage.shape)
    turn = found.data.turn
    column = coordinate_columns(fit.residual.shape[1])[j]
    column = column if turn is None or not turn[i] else TURN_COLUMN
    lines = [
        f"largest residuals in pose {worst + 1}: {size} root mean square",
        f"largest leverage {fit.leverage[i, j]:.3f}: row {i + 1}, {column}",
    ]
    if len(fit.outliers):
        rows = row_names(fit.outliers.tolist())
        lines.append(f"outliers ({len(fit.outliers)}): {rows}")
    return lines


def spring_calibration_notebook(found: "SpringCalibration") -> str:
    """A row for each compliance, and the findings."""
    rows = []
    for row in found.to_frame().to_dict(orient="records"):
        std = row["std"]
        interval = f"{digits(row['low_95'], std)} .. {digits(row['high_95'], std)}"
        cells = [row["joint"], row["parameter"], digits(row["k"], std), f"{std:.1e}"]
        rows.append([*cells, interval, row["unit"]])
    header = ["joint", "parameter", "compliance", "std", "95 % interval", "unit"]
    said = [f"{seen.severity.name.lower()}: {seen.words}" for seen in found.findings]
    return notebook_table(found.headline(), header, rows, said)


def spring_calibration_plot(found: "SpringCalibration", ax: Any = None) -> Any:
    """Draw 95 % intervals of the compliances, and the residuals below them.

    Returns:
        The axes: intervals, residuals of positions [mm] and, where measured, of rotations [deg].
    """
    fit = found.fit
    parts = ResidualPanel.of(fit, found.data.turn)
    axes = panels(ax, 1 + len(parts), 1, (6.4, 2.6 + 2.8 * len(parts)))[:, 0]
    intervals(fit, found.parameters, found.study.model.units, axes[0])
    residuals(fit, axes[1:], parts)
    axes[0].set_title(_title(found), fontsize=10)
    return axes


def _title(found: "SpringCalibration") -> str:
    """The accuracy to expect, and the verdict."""
    if found.study.target is None:
        return f"verdict: {found.verdict}"
    rho0 = 1e3 * found.fitted.noise_fit.accuracy(found.study.target)[0]
    return f"rho0 = {rho0:.4g} mm, verdict: {found.verdict}"


def robot_stands(base: Array) -> str:
    """Where the world of the drawing is in the frame of the instrument, in words."""
    from scipy.spatial.transform import Rotation

    vector = np.rad2deg(Rotation.from_matrix(base[:3, :3]).as_rotvec())
    place = ", ".join(f"{x:.2f}" for x in MM * base[:3, 3])
    turn = ", ".join(f"{x:.3f}" for x in vector)
    return f"at ({place}) mm, turned by the rotation vector ({turn}) deg"


def geometric_calibration_text(found: "GeometricCalibration") -> str:
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


def _parameters(found: "GeometricCalibration") -> list[str]:
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


def _redundant(found: "GeometricCalibration") -> list[str]:
    """How many parameters are not fitted, since others do what they do."""
    count = len(found.fit.redundant)
    if not count:
        return []
    others = "1 other cannot" if count == 1 else f"{count} others cannot"
    return [f"{others} be told apart from these, and count as drawn; the report says which"]


def _turns(found: "GeometricCalibration") -> list[str]:
    """How well orientations fit, where they were measured."""
    turns = found.fit.turns
    if turns is None:
        return []
    fit, left_out = (
        float(np.rad2deg(root_mean_square(part))) for part in (turns.residual, turns.left_out)
    )
    return [f"orientations: {fit:.3g} deg rms off in the fit, {left_out:.3g} deg left out"]


def _quality(found: "GeometricCalibration") -> list[str]:
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


def identification_text(fit: Identification) -> str:
    """The headline, and a row a compliance with its 95 % interval [rad/(N m)]."""
    table = fit.to_frame().to_string(index=False, float_format="{:.4g}".format)
    return f"{fit.headline()}\n{table}"


def pose_error_text(error: "PoseError") -> str:
    """Error after compensation, and displacement under the task's load [mm]."""
    place = error.place.removeprefix("in the ").removeprefix("in ")
    text = (
        f"{place}: rho0 {1e3 * error.rho0:.6f} +- {1e3 * error.rho0_error:.6f} mm, "
        f"by the fit, Eq. (20), {1e3 * error.rho0_fit:.6f} mm\n"
        f"error after compensation below {1e3 * error.error_95:.6f} mm with probability 95 %"
    )
    if error.displacement_95 is None:
        return text
    axes, which = displacement_in_words(error.displacement_95, error.displaced)
    return f"{text}\ndisplacement under the task's load{which}, 95 % intervals [mm]: {axes}"


def prediction_text(found: "Prediction") -> str:
    """A line for each reading, and the comparison."""
    width = max([len(name) for name in found.markers] + [6])
    lengths = np.flatnonzero(found.lengths)
    shown = lengths if found.what == "positions" else np.arange(len(found.columns))
    names = ", ".join(found.columns[j].rpartition("_")[0].replace("_", " ") for j in shown)
    units = "/".join(dict.fromkeys(found.columns[j].rpartition("_")[2] for j in shown))
    named = f"{'marker':{width}}  " if found.markers else ""
    lines = [f"  row  {named}{names} and half the 95 % band [{units}]"]
    for i, one in enumerate(found.readings()[:MOST_LINES]):
        values = "".join(
            f"{one[column]:12.3f} +-{one[f'band_{column}']:.3f}"
            for column in (found.columns[j] for j in shown)
            if column in one
        )
        error = next((f"  error {one[key]:.3f}" for key in ERRORS if key in one), "")
        note = "" if one.get("test", True) else " (places the tool)"
        marker = f"{found.markers[i]:{width}}" if found.markers else ""
        lines.append(f"{one['row']:5d}  {marker}{values}{error}{note}")
    more = len(found.row) - MOST_LINES
    if more > 0:
        lines.append(f"  ... and {more} more, in --json or --out")
    if len(found.errors):
        lines.append(
            f"{int(found.tests.sum())} measured {found.what}: errors {found.mean_mm:.4g} mm mean, "
            f"{found.rms_mm:.4g} mm rms, {found.max_mm:.4g} mm largest; "
            f"{100 * found.share_inside:.1f} % of the coordinates inside their 95 % bands"
        )
    if found.turn_rms_deg is not None:
        what = "orientations" if found.what == "positions" else "rotations"
        lines.append(f"{what}: {found.turn_rms_deg:.3g} deg rms off")
    return "\n".join(lines)


def posterior_text(found: Posterior) -> str:
    """The headline, and a row a parameter with its 95 % interval."""
    table = found.to_frame().to_string(index=False, float_format="{:.4g}".format)
    return f"{found.headline()}\n{table}"


def posterior_check_text(check: "PosteriorCheck") -> str:
    """Standard deviations beside those of the fit, intervals, noise, and the test pose."""
    column, label = check.compared
    width = name_width(check.table["parameter"], 8)
    units = check.table["unit"].unique()
    lines = [
        check.posterior.quality,
        f"{'param':{width}}{'std posterior':>14}{label:>17}{'ratio':>9}{'+- (MC)':>9}"
        f"{'95 % interval':>26}{'effective samples':>19}{'  unit' * (len(units) > 1)}",
    ]
    table = check.table
    for row, std in zip(table.itertuples(), table["std_posterior"].tolist(), strict=True):
        form = f".{places_of(std)}f" if std >= SMALL else ".4e"
        interval = f"{row.low_95:{form}} to {row.high_95:{form}}"
        lines.append(
            f"{row.parameter:{width}}{std:14.5g}{getattr(row, column):17.5g}"
            f"{row.ratio:9.4f}{row.ratio_error:9.4f}"
            f"{interval:>26}{row.effective_samples:19.0f}{f'  {row.unit}' * (len(units) > 1)}"
        )
    if len(units) == 1:
        lines.append(f"standard deviations and intervals in {units[0]}")
    if check.rest:
        lines.append(check.rest)
    if check.ratio_to_expect != 1:
        ratio = f"{check.ratio_to_expect:.4f}"
        lines.append(f"as sigma was estimated, a ratio of {ratio} is to be expected")
    for name, (median, low, high) in check.noise_intervals.items():
        lines.append(f"{name}: {median:.4g}, 95 % interval {low:.4g} to {high:.4g}")
    if check.pose is not None:
        lines.append(check.pose.summary())
    return "\n".join(lines)


def posterior_check_notebook(check: "PosteriorCheck") -> str:
    """A row for each parameter, and the test pose."""
    column, label = check.compared
    rows = []
    for row in check.table.to_dict(orient="records"):
        std = row["std_posterior"]
        mean = with_digits(row["mean"], std)
        ratio = f"{row['ratio']:.3f} \u00b1 {row['ratio_error']:.3f}"
        cells = [row["parameter"], mean, f"{std:.2e}", f"{row[column]:.2e}", ratio, row["unit"]]
        rows.append(cells)
    notes = [] if check.pose is None else [check.pose.headline()]
    header = ["parameter", "mean", "std", label, "ratio", "unit"]
    return notebook_table(check.headline(), header, rows, notes)


def posterior_check_plot(check: "PosteriorCheck", ax: Any = None) -> Any:
    """Draw each parameter, and each pair of them; lines are at the reference.

    Returns:
        The axes (d, d); those above the diagonal are empty.
    """
    shown = LabelledSamples.of(check)
    d = len(shown.labels)
    axes = panels(ax, d, d, (1.6 + 1.55 * d, 1.6 + 1.55 * d), sharex="col")
    corner(shown, axes)
    if ax is None:
        title = f"Posterior, with contours that hold 39 % and 86 %; lines: {check.reference}"
        axes[0, 0].figure.suptitle(title, fontsize=11)
    return axes
