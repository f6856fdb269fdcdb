"""Springs: by how much joints and bearings turn under the torques that load them, and what
unknown numbers of compensators add to these torques.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.measure.parameters import (
    COMPONENTS,
    LINEAR,
    NUMBERS,
    Parameter,
    compensator_names,
    own_direction,
)
from edtk.robots.compensator import GivingWay, Pull
from edtk.robots.elastic_robot import ElasticJoint, ElasticRobot, pull_on
from edtk.robots.robot import Robot
from edtk.system.typing import Array, Indices

STEP = 1e-4  # [rad] of differences, of what is a small correction
# What a torque x does by each law, and its derivative. All are odd but `sign`: by it a spring is
# softer under torques of one sign than under those of the other.
LAWS: dict[str, tuple[Callable[[Array], Array], Callable[[Array], Array]]] = {
    LINEAR: (lambda x: x, np.ones_like),
    "square": (lambda x: x * np.abs(x), lambda x: 2 * np.abs(x)),
    "cubic": (lambda x: x**3, lambda x: 3 * x**2),
    "sign": (np.abs, np.sign),
    "gap": (np.sign, np.zeros_like),
}


@dataclass(frozen=True, eq=False)
class UnknownNumbers:
    """Numbers of a robot's compensators that are parameters: by how much they differ from stated.

    Attributes:
        pulls: The compensators as they are stated.
        joints: The free joint (c,) of each.
        loaded: Coordinates that each loads: elastic joints before its own, and that.
        places: The compensator, and the place among its numbers, of each parameter.
        of: Index of each parameter among all of the model.
    """

    pulls: tuple[Pull, ...]
    joints: tuple[int, ...]
    loaded: tuple[list[int], ...]
    places: tuple[tuple[int, int], ...]
    of: Indices

    @classmethod
    def among(
        cls, robot: Robot, elastic: tuple[ElasticJoint, ...], parameters: Sequence[Parameter]
    ) -> "UnknownNumbers":
        """Those among parameters of a robot.

        Args:
            robot: The rigid robot.
            elastic: The elastic joints, whose coordinates come after those of its free joints.
            parameters: Of which some are numbers of compensators.
        """
        whole = ElasticRobot.of(robot, elastic)
        pulls = tuple(pull_on(whole, pull) for pull in robot.pulls)
        between = ([whole.body_names[i] for i in pull.places] for pull in pulls)
        loaded = tuple([whole.joint_names.index(name) for name in names] for names in between)
        own = [(i, one) for i, one in enumerate(parameters) if one.place == "compensator"]
        names = compensator_names(robot)
        joints = tuple(robot.joint_names.index(pull.given.joint) for pull in robot.pulls)
        places = tuple((names.index(one.of), NUMBERS.index(one.component)) for _, one in own)
        return cls(pulls, joints, loaded, places, np.array([i for i, _ in own], dtype=int))

    def changed(self, sizes: Array) -> tuple[Pull, ...]:
        """The compensators whose numbers differ by sizes (c,), in SI units."""
        numbers = np.array([pull.given.numbers() for pull in self.pulls])
        for (which, place), size in zip(self.places, sizes, strict=True):
            numbers[which, place] += size
        pairs = zip(self.pulls, numbers, strict=True)
        return tuple(replace(pull, given=pull.given.with_numbers(own)) for pull, own in pairs)

    def torque(self, sizes: Array, q: Array) -> Array:
        """What such changes add to the loads (m, s) of the joints, at q (m, s) [N m]."""
        added = np.zeros_like(q)
        if sizes.any():
            for at, new, old in zip(self.loaded, self.changed(sizes), self.pulls, strict=True):
                x = q[:, at].T
                added[:, at] += (new.loads(x) - old.loads(x)).T
        return added

    def torque_derivative(self, sizes: Array, q: Array) -> Array:
        """Derivatives (m, s, s) of these loads by q."""
        added = np.zeros((*q.shape, q.shape[1]))
        if sizes.any():
            for at, new, old in zip(self.loaded, self.changed(sizes), self.pulls, strict=True):
                x = q[:, at].T
                own = new.load_derivative(x) - old.load_derivative(x)
                added[:, np.array(at)[:, None], at] += np.moveaxis(own, -1, 0)
        return added

    def by_numbers(self, sizes: Array, q: Array) -> Array:
        """Derivatives (m, s, c) of these loads by the sizes."""
        found = np.zeros((*q.shape, len(self.places)))
        changed = self.changed(sizes) if len(self.places) else ()
        for i, (which, place) in enumerate(self.places):
            at = self.loaded[which]
            found[:, at, i] = changed[which].loads_by_numbers(q[:, at].T)[place].T
        return found


@dataclass(frozen=True, eq=False)
class Springs:
    """The springs of a model: torques tau (s,) turn the joints by ``sum_i k_i b_i(tau)``.

    Coordinates are the free joints, then the elastic ones. A spring is a sum of terms
    ``b = o f(g' tau)`` with a law f: ``g g' tau`` for a linear one along g, and of an entry of a
    matrix off its diagonal ``e_a tau_b + e_b tau_a``, two terms. All are linear in k.

    Attributes:
        out: Directions o (T, s) of the terms.
        by: Directions g (T, s) of the torques that they answer.
        laws: The law of each term (T,).
        of: Index (T,) of the parameter that each belongs to.
    """

    out: Array
    by: Array
    laws: tuple[str, ...]
    of: Indices

    @classmethod
    def among(
        cls, robot: Robot, elastic: Sequence[ElasticJoint], parameters: Sequence[Parameter]
    ) -> "Springs":
        """Those among parameters.

        Args:
            robot: The rigid robot.
            elastic: The elastic joints, whose coordinates come after those of its free joints.
            parameters: Of which some are springs.
        """
        width = robot.n + len(elastic)
        terms = [
            (i, out, by, one.law)
            for i, one in enumerate(parameters)
            if one.is_spring
            for out, by in _terms(robot, elastic, one)
        ]
        shape = (len(terms), width)
        return cls(
            np.array([out for _, out, _, _ in terms]).reshape(shape),
            np.array([by for _, _, by, _ in terms]).reshape(shape),
            tuple(law for _, _, _, law in terms),
            np.array([i for i, _, _, _ in terms], dtype=int),
        )

    @property
    def width(self) -> int:
        """Number s of coordinates."""
        return self.out.shape[1]

    @cached_property
    def _by_law(self) -> list[tuple[str, Indices]]:
        """The terms of each law but the linear one."""
        laws = np.array(self.laws)
        return [(law, np.flatnonzero(laws == law)) for law in set(self.laws) - {LINEAR}]

    def amplitudes(self, torque: Array) -> Array:
        """``f(g' tau)`` of each term (T, m), under torques (s, m)."""
        found = self.by @ torque
        for law, own in self._by_law:
            found[own] = LAWS[law][0](found[own])
        return found

    def stiffening(self, torque: Array) -> Array:
        """The derivatives ``f'(g' tau)`` (T, m)."""
        found = np.ones((len(self.out), torque.shape[-1]))
        for law, own in self._by_law:
            found[own] = LAWS[law][1](self.by[own] @ torque)
        return found

    def by_torque(self, torque: Array, weights: Array) -> Array:
        """Weights (s, m) of changes of the torques (s, m), for those (T, m) of the amplitudes."""
        return self.by.T @ (weights * self.stiffening(torque))


@dataclass(frozen=True, eq=False)
class Bending:
    """Springs with their sizes: what the loads of a robot turn its joints by.

    Attributes:
        springs: The springs that are parameters.
        sizes: The size (T,) of each term, in SI units.
        known: Compliances (s,) beside these [rad/(N m)].
        numbers: The numbers of compensators that are parameters.
        changes: By how much (c,) these differ from what is stated, in SI units.
    """

    springs: Springs
    sizes: Array
    known: Array
    numbers: UnknownNumbers
    changes: Array

    @property
    def width(self) -> int:
        """Number s of coordinates."""
        return self.springs.width

    @property
    def play(self) -> float:
        """How far a joint may rest anywhere, where its load is zero within a dead zone [rad]."""
        gaps = np.array(self.springs.laws) == "gap"
        return float(2 * np.abs(self.sizes[gaps]).max(initial=0.0))

    def scaled(self, factor: float) -> "Bending":
        """With springs that are softer by a factor."""
        return replace(self, sizes=factor * self.sizes, known=factor * self.known)

    def __getitem__(self, chosen: Indices) -> "Bending":
        """The same springs, which are those of all poses."""
        return self

    @cached_property
    def is_rigid(self) -> bool:
        """Whether nothing gives way."""
        return not (self.sizes.any() or self.known.any())

    def added(self, q: Array) -> Array:
        """What compensators that differ from what is stated add to loads (m, s), at q (m, s)."""
        return self.numbers.torque(self.changes, q)

    def added_derivative(self, q: Array) -> Array:
        """Derivatives (m, s, s) of what they add by q."""
        return self.numbers.torque_derivative(self.changes, q)

    def turn(self, torque: Array) -> Array:
        """Turns (m, s) of all joints under torques (m, s) [rad or m]."""
        amplitudes = self.springs.amplitudes(torque.T).T
        return (amplitudes * self.sizes) @ self.springs.out + self.known * torque

    def tangent(self, torque: Array) -> Array:
        """The derivatives K (m, s, s) of these turns by the torques."""
        stiffening = self.springs.stiffening(torque.T).T * self.sizes
        K = self.springs.out.T @ (stiffening[..., None] * self.springs.by)
        return np.asarray(K + np.diag(self.known))

    def turned_by(self, torque: Array, change: Array) -> Array:
        """``K C`` (m, s, c): how the turns follow changes C (m, s, c) of the torques."""
        return np.asarray(self.tangent(torque) @ change)


@dataclass(frozen=True, eq=False)
class Answers:
    """How springs and compensators of a plan answer loads, about a guess of the compliances.

    A term of a spring turns the joints by ``o f(g' tau)``. With a compensator a joint gives way by
    the part ``u = 1/(1 + k U'')`` of that; and the load is u tau where it has come to rest, unless
    poses are those under load. A number p of the compensator of joint j turns it by
    ``u k_j dtau_c/dp``, at the angle at which it rests. Arrays are component first.

    Attributes:
        springs: The springs among the parameters.
        numbers: The numbers of compensators among them.
        gives: How joints give way; None without compensators, or without a guess.
    """

    springs: Springs
    numbers: UnknownNumbers
    gives: GivingWay | None

    @cached_property
    def of(self) -> Indices:
        """Index (T,) of the parameter of each term, those of compensators last."""
        return np.concatenate([self.springs.of, self.numbers.of])

    @cached_property
    def out(self) -> Array:
        """Directions (T, s) in which the terms turn the joints."""
        own = np.zeros((len(self.numbers.of), self.springs.width))
        for row, (which, _) in zip(own, self.numbers.places, strict=True):
            row[self.numbers.joints[which]] = 1.0
        return np.concatenate([self.springs.out, own])

    def _parts(self, q: Array, width: int) -> tuple[Array, Array]:
        """The part u (s, m) that is left of each coordinate's motion, and its slope by it."""
        assert self.gives is not None
        left, slope = np.ones((width, q.shape[1])), np.zeros((width, q.shape[1]))
        left[: len(q)], slope[: len(q)] = replace(self.gives, brought=True).factors(q)
        return left, slope

    @property
    def _rests(self) -> bool:
        """Whether loads are those of commanded poses, which have given way before."""
        return self.gives is not None and not self.gives.brought

    def amplitudes(self, q: Array, torque: Array) -> Array:
        """Amplitudes (T, m) of all terms, in poses q (n, m) under torques (s, m)."""
        if self.gives is None:
            return self._without(torque)
        u, _ = self._parts(q, len(torque))
        rest = u * torque if self._rests else torque
        of_springs = self.springs.amplitudes(rest) * (self.springs.out @ u)
        return np.concatenate([of_springs, self._of_numbers(q, torque, u)[0]])

    def _without(self, torque: Array) -> Array:
        """Amplitudes (T, m) where no joint with a compensator gives way."""
        found = self.springs.amplitudes(torque)
        if not len(self.numbers.of):
            return found
        return np.concatenate([found, np.zeros((len(self.numbers.of), torque.shape[1]))])

    def pulled_back(self, q: Array, torque: Array, weights: Array) -> tuple[Array, Array]:
        """Derivatives of ``<weights, amplitudes>`` by the torques (s, m), and by q (n, m).

        Args:
            q: Poses (n, m).
            torque: Torques (s, m).
            weights: Weights (T, m).
        """
        count = len(self.springs.of)
        if self.gives is None:
            return self.springs.by_torque(torque, weights[:count]), np.zeros_like(q)
        u, slope = self._parts(q, len(torque))
        rest = u * torque if self._rests else torque
        by_rest = self.springs.by_torque(rest, weights[:count] * (self.springs.out @ u))
        by_u = self.springs.out.T @ (weights[:count] * self.springs.amplitudes(rest))
        by_torque = by_rest
        if self._rests:
            by_torque = u * by_rest
            by_u = by_u + torque * by_rest
        by_q = (by_u * slope)[: len(q)]
        _, of_torque, of_q = self._of_numbers(q, torque, u, slope)
        for i, (which, _) in enumerate(self.numbers.places):
            j = self.numbers.joints[which]
            by_torque[j] += weights[count + i] * of_torque[i]
            by_q[j] += weights[count + i] * of_q[i]
        return by_torque, by_q

    def _of_numbers(
        self, q: Array, torque: Array, u: Array, slope: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """Amplitudes (c, m) of the numbers, and their derivatives by torque and angle.

        With the rest ``y = q + k u tau``, ``a = k u D(y)``: ``da/dtau = (k u)^2 D'(y)`` and
        ``da/dq = k u' D + k u D' (1 + k u' tau)``.
        """
        assert self.gives is not None
        found = np.zeros((3, len(self.numbers.places), q.shape[1]))
        rests = 1.0 if self._rests else 0.0
        each = [which for which, _ in self.numbers.places]
        for which in dict.fromkeys(each):
            own = [i for i, one in enumerate(each) if one == which]
            places = [self.numbers.places[i][1] for i in own]
            j = self.numbers.joints[which]
            k = float(self.gives.compliances[j])
            give = k * u[j]
            rest = q[j] + rests * give * torque[j]
            pulls = self.numbers.pulls[which].by_numbers
            D = pulls(rest)[places]
            found[0, own] = give * D
            if slope is None:
                continue
            changed = (pulls(rest + STEP)[places] - pulls(rest - STEP)[places]) / (2 * STEP)
            found[1, own] = rests * give**2 * changed
            found[2, own] = k * slope[j] * D
            found[2, own] += give * changed * (1 + rests * k * slope[j] * torque[j])
        return found[0], found[1], found[2]


def _terms(
    robot: Robot, elastic: Sequence[ElasticJoint], one: Parameter
) -> list[tuple[Array, Array]]:
    """Directions (s,) of the terms of a spring, and of the torques that they answer."""
    ends = [_direction(robot, elastic, one.of, component) for component in one.ends]
    if len(ends) == 1:
        return [(ends[0], ends[0])]
    return [(ends[0], ends[1]), (ends[1], ends[0])]


def _direction(robot: Robot, elastic: Sequence[ElasticJoint], joint: str, component: str) -> Array:
    """The coordinate (s,) of a spring, or of the joint itself along whose axis it is."""
    g = np.zeros(robot.n + len(elastic))
    own = own_direction(robot, joint, component) if component else 1
    if own:
        g[robot.joint_names.index(joint)] = own
        return g
    places = [(other.before, other.component) for other in elastic]
    g[robot.n + places.index((joint, COMPONENTS.index(component)))] = 1.0
    return g


def elastic_joints(robot: Robot, parameters: Sequence[Parameter]) -> tuple[ElasticJoint, ...]:
    """The elastic joints that springs need, from base to tip."""
    needed = {
        (one.of, component)
        for one in parameters
        if one.is_spring
        for component in one.ends
        if component and not own_direction(robot, one.of, component)
    }
    return tuple(
        ElasticJoint(name, i, f"{name}.{component}")
        for name in robot.body_names
        for i, component in enumerate(COMPONENTS)
        if (name, component) in needed
    )


def sprung(robot: Robot, elastic: tuple[ElasticJoint, ...]) -> Robot:
    """The robot with its elastic joints."""
    return ElasticRobot.of(robot, elastic)
