"""How a relaxation over poses is carried out."""

from collections.abc import Callable
from dataclasses import dataclass

from edtk.design.relaxation.capacity import DEFAULT_MB


def ignore_progress(stage: str, gap: float) -> None:
    """Show nothing."""


def never() -> bool:
    """Do not stop early."""
    return False


@dataclass(frozen=True)
class RelaxOptions:
    """Accuracies, limits and callbacks of `relax_poses`.

    Attributes:
        gap: Relative gap to prove on the candidates.
        tolerance: Relative gap at which the search over the continuum ends. Half of it may be spent
            on merging support points.
        memory_mb: Limit on memory [MB].
        progress: Called with the name of the stage and its relative gap.
        stop: Asked, in the continuum, whether the bound found so far is enough.
    """

    gap: float = 1e-6
    tolerance: float = 1e-5
    memory_mb: float = DEFAULT_MB
    progress: Callable[[str, float], object] = ignore_progress
    stop: Callable[[], bool] = never
