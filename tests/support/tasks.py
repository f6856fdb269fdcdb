"""The task of the paper's example: tools, load, test pose, compliances and a plan."""

import numpy as np

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.robots.load_robot import load_robot
from edtk.robots.rotations import transform

K0 = np.array([0.302, 0.406, 3.002, 3.303, 2.365]) * 1e-6
SIGMA = 0.03e-3
TASK_WRENCH = np.array([0.0, 280.0, -180.0, 5.0, -8.0, 3.0])
TEST_POSE = np.deg2rad([0, -56.9, 89.3, 45.1, 76, 57.2])


def model_of(tool, unknown=(1, 2, 3, 4, 5), rows="position"):
    """The KR 270 with a tool at a position [m]."""
    return ElastostaticModel(load_robot("kuka_kr270").with_tool(transform(tool)), unknown, rows)


TASK = model_of((0.986, 0.0, 0.1))


def plan():
    """Regressors (8, 3, 5) of eight random poses under a weight."""
    q = np.random.default_rng(0).uniform(*TASK.robot.limits, size=(8, 6))
    return model_of((0.6115, 0.0, -0.460)).regressor(q, [0, 0, -2500.0, 0, 0, 0])
