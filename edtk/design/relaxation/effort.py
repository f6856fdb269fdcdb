"""How much is spent on the next restricted master problem."""

from dataclasses import dataclass

from edtk.design.relaxation.solver_options import NEWTON
from edtk.design.relaxation.step import Step

# Accuracy of Newton's method in parts of the gap that the candidates outside leave, and where they
# leave none.
INNER = 0.05
EXACT = 1e-10
# While the gap is above this, cvxpy solves a program to a few digits: its multiplier is good enough
# to say which candidates should enter, and the solver takes fewer iterations.
FAR = 0.05
# Parameters from which on a program of cvxpy takes longer than anyone waits for the last digit.
TOO_MANY = 40


@dataclass(frozen=True)
class Effort:
    """How accurately the next program is solved, and by which solvers in turn."""

    solvers: tuple[str, ...]
    accuracy: float

    @property
    def loose(self) -> bool:
        """Whether an answer to a few digits will do."""
        return self.accuracy > EXACT

    def after(
        self, step: Step, inaccurate: bool, gap: float, p: int, is_proved: bool = False
    ) -> "Effort":
        """The effort for the next program: more where the last answer was too inaccurate.

        Args:
            step: The last answer.
            inaccurate: Whether it was too inaccurate to say which candidates should enter.
            gap: The relative gap that it left.
            p: Number of parameters.
            is_proved: Whether this gap is small enough, so that a last program only sharpens it.
        """
        solvers = self.solvers
        if is_proved and step.solver == NEWTON:
            # Where the method breaks down now, no program of cvxpy's is worth its time and memory.
            solvers = (NEWTON,)
        if inaccurate and not self.loose:
            solvers = solvers[solvers.index(step.solver) + 1 :]
            if step.solver == NEWTON and p > TOO_MANY:
                solvers = ()
        by_newton = step.solver == NEWTON
        can_be_loose = self.loose and not inaccurate and (by_newton or gap > FAR)
        return Effort(solvers, max(INNER * gap, EXACT) if can_be_loose else EXACT)
