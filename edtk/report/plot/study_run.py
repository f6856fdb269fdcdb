"""Picture of a study's run."""

from typing import Any

from edtk.report.draw.criterion_by_size import criterion_by_size
from edtk.report.panels import panels
from edtk.study.study_run import StudyRun


def study_run(run: StudyRun, ax: Any = None) -> Any:
    """Draw the main criterion against the number of experiments, for every kind of plan.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (8.6, 4.8))[0, 0]
    criterion_by_size(run, ax)
    ax.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax
