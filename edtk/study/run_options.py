"""The options of long computations: seed, processes and progress."""

from collections.abc import Callable
from dataclasses import dataclass

from edtk.system.workers import Workers

Progress = Callable[[str, float], object]
THIS_PROCESS = Workers()


def no_progress(label: str, number: float) -> None:
    """Report to nobody."""


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """How a long computation is carried out; the question itself is the study.

    Attributes:
        seed: Takes the place of the study's seed; None for the study's own.
        workers: The processes that do the work; answers do not depend on them. Defaults to this
            one.
        progress: Called with a label of what is done, and a number: a relaxation reports its
            relative gap, the search for a plan its best cost so far, and a whole run the share of
            its steps that are done.
    """

    seed: int | None = None
    workers: Workers = THIS_PROCESS
    progress: Progress = no_progress


DEFAULTS = RunOptions()
