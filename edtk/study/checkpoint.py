"""Finished cases of a study on disk, so that none is computed twice."""

import hashlib
import importlib.metadata
import inspect
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

import criteria
from edtk.study.study import Study
from edtk.system.atomic_file import write_text


class Checkpoint:
    """A folder with one JSON file a case, each written whole or not at all.

    An answer counts as long as what it rests on is the same: the study, its robot, the code and the numerical
    libraries. Numbers come back bit by bit.

    Args:
        folder: Where the files are.
        key: What the answers rest on, as a digest.
    """

    def __init__(self, folder: Path, key: str) -> None:
        self.folder, self.key = folder, key

    def find(self, case: str) -> dict[str, Any] | None:
        """The answer of a case, or None where it is not there or rests on something else."""
        try:
            content = json.loads((self.folder / f"{case}.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        fits = (
            isinstance(content, dict)
            and content.get("key") == self.key
            and isinstance(content.get("answer"), dict)
        )
        return content["answer"] if fits else None

    def keep(self, case: str, answer: dict[str, Any]) -> None:
        """Write the answer of a case."""
        write_text(
            self.folder / f"{case}.json",
            json.dumps({"key": self.key, "answer": answer}, indent=1) + "\n",
        )

    def forget(self, cases: Iterable[str]) -> None:
        """Remove all files of this folder but those of some cases."""
        names = {f"{case}.json" for case in cases}
        for path in self.folder.glob("*.json"):
            if path.name not in names:
                path.unlink()


def checkpoint_of(study: Study, folder: Path) -> Checkpoint:
    """The ledger of a study, in a folder."""
    digest = hashlib.sha256(study.digest.encode())
    for joint in study.robot.joints:
        digest.update(f"{joint.name} {joint.kind} {joint.limits}".encode())
        digest.update(
            np.ascontiguousarray(joint.origin).tobytes()
            + np.ascontiguousarray(joint.axis).tobytes()
        )
    digest.update(np.ascontiguousarray(study.robot.base).tobytes())
    for constraint in study.space.workspace.constraints:
        digest.update(repr(constraint.labels(study.robot)).encode())
    for poses in (getattr(c, "poses", None) for c in study.space.workspace.constraints):
        digest.update(b"" if poses is None else np.ascontiguousarray(poses).tobytes())
    for path in sorted(_code(study)):
        digest.update(path.read_bytes())
    for library in ("numpy", "scipy", "cvxpy", "clarabel", "scs"):
        digest.update(f"{library} {importlib.metadata.version(library)}".encode())
    return Checkpoint(folder, digest.hexdigest()[:16])


def _code(study: Study) -> set[Path]:
    """Source files that an answer rests on: the toolkit's, and those of the study's criteria."""
    packages = (Path(__file__).parents[1], Path(criteria.__path__[0]))
    found = {path for package in packages for path in package.rglob("*.py")}
    return found | {Path(inspect.getfile(criteria.get(name))) for name in study.names}
