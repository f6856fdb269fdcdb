"""Where experiments may lie and what they tell: the design variables of calibration."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from criteria.linalg.triangle import triangle
from edtk.design.packed import pack_gram
from edtk.design.plan import Plan
from edtk.design.problem import Problem
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.frames import Frames
from edtk.model.loads.load import Load
from edtk.model.workspace import Workspace

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DesignSpace:
    """Where poses and loads may lie and what a measurement in them tells.

    Design variables x (..., v) of an experiment are its joint variables [rad or m], then those of its load.

    Args:
        model: The elastostatic model, with the calibration tool.
        workspace: The feasible set of the same robot.
        sigma: Standard deviation of each measured row (rows,) [m, rad].
        load: The wrenches that may be applied.
        free: Indices of the joints that are designed.
        fixed: Joint variables (n,) whose entries outside `free` are kept.
        shared: Information (p, p) that comes with every measurement, whatever its pose; None for none. Experiments
            that are there already are shared out like this: see `beside`.

    Raises:
        ValueError: A joint is fixed outside its limits.
    """

    model: ElastostaticModel
    workspace: Workspace
    sigma: Array
    load: Load
    free: list[int]
    fixed: Array
    shared: Array | None = None

    def __post_init__(self) -> None:
        lower, upper = self.workspace.robot.limits
        outside = (self.fixed < lower) | (self.fixed > upper)
        outside[self.free] = False
        if outside.any():
            name = self.workspace.robot.joint_names[int(outside.argmax())]
            raise ValueError(f"joint {name} is fixed outside its limits")

    @cached_property
    def limits(self) -> Array:
        """Bounds (2, v) of the design variables."""
        return np.concatenate([self.workspace.robot.limits, self.load.limits], axis=1)

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
        """What a person calls each inequality (c,) besides the bounds."""
        return tuple(
            label for c in self.workspace.constraints for label in c.labels(self.workspace.robot)
        )

    def at(self, x: Array) -> "Experiments":
        """The experiments of design variables x (..., v)."""
        return Experiments(self, x, self.workspace.robot.frames(x[..., : len(self.fixed)]))

    def draw(self, cube: Array) -> Array:
        """Design variables (k, v) within the bounds, of points of the unit cube (k, len(drawn))."""
        lower, upper = self.workspace.robot.limits[:, self.free]
        x = np.empty((len(cube), self.size))
        x[:, : len(self.fixed)] = self.fixed
        x[:, self.free] = lower + (upper - lower) * cube[:, : len(self.free)]
        x[:, len(self.fixed) :] = self.load.draw(cube[:, len(self.free) :])
        return x

    def problem(self, x: Array) -> Problem:
        """The experiments x (k, v) as candidates of a problem of arrays."""
        return Problem.of_information(self.at(x).packed, self.model.parameters)

    def plan(self, x: Array, repeats: NDArray[np.int_]) -> Plan:
        """A plan of the experiments x (k, v)."""
        n = len(self.fixed)
        return Plan(x[:, :n], np.array(self.load.wrench(x[:, n:])), repeats)

    def information(self, plan: Plan) -> Array:
        """Information matrix (p, p) of a plan, whatever its wrenches."""
        A = self.model.regressor(plan.q, plan.wrench)
        M = Problem(A, self.sigma, self.model.parameters).information(plan.repeats)
        return M if self.shared is None else M + plan.experiments * self.shared

    def beside(self, kept: Array, experiments: int) -> "DesignSpace":
        """The design of so many experiments more, where others of information kept (p, p) are there already.

        Each new one carries its share of what is there: ``sum_i (M_i + K/m) = K + sum_i M_i``, for m of them.
        """
        return replace(self, shared=kept / experiments)


@dataclass(frozen=True, eq=False)
class Experiments:
    """Experiments x (..., v) of a design; all that is computed rests on the same frames, the chain in these poses."""

    space: DesignSpace
    x: Array
    frames: Frames

    def __getitem__(self, chosen: NDArray[np.int_]) -> "Experiments":
        """Some of experiments (n, v), nothing being computed anew."""
        return Experiments(self.space, self.x[chosen], self.frames[chosen])

    @property
    def _load(self) -> Array:
        return self.x[..., len(self.space.fixed) :]

    @cached_property
    def _regressor(self) -> Array:
        """``A/sigma`` (p, rows, ...), component first."""
        A = self.space.model.regressor_of(self.frames, self.space.load.wrench(self._load))
        return A / self.space.sigma.reshape(-1, *[1] * (A.ndim - 2))

    @cached_property
    def regressor(self) -> Array:
        """``A/sigma`` (..., rows, p)."""
        return batch_first(self._regressor, (1, 0))

    @property
    def packed(self) -> Array:
        """Information ``A' A/sigma^2``, and what is shared, packed (p(p+1)/2, ...)."""
        M = pack_gram(self._regressor)
        if self.space.shared is not None:
            M += self.space.shared[triangle(self.space.model.p)].reshape(-1, *[1] * (M.ndim - 1))
        return M

    def slope(self, B: Array) -> Array:
        """Derivatives (..., v) of ``<B, A/sigma>`` by all design variables, weights B (..., rows, p) held fixed.

        A is linear in the wrench, so that by a load's variable it is ``<B, A(dW)/sigma>``.
        """
        space, model, u = self.space, self.space.model, self._load
        weights = component_first(B / space.sigma[:, None], (-1, -2))
        by_joint = model.regressor_slope_of(self.frames, space.load.wrench(u), weights)
        dW = component_first(space.load.derivative(u), (-1,))
        by_load = [(weights * model.regressor_of(self.frames, w)).sum(axis=(0, 1)) for w in dW]
        return batch_first(
            np.concatenate([by_joint, np.array(by_load).reshape(-1, *by_joint.shape[1:])]), (0,)
        )

    @property
    def slack(self) -> Array:
        """Slacks (..., c) of the constraints besides the bounds; feasible where none is negative."""
        some = [batch_first(c.slack(self.frames), (0,)) for c in self.space.workspace.constraints]
        return np.concatenate([np.zeros((*self.x.shape[:-1], 0)), *some], axis=-1)

    @property
    def slack_gradient(self) -> Array:
        """Derivative (..., c, v) of the slacks."""
        some = [
            batch_first(c.gradient(self.frames), (0, 1)) for c in self.space.workspace.constraints
        ]
        G = np.zeros((*self.x.shape[:-1], len(self.space.labels), self.space.size))
        if some:
            G[..., : len(self.space.fixed)] = np.concatenate(some, axis=-2)
        return G

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Whether each experiment (...) satisfies every constraint, the bounds included."""
        lower, upper = self.space.limits
        within = ((self.x >= lower) & (self.x <= upper)).all(axis=-1)
        return np.asarray(within & (self.slack >= 0).all(axis=-1))


def batch_first(A: Array, last: tuple[int, ...]) -> Array:
    """A view of component-first A whose leading axes come last, in this order."""
    return A.transpose(*range(len(last), A.ndim), *last)


def component_first(A: Array, last: tuple[int, ...]) -> Array:
    """A view of batch-first A whose last axes, counted from the end, come first, in this order."""
    return A.transpose(*last, *range(A.ndim - len(last)))
