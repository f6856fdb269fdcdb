"""A finding about measurements that can be used all the same, with its severity."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from edtk.calibration.finding import Finding, Kind
from edtk.calibration.wording import wording


class Severity(IntEnum):
    """What a finding means for the result."""

    NOTE = 0  # worth knowing
    WARNING = 1  # the result can be used, with care
    ALARM = 2  # do not use the result


@dataclass(frozen=True)
class Diagnostic:
    """One thing that looks wrong in measurements.

    Attributes:
        severity: What it means for the result.
        finding: What it is, and where.
    """

    severity: Severity
    finding: Finding

    @property
    def kind(self) -> Kind:
        """What it is."""
        return self.finding.kind

    @property
    def text(self) -> str:
        """What, where, and what was expected, in one line."""
        return wording(self.finding)

    def to_dict(self) -> dict[str, Any]:
        """Severity, kind and text; rows are counted from 1."""
        return {
            "severity": self.severity.name.lower(),
            "kind": self.kind.name.lower(),
            "text": self.text,
            "rows": [row + 1 for row in self.finding.rows],
        }
