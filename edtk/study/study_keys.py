"""The keys of a study in Python, for editors and type checkers."""

import inspect
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypedDict

from edtk.model.robot import Robot
from edtk.study.schema import Specification


class StudyKeys(TypedDict, total=False):
    """The keys of a study in Python; `Specification` describes them, with units and defaults."""

    title: str | None
    robot: Robot | str | Path | Mapping[str, Any]
    base_link: str | None
    tip_link: str | None
    controller: Mapping[str, Any] | None
    tool: Mapping[str, Any] | None
    load: Mapping[str, Any] | None
    parameters: Mapping[str, Any] | None
    payload: Mapping[str, Any] | None
    marker: Sequence[Mapping[str, Any]] | None
    distance: Sequence[Mapping[str, Any]] | None
    measurement: Mapping[str, Any]
    joints: Mapping[str, Any]
    workspace: Mapping[str, Any] | None
    test_pose: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None
    task: Mapping[str, Any] | None
    interest: Mapping[str, Any] | None
    criterion: str | Mapping[str, Any] | None
    criteria: list[str] | tuple[str, ...] | None
    optimise: list[str] | tuple[str, ...] | None
    sizes: list[int] | tuple[int, ...] | None
    candidates: int | None
    sampling: str | None
    starts: int | None
    seed: int | None
    published: list[str] | tuple[str, ...] | None
    simulation: Mapping[str, Any] | None
    prior: Mapping[str, Any] | None
    noise: Mapping[str, Any] | None
    costs: Mapping[str, Any] | None
    uncertainty: Mapping[str, Any] | None


def keys_signature() -> inspect.Signature:
    """The signature of `Study`: its keys by name, the required ones first, `folder` last."""
    fields = Specification.model_fields
    required = {name for name, field in fields.items() if field.is_required()}
    names = [*sorted(fields, key=lambda name: name not in required), "folder"]
    parameters = [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=inspect.Parameter.empty if name in required else None,
        )
        for name in names
    ]
    return inspect.Signature(parameters)
