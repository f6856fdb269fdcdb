"""Another way of reading the columns of a measurement file."""

from dataclasses import dataclass

from edtk.calibration.finding import Finding
from edtk.inference.measurements import Measurements


@dataclass(frozen=True, eq=False)
class Reading:
    """One way of reading the columns.

    Attributes:
        finding: The error of the columns that it assumes.
        data: The measurements, read so.
    """

    finding: Finding
    data: Measurements
