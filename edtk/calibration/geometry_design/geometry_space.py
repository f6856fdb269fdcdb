"""Where experiments of a study of geometry may lie: poses, without and with a load."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.calibration.geometry.study_geometry import StudyLoads
from edtk.calibration.geometry_design.position_rows import PositionRows
from edtk.design.candidate_arrays import rows_of_blocks
from edtk.design.design_space import DesignSpace
from edtk.design.experiments import Experiments
from edtk.design.plan import Plan
from edtk.design.problem import Problem
from edtk.inference.geometry.position_noise import PositionNoise
from edtk.model.geometry.geometric_model import GeometricModel
from edtk.model.loads.fixed_load import FixedLoad
from edtk.model.loads.listed_load import ListedLoad
from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False, kw_only=True)
class GeometrySpace(DesignSpace):
    """A design space whose experiments are visits of a pose, each under one of the study's loads.

    Design variables are the joints, then the index of the load where there are several; the first
    load is none. What a visit tells are the positions of all markers, and their orientations where
    the study measures full poses: the rows, r for each marker, of `PositionRows`. Candidates are
    kept as rows: parameters of geometry are nearly dependent, and squares would lose their digits.

    Args:
        geometry: Markers and parameters, in the parameters' own units.
        errors: The errors of a visit.
        loads: What loads the joints; None without springs.
        prices: What a visit costs under each load (loads,): the information of a candidate is then
            that for one unit of costs; None where visits are counted.
    """

    geometry: GeometricModel
    errors: PositionNoise
    loads: StudyLoads | None
    prices: Array | None = None

    @property
    def p(self) -> int:
        """Number of parameters."""
        return self.geometry.p

    @property
    def parameters(self) -> tuple[str, ...]:
        """Their names (p,)."""
        return tuple(one.name for one in self.geometry.parameters)

    @property
    def doubles(self) -> int:
        """Numbers that say what a candidate tells: those of its rows."""
        return self.geometry.row_count * len(self.geometry.markers) * self.p

    def at(self, x: Array) -> "GeometryExperiments":
        """The experiments of design variables x (..., v)."""
        return GeometryExperiments(self, x, self.model.frames(x[..., : len(self.fixed)]))

    def told(self, experiments: Experiments) -> Array:
        """What experiments (k) tell: rows (r markers, p, k)."""
        return np.moveaxis(experiments.regressor, 0, -1)

    def problem_of(self, told: Array) -> Problem:
        """Make a problem of experiments whose rows (r markers, p, k) are at hand."""
        rows = np.ascontiguousarray(np.moveaxis(told, -1, 0))
        return Problem.of_kept(rows_of_blocks(rows, 1.0), self.parameters, self.prior)

    def information(self, plan: Plan) -> Array:
        """Information matrix (p, p) of a plan under the plan's own wrenches; prices do not count.

        Visits of a pose err each for itself.
        """
        A = self._rows(plan.q, plan.wrench)
        return Problem(A, parameters=self.parameters, prior=self.prior).information(plan.repeats)

    @cached_property
    def _rows(self) -> PositionRows:
        return PositionRows(self.geometry, self.loads, self.errors)

    def with_loads(self, wrenches: Array, chosen: Sequence[int]) -> "GeometrySpace":
        """The same poses under some loads alone.

        Args:
            wrenches: All loads (s, 6) [N, N m].
            chosen: Indices of those that visits may have.
        """
        own = wrenches[list(chosen)]
        return replace(self, load=FixedLoad(own[0]) if len(own) == 1 else ListedLoad(own))

    def load_of(self, x: Array) -> Indices:
        """Index (m,) of the load of each visit x (m, v), among those of this space."""
        u = x[:, len(self.fixed) :]
        return np.rint(u[:, 0]).astype(int) if u.shape[1] else np.zeros(len(x), dtype=int)

    def rows(self, x: Array) -> Array:
        """Whitened rows (m, r markers, p) of experiments x (m, v), for one unit of costs each."""
        q, wrench = self._visits(x)
        return self._rows(q, wrench) * self._shares(x)[:, None, None]

    def slopes(self, x: Array, B: Array) -> Array:
        """Derivatives (m, v) of ``<B, rows>`` by all design variables, weights B held fixed."""
        q, wrench = self._visits(x)
        found = np.zeros(x.shape)
        found[:, : q.shape[1]] = self._rows.slopes(q, wrench, B * self._shares(x)[:, None, None])
        return found

    def _visits(self, x: Array) -> tuple[Array, Array]:
        """Poses (m, n) and wrenches (m, 6) of experiments."""
        n = len(self.fixed)
        return x[:, :n], np.array(self.load.wrench(x[:, n:]))

    def _shares(self, x: Array) -> Array:
        """Factors (m,) of the rows: the root of the part of a visit that one unit of costs pays."""
        if self.prices is None:
            return np.ones(len(x))
        return np.asarray(1.0 / np.sqrt(self.prices[self.load_of(x)]))


@dataclass(frozen=True, eq=False)
class GeometryExperiments(Experiments):
    """Visits x (..., v) of a space of geometry.

    Args:
        space: The design space.
        x: Design variables (..., v).
        frames: Frames of the robot's chain in these poses.
    """

    space: GeometrySpace

    def __getitem__(self, chosen: Indices) -> "GeometryExperiments":
        """The chosen experiments (n, v)."""
        return GeometryExperiments(self.space, self.x[chosen], self.frames[chosen])

    def visited(self, visits: Array) -> "GeometryExperiments":
        """The same experiments: visits share no error."""
        return self

    @cached_property
    def regressor(self) -> Array:
        """Whitened rows (..., r markers, p)."""
        A = self.space.rows(self.x.reshape(-1, self.x.shape[-1]))
        return A.reshape(*self.x.shape[:-1], *A.shape[1:])

    @cached_property
    def _regressor(self) -> Array:
        """The same, component first (p, r markers, ...)."""
        return np.moveaxis(self.regressor, (-1, -2), (0, 1))

    def slope(self, B: Array) -> Array:
        """Derivatives (..., v) of ``<B, A>`` of the whitened rows A, weights B held fixed."""
        flat = self.x.reshape(-1, self.x.shape[-1])
        weights = np.broadcast_to(B, self.regressor.shape).reshape(len(flat), *B.shape[-2:])
        return self.space.slopes(flat, weights).reshape(self.x.shape)
