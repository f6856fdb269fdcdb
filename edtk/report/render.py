"""Which function renders a result: looked up by the name of its class."""

import re
from collections.abc import Callable, Iterable, Sequence
from html import escape
from importlib import import_module
from typing import Any

from edtk.report.tables import notebook_table, text_table
from edtk.system.presented import Presented

# The page of `edtk.report.views` that shows a result. It holds `exact_plan_text`, and where there
# are a table and a picture `exact_plan_notebook` and `exact_plan_plot`. Where a table says it all,
# `plan_rows` with its header and rows, and perhaps `plan_notes`, are the text and the notebook.
PAGES = {
    "arranged_plan": "problem",
    "calibration": "calibration",
    "comparison": "problem",
    "compensation": "compensation",
    "corrected_program": "compensation",
    "day": "day",
    "evaluation": "evaluation",
    "exact_plan": "plan",
    "found_controller": "robot",
    "geometric_calibration": "calibration",
    "geometry_evaluation": "evaluation",
    "geometry_plan": "plan",
    "identification": "calibration",
    "plan": "plan",
    "plan_bias": "evaluation",
    "plan_check": "day",
    "pose_error": "calibration",
    "posterior": "calibration",
    "posterior_check": "calibration",
    "prediction": "calibration",
    "problem": "problem",
    "problem_plan": "problem",
    "region_plan": "problem",
    "relaxation": "relaxation",
    "relaxed_plan": "relaxation",
    "relaxed_region": "problem",
    "robot": "robot",
    "robot_overview": "robot",
    "spring_calibration": "calibration",
    "study": "study",
    "study_run": "study",
    "verification": "verification",
    "written_program": "day",
}
LACKING = {"plot": "picture", "show": "poses to show"}  # of results that have no such page


def render(form: str, result: Any, *arguments: Any, **options: Any) -> Any:
    """Render a result in one form, with the function of its class, or else of its nearest base.

    Args:
        form: "text", "notebook", "plot" or "show".
        result: The result.
        arguments: Further arguments of the form, such as axes.
        options: Further arguments of the function of the class.

    Raises:
        TypeError: It is no result, or the form does not take these arguments or options.
    """
    for cls in type(result).__mro__:
        name = _snake_case(cls.__name__)
        if name not in PAGES:
            continue
        page = import_module(f"edtk.report.views.{PAGES[name]}")
        if hasattr(page, f"{name}_{form}"):
            return getattr(page, f"{name}_{form}")(result, *arguments, **options)
        if form in TABLES and hasattr(page, f"{name}_rows"):
            _require_none(form, result, *arguments, **options)
            header, rows = getattr(page, f"{name}_rows")(result)
            notes = getattr(page, f"{name}_notes")(result) if hasattr(page, f"{name}_notes") else ()
            return TABLES[form](result.headline(), header, rows, notes)
    found = _headline_alone(form, result)
    _require_none(form, result, *arguments, **options)
    return found


def _require_none(form: str, result: object, *arguments: Any, **options: Any) -> None:
    if arguments or options:
        raise TypeError(f"the {form} of a {type(result).__name__} takes no arguments or options")


def _text(
    headline: str, header: Sequence[str], rows: Iterable[Sequence[object]], notes: Sequence[str]
) -> str:
    """A table for a terminal, below its headline and its notes."""
    return "\n".join([headline, *notes, text_table(header, rows)])


TABLES: dict[str, Callable[..., str]] = {"text": _text, "notebook": notebook_table}


def _headline_alone(form: str, result: object) -> str:
    """A result without a page: its headline, and in a notebook what its summary says besides.

    Raises:
        TypeError: It is no result, or the form is one that takes more.
    """
    name = type(result).__name__
    if not isinstance(result, Presented) or form not in (*TABLES, *LACKING):
        raise TypeError(f"{name} is no result that edtk.report can render as {form}")
    if form in LACKING:
        raise TypeError(f"a {name} has no {LACKING[form]}")
    head = result.headline()
    if form == "text":
        return head
    text = result.summary()
    rest = "" if text == head else f"\n<pre>{escape(text)}</pre>"
    return f"<p><b>{escape(head)}</b></p>{rest}"


def _snake_case(name: str) -> str:
    """``ExactPlan`` as ``exact_plan``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()
