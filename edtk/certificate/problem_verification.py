"""The result of checking a certificate of a problem of arrays."""

from dataclasses import dataclass
from typing import Any

from edtk.certificate.verification import Verification


@dataclass(frozen=True, repr=False)
class ProblemVerification(Verification):
    """All claims of a certificate of a relaxation over a problem's candidates, checked.

    Attributes:
        about: The criterion as a person reads it, with its parameters.
    """

    about: str = ""

    @property
    def proved(self) -> str:
        """What is proved, and on what."""
        if not self.valid:
            return "nothing is proved"
        return f"the bound is proved on the {self.candidates} candidates of the problem alone"

    @property
    def label(self) -> str:
        """The criterion as a person reads it."""
        return self.about

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: `valid`, what the certificate is about, and the claims."""
        return {
            "valid": self.valid,
            "criterion": self.criterion,
            "about": self.about,
            "kind": self.kind,
            "candidates": self.candidates,
            "proved": self.proved,
            "support": self.poses,
            "second_implementation": False,
            "claims": [claim.to_dict() for claim in self.claims],
        }
