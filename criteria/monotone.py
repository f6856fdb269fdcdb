"""Which criteria may be about a part of the parameters."""

from criteria.criterion import Criterion
from criteria.criterion_error import CriterionError
from criteria.relaxable import Relaxable


def monotone(base: Criterion) -> Relaxable:
    """The criterion, if it may be applied to a part of the parameters.

    Raises:
        CriterionError: It may not.
    """
    if base.needs_target:
        raise CriterionError(
            f"criterion {base.name!r} says by its target what is of interest; expected a criterion "
            "without a target"
        )
    if not base.takes_interest:
        raise CriterionError(
            f"criterion {base.name!r} says by itself what is of interest; expected one that does "
            "not, such as D or A"
        )
    if not isinstance(base, Relaxable) or not base.monotone or not base.convex:
        raise CriterionError(
            f"criterion {base.name!r} is not monotone and convex; expected one that is, such as D "
            "or A, for a part of the parameters"
        )
    return base
