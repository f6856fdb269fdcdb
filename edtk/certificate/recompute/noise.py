"""Errors of a visit: of a tracker, of joints that move all markers together, and of the model."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.chain import Chain
from edtk.certificate.recompute.physics import MEASURED, Physics
from edtk.certificate.recompute.plain_data import number, numbers, table, whole
from edtk.system.typing import Array

KEYS = ("tracker", "repeatability", "discrepancy", "within", "readings")
SAME = 1e-9  # [rad]: poses nearer than this are one pose, and distances are compared as exactly
COORDINATES = 3  # of a marker that the tracker sees


@dataclass(frozen=True, eq=False)
class Noise:
    """What the covariance of a visit's rows depends on, besides white noise.

    Attributes:
        tracker: Place (3,) of the tracker [m], then a [m] and b [m/m] of the standard deviation
            ``a + b r`` along its beam and across it; None without one.
        repeatability: Standard deviations (n,) of the joints in a reading [rad or m].
        discrepancy: Standard deviations (rows,) of the model's errors [m, rad].
        within: Poses nearer than this share the model's errors [rad].
        readings: Readings of which a row is made.
    """

    tracker: tuple[Array, Array, Array] | None
    repeatability: Array
    discrepancy: Array
    within: float
    readings: int

    @classmethod
    def from_dict(cls, content: Any, n: int, measured: int) -> "Noise":
        """Read the part `setting.noise` of a certificate.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        where = "setting.noise"
        content = table(content, KEYS, where)
        repeatability = numbers(content["repeatability"], (n,), f"{where}.repeatability")
        discrepancy = numbers(content["discrepancy"], (measured,), f"{where}.discrepancy")
        within = number(content["within"], f"{where}.within")
        tracker = None
        if content["tracker"] is not None:
            of = table(content["tracker"], ("position", "along", "across"), f"{where}.tracker")
            position = numbers(of["position"], (3,), f"{where}.tracker.position")
            along = numbers(of["along"], (2,), f"{where}.tracker.along")
            across = numbers(of["across"], (2,), f"{where}.tracker.across")
            tracker = (position, along, across)
        sizes = [repeatability, discrepancy, np.array([within]), *(tracker or ())[1:]]
        if min(float(size.min()) for size in sizes) < 0:
            raise ValueError(f"{where}: expected no number below zero")
        readings = whole(content["readings"], 1, 2, f"{where}.readings")
        return cls(tracker, repeatability, discrepancy, within, readings)

    def whitened(
        self, A: Array, chain: Chain, physics: Physics, sigma: Array, q: Array, visits: Array
    ) -> Array:
        """Rows of unit covariance (k, rows, p) of regressors A (k, rows, p).

        Args:
            A: The regressors.
            chain: The robot.
            physics: What is measured.
            sigma: Standard deviations (rows,) of the white part [m, rad].
            q: Poses (k, n) [rad or m].
            visits: Visits (k,) that share the model's errors in each pose.

        Raises:
            ValueError: A covariance is not positive definite.
        """
        motion = physics.motion(chain, q)
        Sigma = self.readings * (motion * self.repeatability**2) @ motion.transpose(0, 2, 1)
        own = sigma**2 + visits[:, None] * self.discrepancy**2
        Sigma = Sigma + own[:, None] * np.eye(len(sigma))
        if self.tracker is not None:
            self._add_tracker(Sigma, chain, physics, q)
        size = np.sqrt(np.diagonal(Sigma, axis1=1, axis2=2))
        try:
            L = np.linalg.cholesky(Sigma / size[:, :, None] / size[:, None])
        except np.linalg.LinAlgError as error:
            raise ValueError("the errors of some rows depend on each other exactly") from error
        return np.asarray(np.linalg.solve(L, A / size[:, :, None]))

    def visits(self, chain: Chain, q: Array, amount: Array) -> Array:
        """How many visits (k,) of a plan share the model's errors of each pose, its own included.

        Args:
            chain: The robot, whose prismatic joints do not count for distances.
            q: Poses (k, n) [rad or m].
            amount: Visits (k,) of each.
        """
        if not self.discrepancy.any():
            return np.ones(len(q))
        turning = q[:, ~chain.prismatic]
        near = max(self.within * (1 - SAME), SAME)
        found = []
        for pose in turning:
            # Half a turn is the farthest: the sine of half the angle has its length, the short way.
            turn = 2 * np.arcsin(np.abs(np.sin((turning - pose) / 2)))
            found.append((np.linalg.norm(turn, axis=1) < near) @ amount)
        return np.array(found, dtype=float)

    def _add_tracker(self, Sigma: Array, chain: Chain, physics: Physics, q: Array) -> None:
        """Add the tracker's part to covariances (k, rows, rows), marker by marker."""
        assert self.tracker is not None
        position, along, across = self.tracker
        first = 0
        for kind, place, _ in physics.sensors:
            if kind != "distance":
                beam = chain.point(q, place.offset, place.joint) - position
                r = np.linalg.norm(beam, axis=1)[:, None, None]
                inline = beam[:, :, None] * beam[:, None] / r**2
                aside = np.eye(3) - inline
                part = (along[0] + along[1] * r) ** 2 * inline
                part = part + (across[0] + across[1] * r) ** 2 * aside
                rows = slice(first, first + COORDINATES)
                Sigma[:, rows, rows] += self.readings * part
            first += MEASURED[kind]
