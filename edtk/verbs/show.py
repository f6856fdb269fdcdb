"""`edtk.show`: a page on which one looks at each pose before the arm moves."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.design.plan import Plan
from edtk.measure.compliances import Compliances, compliances_file
from edtk.measure.pose_table import PoseTable
from edtk.study.study import Study
from edtk.study.study_objects import is_sheet
from edtk.system.arguments import checked
from edtk.system.errors import UserError
from edtk.system.files import write_files
from edtk.verbs.inputs import (
    PlanLike,
    StudyLike,
    as_plan,
    content_of,
    errors_in,
    files_of,
    name_of,
    require_output,
)
from edtk.verbs.of_kinds import of_study
from edtk.verbs.of_studies import OfStudy

if TYPE_CHECKING:
    from edtk.calibration.calibration import Calibration
    from edtk.report.show.page import ShownPage
    from edtk.report.show.stage import Shade, Stage

    Given = PlanLike | Calibration | Mapping[str, Any] | None


@checked
def show(study: StudyLike, plan: "Given" = None, *, out: Path | str | None = None) -> "ShownPage":
    """Make a page with the poses of a plan, a sheet or a result, for a browser without a network.

    The arm stands in each pose with its markers, beams and load, what surrounds it, and where
    compliances are known bent by the load, 100 times enlarged. Colours tell what share of the
    information hangs on a pose, or how far its readings are from the fit.

    Args:
        study: A study, or the path of a study file.
        plan: A plan, a filled-in sheet or the result of `edtk.identify`, or the path of one of
            these (CSV, or JSON); None for the test poses of the study, or the robot alone.
        out: File to write (HTML), "-" for standard output.

    Returns:
        The page, which shows itself in a notebook; `.html` is its text.

    Raises:
        UserError: A file is not valid, or of another robot; one line says why.
    """
    from edtk.report.show.page import ShownPage

    question = of_study(study)
    require_output(out, *question.study.reads, *files_of(plan))
    with errors_in(name_of(plan, question.study.where)):
        page = ShownPage(_stage(question, plan))
    if out is not None:
        write_files({Path(out): page.html})
    return page


def _stage(question: OfStudy, given: Any) -> "Stage":
    """What is shown of what is given."""
    from edtk.report.show.stage import OF_SHEET, stage_of, stage_of_plan

    study = question.study
    if given is None:
        return stage_of(study, **_own_poses(study))
    content = _result(given)
    if content is not None:
        return _of_result(question, content, name_of(given, "result"))
    plan = as_plan(study, given)
    if _is_sheet(study, given):
        found = _calibrated(question, given)
        if found is not None:
            return _of_result(question, found.to_dict(), name_of(given, "sheet"))
        return stage_of(study, plan, ordered=OF_SHEET, shades=[_shares(question, plan)])
    return stage_of_plan(study, plan, lambda some: _shares(question, some))


def _result(given: object) -> Mapping[str, Any] | None:
    """The content of a result of `edtk.identify`; None for a plan, a sheet or a table."""
    if isinstance(given, str | Path):
        return compliances_file(given) if Path(given).suffix.lower() == ".json" else None
    is_plan = isinstance(given, Plan) or isinstance(getattr(given, "whole", None), Plan)
    return None if is_plan else content_of(given)


def _of_result(question: OfStudy, content: Mapping[str, Any], where: Path) -> "Stage":
    """The poses of a calibration with their residuals; those of the study where it has none."""
    from edtk.calibration.result_file import MeasuredPoses
    from edtk.report.show.stage import OF_SHEET, residuals, stage_of

    study = question.study
    known = _known(study, content, where)
    if "poses" not in content:
        return stage_of(study, **_own_poses(study), compliances=known)
    found = MeasuredPoses.from_list(content["poses"], study.robot.n, where)
    shades = [residuals(found), _shares(question, found.plan)]
    return stage_of(study, found.plan, ordered=OF_SHEET, compliances=known, shades=shades)


def _known(study: Study, content: Mapping[str, Any], where: Path) -> dict[str, float]:
    """The compliances of a result by name, without those that it does not tell [rad/(N m)]."""
    table = content.get("k", content)
    if isinstance(table, Mapping):
        content = {"k": {name: value for name, value in table.items() if value is not None}}
    found = Compliances.from_dict(content, study.robot.joint_names, (), where)
    return dict(zip(found.joints, found.k.tolist(), strict=True))


def _own_poses(study: Study) -> dict[str, Any]:
    """The test poses of a study, or without any the pose nearest to zero; and which they are."""
    robot = study.robot
    if study.tasks:
        q = np.vstack([np.reshape(task.q, (-1, robot.n)) for task in study.tasks])
        words = "the test poses of the study, with the tool of its measurements"
    else:
        zero = np.array([study.fixed.get(j, 0.0) for j in range(robot.n)])
        q = np.clip(zero, *robot.hard_limits)[None]
        words = "no plan: the pose nearest to zero"
    plan = Plan(q, np.zeros((len(q), 6)), np.ones(len(q), dtype=int))
    return {"plan": plan, "ordered": words}


def _is_sheet(study: Study, given: Any) -> bool:
    """Whether a table is one on which measurements are written down."""
    table = given if isinstance(given, str | Path) or hasattr(given, "columns") else None
    return table is not None and is_sheet(study, PoseTable.read(table, "plan"))


def _calibrated(question: OfStudy, sheet: Any) -> Any:
    """The calibration of a sheet; None where it is not filled in, or tells too little."""
    from edtk.findings.fitted_data import HowFitted

    try:
        return question.identify(sheet, HowFitted(), None, None, None)
    except UserError:
        return None


def _shares(question: OfStudy, plan: Plan) -> "Shade | None":
    """What each pose brings; None where the plan leaves something open."""
    from edtk.report.show.stage import MOST_SHARES, shares

    if len(plan.q) > MOST_SHARES:
        return None
    try:
        designs = question.designs(question.study)
        return shares(designs.information, designs.criterion(), plan)
    except UserError:
        return None
