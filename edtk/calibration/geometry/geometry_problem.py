"""The design problem of a study of geometry: candidate poses, loaded or not."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

import criteria
from edtk.calibration.geometry_design.geometry_space import PositionRows
from edtk.design.problem import Problem, rows_of_blocks
from edtk.fit.geometry.fit_geometry import stages
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.parameters import identifiable
from edtk.measure.position_noise import PositionNoise
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry, StudyLoads, planned_noise
from edtk.system.presented import Presented
from edtk.system.typing import Array

POSES = 60  # random poses that show what any poses could tell


@dataclass(frozen=True, eq=False)
class GeometryProblem(Presented):
    """Candidates for a plan that tells geometry and springs.

    Attributes:
        problem: One candidate a pose and load; parameters are in their own units (mm, mrad,
            1e-6 rad/(N m)), and rows in those of the noise.
        q: Joint variables (n, joints) of the candidates [rad or m].
        wrench: Forces and torques (n, 6) of the candidates [N, N m].
        model: The minimal set of parameters, at the geometry of the drawing.
        noise: The noise of a reading.
        loads: What loads the joints; None without springs.
    """

    problem: Problem
    q: Array
    wrench: Array
    model: MeasuredModel
    noise: PositionNoise
    loads: StudyLoads | None

    def headline(self) -> str:
        """Number of candidates and of parameters."""
        return f"{self.problem.n} candidates, {self.problem.p} parameters of geometry and springs"

    def rows(self, q: ArrayLike, wrench: ArrayLike | None = None) -> Array:
        """How positions of all markers move with the parameters (m, 3k, p) [mm].

        Where the study measures full poses, each marker has three more rows: its orientation as a
        turn [mrad].

        Args:
            q: Poses (m, n) [rad or m].
            wrench: Forces and torques (m, 6) or (6,); none by default.
        """
        poses = np.atleast_2d(np.asarray(q, dtype=float))
        given = np.zeros(6) if wrench is None else np.asarray(wrench, dtype=float)
        wrenches = np.broadcast_to(given, (len(poses), 6))
        return PositionRows(self.model, self.loads)(poses, wrenches)

    def rho0(self, q: ArrayLike, wrench: ArrayLike | None = None) -> criteria.Criterion:
        """The position error to expect in tasks, where geometry and springs are compensated.

        It is the root mean square distance of the markers from where the calibrated model has them,
        over all tasks and markers, in millimetres: ``rho0^2 = trace(A0 M^-1 A0')`` with the rows A0
        of positions in the tasks over the square root of their number. No choice among parameters
        that cannot be told apart changes it.

        Args:
            q: Poses (t, n) of the tasks [rad or m].
            wrench: Their forces and torques (t, 6) or (6,); none by default.
        """
        rows = self.rows(q, wrench)[:, self.model.placed_rows]
        positions = rows.shape[0] * rows.shape[1] / 3
        A0 = rows.reshape(-1, rows.shape[-1]) / np.sqrt(positions)
        # As many rows as parameters say the same as all: only A0'A0 counts.
        found = criteria.create("rho0", np.linalg.qr(A0, mode="r") if len(A0) > A0.shape[1] else A0)
        found.shown = (1.0, "mm")  # its target is in millimetres already
        return found


def geometry_problem(
    study: Study,
    q: ArrayLike,
    wrench: ArrayLike | None = None,
    noise: PositionNoise | None = None,
) -> GeometryProblem:
    """Make the design problem of a study with [parameters].

    A loaded and an unloaded visit of a pose are different candidates: list the pose twice. The
    minimal set of parameters is that which any poses could tell under the loads listed. Rows are
    those at the geometry of the drawing; markers are where the study says (`position_mm`).

    Args:
        study: The study.
        q: Poses (n, joints) of the candidates [rad or m].
        wrench: Forces and torques (n, 6) or (6,) [N, N m]; none by default.
        noise: Errors of a pose; the stated ones by default, with what the model leaves out. The
            tracker of those of a fit stands where the study has it.

    Raises:
        UserError: The study has no [parameters].
        ValueError: Arrays do not fit the robot.
    """
    study.kind.parameters(study)
    setting = StudyGeometry.of(study)
    poses = np.asarray(q, dtype=float)
    if poses.ndim != 2 or poses.shape[1] != study.robot.n or not len(poses):
        raise ValueError(f"poses have the shape {poses.shape}, expected (n, {study.robot.n})")
    wrenches = np.zeros(6) if wrench is None else np.asarray(wrench, dtype=float)
    forces = np.broadcast_to(wrenches, (len(poses), 6))
    loads = setting.loads
    model = _minimal(setting.model, poses, forces, loads)
    reading = setting.noise if noise is None else noise.with_place_of(setting.noise)
    if reading.rows != model.row_count:
        asked = "a size for orientations" if setting.full_poses else "none for orientations"
        raise ValueError(f"noise.turn is {reading.turn}; expected {asked}")
    markers = len(model.markers)
    given = reading.of_visits(model.row_count * markers, markers)
    errors = planned_noise(setting) if noise is None else given
    blocks = PositionRows(model, loads, errors, setting.sight)(poses, forces)
    names = tuple(one.name for one in model.parameters)
    problem = Problem.of_kept(rows_of_blocks(blocks, 1.0), names, None)
    return GeometryProblem(problem, poses, forces, model, reading, loads)


def _minimal(
    model: MeasuredModel, q: Array, wrench: Array, loads: StudyLoads | None
) -> MeasuredModel:
    """The model with the parameters that any poses could tell under these loads."""
    rng = np.random.default_rng(0)
    lower, upper = np.clip(model.robot.limits, -np.pi, np.pi)
    drawn = rng.uniform(lower, upper, (POSES, model.robot.n))
    some = rng.integers(0, len(q), POSES)
    few = np.unique(some)
    poses = np.concatenate([drawn, q[few]])
    forces = np.concatenate([wrench[some], wrench[few]])
    rows = PositionRows(model, loads)(poses, forces).reshape(-1, model.p)
    kept = identifiable(rows, model.parameters, stages(model)).kept
    return model.with_parameters(tuple(model.parameters[i] for i in kept))
