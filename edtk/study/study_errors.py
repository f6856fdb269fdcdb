"""The one place where errors of the design room become lines about a study."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from edtk.design.candidate_source import EmptyFeasibleSetError
from edtk.design.problem import RankDeficientError
from edtk.design.relaxation.capacity import MemoryLimitError
from edtk.design.relaxation.restricted_master import RelaxationError
from edtk.system.errors import ArgumentError, UserError
from edtk.system.workers import WorkersLostError

if TYPE_CHECKING:
    from edtk.study.study import Study


@contextmanager
def study_errors(study: "Study") -> Iterator[None]:
    """Turn errors of relaxations and searches into one line that says what to change.

    Args:
        study: The study that is being answered.

    Raises:
        UserError: Names the key of the study, or is an `ArgumentError` that names the argument of
            the call.
    """
    try:
        yield
    except EmptyFeasibleSetError as error:
        raise study.error("workspace", str(error)) from error
    except RankDeficientError as error:
        unknown = "joints.unknown" if study.specification.parameters is None else "parameters"
        key = "interest" if error.of_interest else unknown
        raise study.error(key, str(error)) from error
    except MemoryLimitError as error:
        raise ArgumentError(str(error), argument="memory_mb") from error
    except (NotImplementedError, RelaxationError) as error:
        raise UserError(str(error), where=study.where) from error
    except WorkersLostError as error:
        raise UserError(str(error)) from error
