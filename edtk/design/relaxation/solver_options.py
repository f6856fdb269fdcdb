"""How a relaxation over candidates is solved."""

from dataclasses import dataclass

from edtk.design.relaxation.restricted_master import CHAIN


@dataclass(frozen=True)
class SolverOptions:
    """Limits and solvers of column generation; the defaults suit every built-in criterion.

    Attributes:
        rounds: Limit on the number of restricted master problems per convex program.
        batch: Candidates that enter the restricted master problem per round, at most.
        solvers: Names from `CHAIN`, the first to be tried first.

    Raises:
        ValueError: A solver is unknown, none is given, or rounds or batch are below one.
    """

    rounds: int = 60
    batch: int = 40
    solvers: tuple[str, ...] = CHAIN

    def __post_init__(self) -> None:
        unknown = [solver for solver in self.solvers if solver not in CHAIN]
        if unknown:
            raise ValueError(f"unknown solver {unknown[0]!r}; available: {', '.join(CHAIN)}")
        if self.rounds < 1 or self.batch < 1 or not self.solvers:
            raise ValueError("rounds and batch must be at least one, and there must be a solver")
