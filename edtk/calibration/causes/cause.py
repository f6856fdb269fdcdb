"""A fault that explains the residuals, with its size."""

from dataclasses import dataclass
from typing import Any

NOISE = "sigma"  # the cause that is no fault: a noise of another size
OUTLIER = "outlier"  # a reading that is off; it has diagnostics of its own, and is never named
POSE = "pose"  # readings of another pose than the one written down
PRIOR = "prior"  # what was known before is wrong; it has diagnostics of its own, too


@dataclass(frozen=True)
class Cause:
    """One fault that explains the residuals better than noise does.

    Attributes:
        cause: Name of the fault.
        size: Its size, in `unit`; the length where it is a vector.
        unit: Unit of the size.
        std: Standard deviation of the size; None where it is one of a list of possibilities.
        p: Probability that good data of the stated noise look so much like this fault, after
            looking at all others as well.
        explained: Share of the misfit (chi-square beyond its expectation) that the fault explains.
        joint: The joint that it is in; empty if it is in none.
        rows: Rows that it is in, counted from 0; empty for all.
        times: Of a second cause: how often each experiment would have to be measured until the
            first one is told from it; None if that is not known, or a hundred times do not.
        grows: Whether it grows from row to row, up to its size.
    """

    cause: str
    size: float
    unit: str
    std: float | None
    p: float
    explained: float = 1.0
    joint: str = ""
    rows: tuple[int, ...] = ()
    times: int | None = None
    grows: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON; rows are counted from 1."""
        return {
            "cause": self.cause,
            "size": self.size,
            "unit": self.unit,
            "std": self.std,
            "p": self.p,
            "explained": self.explained,
            "joint": self.joint or None,
            "rows": [row + 1 for row in self.rows],
            "times": self.times,
            "grows": self.grows,
        }
