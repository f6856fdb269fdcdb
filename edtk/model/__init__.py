"""From joint angles and wrench to the regressor of the compliances (the paper's Section 2)."""

from edtk.model.elastostatics import ElastostaticModel
from edtk.model.robot import Joint, Robot, transform
from edtk.model.robot_file import RobotFileError, load_robot
from edtk.model.workspace import Constraint, Excluded, Height, JointLimits, Radius, Tilt, Workspace

__all__ = [
    "Constraint",
    "ElastostaticModel",
    "Excluded",
    "Height",
    "Joint",
    "JointLimits",
    "Radius",
    "Robot",
    "RobotFileError",
    "Tilt",
    "Workspace",
    "load_robot",
    "transform",
]
