"""Arguments that count something."""

from operator import index

from edtk.system.errors import ArgumentError


def whole_number(given: object, argument: str, least: int) -> int:
    """The argument as a whole number that is not too small.

    Args:
        given: What the caller gave.
        argument: Name of the argument.
        least: The least number that makes sense.

    Raises:
        ArgumentError: It is not such a number.
    """
    try:
        number = index(given)  # type: ignore[arg-type]
    except TypeError as error:
        message = f"expected a whole number, {least} or more"
        raise ArgumentError(message, argument=argument, given=given) from error
    if number < least:
        message = f"expected a whole number, {least} or more"
        raise ArgumentError(message, argument=argument, given=given)
    return number
