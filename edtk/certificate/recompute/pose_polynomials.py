"""Sensitivity and constraints as polynomials of the joints, from their values on a grid of poses.

The page "A bound over every pose" of the documentation has the theorems and their proofs.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from edtk.certificate.recompute.chain import Chain, Pull
from edtk.certificate.recompute.geometry import UNIT, Geometry, unit_of
from edtk.certificate.recompute.physics import GRAVITY
from edtk.certificate.recompute.plain_data import number, rows, table, whole
from edtk.certificate.recompute.setting import Setting
from edtk.certificate.recompute.tasks import EPS
from edtk.certificate.recompute.tracked_forms import Growth
from edtk.certificate.recompute.values import Multipliers
from edtk.system.typing import Array, Indices, Mask

U = EPS / 2  # of one operation
DEGREE = 4  # of a sensitivity in what each vector of the chain is of degree one in
TURN = 2 * np.pi
MOST_FREE_JOINTS = 6
MOST_POSES = 9**MOST_FREE_JOINTS  # of a grid, which fit in memory
SAME_END = 1e-12  # of ends of intervals [rad]; boxes overlap by more
# Roundings of kinematics for each joint of the chain, from above, without those of its angle, and
# those of an angle that turns by itself; see `_rounding`.
OF_JOINT = 96.0
OF_ANGLE = 13.0
COUPLED = "ABCEFG"  # letters of the limits of coupled joints
OF_LINKS = "KLMNP"  # and of the limits of joints whose angles are no variables, see `Link`
BENDING = ("compliance", "spring")  # parameters that load turns
POSES_AT_ONCE = 1 << 15
DROPPED = 1e-13  # sum of coefficients beside all of them, that is dropped and counted as error


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion of angles that maps a box to itself, ``t -> s t + pi h``, s = 1 or -1.

    Where it leaves all polynomials as they are, what is left of an interval stands for all of it.

    Attributes:
        mirrors: Whether s = -1, for each joint (v,).
        turns: Whether h = 1 (v,).
        joint: The joint whose interval is cut.
        low: What is left of it.
        high: Its upper end.
    """

    mirrors: Mask
    turns: Mask
    joint: int
    low: float
    high: float

    @classmethod
    def from_dict(cls, content: Any, slides: Mask, where: str) -> "Motion":
        """Read a motion.

        Raises:
            ValueError: It is none.
        """
        table(content, ("mirrors", "turns", "joint", "low", "high"), where)
        v = len(slides)
        mirrors, turns = (
            np.array([whole(one, 0, 1, where) for one in rows(content[key], v, where)], dtype=bool)
            for key in ("mirrors", "turns")
        )
        if len(mirrors) < v or len(turns) < v or ((mirrors | turns) & slides).any():
            raise ValueError(f"{where}: expected motions of all angles, and of angles alone")
        low, high = number(content["low"], where), number(content["high"], where)
        return cls(mirrors, turns, whole(content["joint"], 0, v - 1, where), low, high)

    def image(self, j: int, interval: tuple[float, float]) -> tuple[float, float]:
        """What an interval of joint j is mapped to."""
        low, high = interval
        shift = np.pi if self.turns[j] else 0.0
        return (shift - high, shift - low) if self.mirrors[j] else (low + shift, high + shift)

    def left(self, box: list[tuple[float, float]], where: str) -> list[tuple[float, float]]:
        """The box (v,) with what is left of the interval that is cut.

        A place of the box is in what is left, or its image is: the motion maps the other intervals
        into themselves, and this one into itself by whole turns.

        Raises:
            ValueError: It is not so.
        """
        kept = (self.low, self.high)
        stays = all(
            _covers(self.image(j, one), [one]) for j, one in enumerate(box) if j != self.joint
        )
        # The image of a place is in what is left where the place is in the image of that: a
        # mirror, and a turn by half, is its own inverse but for whole turns.
        if not stays or not _covers(box[self.joint], [kept, self.image(self.joint, kept)]):
            raise ValueError(f"{where}: a motion that does not take what is left to the whole box")
        return [kept if j == self.joint else one for j, one in enumerate(box)]


def _covers(interval: tuple[float, float], parts: list[tuple[float, float]]) -> bool:
    """Whether parts cover an interval of angles, but for whole turns, and for rounding."""
    low, high = interval
    turns = TURN * np.arange(-4, 5)
    shifted = sorted((a + turn, b + turn) for a, b in parts for turn in turns if a <= b)
    reached = low
    for a, b in shifted:
        if a <= reached + SAME_END:
            reached = max(reached, b)
    return bool(reached >= high - SAME_END)


@dataclass(frozen=True, eq=False)
class Link:
    """The sum ``s = t_j + sign t_i`` as a variable in place of the angle t_j.

    Any two angles may be summed: a polynomial of old variables is one of the new ones.

    Attributes:
        first: The angle i.
        second: The angle j.
        sign: One, or minus one.
    """

    first: int
    second: int
    sign: int

    @classmethod
    def from_dict(cls, content: Any, slides: Mask, where: str) -> "Link":
        """Read a sum.

        Raises:
            ValueError: It is none of two angles.
        """
        v = len(slides)
        if len(rows(content, 3, where)) < 3:
            raise ValueError(f"{where}: expected two joints and a sign")
        i, j = (whole(one, 0, v - 1, where) for one in content[:2])
        sign = whole(content[2], -1, 1, where)
        if i == j or slides[i] or slides[j] or not sign:
            raise ValueError(f"{where}: expected two different joints that turn, and a sign")
        return cls(i, j, sign)

    def range(self, ends: Array) -> Array:
        """Intervals (2, v) that hold all new variables, for those of the old ones."""
        found = ends.copy()
        found[:, self.second] += np.sort(self.sign * ends[:, self.first])
        return found

    def of(self, form: "Form") -> "Form":
        """A polynomial of the old variables in the new ones.

        A product of waves ``exp(i a t_i) exp(i b t_j)`` is ``exp(i (a - sign b) t_i) exp(i b s)``.
        Every entry of `_waves` and of its inverse is exact, so that only sums of two numbers round,
        of which four follow one another, and what they sum is no more than 8 times the size.
        """
        values = np.moveaxis(form.values, (self.first, self.second), (0, 1)).astype(complex)
        n, m = values.shape[:2]
        waves = np.moveaxis(np.tensordot(_waves(n), values, 1), 1, 0)
        waves = np.tensordot(_waves(m), waves, 1)
        moved = np.zeros((m, n + m - 1, *values.shape[2:]), dtype=complex)
        for b, one in enumerate(waves, start=-(m // 2)):
            moved[b + m // 2, m // 2 - self.sign * b :][:n] = one
        found = np.moveaxis(np.tensordot(_unwaved(m), moved, 1), 1, 0)
        found = np.tensordot(_unwaved(n + m - 1), found, 1).real
        found = np.moveaxis(found, (0, 1), (self.first, self.second))
        return Form(found, form.error + 64 * U * form.size).trimmed()


def _waves(size: int) -> NDArray[np.complex128]:
    """From ``1, cos t, sin t, ...`` to ``exp(ikt)``, k ascending: its coefficients (size, size)."""
    found = np.zeros((size, size), dtype=complex)
    n = size // 2
    found[n, 0] = 1.0
    for k in range(1, n + 1):
        found[[n + k, n - k], 2 * k - 1] = 0.5
        found[[n + k, n - k], 2 * k] = -0.5j, 0.5j
    return found


def _unwaved(size: int) -> NDArray[np.complex128]:
    """The inverse of `_waves`."""
    found = 2.0 * _waves(size).conj().T
    found[0] = 0.5 * found[0]
    return found


@dataclass(frozen=True, eq=False)
class Form:
    """A polynomial by coefficients (n_1, ..., n_v), one axis a joint.

    Attributes:
        values: Coefficients by ``1, cos t, sin t, cos 2t, ...`` of an angle, by powers of
            ``(x - middle)/half`` of a length.
        error: By how much it may differ from what it stands for, anywhere.
    """

    values: Array
    error: float

    @property
    def size(self) -> float:
        """The sum of absolute coefficients, which no value is above."""
        return float(np.abs(self.values).sum()) * (1 + self.values.size * U)

    def trimmed(self) -> "Form":
        """Without the highest degrees that hardly count; what they add is error.

        So no degree is believed: that of a sensitivity is at most four, and often less.
        """
        kept = self.values
        dropped = 0.0
        least = DROPPED * self.size
        for j in range(kept.ndim):
            others = tuple(i for i in range(kept.ndim) if i != j)
            sums = np.abs(kept).sum(axis=others)
            above = np.flatnonzero(sums > least)
            n = int(above[-1]) + 1 if len(above) else 1
            n += (n + 1) % 2  # cosine and sine stay together; a length keeps one power more
            n = min(n, kept.shape[j])
            dropped += float(sums[n:].sum())
            kept = np.take(kept, np.arange(n), axis=j)
        return Form(kept, self.error + dropped * (1 + self.values.size * U))

    def padded(self, shape: tuple[int, ...]) -> Array:
        """The coefficients, with zeros for higher degrees."""
        missing = [(0, n - own) for n, own in zip(shape, self.values.shape, strict=True)]
        return np.pad(self.values, missing)

    def over(self, joints: list[int]) -> "Form":
        """The same in some of the joints.

        Raises:
            ValueError: It depends on another one.
        """
        others = [j for j in range(self.values.ndim) if j not in joints]
        if any(self.values.shape[j] > 1 for j in others):
            raise ValueError("a covering leaves out a joint that counts")
        kept = self.values.reshape([n for j, n in enumerate(self.values.shape) if j in joints])
        return replace(self, values=kept)

    def moved(self, motions: "list[Motion]") -> "Form":
        """The same, where what motions change of it counts as error."""
        error = self.error
        for motion in motions:
            signs = np.ones(())
            of_joints = zip(self.values.shape, motion.mirrors, motion.turns, strict=True)
            for n, mirror, turn in of_joints:
                k = (np.arange(n) + 1) // 2
                sine = (np.arange(n) % 2 == 0) & (k > 0)
                own = np.where(turn & (k % 2 == 1), -1, 1) * np.where(mirror & sine, -1, 1)
                signs = signs[..., None] * own
            changed = float(np.abs(self.values[signs < 0]).sum())
            error += 2 * changed * (1 + self.values.size * U)
        return replace(self, error=error)


@dataclass(frozen=True, eq=False)
class Domain:
    """The joints that a covering is about, and the intervals that it must cover.

    Attributes:
        joints: Indices (v,) of free joints.
        limits: Intervals (2, v) [rad or m], of angles at most one turn.
        slides: Which joints (v,) are prismatic.
        degrees: Degree (v,) of every vector of the chain in each: one where a joint moves alone,
            and the sum of all turns for one of its drive.
    """

    joints: list[int]
    limits: Array
    slides: Mask
    degrees: Indices

    @classmethod
    def of(cls, setting: Setting) -> "Domain":
        """All joints that are designed.

        Raises:
            ValueError: There are too many, or none, or one moves others by no whole turns.
        """
        if not setting.free:
            raise ValueError("no joint is designed")
        if len(setting.free) > MOST_FREE_JOINTS:
            raise ValueError(f"a covering of more than {MOST_FREE_JOINTS} joints is not checked")
        low, high = setting.limits[:, setting.free]
        slides = setting.chain.prismatic[setting.free]
        high = np.where(slides, high, np.minimum(high, low + TURN))
        degrees = _degrees(setting.chain)[setting.free]
        if np.prod(DEGREE * degrees * np.where(slides, 1.0, 2.0) + 1) > MOST_POSES:
            raise ValueError(f"a grid of more than {MOST_POSES} poses is not checked")
        return cls(list(setting.free), np.stack([low, high]), slides, degrees)

    def within(self, j: int) -> Form | None:
        """Zero or more within the limits of a joint, a cosine less one; None of a whole turn."""
        low, high = self.limits[:, j]
        if high - low >= TURN:
            return None
        middle, half = (low + high) / 2, (high - low) / 2
        values = np.array([-np.cos(half), np.cos(middle), np.sin(middle)])
        shape = [3 if i == j else 1 for i in range(len(self.joints))]
        return Form(values.reshape(shape), (8 + 4 * (abs(low) + abs(high))) * U)

    def grid(self, order: int) -> list[Array]:
        """Places along each joint that determine products of so many vectors of the chain."""
        found = []
        parts = zip(self.limits.T, self.slides, (order * self.degrees).tolist(), strict=True)
        for (low, high), slides, degree in parts:
            if slides:
                x = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
                found.append((low + high) / 2 + (high - low) / 2 * x)
            else:
                # At most half a turn away from zero, where angles round less.
                places = (np.arange(2 * degree + 1) + degree) % (2 * degree + 1) - degree
                found.append(TURN * places / (2 * degree + 1))
        return found

    def form(self, values: Array, order: int, error: float) -> Form:
        """The polynomial with these values (k,) on the grid, each of which may be off by so much.

        Errors of values move it by Lebesgue's constant of each joint at most; of N angles it is
        ``sum_k 1/(N sin((2k + 1) pi/2N))``, taken between two of them (Ehlich and Zeller, 1966).
        With functions scaled so that their squares have the sum N anywhere, the analysis of N
        values is orthogonal but for ``sqrt(N)``, so that by Cauchy and Schwarz a product rounds by
        ``sqrt(N)`` times its own roundings, in the norm of all values. Along a length the inverse
        is taken as it is, norm by norm.
        """
        values = values.reshape([len(x) for x in self.grid(order)])
        norm = float(np.linalg.norm(values))
        lebesgue = gain = 1.0
        rounds = 0.0
        for j, slides in enumerate(self.slides):
            B = _analysis(order * int(self.degrees[j]), bool(slides))
            n = len(B)
            if slides:
                size = n * float(np.linalg.norm(np.abs(B), 2))
                lebesgue *= size
                gain *= size / np.sqrt(n)
                rounds += (n + 20) * U * size
            else:
                places = np.pi * (2 * np.arange(n) + 1) / (2 * n)
                lebesgue *= float((1 / np.sin(places)).sum()) / n
                rounds += (n + 20) * U * np.sqrt(n)
            values = np.moveaxis(np.tensordot(B, values, (1, j)), 0, j)
        return Form(values, 1.01 * (lebesgue * error + gain * rounds * norm)).trimmed()


def _analysis(degree: int, slides: bool) -> Array:
    """From values on the grid to coefficients (n, n)."""
    if slides:
        x = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
        return np.linalg.inv(np.vander(x, increasing=True))
    n = 2 * degree + 1
    turns = TURN / n * (np.outer(np.arange(1, degree + 1), np.arange(n)) % n)
    both = np.stack([np.cos(turns), np.sin(turns)], axis=1).reshape(-1, n)
    return np.concatenate([np.ones((1, n)), 2 * both]) / n


@dataclass(frozen=True, eq=False)
class Beam:
    """What the sensitivity to readings of a tracker is made of besides.

    Attributes:
        growth: How errors grow.
        squared: The squared distance s [m^2].
        inline: ``Q = <Z, A'b b'A>`` of the beam b.
        prior: ``<Z, M0>``, which is in no form.
    """

    growth: Growth
    squared: Form
    inline: Form
    prior: float


@dataclass(frozen=True, eq=False)
class Polynomials:
    """What a covering of one multiplier and one load is about.

    Attributes:
        domain: The joints.
        sensitivity: d; or ``<Z, M>`` where it counts per trace; or ``<Z, A'A>`` of rows that are
            not whitened where a tracker reads them.
        trace: The trace of M then; None where it does not.
        slacks: Feasible poses have none below zero; by their letter in `SLACKS`.
        beam: How the tracker's errors grow; None where errors are white.
    """

    domain: Domain
    sensitivity: Form
    trace: Form | None
    slacks: dict[str, Form]
    beam: Beam | None = None

    @classmethod
    def of(
        cls, setting: Setting, Z: Multipliers, prior: Array, wrench: Array, per_trace: bool
    ) -> "Polynomials":
        """Those of one multiplier (1, p, p), under one load (9,).

        Raises:
            ValueError: What is measured is no polynomial of the joints, or has not been derived.
        """
        require_checkable(setting)
        domain = Domain.of(setting)
        noise, growth, setting = setting.noise, _growth(setting), _white(setting)
        if noise is not None and (per_trace or Z.indefinite):
            raise ValueError("noise that is not white only bounds what a pose tells from above")
        order = _order(setting)
        q = _poses(setting, domain, order)
        found, error, most = _told(setting, Z.Z[0], Z.scale[0], q, wrench)
        known = float((Z.Z[0] * prior).sum())
        own = 8 * U * float(np.abs(Z.Z[0] * prior).sum())
        # A multiplier that is not semidefinite by rounding is lifted; that adds so much at most.
        lift = float(Z.lift[0])
        own += lift * float(Z.scale[0] @ np.sqrt(np.diag(prior))) ** 2
        if growth is not None and noise is not None and noise.tracker is not None:
            d = domain.form(found, order, error + lift * most)
            beam = _beam(setting, growth, noise.tracker[0], domain, Z, wrench)
            return cls(domain, d, None, _slacks(setting, domain), replace(beam, prior=known + own))
        d = domain.form(found + known, order, error + lift * most + own)
        trace = None
        if per_trace:
            ones = np.ones(setting.p)
            squares, error, _ = _told(setting, np.eye(setting.p), ones, q, wrench)
            own = 8 * U * float(np.trace(prior))
            trace = domain.form(squares + np.trace(prior), order, error + own)
        return cls(domain, d, trace, _slacks(setting, domain))

    def seen(self, joints: list[int], links: list[Link], motions: list[Motion]) -> "Polynomials":
        """The same in some of the joints, with sums for some, where motions tell of the whole."""

        def one(form: Form) -> Form:
            form = form.over(joints)
            for link in links:
                form = link.of(form)
            return form.moved(motions)

        kept = Domain(
            [self.domain.joints[j] for j in joints],
            self.domain.limits[:, joints],
            self.domain.slides[joints],
            self.domain.degrees[joints],
        )
        trace = None if self.trace is None else one(self.trace)
        beam = self.beam
        if beam is not None:
            beam = replace(beam, squared=one(beam.squared), inline=one(beam.inline))
        limits = [self.domain.within(joints[link.second]) for link in links]
        own = zip(OF_LINKS, (form for form in limits if form is not None), strict=False)
        slacks = {letter: one(form) for letter, form in (self.slacks | dict(own)).items()}
        return Polynomials(kept, one(self.sensitivity), trace, slacks, beam)

    def blur(self, limit: float) -> float:
        """About how far rounding moves a sensitivity near a limit.

        It is what is held against boxes, so that those of an honest file close at a limit that is
        lifted by it. Per trace it is more where the trace is below its mean: twice is a guess. Of a
        tracker it is that at the mean distance.
        """
        if self.beam is not None:
            distance = np.abs(self.beam.squared.values.flat[:1])
            return self.sensitivity.error / float(self.beam.growth.variance(distance)[0])
        if self.trace is None:
            return self.sensitivity.error
        mean = float(self.trace.values.flat[0])
        return 2 * (self.sensitivity.error + abs(limit) * self.trace.error) / mean

    def tested(self, limit: float) -> Form:
        """A polynomial that is at most zero where the sensitivity is at most the limit."""
        d = self.sensitivity
        values = d.values.copy()
        if self.trace is None:
            values[(0,) * values.ndim] -= limit
            return Form(values, d.error + 2 * U * (limit + d.size))
        shape = tuple(np.maximum(values.shape, self.trace.values.shape))
        both = d.padded(shape) - limit * self.trace.padded(shape)
        error = d.error + abs(limit) * (self.trace.error + 4 * U * self.trace.size)
        return Form(both, error + 4 * U * d.size)


def require_checkable(setting: Setting) -> None:
    """Refuse a setting whose sensitivity has not been shown to be of degree four in each joint.

    Columns of the Jacobian are of degree one in each joint, and so are loads of wrenches and
    weights: their product is of degree two. A column of geometry is one axis of a frame, or its
    product with the way from there to a marker, which joints before the frame turn together: of
    degree one as well. Where a drive turns several joints, each adds its own turns, see `_degrees`.

    Raises:
        ValueError: It has noise of another kind, compensators, friction, wires, or joints that
            follow others by parts of a turn.
    """
    physics = setting.physics
    geometry = setting.geometry
    wires = physics is not None and any(kind == "distance" for kind, _, _ in physics.sensors)
    pulls = physics is not None and any(isinstance(one, Pull) for one in physics.weights)
    for given, what in (
        (geometry is not None and not _is_linear(geometry), "springs of other laws"),
        (setting.gives is not None or pulls, "compensators"),
        (setting.friction is not None, "friction"),
        (setting.price is not None, "costs"),
        (setting.sight is not None, "markers that are hidden in some poses"),
        (wires, "distances"),
        (len(setting.free) > MOST_FREE_JOINTS, f"more than {MOST_FREE_JOINTS} joints"),
        (
            setting.load.listed is None and setting.load.direction is None,
            "forces in all directions",
        ),
    ):
        if given:
            raise ValueError(f"a covering of poses is not checked here with {what}")
    _growth(setting)
    _degrees(setting.chain)


def _is_linear(geometry: Geometry) -> bool:
    """Whether all parameters are errors of frames, or springs that turn as their load does."""
    each = geometry.parameters
    pulls = any(isinstance(one, Pull) for one in geometry.payload)
    return not pulls and all(not one.law and one.place != "compensator" for one in each)


def _order(setting: Setting) -> int:
    """How many vectors of the chain a sensitivity multiplies."""
    geometry = setting.geometry
    bends = geometry is None or any(one.place in BENDING for one in geometry.parameters)
    return DEGREE if bends else DEGREE // 2


def _told(
    setting: Setting, Z: Array, scale: Array, q: Array, wrench: Array
) -> tuple[Array, float, float]:
    """``sum_r A_r'Z A_r`` (k,) of rows A in poses q (k, n), and what `_rounding` says of it."""
    found = []
    error = most = 0.0
    for first in range(0, len(q), POSES_AT_ONCE):
        some = q[first : first + POSES_AT_ONCE]
        A = setting.whitened_rows(some, np.broadcast_to(wrench, (len(some), 9)))
        found.append(np.einsum("kra,kra->k", A @ Z, A))
        off, most = _rounding(setting, scale, A, wrench)
        error = max(error, off)
    return np.concatenate(found), error, most


def _growth(setting: Setting) -> Growth | None:
    """How errors grow with the distance of a tracker, which are no larger than the noise.

    What the joints scatter, and what the model leaves out with the load, only add to a covariance.
    None where errors are white but for these.

    Raises:
        ValueError: The tracker sees several markers, of which there is no polynomial, or errors
            vanish. Along its beam they may be smaller where no joint slides: then ``b'dp/dq_j`` is
            half the slope of ``b'b``, of degree one in each joint, and Q is of degree four.
    """
    noise = setting.noise
    if noise is None:
        return None
    white = setting.sigma**2 + noise.discrepancy**2
    geometry = setting.geometry
    if geometry is not None and (noise.tracker is not None or geometry.changes):
        raise ValueError("a covering of poses is not checked here with such a noise of positions")
    if noise.tracker is None:
        if not (white > 0).all():
            raise ValueError("a covering of poses is not checked here with errors that vanish")
        return None
    physics = setting.physics
    if physics is None or [kind for kind, _, _ in physics.sensors] != ["position"]:
        raise ValueError("a covering of poses is not checked here with a tracker's other readings")
    growth = Growth.of(noise, float(white[0]), _reach(setting))
    slides = setting.chain.slides.any() and not growth.is_round
    if np.ptp(white) or slides or growth.vanishes:
        raise ValueError("a covering of poses is not checked here with such a tracker")
    return growth


def _white(setting: Setting) -> Setting:
    """The same with white errors that are no larger; of one metre where a tracker adds to them."""
    noise = setting.noise
    if noise is None:
        return setting
    sizes = np.sqrt(setting.sigma**2 + noise.discrepancy**2) * (1 - 4 * U)
    return replace(setting, noise=None, sigma=sizes if noise.tracker is None else np.ones(3))


def _beam(
    setting: Setting, growth: Growth, tracker: Array, domain: Domain, Z: Multipliers, wrench: Array
) -> Beam:
    """The forms of a tracker (3,) that sees one marker, of errors of one metre in the setting.

    A beam is off by what its end is, and its product with a column by the errors of both.
    """
    assert setting.physics is not None
    ((_, place, _),) = setting.physics.sensors
    off = _roundings(setting) * float(_lengths(setting)[0]) + 4 * U * float(np.abs(tracker).sum())
    b = setting.chain.point(_poses(setting, domain, 2), place.offset, place.joint) - tracker
    s = np.square(b).sum(axis=1)
    error = 2 * float(np.sqrt(s.max())) * off + off**2 + 8 * U * float(s.max())
    squared = domain.form(s, 2, error)
    if growth.is_round:
        return Beam(growth, squared, Form(np.zeros((1,) * len(domain.joints)), 0.0), 0.0)
    q = _poses(setting, domain, DEGREE)
    b = setting.chain.point(q, place.offset, place.joint) - tracker
    A = setting.whitened_rows(q, np.broadcast_to(wrench, (len(q), 9)))
    y = np.einsum("kr,kra->ka", b, A)
    wrong, bound = (float(one.max()) for one in _of_columns(setting, Z.scale[0], wrench))
    length = np.abs(b).sum(axis=1)
    each = length * (wrong + 4 * U * (bound + wrong)) + 3 * off * (bound + wrong)
    computed = np.abs(y) @ Z.scale[0]
    errors = 2 * computed * each + each**2 + (4 * setting.p + 12) * U * computed**2
    lifted = float(Z.lift[0]) * float(np.square(computed + each).max())
    found = np.einsum("ka,ab,kb->k", y, Z.Z[0], y)
    return Beam(growth, squared, domain.form(found, DEGREE, float(errors.max()) + lifted), 0.0)


def _degrees(chain: Chain) -> Indices:
    """Degree (n,) of every vector of the chain in each of its drives.

    A joint that turns r times for one turn of its drive has the cosine of ``r t``; a product of
    joints adds their degrees. Lengths are of degree one, however many slide together.

    Raises:
        ValueError: A joint turns by a ratio that is not whole, or turns where another one slides.
    """
    P = chain.ties[0]
    turning = P[~chain.slides]
    across = np.where(chain.prismatic, turning.any(axis=0), P[chain.slides].any(axis=0))
    if (turning != np.round(turning)).any() or across.any():
        raise ValueError(
            "a covering of poses is not checked here with joints that follow by another ratio than "
            "one of whole turns"
        )
    return np.where(chain.prismatic, 1, np.abs(turning).sum(axis=0)).astype(int)


def _poses(setting: Setting, domain: Domain, order: int) -> Array:
    """All poses (k, n) of the grid."""
    mesh = np.meshgrid(*domain.grid(order), indexing="ij")
    q = np.tile(setting.fixed, (mesh[0].size, 1))
    q[:, domain.joints] = np.stack([one.ravel() for one in mesh], axis=1)
    return q


def _travel(setting: Setting) -> Array:
    """How far each of all joints (N,) goes from zero at most [rad or m]."""
    P, b = setting.chain.ties
    slides = setting.chain.prismatic
    limits = np.where(slides, np.abs(setting.limits).max(axis=0), np.pi)
    drives = np.maximum(limits, np.abs(setting.fixed))
    return np.asarray(np.abs(P) @ drives + np.abs(b))


def _roundings(setting: Setting) -> float:
    """Roundings of a column of the Jacobian, in units of the arm's length; see `_rounding`.

    The angle of a joint that drives turn is a sum of k products and an offset, which rounds by
    ``(k + 1) U`` of what it is made of, and moves a frame by ``sqrt(2)`` times that.
    """
    P, b = setting.chain.ties
    alone = ((P != 0).sum(axis=1) == 1) & (np.abs(P).sum(axis=1) == 1) & (b == 0)
    terms = (P != 0).sum(axis=1) + 3.35
    angles = np.where(setting.chain.slides, 0.0, np.sqrt(2) * terms * _travel(setting))
    of_angle = float(np.where(alone, OF_ANGLE, np.maximum(angles, OF_ANGLE)).max())
    return (OF_JOINT + 3 * of_angle) * len(P) * U


def _reach(setting: Setting) -> float:
    """How far the one marker is from the origin at most [m]."""
    assert setting.physics is not None
    ((_, place, _),) = setting.physics.sensors
    chain = setting.chain
    links = np.concatenate([[chain.base, chain.tool], chain.origins])[:, :3, 3]
    own = np.linalg.norm(links, axis=1).sum() + _travel(setting)[chain.slides].sum()
    return float(own + np.linalg.norm(place.offset))


def _lengths(setting: Setting) -> Array:
    """How far points of tool, load and instruments are at most (1 + n,) [m].

    First from the base, then from each joint. At least one, as directions count like lengths.
    """
    chain = setting.chain
    travel = _travel(setting)
    steps = np.linalg.norm(chain.origins[:, :3, 3], axis=1) + np.where(chain.slides, travel, 0.0)
    behind = np.append(np.cumsum(steps[::-1])[::-1][1:], 0.0)
    base, tool = (float(np.linalg.norm(one[:3, 3])) for one in (chain.base, chain.tool))
    places = []
    if setting.physics is not None:
        places = [place for _, place, _ in setting.physics.sensors]
        weights = [*setting.physics.weights]
        if setting.geometry is not None:
            weights += setting.geometry.payload
        places += [one[1] for one in weights if not isinstance(one, Pull)]
        places.append(setting.physics.load_point)
    tool += max((float(np.linalg.norm(place.offset)) for place in places), default=0.0)
    return (
        np.maximum(np.append(base + steps.sum(), behind + np.where(chain.slides, travel, 0)), 1.0)
        + tool
    )


def _rounding(setting: Setting, scale: Array, A: Array, wrench: Array) -> tuple[float, float]:
    """By how much ``sum_r A_r'Z A_r`` may be off, and a bound on ``sum_r (sum_a s_a |A_ra|)^2``.

    One product of rotations rounds by 12 units in Frobenius norm, Rodrigues' formula by 15, and an
    angle of the grid by 2.35 units of half a turn, which moves a frame by 13 at most, so that
    a frame behind N joints is off by 40 N units, and a point by 44 N times the length of the arm L.
    A column of the Jacobian has the errors of an axis and of two points, 128 N L, and few of its
    own. With a column of size c, and a load of the joint of size t, which is off as the column is,
    an entry is off by 135 N units of ``L t + c T``, where T is what the load does at the length L.
    The column of a drive is the sum of those of its joints, each as often as it turns.

    Args:
        setting: Robot and instruments.
        scale: Numbers s (p,) so large that ``|Z_ab|`` is at most ``s_a s_b``.
        A: Whitened rows (k, rows, p) that were computed.
        wrench: The load (9,).
    """
    off, bound = _of_columns(setting, scale, wrench)
    computed = np.abs(A) @ scale
    own = (4 * setting.p + len(setting.sigma) + 8) * U * np.square(computed).sum(axis=1)
    error = 2 * (computed * off).sum(axis=1) + own
    return float(error.max() + 2 * np.square(off).sum()), float(np.square(bound + off).sum())


def _of_columns(setting: Setting, scale: Array, wrench: Array) -> tuple[Array, Array]:
    """Roundings of ``sum_a s_a |A_ra|`` (rows,), and bounds on it, see `_rounding`."""
    force, moment, lever = (float(np.linalg.norm(part)) for part in wrench.reshape(3, 3))
    if setting.physics is not None:
        force += GRAVITY * sum(
            one[0] for one in setting.physics.weights if not isinstance(one, Pull)
        )
    lengths = _lengths(setting) + lever
    if setting.geometry is not None:
        return _of_geometry(setting, setting.geometry, scale, force, moment, lengths[0])
    torques = force * lengths + moment
    turns = np.abs(setting.chain.ties[0])[:, setting.unknown].T
    of_each, loads = turns @ lengths[1:], turns @ torques[1:]
    count = turns.sum(axis=1)
    units = _roundings(setting)
    sums = count * (lengths[0] * loads + of_each * torques[0])
    off = units * float(scale @ sums) / setting.sigma
    return off, float(scale @ (of_each * loads)) / setting.sigma


def _of_geometry(
    setting: Setting, geometry: Geometry, scale: Array, force: float, moment: float, length: float
) -> tuple[Array, Array]:
    """Those of columns of geometry, none of which has a longer lever than the whole arm.

    A spring has the product of a column and a load for each of its ends, which is off as both are,
    and each may be a sum over the joints that its drive turns.
    """
    turned = float(np.abs(setting.chain.ties[0]).sum(axis=0).max()) ** 2
    force += GRAVITY * sum(one[0] for one in geometry.payload if not isinstance(one, Pull))
    load = force * length + moment
    sizes, off = np.zeros((2, setting.p))
    for a, one in enumerate(geometry.parameters):
        springs = one.place in BENDING
        answer = turned * load * unit_of(one) * max(len(one.ends), 1)
        sizes[a] = length * (answer if springs else UNIT)
        off[a] = sizes[a] * (2 if springs else 1)
    # Loaded less unloaded: the errors of both.
    twice = 2.0 if geometry.changes else 1.0
    bound = twice * float(scale @ sizes) / setting.sigma
    return twice * _roundings(setting) * float(scale @ off) / setting.sigma, bound


def _slacks(setting: Setting, domain: Domain) -> dict[str, Form]:
    """The constraints as polynomials of degree one and two, at least zero where they hold.

    Poses to stay away from are left out: without them more poses count.
    """
    workspace = setting.workspace
    chain = setting.chain
    length = float(_lengths(setting)[0])
    of_axis = _roundings(setting)
    of_point = of_axis * length
    given: dict[str, tuple[Callable[[Array, Array], Array], int, float]] = {}
    if workspace.height is not None:
        height = workspace.height
        given["h"] = (lambda point, axis: point[:, 2] - height, 1, of_point + 2 * U * abs(height))
    if workspace.radius is not None:
        squared = workspace.radius**2
        error = 3 * length * of_point + 8 * U * squared
        given["r"] = (lambda point, axis: (point[:, :2] ** 2).sum(axis=1) - squared, 2, error)
    if workspace.tilt is not None and workspace.tilt < np.pi / 2:
        steepest = float(np.sin(workspace.tilt))
        given["u"] = (lambda point, axis: steepest - axis[:, 2], 1, of_axis)
        given["d"] = (lambda point, axis: steepest + axis[:, 2], 1, of_axis)
    found = _coupled(setting, domain)
    for letter, (slack, order, error) in given.items():
        values = slack(*chain.tool_point_and_axis(_poses(setting, domain, order)))
        found[letter] = domain.form(values, order, error)
    return found


def _coupled(setting: Setting, domain: Domain) -> dict[str, Form]:
    """``cos(r q - middle) - cos(half)`` of each joint that drives turn between limits of its own.

    It is at least zero within these, and a whole turn beside them, too. Wider limits are none.
    """
    sums, ends = setting.chain.coupled
    low, high = ends + setting.workspace.margin * np.array([[1.0], [-1.0]])
    turns = ~(sums != 0)[:, setting.chain.prismatic].any(axis=1)
    q = _poses(setting, domain, 1)
    found: dict[str, Form] = {}
    for letter, j in zip(COUPLED, np.flatnonzero(turns & (high - low < TURN)), strict=False):
        middle, half = (low[j] + high[j]) / 2, (high[j] - low[j]) / 2
        values = np.cos(q @ sums[j] - middle) - np.cos(half)
        reach = float((np.abs(q) @ np.abs(sums[j])).max()) + abs(low[j]) + abs(high[j])
        error = (8 + (len(sums[j]) + 8) * reach) * U
        found[letter] = domain.form(values, 1, error)
    return found
