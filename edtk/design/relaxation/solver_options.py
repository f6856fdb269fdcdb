"""How a relaxation over candidates is solved."""

from dataclasses import dataclass

from edtk.design.relaxation.restricted_master import CHAIN

NEWTON = "NEWTON"
# Newton's method knows smooth criteria only; the others' programs are cvxpy's.
SOLVERS_IN_TURN = (NEWTON, *CHAIN)
LEAST_BATCH = 40
# Candidates per parameter that enter per round: the support grows with the number of parameters.
BATCH_PER_PARAMETER = 4


@dataclass(frozen=True)
class SolverOptions:
    """Limits and solvers of column generation; the defaults suit every built-in criterion.

    Attributes:
        rounds: Limit on the number of restricted master problems per convex program.
        batch: Candidates that enter the restricted master problem per round, at most; defaults to
            40, and to more where there are more than ten parameters.
        solvers: Names from `SOLVERS_IN_TURN`, the first to be tried first.

    Raises:
        ValueError: A solver is unknown, none is given, or rounds or batch are below one.
    """

    rounds: int = 60
    batch: int | None = None
    solvers: tuple[str, ...] = SOLVERS_IN_TURN

    def __post_init__(self) -> None:
        unknown = [solver for solver in self.solvers if solver not in SOLVERS_IN_TURN]
        if unknown:
            known = ", ".join(SOLVERS_IN_TURN)
            raise ValueError(f"unknown solver {unknown[0]!r}; available: {known}")
        if self.rounds < 1 or self.batch_of(1) < 1 or not self.solvers:
            raise ValueError("rounds and batch must be at least one, and there must be a solver")

    def batch_of(self, p: int) -> int:
        """The batch for p parameters."""
        return max(LEAST_BATCH, BATCH_PER_PARAMETER * p) if self.batch is None else self.batch
