"""The files of a comparison: a report to read, and its figures."""

from pathlib import Path
from typing import TYPE_CHECKING

from edtk.report.comparison.efficiencies import Efficiencies
from edtk.report.comparison_report import comparison_report
from edtk.report.draw.criterion_by_size import criterion_by_size
from edtk.report.draw.heat_map import heat_map
from edtk.report.new_figure import new_figure
from edtk.report.save_figure import save_figure
from edtk.study.study_run import StudyRun
from edtk.system.atomic_file import write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_comparison(run: StudyRun, folder: Path | None = None) -> None:
    """Write `report.md` and its figures; figures of sizes that are gone are removed.

    Args:
        run: The result of the study.
        folder: Where to write; defaults to the folder of the run.
    """
    folder = run.folder if folder is None else folder
    save_figure(_comparison(run), folder / "comparison.png")
    sizes = [Efficiencies.of(run, size) for size in sorted(run.study.specification.sizes)]
    pictures = set()
    for found in sizes:
        if found.plans:
            save_figure(_heat_map(found), folder / found.picture)
            pictures.add(found.picture)
    for path in folder.glob("efficiency_m*.png"):
        if path.name not in pictures:
            path.unlink()
    write_text(folder / "report.md", comparison_report(run, sizes))


def _comparison(run: StudyRun) -> "Figure":
    """The main criterion by size, with the legend beside it."""
    figure = new_figure(8.6, 4.8)
    criterion_by_size(run, figure.add_subplot())
    figure.legend(loc="outside right upper", fontsize=8, frameon=False)
    return figure


def _heat_map(found: Efficiencies) -> "Figure":
    """Efficiencies of the plans of one size."""
    figure = new_figure(1.8 + 0.62 * len(found.names), 1.1 + 0.36 * len(found.plans))
    ax = figure.add_subplot()
    heat_map(100 * found.values, found.plans, found.names, ax)
    ax.set_title(f"Efficiency of plans of {found.size} experiments, by criterion", fontsize=10)
    return figure
