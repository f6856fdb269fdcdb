"""Where experiments may lie: the design variables of a calibration and their feasible set."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.design.experiments import Experiments
from edtk.design.plan import Plan
from edtk.design.problem import Problem
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.loads.load import Load
from edtk.model.noise.shared_visits import shared_visits
from edtk.model.noise.visit_noise import VisitNoise
from edtk.model.noise.whitener import Whitener
from edtk.model.workspace import Workspace
from edtk.system.typing import Array, Indices

TURNS = 2.0  # to which a joint that turns without end is bounded in a descent


@dataclass(frozen=True, eq=False)
class DesignSpace:
    """Where poses and loads may lie, and how informative a measurement in them is.

    Design variables x (..., v) of an experiment are its joint variables [rad or m], then those of
    its load.

    Args:
        model: The elastostatic model, with the calibration tool.
        workspace: The feasible set of the same robot.
        sigma: Standard deviation of each measured row (rows,) [m, rad], where errors are white.
        load: The wrenches that may be applied.
        free: Indices of the joints that are designed.
        fixed: Joint variables (n,); the entries of `free` joints are ignored.
        prior: Prior information M0 (p, p) per single experiment of a plan, see `Problem`; by
            default there is none. `with_kept` sets it.
        sharing: Number of experiments that share what is known beside them; 0 without a prior.
        noise: Errors that are not white, in place of `sigma`; None for white ones.

    Raises:
        ValueError: A joint is fixed outside its limits.
    """

    model: ElastostaticModel
    workspace: Workspace
    sigma: Array
    load: Load
    free: list[int]
    fixed: Array
    prior: Array | None = None
    sharing: int = 0
    noise: VisitNoise | None = None

    def __post_init__(self) -> None:
        lower, upper = self.workspace.robot.hard_limits
        outside = (self.fixed < lower) | (self.fixed > upper)
        outside[self.free] = False
        if outside.any():
            name = self.workspace.robot.joint_names[int(outside.argmax())]
            raise ValueError(f"joint {name} is fixed outside its limits")

    @property
    def p(self) -> int:
        """Number of parameters."""
        return self.model.p

    @property
    def doubles(self) -> int:
        """Numbers that say what a candidate tells: those of its packed information."""
        return self.p * (self.p + 1) // 2

    @cached_property
    def limits(self) -> Array:
        """Bounds (2, v) of the design variables."""
        robot = self.workspace.robot
        # A descent may go on where one turn ends: what is behind is no other pose.
        turns = np.where(robot.continuous, TURNS, 1.0)
        return np.concatenate([turns * robot.limits, self.load.limits], axis=1)

    @property
    def size(self) -> int:
        """Number v of design variables."""
        return int(self.limits.shape[1])

    @property
    def drawn(self) -> list[int]:
        """Indices of the design variables that are not fixed."""
        return [*self.free, *range(self.workspace.robot.n, self.size)]

    @property
    def movable(self) -> list[int]:
        """Indices of the design variables that a descent may change."""
        return self.drawn if self.load.moves else list(self.free)

    @property
    def labels(self) -> tuple[str, ...]:
        """Names (c,) of the constraints other than the bounds, for messages."""
        return tuple(
            label
            for constraint in self.workspace.constraints
            for label in constraint.labels(self.workspace.robot)
        )

    def at(self, x: Array) -> Experiments:
        """The experiments of design variables x (..., v)."""
        return Experiments(self, x, self.model.frames(x[..., : len(self.fixed)]))

    def draw(self, cube: Array) -> Array:
        """Stretch points of the unit cube (k, len(drawn)) to design variables (k, v)."""
        lower, upper = self.workspace.robot.limits[:, self.free]
        x = np.empty((len(cube), self.size))
        x[:, : len(self.fixed)] = self.fixed
        x[:, self.free] = lower + (upper - lower) * cube[:, : len(self.free)]
        # The load maps its own part of the cube: the index of a listed load is a whole number.
        x[:, len(self.fixed) :] = self.load.draw(cube[:, len(self.free) :])
        return x

    def problem(self, x: Array) -> Problem:
        """Make a problem of arrays with the experiments x (k, v) as its candidates."""
        return self.problem_of(self.told(self.at(x)))

    def told(self, experiments: Experiments) -> Array:
        """What experiments (k) tell, as `problem_of` takes it: packed information, k last."""
        return experiments.packed

    def problem_of(self, told: Array) -> Problem:
        """Make a problem of experiments whose packed information (p(p+1)/2, k) is at hand."""
        return Problem.of_information(told, self.model.parameters, self.prior)

    def plan(self, x: Array, repeats: Indices) -> Plan:
        """Make a plan of the experiments x (k, v) with repetitions (k,)."""
        n = len(self.fixed)
        q = self.workspace.robot.within_one_turn(x[:, :n])
        return Plan(q, np.array(self.load.wrench(x[:, n:])), repeats)

    def information(self, plan: Plan) -> Array:
        """Information matrix (p, p) of a plan under the plan's own wrenches."""
        # A plan from a file may have other loads than this space, and thus no design variables.
        A = self.model.regressor(plan.q, plan.wrench)
        if self.noise is None:
            problem = Problem(A, self.sigma, self.model.parameters, self.prior)
        else:
            A = self._whitened(A, plan, self.noise)
            problem = Problem(A, 1.0, self.model.parameters, self.prior)
        return problem.information(plan.repeats)

    def information_beside(self, kept: Plan | None, plan: Plan) -> Array:
        """Information matrix (p, p) of a plan and the kept experiments, which may share errors.

        Args:
            kept: The experiments that `with_kept` made the prior of this space; None for none.
            plan: The others.
        """
        M = self.information(plan)
        if kept is None or self.noise is None or not self.noise.shares:
            return M
        own = replace(self, prior=None)
        together = own.information(kept + plan)
        return M + (together - own.information(kept) - own.information(plan))

    def _whitened(self, A: Array, plan: Plan, noise: VisitNoise) -> Array:
        """Whitened regressors (k, rows, p) of a plan whose visits may share the discrepancy."""
        frames = self.model.frames(plan.q)
        visits = shared_visits(plan.q, plan.repeats, frames.sliding, noise.within)
        whitener = Whitener.of(noise.covariance_of(self.model, frames, visits))
        return np.moveaxis(whitener.rows(np.moveaxis(A, (-1, -2), (0, 1))), (0, 1), (-1, -2))

    @property
    def alone(self) -> "DesignSpace":
        """The same space, in which each visit has a discrepancy of its own.

        One visit of a pose has the same information in both.
        """
        if self.noise is None or not self.noise.shares:
            return self
        return replace(self, noise=self.noise.alone)

    def with_kept(self, kept: Array, experiments: int) -> "DesignSpace":
        """The design space of further experiments beside kept ones.

        Args:
            kept: Information K (p, p) of the kept experiments.
            experiments: Number m of further experiments. Each has a share ``M0 = K/m`` as its
                prior, so that ``sum_i (M0 + M_i) = K + sum_i M_i``.
        """
        return replace(self, prior=kept / experiments, sharing=experiments)
