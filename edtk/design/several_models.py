"""Candidates under several models at once: one design that has to serve them all."""

from collections.abc import Sequence

import numpy as np

from edtk.design.problem import Problem
from edtk.system.errors import ArgumentError


def several_models(problems: Sequence[Problem]) -> Problem:
    """Put the models of the same candidates side by side.

    The information matrix is block diagonal, ``diag(M_1, .., M_k)`` with a block a model. Criteria
    with `sizes`, such as `criteria.create("minimax", criteria=["D", "D"], sizes=[2, 3])`, are about
    one block each.

    Args:
        problems: The same n candidates under each model, in the same order.

    Returns:
        A problem of ``p_1 + .. + p_k`` parameters, named as in the models; a name that several
        models use is followed by the number of its model, as in "k1 (2)".

    Raises:
        ArgumentError: There is no model, or the numbers of candidates differ.

    Example:
        >>> import numpy as np, edtk
        >>> x = np.linspace(-1, 1, 41)
        >>> line, parabola = (np.vander(x, p, increasing=True)[:, None, :] for p in (2, 3))
        >>> both = edtk.several_models([edtk.Problem(line), edtk.Problem(parabola)])
        >>> worst = edtk.criteria.create("minimax", criteria=["D", "D"], sizes=[2, 3])
        >>> x[edtk.relax(both, worst).weights > 0.1].tolist()
        [-1.0, 0.0, 1.0]
    """
    if not problems:
        raise ArgumentError("expected at least one model", argument="problems")
    counts = [problem.n for problem in problems]
    if len(set(counts)) > 1:
        raise ArgumentError(
            f"the models have {', '.join(map(str, counts))} candidates; expected as many of each",
            argument="problems",
        )
    factors = [problem.factors() for problem in problems]
    p = sum(problem.p for problem in problems)
    rows = sum(U.shape[1] for U in factors)
    blocks = np.zeros((counts[0], rows, p))
    prior = np.zeros((p, p))
    row = 0
    column = 0
    for problem, U in zip(problems, factors, strict=True):
        own = slice(column, column + problem.p)
        blocks[:, row : row + U.shape[1], own] = U
        if problem.prior is not None:
            prior[own, own] = problem.prior
        row += U.shape[1]
        column += problem.p
    has_prior = any(problem.prior is not None for problem in problems)
    return Problem(blocks, parameters=_names(problems), prior=prior if has_prior else None)


def _names(problems: Sequence[Problem]) -> tuple[str, ...]:
    """The parameters' names, made different."""
    every = [name for problem in problems for name in problem.parameters]
    return tuple(
        f"{name} ({i})" if every.count(name) > 1 else name
        for i, problem in enumerate(problems, start=1)
        for name in problem.parameters
    )
