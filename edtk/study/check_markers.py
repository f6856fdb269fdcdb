"""The checks of what a study measures, that need its robot."""

from typing import TYPE_CHECKING

from edtk.study.study_model import distance_names, is_reference, marker_kinds, marker_names

if TYPE_CHECKING:
    from edtk.study.study_objects import StudyObjects


def check_markers(study: "StudyObjects") -> None:
    """Check names and bodies of markers and distances, and the noise and weights that they need.

    Raises:
        UserError: One line that names the study, the key and what was expected.
    """
    _check_names(study)
    _check_bodies(study)
    _check_rows(study)
    measurement = study.specification.measurement
    kinds = set(marker_kinds(study))
    if "pose" in (kinds or {measurement.rows}) and measurement.sigma_deg is None:
        raise study.error(
            "measurement.sigma_deg", "expected, since rows = 'pose' measures rotations too"
        )
    if measurement.reference == "nominal" and not any(link.mass for link in study.robot.links):
        raise study.error(
            "measurement.reference",
            "'nominal' positions see the weight of the links, and the robot file gives no masses; "
            "expected mass_kg and center_m of its joints, or reference = 'unloaded'",
        )


def _check_names(study: "StudyObjects") -> None:
    """Each name once, and distances that end at markers that there are."""
    markers = marker_names(study)
    distances = distance_names(study)
    for key, names, before in (("marker", markers, ()), ("distance", distances, markers)):
        for i, name in enumerate(names):
            if name in (*before, *names[:i]):
                raise study.error(f"{key}.{i}.name", f"{name!r} is named twice")
    for i, distance in enumerate(study.specification.distance):
        if distance.marker is not None and distance.marker not in markers:
            known = ", ".join(markers) or "none"
            raise study.error(
                f"distance.{i}.marker", f"no marker {distance.marker!r}; this study has {known}"
            )


def _check_bodies(study: "StudyObjects") -> None:
    """Markers and distances sit on bodies of this robot."""
    known = study.robot.body_names
    markers = study.specification.marker
    bodies = [
        (f"marker.{i}", one.joint) for i, one in enumerate(markers) if not is_reference(study, one)
    ]
    bodies += [(f"distance.{i}", one.joint) for i, one in enumerate(study.specification.distance)]
    for key, joint in bodies:
        if joint is not None and joint not in known:
            raise study.error(
                f"{key}.joint", f"no joint {joint!r}; this robot has {', '.join(known)}"
            )


def _check_rows(study: "StudyObjects") -> None:
    """The rows of a sheet can be told apart: "a x" is a coordinate of a marker "a"."""
    names = [sensor.name for sensor in study.model.sensors]
    for i, name in enumerate(names):
        if name in names[:i]:
            key = "distance" if name in distance_names(study) else "marker"
            raise study.error(key, f"{name!r} is the name of a row in sheets; expected another one")
