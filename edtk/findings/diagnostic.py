"""A finding about measurements that can be used all the same, with its severity."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from edtk.findings.finding import Finding, Kind
from edtk.findings.wording import wording


class Severity(IntEnum):
    """The consequence of a finding for the result."""

    NOTE = 0  # worth knowing
    WARNING = 1  # the result can be used, with care
    ALARM = 2  # do not use the result


@dataclass(frozen=True)
class Diagnostic:
    """One thing that looks wrong in measurements.

    Attributes:
        severity: Its consequence for the result.
        finding: Its kind, rows, columns and numbers.
    """

    severity: Severity
    finding: Finding

    @property
    def kind(self) -> Kind:
        """The kind of the finding."""
        return self.finding.kind

    @property
    def text(self) -> str:
        """One line that says what is wrong, where, and what was expected."""
        return wording(self.finding)

    def to_dict(self) -> dict[str, Any]:
        """Severity, kind and text; rows are counted from 1."""
        return {
            "severity": self.severity.name.lower(),
            "kind": self.kind.name.lower(),
            "text": self.text,
            "rows": [row + 1 for row in self.finding.rows],
        }
