"""The error to expect in a task after a compensation, in parts that have names."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from edtk.system.presented import Presented


@dataclass(frozen=True)
class ErrorBudget(Presented):
    """Root mean square errors of the tool point after compensation in the task, by source [m].

    Attributes:
        noise: Of the measurements: rho0, Eq. (20).
        model: What the linear model leaves.
        load: A calibration load of another size or direction than stated.
        tool: A calibration tool point elsewhere than stated.
        rigid_joints: Joints that count as rigid, and bend.
        drift: A shift between unloaded and loaded readings.
        repeatability: The robot does not stay where it was between two readings.
        uncompensated: The displacement of the task without any compensation, for comparison, with
            the joints that count as rigid.
        absolute: Whether displacements were counted from the rigid robot, whose geometry and
            place are then taken as exact.
    """

    noise: float
    model: float
    load: float
    tool: float
    rigid_joints: float
    drift: float
    repeatability: float
    uncompensated: float
    absolute: bool = False

    @property
    def parts(self) -> dict[str, float]:
        """All parts by name [m]."""
        others = ("uncompensated", "absolute")
        names = [field.name for field in fields(self) if field.name not in others]
        return {name: getattr(self, name) for name in names}

    @property
    def total(self) -> float:
        """The root of the sum of squares of all parts [m]."""
        return float(np.sqrt(sum(part**2 for part in self.parts.values())))

    @property
    def largest(self) -> str:
        """Name of the largest part."""
        return max(self.parts, key=self.parts.__getitem__)

    def headline(self) -> str:
        """The total and its largest part."""
        share = f"{1e3 * self.parts[self.largest]:.2g} mm by {self.largest.replace('_', ' ')}"
        return f"{1e3 * self.total:.2g} mm expected in the task, {share}"

    def to_dict(self) -> dict[str, Any]:
        """The parts and the total, in millimetres."""
        parts = {name: 1e3 * part for name, part in self.parts.items()}
        return {**parts, "total": 1e3 * self.total}
