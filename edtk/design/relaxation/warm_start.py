"""Where a restricted master problem starts from: the answer of a like one."""

from dataclasses import dataclass, replace

import numpy as np

from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class WarmStart:
    """Candidates with the weights and the multiplier that they had last.

    Attributes:
        candidates: Indices (k,) of the candidates; none where nothing is known.
        weights: Their weights (k,), of sum one; zero for those that are new.
        multiplier: The multiplier (p, p) of these weights, if it is known.
    """

    candidates: Indices
    weights: Array
    multiplier: Array | None = None

    @classmethod
    def none(cls) -> "WarmStart":
        """Nothing is known."""
        return cls(np.empty(0, dtype=int), np.empty(0))

    @classmethod
    def alike(cls, candidates: Indices) -> "WarmStart":
        """Candidates (k,) of equal weights."""
        return cls(candidates, np.full(len(candidates), 1.0 / len(candidates)))

    def __len__(self) -> int:
        """Number of candidates."""
        return len(self.candidates)

    def inside(self, part: Indices) -> "WarmStart":
        """The same, as indices into a part of all candidates (k, ascending) that has them all."""
        return replace(self, candidates=np.searchsorted(part, self.candidates))

    def outside(self, part: Indices) -> "WarmStart":
        """The same as indices into all candidates, from those into a part (k, ascending)."""
        return replace(self, candidates=part[self.candidates])
