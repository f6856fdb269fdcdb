"""The result of checking a certificate: each claim, stated and recomputed."""

from dataclasses import asdict, dataclass
from typing import Any

from edtk.system.presented import Presented


@dataclass(frozen=True)
class Claim:
    """One claim of a certificate.

    Attributes:
        claim: Name: "feasible", "value", "bound", ...
        holds: Whether the recomputed number agrees with the stated one.
        stated: The number in the certificate; None for a claim without a number.
        recomputed: The number found here; None where nothing could be computed.
        reason: Why the claim does not hold, in one line; empty if it does.
    """

    claim: str
    holds: bool
    stated: float | None
    recomputed: float | None
    reason: str = ""


@dataclass(frozen=True, repr=False)
class Verification(Presented):
    """All claims of a certificate, checked.

    Attributes:
        subject: The criterion and the kind of plan that the certificate is about.
        claims: The claims, in the order in which they were checked.
    """

    subject: str
    claims: tuple[Claim, ...]

    @property
    def valid(self) -> bool:
        """Whether every claim holds."""
        return all(claim.holds for claim in self.claims)

    def headline(self) -> str:
        """One line: the subject, and whether all claims hold."""
        verdict = "valid" if self.valid else "NOT valid"
        return f"Verification({self.subject}: {verdict}, {len(self.claims)} claims)"

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: `valid`, and the claims."""
        return {"valid": self.valid, "claims": [asdict(claim) for claim in self.claims]}
