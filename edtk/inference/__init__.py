"""What the measurements say (the paper's Sections 2 and 3)."""

from edtk.inference.compensation import compensated_joints, compensation_accuracy
from edtk.inference.estimate import Estimate, SingularPlanError, covariance, estimate, unidentified
from edtk.inference.posterior import Posterior, sample_posterior
from edtk.inference.simulate import simulate

__all__ = [
    "Estimate",
    "Posterior",
    "SingularPlanError",
    "compensated_joints",
    "compensation_accuracy",
    "covariance",
    "estimate",
    "sample_posterior",
    "simulate",
    "unidentified",
]
