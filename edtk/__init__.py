"""edtk: plans of experiments that can be trusted, for robot calibration and linear(ised) models.

    >>> import edtk
    >>> study = edtk.load_study("studies/kr270_milling.toml")  # doctest: +SKIP
    >>> plan = edtk.plan(study, size=4)  # doctest: +SKIP
    >>> calibration = edtk.identify(study, "day1.csv")  # doctest: +SKIP

The verbs are those of the command line, with its words. Every name is loaded when it is first used,
so that `import edtk` itself costs next to nothing.
"""

import importlib
from typing import TYPE_CHECKING, Any

from edtk.version import __version__

if TYPE_CHECKING:
    import criteria as criteria
    from edtk import candidates as candidates
    from edtk.calibration.calibration import Calibration as Calibration
    from edtk.calibration.compensate import Compensation as Compensation
    from edtk.calibration.correct_program import CorrectedProgram as CorrectedProgram
    from edtk.calibration.evaluate_geometry import (
        GeometryEvaluation as GeometryEvaluation,
    )
    from edtk.calibration.geometric_calibration import (
        GeometricCalibration as GeometricCalibration,
    )
    from edtk.calibration.geometry_plan import GeometryPlan as GeometryPlan
    from edtk.calibration.geometry_plan import geometry_problem as geometry_problem
    from edtk.calibration.planned import PlanBias as PlanBias
    from edtk.calibration.posterior_check import PosteriorCheck as PosteriorCheck
    from edtk.calibration.prediction import Prediction as Prediction
    from edtk.calibration.robot_program import WrittenProgram as WrittenProgram
    from edtk.calibration.spring_calibration import SpringCalibration as SpringCalibration
    from edtk.cell.cell import Cell as Cell
    from edtk.cell.plan_check import PlanCheck as PlanCheck
    from edtk.certificate.verify_certificate import Verification as Verification
    from edtk.design.bound import Bound as Bound
    from edtk.design.errors import Errors as Errors
    from edtk.design.exact.apportion import apportion as apportion
    from edtk.design.exact.arranged.arranged_plan import ArrangedPlan as ArrangedPlan
    from edtk.design.exact.comparison import Comparison as Comparison
    from edtk.design.exact.counts.problem_plan import ProblemPlan as ProblemPlan
    from edtk.design.exact.exact_plan import ExactPlan as ExactPlan
    from edtk.design.exact.exchange import exchange as exchange
    from edtk.design.exact.plan_region import RegionPlan as RegionPlan
    from edtk.design.plan import Plan as Plan
    from edtk.design.problem import Problem as Problem
    from edtk.design.problem import several_models as several_models
    from edtk.design.region import Region as Region
    from edtk.design.relaxation.relax_poses import PlanInterrupted as PlanInterrupted
    from edtk.design.relaxation.relaxation import Relaxation as Relaxation
    from edtk.design.relaxation.relaxed_plan import RelaxedPlan as RelaxedPlan
    from edtk.design.relaxation.relaxed_region import RelaxedRegion as RelaxedRegion
    from edtk.fit.controller.find_controller import FoundController as FoundController
    from edtk.robots.compensator import Compensator as Compensator
    from edtk.robots.joint import Joint as Joint
    from edtk.robots.load_robot import load_robot as load_robot
    from edtk.robots.robot import Robot as Robot
    from edtk.robots.robot_overview import RobotOverview as RobotOverview
    from edtk.study.evaluate import Evaluation as Evaluation
    from edtk.study.study import Study as Study
    from edtk.study.study_run import StudyRun as StudyRun
    from edtk.system.errors import UserError as UserError
    from edtk.verbs.bayes import Sampling as Sampling
    from edtk.verbs.bayes import bayes as bayes
    from edtk.verbs.compare import compare as compare
    from edtk.verbs.evaluate import bias as bias
    from edtk.verbs.evaluate import check as check
    from edtk.verbs.evaluate import evaluate as evaluate
    from edtk.verbs.identify import compensate as compensate
    from edtk.verbs.identify import identify as identify
    from edtk.verbs.identify import predict as predict
    from edtk.verbs.inputs import load_study as load_study
    from edtk.verbs.new import new as new
    from edtk.verbs.next import next as next
    from edtk.verbs.plan import plan as plan
    from edtk.verbs.relax import relax as relax
    from edtk.verbs.robot import controller as controller
    from edtk.verbs.robot import robot as robot
    from edtk.verbs.run import run as run
    from edtk.verbs.show import show as show
    from edtk.verbs.template import program as program
    from edtk.verbs.template import template as template
    from edtk.verbs.template import timetable as timetable
    from edtk.verbs.verify import verify as verify

_HOME = {
    # verbs, in the order of a day's work
    "new": "edtk.verbs.new",
    "controller": "edtk.verbs.robot",
    "load_study": "edtk.verbs.inputs",
    "robot": "edtk.verbs.robot",
    "plan": "edtk.verbs.plan",
    "relax": "edtk.verbs.relax",
    "next": "edtk.verbs.next",
    "compare": "edtk.verbs.compare",
    "run": "edtk.verbs.run",
    "evaluate": "edtk.verbs.evaluate",
    "check": "edtk.verbs.evaluate",
    "show": "edtk.verbs.show",
    "template": "edtk.verbs.template",
    "timetable": "edtk.verbs.template",
    "program": "edtk.verbs.template",
    "identify": "edtk.verbs.identify",
    "predict": "edtk.verbs.identify",
    "bayes": "edtk.verbs.bayes",
    "bias": "edtk.verbs.evaluate",
    "compensate": "edtk.verbs.identify",
    "verify": "edtk.verbs.verify",
    # nouns
    "Study": "edtk.study.study",
    "Robot": "edtk.robots.robot",
    "Joint": "edtk.robots.joint",
    "Compensator": "edtk.robots.compensator",
    "RobotOverview": "edtk.robots.robot_overview",
    "FoundController": "edtk.fit.controller.find_controller",
    "load_robot": "edtk.robots.load_robot",
    "Plan": "edtk.design.plan",
    "ExactPlan": "edtk.design.exact.exact_plan",
    "RelaxedPlan": "edtk.design.relaxation.relaxed_plan",
    "Evaluation": "edtk.study.evaluate",
    "Cell": "edtk.cell.cell",
    "PlanCheck": "edtk.cell.plan_check",
    "Calibration": "edtk.calibration.calibration",
    "SpringCalibration": "edtk.calibration.spring_calibration",
    "GeometricCalibration": "edtk.calibration.geometric_calibration",
    "Prediction": "edtk.calibration.prediction",
    "WrittenProgram": "edtk.calibration.robot_program",
    "GeometryPlan": "edtk.calibration.geometry_plan",
    "GeometryEvaluation": "edtk.calibration.evaluate_geometry",
    "PosteriorCheck": "edtk.calibration.posterior_check",
    "PlanBias": "edtk.calibration.planned",
    "Compensation": "edtk.calibration.compensate",
    "CorrectedProgram": "edtk.calibration.correct_program",
    "Verification": "edtk.certificate.verify_certificate",
    "Bound": "edtk.design.bound",
    "Sampling": "edtk.verbs.bayes",
    "StudyRun": "edtk.study.study_run",
    "UserError": "edtk.system.errors",
    "PlanInterrupted": "edtk.design.relaxation.relax_poses",
    # any linear(ised) model
    "Problem": "edtk.design.problem",
    "Region": "edtk.design.region",
    "Errors": "edtk.design.errors",
    "several_models": "edtk.design.problem",
    "Relaxation": "edtk.design.relaxation.relaxation",
    "ArrangedPlan": "edtk.design.exact.arranged.arranged_plan",
    "Comparison": "edtk.design.exact.comparison",
    "ProblemPlan": "edtk.design.exact.counts.problem_plan",
    "RelaxedRegion": "edtk.design.relaxation.relaxed_region",
    "RegionPlan": "edtk.design.exact.plan_region",
    "apportion": "edtk.design.exact.apportion",
    "exchange": "edtk.design.exact.exchange",
    "geometry_problem": "edtk.calibration.geometry_plan",
}
_MODULES = {"criteria": "criteria", "candidates": "edtk.candidates"}
__all__ = ["__version__", *_MODULES, *_HOME]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used.

    Raises:
        AttributeError: The package has no such name.
    """
    if name in _MODULES:
        found: Any = importlib.import_module(_MODULES[name])
    elif name in _HOME:
        found = getattr(importlib.import_module(_HOME[name]), name)
    else:
        raise AttributeError(f"module 'edtk' has no attribute {name!r}")
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """The public names, for completion at a prompt."""
    return sorted(__all__)
