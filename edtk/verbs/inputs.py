"""Inputs and outputs of verbs: checked before the work, so that no result is lost in the end."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import combinations
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeGuard, runtime_checkable

import criteria
from edtk.design.plan import Plan
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.measure.pose_table import Table, path_of
from edtk.study.study import Study
from edtk.study.study import load_study as read_study
from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError, UserError, finite_numbers, whole_number
from edtk.system.files import (
    STANDARD_OUTPUT,
    Content,
    is_standard_output,
    read_text,
    require_writable,
    write_files,
)
from edtk.system.parsing import json_text, parse_json
from edtk.system.workers import Workers, WorkersLostError, open_workers

if TYPE_CHECKING:
    import pandas as pd


LINK_FLAGS = {"base_link": "--base", "tip_link": "--tip"}
# Ends of the names of files: who asks for one of them means no folder.
OF_FILES = (".json", ".csv", ".html", ".toml", ".md", ".txt", ".png", ".svg")
MOST_RESULT_MB = 100.0  # of the file of a result


class HasPlan(Protocol):
    """A result with a plan, such as that of `edtk.plan`."""

    @property
    def whole(self) -> Plan:
        """All its experiments."""


@runtime_checkable
class IsCalibration(Protocol):
    """A calibration, of springs or of geometry: nothing else has a verdict."""

    @property
    def verdict(self) -> str:
        """Whether to compensate with it."""

    def to_dict(self) -> dict[str, Any]:
        """The content of its file."""


StudyLike = Study | Path | str
PlanLike = Plan | HasPlan | Table


@checked
def load_study(path: Path | str, exclude: Path | str | None = None) -> Study:
    """Read and validate a study file.

    Args:
        path: The file (TOML).
        exclude: A plan (CSV) of poses to stay away from, besides those that the study excludes.

    Returns:
        The study, with its robot, its design space and its test pose.

    Raises:
        UserError: One line that names the file, the key and what was expected.
    """
    return read_study(path, exclude)


def as_study(study: StudyLike) -> Study:
    """The study itself, or the study of a file.

    Raises:
        UserError: The file is not a valid study; the message names the file and the key.
    """
    given: object = study
    if not isinstance(given, Study | Path | str):
        message = f"expected a study, or the path of one, not {type(given).__name__}; arrays of "
        hint = "regressors (n, rows, p) make an edtk.Problem, data frames edtk.Problem.from_frame"
        raise UserError(message + hint)
    return study if isinstance(study, Study) else read_study(study)


def as_plan(study: Study, plan: PlanLike, argument: str = "plan", made: bool = False) -> Plan:
    """The plan itself, that of a result, or the plan or sheet of a CSV file or a data frame.

    Poses of files are checked against the workspace.

    Args:
        study: The study.
        plan: What is given.
        argument: Its name in the call, for messages.
        made: Whether of a sheet only the rows that are filled in count.

    Raises:
        UserError: It is not a valid plan; the message names the file, the row and the column.
    """
    found = plan_of(study, plan, argument)
    return study.load_plan(as_table(plan, argument), made) if found is None else found


def plan_of(study: Study, given: object, argument: str) -> Plan | None:
    """A plan that is one already, or that a result has; None for anything else.

    Raises:
        ArgumentError: It is of another robot.
    """
    whole = given if isinstance(given, Plan) else getattr(given, "whole", None)
    if not isinstance(whole, Plan):
        return None
    joints = whole.q.shape[1]
    if joints != study.robot.n:
        message = f"has poses of {joints} joints; expected the {study.robot.n} of the study"
        raise ArgumentError(message, argument=argument)
    return whole


def as_table(given: Any, argument: str) -> Table:
    """The path of a table, or the table.

    Raises:
        ArgumentError: It is neither.
    """
    if isinstance(given, str | Path) or _is_frame(given):
        return given
    message = f"expected the path of a CSV file, or a data frame, not {type(given).__name__}"
    raise ArgumentError(message, argument=argument)


def _is_frame(given: object) -> TypeGuard["pd.DataFrame"]:
    """Whether this is a data frame of pandas, which is imported where one is given alone."""
    return type(given).__module__.split(".")[0] == "pandas" and hasattr(given, "columns")


def files_of(*given: object) -> tuple[Path | str, ...]:
    """Which of some inputs are files, that no output may replace."""
    return tuple(one for one in given if isinstance(one, str | Path))


def name_of(given: object, otherwise: str) -> Path:
    """The path that messages name: the given one, or a word for an object without a file."""
    if _is_frame(given):
        return path_of(given)
    return Path(given) if isinstance(given, str | Path) else Path(otherwise)


def content_of(result: object) -> Mapping[str, Any] | None:
    """The content of a calibration, as its file would hold it; None for a path and others."""
    if isinstance(result, Mapping):
        return result
    return result.to_dict() if isinstance(result, IsCalibration) else None


def text_of(result: object) -> str:
    """A text that is the same for a result and its file, and another one for other numbers.

    Raises:
        UserError: The file is not valid JSON.
    """
    if isinstance(result, str | Path):
        content: Any = parse_json(read_text(result, MOST_RESULT_MB), result)
    else:
        content = content_of(result)
    return str(result) if content is None else json_text(content)


@contextmanager
def errors_in(where: Path | str) -> Iterator[None]:
    """Name the input in errors that only the arithmetic or the file system finds.

    Args:
        where: The file, or the word, that begins the message.

    Raises:
        UserError: A plan or sheet leaves parameters open, or a file cannot be used.
    """
    from edtk.fit.least_squares import SingularPlanError

    try:
        yield
    except SingularPlanError as error:
        raise UserError(str(error), where=where) from error
    except OSError as error:
        # Without a name it is none of the files that were asked for: memory of workers, say.
        raise UserError(error.strerror or str(error), where=error.filename) from error


@contextmanager
def links_by_flags() -> Iterator[None]:
    """Name the flag in an error about the link where an arm begins or ends.

    Messages of a robot's file name the key of a study; a call without a study has a flag.

    Raises:
        UserError: A robot's file has no such link, or several that may be meant.
    """
    try:
        yield
    except UserError as error:
        if error.key not in LINK_FLAGS:
            raise
        message = f"{error.message} ({LINK_FLAGS[error.key]} NAME)"
        raise UserError(message, where=error.where, key=error.key) from error


def require_output(path: Path | str | None, *inputs: Path | str | None) -> None:
    """Check, before long work, that a file can be written.

    The file must be neither an input of the same call nor a sheet with measurements in it.

    Args:
        path: The file to write; None and standard output (`-`) are always fine.
        inputs: The files that the call reads; None entries do not count.

    Raises:
        UserError: The file is an input, or holds measurements.
        OSError: The file cannot be written.
    """
    if path is None or Path(path) == STANDARD_OUTPUT:
        return
    if any(other is not None and _same(path, other) for other in inputs):
        raise UserError("is read by this command; expected another file to write", where=path)
    require_writable(path)
    if Path(path).exists():
        from edtk.calibration.template import is_filled

        if is_filled(Path(path)):
            raise UserError("has measurements in it; expected another file to write", where=path)


def require_different(**outputs: Path | str | None) -> None:
    """Check that the files that a call writes are not the same.

    Args:
        outputs: The files by argument; None entries do not count.

    Raises:
        ArgumentError: Two arguments name the same file.
    """
    given = {argument: path for argument, path in outputs.items() if path is not None}
    for first, second in combinations(given, 2):
        both_printed = is_standard_output(given[first]) and is_standard_output(given[second])
        if both_printed or _same(given[first], given[second]):
            raise ArgumentError(
                "another output goes there, too; expected a place of its own",
                argument=second,
                given=given[second],
            )


def require_file(path: Path | str | None) -> None:
    """Check that an output is no standard output: it is read as well.

    Raises:
        UserError: It is standard output.
    """
    if path is not None and Path(path) == STANDARD_OUTPUT:
        raise UserError("is standard output; expected a file", where=path)


def require_folder(path: Path | str | None) -> None:
    """Check that an output of several files is no standard output, and is not named like a file.

    Raises:
        UserError: It is.
    """
    if path is None:
        return
    folder = Path(path)
    if folder == STANDARD_OUTPUT:
        raise UserError("is standard output; expected a folder for several files", where=path)
    if folder.suffix in OF_FILES and not folder.is_dir():
        raise UserError("is named like a file; expected a folder for several files", where=path)


def _same(first: Path | str, second: Path | str) -> bool:
    """Whether two paths lead to the same file, through links or not."""
    return os.path.realpath(first) == os.path.realpath(second)


CriterionLike = criteria.Criterion | str | Mapping[str, Any]


# Sensitivities are sums of products, of which each is known to some ``p^2 eps``: 1e-14 of five
# parameters, 2e-13 of thirty.
LEAST_GAP = 1e-12


def proved_gap(given: object, argument: str) -> float | None:
    """A relative gap that is to be proved; None where none is asked for.

    Raises:
        ArgumentError: It is no number between 0 and 1, or rounding alone makes a larger gap.
    """
    if given is None:
        return None
    if isinstance(given, Real) and LEAST_GAP <= float(given) < 1:
        return float(given)
    if isinstance(given, Real) and 0 < float(given) < LEAST_GAP:
        message = f"expected {LEAST_GAP:g} or more: rounding alone makes a gap of about as much"
        raise ArgumentError(message, argument=argument, given=given)
    raise ArgumentError("expected a relative gap between 0 and 1", argument=argument, given=given)


def given_size(size: int | None) -> int:
    """The number of experiments, which nothing else says.

    Raises:
        ArgumentError: It is not given.
    """
    if size is None:
        raise ArgumentError("expected the number of experiments", argument="size")
    return size


@contextmanager
def workers_for(workers: int | None, dask: str | None) -> Iterator[Workers]:
    """Workers that are open as long as the block runs.

    Args:
        workers: Processes on this machine; None for one a core.
        dask: Address of a Dask scheduler; None for this machine.

    Raises:
        ArgumentError: Both are given, no scheduler answers there, or its workers are lost.
    """
    if workers is not None and dask is not None:
        message = "a cluster's own workers do the work; expected one of both options"
        raise ArgumentError(message, argument="workers", given=workers)
    number = None if workers is None else whole_number(workers, "workers", 1)
    try:
        with open_workers(number, dask) as found:
            yield found
    except WorkersLostError as error:
        raise ArgumentError(str(error), argument="dask") from error


@dataclass(frozen=True)
class TableAndCertificate:
    """Where they go; each may be standard output, `-`, but one at a time.

    Attributes:
        out: The table (CSV); None for none.
        certificate: What proves the numbers (JSON); None for none.
        rest: A table of what is new alone (CSV); None for none.
    """

    out: Path | str | None
    certificate: Path | str | None
    rest: Path | str | None = None

    def require(self, *inputs: Path | str | None) -> None:
        """Check, before long work, that they can be written.

        Args:
            inputs: The files that the call reads; None entries do not count.

        Raises:
            UserError: They are the same file, or one of them is an input or holds measurements.
            OSError: A file cannot be written.
        """
        require_different(out=self.out, certificate=self.certificate, rest=self.rest)
        for path in (self.out, self.certificate, self.rest):
            require_output(path, *inputs)

    def write(
        self,
        table: Callable[[], "pd.DataFrame"],
        proof: Callable[[], str],
        new: Callable[[], "pd.DataFrame"] | None = None,
    ) -> None:
        """Write what was asked for, all files or none.

        Args:
            table: Makes the table.
            proof: Makes the text of the certificate.
            new: Makes the table of what is new.
        """
        from edtk.measure.cells import csv_text

        files: dict[Path, Content] = {}
        if self.out is not None:
            files[Path(self.out)] = csv_text(table())
        if self.certificate is not None:
            files[Path(self.certificate)] = proof()
        if self.rest is not None and new is not None:
            files[Path(self.rest)] = csv_text(new())
        write_files(files)


def at_hand(question: Problem | Region, keep: Any) -> Any:
    """Experiments at hand, as a call states them: a `Problem`, or indices of candidates, or None.

    They need be no candidates: points of a region, or a data frame with the candidates' columns.

    Raises:
        ArgumentError: They are neither.
    """
    import pandas as pd

    if keep is None or isinstance(keep, Problem):
        return keep
    if isinstance(question, Region):
        frame = isinstance(keep, pd.DataFrame)
        points = finite_numbers(_columns(keep, question.variables) if frame else keep, "keep")
        if not points.size:
            return None
        points = points[:, None] if points.ndim == 1 and question.size == 1 else points
        if points.ndim != 2 or points.shape[1] != question.size:
            message = f"expected points (n, {question.size}), or a Problem"
            raise ArgumentError(message, argument="keep")
        return question.problem(points)
    if not isinstance(keep, pd.DataFrame):
        return keep
    if question.rows_of is None or question.frame is None:
        message = (
            "a data frame needs one model of a data frame, with a noise that is known elsewhere; "
            "expected indices or a Problem"
        )
        raise ArgumentError(message, argument="keep")
    rows = question.rows_of(_columns(keep, tuple(question.frame.columns)))
    return Problem(rows, parameters=question.parameters)


def _columns(frame: "pd.DataFrame", names: Sequence[str]) -> "pd.DataFrame":
    """The named columns of a data frame.

    Raises:
        ArgumentError: One is missing.
    """
    missing = [name for name in names if name not in frame.columns]
    if missing:
        raise ArgumentError(f"no column {missing[0]!r} in the data frame", argument="keep")
    return frame[list(names)]
