"""Gravity compensators: springs and gas cylinders across a joint, by their potentials."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from edtk.robots.joint import Joint
from edtk.robots.rotations import rotation, vector_product
from edtk.system.typing import Array

Medium = Literal["coil", "gas"]
SHORTEST = 1e-6  # a lever, or a distance of anchors, that is none [m]
SAMPLES = 721  # angles of a joint's range at which anchors must be apart, and a gas have room


@dataclass(frozen=True, eq=False)
class Compensator:
    """A coil spring or a gas cylinder between the body before a joint and the one that it moves.

    It pulls its anchors together by the force F, which is `preload` where the joint is at zero and
    the anchors are s0 apart. With ``x = s - s0``, the stretch from there,

        coil  F = P + c x            gas  F = P / (1 - c x / P),

    the law of Boyle and Mariotte for a gas that is compressed as the anchors part: P is the force
    and c its slope at x = 0. A cylinder that pushes has a negative P, and a positive c too.

    Args:
        joint: Name of the joint.
        before: Anchor (3,) on the body before the joint, in the joint's frame at zero [m].
        behind: Anchor (3,) on the body that the joint moves, in the same frame at zero [m].
        stiffness: c [N/m].
        preload: P [N].
        medium: "coil" or "gas".

    Raises:
        ValueError: A number is none, or the anchors coincide.
    """

    joint: str
    before: Array
    behind: Array
    stiffness: float
    preload: float
    medium: Medium = "coil"

    def __post_init__(self) -> None:
        for name in ("before", "behind"):
            point = np.array(getattr(self, name), dtype=float)
            if point.shape != (3,) or not np.isfinite(point).all():
                raise ValueError(f"compensator at {self.joint}: an anchor is a point of 3 numbers")
            object.__setattr__(self, name, point)
        if not (np.isfinite(self.preload) and np.isfinite(self.stiffness) and self.stiffness >= 0):
            raise ValueError(
                f"compensator at {self.joint}: expected a preload, and a stiffness from 0 on"
            )
        if self.medium not in get_args(Medium):
            raise ValueError(f"compensator at {self.joint}: expected coil or gas")
        if self.medium == "gas" and not self.preload:
            raise ValueError(
                f"compensator at {self.joint}: a gas has a force where the joint is at zero; "
                "expected a preload that is not 0"
            )
        if np.linalg.norm(self.before - self.behind) < SHORTEST:
            raise ValueError(
                f"compensator at {self.joint}: the anchors coincide where the joint is at zero; "
                "expected two points"
            )

    def numbers(self) -> list[float]:
        """All numbers (8,): anchors [m], stiffness [N/m] and preload [N]."""
        return [*self.before.tolist(), *self.behind.tolist(), self.stiffness, self.preload]

    def times(self, factor: float) -> "Compensator":
        """One at the same places that pulls so many times as much."""
        return replace(self, stiffness=factor * self.stiffness, preload=factor * self.preload)

    def with_numbers(self, numbers: Array) -> "Compensator":
        """The same with other numbers (8,).

        Raises:
            ValueError: They are those of no compensator.
        """
        before, behind, (stiffness, preload) = np.split(np.asarray(numbers, dtype=float), [3, 6])
        return Compensator(
            self.joint, before, behind, float(stiffness), float(preload), self.medium
        )


@dataclass(frozen=True, eq=False)
class Reach:
    """The distance s of the anchors, and its derivatives by the joint's angle, in some poses.

    Attributes:
        length: s (...) [m].
        first: s' (...) [m/rad]: the lever arm of the force about the axis.
        second: s'' (...) [m/rad^2].
        third: s''' (...) [m/rad^3].
    """

    length: Array
    first: Array
    second: Array
    third: Array


@dataclass(frozen=True, eq=False)
class Pull:
    """A compensator on the joint of a chain: its potential U(q), and the torque ``-dU/dq``.

    The anchor b behind the joint turns about the unit axis n, and the anchor a before it stays.
    With their parts across the axis, ``a.R(q) b - a_n b_n = A cos q + B sin q``, so that

        s^2 = C - 2 (A cos q + B sin q),   s s' = A sin q - B cos q,

    with ``A = a.b - a_n b_n``, ``B = a.(n x b)`` and ``C = |a|^2 + |b|^2 - 2 a_n b_n``. In a plane,
    at the distances a and L from the axis, this is ``s^2 = a^2 + L^2 + 2 a L cos(q + phi)``. Then

        tau = -F s',   tau' = -(F_s s'^2 + F s''),   tau'' = -(F_ss s'^3 + 3 F_s s' s'' + F s''').

    Elastic joints before the joint are between the anchors, too, and the force loads all of them:
    ``tau_i = -F s_i`` and ``dtau_i/dx_j = -(F_s s_i s_j + F s_ij)`` with the derivatives of the
    distance s by their variables x, see `Line`.

    Attributes:
        place: Index of the joint among all of the chain.
        axis: Its unit axis (3,).
        given: The compensator.
        elastic: The elastic joints right before the joint, from base to tip.
    """

    place: int
    axis: Array
    given: Compensator
    elastic: tuple[Joint, ...] = ()

    @property
    def places(self) -> list[int]:
        """Indices in the chain of the joints between the anchors, its own the last."""
        return list(range(self.place - len(self.elastic), self.place + 1))

    def loads(self, x: Array) -> Array:
        """Loads (k, ...) of the joints between the anchors, by their variables x (k, ...)."""
        if not self.elastic:
            return self.torque(x)
        line = self._line(x)
        return np.moveaxis(-self.force(line.length)[0][..., None] * line.first, -1, 0)

    def load_derivative(self, x: Array) -> Array:
        """Derivatives (k, k, ...) of these loads by the variables, symmetric."""
        if not self.elastic:
            return self.derivative(x)[None]
        line = self._line(x)
        F, by_length, _ = self.force(line.length)
        squares = line.first[..., :, None] * line.first[..., None, :]
        H = -(by_length[..., None, None] * squares + F[..., None, None] * line.second)
        return np.moveaxis(H, (-2, -1), (0, 1))

    def loads_by_numbers(self, x: Array) -> Array:
        """Derivatives (8, k, ...) of these loads by the compensator's numbers."""
        if not self.elastic:
            return self.by_numbers(x[0])[:, None]
        line = self._line(x)
        F, by_length, _ = self.force(line.length)
        ends = np.stack([self.given.before, self.given.behind])
        apart = (ends[1] - ends[0]) / self.rest
        ds, d_first = line.by_ends()
        dF = np.zeros((*line.length.shape, 8))
        dF[..., :6] = by_length[..., None] * (ds - np.concatenate([-apart, apart]))
        dF[..., 6:] = np.moveaxis(self._force_by_numbers(line.length), 0, -1)
        found = -dF[..., None, :] * line.first[..., None]
        found[..., :6] -= F[..., None, None] * d_first
        return np.moveaxis(found, (-1, -2), (0, 1))

    def _line(self, x: Array) -> "Line":
        """From anchor to anchor, with the joints between them at x (k, ...)."""
        slides = [joint.kind == "prismatic" for joint in self.elastic]
        axes = [*(joint.axis for joint in self.elastic), self.axis]
        ends = self.given.before, self.given.behind
        return Line.of((*slides, False), axes, ends, np.moveaxis(x, 0, -1))

    @cached_property
    def _numbers(self) -> tuple[float, float, float]:
        """A, B and C [m^2]."""
        a, b, n = self.given.before, self.given.behind, self.axis
        along = float(a @ n) * float(b @ n)
        A = float(a @ b) - along
        B = float(a @ np.cross(n, b))
        return A, B, float(a @ a + b @ b) - 2 * along

    @cached_property
    def _of_numbers(self) -> Array:
        """Derivatives (3, 8) of A, B and C by the compensator's numbers."""
        a, b, n = self.given.before, self.given.behind, self.axis
        aside, turned = (point - float(point @ n) * n for point in (a, b))
        none = np.zeros(2)
        dA = np.concatenate([turned, aside, none])
        dB = np.concatenate([np.cross(n, b), np.cross(a, n), none])
        dC = 2 * np.concatenate([a - (b - turned), b - (a - aside), none])
        return np.stack([dA, dB, dC])

    def reach(self, q: Array) -> Reach:
        """The anchors' distance at angles q (...) [rad]."""
        A, B, C = self._numbers
        cosine, sine = np.cos(q), np.sin(q)
        along = A * cosine + B * sine
        across = A * sine - B * cosine
        s = np.sqrt(np.maximum(C - 2 * along, SHORTEST**2))
        first = across / s
        second = (along - first**2) / s
        return Reach(s, first, second, (-across - 3 * first * second) / s)

    @cached_property
    def rest(self) -> float:
        """The anchors' distance s0 where the joint is at zero [m]."""
        A, _, C = self._numbers
        return float(np.sqrt(C - 2 * A))

    @property
    def nearest(self) -> Array:
        """The angle at which the anchors are nearest, from minus half a turn on [rad]."""
        A, B, _ = self._numbers
        return np.array(np.arctan2(B, A))

    def force(self, length: Array) -> tuple[Array, Array, Array]:
        """F, and its first and second derivatives by the length s (...) [N, N/m, N/m^2]."""
        x = length - self.rest
        P, c = self.given.preload, self.given.stiffness
        if self.given.medium == "coil":
            return P + c * x, np.full_like(x, c), np.zeros_like(x)
        left = 1 - c * x / P
        return P / left, c / left**2, 2 * c**2 / P / left**3

    def energy(self, q: Array) -> Array:
        """U (...) at angles q (...), zero at zero [J]."""
        x = self.reach(q).length - self.rest
        P, c = self.given.preload, self.given.stiffness
        if self.given.medium == "coil" or not c:
            return np.asarray(P * x + c * x**2 / 2)
        return np.asarray(-(P**2) / c * np.log1p(-c * x / P))

    def torque(self, q: Array) -> Array:
        """Load (...) of the joint at angles q (...) [N m]."""
        reach = self.reach(q)
        return -self.force(reach.length)[0] * reach.first

    def by_numbers(self, q: Array) -> Array:
        """Derivatives (8, ...) of the torque by the compensator's numbers, at angles q (...).

        Those of A, B and C first: ``tau = -F m/s``, ``m = A sin q - B cos q``, ``s0^2 = C - 2 A``.
        """
        dA, dB, dC = self._of_numbers.reshape(3, 8, *[1] * q.ndim)
        reach = self.reach(q)
        s = reach.length
        F, by_length, _ = self.force(s)
        cosine, sine = np.cos(q), np.sin(q)
        ds = (dC / 2 - cosine * dA - sine * dB) / s
        dF = by_length * (ds - (dC / 2 - dA) / self.rest)
        dF[6:] += self._force_by_numbers(s)
        return -dF * reach.first - F * (sine * dA - cosine * dB - reach.first * ds) / s

    def _force_by_numbers(self, length: Array) -> Array:
        """Derivatives (2, ...) of the force by stiffness and preload, the lengths held fixed."""
        x = length - self.rest
        if self.given.medium == "coil":
            return np.stack([x, np.ones_like(x)])
        u = self.given.stiffness * x / self.given.preload
        return np.stack([x, 1 - 2 * u]) / (1 - u) ** 2

    def derivative(self, q: Array) -> Array:
        """``dtau/dq`` (...), less than the stiffness that the joint gains [N m/rad]."""
        reach = self.reach(q)
        F, by_length, _ = self.force(reach.length)
        return -(by_length * reach.first**2 + F * reach.second)

    def second_derivative(self, q: Array) -> Array:
        """``d^2 tau/dq^2`` (...) [N m/rad^2]."""
        reach = self.reach(q)
        F, by_length, curved = self.force(reach.length)
        found = curved * reach.first**3 + 3 * by_length * reach.first * reach.second
        return -(found + F * reach.third)


@dataclass(frozen=True, eq=False)
class Line:
    """The line between two points, of which one is carried by a chain of joints from one origin.

    A joint i moves the carried point by ``v_i = w_i x r_i``, or by ``v_i = w_i`` if it slides, and
    with the direction u of the line

        s_i = u.v_i,   s_ij = (v_i.v_j - s_i s_j)/s + u.(w_i x v_j)  for i at or before j,

    the last without w_i where joint i slides: it turns nothing.

    Attributes:
        length: s (...) [m].
        first: s_i (..., k) by the joints' variables.
        second: s_ij (..., k, k).
        direction: u (..., 3).
        moved: v_i (..., k, 3).
        axes: w_i (..., k, 3), zero where a joint slides.
        turned: Rotation (..., 3, 3) of the frame that carries the second point.
    """

    length: Array
    first: Array
    second: Array
    direction: Array
    moved: Array
    axes: Array
    turned: Array

    def by_ends(self) -> tuple[Array, Array]:
        """Derivatives of s (..., 6) and of s_i (..., k, 6) by the two points.

        ``ds = u.dr`` of the line r, ``ds_i = (v_i - s_i u).dr/s``, and with the carried point
        v_i changes by ``w_i x R db``.
        """
        u, R = self.direction, self.turned
        across = self.moved - self.first[..., None] * u[..., None, :]
        across = across / self.length[..., None, None]
        ds = np.concatenate([-u, (u[..., None, :] @ R)[..., 0, :]], axis=-1)
        turning = vector_product(np.broadcast_to(u[..., None, :], self.axes.shape), self.axes)
        return ds, np.concatenate([-across, (across + turning) @ R], axis=-1)

    @classmethod
    def of(
        cls, slides: Sequence[bool], axes: Sequence[Array], ends: tuple[Array, Array], x: Array
    ) -> "Line":
        """Place the chain.

        Args:
            slides: Which joints (k,) slide.
            axes: Their axes (3,), each in the frame behind the joint before.
            ends: The point that stays, and the one that is carried (3,) [m].
            x: Variables (..., k) of the joints.
        """
        R = np.broadcast_to(np.eye(3), (*x.shape[:-1], 3, 3))
        p = np.zeros((*x.shape[:-1], 3))
        directions, origins = [], []
        for i, (is_slide, axis) in enumerate(zip(slides, axes, strict=True)):
            directions.append(R @ axis)
            origins.append(p)
            if is_slide:
                p = p + x[..., i, None] * directions[-1]
            else:
                R = R @ rotation(x[..., i, None] * axis)
        w = np.stack(directions, axis=-2)
        end = p + R @ ends[1]
        sliding = np.array(slides)[:, None]
        v = np.where(sliding, w, vector_product(w, end[..., None, :] - np.stack(origins, axis=-2)))
        line = end - ends[0]
        s = np.sqrt((line * line).sum(axis=-1))
        u = line / s[..., None]
        first = np.einsum("...c,...ic->...i", u, v)
        turning = np.where(sliding, 0.0, w)
        turned = vector_product(turning[..., :, None, :], v[..., None, :, :])
        upper = np.triu(np.einsum("...c,...ijc->...ij", u, turned))
        bent = upper + np.swapaxes(np.triu(upper, 1), -1, -2)
        across = v @ np.swapaxes(v, -1, -2) - first[..., :, None] * first[..., None, :]
        return cls(s, first, across / s[..., None, None] + bent, u, v, turning, R)


def compensator_in_words(pull: Pull, limits: tuple[float, float]) -> str:
    """A sentence on the torque of a compensator within the limits of its joint [rad]."""
    q = np.linspace(*limits, SAMPLES)
    torque = pull.torque(q)
    stiffness = -pull.derivative(q)
    A, B, _ = pull._numbers
    # Where the anchors are nearest, and half a turn from there, their line crosses the axis.
    turns = np.arctan2(B, A) + np.pi * np.arange(-4, 5)
    dead = [f"{np.rad2deg(at):.4g}" for at in turns if limits[0] <= at <= limits[1]]
    crosses = f"; its line crosses the axis at {' and '.join(dead)} deg" if dead else ""
    return (
        f"{pull.given.joint} has a gravity compensator ({pull.given.medium}): torque "
        f"{torque.min():.4g} .. {torque.max():.4g} N m, stiffness {stiffness.min():.4g} .. "
        f"{stiffness.max():.4g} N m/rad{crosses}"
    )


def pull_of(given: Compensator, place: int, joint: Joint) -> Pull:
    """A compensator on a joint of a chain.

    Args:
        given: The compensator.
        place: Index of the joint among all of the chain.
        joint: The joint.

    Raises:
        ValueError: The joint slides; or an anchor is on its axis, so that the lever is zero in the
            whole range; or somewhere in it the anchors meet, or the gas has no volume left.
    """
    name = given.joint
    if joint.kind != "revolute":
        raise ValueError(f"{name} is prismatic; expected a joint that turns")
    pull = Pull(place, joint.axis, given)
    for which, point in (("first", given.before), ("second", given.behind)):
        if np.linalg.norm(np.cross(joint.axis, point)) < SHORTEST:
            raise ValueError(
                f"the {which} anchor lies on the axis of {name}, where no force turns the joint; "
                "expected a point beside it"
            )
    q = np.linspace(*joint.limits, SAMPLES)
    nearest = pull.nearest
    if pull.reach(nearest).length <= SHORTEST and (joint.limits[0] <= nearest <= joint.limits[1]):
        raise ValueError(f"the anchors meet at {name} = {np.rad2deg(nearest):.4g} deg")
    if given.medium == "gas":
        s = pull.reach(q).length
        left = 1 - given.stiffness * (s - pull.rest) / given.preload
        gone = np.flatnonzero(left <= 0)
        if len(gone):
            raise ValueError(
                f"the gas has no volume left at {name} = {np.rad2deg(q[gone[0]]):.4g} deg; "
                "expected a smaller stiffness, or a larger preload"
            )
    return pull


@dataclass(frozen=True, eq=False)
class GivingWay:
    """How joints with compensators give way about a guess of their compliances.

    Such a joint is stiffer by ``U''``, or softer: a load that is added turns it by
    ``k / (1 + k U'')`` of itself. Of what a load does to a joint that is held at the commanded
    angle, a small change of k moves ``1 / (1 + k U'')^2``: the load itself has given way before.
    Where the joint has been brought to the angle at which the load acts, as commands do, it is
    ``1 / (1 + k U'')``.

    Attributes:
        pulls: The compensators.
        compliances: The guess (n,) of all free joints [rad/(N m)].
        free: Index of each free joint (n,) among all of the chain.
        brought: Whether poses are those under load, and not those that are commanded.
    """

    pulls: tuple[Pull, ...]
    compliances: Array
    free: tuple[int, ...]
    brought: bool = False

    def factors(self, q: Array) -> tuple[Array, Array]:
        """The factor of each joint (n, ...) at q (n, ...), and its derivative by that joint."""
        curvature, slope = np.zeros((2, *q.shape))
        for pull in self.pulls:
            j = self.free.index(pull.place)
            curvature[j] -= pull.derivative(q[j])
            slope[j] -= pull.second_derivative(q[j])
        k = self.compliances.reshape(-1, *[1] * (q.ndim - 1))
        stiff = 1 + k * curvature
        power = 1 if self.brought else 2
        return stiff**-power, -power * k * slope * stiff ** (-power - 1)
