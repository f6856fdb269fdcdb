"""How many candidates a limit on memory allows."""

import numpy as np

BASE_MB = 350.0  # the interpreter with all libraries that a relaxation loads
DEFAULT_MB = 1000.0
# Candidates that a pass over those beyond memory brings back per multiplier, and the least number
# that is worth holding.
KEPT = 20_000
# Doubles per candidate besides information and poses: sensitivities, their order, weights.
WORK = 8


class MemoryLimitError(ValueError):
    """The limit on memory leaves no room for candidates.

    Attributes:
        limit_mb: The limit [MB].
        least_mb: The least limit that is enough [MB].
    """

    def __init__(self, limit_mb: float, least_mb: float) -> None:
        super().__init__(
            f"a memory limit of {limit_mb:g} MB is too small, expected {least_mb:g} MB or more"
        )
        self.limit_mb = limit_mb
        self.least_mb = least_mb


def capacity(doubles: int, variables: int, memory_mb: float) -> int:
    """Count the candidates that fit below a limit on memory.

    Each has its information, a scaled copy of that, its design variables and its sensitivities.

    Args:
        doubles: Numbers of a candidate's information, see `DesignSpace.doubles`.
        variables: Number of design variables of an experiment.
        memory_mb: Limit on memory [MB], for the whole process.

    Raises:
        MemoryLimitError: Fewer fit than are worth holding.
    """
    bytes_each = 8 * (2 * doubles + variables + WORK)
    fit = (memory_mb - BASE_MB) * 1e6 / bytes_each
    if not fit >= KEPT:  # also where the limit is not a number
        raise MemoryLimitError(memory_mb, np.ceil(BASE_MB + KEPT * bytes_each / 1e6))
    return int(min(fit, 2**62))
