"""What explains the residuals of measurements: faults, and readings that are off by themselves."""

from dataclasses import dataclass, replace

from edtk.calibration.causes.cause import Cause
from edtk.system.typing import Indices

MOST_OFF = 6  # one of so many rows may be an outlier, and one in any case
MOST_LOOKS = 20  # outliers that anybody would look at one by one


@dataclass(frozen=True)
class FoundCauses:
    """Faults that explain the residuals, and outliers beside which they do.

    Attributes:
        named: The best cause, and a second one that is about as likely; none if noise explains all.
        outliers: Rows that are off by themselves, counted from 0: the others were looked at without
            them.
        unexplained: Whether the best fault leaves what noise does not make; it is not named.
    """

    named: tuple[Cause, ...] = ()
    outliers: tuple[int, ...] = ()
    unexplained: bool = False

    def in_rows(self, rows: Indices) -> "FoundCauses":
        """The same of measurements of which these were some: their row i is `rows[i]` there."""
        named = tuple(replace(one, rows=_numbers(one.rows, rows)) for one in self.named)
        return replace(self, named=named, outliers=_numbers(self.outliers, rows))


def most_outliers(rows: int) -> int:
    """How many of so many rows may be off by themselves; of more, none is the odd one."""
    return min(max(1, rows // MOST_OFF), MOST_LOOKS)


def _numbers(found: tuple[int, ...], rows: Indices) -> tuple[int, ...]:
    """Numbers among all rows of some that were found among a part of them."""
    return tuple(int(rows[i]) for i in found)
