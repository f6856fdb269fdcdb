"""A calibration day, and the sheet that is filled in on it.

The robot is at rest under its load: its true, nonlinear equilibrium is what the tracker sees.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from edtk import Study
from edtk.fit.equilibrium import equilibrium_deflection
from edtk.measure.equilibrium import torque_and_derivative
from edtk.measure.pose_table import DEFLECTION_COLUMNS, WRENCH_COLUMNS, pose_columns, pose_factors
from edtk.robots.frames import MILLIMETRE
from edtk.robots.robot import Robot
from edtk.system.typing import Array, Indices

TINY = 1e-12  # length of a link that is none [m]


@dataclass(frozen=True, eq=False)
class Scene:
    """A calibration day: what the sheet says, and what is true. N rows, p poses.

    Attributes:
        study: The study of the robot.
        pose: Number (N,) of each row's pose; repetitions have the same.
        q: Joint variables (N, n) as they are written [rad].
        wrench: Wrenches (N, 6) as they are written [N, N m].
        true_q: Joint variables (N, n) that were measured.
        true_wrench: Wrenches (N, 6) that acted.
        tool: The tool's true frame (4, 4).
        k: True compliances (N, n) of each row [rad/(N m)].
        play: Angles (N, n) by which joints give way beside their springs [rad].
        turn: Matrix (3, 3) from the world to the axes in which displacements are written.
        moved: Displacement (N, 3) of something else between the two readings [m].
        noise: True noise over the stated one.
        common: Share of the noise's variance that repetitions of a pose have in common.
        longer: Lengths (n,) by which the links before the joints are longer than in the model [m].
        outlier: Error (N, 3) of single readings, in standard deviations.
        factor: Factor on the written displacements.
        exchanged: Two columns of the sheet that were exchanged; empty for none.
        rows: Rows in which the fault is, where it is not in all.
        joint: Name of the joint in which the fault is; empty if it is in none.
    """

    study: Study
    pose: Indices
    q: Array
    wrench: Array
    true_q: Array
    true_wrench: Array
    tool: Array
    k: Array
    play: Array
    turn: Array
    moved: Array
    longer: Array
    outlier: Array
    noise: float = 1.0
    common: float = 0.0
    factor: float = 1.0
    exchanged: tuple[str, ...] = ()
    rows: tuple[int, ...] = ()
    joint: str = ""

    @classmethod
    def of(cls, study: Study, poses: Array, wrench: Array, repeats: int) -> "Scene":
        """A day without a fault: poses (p, n) and wrenches (p, 6), each measured so many times."""
        q = np.repeat(poses, repeats, axis=0)
        wrench = np.repeat(wrench, repeats, axis=0)
        k = np.zeros(study.robot.n)
        k[study.model.joints] = study.compliances
        rows = len(q)
        distinct = np.unique(q, axis=0, return_inverse=True)[1].ravel()
        return cls(
            study=study,
            pose=distinct,
            q=q,
            wrench=wrench,
            true_q=q,
            true_wrench=wrench,
            tool=study.robot.tool,
            k=np.tile(k, (rows, 1)),
            play=np.zeros(q.shape),
            turn=np.eye(3),
            moved=np.zeros((rows, 3)),
            longer=np.zeros(study.robot.n),
            outlier=np.zeros((rows, 3)),
        )

    @property
    def robot(self) -> Robot:
        """The true robot."""
        joints = []
        for joint, longer in zip(self.study.robot.joints, self.longer, strict=True):
            origin = joint.origin.copy()
            origin[:3, 3] *= 1 + longer / max(float(np.linalg.norm(origin[:3, 3])), TINY)
            joints.append(replace(joint, origin=origin))
        return replace(self.study.robot, joints=tuple(joints), tool=self.tool)

    def torque(self) -> Array:
        """Loads of the joints (N, n) in the unloaded pose [N m]."""
        return torque_and_derivative(self.study.robot, self.true_q, self.true_wrench)[0]

    def measured(self, rng: np.random.Generator) -> Array:
        """Written displacements (N, 3) [m]."""
        model = replace(self.study.model, robot=self.robot)
        d = equilibrium_deflection(model, self.true_q, self.true_wrench, self.k)
        J = model.robot.jacobian(self.true_q)[:, :3]
        d = d + (J @ self.play[..., None])[..., 0] + self.moved
        sigma = self.noise * self.study.sigma[:3]
        own = rng.standard_normal(d.shape)
        shared = rng.standard_normal((self.pose.max() + 1, 3))[self.pose]
        error = np.sqrt(1 - self.common) * own + np.sqrt(self.common) * shared
        return ((d + sigma * (error + self.outlier)) @ self.turn.T) * self.factor

    def write(self, path: Path, rng: np.random.Generator) -> None:
        """Write the filled-in sheet (CSV)."""
        free = [j for j in range(self.study.robot.n) if j not in self.study.fixed]
        columns = [pose_columns(self.study.robot)[j] for j in free]
        q = (self.q / pose_factors(self.study.robot))[:, free]
        cells = np.hstack([q, self.wrench, self.measured(rng) / MILLIMETRE])
        names = [*columns, *WRENCH_COLUMNS, *DEFLECTION_COLUMNS]
        if self.exchanged:
            i, j = (names.index(name) for name in self.exchanged)
            cells[:, [i, j]] = cells[:, [j, i]]
        pd.DataFrame(cells, columns=names).to_csv(path, index=False, float_format="%.10g")
