"""Measurements of three markers in several visits of some poses, and their noise."""

from dataclasses import replace

import numpy as np
import pandas as pd

from edtk.fit.equilibrium import equilibrium_deflection
from edtk.fit.measurements import Measurements, joint_motion
from edtk.fit.noise import visit_covariance
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.instruments.marker import Marker
from edtk.measure.pose_table import (
    DEFLECTION_COLUMNS,
    MARKER_COLUMNS,
    SIGMA_COLUMN,
    VISIT_COLUMN,
    WRENCH_COLUMNS,
    pose_columns,
)
from edtk.measure.task import all_compliances
from edtk.robots.frames import BodyPoint
from tests.support.readings import PLAN, STUDY

MODEL = STUDY.model
MARKERS = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.1], [0.0, -0.3, 0.2]])
TRACKER = 5e-6


def visited(poses=8, visits=3, markers=3, readings=1, sigma=TRACKER):
    """Poses, loads, markers and visits, without deflections; sorted by pose, visit, marker."""
    one = np.repeat(np.arange(poses), visits * markers * readings)
    marker = np.tile(np.repeat(MARKERS[:markers], readings, axis=0), (poses * visits, 1))
    visit = np.tile(np.repeat(np.arange(visits), markers * readings), poses) * 1.0
    zeros = np.zeros((len(one), 3))
    return Measurements(PLAN.q[one], PLAN.wrench[one], zeros, zeros + sigma, marker, visit=visit)


def motion_of(data, joints=1.0):
    """Motions (m, 3, 6) of the markers by joints of that standard deviation [rad]."""
    model = ElastostaticModel(STUDY.robot, None, "position")
    return joints * joint_motion(model, data)


def sheet(path, data, joints=0.0, discrepancy=0.0, seed=0):
    """Write measurements with simulated readings as a sheet, and return its table."""
    noise = visit_covariance(
        data,
        data.sigma,
        motion_of(data, np.sqrt(2) * joints),
        np.full(data.sigma.shape, discrepancy),
    )
    k = all_compliances(MODEL, STUDY.compliances)
    there = replace(MODEL, sensors=(Marker(BodyPoint(data.marker.T)),))
    clean = equilibrium_deflection(there, data.q, data.wrench, k)
    z = np.random.default_rng(seed).standard_normal(clean.shape)
    moved = clean + noise.colour(z)
    table = pd.DataFrame(np.rad2deg(data.q), columns=list(pose_columns(STUDY.robot)))
    table[list(WRENCH_COLUMNS)] = data.wrench
    table[VISIT_COLUMN] = data.visit
    table[list(MARKER_COLUMNS)] = 1e3 * data.marker
    table[list(DEFLECTION_COLUMNS)] = 1e3 * moved
    table[SIGMA_COLUMN] = 1e3 * data.sigma[:, 0]
    table.to_csv(path, index=False)
    return table
