"""A design over poses: weights instead of repetitions, with the proof of its bound."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from criteria import Relaxable
from edtk.design.bound import Bound, BoundKind, printed_form
from edtk.design.candidate_source import CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.design.plan import Plan
from edtk.design.relaxation.relax import normalised
from edtk.system.atomic_file import atomic_path
from edtk.system.presented import Presented
from edtk.tables.pose_table import WRENCH_COLUMNS, pose_factors

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RelaxedPlan(Presented):
    """Poses and the share of the experiments that each should have, per single experiment.

    Attributes:
        source: Where the candidate poses come from.
        candidates: The bound is proved over the first so many of them, and these poses.
        criterion: What was minimised.
        x: Design variables (k, v) of the experiments.
        weights: Their shares (k,), of sum one.
        cost: The criterion's cost.
        proved_bound: No design over the candidates and these poses has a lower cost.
        searched_bound: Not proved: a bound on designs over all feasible poses, provided that the
            ascents from many starts have found the pose of largest sensitivity; None without a
            search.
        multipliers: What proves the bound (r, p, p), see `Relaxable.lower_bound`.
        solver: The solver whose answer this is.
        iterations: Number of masters that were solved.
        seconds: What took how long [s].
    """

    source: CandidateSource
    candidates: int
    criterion: Relaxable
    x: Array
    weights: Array
    cost: float
    proved_bound: Bound
    searched_bound: Bound | None
    multipliers: Array
    solver: str
    iterations: int
    seconds: dict[str, float] = field(default_factory=dict)

    def headline(self) -> str:
        """Criterion, value, number of poses and proved gap."""
        factor, unit = self.criterion.shown
        value = f"{factor * self.value:.4g} {unit}".rstrip()
        return (
            f"{self.criterion.name} = {value} with weights on {len(self.x)} poses, "
            f"proved gap {max(self.gap, 0.0):.1e}"
        )

    @property
    def space(self) -> DesignSpace:
        """Model, feasible set and noise."""
        return self.source.space

    @property
    def gap(self) -> float:
        """Relative gap ``1 - bound/cost`` of the proved bound."""
        return self.proved_bound.gap_to(self.cost)

    @property
    def best_bound(self) -> Bound:
        """The bound over all poses where one was searched, else the proved one."""
        return self.proved_bound if self.searched_bound is None else self.searched_bound

    @property
    def bound(self) -> float:
        """The proved bound as printed in the criterion's formula."""
        return self.proved_bound.value

    @property
    def information(self) -> Array:
        """Information matrix (p, p) of one experiment's worth of this design."""
        return self.space.problem(self.x).information(self.weights)

    @property
    def value(self) -> float:
        """The criterion as printed in its formula."""
        return printed_form(self.cost, self.criterion.sense)

    @property
    def _heaviest_first(self) -> NDArray[np.int_]:
        """Indices (k,) of the experiments in the order in which people and files see them."""
        return np.argsort(-self.weights, kind="stable")

    @property
    def plan(self) -> Plan:
        """Poses and wrenches, the heaviest first, once each."""
        order = self._heaviest_first
        return self.space.plan(self.x[order], np.ones(len(order), dtype=int))

    @property
    def table(self) -> pd.DataFrame:
        """Poses in degrees and millimetres, wrenches where they are designed too, and weights; the heaviest first."""
        table = self.plan.to_frame(self.space.workspace.robot).drop(columns="repeats")
        if not self.space.load.limits.size:
            table = table.drop(columns=list(WRENCH_COLUMNS))
        return table.assign(weight=self.weights[self._heaviest_first])

    def certify(self) -> tuple[float, float]:
        """Cost and proved bound anew, from poses, weights and multipliers alone: every candidate is priced again."""
        tops = np.full(len(self.multipliers), -np.inf)
        for x in (self.x, *(part.x for part in self.source.chunks(self.candidates))):
            sensitivities = normalised(self.space.problem(x), self.criterion).sensitivities(
                self.multipliers
            )
            tops = np.maximum(tops, sensitivities.max(axis=1))
        M = self.information
        return float(self.criterion.cost(M)), self.criterion.lower_bound(self.multipliers, tops, M)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON: as people read them, and exactly under the key `certificate`.

        The support has the heaviest pose first, with angles in degrees. The certificate has costs,
        and the design variables in the plan's own order.
        """
        plan, weights = self.plan, self.weights[self._heaviest_first]
        searched = self.searched_bound
        degrees = plan.q / pose_factors(self.space.workspace.robot)
        return {
            "criterion": self.criterion.name,
            "value": self.value,
            "bound": _finite(self.bound),
            "gap": self.gap,
            "bound_searched": searched and _finite(searched.value),
            "candidates": self.candidates,
            "support": [
                {"q_deg": q.tolist(), "wrench": W.tolist(), "weight": float(w)}
                for q, W, w in zip(degrees, plan.wrench, weights, strict=True)
            ],
            "multipliers": self.multipliers.tolist(),
            "seed": self.source.seed,
            "sampling": self.source.sampling,
            "solver": self.solver,
            "iterations": self.iterations,
            "seconds": self.seconds,
            "certificate": {
                "cost": self.cost,
                "bound": self.proved_bound.cost,
                "bound_searched": searched and searched.cost,
                "x": self.x.tolist(),
                "weights": self.weights.tolist(),
            },
        }

    @classmethod
    def from_dict(
        cls, source: CandidateSource, criterion: Relaxable, data: dict[str, Any]
    ) -> "RelaxedPlan":
        """The plan that `to_dict` has written, bit by bit.

        Args:
            source: Where the candidates come from; the dictionary has no robot.
            criterion: What was minimised.
            data: The dictionary.

        Raises:
            KeyError: An entry is missing.
        """
        exact = data["certificate"]
        cost = exact["cost"]
        searched = exact["bound_searched"]
        return cls(
            source=source,
            candidates=data["candidates"],
            criterion=criterion,
            x=np.array(exact["x"]),
            weights=np.array(exact["weights"]),
            cost=cost,
            proved_bound=Bound.of(criterion, exact["bound"], cost, BoundKind.PROVED_ON_CANDIDATES),
            searched_bound=None
            if searched is None
            else Bound.of(criterion, searched, cost, BoundKind.SEARCHED),
            multipliers=np.array(data["multipliers"]),
            solver=data["solver"],
            iterations=data["iterations"],
            seconds=data.get("seconds", {}),
        )

    def to_csv(self, path: Path | str) -> None:
        """Write poses in degrees and millimetres, and weights, atomically; the heaviest first."""
        with atomic_path(path) as temporary:
            self.table.to_csv(temporary, index=False, float_format="%.10g")


def _finite(x: float) -> float | None:
    """What JSON can hold: None for a bound that says nothing."""
    return x if np.isfinite(x) else None
