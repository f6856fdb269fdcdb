"""What poses of a robot tell, and its constraints, as polynomials in the joints.

Every vector of a chain is affine in ``(1, cos x_j, sin x_j)`` of each joint that turns and in
``(1, x_j)`` of each that slides. So are the motion ``v_j = dy/dx_j`` of a point and the load
``tau_j`` of a joint, which is such a motion times a force that stays. With ``A = [v_j tau_j]`` and
white errors the information is ``M_jk = G_jk T_jk`` with ``G_jk = v_j' Sigma^-1 v_k`` and
``T_jk = tau_j tau_k``: of degree two each. Where the chain makes less of it - turning all that
moves changes no product ``v_j . v_k`` - coefficients vanish, and `Polynomial.trimmed` proves it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np

from edtk.design.design_space import DesignSpace
from edtk.design.enclosure.polynomial import (
    ROUNDOFF,
    NotEnclosedError,
    Polynomial,
    sum_of_products,
    sum_of_squares,
)
from edtk.design.enclosure.space_polynomials import Beam, SpacePolynomials, require_few
from edtk.design.enclosure.tracked import Growth
from edtk.measure.instruments.distance import Distance
from edtk.robots.frames import dot, force_and_torque
from edtk.robots.rotations import ROUNDING
from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class RobotPolynomials(SpacePolynomials):
    """Those of a space of compliances alone: information ``M_jk = G_jk T_jk``.

    Args:
        space: The design space.

    Raises:
        NotEnclosedError: Something of the space is no polynomial; see `Chart.of`.
    """

    def __post_init__(self) -> None:
        model = self.space.model
        pulls = () if model.weights is None else model.weights.pulls
        if pulls or model.gives is not None:
            raise NotEnclosedError(
                "a compensator's load is a root of a polynomial of its joint's angle, and no "
                "polynomial"
            )
        if model.friction is not None:
            raise NotEnclosedError(
                "what friction holds is a root of a polynomial of a joint's load, and no polynomial"
            )
        if self.space.noise is not None and not self._variances.all():
            raise NotEnclosedError(
                "errors of some rows vanish in some poses; expected a part that is white"
            )

    @property
    def unloaded(self) -> bool:
        """Whether weights load the joints anyway."""
        return self.space.model.weights is not None

    @property
    def is_exact(self) -> bool:
        """Whether errors are white, no distance counts as its whole point, and none is hidden."""
        wires = any(isinstance(one, Distance) for one in self.space.model.whole_instruments)
        return self.space.noise is None and not wires and self.space.sight is None

    @property
    def reach(self) -> float:
        """The largest length of the chain and what hangs on it [m]."""
        model = self.space.model
        points = [model.load_point, *(sensor.point for sensor in model.whole_instruments)]
        if model.weights is not None:
            points += model.weights.centers
        levers = self.space.load.wrench(self.chart.bases[:, model.robot.n :])[:, 6:]
        farthest = float(np.abs(levers).sum(axis=1).max(initial=0.0))
        return max(map(model.reach_of, points)) + farthest

    @cached_property
    def beam(self) -> Beam | None:
        """That of the one marker that a tracker sees, of white errors that are alike in its rows.

        None for several markers, and for an instrument that reads turns, too: then errors are
        counted as small as they are anywhere.
        """
        noise = self.space.noise
        if noise is None or noise.tracker is None or self.space.model.row_count != 3:
            return None
        white = np.square(noise.white) + np.square(noise.discrepancy)
        if not noise.tracked or np.ptp(white):
            return None
        along, across = noise.tracker.along, noise.tracker.across
        least = (min(along[0], across[0]), min(along[1], across[1]))
        readings = float(noise.readings)
        growth = Growth(float(white[0]), readings, least, across, float(self._variances.min()))
        squared = sum_of_squares(self._away).trimmed()
        inline = None if least == across else self._inline
        return Beam(growth, squared, inline, len(self.chart.bases), self._nearest**2)

    @cached_property
    def _away(self) -> list[Polynomial]:
        """The beam (3,) of the tracker [m]."""
        assert self.space.noise is not None
        tracker = self.space.noise.tracker
        assert tracker is not None
        point = self.space.model.whole_instruments[0].point
        away = point.position(self.frames) - tracker.position[:, None]
        error = self.steps * sum(self._apart)
        return [self.chart.polynomial(one, error) for one in away]

    @property
    def _nearest(self) -> float:
        """No pose has the marker nearer to the tracker [m]."""
        away, reach = self._apart
        return max(0.0, away - reach - self.steps * (away + reach))

    @cached_property
    def _apart(self) -> tuple[float, float]:
        """How far the tracker is from the world's origin, and its marker at most [m]."""
        assert self.space.noise is not None
        tracker = self.space.noise.tracker
        assert tracker is not None
        reach = self.space.model.reach_of(self.space.model.whole_instruments[0].point)
        return float(np.linalg.norm(tracker.position)), reach

    @cached_property
    def _variances(self) -> Array:
        """Variances (rows,) such that errors are no smaller, in any pose [m^2, rad^2]."""
        noise = self.space.noise
        if noise is None:
            return np.square(self.space.sigma)
        model = self.space.model
        least = noise.least([model.reach_of(one.point) for one in model.whole_instruments])
        return np.asarray(np.square(least.white) + np.square(least.discrepancy))

    @cached_property
    def _motion(self) -> list[list[Polynomial]]:
        """Whitened motions (p, rows) of the unknown joints; of a distance, those of its point.

        A distance moves by ``u . v_j``, and ``(u . v)^2 <= |v|^2``: its point tells no less.
        """
        model = self.space.model
        rows = []
        first = 0
        for sensor in model.whole_instruments:
            last = first + sensor.rows
            if isinstance(sensor, Distance):
                motion = self.frames.folded(sensor.point.linear(self.frames))
                variances = np.repeat(self._variances[first:last], 3)
            else:
                motion = self.frames.folded(sensor.motion(self.frames))
                variances = self._variances[first:last]
            rows.append(motion / np.sqrt(variances)[:, None])
            first = last
        every = np.concatenate(rows, axis=1)[model.joints]
        least = np.sqrt(self._variances.min())
        error = self.steps * self.folds * max(self.reach, 1.0) / least
        return [[self.chart.polynomial(row, error) for row in joint] for joint in every]

    @cached_property
    def gram(self) -> dict[tuple[int, int], Polynomial]:
        """``G_jk = v_j' Sigma^-1 v_k`` of parameters j <= k."""
        return _products(self._motion)

    @cached_property
    def _inline_gram(self) -> dict[tuple[int, int], Polynomial]:
        """``b'v_j b'v_k`` of the beam b and whitened motions v_j, as those of `gram`."""
        along = [_dot(self._away, v).trimmed() for v in self._motion]
        return _products([[one] for one in along])

    @cached_property
    def loads(self) -> list[dict[tuple[int, int], Polynomial]]:
        """``T_jk = tau_j tau_k`` of parameters j <= k, for each objective."""
        return [self._loads_of(base) for base in self.chart.bases]

    def _torque(self, wrench: Array) -> Array:
        """Loads (n, m) of all joints, as `ElastostaticModel.torque_of` but for what it rounds off.

        Args:
            wrench: Forces and torques (m, 6 or 9) in the poses of the chart's nodes.
        """
        model = self.space.model
        F, T = force_and_torque(wrench, self.frames)
        point = model.load_point.of_load(wrench)
        torque = dot(point.linear(self.frames), F) + dot(point.angular(self.frames), T)
        if model.weights is not None:
            torque += model.weights.torque(self.frames)
        return self.frames.folded(torque)

    def _loads_of(self, base: Array) -> dict[tuple[int, int], Polynomial]:
        """The same of one setting of the load."""
        model = self.space.model
        u = (self.chart.nodes() @ self.chart.matrix.T + base)[:, model.robot.n :]
        wrench = self.space.load.wrench(u)
        torque = self._torque(wrench)[model.joints]
        size = self.reach * np.abs(wrench[:, :3]).sum(axis=1) + np.abs(wrench[:, 3:6]).sum(axis=1)
        if model.weights is not None:
            force = np.abs(model.weights.force(self.frames)).sum(axis=1).max()
            size = size + self.reach * float(force)
        error = self.steps * self.folds * float(size.max())
        tau = [self.chart.polynomial(one, error) for one in torque]
        return {(j, k): (tau[j] * tau[k]).trimmed() for j, k in self.gram}

    @cached_property
    def told(self) -> Indices:
        """The largest degrees of a ``G_jk T_jk``, and of what a beam adds to them."""
        grams = [self.gram]
        every = []
        if self.beam is not None:
            every.append(self.beam.squared.degrees)
            grams += [] if self.beam.inline is None else [self._inline_gram]
        pairs = [(G[pair], T[pair]) for G in grams for T in self.loads for pair in G]
        every += [tuple(_degrees(f, g)) for f, g in pairs]
        return np.asarray(np.max(every, axis=0))

    def sensitivity(self, Z: Array, objective: int = 0) -> Polynomial:
        """``tr(Z A' Sigma^-1 A)`` in all variables of the chart, Z (p, p) symmetric."""
        return self._information(self.gram, Z, objective)

    def _inline(self, Z: Array, objective: int) -> Polynomial:
        """``<Z, A'b b'A>`` of the beam b."""
        return self._information(self._inline_gram, Z, objective)

    def _information(
        self, gram: dict[tuple[int, int], Polynomial], Z: Array, objective: int
    ) -> Polynomial:
        """``sum_jk Z_jk G_jk T_jk``."""
        T = self.loads[objective]
        share = self.space.shares(self.chart.bases[objective]) ** 2
        terms = [
            (float(share) * float(Z[j, k]) * (1.0 if j == k else 2.0), G, T[j, k])
            for (j, k), G in gram.items()
            if Z[j, k] and G.coefficients.any() and T[j, k].coefficients.any()
        ]
        if not terms:
            return Polynomial.constant(self.chart.axes, 0.0)
        degrees = np.max([_degrees(f, g) for _, f, g in terms], axis=0)
        require_few(self.chart.axes, degrees)
        return sum_of_products(terms)

    @cached_property
    def sizes(self) -> Array:
        """The largest ``G_jj T_jj``."""
        found = [
            self.gram[j, j].size * max(T[j, j].size for T in self.loads)
            for j in range(self.space.p)
        ]
        return np.array(found)


def _dot(one: list[Polynomial], other: list[Polynomial]) -> Polynomial:
    """``one'other`` of vectors."""
    return sum_of_products([(1.0, f, g) for f, g in zip(one, other, strict=True)])


def _products(vectors: list[list[Polynomial]]) -> dict[tuple[int, int], Polynomial]:
    """``v_j'v_k`` of vectors j <= k."""
    each = range(len(vectors))
    return {(j, k): _dot(vectors[j], vectors[k]).trimmed() for j in each for k in each if j <= k}


def _degrees(f: Polynomial, g: Polynomial) -> Indices:
    """Degrees of a product; zero where a factor is zero."""
    vanishes = not f.coefficients.any() or not g.coefficients.any()
    return np.zeros(len(f.axes), dtype=int) if vanishes else np.add(f.degrees, g.degrees)


@dataclass(frozen=True, eq=False)
class RowPolynomials(SpacePolynomials):
    """Those of a space whose whitened rows are polynomials: ``sum_r a_r' Z a_r`` of the rows a_r.

    Args:
        space: The design space.
        rows: Rows (m, r, p) of experiments (m, v).
        order: How many vectors of the chain are multiplied in a row.
        largest: How large the entries (p,) of a row can be where each vector has its full length:
            their roundings are relative to it.
        lever: The largest length of the chain and what hangs on it [m].
        is_white: Whether these rows are those of the space; else they tell no less.
    """

    rows: Callable[[Array], Array]
    order: int
    largest: Array
    lever: float
    is_white: bool

    @property
    def unloaded(self) -> bool:
        """Geometry is read without any load, too."""
        return True

    @property
    def is_exact(self) -> bool:
        """Whether errors are white in the space, too."""
        return self.is_white

    @property
    def reach(self) -> float:
        """The largest length of the chain and what hangs on it [m]."""
        return self.lever

    @cached_property
    def entries(self) -> list[list[list[Polynomial]]]:
        """The rows' entries, for each objective, row and parameter."""
        return [self._entries_of(base) for base in self.chart.bases]

    def _entries_of(self, base: Array) -> list[list[Polynomial]]:
        """The same of one setting of the load."""
        samples = self.rows(self.chart.nodes(self.order) @ self.chart.matrix.T + base)
        each = 2 * self.order * (self.steps + ROUNDING)  # small loads are set to zero
        errors = each * self.folds**self.order * self.largest
        return [
            [
                self.chart.polynomial(samples[:, r, i], float(errors[i]), self.order)
                for i in range(self.space.p)
            ]
            for r in range(samples.shape[1])
        ]

    @cached_property
    def told(self) -> Indices:
        """Degrees of the sensitivity of a multiplier that has no symmetry of its own."""
        every = [self._whole(self._generic, k).trimmed() for k in range(len(self.chart.bases))]
        return np.asarray(np.max([f.degrees for f in every], axis=0))

    @cached_property
    def sizes(self) -> Array:
        """The largest sums of squares of the entries."""
        every = [[[f.size**2 for f in row] for row in rows] for rows in self.entries]
        return np.asarray(np.sum(every, axis=1).max(axis=0))

    def sensitivity(self, Z: Array, objective: int = 0) -> Polynomial:
        """``sum_r a_r' Z a_r``; what of it depends on variables that are dropped is an error."""
        whole = self._whole(Z, objective)
        return whole.cut([n if own else 0 for n, own in zip(whole.degrees, self.told, strict=True)])

    def _whole(self, Z: Array, objective: int) -> Polynomial:
        """The same, with all degrees that rows could have."""
        axes = self.chart.axes
        rows = self.entries[objective]
        degrees = 2 * np.max([f.degrees for row in rows for f in row], axis=0)
        require_few(axes, degrees)
        values = np.zeros([axis.size(int(n)) for axis, n in zip(axes, degrees, strict=True)])
        rounding = error = 0.0
        sizes = np.abs(Z)
        for row in rows:
            samples = [f.samples(degrees) for f in row]
            V = np.stack([one.values for one in samples])
            values += np.einsum("i...,i...->...", np.tensordot(Z, V, axes=1), V)
            largest = np.array([one.largest for one in samples])
            off = np.array([one.rounding for one in samples])
            units = (2 * len(row) + 2 + len(rows)) * ROUNDOFF
            rounding += float((2 * largest + off) @ sizes @ off + units * largest @ sizes @ largest)
            own = np.array([f.error for f in row])
            error += float((2 * np.array([f.size for f in row]) + own) @ sizes @ own)
        found = Polynomial.of_samples(axes, values, rounding)
        return replace(found, error=found.error + error)


@runtime_checkable
class Enclosable(Protocol):
    """A space that knows its polynomials itself, as that of a study of geometry does."""

    def polynomials(self) -> SpacePolynomials:
        """Its sensitivities and slacks."""


def polynomials_of(space: DesignSpace) -> SpacePolynomials:
    """The polynomials of a design space.

    Raises:
        NotEnclosedError: Something of it is no polynomial; says what, in one line.
    """
    return space.polynomials() if isinstance(space, Enclosable) else RobotPolynomials(space)
