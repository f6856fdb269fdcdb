"""A study as the text of a TOML file, from which it can be read again."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from edtk.design.plan import Plan
from edtk.study.toml_text import toml_text
from edtk.system.atomic_file import write_text

if TYPE_CHECKING:
    from edtk.study.study import Study


def study_toml(study: "Study", path: Path | str | None = None) -> str:
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
    content = study.to_dict()
    if study.excluded is not None:
        workspace = content.get("workspace", {})
        names = [*workspace.get("excluded", []), _excluded_name(study)]
        content["workspace"] = workspace | {"excluded": names}
    if path is None:
        return toml_text(content)
    folder = Path(path).parent
    if folder.resolve() != study.folder.resolve():

        def moved(name: str) -> str:
            return name if Path(name).is_absolute() else _relative(study.folder / name, folder)

        if study.specification.robot_file is not None:
            content["robot"] = moved(study.specification.robot_file)
        content = _with_names(content, moved)
    text = toml_text(content)
    write_text(path, text)
    return text


def _excluded_name(study: "Study") -> str:
    """The file of poses that were given to `Study.excluding`, relative to the study's folder."""
    if isinstance(study.excluded, Plan):
        raise study.error("workspace.excluded", "is a plan in memory; expected its file's name")
    return _relative(Path(str(study.excluded)), study.folder)


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
    return content


def _relative(path: Path, folder: Path) -> str:
    """A path as a file in the folder names it."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:  # no relative path leads to another drive
        return path.absolute().as_posix()
