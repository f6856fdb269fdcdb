"""Parameters of criteria in which a person names what a model estimates."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

# Numbers by name: {k2 = 1, k3 = -1}.
BY_NAME = ("c",)
LISTED = ("interest",)  # a list of names: ["k2", "k3"]


def named_parameters(
    parameters: Mapping[str, Any], names: Sequence[str], kind: str = "parameter"
) -> dict[str, Any]:
    """Parameters of a criterion with arrays in place of names, those of its parts included.

    Args:
        parameters: As a person writes them.
        names: Names (p,) of what the model estimates.
        kind: What they are, for messages.

    Raises:
        ValueError: A name is not among them; the line lists them.
    """
    found = dict(parameters)
    for key in BY_NAME:
        factors = found.get(key)
        if isinstance(factors, Mapping):
            _require_known(factors, names, kind)
            found[key] = [factors.get(name, 0.0) for name in names]
    for key in LISTED:
        listed = found.get(key)
        if isinstance(listed, list | tuple) and all(isinstance(name, str) for name in listed):
            _require_known(listed, names, kind)
            found[key] = np.array([[float(each == name) for name in listed] for each in names])
    if isinstance(found.get("criteria"), list | tuple):
        found["criteria"] = [
            named_parameters(part, names, kind) if isinstance(part, Mapping) else part
            for part in found["criteria"]
        ]
    return found


def _require_known(given: Any, names: Sequence[str], kind: str) -> None:
    for name in given:
        if name not in names:
            raise ValueError(f"{name!r} is no {kind}; expected {', '.join(names)}")
