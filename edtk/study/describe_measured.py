"""What a study measures, in words."""

from typing import TYPE_CHECKING

from edtk.study.study_model import marker_kinds

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
    given = study.specification
    kinds = marker_kinds(study)
    poses = kinds.count("pose")
    positions = kinds.count("position")
    distances = len(given.distance)
    parts = [
        f"{count} {kind}{'s' if count > 1 else ''}"
        for count, kind in ((positions, "position"), (poses, "pose"), (distances, "distance"))
        if count
    ]
    return f"{', '.join(parts)}{since}"
