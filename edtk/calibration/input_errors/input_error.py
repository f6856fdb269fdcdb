"""The error that measurements end in which are certainly wrong."""

from pathlib import Path

from edtk.calibration.finding import Finding
from edtk.calibration.wording import wording
from edtk.system.errors import UserError


class InputError(UserError):
    """Measurements are certainly wrong.

    Attributes:
        finding: The first error, with rows and columns.
    """

    def __init__(self, path: Path, finding: Finding) -> None:
        super().__init__(wording(finding), where=path)
        self.finding = finding
