"""Inputs of a verb: a path, or the object that is read from it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from edtk.design.plan import Plan
from edtk.study.study import Study, load_study
from edtk.system.errors import UserError

StudyLike = Study | Path | str
PlanLike = Plan | Path | str


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


def as_plan(study: Study, plan: PlanLike) -> Plan:
    """The plan itself, or the plan of a CSV file, whose poses are checked against the workspace.

    Raises:
        UserError: The file is not a valid plan; the message names the file, the row and the column.
    """
    return plan if isinstance(plan, Plan) else study.load_plan(plan)


def name_of(given: object, otherwise: str) -> Path:
    """The path that messages name: the given one, or a word for an object without a file."""
    return Path(given) if isinstance(given, str | Path) else Path(otherwise)


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
