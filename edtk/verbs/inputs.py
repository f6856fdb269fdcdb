"""Inputs of a verb: a path, a table, or what another verb returns."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeGuard

from edtk.design.plan import Plan
from edtk.study.study import Study, load_study
from edtk.system.errors import ArgumentError, UserError
from edtk.tables.pose_table import Table, path_of

if TYPE_CHECKING:
    import pandas as pd


class HasPlan(Protocol):
    """A result with a plan, such as that of `edtk.plan`."""

    @property
    def whole(self) -> Plan:
        """All its experiments."""


StudyLike = Study | Path | str
PlanLike = Plan | HasPlan | Table


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
    return study if isinstance(study, Study) else load_study(study)


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
    """The content of a result, as its file would hold it; None for a path and anything else."""
    if isinstance(result, Mapping):
        return result
    to_dict = getattr(result, "to_dict", None)
    content = to_dict() if callable(to_dict) and not _is_frame(result) else None
    return content if isinstance(content, Mapping) else None


@contextmanager
def errors_in(where: Path | str) -> Iterator[None]:
    """Name the input in errors that only the arithmetic or the file system finds.

    Args:
        where: The file, or the word, that begins the message.

    Raises:
        UserError: A plan or sheet leaves parameters open, or a file cannot be used.
    """
    from edtk.inference.least_squares import SingularPlanError

    try:
        yield
    except SingularPlanError as error:
        raise UserError(str(error), where=where) from error
    except OSError as error:
        # Without a name it is none of the files that were asked for: memory of workers, say.
        raise UserError(error.strerror or str(error), where=error.filename) from error
