"""Whether candidates tell what has to be known, and the words where they do not."""

from typing import TYPE_CHECKING

import numpy as np

from criteria import Criterion
from edtk.design.rank_deficient_error import RankDeficientError
from edtk.design.rows import Rows

if TYPE_CHECKING:
    from edtk.design.problem import Problem


def require_identifiable(problem: "Problem", criterion: Criterion | None) -> None:
    """Check that the candidates and the prior together excite all that has to be known.

    Args:
        problem: The candidates.
        criterion: Tells what that is; None for all directions of the parameters.

    Raises:
        RankDeficientError: Some directions are open, or parameters can hardly be told apart.
    """
    if problem.conditioning.fades:
        how = "" if isinstance(problem.kept, Rows) else ", or give rows instead of information"
        raise RankDeficientError(
            "the candidates together do not identify all parameters to working precision: "
            f"their condition number is {problem.conditioning.number:.1e}; centre or scale the "
            f"regressors{how}"
        )
    if criterion is not None and not criterion.needs_all:
        missing = _missing(problem, criterion)
        if missing:
            raise RankDeficientError(
                "the candidates together cannot identify what is of interest: no candidate "
                f"tells {' or '.join(missing)}",
                of_interest=True,
            )
        return
    if problem.conditioning.is_open.any():
        directions = problem.conditioning.directions(problem.parameters)
        raise RankDeficientError(
            "the candidates together cannot identify all parameters: no candidate excites "
            f"{' or '.join(directions)}"
        )


def _missing(problem: "Problem", criterion: Criterion) -> tuple[str, ...]:
    """What the candidates leave open of all that a criterion needs, in words."""
    found = problem.conditioning
    if not problem.has_distant_units:
        M = problem.mean if found.is_well else found.information()
        return criterion.missing(M, problem.parameters)
    # In units of the columns' lengths no parameter is taken for rounding.
    M = found.information() / np.outer(found.scale, found.scale)
    return criterion.in_units(np.diag(1.0 / found.scale)).missing(M, problem.parameters)
