"""The error to expect in a task after a compensation, in parts that have names."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from edtk.model.assumed_joint import AssumedJoint
from edtk.system.presented import Presented


@dataclass(frozen=True)
class JointPart:
    """What a joint that is not identified adds to the error in the task.

    Attributes:
        joint: The joint, with what is assumed of it.
        error: Its part of the total [m].
        told: With which standard deviation the measurements would tell its compliance, if it was
            unknown, by their noise; inf if they do not [rad/(N m)].
    """

    joint: AssumedJoint
    error: float
    told: float = np.inf

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, in SI units but for the error in millimetres."""
        return {
            "joint": self.joint.name,
            "rad_per_Nm": self.joint.compliance,
            "std_rad_per_Nm": self.joint.std,
            "source": self.joint.source,
            "error_mm": 1e3 * self.error,
            "told_std_rad_per_Nm": self.told if np.isfinite(self.told) else None,
        }


@dataclass(frozen=True)
class ErrorBudget(Presented):
    """Root mean square errors of the tool point after compensation in the task, by source [m].

    Attributes:
        noise: Of the measurements: rho0, Eq. (20).
        model: What the linear model leaves.
        load: A calibration load of another size or direction than stated.
        tool: A calibration tool point elsewhere than stated.
        rigid_joints: Joints that count as rigid, and bend.
        known_joints: Joints whose known compliances are not exactly so.
        drift: A shift between unloaded and loaded readings.
        repeatability: The robot does not stay where it was between two readings.
        uncompensated: The displacement of the task without any compensation, for comparison, with
            the joints that count as rigid.
        absolute: Whether displacements were counted from the rigid robot, whose geometry and
            place are then taken as exact.
        joints: The joints that make the parts of rigid and known ones, from base to tip.
    """

    noise: float
    model: float
    load: float
    tool: float
    rigid_joints: float
    known_joints: float
    drift: float
    repeatability: float
    uncompensated: float
    absolute: bool = False
    joints: tuple[JointPart, ...] = ()

    @property
    def parts(self) -> dict[str, float]:
        """All parts by name [m]."""
        others = ("uncompensated", "absolute", "joints")
        names = [field.name for field in fields(self) if field.name not in others]
        return {name: getattr(self, name) for name in names}

    @property
    def total(self) -> float:
        """The root of the sum of squares of all parts [m]."""
        return float(np.sqrt(sum(part**2 for part in self.parts.values())))

    @property
    def assumed(self) -> float:
        """The parts of the total that rest on assumed compliances, together [m]."""
        return float(np.hypot(self.rigid_joints, self.known_joints))

    @property
    def measured(self) -> float:
        """All that the measurements make of the total [m]."""
        return float(np.sqrt(max(self.total**2 - self.assumed**2, 0.0)))

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
