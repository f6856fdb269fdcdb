"""Studies and their runs."""

from typing import Any

import numpy as np

import criteria
from criteria.criterion import printed
from edtk.design.bound import HEADLINE
from edtk.measure.expected_error import ErrorBudget
from edtk.measure.task import Task
from edtk.report.draw.plans import criterion_by_size
from edtk.report.figures import GREY, ORANGE, panels
from edtk.report.shown import plain
from edtk.report.tables import notebook_table, percent, text_table
from edtk.report.views.calibration import error_budget
from edtk.report.views.robot import ARM, fit_axes, robot_plot
from edtk.robots.robot import motors_in_words
from edtk.study.schema import describe_noise
from edtk.study.study import Study
from edtk.study.study_model import describe_measured, other_springs
from edtk.study.study_run import StudyRun
from edtk.system.typing import Array

MOST_POSES = 12  # drawn of many test poses, evenly spread
ARROW = 0.35  # length of a load's arrow, over the size of the arm


def study_text(asked: Study) -> str:
    """The question: a line for each key that a person would ask about."""
    rows = study_rows(asked)
    width = max(len(name) for name, _ in rows)
    lines = [f"  {name:{width}}  {value}" for name, value in rows]
    return "\n".join([asked.specification.title, *lines])


def study_rows(asked: Study) -> list[tuple[str, str]]:
    """Names and values of the main keys, in words."""
    specification = asked.specification
    noise = describe_noise(specification)
    joints = specification.joints
    fixed = [f"{name} = {value:g} deg" for name, value in joints.fixed_deg.items()]
    fixed += [f"{name} = {value:g} mm" for name, value in joints.fixed_mm.items()]
    labels = [label for c in asked.workspace.constraints for label in c.labels(asked.robot)]
    rows = [
        ("robot", f"{asked.robot.name}, {asked.robot.n} joints"),
        ("motors", "; ".join(motors_in_words(asked.robot))),
        ("controller", _controller(asked)),
        ("unknown", ", ".join((*joints.unknown, *_other_springs(asked)))),
        ("of interest", ", ".join(asked.interest_names)),
        ("known", joints.known_in_words()),
        ("prior", "counts in designs" if specification.prior.in_design else ""),
        ("fixed", ", ".join(fixed)),
        ("experiment", specification.describe_load()),
        ("measured", f"{describe_measured(asked)}, {noise}"),
        ("workspace", "; ".join(labels)),
        ("task", _task(asked)),
        ("optimised for", ", ".join(specification.optimise)),
        ("compared under", ", ".join(specification.criteria)),
        ("experiments", ", ".join(map(str, specification.sizes))),
        ("seed", str(specification.seed)),
    ]
    return [(name, value) for name, value in rows if value]


def _other_springs(asked: Study) -> list[str]:
    """Names of the springs beside the joints' own compliances."""
    return [one.name.removeprefix("k_") for one in other_springs(asked)]


def _controller(asked: Study) -> str:
    """How the controller counts otherwise than the model; empty if it does not."""
    robot = asked.robot
    controller = robot.controller
    if controller is None:
        return ""
    names = robot.joint_names
    turned = [name for name, sign in zip(names, controller.sign, strict=True) if sign < 0]
    zeros = [
        f"{joint.name} = {zero:g} {'mm' if joint.kind == 'prismatic' else 'deg'}"
        for joint, zero in zip(robot.joints, controller.zero, strict=True)
        if zero
    ]
    parts = [f"counts {', '.join(turned)} the other way round"] if turned else []
    parts += [f"shows {', '.join(zeros)} at the model's zero"] if zeros else []
    parts += [f"{names[one.joint]} follows {names[one.leader]}" for one in controller.follows]
    return "; ".join(parts)


def _task(asked: Study) -> str:
    """Where the robot shall be accurate; empty without a test pose."""
    tasks = asked.tasks
    if not tasks:
        return ""
    levers = sorted({1e3 * task.lever for task in tasks if task.lever})
    sizes = " or ".join(f"{size:g}" for size in levers)
    lever = f", rotations count as at {sizes} mm" if levers else ""
    path = asked.specification.task
    named = "" if path is None else f" of the path {path.file}"
    return f"{tasks.place.removeprefix('in ')}{named}{lever}"


def study_notebook(asked: Study) -> str:
    """The question: a row for each key that a person would ask about."""
    return notebook_table(asked.specification.title, ["key", "value"], study_rows(asked))


def study_plot(result: Study, ax: Any = None) -> Any:
    """Draw the robot in its test poses, with the load of the task; at zero if it has none.

    The first pose is drawn as bodies, the others as lines between the joints.

    Args:
        result: The study.
        ax: Axes with a 3D projection; a new figure where they are not given.

    Returns:
        The axes.
    """
    tasks = list(result.tasks)
    if not tasks:
        return robot_plot(result.robot, ax)
    first = tasks[0]
    ax = robot_plot(first.placed, ax, q=first.q)
    spread = np.linspace(1, len(tasks) - 1, min(len(tasks) - 1, MOST_POSES - 1))
    shown = [tasks[i] for i in np.unique(spread.astype(int))] if len(tasks) > 1 else []
    points = [_chain(task) for task in (first, *shown)]
    for chain in points[1:]:
        ax.plot(*chain.T, color=GREY, linewidth=1.2, marker="o", markersize=2.5)
        ax.plot(*chain[-1:].T, "o", markersize=4, color=ORANGE)
    every = np.vstack(points)
    size = float(np.ptp(every, axis=0).max())
    arrow = _arrow(first, size)
    load = ""
    if arrow is not None:
        load = f"; the arrow is the load there, {np.linalg.norm(first.wrench[:3]):.4g} N"
        ax.quiver(*points[0][-1], *arrow, color=ARM, linewidth=2.0)
        every = np.vstack([every, points[0][-1] + arrow])
    fit_axes(every, ax)
    several = "" if len(tasks) == 1 else f", {len(tasks)} of them"
    ax.set_title(plain(f"{result.robot.name} in its test pose{several}{load}"), fontsize=10)
    return ax


def _chain(task: Task) -> Array:
    """Base, joints and tool point of a test pose (k, 3) [m]."""
    frames = task.placed.frames(task.q)
    return np.vstack([task.placed.base[:3, 3], frames.origins, frames.position])


def _arrow(task: Task, size: float) -> Array | None:
    """The direction of the task's force (3,), as long as the picture takes; None without one."""
    force = np.asarray(task.wrench)[:3]
    length = float(np.linalg.norm(force))
    return ARROW * size * force / length if length > 0 else None


def study_run_text(run: StudyRun) -> str:
    """A line for each plan."""
    return "\n".join([run.headline(), *expected_of_run(run), text_table(*study_run_rows(run))])


def expected_of_run(run: StudyRun) -> list[str]:
    """What errors to expect of the largest plan for the main criterion; nothing without a task."""
    if run.expected is None:
        return []
    budget = budget_of_run(run)
    return [
        *([] if budget is None else [error_budget(budget, run.designs.of_visits)]),
        str(run.expected),
    ]


def budget_of_run(run: StudyRun) -> ErrorBudget | None:
    """The error budget of that plan; None where it is not known."""
    return None if run.best is None else run.designs.error_budget(run.best)


def study_run_rows(run: StudyRun) -> tuple[list[str], list[list[str]]]:
    """Header and rows: plan, sizes, the main criterion and the efficiency under it."""
    main = run.study.main_criterion
    rows = []
    for _, row in run.table.iterrows():
        cells = [row["reason"], ""]
        if not row["reason"]:
            cells = [
                printed(criteria.get(main), row[main], run.study.model.units, HEADLINE),
                percent(row[f"efficiency_{main}"]),
            ]
        rows.append([row["plan"], str(row["experiments"]), str(row["poses"]), *cells])
    return ["plan", "experiments", "poses", main, "efficiency"], rows


def study_run_plot(run: StudyRun, ax: Any = None) -> Any:
    """Draw the main criterion against the number of experiments, for every kind of plan.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (8.6, 4.8))[0, 0]
    criterion_by_size(run, ax)
    ax.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax
