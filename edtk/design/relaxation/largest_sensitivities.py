"""The largest sensitivity to each of several multipliers, and where it was found."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from criteria import Criterion
from edtk.design.candidates import Candidates
from edtk.design.relaxation.normalised import normalised
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class LargestSensitivities:
    """The numbers from which a bound follows, together with the multipliers.

    Attributes:
        values: The largest sensitivity (r,) to each multiplier, of the normalised problem.
        x: Design variables (r, v) of the experiments that have it.
    """

    values: Array
    x: Array

    @classmethod
    def of(cls, sensitivities: Array, x: Array) -> "LargestSensitivities":
        """The largest of sensitivities (r, n) of experiments (n, v)."""
        where = sensitivities.argmax(axis=-1)
        return cls(sensitivities[np.arange(len(where)), where], x[where])

    @classmethod
    def over(
        cls, candidates: Candidates, criterion: Criterion, multipliers: Array
    ) -> "LargestSensitivities":
        """The largest sensitivities of candidates (n) to multipliers (r, p, p)."""
        problem = normalised(candidates.problem, criterion)
        return cls.of(problem.sensitivities(multipliers), candidates.x)

    def or_larger(self, others: "LargestSensitivities") -> "LargestSensitivities":
        """The larger one of two, for each multiplier."""
        keeps = self.values >= others.values
        return LargestSensitivities(
            np.maximum(self.values, others.values), np.where(keeps[:, None], self.x, others.x)
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        return {"values": self.values.tolist(), "x": self.x.tolist()}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> "LargestSensitivities":
        """Restore an object that `to_dict` has written, bit by bit."""
        return cls(np.array(data["values"]), np.array(data["x"]))
