"""What a study measures, in words."""

from typing import TYPE_CHECKING

from edtk.model.sensors.distance import Distance
from edtk.model.sensors.pose_marker import PoseMarker

if TYPE_CHECKING:
    from edtk.study.study_objects import StudyObjects


def describe_measured(study: "StudyObjects") -> str:
    """How many markers, poses and distances, and what they are measured from.

    Args:
        study: Its keys, checked.
    """
    model = study.model
    since = ", from the nominal robot" if study.is_absolute else ""
    if not model.sensors:
        return f"{model.rows}{since}"
    distances = sum(isinstance(sensor, Distance) for sensor in model.sensors)
    poses = sum(isinstance(sensor, PoseMarker) for sensor in model.sensors)
    positions = len(model.sensors) - distances - poses
    parts = [
        f"{count} {kind}{'s' if count > 1 else ''}"
        for count, kind in ((positions, "position"), (poses, "pose"), (distances, "distance"))
        if count
    ]
    return f"{', '.join(parts)}{since}"
