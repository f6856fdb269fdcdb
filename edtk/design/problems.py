"""Problems in other units, and with the prior that a criterion brings along."""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

from criteria import Criterion
from edtk.design.information import Known, Rows
from edtk.design.problem import Problem
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Whitened:
    """A problem for parameters k' with ``k = T k'``.

    Rows of a model such as a polynomial far from the origin are nearly dependent. Their information
    has the square of their condition number, and no digits left. So k' replaces k before any
    information is formed; its squares lose nothing.

    Attributes:
        problem: The candidates, for k'.
        T: Regular matrix (p, p), from a QR factorization of the rows.
        rounding: Bounds (n,) on the rounding ``|E_i|`` of the candidates' rows ``A_i T``; where
            there are no rows, on that of their information ``T' M_i T``.
    """

    problem: Problem
    T: Array
    rounding: Array

    @classmethod
    def of(cls, problem: Problem, needed: bool = False, as_rows: bool = False) -> "Whitened | None":
        """Whiten a problem, once; None where its squares are good enough as they are.

        Args:
            problem: The candidates.
            needed: Whether a criterion asks for it, however good they are.
            as_rows: Whether rows are to stay rows, however many they are; they are not shared then.
        """
        good = problem.conditioning.is_well and not problem.has_distant_units
        if good and not needed:
            return None
        if as_rows:
            return cls.by(problem, problem.conditioning.whitener, as_rows)
        if problem not in _known:
            _known[problem] = cls.by(problem, problem.conditioning.whitener)
        return _known[problem]

    @classmethod
    def by(cls, problem: Problem, T: Array, as_rows: bool = False) -> "Whitened":
        """The problem for parameters k' with ``k = T k'``, whatever T (p, p) is."""
        rounding = problem.kept.rounding_of_times(T)
        if not isinstance(problem.kept, Rows):
            return cls(problem.in_units(T), T, rounding)
        kept = problem.kept.whitened(T, problem.conditioning.open_columns, as_rows)
        prior = None if problem.known is None else problem.known.times(T)
        return cls(Problem.of_kept(kept, None, prior), T, rounding)


# Several criteria of one problem share the work; it is forgotten with the problem.
_known: WeakKeyDictionary[Problem, Whitened] = WeakKeyDictionary()


def absorb_prior(
    problem: Problem, criterion: Criterion, size: float = 1.0
) -> tuple[Problem, Criterion]:
    """Put the prior precision of a Bayesian criterion into the problem.

    ``phi(M + R)`` of a plan of m experiments is phi of their information where each of them has
    ``R/m`` besides its own; so every algorithm sees a homogeneous criterion. Of other criteria
    nothing changes.

    Args:
        problem: The candidates.
        criterion: Any criterion.
        size: Number m of experiments that share the prior; one where weights of sum one are sought.

    Returns:
        The problem with more prior information, and phi; or both as they were given.
    """
    criterion.require_order(problem.p)
    if criterion.precision is None:
        return problem, criterion
    own = criterion.precision / size
    prior = Known.of(own) if problem.known is None else problem.known.plus(own)
    return problem.with_prior(prior), criterion.without_prior
