"""What a calibration's report rests on: the data, the load, the tool, the options and the model."""

import numpy as np

from edtk.calibration.calibration import Calibration
from edtk.inference.measurements import Measurements
from edtk.report.page import facts, section
from edtk.study.describe_measured import describe_measured
from edtk.system.typing import Array
from edtk.version import __version__


def calibration_facts(found: Calibration) -> str:
    """The section that lets somebody else repeat the result."""
    return section(
        "What was measured, and how was it evaluated?",
        facts("Measurements", _measured(found)),
        facts("Evaluation", _evaluated(found)),
    )


def _measured(found: Calibration) -> list[tuple[str, str]]:
    """The file, the noise, the load and the tool."""
    data = found.data
    poses = int(data.pose.max()) + 1
    coordinates = data.deflection.shape[1]
    tool = found.study.specification.tool
    place = found.study.robot.tool_is_from
    payload = found.study.specification.payload
    turned = f", turned by {_vector(tool.rpy_deg)} deg (rpy)" if any(tool.rpy_deg) else ""
    rows = [
        ("File", found.path.name),
        ("SHA-256", found.origin.sha256),
        ("Last changed", found.origin.changed),
        ("Rows", _rows(len(data), poses, coordinates)),
        ("Stated noise", _stated_noise(data)),
        ("Estimated noise", _estimated_noise(found)),
        ("Load", _load(data.wrench)),
        ("Tool", f"{_vector(tool.position_mm)} mm from the {place}{turned}"),
        ("Marker", _marker(found)),
        ("Payload", "" if payload is None else payload.describe()),
        ("Displacements", "from the nominal robot" if found.study.is_absolute else ""),
    ]
    return [(name, text) for name, text in rows if text]


def _evaluated(found: Calibration) -> list[tuple[str, str]]:
    """The study, the options and the program."""
    study = found.study
    asked = found.asked
    name = f"{asked.path.name}, " if asked.path is not None else ""
    pm = "\N{PLUS-MINUS SIGN}"
    known = [
        f"{joint} {one.value:g} {pm} {one.deviation:g} rad/(N m)"
        for joint, one in study.specification.joints.known.items()
    ]
    plan = found.fitted.plan
    rows = [
        ("Study", f"{name}SHA-256 begins with {asked.digest}"),
        ("Robot", study.robot.name),
        ("Model", _model(found)),
        ("Fit", _fit(found)),
        ("Noise", "as stated" if found.fit.known else "estimated (sigma unknown)"),
        ("Repetitions", "noise that they share is estimated" if found.fitted.common_noise else ""),
        ("Plan", "none given" if plan is None else f"{plan.experiments} experiments, compared"),
        ("Sheet", "taken as it is, even if columns look misread" if found.origin.as_is else ""),
        ("Known", ", ".join(known)),
        ("Posterior", "sampled" if found.check is not None else "not sampled"),
        ("Program", f"edtk {__version__}"),
    ]
    return [(name, text) for name, text in rows if text]


def _model(found: Calibration) -> str:
    """The model that was fitted, and why."""
    tenth = "moves a compliance by more than a tenth of its standard deviation"
    if found.fitted.nonlinear:
        return f"the loaded equilibrium, as it {tenth}"
    if found.origin.linear:
        return "linear, as asked for"
    return f"linear; the loaded equilibrium is fitted where it {tenth}"


def _fit(found: Calibration) -> str:
    """The loss."""
    if found.fit.robust:
        return "robust: Huber's loss, by which outliers count less"
    if found.fit.too_few_for_robust:
        return "least squares, as there are too few coordinates for the robust fit asked for"
    return "weighted least squares"


def _stated_noise(data: Measurements) -> str:
    """The stated sigma of positions and of rotations, and whether errors are correlated."""
    sigma = data.sigma
    turns = np.rad2deg(sigma[~data.lengths])
    parts = []
    if data.lengths.any():
        parts.append(f"{_range(1e3 * sigma[data.lengths])} mm for each coordinate")
    if len(turns):
        parts.append(f"{_range(turns)} deg for each rotation")
    text = ", ".join(parts)
    if data.tracker is not None:
        text = f"{text}, correlated within a visit as the study's [noise] states"
    elif data.covariance is not None:
        text = f"{text}, correlated within a row as the sheet states"
    return text


def _estimated_noise(found: Calibration) -> str:
    """The sigma by the residuals."""
    if not np.isfinite(found.sigma_hat):
        return "unknown: as many coordinates as parameters were measured"
    times = f"{found.fit.scale:.3g} times the stated"
    return f"{1e3 * found.sigma_hat:.3g} mm, {times}, from {found.fit.dof} degrees of freedom"


def _rows(count: int, poses: int, coordinates: int) -> str:
    """How much was measured."""
    several = f"{count} measurement{'s' * (count > 1)} in {poses} pose{'s' * (poses > 1)}"
    return f"{several}, {coordinates} coordinate{'s' * (coordinates > 1)} each"


def _load(wrench: Array) -> str:
    """The load, where it is one, or the sizes of several."""
    # Sorting a million equal loads takes seconds.
    different = wrench[:1] if (wrench == wrench[0]).all() else np.unique(wrench, axis=0)
    if len(different) == 1:
        force = f"F = {_vector(different[0, :3])} N"
        return f"{force}, T = {_vector(different[0, 3:])} N m" if different[0, 3:].any() else force
    forces = np.linalg.norm(different[:, :3], axis=1)
    return f"{len(different)} different ones, with forces of {_range(forces)} N"


def _marker(found: Calibration) -> str:
    """The instruments of the study, or how far markers are from the tool point; empty for none."""
    model = found.study.model
    if model.sensors:
        names = ", ".join(sensor.name for sensor in model.whole_instruments)
        return f"{describe_measured(found.study)}: {names}"
    marker = found.data.marker
    if not marker.any():
        return ""
    lengths = 1e3 * np.linalg.norm(np.unique(marker, axis=0), axis=1)
    return f"{len(lengths)} in the tool frame, {_range(lengths)} mm from the tool point"


def _range(values: Array) -> str:
    """One number, or the least and the largest."""
    low = f"{values.min():.4g}"
    high = f"{values.max():.4g}"
    return low if low == high else f"{low} to {high}"


def _vector(values: Array | tuple[float, ...]) -> str:
    """A vector as a person writes it."""
    return f"({', '.join(f'{value:g}' for value in values)})"
