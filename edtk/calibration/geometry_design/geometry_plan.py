"""A plan of visits for a study of geometry, by load, with what it tells, and its sheet."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.geometry_design.day_costs import DayCosts, PosesByLoad
from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.calibration.geometry_design.geometry_space import PositionRows
from edtk.calibration.template import visiting_order
from edtk.design.bound import Bound
from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.plan import Plan
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.fit.geometry.fit_geometry import stages
from edtk.fit.geometry.marker_positions import VECTOR
from edtk.measure.parameters import Identifiable, identifiable
from edtk.measure.pose_table import (
    LOADED_COLUMNS,
    MARKER_NAME_COLUMN,
    VISIT_COLUMN,
    pose_columns,
    rounded,
)
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class ToldByPlan:
    """The parameters that a plan tells.

    Attributes:
        question: The question of the study.
        plan: The plan.
    """

    question: GeometryQuestion
    plan: Plan

    @cached_property
    def told(self) -> Identifiable:
        """Which parameters of the question it tells apart."""
        question = self.question
        rows = question.rows(self.plan.q, self.plan.wrench).reshape(-1, question.model.p)
        return identifiable(rows, question.model.parameters, stages(question.model))

    @cached_property
    def covariance(self) -> Array:
        """Covariance (r, r) of these parameters, in their units."""
        question = self.question
        kept = self.told.kept
        rows = PositionRows(question.model, question.setting.loads, question.setting.noise)
        A = rows(self.plan.q, self.plan.wrench)
        weighted = np.sqrt(self.plan.repeats)[:, None, None] * A[..., kept]
        # From the rows: their squares would lose half of the digits.
        R = np.linalg.qr(weighted.reshape(-1, len(kept)), mode="r")
        inverse = np.linalg.solve(R, np.eye(len(R)))
        return np.asarray(inverse @ inverse.T)


@dataclass(frozen=True, eq=False, kw_only=True)
class GeometryPlan(ExactPlan):
    """The best plan of visits that a search has found.

    Attributes:
        question: The question of the study.
        bound_of_all: No plan within the same size and budget costs less, whatever loads it uses.
        costs: What visits and load changes cost; None where nobody said.
        tried: Loads that a plan within the budget may visit, as indices of `question.wrenches`,
            with the cost of the best plan of them; none where nothing limits the loads.
        asked: Number of new visits that were asked for; None where the budget decides.
        proofs: The relaxations of all sets of loads that the budget pays for, on which the bound
            rests; none of a set that cannot tell what the criterion needs.
        rho0: Error of the markers to expect in the test poses [m]; None without any.
    """

    question: GeometryQuestion
    bound_of_all: Bound
    costs: DayCosts | None = None
    tried: dict[tuple[int, ...], float] = field(default_factory=dict)
    rho0: float | None = None
    asked: int | None = None
    proofs: dict[tuple[int, ...], RelaxedPlan] = field(default_factory=dict)

    @property
    def lower_bound(self) -> Bound:
        """The bound on the cost of every plan within the same size and budget."""
        return self.bound_of_all

    @property
    def bound_gap(self) -> float:
        """Relative gap between the bound and the best weights."""
        return self.bound_of_all.gap

    @property
    def poses(self) -> PosesByLoad:
        """The poses, each once, with its visits without and with each load; kept ones too."""
        return PosesByLoad.of(self.whole, self.question.wrenches, self.robot)

    @property
    def listed(self) -> Array:
        """The poses (k, n) in the order in which they are printed [rad or m]."""
        return self.poses.q

    @property
    def poses_kept(self) -> Indices:
        """How many of the visits of each of these poses were made already (k,)."""
        every = self.poses.visits.sum(axis=1)
        if self.kept is None:
            return np.zeros(len(every), dtype=int)
        return self.poses.visits_of(self.kept)

    @property
    def spent(self) -> float | None:
        """What the new visits cost, load changes included; None where nobody said."""
        if self.costs is None:
            return None
        new = PosesByLoad.of(self.plan, self.question.wrenches, self.robot)
        return self.costs.total(new.wrenches, new.visits.sum(axis=0))

    @property
    def day(self) -> dict[str, Any] | None:
        """What visits cost and may cost, as a certificate holds it; None without a budget."""
        costs = self.costs
        if costs is None or costs.budget is None:
            return None
        return {
            "visit": costs.visit,
            "loaded_visit": costs.loaded_visit,
            "load_change": costs.change,
            "load_changes": costs.changes,
            "budget": costs.budget,
            "visits": self.asked,
        }

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, as of other plans, with costs, loads and what is identified."""
        found = super().to_dict()
        poses = self.poses
        new = PosesByLoad.of(self.plan, self.question.wrenches, self.robot)
        loads = int(np.count_nonzero(new.visits.sum(axis=0)))
        costs = self.costs
        return {
            **found,
            "rank": self.question.model.p,
            "structural_rank": self.question.structural.p,
            "parameters": [one.name for one in self.question.model.parameters],
            "untold": list(self.question.untold),
            "rho0_mm": None if self.rho0 is None else 1e3 * self.rho0,
            "loads": poses.wrenches.tolist(),
            "poses": poses.to_list(),
            "costs": None
            if costs is None
            else {
                "spent": self.spent,
                "budget": costs.budget,
                "load_changes": costs.changes_of(loads),
                "unit": costs.unit,
            },
        }


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
