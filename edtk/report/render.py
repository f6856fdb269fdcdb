"""Which function renders a result: looked up by the name of its class."""

import re
from importlib import import_module
from typing import Any

# The page of `edtk.report.views` that shows a result. It holds `exact_plan_text`, and where there
# are a table and a picture `exact_plan_notebook` and `exact_plan_plot`.
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
    "presented": "presented",
    "problem": "problem",
    "problem_plan": "problem",
    "region_plan": "region",
    "relaxation": "relaxation",
    "relaxed_plan": "relaxation",
    "relaxed_region": "region",
    "robot": "robot",
    "robot_overview": "robot",
    "spring_calibration": "calibration",
    "study": "study",
    "study_run": "study",
    "verification": "verification",
    "written_program": "day",
}


def render(form: str, result: object, *arguments: Any, **options: Any) -> Any:
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
    raise TypeError(f"{type(result).__name__} is no result that edtk.report can render as {form}")


def _snake_case(name: str) -> str:
    """``ExactPlan`` as ``exact_plan``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()
