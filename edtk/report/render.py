"""Which function renders a result: looked up by the name of its class."""

import re
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from edtk.system.presented import Presented


def render(form: str, result: Presented, *arguments: Any, **options: Any) -> Any:
    """Render a result in one form, with the file of its class, or else of its nearest base class.

    Args:
        form: A folder of `edtk.report`: "text", "notebook" or "plot".
        result: The result.
        arguments: Further arguments of the form, such as axes.
        options: Further arguments of the function of the class.

    Raises:
        TypeError: It is no result, or the form does not take these arguments or options.
    """
    for cls in type(result).__mro__:
        name = _snake_case(cls.__name__)
        module = f"edtk.report.{form}.{name}"
        if find_spec(module) is not None:
            return getattr(import_module(module), name)(result, *arguments, **options)
    raise TypeError(f"{type(result).__name__} is no result that edtk.report can render as {form}")


def _snake_case(name: str) -> str:
    """``ExactPlan`` as ``exact_plan``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()
