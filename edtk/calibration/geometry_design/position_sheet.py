"""The sheet on which positions of markers are written down while a plan is measured."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.calibration.geometry.study_geometry import StudyGeometry
from edtk.calibration.geometry_design.day_costs import DayCosts
from edtk.calibration.visiting_order import visiting_order
from edtk.design.plan import Plan
from edtk.inference.geometry.turn_columns import VECTOR
from edtk.study.study import Study
from edtk.system.typing import Indices
from edtk.tables.in_file_units import rounded
from edtk.tables.pose_columns import pose_columns
from edtk.tables.sheet_columns import LOADED_COLUMNS, MARKER_NAME_COLUMN, VISIT_COLUMN

if TYPE_CHECKING:
    import pandas as pd


def position_sheet(study: Study, plan: Plan) -> "pd.DataFrame":
    """Make the empty sheet of a plan of visits: a row for each marker of each visit.

    All poses without a load come first, then those under each load, each in an order of little
    joint travel. Where the study asks for more load changes, the visits of each load are shared out
    among so many rounds. Reference points on the base have rows in every visit, too. Orientations
    of full poses are rotation vectors. Angles have the digits that a controller takes; `edtk
    identify` reads the sheet when it is filled in.

    Args:
        study: The study, with [parameters].
        plan: The visits.
    """
    setting = StudyGeometry.of(study)
    plan = Plan(rounded(study.robot, plan.q), plan.wrench, plan.repeats)
    order = visit_order(study, plan)
    names = (*setting.markers, *setting.references)
    table = plan.to_frame(study.robot).drop(columns="repeats")
    table = table.iloc[np.repeat(order, len(names))].reset_index(drop=True)
    table[VISIT_COLUMN] = np.arange(len(table)) // len(names) + 1
    table[MARKER_NAME_COLUMN] = list(names) * len(order)
    table[list(LOADED_COLUMNS)] = np.nan
    if setting.full_poses:
        table[_turn_columns(study, setting.markers)] = np.nan
    return table


def _turn_columns(study: Study, markers: tuple[str, ...]) -> list[str]:
    """Columns of the orientations; with the markers' names where a joint has one of them."""
    if set(VECTOR) & set(pose_columns(study.robot)):
        return [f"{name}_{column}" for name in markers for column in VECTOR]
    return list(VECTOR)


def visit_order(study: Study, plan: Plan) -> Indices:
    """Indices of the plan's poses in the order in which they are visited, repeats included."""
    lower, upper = study.robot.limits
    span = upper - lower
    loads = np.unique(plan.wrench, axis=0)
    loads = loads[np.argsort(loads.any(axis=1), kind="stable")]
    costs = DayCosts.of(study)
    changes = len(loads) - 1 if costs is None else costs.changes_of(len(loads))
    rounds: list[list[Indices]] = []
    for i, load in enumerate(loads):
        own = np.flatnonzero((plan.wrench == load).all(axis=1))
        path = own[visiting_order(plan.q[own], span)]
        visits = np.repeat(path, plan.repeats[path])
        # Load i is on in every len(loads)-th of changes + 1 stretches of the day.
        stretches = len(range(i, changes + 1, len(loads)))
        rounds.append(np.array_split(visits, stretches))
    taken = [rounds[i % len(loads)][i // len(loads)] for i in range(changes + 1)]
    return np.concatenate(taken)
