"""The result of checking a certificate: each claim, stated and recomputed."""

import math
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
        candidates: Number of candidates over which a bound is proved; None for other claims.
    """

    claim: str
    holds: bool
    stated: float | None
    recomputed: float | None
    reason: str = ""
    candidates: int | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON, which knows no infinity: such a number becomes None."""
        return {
            name: None if isinstance(part, float) and not math.isfinite(part) else part
            for name, part in asdict(self).items()
        }


@dataclass(frozen=True, repr=False)
class Verification(Presented):
    """All claims of a certificate, checked.

    Attributes:
        criterion: Name of the criterion.
        kind: "relaxation" or "plan".
        robot: Name of the robot.
        poses: Number of poses of the design.
        kept: Number of experiments that the certificate takes as carried out already.
        candidates: Number of candidates over which a bound is proved.
        claims: The claims, in the order in which they were checked.
        prior: Whether the certificate takes something as known beforehand.
        of: Combinations of the compliances that the criterion is about; none if about all.
        sampling: How the candidates are drawn: "random" or "sobol"; empty where they are given.
        searched: Whether a bound over all poses is stated.
        experiments: Number of experiments of a plan, the kept ones not counted.
        budget: What a plan may cost; None without a budget.
        of_study: Whether a study stood beside the certificate, so that its setting is not the
            file's own word.
    """

    criterion: str
    kind: str
    robot: str
    poses: int
    kept: int
    candidates: int
    claims: tuple[Claim, ...]
    of: tuple[str, ...] = ()
    prior: bool = False
    sampling: str = ""
    searched: bool = False
    experiments: int = 0
    budget: float | None = None
    of_study: bool = False

    @property
    def label(self) -> str:
        """The criterion, and what it is about if not all compliances: "D of k2, k3"."""
        return f"{self.criterion} of {', '.join(self.of)}" if self.of else self.criterion

    @property
    def valid(self) -> bool:
        """Whether every claim holds."""
        return all(claim.holds for claim in self.claims)

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the claims that do not hold."""
        return tuple(claim.claim for claim in self.claims if not claim.holds)

    @property
    def proved(self) -> str:
        """What is proved, and on what: a sentence that cannot be read as more."""
        if not self.valid:
            return "nothing is proved"
        where = "for this study" if self.of_study else "in a setting that is the file's own word"
        searched = "searched over all poses, not proved"
        if self.kind == "plan" and self.searched:
            return f"{where}; its efficiency beside {self._plans} is {searched}"
        plural = "" if self.candidates == 1 else "s"
        drawn = f"{self.candidates:,} {self.sampling} candidate pose{plural} alone"
        of = f" on {self._plans}" if self.kind == "plan" else ""
        beyond = (
            f"over all poses it is {searched}" if self.searched else "other poses may be better"
        )
        return f"{where}; the bound{of} is proved on {drawn}: {beyond}"

    @property
    def _plans(self) -> str:
        """The plans beside which a plan is judged."""
        if self.budget is not None:
            return f"all plans within a budget of {self.budget:g}"
        return (
            f"all plans of {self.experiments} new experiment{'' if self.experiments == 1 else 's'}"
        )

    def headline(self) -> str:
        """The subject, and whether all claims hold."""
        verdict = "valid" if self.valid else f"NOT valid ({', '.join(self.failed)})"
        return f"certificate of a {self.kind}, {self.label}: {verdict}"

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: `valid`, what the certificate is about, and the claims."""
        return {
            "valid": self.valid,
            "criterion": self.criterion,
            "kind": self.kind,
            "robot": self.robot,
            "poses": self.poses,
            "kept": self.kept,
            "candidates": self.candidates,
            "proved": self.proved,
            "of_study": self.of_study,
            **({"prior": True} if self.prior else {}),
            **({"interest": list(self.of)} if self.of else {}),
            "claims": [claim.to_dict() for claim in self.claims],
        }
