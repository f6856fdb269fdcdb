"""The comparison report: one Markdown file and its figures."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from edtk.calibration.evaluate_geometry import GeometryDesigns
from edtk.design.exact.find_plan import BATCH_SIZE
from edtk.design.exact.visit_search import VISIT_STARTS
from edtk.measure.expected_error import TaskAccuracy
from edtk.report.comparison_sections import (
    PICTURE,
    Efficiencies,
    all_values,
    around_the_task,
    budget_of_costs,
    by_size,
    efficiencies,
    fewer_poses,
    in_each_task,
    loss_of_others,
    margin_in_words,
    over,
    relaxation_table,
    setting_of_geometry,
    verdict,
    visits_by_load,
)
from edtk.report.draw.bars import heat_map, room_for
from edtk.report.draw.plans import LONGEST_LABEL, criterion_by_size, task_errors
from edtk.report.figures import new_figure, png
from edtk.report.show.page import page_html
from edtk.report.show.plate import PAGE, plate, plate_words
from edtk.report.show.stage import Stage, shares, stage_of_plan
from edtk.study.schema import describe_noise
from edtk.study.study_model import describe_measured
from edtk.study.study_run import StudyRun
from edtk.system.errors import shortened
from edtk.system.files import Content

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AROUND = "What accuracy to expect in the test pose, and around it"
IN_EACH = "What accuracy to expect in the test poses, and around them"
EFFICIENCY = (
    "Efficiency against the bound over {poses} (searched, not proved): the bound "
    "divided by the plan's cost. Rows are plans, columns criteria.\n"
)
VALUES = "### Values of the criteria\n\nrho0 and rho_max in um, the others {units}.\n"
RELAXATION = (
    "Bounds come from the relaxation, which puts weights on poses instead of whole experiments; "
    "its values are those of one experiment. The proved bound holds for all plans of candidates "
    "and of poses that were added to them. The searched bound is about {poses}; it holds if the "
    "search, from many starts, has found the most sensitive pose.\n"
)
PLATE = "poses.png"
USUAL_LABEL = 20  # which have their place
LEAST_HEAT_MAP = (4.8, 3.0)  # for the title and the label of the colours [inch]


def comparison_report(run: StudyRun, sizes: Iterable[Efficiencies]) -> str:
    """The text of `report.md`.

    Args:
        run: The result of the study.
        sizes: Efficiencies of the plans of each size, whose heat maps lie beside the report.
    """
    main = run.study.main_criterion
    tasks = run.study.tasks
    question = tasks.place if tasks and main == "rho0" else f"for {main}"
    chapters = _Chapters.of_run(run)
    parts = [
        f"# {_plain(run.study.specification.title)}\n",
        verdict(run),
        *_in_time(run),
        *_warnings(run),
        "## The question\n",
        chapters.setting(),
        f"## Which plan is best {question}?\n",
        f"![{main} against the number of experiments](comparison.png)\n",
        by_size(run),
        *chapters.visits(),
        *chapters.tasks(),
        *_poses(run),
        f"## What plans for other criteria cost in {main}\n",
        loss_of_others(run),
        "## Fewer distinct poses\n",
        fewer_poses(run),
        "## All plans under all criteria\n",
        EFFICIENCY.format(poses=over(run)),
        *(efficiencies(found) for found in sizes),
        VALUES.format(units=chapters.units),
        all_values(run),
        "## How it was computed\n",
        chapters.search(),
        RELAXATION.format(poses=over(run)),
        relaxation_table(run),
        _origin(run),
    ]
    # No text of ours has a tag, and a user's title or a plug-in's name shall bring none.
    return "\n".join(parts).replace("<", "&lt;")


@dataclass(frozen=True)
class _Chapters:
    """What a report says otherwise where designs are of another kind; here, of compliances.

    Attributes:
        run: The result of the study.
    """

    run: StudyRun
    units: ClassVar[str] = "in SI units"

    @staticmethod
    def of_run(run: StudyRun) -> "_Chapters":
        """Those of a run."""
        designs = run.designs
        return _OfGeometry(run, designs) if isinstance(designs, GeometryDesigns) else _Chapters(run)

    def setting(self) -> str:
        """One paragraph on the question."""
        run = self.run
        specification = run.study.specification
        unknown = ", ".join(run.study.model.parameters)
        return (
            f"Robot {_plain(run.study.robot.name)}; unknown compliances {unknown}{_interest(run)}"
            f"{_prior(run)}; "
            f"{specification.describe_load()}; "
            f"{_measured(run)}{_noise(run)}{margin_in_words(run.study)}"
            f"{''.join(f'; {words}' for words in budget_of_costs(run.study))}.\n"
        )

    def visits(self) -> list[str]:
        """How many visits are loaded, where that may differ."""
        return []

    def tasks(self) -> list[str]:
        """What accuracy to expect in the test pose or in several, and around them."""
        run = self.run
        if not run.study.tasks:
            return []
        if len(run.study.tasks) == 1:
            return [f"## {AROUND}\n", around_the_task(run)]
        each = [in_each_task(found, self.run.study.tasks.subject) for found in self._of_largest()]
        return [f"## {IN_EACH}\n", *each, around_the_task(run)]

    def _of_largest(self) -> list[TaskAccuracy]:
        """The errors in each test pose of the largest plan, with their totals."""
        best = self.run.best
        found = None if best is None else self.run.designs.totals(best)
        return [] if found is None else [found]

    def search(self) -> str:
        """How far plans were searched for."""
        specification = self.run.study.specification
        main = self.run.study.main_criterion
        # Starts are made in batches: the last one is filled up.
        least = BATCH_SIZE * -(-specification.starts // BATCH_SIZE)
        most = BATCH_SIZE * -(-specification.descents(main) // BATCH_SIZE)
        return (
            f"{specification.candidates} candidate poses; at most {least} starts of the search "
            f"for each plan, {most} for {main}.\n"
        )


@dataclass(frozen=True)
class _OfGeometry(_Chapters):
    """The same of visits, without and with a load.

    Attributes:
        designs: The designs of the run.
    """

    designs: GeometryDesigns
    units: ClassVar[str] = "for parameters in mm, mrad and 1e-6 rad/(N m)"

    def setting(self) -> str:
        """One paragraph on the question."""
        name = _plain(self.run.study.robot.name)
        return f"Robot {name}; {setting_of_geometry(self.designs)}"

    def visits(self) -> list[str]:
        """How many visits are loaded."""
        return list(filter(None, [visits_by_load(self.run, self.designs)]))

    def tasks(self) -> list[str]:
        """What accuracy to expect of the markers, where anything tells it."""
        return [] if self.run.expected is None else super().tasks()

    def search(self) -> str:
        """How far plans were searched for."""
        specification = self.run.study.specification
        starts = min(VISIT_STARTS, specification.starts)
        return (
            f"{specification.candidates} candidate visits; at most {starts} starts of the search "
            "for each plan.\n"
        )


def _poses(run: StudyRun) -> list[str]:
    """A picture of each pose of the largest plan for the main criterion."""
    stage = best_stage(run)
    if stage is None:
        return []
    size = run.best.experiments if run.best is not None else 0
    text = (
        f"![{plate_words(stage)}]({PLATE})\n\n{plate_words(stage)} "
        f"[{PAGE}]({PAGE}) shows each from all sides, and bent by its load.\n"
    )
    return [f"## The poses of the plan of {size} experiments\n", text]


def best_stage(run: StudyRun) -> Stage | None:
    """The largest plan for the main criterion with what each pose brings; None without one."""
    if run.best is None:
        return None
    designs = run.designs
    return stage_of_plan(
        run.study,
        run.best,
        lambda plan: shares(designs.information, designs.criterion(), plan),
    )


def _plain(text: str) -> str:
    """A user's words, in which no link or picture begins."""
    return text.replace("[", "\\[").replace("`", "\\`")


def _prior(run: StudyRun) -> str:
    """What is known before the measurements, if that counts."""
    counts = run.study.specification.prior.in_design
    return "; the study's prior counts beside the experiments" if counts else ""


def _interest(run: StudyRun) -> str:
    """Which compliances criteria are about, if not about all."""
    names = run.study.interest_names
    return f", criteria without a task are of {', '.join(names)} alone" if names else ""


def _measured(run: StudyRun) -> str:
    """What is measured, if not the position of the tool point."""
    study = run.study
    plain = not study.model.sensors and not study.is_absolute
    return "" if plain else f"measured: {describe_measured(study)}; "


def _noise(run: StudyRun) -> str:
    """The noise of a measurement."""
    specification = run.study.specification
    if run.study.noise is None:
        return f"sigma = {specification.measurement.sigma_mm:g} mm per coordinate"
    return describe_noise(specification)


def _in_time(run: StudyRun) -> list[str]:
    """That the time of the run has cut something off; nothing where it has not."""
    if not run.cut:
        return []
    count = len(run.cut)
    were = "was" if count == 1 else "were"
    return [
        f"The time for this run was over before all was done: {count} of its relaxations and "
        f"searches {were} cut off or not begun. Their plans and bounds are the best so far; the "
        "same run, started again, goes on from what is finished.\n"
    ]


def _warnings(run: StudyRun) -> list[str]:
    """What is hard to believe in the question or in its answer; nothing if there is nothing."""
    lines = "\n".join(f"- {line}" for line in run.warnings)
    return [f"## Warnings\n\n{lines}\n"] if lines else []


def _origin(run: StudyRun) -> str:
    """Where the numbers come from."""
    version = run.table["edtk"].iloc[0]
    return f"Seed {run.study.specification.seed}, study {run.study.digest}, edtk {version}.\n"


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
        files[run.folder / PICTURE] = png(_task_figure(run))
    stage = best_stage(run)
    if stage is not None:
        files[run.folder / PLATE] = png(plate(stage))
        files[run.folder / PAGE] = page_html(stage)
    return files | {run.folder / "report.md": comparison_report(run, sizes)}


def _comparison(run: StudyRun) -> "Figure":
    """The main criterion by size, with the legend beside it."""
    figure = new_figure(8.6, 4.8)
    criterion_by_size(run, figure.add_subplot())
    figure.legend(loc="outside right upper", fontsize=8, frameon=False)
    return figure


def _task_figure(run: StudyRun) -> "Figure":
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
    figure = new_figure(max(width, LEAST_HEAT_MAP[0]), max(height, LEAST_HEAT_MAP[1]))
    ax = figure.add_subplot()
    heat_map(100 * found.values, plans, found.names, ax)
    ax.set_title(f"Efficiency of plans of {found.size} experiments, by criterion", fontsize=10)
    return figure
