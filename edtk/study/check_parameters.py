"""The checks of a study of geometry that need its robot."""

from typing import TYPE_CHECKING

from edtk.model.geometry.all_parameters import all_parameters
from edtk.study.study_model import is_reference

if TYPE_CHECKING:
    from edtk.study.study_objects import StudyObjects


def check_parameters(study: "StudyObjects") -> None:
    """Check that the unknowns are of this robot, and that positions of the tool are measured.

    Raises:
        UserError: One line that names the study, the key and what was expected.
    """
    given = study.specification
    if given.parameters is None:
        if given.costs is not None:
            raise study.error(
                "costs", "plans of compliances alone do not heed it; expected [parameters] too"
            )
        return
    unknown = given.joints.unknown
    compliance = given.parameters.compliance
    if compliance is not None and tuple(compliance) != unknown:
        raise study.error(
            "joints.unknown",
            "differs from parameters.compliance; expected the same joints, or one of both keys",
        )
    for name in unknown:
        if name not in study.robot.joint_names:
            names = ", ".join(study.robot.joint_names)
            raise study.error("parameters.compliance", f"no joint {name!r}; this robot has {names}")
    try:
        chosen = all_parameters(
            study.robot, (), given.parameters.geometry, (), given.parameters.base, False
        )
    except ValueError as error:
        raise study.error("parameters.geometry", str(error)) from error
    if not chosen and not given.parameters.tool and not unknown:
        raise study.error("parameters", "leaves nothing unknown; expected geometry, base or tool")
    _check_measured(study)
    _check_unused(study)


def _check_measured(study: "StudyObjects") -> None:
    """Positions of markers on the tool, and reference points on the base, and nothing else."""
    given = study.specification
    if given.distance:
        raise study.error("distance", "a study of geometry knows no distances; expected markers")
    full = given.measurement.rows == "pose"
    if full and not given.marker:
        raise study.error("marker", "expected one with a name, whose poses are measured")
    if given.measurement.reference != "unloaded":
        raise study.error(
            "measurement.reference",
            "positions of a study of geometry are absolute anyway; leave the key out",
        )
    if given.measurement.sigma_mm is None:
        raise study.error(
            "measurement.sigma_mm", "expected, the standard deviation of a coordinate [mm]"
        )
    for i, marker in enumerate(given.marker):
        if is_reference(study, marker):
            if marker.rows == "pose":
                message = "points on the base have positions alone; expected 'position'"
                raise study.error(f"marker.{i}.rows", message)
        elif marker.rows not in (None, given.measurement.rows):
            message = "expected that of measurement.rows for all markers on the tool"
            raise study.error(f"marker.{i}.rows", message)
        if marker.joint is not None and not is_reference(study, marker):
            raise study.error(
                f"marker.{i}.joint",
                "markers of a study of geometry sit on the tool, or on the 'base' as references",
            )
    if given.marker and all(is_reference(study, marker) for marker in given.marker):
        raise study.error("marker", "expected one on the tool besides those on the base")


def _check_unused(study: "StudyObjects") -> None:
    """Keys that a calibration of geometry would not heed are refused, not passed over."""
    given = study.specification
    noise = given.noise
    unused = {
        "joints.known_rad_per_Nm": bool(given.joints.known_rad_per_Nm),
        "noise.tracker_position_mm": noise is not None and noise.has_tracker,
        "task": given.task is not None,
        "prior": given.prior != type(given.prior)(),
    }
    for i, pose in enumerate(given.test_poses):
        key = "test_pose" if len(given.test_poses) == 1 else f"test_pose.{i}"
        unused[f"{key}.robust_deg"] = bool(pose.robust_deg)
        unused[f"{key}.lever_mm"] = bool(pose.lever_mm)
        unused[f"{key}.payload"] = pose.payload is not None
    instead = {
        "joints.known_rad_per_Nm": "list the joint in parameters.compliance",
        "noise.tracker_position_mm": "give measurement.sigma_mm",
        "task": "give test poses",
        "prior": "its estimate rests on the positions alone",
    }
    for key, is_given in unused.items():
        if is_given:
            why = instead.get(key, "give more test poses, with a load each")
            raise study.error(key, f"a study of geometry does not heed this key; {why}")
