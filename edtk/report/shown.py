"""Numbers as a person reads them, texts in pictures, and the plans that a picture compares."""

import math
from typing import TYPE_CHECKING

import numpy as np

import criteria
from criteria.criterion import unit_of
from edtk.measure.task import Tasks
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd

    from edtk.study.study_run import StudyRun

UNKNOWN = 3  # where nothing is said of the uncertainty
MOST_FIGURES = 6
LEAST_PLACES = 2  # behind the point: three digits
SMALL = 1e-5  # standard deviation below which numbers are written with powers of ten
MOST_PLACES = 15  # a double has no more


def plain(text: str) -> str:
    """A name or title in which matplotlib finds no formula: between two dollars it looks for one.

    Every text that a study, a file's name or a plug-in may hold goes through here on its way into
    a picture.
    """
    return text.replace("$", r"\$")


def places_of(std: float) -> int:
    """Digits behind the point, down to the second digit of a standard deviation."""
    if not (std > 0 and math.isfinite(std)):
        return UNKNOWN
    return min(max(1 - math.floor(math.log10(std)), 0), MOST_FIGURES)


def digits(value: float, std: float, like: float | None = None) -> str:
    """Write a value down to the second digit of its standard deviation: 4.0005e-07.

    It has three digits at least.

    Args:
        value: The value.
        std: Its standard deviation.
        like: A value that it is compared with; it then has the digits of that one, if both are of
            the same decade.
    """
    other = value if like is None or _decade(like) != _decade(value) else like
    ratio = abs(other) / std if std > 0 else 1.0
    places = LEAST_PLACES
    if math.isfinite(ratio) and ratio > 0:
        places = max(LEAST_PLACES, math.floor(math.log10(ratio)) + 2)
    return f"{value:.{min(places, MOST_PLACES)}e}"


def with_digits(value: float, std: float) -> str:
    """A value down to the second digit of its standard deviation: 0.012, or 4.0005e-07."""
    return f"{value:.{places_of(std)}f}" if std >= SMALL else digits(value, std)


def displacement_in_words(ends: Array, pose: int | None) -> tuple[str, str]:
    """Ends (2, 3) of a displacement by axis [mm], and which pose it is of, where there are some."""
    low, high = 1e3 * ends
    axes = ", ".join(f"{n} {a:.4f} to {b:.4f}" for n, a, b in zip("xyz", low, high, strict=True))
    return axes, "" if pose is None else f" in pose {pose}"


def _decade(value: float) -> int | None:
    """The power of ten with which a value is written."""
    return math.floor(math.log10(abs(value))) if value and math.isfinite(value) else None


def shown_unit(name: str) -> tuple[float, str]:
    """Factor and unit for a criterion's values; "SI" where the criterion names none."""
    factor, unit = criteria.get(name).shown
    if unit == "mm":
        return 1e3 * factor, "um"
    return (factor, unit) if unit else (factor, "SI")


def run_unit(run: "StudyRun", name: str) -> tuple[float, str]:
    """Factor and unit for a criterion's values; where it names none, those of the parameters."""
    factor, unit = shown_unit(name)
    if unit != "SI" or not criteria.get(name).degree:
        return factor, unit.removeprefix("SI")  # a ratio has none
    units = run.study.model.units if run.designs.unit == unit else ()
    return factor, unit_of(criteria.get(name), units) or run.designs.unit


def plans_of(
    table: "pd.DataFrame", kind: str, optimised_for: str = "", size: int | None = None
) -> "pd.DataFrame":
    """Choose plans.

    Args:
        table: The table of a study's run.
        kind: "optimised", "distinct", "published" or "random".
        optimised_for: Name of a criterion; "" for plans that were not optimised.
        size: Number of experiments; None for any.
    """
    chosen = (table["kind"] == kind) & (table["optimised_for"] == optimised_for)
    return table[chosen if size is None else chosen & (table["experiments"] == size)]


def other_plans(table: "pd.DataFrame") -> dict[str, "pd.DataFrame"]:
    """Published and random plans, in groups of one plan a size, by the group's name in a report.

    Several published plans of one size are groups of their own, named after their files.

    Args:
        table: The table of a study's run.
    """
    published = plans_of(table, "published")
    labels = [_label(row["plan"], row["experiments"]) for _, row in published.iterrows()]
    groups = {
        label: published[np.array([other == label for other in labels], dtype=bool)]
        for label in dict.fromkeys(labels)
    }
    return groups | {"random": plans_of(table, "random")}


def _label(plan: str, size: int) -> str:
    """The name of a published plan's group, from its name in the table, see `Case.name`."""
    file = plan.partition(f"_m{size}_")[2]
    return f"published ({file})" if file else "published"


def left_out_line(rms_mm: float, inside: float) -> str:
    """How well poses are predicted that are left out one by one, for a terminal.

    Args:
        rms_mm: Root mean square of the errors [mm].
        inside: Share of the coordinates inside their bands.
    """
    return (
        f"each pose predicted without it: {rms_mm:.4g} mm rms, "
        f"{100 * inside:.1f} % of the coordinates inside their 95 % bands"
    )


def left_out_sentence(inside: float) -> str:
    """What the errors of poses mean that are left out one by one, for a report."""
    return (
        "Each pose is predicted by a fit of all others: that error is the one to expect of new "
        f"poses of the same kind. {100 * inside:.0f} % of the coordinates were inside their 95 % "
        "bands."
    )


def expected_rho0(rho0_mm: float, tasks: Tasks) -> str:
    """The error in the tasks that noise leaves, of what counts there."""
    return f"rho0 {rho0_mm:.4g} mm: error of {tasks.subject} {tasks.place}, by the noise alone"
