"""Check that a plan of a given size can identify all parameters."""

from criteria import Criterion
from edtk.design.design_space import DesignSpace
from edtk.design.exact.no_plan_error import NoPlanError
from edtk.design.exact.smallest_size import smallest_size


class TooFewExperimentsError(NoPlanError):
    """More experiments, or more distinct poses, are needed to identify all parameters.

    Attributes:
        what: "experiment" or "distinct pose".
        number: The number that was asked for.
        parameters: The number of parameters.
        least: The smallest number that can identify them.
        of: Label of a criterion that needs some of the parameters only; empty if all are needed.
    """

    def __init__(self, what: str, number: int, parameters: int, least: int, of: str = "") -> None:
        super().__init__(what, number, parameters, least, of)
        self.what = what
        self.number = number
        self.parameters = parameters
        self.least = least
        self.of = of

    def __str__(self) -> str:
        plural = "s" if self.number > 1 else ""
        needed = f"what {self.of} needs" if self.of else f"{self.parameters} parameters"
        return (
            f"{self.number} {self.what}{plural} cannot identify {needed}; "
            f"the smallest number is {self.least}"
        )


def require_enough(space: DesignSpace, m: int, places: int, criterion: Criterion) -> None:
    """Check that m experiments at so many distinct poses can identify all that a criterion needs.

    Raises:
        TooFewExperimentsError: They cannot; carries the smallest number that can.
        RankDeficientError: No number of experiments can.
    """
    least = smallest_size(space, criterion)
    for what, number in (("experiment", m), ("distinct pose", places)):
        if number < least:
            of = "" if criterion.needs_all else criterion.label
            raise TooFewExperimentsError(what, number, space.p, least, of)
