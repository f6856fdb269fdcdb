"""The types of a study's keys in Python, for editors and type checkers."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypedDict

from edtk.model.robot import Robot


class StudyKeys(TypedDict, total=False):
    """The keys of a study in Python; `Specification` describes them, with units and defaults."""

    title: str | None
    robot: Robot | str | Path | Mapping[str, Any]
    tool: Mapping[str, Any]
    load: Mapping[str, Any]
    measurement: Mapping[str, Any]
    joints: Mapping[str, Any]
    workspace: Mapping[str, Any] | None
    test_pose: Mapping[str, Any] | None
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
