"""What the measurements say (the paper's Sections 2 and 3)."""

from edtk.inference.compensation import compensated_joints, compensation_accuracy
from edtk.inference.estimate import Estimate, SingularPlanError, covariance, estimate, unidentified
from edtk.inference.identify import Identification, identify
from edtk.inference.measurements import Measurements
from edtk.inference.noise import Noise
from edtk.inference.posterior import Posterior, sample_posterior
from edtk.inference.prior import Flat, HalfNormal, LogNormal, Marginal, Normal, Prior
from edtk.inference.simulate import simulate

__all__ = [
    "Estimate",
    "Flat",
    "HalfNormal",
    "Identification",
    "LogNormal",
    "Marginal",
    "Measurements",
    "Noise",
    "Normal",
    "Posterior",
    "Prior",
    "SingularPlanError",
    "compensated_joints",
    "compensation_accuracy",
    "covariance",
    "estimate",
    "identify",
    "sample_posterior",
    "simulate",
    "unidentified",
]
