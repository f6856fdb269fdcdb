"""Geometry: plans of visits, their evaluation, and calibrations."""

import numpy as np

from edtk.calibration.evaluate_geometry import GeometryEvaluation
from edtk.calibration.geometric_calibration import GeometricCalibration
from edtk.calibration.geometry_plan import GeometryPlan
from edtk.calibration.geometry_question import GeometryQuestion
from edtk.design.exact.day import PosesByLoad
from edtk.findings.finding import notes
from edtk.fit.fitted_geometry import root_mean_square
from edtk.measure.pose_table import in_file_units, pose_columns
from edtk.report.geometry_report import MOST_MARKERS, robot_stands
from edtk.report.show.page import ShownPage
from edtk.report.show.stage import shares, stage_of_plan
from edtk.report.shown import expected_rho0, left_out_line, places_of
from edtk.report.tables import name_width, number_columns
from edtk.report.views.calibration import budget_lines, extension_lines
from edtk.report.views.evaluation import criteria_lines, deviation_lines
from edtk.report.views.plan import experiments, on_limits, search_lines
from edtk.robots.frames import MM
from edtk.system.typing import Array


def geometric_calibration_text(found: GeometricCalibration) -> str:
    """Parameters, how well poses are predicted that were left out, and the verdict."""
    fit = found.fit
    lines = [
        f"{fit.data.count} positions of {len(fit.data.markers)} markers in {fit.data.poses} poses"
        + (f", {len(found.left_out)} visits left out" if found.left_out else ""),
        f"{fit.rank} parameters can be told apart"
        + (f" of {fit.structural} that better poses would tell" if fit.open else "")
        + "; each is added to what the drawing, the study's markers",
        "or the place of the robot say",
        f"robot in the instrument's frame: {robot_stands(found.base)}",
        *_parameters(found),
        *_redundant(found),
        *_quality(found),
    ]
    lines += extension_lines(found.extension)
    lines += notes(found.findings)
    lines += [f"assumed: {line}" for line in found.assumed]
    if found.check is not None:
        lines += ["posterior", found.check.summary()]
    return "\n".join([*lines, f"verdict: {found.verdict}"])


def _parameters(found: GeometricCalibration) -> list[str]:
    """A line for each parameter, but of the places of many markers for those of the first few."""
    named = found.fit.data.markers[:MOST_MARKERS]
    every = found.fit.fitted.model.parameters
    parameters = [one for one in every if one.place != "tool" or one.of in named]
    width = name_width([one.name for one in parameters], 6)
    lines = []
    for one in parameters:
        own = found.parameters[one.name]
        places = places_of(own["std"])
        value = f"{own['value']:10.{places}f} +- {own['std']:.{places}f} {one.unit}"
        lines.append(f"  {one.name:{width}}{value}  {one.words}")
    others = [one for one in every if one not in parameters]
    if others:
        units = dict.fromkeys(one.unit for one in others)
        std = " and ".join(
            f"{max(found.parameters[o.name]['std'] for o in others if o.unit == unit):.2g} {unit}"
            for unit in units
        )
        count = len({one.of for one in others})
        lines.append(
            f"  and the places of {count} more markers, each known to +- {std} or better; "
            "--out or --json says where they are"
        )
    return lines


def _redundant(found: GeometricCalibration) -> list[str]:
    """How many parameters are not fitted, since others do what they do."""
    count = len(found.fit.redundant)
    if not count:
        return []
    others = "1 other cannot" if count == 1 else f"{count} others cannot"
    return [f"{others} be told apart from these, and count as drawn; the report says which"]


def _turns(found: GeometricCalibration) -> list[str]:
    """How well orientations fit, where they were measured."""
    turns = found.fit.turns
    if turns is None:
        return []
    fit, left_out = (
        float(np.rad2deg(root_mean_square(part))) for part in (turns.residual, turns.left_out)
    )
    return [f"orientations: {fit:.3g} deg rms off in the fit, {left_out:.3g} deg left out"]


def _quality(found: GeometricCalibration) -> list[str]:
    """How well positions fit, and are predicted."""
    fit = found.fit
    noise = fit.fitted.noise
    joints = max(noise.model_joints.tolist(), default=0.0)
    sizes = {
        "each joint were off by {:.3g} mrad": joints,
        "each coordinate by {:.3g} mm": noise.model_white,
        "each orientation by {:.3g} deg": np.rad2deg(1e-3 * (noise.model_turn or 0.0)),
    }
    parts = " and ".join(text.format(size) for text, size in sizes.items() if size)
    left_out = f"errors that the model does not explain: as if {parts}, anew in each pose"
    if not parts:
        left_out = "the residuals show no errors that the model does not explain"
    if noise.unknown:
        size = f"the residuals tell the noise: a coordinate is off by {fit.reading:.3g} mm"
        beside = f"; besides as if {parts}, anew in each pose" if parts else ""
        left_out = f"{size}, with what the model leaves out of it{beside}"
    repeats = f"; repeats of readings scatter by {fit.reading:.3g} mm" if noise.repeats else ""
    if noise.repeats and noise.turn is not None:
        repeats += f" and {np.rad2deg(1e-3 * noise.turn):.3g} deg"
    alone = f"{MM * fit.placed:.4g} mm rms with base and tools fitted alone, "
    if np.isnan(fit.placed):
        alone = ""  # differences of readings place nothing
    return [
        f"distance of positions: {alone}{MM * fit.rms:.4g} mm rms with all fitted",
        left_out_line(found.loo_rms_mm, fit.share_inside),
        *_turns(found),
        *(
            [expected_rho0(found.rho0_mm, found.in_tasks), str(found.expected)]
            if found.rho0_mm is not None
            else []
        ),
        *budget_lines(found.budget, of_visits=True, planned=False),
        left_out + repeats,
    ]


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
