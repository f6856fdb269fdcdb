"""Where springs and the loads of joints come to rest, whatever the springs and the loads are.

Motors hold the joints at q, springs turn them further by ``u = b(tau)``, and the loads tau follow:
``u = b(tau(q + u))``. With ``K = db/dtau`` and ``H = dtau/dq`` a rest is stable where all
eigenvalues of ``I - K H`` have positive real parts. Coordinates are the joints that motors turn,
then the elastic ones.
"""

from dataclasses import dataclass, fields
from typing import Protocol, Self

import numpy as np

from criteria.linalg.inverse import TINY
from edtk.measure.measured_model import Load, LoadsOfReadings, Torque
from edtk.measure.springs import Bending
from edtk.robots.elastic_robot import widened
from edtk.robots.inverse import LONGEST
from edtk.system.typing import Array, Indices, Mask

# Joint deflection [rad or m] beyond which springs become soft in steps: Newton's method could then
# have jumped to another branch of equilibria.
FAR = 0.1
STEPS = 32
ITERATIONS = 30  # Newton steps; a handful is the rule
NEAR = 1e-5  # Newton step [rad or m] after which the derivative is good for the others
CONVERGED = 1e-12  # Newton step, relative to the deflection, that is rounding
# Of a joint's angle: with a compensator as stiff as its joint, a step is no smaller.
ROUNDING = 4 * np.finfo(float).eps


class Loads(Protocol):
    """What loads the joints."""

    def __call__(self, q: Array, wrench: Array) -> Array:
        """Loads (m, s) [N m or N] in poses q (m, s, or less) under wrenches (m, 6 or 9)."""

    def with_derivative(self, q: Array, wrench: Array) -> tuple[Array, Array]:
        """Loads (m, s), and their derivatives ``H_jl = dtau_j/dq_l`` (m, s, s)."""


class Compliant(Protocol):
    """Springs: what loads turn the joints by."""

    @property
    def play(self) -> float:
        """How far a joint may rest anywhere [rad]."""

    def turn(self, torque: Array) -> Array:
        """Turns b (m, s) under loads (m, s) [rad or m]."""

    def turned_by(self, torque: Array, change: Array) -> Array:
        """``K C`` (m, s, c): how turns under loads (m, s) follow changes C (m, s, c) of these."""

    def scaled(self, factor: float) -> Self:
        """Springs that are softer by a factor."""

    def __getitem__(self, chosen: Indices) -> Self:
        """The springs in some of the poses."""


@dataclass(frozen=True, eq=False)
class Settled:
    """Where Newton's method has ended.

    Attributes:
        turn: Turns u (m, s) of the joints [rad or m].
        torque: Their loads (m, s) [N m or N].
        slope: ``I - K H`` (m, s, s).
        rests: Whether springs and loads agree (m,).
    """

    turn: Array
    torque: Array
    slope: Array
    rests: Mask

    @property
    def far(self) -> Indices:
        """Poses that may have gone over to another equilibrium, or to none."""
        return np.flatnonzero(~self.rests | (np.abs(self.turn) > FAR).any(axis=-1))

    @property
    def stable(self) -> Mask:
        """Which poses (m,) come back when they are pushed."""
        return self.rests & _stable(self.slope)

    def with_others(self, poses: Indices, others: "Settled") -> "Settled":
        """The same with some poses that have ended elsewhere."""
        mine = {one.name: getattr(self, one.name).copy() for one in fields(self)}
        for name, array in mine.items():
            array[poses] = getattr(others, name)
        return Settled(**mine)


def settle(springs: Compliant, loads: Loads, q: Array, wrench: Array, turn: Array) -> Settled:
    """Bring joints to rest from turns near it, each pose until it has converged.

    Args:
        springs: What loads turn the joints by.
        loads: What loads them.
        q: Commanded poses (m, s) [rad or m].
        wrench: Forces and torques (m, 6 or 9) [N, N m].
        turn: Where to start (m, s).
    """
    turn = turn.copy()
    m, s = turn.shape
    torque = np.zeros((m, s))
    slope = np.zeros((m, s, s))
    rests = np.zeros(m, dtype=bool)
    moving = np.arange(m)
    longest = np.inf
    for _ in range(ITERATIONS):
        if not len(moving):
            break
        every = len(moving) == m
        at: Indices | slice = slice(None) if every else moving
        own = springs if every else springs[moving]
        near = q[at] + turn[at]
        if longest > NEAR:
            tau, H = loads.with_derivative(near, wrench[at])
            slope[at] = np.eye(s) - own.turned_by(tau, H)
        else:
            tau = loads(near, wrench[at])
        torque[at] = tau
        apart = own.turn(tau) - turn[at]
        # At a buckling point the derivative is singular: such a pose is given up.
        regular = np.abs(np.linalg.det(slope[at])) > np.finfo(float).eps
        step = np.zeros_like(apart)
        step[regular] = np.linalg.solve(slope[at][regular], apart[regular, :, None])[..., 0]
        lengths = np.abs(step).max(axis=-1, initial=0.0, keepdims=True)
        step *= np.minimum(1.0, LONGEST / np.maximum(lengths, TINY))
        turn[at] += step
        size = np.abs(turn[at]).max(axis=-1, initial=0.0, keepdims=True)
        digits = ROUNDING * np.abs(near).max(axis=-1, initial=0.0, keepdims=True)
        done = (np.abs(step) <= CONVERGED * size + digits).all(axis=-1)
        rests[at] = regular & (done | _in_play(springs.play, apart, slope[at]))
        moving = moving[regular & ~done]
        longest = float(lengths.max(initial=0.0))
    return Settled(turn, torque, slope, rests)


def _in_play(play: float, apart: Array, slope: Array) -> Mask:
    """Whether springs and loads (m,) differ by no more than from one end of a dead zone to another.

    On the way, the springs behind it turn by ``K H`` of that.
    """
    if not play:
        return np.zeros(len(apart), dtype=bool)
    KH = np.eye(slope.shape[-1]) - slope
    widest = play * (1 + np.abs(KH).sum(axis=-1).max(axis=-1, keepdims=True))
    return np.asarray((np.abs(apart) <= widest).all(axis=-1))


def stable_rest(springs: Compliant, loads: Loads, q: Array, wrench: Array) -> tuple[Settled, Mask]:
    """Follow the rest of the arm from the unloaded pose on, while it is stable.

    Where joints turn far, springs become soft in equal steps that all have to be stable: so the
    branch that begins at the unloaded pose is followed, and ends where the arm snaps or buckles.

    Returns:
        Where the joints rest, and whether each pose got there (m,).
    """
    found = settle(springs, loads, q, wrench, np.zeros_like(q))
    good = found.stable
    far = found.far
    if len(far):
        followed, good[far] = _softened(springs[far], loads, q[far], wrench[far])
        found = found.with_others(far, followed)
    return found, good


def _softened(springs: Compliant, loads: Loads, q: Array, wrench: Array) -> tuple[Settled, Mask]:
    """The same in steps."""
    found = settle(springs.scaled(0.0), loads, q, wrench, np.zeros_like(q))
    good = np.ones(len(q), dtype=bool)
    for part in np.linspace(0, 1, STEPS + 1)[1:]:
        at = np.flatnonzero(good)
        softer = springs.scaled(float(part))[at]
        further = settle(softer, loads, q[at], wrench[at], found.turn[at])
        found = found.with_others(at, further)
        good[at] = further.stable
    return found, good


def _stable(slope: Array) -> Mask:
    """Whether all eigenvalues of each matrix (N, n, n) have a positive real part (N,)."""
    off = np.abs(slope - np.eye(slope.shape[-1])).sum(axis=-1).max(axis=-1, initial=0.0)
    # By Gershgorin's theorem a matrix within a row sum of one of the identity has; eigenvalues of
    # many matrices take longer than all the rest.
    good = off < 1
    hard = np.flatnonzero(~good)
    good[hard] = np.linalg.eigvals(slope[hard]).real.min(axis=-1, initial=np.inf) > 0
    return good


@dataclass(frozen=True, eq=False)
class _Changed:
    """Loads with compensators whose numbers differ from what is stated."""

    loads: Loads
    bending: Bending

    def __call__(self, q: Array, wrench: Array) -> Array:
        return self.loads(q, wrench) + self.bending.added(q)

    def with_derivative(self, q: Array, wrench: Array) -> tuple[Array, Array]:
        torque, H = self.loads.with_derivative(q, wrench)
        return torque + self.bending.added(q), H + self.bending.added_derivative(q)


def resting_load(
    bending: Bending, q: Array, wrench: Array, loads: Loads | None, derivatives: bool = True
) -> Load | None:
    """What loads the joints at rest.

    Args:
        bending: What loads turn the joints by.
        q: Joint variables (m, n) [rad or m].
        wrench: Forces and torques (m, 6).
        loads: What they load the joints with; None where nothing does.
        derivatives: Whether to say what the joints give way more, or less, as their loads change
            with them.
    """
    if loads is None:
        return None
    changed = _Changed(loads, bending)
    start = widened(q, bending.width)
    torque = changed(start, wrench)
    if bending.is_rigid:
        return Load(torque)
    found = settle(bending, changed, start, wrench, bending.turn(torque))
    far = found.far
    if len(far):
        followed, _ = stable_rest(bending, changed, start[far], wrench[far])
        found = found.with_others(far, followed)
    if not derivatives:
        return Load(found.torque)
    return Load(
        found.torque,
        np.asarray(np.linalg.inv(found.slope), dtype=float),
        bending.tangent(found.torque),
        start + found.turn,
        bending.changes,
    )


def loading_in(
    bending: Bending,
    q: Array,
    wrench: Array,
    loads: Loads | None,
    differs: Mask,
    derivatives: bool = True,
) -> Torque:
    """What loads the joints at rest in each visit, see `resting_load`, and what did before.

    Args:
        bending: What loads turn the joints by.
        q: Joint variables (m, n) [rad or m].
        wrench: Forces and torques (m, 6).
        loads: What they load the joints with.
        differs: Which readings (m,) are differences of a loaded and an unloaded one.
        derivatives: Whether derivatives by the springs are wanted.
    """
    after = resting_load(bending, q, wrench, loads, derivatives)
    if after is None or not differs.any():
        return after
    unloaded = np.zeros((int(differs.sum()), 6))
    before = resting_load(bending, q[differs], unloaded, loads, derivatives)
    assert before is not None
    return LoadsOfReadings(after, differs, before)


def no_rest(bending: Bending, q: Array, wrench: Array, loads: Loads | None) -> Mask:
    """Poses (m,) without a stable equilibrium: the arm would snap, or the load buckles it."""
    if loads is None or bending.is_rigid:
        return np.zeros(len(q), dtype=bool)
    return ~stable_rest(bending, _Changed(loads, bending), widened(q, bending.width), wrench)[1]
