"""Everything that a step needs to know of the place where it begins."""

from dataclasses import dataclass, fields

import numpy as np

from edtk.design.interior_point.neighbourhood import Neighbourhood
from edtk.design.interior_point.objective import Objective
from edtk.design.interior_point.scaled_variables import ScaledVariables
from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class Point:
    """Value, slacks and derivatives at the b starts that are still on their way.

    Derivatives are by the movable variables y in parts of their range.

    Attributes:
        start: Indices (b,) of the starts.
        y: Movable variables (b, k, d).
        value: Values (b,) of the objective f.
        slope: Slopes (b, k, d) of the objective.
        own: Second derivatives (b, k, d, d) of the objective by the variables of one experiment.
        joint: Second derivatives (b, kd, kd) by those of all, to which `own` is added.
        slack: Slacks s (b, k, c); those of the bounds ``0 <= y <= 1`` are the last 2d.
        slack_slope: Gradients G (b, k, c, d) of the slacks.
        slack_curvature: Second derivatives (b, k, c - 2d, d, d) of the slacks that are not linear.
    """

    start: Indices
    y: Array
    value: Array
    slope: Array
    own: Array
    joint: Array
    slack: Array
    slack_slope: Array
    slack_curvature: Array

    @classmethod
    def at(
        cls, variables: ScaledVariables, objective: Objective, y: Array, start: Indices
    ) -> "Point":
        """Evaluate objective and constraints at y (b, k, d) of some starts (b,)."""
        near = Neighbourhood(variables.space, variables.design(y, start))
        slack_slopes = near.first(near.experiments.slack_gradient)
        walls = variables.bound_slopes
        of_bounds = np.broadcast_to(walls, (*y.shape[:2], *walls.shape))
        local = objective.local(near, start)
        return cls(
            start=start,
            y=y,
            value=local.value,
            slope=local.slope,
            own=local.own,
            joint=local.joint,
            slack=np.concatenate([near.experiments.slack[0], y, 1.0 - y], axis=-1),
            slack_slope=np.concatenate([slack_slopes[0], of_bounds], axis=-2),
            slack_curvature=near.second(slack_slopes),
        )

    def __getitem__(self, chosen: Indices) -> "Point":
        """The chosen starts."""
        return Point(*(getattr(self, field.name)[chosen] for field in fields(self)))

    @property
    def inside(self) -> Indices:
        """Positions of the starts whose value is finite and whose slacks are all positive."""
        return np.flatnonzero(np.isfinite(self.value) & (self.slack > 0).all(axis=(1, 2)))

    def slack_change(self, d: Array) -> Array:
        """Changes ``G d`` (b, k, c) of the slacks by steps d (b, k, d), to first order."""
        return np.asarray((self.slack_slope @ d[..., None])[..., 0])

    def with_starts_of(self, other: "Point", chosen: Indices) -> "Point":
        """The same with some starts from another point; itself if none is chosen."""
        if not len(chosen):
            return self
        arrays = []
        for field in fields(self):
            array = np.array(getattr(self, field.name))
            array[chosen] = getattr(other, field.name)[chosen]
            arrays.append(array)
        return Point(*arrays)
