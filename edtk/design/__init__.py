"""Which poses to measure (the paper's Section 4): problems, plans, and how plans are found."""

from edtk.design.candidates import EmptyFeasibleSetError, sample_feasible
from edtk.design.exact import PoseDesign
from edtk.design.plan import Plan, PlanFileError, pose_factors
from edtk.design.problem import Problem
from edtk.design.refine import refine
from edtk.design.relax import Relaxation, RelaxationError, relax
from edtk.design.round import apportion

__all__ = [
    "EmptyFeasibleSetError",
    "Plan",
    "PlanFileError",
    "PoseDesign",
    "Problem",
    "Relaxation",
    "RelaxationError",
    "apportion",
    "pose_factors",
    "refine",
    "relax",
    "sample_feasible",
]
