"""Check that a plan of a given size can identify all parameters."""

from edtk.design.design_space import DesignSpace
from edtk.design.exact.smallest_size import smallest_size


class TooFewExperimentsError(ValueError):
    """More experiments, or more distinct poses, are needed to identify all parameters.

    Attributes:
        what: "experiment" or "distinct pose".
        number: The number that was asked for.
        parameters: The number of parameters.
        least: The smallest number that can identify them.
    """

    def __init__(self, what: str, number: int, parameters: int, least: int) -> None:
        super().__init__(what, number, parameters, least)
        self.what = what
        self.number = number
        self.parameters = parameters
        self.least = least

    def __str__(self) -> str:
        plural = "s" if self.number > 1 else ""
        return (
            f"{self.number} {self.what}{plural} cannot identify {self.parameters} parameters; "
            f"the smallest number is {self.least}"
        )


def require_enough(space: DesignSpace, m: int, places: int) -> None:
    """Check that m experiments at so many distinct poses can identify all parameters.

    Raises:
        TooFewExperimentsError: They cannot; carries the smallest number that can.
        RankDeficientError: No number of experiments can.
    """
    least = smallest_size(space)
    for what, number in (("experiment", m), ("distinct pose", places)):
        if number < least:
            raise TooFewExperimentsError(what, number, space.model.p, least)
