"""Plans of which none is worse than another of the same question that is limited more."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from edtk.study.case import Case

GAIN = 1e-6  # relative improvement that counts; plans that differ by less are one, but for rounding


def none_worse(cases: Sequence[Case]) -> list[Case]:
    """Cases in the same order, each with the best plan of all that answer its question.

    A plan of at most k poses answers the question for one of at most k + 1, and for one of any
    number. Where poses of a search come close to each other, the search for fewer of them may find
    the better plan.
    """
    return [_with_best(case, [other for other in cases if _answers(other, case)]) for case in cases]


def _answers(other: Case, case: Case) -> bool:
    """Whether a plan is one of the same criterion and size, on no more poses."""
    if other.found is None or other.optimised != case.optimised or other.size != case.size:
        return False
    return _limit(other) <= _limit(case)


def _limit(case: Case) -> float:
    """Number of distinct poses at most."""
    return np.inf if case.distinct is None else case.distinct


def _with_best(case: Case, others: Sequence[Case]) -> Case:
    """The case, with the plan of another one where that is better."""
    own = np.inf if case.found is None else case.found.cost
    for other in others:
        assert other.found is not None
        if other.found.cost < own * (1 - GAIN):
            own = other.found.cost
            case = replace(case, plan=other.plan, found=other.found, reason="")
    return case
