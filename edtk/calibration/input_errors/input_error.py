"""The error that measurements end in which are certainly wrong."""

from pathlib import Path
from typing import TYPE_CHECKING

from edtk.calibration.finding import Finding
from edtk.calibration.wording import wording
from edtk.system.errors import UserError

if TYPE_CHECKING:
    from edtk.calibration.calibration import Calibration


class InputError(UserError):
    """Measurements are certainly wrong.

    Attributes:
        finding: The first error, with rows and columns.
        calibration: The calibration of the sheet as it is, which is not to be used, with the causes
            of the error.
    """

    def __init__(self, path: Path, finding: Finding, calibration: "Calibration") -> None:
        super().__init__(wording(finding), where=path)
        self.finding = finding
        self.calibration = calibration
