"""Plans of visits for studies of geometry, and their worth."""

from edtk.calibration.geometry_design.evaluate_geometry import GeometryEvaluation
from edtk.calibration.geometry_design.geometry_plan import GeometryPlan
from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.design.exact.day import PosesByLoad
from edtk.measure.pose_table import in_file_units, pose_columns
from edtk.report.show.page import ShownPage
from edtk.report.show.stage import shares, stage_of_plan
from edtk.report.shown import expected_rho0
from edtk.report.tables import number_columns
from edtk.report.views.calibration import budget_lines
from edtk.report.views.evaluation import criteria_lines, deviation_lines
from edtk.report.views.plan import experiments, on_limits, search_lines
from edtk.system.typing import Array


def geometry_plan_show(found: GeometryPlan) -> ShownPage:
    """The visits in the order of their sheet, with the share of the information of each."""
    question = found.question
    criterion = found.relaxed.criterion
    stage = stage_of_plan(
        question.study, found.whole, lambda plan: shares(question.information, criterion, plan)
    )
    return ShownPage(stage)


def geometry_plan_text(found: GeometryPlan) -> str:
    """Value, bound, what is identified, what the day costs, and the poses with their visits."""
    poses = found.poses
    lines = search_lines(
        found,
        f"{found.whole.experiments} visits of {len(poses.q)} poses",
        "is known before",
        [*_identified(found), *_rho0(found), *_loads(found, poses)],
        "the parameters",
    )
    table = experiments(found) if found.question.chooses_forces else _table(found, poses)
    return "\n".join([*lines, *table, *on_limits(found)])


def _loads(found: GeometryPlan, poses: PosesByLoad) -> list[str]:
    """What loads the visits of each column, or each visit."""
    if not found.question.chooses_forces:
        return visits_by_load(poses)
    return [f"each visit under {found.question.study.specification.describe_load()}"]


def _identified(found: GeometryPlan) -> list[str]:
    """How many parameters a plan tells, and what no plan of this study does."""
    question = found.question
    lines = [f"{question.model.p} parameters can be told apart"]
    if question.model.p < question.structural.p:
        lines[0] += f" of {question.structural.p} that any poses would tell"
    lines += [f"not told by feasible poses: {words}" for words in question.untold]
    return [*lines, *about(question)]


def about(question: GeometryQuestion) -> list[str]:
    """What the criteria are about, where that is not all that is unknown."""
    table = question.study.specification.interest
    if table is None:
        return []
    names = " and ".join(table.parameters)
    return [f"criteria but rho0 and rho_max are about {names}; the rest is unknown too"]


def _rho0(found: GeometryPlan) -> list[str]:
    """The error in the test poses, where it is not the value itself."""
    if found.rho0 is None:
        return []
    return [
        expected_rho0(1e3 * found.rho0, found.question.study.tasks),
        *([] if found.expected is None else [str(found.expected)]),
        *budget_lines(found.error_budget, of_visits=True),
        *as_drawn(found.question),
    ]


def as_drawn(question: GeometryQuestion) -> list[str]:
    """What a tool point depends on, and markers do not tell."""
    return [f"in the tasks taken as drawn: {words}" for words in question.as_drawn]


def visits_by_load(poses: PosesByLoad) -> list[str]:
    """What loads the visits of each column; nothing where none is loaded."""
    if len(poses.wrenches) == 1:
        return []
    lines = []
    for i, (W, visits) in enumerate(zip(poses.wrenches, poses.visits.T, strict=True)):
        what = "without a load" if not W.any() else f"under {_name(poses, i)}, {_wrench(W)}"
        count = visits.sum()
        lines.append(f"{count} visit{'' if count == 1 else 's'} {what}")
    both = int(((poses.visits > 0).sum(axis=1) > 1).sum())
    if both:
        lines.append(f"{both} of the poses are visited under more than one of them")
    return lines


def _name(poses: PosesByLoad, load: int) -> str:
    """What a load is called in the table."""
    return "load" if len(poses.wrenches) == 2 else f"load {load}"


def _wrench(W: Array) -> str:
    """A wrench (6,) in words."""
    parts = [
        f"{letter} = ({', '.join(f'{x:g}' for x in part)}) {unit}"
        for letter, part, unit in (("F", W[:3], "N"), ("T", W[3:6], "N m"))
        if part.any()
    ]
    where = f" at ({', '.join(f'{x:g}' for x in 1e3 * W[6:])}) mm" if len(W) > 6 else ""
    return ", ".join(parts) + where


def _table(found: GeometryPlan, poses: PosesByLoad) -> list[str]:
    """A header, and a line for each pose: its visits without and under each load, its joints."""
    names = list(pose_columns(found.robot))
    numbers = [[f"{x:.3f}" for x in row] for row in in_file_units(found.robot, poses.q)]
    header, *rows = number_columns(names, numbers, 10)
    if len(poses.wrenches) == 1:
        heads = ["visits"]
    elif len(poses.wrenches) == 2:
        heads = ["unloaded", "loaded"]
    else:
        heads = ["no load", *(_name(poses, i) for i in range(1, len(poses.wrenches)))]
    lines = [f"{' '.join(f'{head:>8}' for head in heads)} {header}"]
    kept = found.poses_kept
    for own, row, times in zip(poses.visits, rows, kept, strict=True):
        counts = " ".join(f"{number or '-':>8}" for number in own)
        there = f"  {times} of them kept" if times else ""
        lines.append(f"{counts} {row}{there}")
    return lines


def geometry_evaluation_text(found: GeometryEvaluation) -> str:
    """What is told, a line for each criterion, and one for each standard deviation."""
    question = found.question
    lines = [
        f"{found.experiments} visits of {len(found.poses.q)} poses"
        + (", beside what is known before" if found.with_prior else ""),
        *visits_by_load(found.poses),
        f"{found.rank} parameters can be told apart"
        + (f" of {question.model.p} that better poses would tell" if found.open else ""),
        *(f"open: {words}" for words in found.open),
        *(f"not told by feasible poses: {words}" for words in question.untold),
        *_rho0_of_evaluation(found),
        *about(question),
    ]
    deviations = deviation_lines(found, (one.words for one in found.parameters))
    return "\n".join([*lines, *criteria_lines(found), *deviations])


def _rho0_of_evaluation(found: GeometryEvaluation) -> list[str]:
    """The error in the test poses, or why there is none."""
    tasks = found.question.study.tasks
    if found.rho0 is not None:
        return [
            expected_rho0(1e3 * found.rho0, tasks),
            *([] if found.expected is None else [str(found.expected)]),
            *budget_lines(found.error_budget, of_visits=True),
            *as_drawn(found.question),
        ]
    if not tasks:
        return []
    return [f"no rho0: what is open moves {tasks.subject} {tasks.place}"]
