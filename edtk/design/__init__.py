"""Which poses to measure (the paper's Section 4): problems, plans, and how plans are found."""

from edtk.design.candidates import Candidates, CandidateSource, EmptyFeasibleSetError, sample_feasible
from edtk.design.exact_plan import ExactPlan
from edtk.design.exchange import exchange
from edtk.design.find_plan import TooFewError, find_plan
from edtk.design.load import BoundedLoad, FixedLoad, FreeLoad, ListedLoad, Load
from edtk.design.master import RelaxationError
from edtk.design.plan import Plan, PlanFileError, pose_factors
from edtk.design.pose_design import PoseDesign
from edtk.design.problem import Problem, RankDeficientError
from edtk.design.refine import refine
from edtk.design.relax import Relaxation, RelaxationInterrupted, relax
from edtk.design.relax_poses import MemoryLimitError, PlanInterrupted, relax_poses
from edtk.design.relaxed_plan import RelaxedPlan
from edtk.design.round import apportion

__all__ = [
    "BoundedLoad",
    "CandidateSource",
    "Candidates",
    "EmptyFeasibleSetError",
    "ExactPlan",
    "FixedLoad",
    "FreeLoad",
    "ListedLoad",
    "Load",
    "MemoryLimitError",
    "Plan",
    "PlanFileError",
    "PlanInterrupted",
    "PoseDesign",
    "Problem",
    "RankDeficientError",
    "Relaxation",
    "RelaxationError",
    "RelaxationInterrupted",
    "RelaxedPlan",
    "TooFewError",
    "apportion",
    "exchange",
    "find_plan",
    "pose_factors",
    "refine",
    "relax",
    "relax_poses",
    "sample_feasible",
]
