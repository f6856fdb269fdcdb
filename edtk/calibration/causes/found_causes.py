"""What explains the residuals of measurements: faults, and readings that are off by themselves."""

from dataclasses import dataclass, replace

from edtk.calibration.causes.cause import Cause
from edtk.system.typing import Indices


@dataclass(frozen=True)
class FoundCauses:
    """Faults that explain the residuals, and outliers beside which they do.

    Attributes:
        named: The best cause, and a second one that is about as likely; none if noise explains all.
        outliers: Rows that are off by themselves, counted from 0: the others were looked at without
            them.
    """

    named: tuple[Cause, ...] = ()
    outliers: tuple[int, ...] = ()

    def in_rows(self, rows: Indices) -> "FoundCauses":
        """The same of measurements of which these were some: their row i is `rows[i]` there."""
        named = tuple(replace(one, rows=_numbers(one.rows, rows)) for one in self.named)
        return FoundCauses(named, _numbers(self.outliers, rows))


def _numbers(found: tuple[int, ...], rows: Indices) -> tuple[int, ...]:
    """Numbers among all rows of some that were found among a part of them."""
    return tuple(int(rows[i]) for i in found)
