"""Models of a sheet that were weighed against each other, and what remains undecided."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from edtk.findings.causes.evidence import Weighed
from edtk.study.study import Study
from edtk.system.presented import Presented

if TYPE_CHECKING:
    import pandas as pd

MODELS_SHOWN = 8  # models in a table
UNDECIDED = 0.05  # probability of a piece from which, and to one less it, it is undecided
PLAIN = "ideal springs"


@dataclass(frozen=True, eq=False)
class WeighedModel:
    """A model with some pieces.

    Attributes:
        pieces: Names of its pieces.
        weighed: Its marginal likelihood, and what it says of parameters and pieces.
        weight: Its posterior weight among all models.
        left_out: Root mean square distance of poses that were left out one by one [m, or rad where
            rotations alone are measured].
        expected: Error to expect in the tasks if the model was the right one [m]; NaN without any.
    """

    pieces: tuple[str, ...]
    weighed: Weighed
    weight: float
    left_out: float
    expected: float

    @property
    def words(self) -> str:
        """Its name, for people."""
        return " + ".join((PLAIN, *self.pieces))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "pieces": list(self.pieces),
            "log_evidence": -self.weighed.score / 2,
            "weight": self.weight,
            "left_out_mm": 1e3 * self.left_out,
            "model_error_percent": 100 * self.weighed.share,
            "expected_mm": None if math.isnan(self.expected) else 1e3 * self.expected,
        }


@dataclass(frozen=True, eq=False)
class Extension(Presented):
    """Models of a sheet with their weights, and what remains undecided between them.

    Attributes:
        models: The models that count, the likeliest first; it is the chosen one. That of ideal
            springs is among them.
        tried: How many models were weighed.
        inclusion: Posterior probability of each piece, by name; of those that may be there at all.
        undecided: By how much models differ in the tasks from the chosen one, root mean square over
            their weights [m]; NaN without tasks.
        expected: Error to expect in the tasks, with the noise, what each model leaves out, what
            remains undecided, and all else that is uncertain [m]; NaN without tasks.
        study: The study of the chosen model; the given one where ideal springs are enough.
    """

    models: tuple[WeighedModel, ...]
    tried: int
    inclusion: dict[str, float]
    undecided: float
    expected: float
    study: Study

    @property
    def chosen(self) -> WeighedModel:
        """The likeliest model."""
        return self.models[0]

    @property
    def open(self) -> tuple[str, ...]:
        """Pieces that may be there or not."""
        return tuple(name for name, p in self.inclusion.items() if UNDECIDED < p < 1 - UNDECIDED)

    def headline(self) -> str:
        """The chosen model, and what remains undecided."""
        known = f"{self.chosen.words} ({100 * self.chosen.weight:.0f} %)"
        return known + (f"; undecided: {', '.join(self.open)}" if self.open else "")

    @property
    def shown(self) -> tuple[WeighedModel, ...]:
        """The models of a table: the likeliest, and that of ideal springs."""
        first = self.models[:MODELS_SHOWN]
        plain = [one for one in self.models if not one.pieces and one not in first]
        return (*first, *plain)

    def to_frame(self) -> "pd.DataFrame":
        """A row for each model."""
        import pandas as pd

        return pd.DataFrame(
            {
                "model": [one.words for one in self.models],
                "log_evidence": [-one.weighed.score / 2 for one in self.models],
                "weight": [one.weight for one in self.models],
                "left_out_mm": [1e3 * one.left_out for one in self.models],
                "expected_mm": [1e3 * one.expected for one in self.models],
            }
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        in_tasks = {"undecided_mm": self.undecided, "expected_mm": self.expected}
        return {
            "chosen": list(self.chosen.pieces),
            "models": [one.to_dict() for one in self.models],
            "tried": self.tried,
            "inclusion": self.inclusion,
            "undecided": list(self.open),
            **{name: None if math.isnan(x) else 1e3 * x for name, x in in_tasks.items()},
        }
