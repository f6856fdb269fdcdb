"""What the report of a calibration of geometry rests on."""

import numpy as np

from edtk.calibration.geometry.geometric_calibration import GeometricCalibration
from edtk.report.page import facts, section
from edtk.system.typing import Array
from edtk.version import __version__

MM = 1e3


def geometry_facts(found: GeometricCalibration) -> str:
    """The section that lets somebody else repeat the result."""
    return section(
        "What was measured, and how was it evaluated?",
        facts("Measurements", _measured(found)),
        facts("Evaluation", _evaluated(found)),
    )


def _measured(found: GeometricCalibration) -> list[tuple[str, str]]:
    """The file, and what is in it."""
    fit = found.fit
    left_out = len(found.left_out)
    stated = found.setting.noise
    rows = [
        ("File", found.path.name),
        ("SHA-256", found.origin.sha256),
        ("Last changed", found.origin.changed),
        ("Positions", f"{fit.data.count} in {len(fit.data)} visits of {fit.data.poses} poses"),
        ("Left out", f"{left_out} visits" if left_out else ""),
        ("Markers", ", ".join(fit.data.markers)),
        ("On the base", ", ".join(found.setting.references)),
        ("Stated noise", f"{stated.reading:.3g} mm a coordinate"),
        ("Loads", _loads(fit.data.wrench)),
        ("Assumed", "; ".join(found.assumed)),
    ]
    return [(name, text) for name, text in rows if text]


def _evaluated(found: GeometricCalibration) -> list[tuple[str, str]]:
    """The study, the place of the robot, and the program."""
    study = found.study
    name = f"{study.path.name}, " if study.path is not None else ""
    loss = (
        "poses that fit badly count less, as with t errors" if (found.fit.weights < 1).any() else ""
    )
    rows = [
        ("Study", f"{name}SHA-256 begins with {study.digest}"),
        ("Robot", study.robot.name),
        ("Robot in the instrument's frame", robot_stands(found.base)),
        ("Joints count", found.counting.words or "as the study says"),
        (
            "Fit",
            f"nonlinear least squares, variances by restricted likelihood; {loss}".rstrip("; "),
        ),
        ("Program", f"edtk {__version__}"),
    ]
    return [(name, text) for name, text in rows if text]


def _loads(wrench: Array) -> str:
    """How many poses are loaded."""
    loaded = int(wrench.any(axis=1).sum())
    return f"{loaded} of {len(wrench)} visits" if loaded else ""


def robot_stands(base: Array) -> str:
    """Where the world of the drawing is in the frame of the instrument, in words."""
    from scipy.spatial.transform import Rotation

    vector = np.rad2deg(Rotation.from_matrix(base[:3, :3]).as_rotvec())
    place = ", ".join(f"{x:.2f}" for x in MM * base[:3, 3])
    turn = ", ".join(f"{x:.3f}" for x in vector)
    return f"at ({place}) mm, turned by the rotation vector ({turn}) deg"
