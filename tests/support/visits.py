"""Measurements of three markers in several visits of some poses, and their noise."""

import numpy as np

from edtk.inference.joint_motion import joint_motion
from edtk.inference.measurements import Measurements
from edtk.model.elastostatic_model import ElastostaticModel
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
