"""The worth of a plan of visits: rank, all criteria, and the error to expect in the test poses."""

import numpy as np

import criteria
from edtk.calibration.geometry_design.geometry_designs import GeometryDesigns
from edtk.calibration.geometry_design.geometry_evaluation import GeometryEvaluation
from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.calibration.geometry_design.poses_by_load import PosesByLoad
from edtk.calibration.geometry_design.position_rows import MM, PositionRows
from edtk.calibration.geometry_design.told_by_plan import ToldByPlan
from edtk.design.plan import Plan
from edtk.model.geometry.identifiable import Identifiable
from edtk.study.criterion_values import criterion_values, observability
from edtk.study.study import Study
from edtk.study.study_errors import study_errors
from edtk.system.typing import Array

UNTOLD = 1e-6  # [mm] an error in a task that a unit of what a plan leaves open may make


def evaluate_geometry(study: Study, plan: Plan) -> GeometryEvaluation:
    """Score a plan of visits under every criterion that the study can evaluate.

    A plan that leaves parameters open is scored, too: the standard deviations are then those of the
    parameters that it tells, criteria of all parameters have no value, and rho0 has one where no
    open parameter moves a marker in the test poses.

    Args:
        study: The study, with [parameters].
        plan: The plan, whether or not its poses are feasible.

    Raises:
        UserError: The study is no question of a plan, or a criterion that it names fails.
    """
    with study_errors(study):
        question = GeometryQuestion.of(study)
    by_plan = ToldByPlan(question, plan)
    told = by_plan.told
    is_whole = not len(told.left)
    parameters = tuple(question.model.parameters[i] for i in told.kept)
    cov = by_plan.covariance
    values: dict[str, float] = {}
    skipped = _without_value(question)
    if is_whole:
        M = question.space.information(plan)
        has_target = question.target is not None
        values, skipped = criterion_values(study, M, question.criterion, has_target)
    return GeometryEvaluation(
        question=question,
        poses=PosesByLoad.of(plan, question.wrenches, study.robot),
        criteria=values,
        observability_unscaled=_unscaled(question, plan) if is_whole else {},
        covariance=cov,
        parameters=parameters,
        open=told.words,
        rho0=_rho0(question, told, cov),
        skipped=skipped,
        warnings=study.warnings + GeometryDesigns(study, question).warnings(plan),
    )


def _rho0(question: GeometryQuestion, told: Identifiable, cov: Array) -> float | None:
    """The error in the test poses [m]; None without any, or where it depends on what is open."""
    target = question.target
    if target is None:
        return None
    apart = target[:, told.left] - target[:, told.kept] @ told.shares
    if MM * np.abs(apart).max(initial=0.0) > UNTOLD:
        return None
    rows = target[:, told.kept]
    return float(np.sqrt(np.einsum("rp,pq,rq->", rows, cov, rows)))


def _without_value(question: GeometryQuestion) -> dict[str, str]:
    """Why the criteria of the study have no value."""
    names = [name for name in question.study.names if not criteria.get(name).needs_target]
    return dict.fromkeys(names, "the plan leaves parameters open")


def _unscaled(question: GeometryQuestion, plan: Plan) -> dict[str, float]:
    """O1 to O5 of the stacked regressor in mm and mrad, without division by the noise."""
    rows = PositionRows(question.model, question.setting.loads)(plan.q, plan.wrench)
    M = np.einsum("k,kri,krj->ij", plan.repeats, rows, rows)
    return observability(M, question.criterion)
