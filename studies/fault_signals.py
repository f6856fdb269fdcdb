"""What faults add to the residuals of a plan, in units of the noise.

Residuals r (d,) of good data are independent standard normal numbers, once what the compliances
take up is projected out. A fault of a known size moves their mean to a *signal*, or changes their
covariance. One of unknown direction, sign, joint or pose is a mixture of such alternatives.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from faults import KR270

from edtk import Study
from edtk.calibration.planned import planned_measurements
from edtk.design.plan import Plan
from edtk.findings.causes.faults import families
from edtk.findings.causes.scene import Displacements
from edtk.fit.least_squares import Whitened
from edtk.fit.measurements import Measurements
from edtk.robots.frames import MILLIMETRE
from edtk.system.typing import Array

DIRECTIONS = 1000  # of vectors, spread evenly
CHUNK = 1_000_000  # log-likelihoods at once
OUTLIER = 15.0  # [sigma]
TWO_OUTLIERS = 10.0  # [sigma]
PAIRS = 300  # of coordinates in which two outliers are
SHIFTS = np.deg2rad(np.concatenate([np.arange(-30, -2), np.arange(3, 31)]))  # of mistyped joints


class Alternative(Protocol):
    """A distribution of residuals other than that of good data."""

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Residuals (count, d)."""
        ...

    def log_ratio(self, r: Array) -> Array:
        """Logarithm (n,) of the likelihood of residuals (n, d) over that of good data."""
        ...

    def of_sizes(self, factors: Sequence[float]) -> "Alternative":
        """The same, of one of several sizes; itself where it has no size."""
        ...


@dataclass(frozen=True, eq=False)
class Shifted:
    """One of several signals, all equally likely.

    Attributes:
        signals: The signals (k, d).
    """

    signals: Array

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """A random signal in each, and noise."""
        which = rng.integers(len(self.signals), size=count)
        return np.asarray(self.signals[which] + rng.standard_normal((count, self.signals.shape[1])))

    def log_ratio(self, r: Array) -> Array:
        """``log mean exp(r's - s's/2)`` over the signals s."""
        half = (self.signals**2).sum(axis=1) / 2
        rows = max(CHUNK // len(half), 1)
        parts = [r[i : i + rows] @ self.signals.T - half for i in range(0, len(r), rows)]
        return np.concatenate([log_mean_exp(part.T) for part in parts])

    def of_sizes(self, factors: Sequence[float]) -> "Shifted":
        """The same, of one of several sizes."""
        return Shifted(np.concatenate([factor * self.signals for factor in factors]))


@dataclass(frozen=True, eq=False)
class Noisier:
    """A normal distribution of another covariance.

    Attributes:
        covariance: The covariance (d, d).
    """

    covariance: Array

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Residuals of that covariance."""
        root = np.linalg.cholesky(self.covariance)
        return np.asarray(rng.standard_normal((count, len(root))) @ root.T)

    def log_ratio(self, r: Array) -> Array:
        """``(r'r - r'S^-1 r - log det S) / 2``."""
        less = r**2 - r * np.linalg.solve(self.covariance, r.T).T
        return np.asarray((less.sum(axis=1) - np.linalg.slogdet(self.covariance)[1]) / 2)

    def of_sizes(self, factors: Sequence[float]) -> "Noisier":
        """Itself: the share of noise is drawn from nothing."""
        return self


def log_mean_exp(x: Array) -> Array:
    """``log mean exp`` over the first axis."""
    most = x.max(axis=0)
    return np.asarray(most + np.log(np.exp(x - most).mean(axis=0)))


def signals_of(study: Study, q: Array, poses_of: Array) -> dict[str, Alternative]:
    """The faults of faults.py that a fit does not see at a glance, by their titles there.

    To first order, as the faults are small but for a wrong pose, whose other regressors are taken.
    Beside them are tool points that are off along x and y, which are other causes.

    Args:
        study: The study, whose [simulation] gives the true compliances.
        q: Joint variables (N, n) of the rows [rad].
        poses_of: Number (N,) of each row's pose.
    """
    rows = np.ones(len(q), dtype=int)
    wrench = np.asarray(study.space.load.wrench(np.zeros((len(q), 0))))
    data = planned_measurements(study, Plan(q, wrench, rows))
    A = data.regressor(study.model)
    k = study.compliances
    whitened = Whitened.of(A, data.noise, study.model.parameters)
    Q = whitened.Q.reshape(-1, len(k))
    rest = np.linalg.qr(Q, mode="complete")[0][:, len(k) :]

    def seen(changes: Array) -> Array:
        """Signals (c, d) of changes (N, 3, c) of the measurements [m]."""
        return np.asarray(whitened.in_sigma(np.moveaxis(changes, -1, 0)).reshape(-1, len(Q)) @ rest)

    found: dict[str, Alternative] = {}
    for title, signals in _smooth(study, data, A, seen).items():
        found[title] = Shifted(signals)
    found["wrong pose in all its repeats"] = Shifted(seen(_wrong_poses(study, data, A, poses_of)))
    found["one outlier of 15 sigma"] = Shifted(OUTLIER * np.concatenate([rest, -rest]))
    d = rest.shape[1]
    some = np.random.default_rng(len(rest)).choice(len(rest), (PAIRS, 2))
    signs = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    pairs = np.concatenate([rest[some[:, 0]] * a + rest[some[:, 1]] * b for a, b in signs])
    found["two outliers of 10 sigma"] = Shifted(TWO_OUTLIERS * pairs)
    found["sigma 1.5 times too small"] = Noisier(1.5**2 * np.eye(d))
    same = (poses_of[:, None] == poses_of).astype(float)
    shared = np.kron((np.eye(len(q)) + same) / 2, np.eye(3))
    found["noise common to a pose"] = Noisier(rest.T @ shared @ rest)
    return found


# Titles and sizes of faults that have a direction, by their causes; the tool points that are off
# along x and y are in no table.
WITH_DIRECTION = {
    "load_direction": ("load tilted by 3 degrees", np.deg2rad(3)),
    "tool_x": ("tool_x", 2 * MILLIMETRE),
    "tool_y": ("tool_y", 2 * MILLIMETRE),
    "tool_z": ("tool point 10 mm off along z", 10 * MILLIMETRE),
    "frame_rotation": ("measuring frame turned by 2 degrees", np.deg2rad(2)),
    "drift": ("drift of 50 um", 0.05 * MILLIMETRE),
}
# Those of joints: the cause, whether it is in one joint, and in which if that is not by chance.
SOFTER = 0.3 / 2.3  # of the mean compliance, to either side: 30 % from one side to the other
OF_JOINTS = (
    ("torque_sign", True, "", "one joint 30 % softer by sign of torque", SOFTER),
    ("torque_sign", False, "", "all joints 30 % softer by sign", SOFTER),
    ("backlash", True, "", "backlash of 0.005 degrees, one joint", np.deg2rad(0.005)),
    ("backlash", False, "", "backlash of 0.005 degrees, all joints", np.deg2rad(0.005)),
)
# Those that have either sign, and friction, whose size is the usual one.
OF_EITHER_SIGN = (
    ("joint_zero", True, "zero of one joint 1 degree off", np.deg2rad(1)),
    ("link_length", True, "one link 100 mm longer", 100 * MILLIMETRE),
)
OTHERS = (
    ("link_length", False, "", "all links 100 mm longer", 100 * MILLIMETRE),
    ("friction", True, "", "friction, a tenth of one joint's load", None),
    ("friction", False, "deg", "friction of 0.005 degrees, all joints", np.deg2rad(0.005)),
)
AS_BEFORE = (
    ("backlash", True, "q2", "backlash of 0.0045 degrees, q2", np.deg2rad(0.0045)),
    ("backlash", True, "q4", "backlash of 0.012 degrees, q4", np.deg2rad(0.012)),
    ("backlash", False, "", "backlash of 0.0033 degrees, all", np.deg2rad(0.0033)),
)


def _smooth(
    study: Study, data: Measurements, A: Array, seen: Callable[[Array], Array]
) -> dict[str, Array]:
    """Signals (k, d) of faults of any size, by title."""
    of_joints = (*OF_JOINTS, *AS_BEFORE) if study.robot.name == KR270 else OF_JOINTS
    found: dict[str, list[Array]] = {}
    for family in families(Displacements(study.model, data, A, study.compliances)):
        units = seen(family.derivative_at_zero(study.compliances))
        if family.cause in WITH_DIRECTION:
            title, size = WITH_DIRECTION[family.cause]
            # Of the drifts the first, which all readings share.
            found.setdefault(title, [size * directions(family.dims) @ units])
        for cause, single, title, size in OF_EITHER_SIGN:
            if cause == family.cause and single == bool(family.joint):
                found.setdefault(title, []).append(size * directions(1) @ units)
        for cause, single, unit, title, size in OTHERS:
            same = cause == family.cause and single == bool(family.joint)
            if same and unit in ("", family.unit):
                found.setdefault(title, []).append((size or family.usual) * units)
        for cause, single, joint, title, size in of_joints:
            same = cause == family.cause and single == bool(family.joint)
            if same and joint in ("", family.joint):
                found.setdefault(title, []).append(size * units)
    return {title: np.concatenate(signals) for title, signals in found.items()}


def _wrong_poses(study: Study, data: Measurements, A: Array, poses_of: Array) -> Array:
    """Changes (N, 3, c) of the measurements where a joint of a pose is not at its written value."""
    found = []
    for pose in np.unique(poses_of):
        rows = np.flatnonzero(poses_of == pose)
        for joint in study.model.joints:
            other = data[np.full(len(SHIFTS), rows[0])]
            q = other.q.copy()
            q[:, joint] += SHIFTS
            change = (replace(other, q=q).regressor(study.model) - A[rows[0]]) @ study.compliances
            whole = np.zeros((*A.shape[:2], len(SHIFTS)))
            whole[rows] = change.T
            found.append(whole)
    return np.concatenate(found, axis=-1)


def directions(dims: int) -> Array:
    """Unit vectors (k, dims), spread evenly: both signs, a circle, or Fibonacci's sphere."""
    if dims == 1:
        return np.array([[1.0], [-1.0]])
    number = np.arange(DIRECTIONS)
    if dims == 2:
        angle = 2 * np.pi * number / DIRECTIONS
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)
    height = 1 - (2 * number + 1) / DIRECTIONS
    angle = np.pi * (1 + np.sqrt(5)) * (number + 0.5)
    flat = np.sqrt(1 - height**2)
    return np.stack([flat * np.cos(angle), flat * np.sin(angle), height], axis=1)
