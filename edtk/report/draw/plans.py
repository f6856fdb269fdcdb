"""Plans and designs: criteria by size, poses, sensitivities, and errors in test poses."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.design.plan import Plan
from edtk.measure.expected_error import TaskAccuracy
from edtk.measure.pose_table import pose_factors
from edtk.report.figures import BLUE, COLOURS, GREY, MARKERS, ORANGE
from edtk.report.shown import other_plans, plain, plans_of, run_unit
from edtk.robots.robot import Robot
from edtk.system.errors import shortened
from edtk.system.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from edtk.study.study_run import StudyRun

LONGEST_LABEL = 40  # characters of a plan's name in a picture
AREA_OF_ONE = 30.0  # of the marker of a single measurement [pt^2]
MOST_TICKS = 30  # poses up to which each one has a tick
FEW_POSES = 20  # poses up to which each has its number under the axis
HALF = 0.25  # width of the bar of a pose to either side


def criterion_by_size(run: "StudyRun", ax: "Axes") -> None:
    """Draw the main criterion for every kind of plan, and the bound; without a legend."""
    main = run.study.main_criterion
    factor, unit = run_unit(run, main)
    others = [name for name in run.study.specification.optimise if name != main]
    ours = {f"optimised for {name}": plans_of(run.table, "optimised", name) for name in others}
    groups = {f"optimised for {main}": plans_of(run.table, "optimised", main)}
    groups |= other_plans(run.table) | ours
    for i, (label, group) in enumerate(groups.items()):
        plans = group.sort_values("experiments")
        if len(plans):
            ax.plot(
                plans["experiments"],
                factor * plans[main],
                label=plain(shortened(label, LONGEST_LABEL)),
                linewidth=2.0 if i == 0 else 1.0,
                linestyle=":" if label == "random" else "-",
                color=COLOURS[i % len(COLOURS)],
                marker=MARKERS[i % len(MARKERS)],
                markersize=5,
            )
    _bound(run, factor, ax)
    _scales(run, f"{plain(main)} [{unit}]", ax)


def _bound(run: "StudyRun", factor: float, ax: "Axes") -> None:
    """The bound over all poses, as a line over all numbers of experiments."""
    sizes = run.study.specification.sizes
    main = run.study.main_criterion
    if main in run.relaxations:
        m = np.geomspace(min(sizes), max(sizes), 100)
        best = run.relaxations[main].best_bound
        bound = np.array([best.scaled(size).value for size in m])
    else:  # each size has a bound of its own
        m = np.sort(np.array(sizes, dtype=float))
        found = (run.bound(int(size)) for size in m)
        bound = np.array([np.nan if one is None else one.value for one in found])
    ax.plot(
        m,
        factor * bound,
        color="black",
        linestyle="--",
        linewidth=1.2,
        label="bound over all poses",
    )


def _scales(run: "StudyRun", label: str, ax: "Axes") -> None:
    """Logarithmic axes with plain numbers, and a tick for each size."""
    from matplotlib.ticker import FixedLocator, NullLocator, ScalarFormatter

    ax.set(xscale="log", yscale="log", xlabel="number of experiments m", ylabel=label)
    ax.xaxis.set_major_locator(FixedLocator(sorted(run.study.specification.sizes)))
    ax.xaxis.set_minor_locator(NullLocator())
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(ScalarFormatter())
    ax.set_title(plain(run.study.specification.title), fontsize=11)
    ax.grid(visible=True, which="both", alpha=0.25)


def joint_variables(plan: Plan, robot: Robot | None, ax: "Axes") -> None:
    """Draw a marker for each joint and pose, its area in proportion to the repetitions.

    Args:
        plan: Poses and repetitions.
        robot: Names the joints, which are drawn in degrees and millimetres; without it they are
            numbered, and drawn in radians and metres.
        ax: Where to draw.
    """
    k, n = plan.q.shape
    shown = plan.q if robot is None else robot.shown(plan.q) / pose_factors(robot)
    names = [f"q{j + 1}" for j in range(n)] if robot is None else robot.joint_names
    for j, (name, values) in enumerate(zip(names, shown.T, strict=True)):
        colour = COLOURS[j % len(COLOURS)]
        ax.plot(range(1, k + 1), values, color=colour, linewidth=0.8, alpha=0.4)
        marker = MARKERS[j % len(MARKERS)]
        sizes = AREA_OF_ONE * plan.repeats
        ax.scatter(range(1, k + 1), values, s=sizes, color=colour, marker=marker, alpha=0.8)
        # An entry of the legend of its own: that of the scatter is as large as its first marker.
        ax.scatter([], [], s=AREA_OF_ONE, color=colour, marker=marker, label=plain(name))
    if k <= MOST_TICKS:
        ax.set_xticks(range(1, k + 1))
    repeated = "" if (plan.repeats == 1).all() else " (area of a marker: repetitions)"
    ax.set_xlabel(f"pose{repeated}")
    ax.set_ylabel(_label(robot))
    ax.grid(alpha=0.3)
    ax.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _label(robot: Robot | None) -> str:
    """Name and unit of the joint variables."""
    if robot is None:
        return "joint variable [rad or m]"
    kinds = {joint.kind for joint in robot.joints}
    if kinds == {"revolute"}:
        return "joint angle [deg]"
    return "joint position [mm]" if kinds == {"prismatic"} else "joint variable [deg or mm]"


def design_stems(at: Array, shares: Array, share: str, variable: str, ax: "Axes") -> None:
    """Draw a stem of its share at each point, and the line that no sensitivity exceeds.

    The curve of the sensitivity, in parts of the largest, is drawn already.

    Args:
        at: Places (k,) of the points.
        shares: Their shares (k,) of the experiments.
        share: What a share is called.
        variable: Name of the axis of places.
        ax: Where to draw.
    """
    ax.axhline(1.0, color=BLUE, linewidth=0.8, linestyle=":")
    ax.vlines(at, 0, shares, color=ORANGE, linewidth=2)
    ax.plot(at, shares, "o", color=ORANGE, label=share, clip_on=False)
    ax.set_xlabel(variable)
    ax.set_ylabel(f"{share}, sensitivity / largest [-]")
    # Beside the picture: there is no place inside that no design uses.
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    ax.grid(axis="y", alpha=0.3)
    ax.set_axisbelow(True)


def task_errors(
    found: TaskAccuracy, label: str, others: Mapping[str, TaskAccuracy], ax: "Axes"
) -> None:
    """Draw the root mean square errors with their 95 % band, and those of other plans [mm].

    Along a path the errors are a line over its length. Poses that do not follow each other have a
    bar each. The worst pose is marked; the legend is left to the figure.

    Args:
        found: The accuracy.
        label: What it is called.
        others: Further accuracies in the same poses, by name.
        ax: Where to draw.
    """
    at = 1e3 * found.along if found.is_path else np.arange(1.0, len(found.error) + 1)
    low, high = 1e3 * found.band.T
    error = 1e3 * found.error
    band: dict[str, Any] = {
        "color": BLUE,
        "alpha": 0.18,
        "linewidth": 0,
        "label": "95 % of the errors",
    }
    if found.is_path:
        ax.fill_between(at, low, high, **band)
        ax.plot(at, error, color=BLUE, linewidth=2.0, label=plain(label))
    else:
        ax.bar(at, high - low, 2 * HALF, low, **band)
        ax.hlines(error, at - HALF, at + HALF, color=BLUE, linewidth=2.0, label=plain(label))
    if found.total is not None:
        _total(found, at, ax)
    for i, (name, other) in enumerate(others.items(), start=1):
        ax.plot(
            at,
            1e3 * other.error,
            label=plain(shortened(name, LONGEST_LABEL)),
            color=COLOURS[i % len(COLOURS)],
            marker="" if found.is_path else MARKERS[i % len(MARKERS)],
            linestyle=_line(found, name),
            linewidth=1.0,
            markersize=5,
        )
    shown = found.error if found.total is None else found.total
    mean = 1e3 * found.mean_of(shown)
    ax.axhline(mean, color=GREY, linestyle="--", linewidth=1.0, label="over all poses")
    worst = found.worst_of(shown)
    name = f"worst, pose {worst + 1}"
    ax.plot(at[worst], 1e3 * shown[worst], color="black", marker="o", linestyle="", label=name)
    _task_scales(found, at, ax)


def _total(found: TaskAccuracy, at: Array, ax: "Axes") -> None:
    """The error with all that else is uncertain, on top."""
    assert found.total is not None
    total = 1e3 * found.total
    if found.is_path:
        ax.plot(at, total, color=ORANGE, linewidth=2.0, label="total error")
    else:
        ax.hlines(total, at - HALF, at + HALF, color=ORANGE, linewidth=2.0, label="total error")


def _line(found: TaskAccuracy, name: str) -> str:
    """The line of another plan; poses that do not follow each other have none between them."""
    if not found.is_path:
        return ""
    return ":" if name == "random" else "-"


def _task_scales(found: TaskAccuracy, at: Array, ax: "Axes") -> None:
    """Names of the axes; errors begin at zero."""
    ax.set_ylim(bottom=0)
    ax.set_ylabel("error of the tool point [mm]")
    if found.is_path:
        ax.set_xlim(at[0], at[-1] if at[-1] > at[0] else at[0] + 1)
        ax.set_xlabel("length along the path [mm]")
    else:
        ax.set_xlabel("test pose")
        if len(at) <= FEW_POSES:
            ax.set_xticks(at)
    ax.grid(alpha=0.3)
    ax.set_axisbelow(True)
