"""The files of a comparison: a report to read, and its figures."""

from pathlib import Path
from typing import TYPE_CHECKING

from edtk.report.comparison.efficiencies import Efficiencies
from edtk.report.comparison.in_each_task import PICTURE
from edtk.report.comparison_report import comparison_report
from edtk.report.draw.criterion_by_size import LONGEST_LABEL, criterion_by_size
from edtk.report.draw.heat_map import heat_map
from edtk.report.draw.name_ticks import room_for
from edtk.report.draw.task_errors import task_errors
from edtk.report.new_figure import new_figure
from edtk.report.png import png
from edtk.study.study_run import StudyRun
from edtk.system.atomic_file import Content
from edtk.system.errors import shortened

if TYPE_CHECKING:
    from matplotlib.figure import Figure

USUAL_LABEL = 20  # which have their place


def comparison_files(run: StudyRun) -> dict[Path, Content]:
    """The contents of `report.md` and of its figures, by path.

    Args:
        run: The result of the study.
    """
    sizes = [Efficiencies.of(run, size) for size in sorted(run.study.specification.sizes)]
    files: dict[Path, Content] = {run.folder / "comparison.png": png(_comparison(run))}
    for found in sizes:
        if found.plans:
            files[run.folder / found.picture] = png(_heat_map(found))
    if run.accuracies:
        files[run.folder / PICTURE] = png(_tasks(run))
    return files | {run.folder / "report.md": comparison_report(run, sizes)}


def _comparison(run: StudyRun) -> "Figure":
    """The main criterion by size, with the legend beside it."""
    figure = new_figure(8.6, 4.8)
    criterion_by_size(run, figure.add_subplot())
    figure.legend(loc="outside right upper", fontsize=8, frameon=False)
    return figure


def _tasks(run: StudyRun) -> "Figure":
    """Errors in each test pose, of the largest plan for the main criterion and others beside."""
    figure = new_figure(8.6, 4.2)
    first, *others = run.accuracies.items()
    task_errors(first[1], first[0], dict(others), figure.add_subplot())
    figure.legend(loc="outside right upper", fontsize=8, frameon=False)
    return figure


def _heat_map(found: Efficiencies) -> "Figure":
    """Efficiencies of the plans of one size."""
    plans = [shortened(name, LONGEST_LABEL) for name in found.plans]
    longer = max(0, *(len(name) - USUAL_LABEL for name in plans))
    width = 1.8 + 0.62 * len(found.names) + 0.09 * longer
    height = 1.1 + 0.36 * len(plans) + room_for(found.names)
    figure = new_figure(width, height)
    ax = figure.add_subplot()
    heat_map(100 * found.values, plans, found.names, ax)
    ax.set_title(f"Efficiency of plans of {found.size} experiments, by criterion", fontsize=10)
    return figure
