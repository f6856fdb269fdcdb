"""The heading of a report of a calibration."""

from edtk.study.study import Study

WORD = "Calibration"


def calibration_title(study: Study) -> str:
    """The study's title, which says that it is of a calibration."""
    title = study.specification.title
    return title if title.startswith(WORD) else f"{WORD}: {title}"
