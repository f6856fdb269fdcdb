"""Studies as TOML, from files, from Python's keys, and back to text."""

import inspect
import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypedDict

import numpy as np

from edtk.design.plan import Plan
from edtk.robots.robot import Robot
from edtk.study.asked import Asked
from edtk.study.schema import Specification
from edtk.system.fields import Table
from edtk.system.files import decode, read_bytes, write_text
from edtk.system.parsing import MOST_STUDY_MB, parse_toml

MOST_INLINE = 100  # characters of a line, beyond which a list is written an entry a line
SHORT_ESCAPES = {
    '"': '\\"',
    "\\": "\\\\",
    "\b": "\\b",
    "\t": "\\t",
    "\n": "\\n",
    "\f": "\\f",
    "\r": "\\r",
}


def read_toml(path: Path) -> tuple[dict[str, Any], bytes]:
    """Read a study file.

    Returns:
        Its keys, and its bytes.

    Raises:
        UserError: The file does not exist, cannot be read, or is not valid TOML.
    """
    raw = read_bytes(path, MOST_STUDY_MB)
    return parse_toml(decode(raw, path), path), raw


def plain_keys(keys: Mapping[str, Any]) -> dict[str, Any]:
    """Turn arrays into lists, paths into strings and tables into mappings, at every depth.

    Args:
        keys: Keys and their values; a key whose value is None counts as not given.

    Returns:
        The same keys with plain values. Values of other kinds stay as they are, for the
        validation to reject.
    """
    return {str(key): _plain(value) for key, value in keys.items() if value is not None}


def _plain(value: Any) -> Any:
    if isinstance(value, Table):
        return value.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    if isinstance(value, Mapping):
        return plain_keys(value)
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return value


BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def toml_text(content: Mapping[str, Any]) -> str:
    """Write plain keys as TOML 1.0, so that `tomllib.loads` gives the same keys and values.

    Args:
        content: Booleans, integers, floats, strings, lists and tables (mappings with string keys),
            nested at will. Tuples are written as lists.

    Returns:
        The text. Keys keep their order, but for tables, which follow the other keys of their
        table, as TOML demands.

    Raises:
        TypeError: A value is of no such kind; TOML knows no None.
    """
    return "\n".join(_lines(content, ())).strip("\n") + "\n"


def inline(value: Any) -> str:
    """Write one value as it stands on the right of an equals sign; a table on one line."""
    return _value(value)


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    """Lines of a table: its plain keys, then its tables."""
    lines = []
    for key, value in table.items():
        if not (_is_table(value) or _is_table_array(value)):
            lines.append(f"{_key(key)} = {_value(value, len(key) + len(' = '))}")
    for key, value in table.items():
        inner = (*path, key)
        name = ".".join(map(_key, inner))
        if _is_table(value):
            inside = _lines(value, inner)
            needs_header = not inside or inside[0] != ""  # the header of a table inside says it all
            lines += ["", f"[{name}]", *inside] if needs_header else inside
        elif _is_table_array(value):
            for entry in value:
                lines += ["", f"[[{name}]]", *_lines(entry, inner)]
    return lines


def _is_table(value: object) -> bool:
    return isinstance(value, Mapping)


def _is_list(value: object) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _is_table_array(value: Any) -> bool:
    return _is_list(value) and len(value) > 0 and all(map(_is_table, value))


def _key(key: str) -> str:
    return key if BARE_KEY.fullmatch(key) else _string(key)


def _value(value: Any, indent: int = 0) -> str:
    """A value on the right of an equals sign, or inside a list."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(int(value))
    if isinstance(value, float):
        return _float(float(value))
    if isinstance(value, str):
        return _string(value)
    if _is_table(value):  # inside a list that holds other things too
        return f"{{ {', '.join(f'{_key(key)} = {_value(v)}' for key, v in value.items())} }}"
    if _is_list(value):
        entries = [_value(entry) for entry in value]
        line = f"[{', '.join(entries)}]"
        if indent + len(line) <= MOST_INLINE:
            return line
        return "\n".join(["[", *(f"    {entry}," for entry in entries), "]"])
    raise TypeError(f"TOML has no form for {value!r}")


def _float(number: float) -> str:
    """The shortest text that is read as the same number."""
    if math.isnan(number):
        return "nan"
    if math.isinf(number):
        return "inf" if number > 0 else "-inf"
    return repr(number)


def _string(text: str) -> str:
    """A basic string: quotes, backslashes and control characters are escaped."""
    return f'"{"".join(map(_character, text))}"'


def _character(character: str) -> str:
    if character in SHORT_ESCAPES:
        return SHORT_ESCAPES[character]
    is_control = ord(character) < 0x20 or ord(character) == 0x7F
    return f"\\u{ord(character):04x}" if is_control else character


def study_toml(study: Asked, path: Path | str | None = None) -> str:
    """Write a study as TOML, so that `load_study` gives the same study again.

    Args:
        study: The study.
        path: File to write, whole or not at all. None to only return the text, in which file names
            are relative to the study's folder.

    Returns:
        The text. In a file, the names of other files are relative to its own folder.

    Raises:
        UserError: The study excludes a plan that is in no file.
        OSError: The file cannot be written.
    """
    text = toml_in(study, study.folder if path is None else Path(path).parent)
    if path is not None:
        write_text(path, text)
    return text


def toml_in(study: Asked, folder: Path) -> str:
    """The text of a study's file in a folder, to which names of other files are relative.

    Raises:
        UserError: The study excludes a plan that is in no file.
    """
    content = study.to_dict()
    if study.excluded is not None:
        workspace = content.get("workspace", {})
        names = [*workspace.get("excluded", []), _excluded_name(study)]
        content["workspace"] = workspace | {"excluded": names}
    if folder.resolve() != study.folder.resolve():

        def moved(name: str) -> str:
            return name if Path(name).is_absolute() else relative_path(study.folder / name, folder)

        if study.specification.robot_file is not None:
            file = moved(study.specification.robot_file)
            more = content["robot"]
            content["robot"] = file if isinstance(more, str) else more | {"file": file}
        content = _with_names(content, moved)
    return toml_text(content)


def _excluded_name(study: Asked) -> str:
    """The file of poses that were given to `Study.excluding`, relative to the study's folder."""
    if isinstance(study.excluded, Plan):
        raise study.error("workspace.excluded", "is a plan in memory; expected its file's name")
    return relative_path(Path(str(study.excluded)), study.folder)


def _with_names(content: dict[str, Any], moved: Callable[[str], str]) -> dict[str, Any]:
    """The same keys, with other names of plans, paths and results."""
    content = dict(content)
    if "published" in content:
        content["published"] = [moved(name) for name in content["published"]]
    if "excluded" in content.get("workspace", {}):
        names = [moved(name) for name in content["workspace"]["excluded"]]
        content["workspace"] = content["workspace"] | {"excluded": names}
    if "task" in content:
        content["task"] = content["task"] | {"file": moved(content["task"]["file"])}
    if "earlier_file" in content.get("prior", {}):
        name = moved(content["prior"]["earlier_file"])
        content["prior"] = content["prior"] | {"earlier_file": name}
    if "mesh" in content.get("scene", {}):
        meshes = [mesh | {"file": moved(mesh["file"])} for mesh in content["scene"]["mesh"]]
        content["scene"] = content["scene"] | {"mesh": meshes}
    return content


def relative_path(path: Path, folder: Path) -> str:
    """A path as a file in the folder names it."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # no relative path leads to another drive
        return path.absolute().as_posix()


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
    give_up: Mapping[str, Any] | None
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
    scene: Mapping[str, Any] | None


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
