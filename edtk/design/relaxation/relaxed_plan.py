"""A design over poses: weights instead of repetitions, with bounds and what proves them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from criteria import Relaxable
from criteria.criterion import printed
from edtk.design.bound import HEADLINE, Bound, BoundKind, RelaxedDesign, printed_bounds
from edtk.design.candidate_source import Candidates, CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.design.plan import Plan
from edtk.design.relaxation.proof import normalised
from edtk.design.relaxation.search_continuum import LargestSensitivities
from edtk.measure.cells import csv_text
from edtk.measure.pose_table import pose_factors, wrench_columns
from edtk.system.files import write_text
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, kw_only=True)
class RelaxedPlan(RelaxedDesign):
    """A relaxed design over poses: its weights (k,) are the share that each should have.

    Attributes:
        source: Where the candidate poses come from.
        candidates: The bound is proved over the first so many of them, and over these poses.
        x: Design variables (k, v) of the experiments.
        searched_bound: Not proved: no design over all feasible poses has a lower cost, provided
            that the ascents have found the largest sensitivities; None without a search.
        proved_sensitivities: The largest sensitivities of the candidates and of these poses.
        searched_sensitivities: The largest sensitivities that were found in any pose, and where;
            None without a search.
        seconds: Time that each stage took [s].
        ended: Why the search, or the proof of a bound over all poses, ended: "proved", also where
            nobody asked for one, "budget" or "interrupted".
        without_cell: The same over all poses, whether they are free or not, where there is a cell:
            its bound holds with the cell, too, and is what a certificate proves.
    """

    source: CandidateSource
    candidates: int
    criterion: Relaxable
    x: Array
    searched_bound: Bound | None
    proved_sensitivities: LargestSensitivities
    searched_sensitivities: LargestSensitivities | None
    seconds: Mapping[str, float] = field(default_factory=dict)
    ended: str = "proved"
    without_cell: "RelaxedPlan | None" = None

    def headline(self) -> str:
        """Criterion, value, number of poses and proved gap."""
        value = self.printed(self.value, HEADLINE)
        proved = "gap by a solver's word" if self.rests_on_solver else "proved gap"
        return (
            f"{self.criterion.label} = {value} with weights on {len(self.x)} poses, "
            f"{proved} {self.gap:.1e}"
        )

    def printed(self, value: float, digits: int = 6) -> str:
        """A value of the criterion with its unit."""
        return printed(self.criterion, value, self.space.units, digits)

    @property
    def rests_on_solver(self) -> bool:
        """Whether the bounds rest on a solver's word, as of a criterion without a dual form."""
        return self.criterion.rests_on_solver(self.multipliers, self.information)

    @property
    def space(self) -> DesignSpace:
        """Model, feasible set and noise."""
        return self.source.space

    @property
    def places(self) -> Array:
        """Design variables (k, v)."""
        return self.x

    @property
    def bounds(self) -> dict[str, Bound]:
        """That on the candidates, and that of the search where there was one."""
        searched = self.sharper_search
        return super().bounds | ({} if searched is None else {"searched": searched})

    @property
    def best_bound(self) -> Bound:
        """The bound over all poses where one was searched, else the proved one."""
        searched = self.sharper_search
        return self.proved_bound if searched is None else searched

    @property
    def sharper_search(self) -> Bound | None:
        """The bound of a search over all poses, if there was one.

        That without the cell holds for free poses too, and is told where its search ended sharper.
        """
        own = self.searched_bound
        beyond = None if self.without_cell is None else self.without_cell.searched_bound
        if own is None or beyond is None or beyond.cost <= own.cost:
            return own
        return Bound.of(self.criterion, beyond.cost, self.cost, own.kind)

    def holding_for(self, x: Array) -> "RelaxedPlan":
        """The same with a bound that holds for designs on further experiments, too.

        One of a search becomes lower where they are more sensitive than all that it has found.
        Where there is none, they join the poses, without weight, so that a certificate has all that
        its bound is on.

        Args:
            x: Their design variables (k, v); they need not be candidates.
        """
        beyond = None if self.without_cell is None else self.without_cell.holding_for(x)
        others = Candidates(x, self.space.problem(x))
        own = LargestSensitivities.over(others, self.criterion, self.multipliers)
        if self.searched_bound is None or self.searched_sensitivities is None:
            largest = self.proved_sensitivities.or_larger(own)
            return replace(
                self,
                x=np.concatenate([self.x, x]),
                weights=np.concatenate([self.weights, np.zeros(len(x))]),
                proved_bound=self._bound_of(largest, BoundKind.PROVED_ON_CANDIDATES),
                proved_sensitivities=largest,
                without_cell=beyond,
            )
        largest = self.searched_sensitivities.or_larger(own)
        if (largest.values == self.searched_sensitivities.values).all():
            return replace(self, without_cell=beyond)
        return replace(
            self,
            searched_bound=self._bound_of(largest, self.searched_bound.kind),
            searched_sensitivities=largest,
            without_cell=beyond,
        )

    def _bound_of(self, largest: LargestSensitivities, kind: BoundKind) -> Bound:
        """The bound that follows from the largest sensitivities."""
        cost = self.criterion.lower_bound(self.multipliers, largest.values, self.information)
        return Bound.of(self.criterion, cost, self.cost, kind)

    @property
    def certified(self) -> "RelaxedPlan":
        """What a certificate is about: the relaxation over all poses, free or not."""
        return self if self.without_cell is None else self.without_cell

    @property
    def on_candidates(self) -> "RelaxedPlan":
        """The same with the bound alone that is proved on candidates."""
        beyond = self.without_cell
        return replace(
            self,
            searched_bound=None,
            searched_sensitivities=None,
            without_cell=None if beyond is None else beyond.on_candidates,
        )

    @property
    def information(self) -> Array:
        """Information matrix (p, p) of one experiment's worth of this design."""
        return self.space.problem(self.x).information(self.weights)

    @property
    def plan(self) -> Plan:
        """Poses and wrenches, the heaviest first, once each."""
        order = self._heaviest_first
        return self.space.plan(self.x[order], np.ones(len(order), dtype=int))

    @property
    def _heaviest_first(self) -> Indices:
        """Indices (k,) of the experiments in the order in which people and files see them."""
        return np.argsort(-self.weights, kind="stable")

    def certify(self) -> tuple[float, float]:
        """Compute cost and proved bound anew, from poses, weights and multipliers alone.

        All candidates are generated again, and so are their sensitivities.

        Returns:
            Cost, and a lower bound on the cost of every design over candidates and poses.
        """
        largest = np.full(len(self.multipliers), -np.inf)
        for x in (self.x, *(part.x for part in self.source.chunks(self.candidates))):
            problem = normalised(self.space.problem(x), self.criterion)
            largest = np.maximum(largest, problem.sensitivities(self.multipliers).max(axis=1))
        M = self.information
        bound = self.criterion.lower_bound(self.multipliers, largest, M)
        return float(self.criterion.cost(M)), bound

    def to_frame(self) -> "pd.DataFrame":
        """Make a table with a pose a row, the heaviest first, and its weight in the last column.

        Joint variables are in degrees or millimetres; wrenches, in newtons and newton metres, have
        columns where they are designed too.
        """
        frame = self.plan.to_frame(self.space.workspace.robot).drop(columns="repeats")
        if not self.space.load.limits.size:
            frame = frame.drop(columns=list(wrench_columns(self.plan.wrench)))
        return frame.assign(weight=self.weights[self._heaviest_first])

    def to_csv(self, path: Path | str) -> None:
        """Write `to_frame` to a file, whole or not at all."""
        write_text(path, csv_text(self.to_frame()))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON: as a person reads them, and exactly under the key `exact`.

        The support has the heaviest pose first, with its angles in degrees. The exact part has
        costs, and design variables in the order of this plan.
        """
        searched = self.sharper_search
        return {
            "criterion": self.criterion.name,
            "value": self.value,
            "bound": _finite(self.bound),
            "gap": self.gap,
            "bound_searched": None if searched is None else _finite(searched.value),
            "bounds": printed_bounds(self.bounds),
            "candidates": self.candidates,
            "support": self._support(),
            "multipliers": self.multipliers.tolist(),
            "seed": self.source.seed,
            "sampling": self.source.sampling,
            "solver": self.solver,
            "iterations": self.iterations,
            "seconds": self.seconds,
            **({} if self.ended == "proved" else {"ended": self.ended}),
            **self._without_cell(),
            "exact": self._exact(),
        }

    @classmethod
    def from_dict(
        cls, source: CandidateSource, criterion: Relaxable, data: Mapping[str, Any]
    ) -> "RelaxedPlan":
        """Make the plan that `to_dict` has written, the same to the last bit.

        Args:
            source: Where the candidates come from; the numbers do not contain the robot.
            criterion: What was minimised.
            data: The numbers. The seconds may be missing.

        Raises:
            KeyError: Another entry is missing.
        """
        exact = data["exact"]
        cost = exact["cost"]
        proved = Bound.of(criterion, exact["bound"], cost, BoundKind.PROVED_ON_CANDIDATES)
        searched = None
        searched_sensitivities = None
        if exact["bound_searched"] is not None:
            searched = Bound.of(criterion, exact["bound_searched"], cost, BoundKind.SEARCHED)
            searched_sensitivities = LargestSensitivities.from_dict(exact["searched_sensitivities"])
        return cls(
            source=source,
            candidates=data["candidates"],
            criterion=criterion,
            x=np.array(exact["x"]),
            weights=np.array(exact["weights"]),
            cost=cost,
            proved_bound=proved,
            searched_bound=searched,
            multipliers=np.array(data["multipliers"]),
            proved_sensitivities=LargestSensitivities.from_dict(exact["proved_sensitivities"]),
            searched_sensitivities=searched_sensitivities,
            solver=data["solver"],
            iterations=data["iterations"],
            seconds=data.get("seconds", {}),
            without_cell=cls.from_dict(source.without_cell, criterion, data["without_cell"])
            if "without_cell" in data
            else None,
        )

    def _without_cell(self) -> dict[str, Any]:
        """The relaxation over poses that may touch something, where there is a cell."""
        return {} if self.without_cell is None else {"without_cell": self.without_cell.to_dict()}

    def _support(self) -> list[dict[str, Any]]:
        """Pose, wrench and weight of each experiment, the heaviest first."""
        plan = self.plan
        robot = self.space.workspace.robot
        shown = robot.shown(plan.q) / pose_factors(robot)
        weights = self.weights[self._heaviest_first]
        return [
            {"q_deg": q.tolist(), "wrench": W.tolist(), "weight": float(weight)}
            for q, W, weight in zip(shown, plan.wrench, weights, strict=True)
        ]

    def _exact(self) -> dict[str, Any]:
        """Costs, bounds and what they follow from, besides the multipliers."""
        bound = self.searched_bound
        sensitivities = self.searched_sensitivities
        return {
            "cost": self.cost,
            "bound": self.proved_bound.cost,
            "bound_searched": None if bound is None else bound.cost,
            "x": self.x.tolist(),
            "weights": self.weights.tolist(),
            "proved_sensitivities": self.proved_sensitivities.to_dict(),
            "searched_sensitivities": None if sensitivities is None else sensitivities.to_dict(),
        }


def _finite(number: float) -> float | None:
    """The number for JSON: None for a bound that says nothing."""
    return number if np.isfinite(number) else None
