"""Finished cases of a study on disk, so that none is computed twice."""

import hashlib
import importlib.metadata
import inspect
import json
from collections.abc import Callable, Container, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import criteria
from edtk.design.design_space import DesignSpace
from edtk.robots.robot_file import robot_to_dict
from edtk.study.study import Study
from edtk.system.files import read_text, write_text
from edtk.system.time_limit import out_of_time, time_left, time_limit
from edtk.system.typing import Array
from edtk.system.workers import Workers

LIBRARIES = ("numpy", "scipy", "cvxpy", "clarabel", "scs")  # that compute the answers
KEY_DIGITS = 16  # of the SHA-256 that is a checkpoint's key, or the seal of an answer
MOST_MB = 1000.0  # of a file


class Checkpoint:
    """A folder with one JSON file a case, each written whole or not at all.

    An answer counts as long as everything that it rests on is the same: the study, its robot, the
    code and the numerical libraries. Numbers come back bit by bit.

    Args:
        folder: Folder of the files.
        key: Digest of everything that the answers rest on.
    """

    def __init__(self, folder: Path, key: str) -> None:
        self.folder = folder
        self.key = key
        self._known: dict[str, Mapping[str, Any]] = {}  # answers that have a file

    def find(self, case: str) -> dict[str, Any] | None:
        """The answer of a case; None if there is no file of it, or not one that `keep` has written.

        A file that was changed since is computed anew: its numbers would be taken for results.
        """
        try:
            content = json.loads(read_text(self.folder / f"{case}.json", MOST_MB))
        except (ValueError, RecursionError):  # it cannot be read, or is no JSON
            return None
        answer = content.get("answer") if isinstance(content, dict) else None
        return answer if isinstance(answer, dict) and content == self._sealed(answer) else None

    def keep(self, case: str, answer: Mapping[str, Any]) -> None:
        """Write the answer of a case."""
        self._known[case] = answer
        text = json.dumps(self._sealed(answer), indent=1)
        write_text(self.folder / f"{case}.json", f"{text}\n")

    def _sealed(self, answer: Mapping[str, Any]) -> dict[str, Any]:
        """The content of a file: the answer, with its digest."""
        seal = hashlib.sha256(json.dumps(answer).encode()).hexdigest()
        return {"key": self.key, "seal": seal[:KEY_DIGITS], "answer": answer}

    def complete(
        self,
        pieces: Mapping[str, Callable[[], dict[str, Any]]],
        workers: Workers,
        report: Callable[[str], object],
        share: float = 1.0,
        is_first: bool = True,
        resting_on_cut: Container[str] = (),
    ) -> tuple[dict[str, dict[str, Any]], set[str]]:
        """Collect the answers of all cases, and compute and keep those that are not finished.

        Where the time is limited (`time_limit`), cases that are not begun in time are left out. An
        answer that was cut off is not kept.

        Args:
            pieces: The work that answers each case, by the name of the case.
            workers: The processes that do it, in this order.
            report: Called with the name of each case that is finished.
            share: The part of the time that is left which each may take.
            is_first: Whether an answer to the first case is waited for in any time.
            resting_on_cut: Cases whose work rests on an answer that was cut off, as theirs is then.

        Returns:
            The answers by name, and the names of those that were cut off.

        Raises:
            WorkersLostError: No process is left to do the work.
        """
        answers: dict[str, dict[str, Any]] = {}
        cut: set[str] = set()
        missing = []
        for name in pieces:
            answer = self.find(name)
            if answer is None:
                missing.append(name)
            else:
                answers[name] = answer
                self._known[name] = answer
                report(name)
        # Without a limit nobody waits for the slowest of those that run side by side.
        together = workers.size if np.isfinite(time_left()) else max(len(missing), 1)
        for start in range(0, len(missing), together):
            if out_of_time() and (answers or not is_first):
                break
            names = missing[start : start + together]
            limited = [partial(_limited, pieces[name], share * time_left()) for name in names]
            for i, (answer, was_cut) in workers.run(limited):
                if was_cut or names[i] in resting_on_cut:
                    cut.add(names[i])
                else:
                    self.keep(names[i], answer)
                answers[names[i]] = answer
                report(names[i])
        return answers, cut

    def restore(self) -> None:
        """Write again what somebody has removed while others were computed."""
        for case, answer in self._known.items():
            if not (self.folder / f"{case}.json").exists():
                self.keep(case, answer)

    def forget_others(self, cases: Iterable[str]) -> None:
        """Remove the files of all cases but these."""
        names = {f"{case}.json" for case in cases}
        for path in self.folder.glob("*.json"):
            if path.name not in names and path.is_file():
                path.unlink()


def _limited(piece: Callable[[], dict[str, Any]], seconds: float) -> tuple[dict[str, Any], bool]:
    """The answer of a piece of work with a limit of time [s], and whether it was cut off."""
    with time_limit(seconds) as limit:
        answer = piece()
    return answer, limit.cut


def checkpoint_of(
    study: Study, folder: Path, space_of: Callable[[], DesignSpace] | None = None
) -> Checkpoint:
    """The checkpoint of a study, in a folder.

    Args:
        study: The study.
        folder: The folder.
        space_of: Gives the design space; defaults to the study's own.
    """
    constraints = (study.space if space_of is None else space_of()).workspace.constraints
    digest = hashlib.sha256(study.digest.encode())
    # The study's own digest knows the name of a robot's file, not its content.
    digest.update(json.dumps(robot_to_dict(study.robot)).encode())
    for constraint in constraints:
        digest.update(repr(constraint.labels(study.robot)).encode())
    for poses in (getattr(c, "poses", None) for c in constraints):
        digest.update(b"" if poses is None else _bytes(poses))
    for task in study.tasks:  # those of a path are in a file of their own
        digest.update(_bytes(np.concatenate([task.q, task.wrench])))
    if study.cell is not None:
        # Bodies may be read from files of their own.
        digest.update(study.cell.digest.encode())
    if study.prior_information is not None:
        digest.update(_bytes(study.prior_information))
    known = study.specification.prior
    if known.in_design and known.earlier_file is not None:
        digest.update((study.folder / known.earlier_file).read_bytes())
    for path in sorted(_code(study)):
        digest.update(path.read_bytes())
    for library in LIBRARIES:
        digest.update(f"{library} {importlib.metadata.version(library)}".encode())
    return Checkpoint(folder, digest.hexdigest()[:KEY_DIGITS])


def _bytes(array: Array) -> bytes:
    return np.ascontiguousarray(array).tobytes()


def _code(study: Study) -> set[Path]:
    """Source files that an answer rests on: the toolkit's, and those of the study's criteria."""
    packages = (Path(__file__).parents[1], Path(criteria.__path__[0]))
    found = {path for package in packages for path in package.rglob("*.py")}
    return found | {Path(inspect.getfile(criteria.get(name))) for name in study.names}
