"""A check that what a criterion gives to be minimised is something that can be minimised."""

from typing import TYPE_CHECKING

from criteria.criterion_error import CriterionError

if TYPE_CHECKING:
    import cvxpy as cp


def require_expression(found: object, place: str) -> "cp.Expression":
    """Check that a criterion's code has returned a scalar expression of cvxpy.

    Args:
        found: What the code has returned.
        place: The code, for the message: "criterion 'mine': its expression".

    Raises:
        CriterionError: It is something else, or has more than one entry.
    """
    import cvxpy as cp

    if not isinstance(found, cp.Expression):
        raise CriterionError(
            f"{place} returns an object of type {type(found).__name__}; expected a scalar "
            "expression of cvxpy"
        )
    if not found.is_scalar():
        raise CriterionError(
            f"{place} has shape {found.shape}; expected a scalar expression of cvxpy"
        )
    return found
