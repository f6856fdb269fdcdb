"""Visits of a day in their order, and what faults of the day add to them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from edtk.calibration.causes.families import (
    USUAL_DRIFT,
    USUAL_PLAY,
    USUAL_SHARE,
    USUAL_TILT,
    USUAL_TOOL,
    USUAL_TURN,
)
from edtk.calibration.detect import FAULTS
from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.calibration.geometry_design.position_rows import PositionRows
from edtk.inference.geometry.position_noise import PositionNoise
from edtk.model.geometry.all_parameters import all_parameters
from edtk.model.geometry.geometric_parameter import SHIFTS, SOFTNESS
from edtk.system.typing import Array

USUAL_MOVE = 0.5e-3  # by which a tripod is pushed [m]
STEP = 1e-6  # of a numerical derivative [rad]
MILLI = 1e-3
# Units of the faults' sizes; those of a joint mean the joint in which it is hardest to see.
UNITS = {**FAULTS, "frame_moved": "mm"}
BY_LOADS = ("load_size", "load_direction", "torque_sign", "backlash")
# Of these the sizes of the springs say how much a load shows; play needs none.
BY_SPRINGS = ("load_size", "load_direction", "torque_sign")


@dataclass(frozen=True, eq=False)
class VisitFault:
    """A fault, and what one SI unit of its size adds to visits.

    Attributes:
        name: Its name.
        D: What it adds (m, rows, dims), in units of the noise.
        usual: The size that such faults usually have, in SI units.
        joint: The joint that it is in; empty for none.
        tries: How many faults of the kind there are.
        only_positive: Whether there is none of a negative size.
    """

    name: str
    D: Array
    usual: float
    joint: str = ""
    tries: float = 1
    only_positive: bool = False

    @property
    def dims(self) -> int:
        """Number of its parameters."""
        return int(self.D.shape[-1])


@dataclass(frozen=True, eq=False)
class Visits:
    """Visits in the order of a day.

    Attributes:
        question: The question of the study.
        q: Poses (m, n) [rad or m].
        wrench: Their loads (m, 6) [N, N m].
        time: When each is made (m,), from 0 at the beginning of the day to 1 at its end.
    """

    question: GeometryQuestion
    q: Array
    wrench: Array
    time: Array

    def faults(self, name: str, k: Array | None) -> Iterator[VisitFault]:
        """The faults of a name, to first order about the drawing; one for each joint, or one.

        Args:
            name: One of `UNITS`.
            k: Compliances (n,) of the unknown joints [rad/(N m)]; None where nobody told them.
        """
        base = self._columns("base")
        if name.startswith("tool_"):
            axis = "xyz".index(name[-1])
            markers = self._columns("tool").reshape(*base.shape[:2], -1, len(SHIFTS))
            yield VisitFault(name, markers.sum(axis=2)[..., [axis]], USUAL_TOOL[axis])
        elif name == "frame_rotation":
            yield VisitFault(name, base[..., 3:], USUAL_TURN)
        elif name == "frame_moved":
            late = (self.time > 0.5)[:, None, None]
            yield VisitFault(name, base[..., :3] * late, USUAL_MOVE)
        elif name == "drift":
            since = (self.time - 0.5)[:, None, None]
            yield VisitFault(name, base[..., :3] * since, USUAL_DRIFT)
        elif name == "load_size":
            assert k is not None
            yield VisitFault(name, self._bent(2 * self.wrench, k) - self._bent(self.wrench, k), 0.1)
        elif name == "load_direction":
            assert k is not None
            yield self._askew(k)
        else:
            yield from self._by_sign(name, k)

    def _columns(self, place: str) -> Array:
        """Rows (m, rows, columns) of shifts and turns of the base, or of shifts of the markers.

        They are for a metre or a radian.
        """
        model = self.question.model
        unknown = all_parameters(
            model.robot, model.markers, (), base=place == "base", tool=place == "tool"
        )
        rows = PositionRows(
            replace(model, parameters=unknown), self.question.setting.loads, self._noise
        )
        return rows(self.q, self.wrench) / MILLI

    @property
    def _noise(self) -> PositionNoise:
        """The errors by which all is whitened."""
        return self.question.setting.noise

    def _springs(self, wrench: Array) -> Array:
        """Rows (m, rows, springs) of the unknown springs under other wrenches, for 1 rad/(N m)."""
        model = self.question.model
        names = self.question.study.specification.joints.unknown
        unknown = all_parameters(model.robot, (), (), names, base=False, tool=False)
        loads = self.question.setting.loads
        rows = PositionRows(replace(model, parameters=unknown), loads, self._noise)
        return rows(self.q, wrench) / SOFTNESS

    def _bent(self, wrench: Array, k: Array) -> Array:
        """What wrenches bend (m, rows, 1)."""
        return (self._springs(wrench) @ k)[..., None]

    def _askew(self, k: Array) -> VisitFault:
        """The load is turned about the axes of the world that are not its own."""
        mean = self.wrench[:, :3].mean(axis=0)
        axes = np.linalg.svd(mean[None])[2][1:] if mean.any() else np.eye(3)
        columns = []
        for axis in axes:
            turned = [np.cross(axis, part) for part in (self.wrench[:, :3], self.wrench[:, 3:])]
            nudge = STEP * np.hstack(turned)
            ahead = self._bent(self.wrench + nudge, k) - self._bent(self.wrench - nudge, k)
            columns.append(ahead / (2 * STEP))
        return VisitFault("load_direction", np.concatenate(columns, axis=-1), USUAL_TILT)

    def _by_sign(self, name: str, k: Array | None) -> Iterator[VisitFault]:
        """A joint whose spring or position depends on the sign of its load."""
        study = self.question.study
        loads = self.question.setting.loads
        assert loads is not None
        unknown = list(study.unknown)
        torque = loads(self.q, self.wrench)[:, unknown]
        sign = np.sign(torque)[:, None]
        springs = self._springs(self.wrench)
        both = (torque > 0).any(axis=0) & (torque < 0).any(axis=0)
        for i in np.flatnonzero(both):
            joint = study.robot.joints[unknown[i]]
            D = springs[..., [i]]
            usual = USUAL_SHARE
            if name == "torque_sign":
                assert k is not None
                D = k[i] * sign[..., [i]] * D
            elif joint.kind == "revolute":
                # A spring moves the marker by the torque: what is left is its sign.
                size = np.abs(torque[:, None, [i]])
                D = np.divide(D, size, out=np.zeros_like(D), where=size > 0)
                usual = USUAL_PLAY["revolute"]
            else:
                continue
            yield VisitFault(name, D, usual, joint.name, 2 * both.sum(), name == "backlash")
