"""The accuracy to expect in each of several test poses, or along a path."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class TaskAccuracy:
    """Errors of the tool point after compensation, for each task pose.

    Attributes:
        along: Length (t,) of the path from the first tool point to each, straight from one to the
            next [m].
        weight: Weights (t,) of the poses.
        error: Root mean square errors (t,), Eq. (17); rotations count where the task says so [m].
        band: Ends (t, 2) of the ranges in which 95 % of the errors lie [m].
        before: Displacement (t,) without compensation [m]; None if the compliances are not known.
        is_path: Whether the poses follow each other along a path.
        total: Errors (t,) with all that else is uncertain, see `ErrorBudget`, those around a pose
            included where its task says so [m]; None if they are not known.
    """

    along: Array
    weight: Array
    error: Array
    band: Array
    before: Array | None
    is_path: bool
    total: Array | None = None

    @property
    def worst(self) -> int:
        """Index of the pose with the largest error, among those that have a weight."""
        return self.worst_of(self.error)

    @property
    def mean(self) -> float:
        """Root of the weighted mean of squares: rho0, if no neighbourhoods count [m]."""
        return self.mean_of(self.error)

    def worst_of(self, errors: Array) -> int:
        """Index of the largest of some errors (t,), among poses that have a weight."""
        return int(np.where(self.weight > 0, errors, -1.0).argmax())

    def mean_of(self, errors: Array) -> float:
        """Root of the weighted mean of squares of some errors (t,)."""
        return float(np.sqrt(np.average(errors**2, weights=self.weight)))

    def to_frame(self) -> "pd.DataFrame":
        """A row for each pose: number from 1, weight, millimetres."""
        import pandas as pd

        columns: dict[str, Any] = {"pose": np.arange(1, len(self.error) + 1)}
        if self.is_path:
            columns["along_mm"] = 1e3 * self.along
        columns["weight"] = self.weight
        if self.before is not None:
            columns["uncompensated_mm"] = 1e3 * self.before
        if self.total is not None:
            columns["total_error_mm"] = 1e3 * self.total
        columns["error_mm"] = 1e3 * self.error
        columns["low_95_mm"] = 1e3 * self.band[:, 0]
        columns["high_95_mm"] = 1e3 * self.band[:, 1]
        return pd.DataFrame(columns)

    def to_dict(self) -> list[dict[str, Any]]:
        """Plain numbers for JSON, an object a pose [m]."""
        return [
            {
                "pose": i + 1,
                "along": float(self.along[i]),
                "weight": float(self.weight[i]),
                "uncompensated": None if self.before is None else float(self.before[i]),
                "error": float(self.error[i]),
                "error_band95": self.band[i].tolist(),
                **({} if self.total is None else {"total": float(self.total[i])}),
            }
            for i in range(len(self.error))
        ]
