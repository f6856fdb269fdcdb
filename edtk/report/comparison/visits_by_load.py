"""How many visits of a study of geometry are loaded, and what their days cost."""

import numpy as np

from edtk.calibration.geometry_design.day_costs import DayCosts
from edtk.calibration.geometry_design.geometry_designs import GeometryDesigns
from edtk.calibration.geometry_design.poses_by_load import PosesByLoad
from edtk.report.markdown_table import markdown_table
from edtk.study.study_run import StudyRun


def visits_by_load(run: StudyRun, designs: GeometryDesigns) -> str:
    """A table with a plan a row: its poses, its visits under each load, and its costs.

    It is empty where visits have no load and cost nothing that somebody told.
    """
    wrenches = designs.question.wrenches
    costs = DayCosts.of(run.study)
    if len(wrenches) == 1 and costs is None:
        return ""
    loads = ["loaded"] if len(wrenches) == 2 else [f"load {i}" for i in range(1, len(wrenches))]
    header = ["plan", "poses", "without a load", *loads]
    if costs is not None:
        header += ["load changes", f"costs [{costs.unit}]" if costs.unit else "costs"]
    rows = []
    for case in run.cases:
        if case.plan is None:
            continue
        poses = PosesByLoad.of(case.plan, wrenches, run.study.robot)
        visits = poses.visits.sum(axis=0)
        row = [case.name, len(poses.q), *(visits.tolist()[: len(wrenches)])]
        if costs is not None:
            changes = costs.changes_of(int(np.count_nonzero(visits)))
            row += [changes, f"{costs.total(poses.wrenches, visits):g}"]
        rows.append(row)
    return f"## Visits by load\n\n{markdown_table(header, rows)}"
