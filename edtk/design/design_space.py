"""Where experiments of a robot may lie: design variables, feasible set, and what they tell."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, Self

import numpy as np

from criteria import Criterion
from criteria.linalg.inverse import root
from edtk.cell.cell import Clear
from edtk.cell.sight import AllSeen, Sight
from edtk.design.information import pack_gram
from edtk.design.plan import Plan
from edtk.design.problem import Problem
from edtk.design.weighted_candidates import packed_information
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.noise import VisitNoise, shared_visits
from edtk.measure.whitening import Whitener, WhiteRows, read_alone
from edtk.robots.constraints.constraint import Constraint
from edtk.robots.frames import Frames
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.loads.listed_load import ListedLoad
from edtk.robots.loads.load import Load
from edtk.robots.workspace import Workspace
from edtk.system.typing import Array, Indices, Mask

ENDLESS_TURNS = 2.0  # to which a joint that turns without end is bounded in a descent


class Space(Protocol):
    """A feasible set of experiments: bounds of its variables, and what an experiment tells."""

    @property
    def limits(self) -> Array:
        """Bounds (2, v) of the design variables."""

    @property
    def movable(self) -> list[int]:
        """Indices of the variables that a descent may change."""

    @property
    def prior(self) -> Array | None:
        """Prior information M0 (p, p) per single experiment, or None."""

    @property
    def sight(self) -> Sight | None:
        """Which instruments are read in which poses; None where all are in each."""

    def at(self, x: Array, held: Mask | None = None) -> "Points":
        """The experiments of design variables x (..., v).

        Args:
            x: The variables.
            held: Instruments (k, ...) that alone count, and have to be read; None for those that
                are.
        """


class Points(Protocol):
    """Experiments x (..., v) of a design space: information, slacks, and their derivatives."""

    @property
    def space(self) -> Space:
        """Where the experiments lie."""

    @property
    def x(self) -> Array:
        """Design variables (..., v)."""

    @property
    def regressor(self) -> Array:
        """Whitened rows (..., rows, p)."""

    @property
    def packed(self) -> Array:
        """Information of one measurement each (p(p+1)/2, ...), without the prior."""

    @property
    def slack(self) -> Array:
        """Slacks (..., c) of the constraints other than the bounds; negative means infeasible."""

    @property
    def slack_gradient(self) -> Array:
        """Derivatives (..., c, v) of the slacks."""

    @property
    def feasible(self) -> Mask:
        """Whether each experiment (...) satisfies all constraints, the bounds included."""

    def visited(self, visits: Array) -> "Points":
        """The same experiments, whose repeats may share an error."""

    def information(self, repeats: Array) -> Array:
        """Information matrices (b, p, p) of plans (b, k), the prior included."""

    def slope(self, B: Array) -> Array:
        """Derivatives (..., v) of ``<B, A>`` of the whitened rows A, weights B held fixed."""


@dataclass(frozen=True, eq=False)
class Experiments:
    """Experiments x (..., v) of a design space.

    All quantities share the same frames, which are computed once. Arrays are kept component first
    inside, since sums over few components of many experiments are fastest that way.

    Args:
        space: The design space.
        x: Design variables (..., v).
        frames: Frames of the robot's chain in these poses.
        visits: Visits (...) of each pose, which share its discrepancy; None for one each.
        held: Instruments (k, ...) that alone count, and that have to be read; None for those that
            are read.
    """

    space: "DesignSpace"
    x: Array
    frames: Frames
    visits: Array | None = None
    held: Mask | None = None

    def __getitem__(self, chosen: Indices) -> "Experiments":
        """The chosen experiments (n, v); nothing is computed anew."""
        visits = None if self.visits is None else self.visits[chosen]
        held = None if self.held is None else self.held[:, chosen]
        return Experiments(self.space, self.x[chosen], self.frames[chosen], visits, held)

    def visited(self, visits: Array) -> "Experiments":
        """The same experiments, each of which is one of so many visits of its pose.

        The experiments themselves where visits share no error, see `VisitNoise`.

        Args:
            visits: Numbers of visits, which broadcast to (...); below one they count as one.
        """
        noise = self.space.noise
        if noise is None or not noise.shares:
            return self
        shape = self.x.shape[:-1]
        return replace(self, visits=np.broadcast_to(np.maximum(visits, 1.0), shape))

    @cached_property
    def _read(self) -> Mask | None:
        """Which rows (rows, ...) there are; None for all."""
        sight = self.space.sight
        if sight is None:
            return None
        if self.held is None:
            return sight.rows_in(self.frames)
        return np.repeat(self.held, sight.widths, axis=0)

    @cached_property
    def _constraints(self) -> tuple[Constraint, ...]:
        """All constraints other than the bounds: what is held has to be read."""
        if self.space.sight is None or self.held is None:
            return self.space.constraints
        return (*self.space.constraints, AllSeen(self.space.sight, self.held))

    @property
    def _load(self) -> Array:
        """Variables (..., d) of the load."""
        return self.x[..., len(self.space.fixed) :]

    @cached_property
    def _whitener(self) -> Whitener | WhiteRows:
        """What makes errors of unit covariance of those of a measurement."""
        noise = self.space.noise
        if noise is None:
            return WhiteRows(self.space.sigma)
        Sigma = noise.covariance_of(self.space.model, self.frames, self._wrench, self._visits)
        return Whitener.of(Sigma if self._read is None else read_alone(Sigma, self._read))

    @property
    def _visits(self) -> Array | float:
        """Visits (...) of each pose that share an error."""
        return 1.0 if self.visits is None else self.visits

    @cached_property
    def _wrench(self) -> Array:
        """Loads (..., 6) or (6,) [N, N m]."""
        return self.space.load.wrench(self._load)

    @cached_property
    def _regressor(self) -> Array:
        """Whitened regressors, ``A/sigma`` or ``L^-1 A`` (p, rows, ...), component first."""
        A = self.space.model.regressor_of(self.frames, self._wrench)
        if self._read is not None:
            A = A * self._read
        A = self._whitener.rows(A)
        return A if self.space.prices is None else A * self.space.shares(self.x)

    @cached_property
    def regressor(self) -> Array:
        """Whitened regressors (..., rows, p): ``A/sigma``, or ``L^-1 A`` with ``Sigma = L L'``."""
        return _batch_first(self._regressor, (1, 0))

    @property
    def packed(self) -> Array:
        """Information ``A' Sigma^-1 A`` of one measurement each, packed (p(p+1)/2, ...).

        The prior of the design space is no part of it; it enters by `DesignSpace.problem`.
        """
        return pack_gram(self._regressor)

    def information(self, repeats: Array) -> Array:
        """Information matrices of plans, the prior included.

        Repeats share the discrepancy of their own pose; different poses count as far apart.

        Args:
            repeats: Repetitions (b, k) of b plans of k experiments, where x is (b, k, v).

        Returns:
            Matrices (b, p, p).
        """
        regressor = self.visited(repeats).regressor
        return weighted_information(regressor, repeats, self.space.prior)

    def slope(self, B: Array) -> Array:
        """Derivatives of ``<B, A_w>`` by all design variables, weights B held fixed.

        ``A_w = A/sigma`` are the whitened rows. A is linear in the wrench, but for the part of
        weights that hang on the arm, so that the derivative by a variable of the load is
        ``<B, A(dW)/sigma>`` with dW the derivative of the wrench.

        Where errors are correlated, ``A_w = L^-1 A`` with ``Sigma = L L'``, and B must be such that
        ``B A_w'`` is symmetric. It is for ``B = A_w G`` with symmetric G, from differentials of
        information ``<G, dM> = 2 <A_w G, dA_w>``. Then it does not matter how L turns, and

            d<B, A_w> = <L^-T B, dA> - <L^-T B A_w' L^-1, dSigma> / 2.

        Args:
            B: Weights (..., rows, p); of correlated rows see above.

        Returns:
            Array (..., v).
        """
        space = self.space
        model = space.model
        if space.prices is not None:
            B = B * space.shares(self.x)[..., None, None]
        if self._read is not None:
            B = B * np.moveaxis(self._read, 0, -1)[..., None]
        # All derivatives by joints come from one adjoint pass with these weights.
        weights = self._whitener.transposed(_component_first(B, (-1, -2)))
        by_joint = model.regressor_slope_of(self.frames, self._wrench, weights)
        wrench_changes = _component_first(space.load.derivative(self._load), (-1,))
        by_load = [
            (weights * model.by_wrench.regressor_of(self.frames, change)).sum(axis=(0, 1))
            for change in wrench_changes
        ]
        if isinstance(self._whitener, Whitener):
            of_noise, of_its_load = self._noise_slope(weights, self._whitener, wrench_changes)
            by_joint = by_joint + of_noise
            by_load = [own + more for own, more in zip(by_load, of_its_load, strict=True)]
        # Without a load to design by_load is empty, and reshape gives it the missing axes.
        by_load_too = np.array(by_load).reshape(-1, *by_joint.shape[1:])
        return _batch_first(np.concatenate([by_joint, by_load_too]), (0,))

    def _noise_slope(
        self, weights: Array, whitener: Whitener, wrench_changes: Array
    ) -> tuple[Array, list[Array]]:
        """``-<P Q', dSigma>/2``, of P = L^-T B and Q = Sigma^-1 A.

        Returns:
            Derivatives by all joints (n, ...), and by each change of the wrench (...).
        """
        noise, model = self.space.noise, self.space.model
        assert noise is not None
        by_covariance = whitener.slope_weights(weights, self._regressor)
        given = (model, self.frames, by_covariance, self._wrench)
        changes = [model.by_wrench.torque_of(self.frames, change) for change in wrench_changes]
        return (
            noise.slope_of(*given, visits=self._visits),
            noise.load_slope_of(*given, changes, visits=self._visits),
        )

    @property
    def slack(self) -> Array:
        """Slacks (..., c) of the constraints other than the bounds; negative means infeasible."""
        none = np.zeros((*self.x.shape[:-1], 0))
        constraints = self._constraints
        own = [_batch_first(constraint.slack(self.frames), (0,)) for constraint in constraints]
        return np.concatenate([none, *own], axis=-1)

    @property
    def slack_gradient(self) -> Array:
        """Derivative (..., c, v) of the slacks by all design variables."""
        gradients = [
            _batch_first(constraint.gradient(self.frames), (0, 1))
            for constraint in self._constraints
        ]
        count = sum(one.shape[-2] for one in gradients)
        G = np.zeros((*self.x.shape[:-1], count, self.space.size))
        if gradients:
            G[..., : len(self.space.fixed)] = np.concatenate(gradients, axis=-2)
        return G

    @property
    def feasible(self) -> Mask:
        """Whether each experiment (...) satisfies all constraints, the bounds included."""
        lower, upper = self.space.limits
        within = ((self.x >= lower) & (self.x <= upper)).all(axis=-1)
        return np.asarray(within & (self.slack >= 0).all(axis=-1))


def weighted_information(A: Array, repeats: Array, prior: Array | None) -> Array:
    """Information matrices ``sum_i r_i (M0 + A_i' A_i)`` (b, p, p) of plans.

    Args:
        A: Whitened regressors (b, k, rows, p).
        repeats: Repetitions r (b, k).
        prior: Prior information M0 (p, p), or None.
    """
    # The rows of a plan are stacked, so that one product of matrices sums over poses and rows.
    stacked = _stacked(A, repeats)
    M = np.swapaxes(stacked, 1, 2) @ stacked
    return M if prior is None else M + repeats.sum(axis=1)[:, None, None] * prior


def _stacked(A: Array, repeats: Array) -> Array:
    """Rows (..., k rows, p) of plans (..., k), each times the root of its repetitions."""
    weighted = A * np.sqrt(repeats)[..., None, None]
    return weighted.reshape(*repeats.shape[:-1], -1, A.shape[-1])


def plan_costs(criterion: Criterion, experiments: Points, repeats: Array) -> Array:
    """Costs (b,) of plans (b, k), see `Criterion.cost_by_rows`.

    A descent goes by the cost of M, in which a nearly singular plan seems better than it is by
    rounding; what a search compares shall not.

    Args:
        criterion: What is minimised.
        experiments: Those of the plans.
        repeats: Their repetitions (b, k).
    """
    A = experiments.visited(repeats).regressor
    prior = experiments.space.prior

    def rows(i: int) -> Array:
        return _with_prior(_stacked(A[i], repeats[i]), repeats[i], prior)

    return criterion.cost_by_rows(weighted_information(A, repeats, prior), rows)


def _with_prior(rows: Array, repeats: Array, prior: Array | None) -> Array:
    """Rows (n, p) of a plan, and those of the prior of each of its experiments."""
    if prior is None:
        return rows
    return np.concatenate([rows, np.sqrt(repeats.sum()) * root(prior)])


def _batch_first(A: Array, last: tuple[int, ...]) -> Array:
    """A view of component-first A whose leading axes come last, in this order."""
    return A.transpose(*range(len(last), A.ndim), *last)


def _component_first(A: Array, last: tuple[int, ...]) -> Array:
    """A view of batch-first A whose last axes, counted from the end, come first, in this order."""
    return A.transpose(*last, *range(A.ndim - len(last)))


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
        prices: What an experiment costs under each of several loads (loads,): the information of an
            experiment is then that for one unit of costs; None where experiments are counted.
        sight: Which instruments are read in which poses; None where all are in each.
        clear: Keeps poses free of what stands in the cell; None without a cell.

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
    prices: Array | None = None
    sight: Sight | None = None
    clear: Clear | None = None

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
    def parameters(self) -> tuple[str, ...]:
        """Their names (p,)."""
        return self.model.parameters

    @property
    def units(self) -> tuple[str, ...]:
        """Their units (p,)."""
        return self.model.units

    @property
    def doubles(self) -> int:
        """Numbers that say what a candidate tells: those of its packed information."""
        return self.p * (self.p + 1) // 2

    @cached_property
    def limits(self) -> Array:
        """Bounds (2, v) of the design variables."""
        robot = self.workspace.robot
        # A descent may go on where one turn ends: what is behind is no other pose.
        turns = np.where(robot.continuous, ENDLESS_TURNS, 1.0)
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
            for constraint in self.constraints
            for label in constraint.labels(self.workspace.robot)
        )

    def with_loads(self, wrenches: Array, chosen: Sequence[int]) -> Self:
        """The same poses under some loads alone.

        Args:
            wrenches: All loads (s, 6) [N, N m].
            chosen: Indices of those that experiments may have.
        """
        own = wrenches[list(chosen)]
        return replace(self, load=FixedLoad(own[0]) if len(own) == 1 else ListedLoad(own))

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """All constraints other than the bounds; that of the cell, which takes longest, is last."""
        beside = self.workspace.beside_limits
        return beside if self.clear is None else (*beside, self.clear)

    @cached_property
    def without_cell(self) -> Self:
        """The same space, in which poses may touch what stands in the cell."""
        return self if self.clear is None else replace(self, clear=None)

    def load_of(self, x: Array) -> Indices:
        """Index (...) of the load of experiments x (..., v), of those that are listed."""
        u = x[..., len(self.fixed) :]
        return np.rint(u[..., 0]).astype(int) if u.shape[-1] else np.zeros(x.shape[:-1], dtype=int)

    def shares(self, x: Array) -> Array:
        """Factors (...) of rows: the root of what one unit of costs pays of an experiment."""
        if self.prices is None:
            return np.ones(x.shape[:-1])
        return np.asarray(1.0 / np.sqrt(self.prices[self.load_of(x)]))

    def at(self, x: Array, held: Mask | None = None) -> Experiments:
        """The experiments of design variables x (..., v), see `Space`."""
        frames = self.model.frames(x[..., : len(self.fixed)], self._bodies)
        return Experiments(self, x, frames, held=held)

    @cached_property
    def _bodies(self) -> frozenset[int]:
        """Joints whose bodies may touch something, or carry or hide a marker."""
        seen = () if self.sight is None else self.sight.bodies_in_beams
        touching = () if self.clear is None else self.clear.cell.carriers
        return frozenset([*seen, *touching])

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
        # What a model has computed may have roundings in the place of zeros.
        return Problem.of_kept(packed_information(told), self.model.parameters, self.prior)

    def plan(self, x: Array, repeats: Indices) -> Plan:
        """Make a plan of the experiments x (k, v) with repetitions (k,)."""
        n = len(self.fixed)
        q = self.workspace.robot.within_one_turn(x[:, :n])
        return Plan(q, np.array(self.load.wrench(x[:, n:])), repeats)

    def information(self, plan: Plan) -> Array:
        """Information matrix (p, p) of a plan under the plan's own wrenches; prices do not count.

        Visits of poses near each other share what the model leaves out, see `shared_visits`.
        """
        A = self.rows_of(plan)
        return Problem(A, parameters=self.parameters, prior=self.prior).information(plan.repeats)

    def rows_of(self, plan: Plan) -> Array:
        """Whitened rows (k, rows, p) of a plan's visits, see `information`."""
        # A plan from a file may have other loads than this space, and thus no design variables.
        A = self.model.regressor(plan.q, plan.wrench)
        if self.sight is not None:
            A = A * self.sight.rows(plan.q)[..., None]
        if self.noise is None:
            return np.asarray(A / self.sigma[:, None])
        return self._whitened(A, plan, self.noise)

    def cost(
        self, criterion: Criterion, plan: Plan, kept: Plan | None = None, known: Array | None = None
    ) -> float:
        """The cost of a plan, with all digits that its rows have.

        Args:
            criterion: A criterion.
            plan: The plan.
            kept: Further experiments, see `information_beside`.
            known: Information (p, p) that counts besides; None for none.
        """
        repeats = plan.repeats.astype(float)
        M = self.information_beside(kept, plan)
        if known is not None:
            M = M + known
        if kept is not None and self.shares_errors:
            return float(criterion.cost(M))

        def rows(_: int) -> Array:
            own = _with_prior(_stacked(self.rows_of(plan), repeats), repeats, self.prior)
            return own if known is None else np.concatenate([own, root(known)])

        return float(criterion.cost_by_rows(M, rows))

    @property
    def shares_errors(self) -> bool:
        """Whether visits of poses near each other share what the model leaves out."""
        return self.noise is not None and self.noise.shares

    def information_beside(self, kept: Plan | None, plan: Plan) -> Array:
        """Information matrix (p, p) of a plan and the kept experiments, which may share errors.

        Args:
            kept: The experiments that `with_kept` made the prior of this space; None for none.
            plan: The others.
        """
        M = self.information(plan)
        if kept is None or not self.shares_errors:
            return M
        own = replace(self, prior=None)
        together = own.information(kept + plan)
        return M + (together - own.information(kept) - own.information(plan))

    def _whitened(self, A: Array, plan: Plan, noise: VisitNoise) -> Array:
        """Whitened regressors (k, rows, p) of a plan whose visits may share the discrepancy."""
        frames = self.model.frames(plan.q)
        visits = shared_visits(plan.q, plan.repeats, frames.sliding, noise.within, plan.wrench)
        Sigma = noise.covariance_of(self.model, frames, plan.wrench, visits)
        if self.sight is not None:
            Sigma = read_alone(Sigma, self.sight.rows_in(frames))
        whitener = Whitener.of(Sigma)
        return np.moveaxis(whitener.rows(np.moveaxis(A, (-1, -2), (0, 1))), (0, 1), (-1, -2))

    @property
    def alone(self) -> "DesignSpace":
        """The same space, in which each visit has a discrepancy of its own.

        One visit of a pose has the same information in both.
        """
        noise = self.noise
        return replace(self, noise=noise.alone) if noise is not None and noise.shares else self

    def with_kept(self, kept: Array, experiments: int) -> "DesignSpace":
        """The design space of further experiments beside kept ones.

        Args:
            kept: Information K (p, p) of the kept experiments.
            experiments: Number m of further experiments. Each has a share ``M0 = K/m`` as its
                prior, so that ``sum_i (M0 + M_i) = K + sum_i M_i``.
        """
        return replace(self, prior=kept / experiments, sharing=experiments)
