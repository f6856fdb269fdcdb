"""A problem in parameters that its candidates tell equally well."""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from edtk.design.packed_information import PackedInformation
from edtk.design.problem import Problem
from edtk.design.rows import Rows
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
    def of(cls, problem: Problem, needed: bool = False) -> "Whitened | None":
        """Whiten a problem, once; None where its squares are good enough as they are.

        Args:
            problem: The candidates.
            needed: Whether a criterion asks for it, however good they are.
        """
        good = problem.conditioning.is_well and not problem.has_distant_units
        if good and not needed:
            return None
        if problem not in _known:
            _known[problem] = cls.by(problem, problem.conditioning.whitener)
        return _known[problem]

    @classmethod
    def by(cls, problem: Problem, T: Array) -> "Whitened":
        """The problem for parameters k' with ``k = T k'``, whatever T (p, p) is."""
        white = problem.in_units(T)
        rounding = problem.kept.rounding_of_times(T)
        if isinstance(white.kept, Rows):
            # Directions that no candidate tells have columns of rounding alone.
            A = np.where(problem.conditioning.is_open, 0.0, white.kept.A)
            kept: Rows | PackedInformation = Rows(A)
            if 2 * A.shape[1] > white.p:  # squares are fewer numbers
                kept = PackedInformation(Rows(A).packed())
            white = Problem.of_kept(kept, None, white.prior)
        return cls(white, T, rounding)


# Several criteria of one problem share the work; it is forgotten with the problem.
_known: WeakKeyDictionary[Problem, Whitened] = WeakKeyDictionary()
