"""Sensitivity and constraints as polynomials of the joints, from their values on a grid of poses.

The page "A bound over every pose" of the documentation has the theorems and their proofs.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from edtk.certificate.recompute.chain import Pull
from edtk.certificate.recompute.forms import (
    DEGREE,
    MOST_FREE_JOINTS,
    TURN,
    Domain,
    Form,
    Link,
    Motion,
    U,
    degrees_of,
)
from edtk.certificate.recompute.geometry import UNIT, Geometry, unit_of
from edtk.certificate.recompute.physics import GRAVITY, Noise
from edtk.certificate.recompute.setting import Setting
from edtk.certificate.recompute.tasks import EPS
from edtk.certificate.recompute.values import Multipliers
from edtk.system.typing import Array

OF_FACTORS = 50 * EPS  # of a factor, beside the sizes of what it is made of
DISTANT = 4.0  # of a box: its largest squared distance over its least one is no more
# Roundings of kinematics for each joint of the chain, from above, without those of its angle, and
# those of an angle that turns by itself; see `_rounding`.
OF_JOINT = 96.0
OF_ANGLE = 13.0
COUPLED = "ABCEFG"  # letters of the limits of coupled joints
OF_LINKS = "KLMNP"  # and of the limits of joints whose angles are no variables, see `Link`
BENDING = ("compliance", "spring")  # parameters that load turns
POSES_AT_ONCE = 1 << 15


@dataclass(frozen=True, eq=False)
class Growth:
    """Variances of a reading, a white part and so many times ``(a + b r)^2`` at a distance r.

    With variances l across the beam b, e along it, ``s = b'b``, ``N = <Z, A'A>`` and
    ``Q = <Z, A'b b'A>`` the sensitivity to readings of a tracker is ``(N + (l - e)/(e s) Q)/l``.
    The page "A bound over every pose" of the documentation has the theorem that bounds it on a box,
    and its proof.

    Attributes:
        white: The white part [m^2].
        readings: Readings of which a row is made.
        along: a [m] and b [m/m] along the beam (2,), at most those across it.
        across: a and b across it (2,).
        nearest: No squared distance is less [m^2].
    """

    white: float
    readings: int
    along: Array
    across: Array
    nearest: float

    @classmethod
    def of(cls, noise: Noise, white: float, reach: float) -> "Growth":
        """That of a tracker; along the beam errors count as no larger than across it.

        Args:
            noise: The noise.
            white: The white part [m^2].
            reach: The largest distance of its marker from the origin [m].
        """
        assert noise.tracker is not None
        position, along, across = noise.tracker
        away = float(np.linalg.norm(position))
        apart = max(0.0, away - reach - OF_FACTORS * (away + reach))
        return cls(white, noise.readings, np.minimum(along, across), across, apart**2)

    @property
    def vanishes(self) -> bool:
        """Whether there may be no error at the least distance."""
        return not float(self.along_beam(np.array(self.nearest))) > 0

    @property
    def is_round(self) -> bool:
        """Whether errors are alike in all directions."""
        return bool((self.along == self.across).all())

    def variance(self, squared: Array) -> Array:
        """The variance l [m^2] across beams of squared lengths (L,)."""
        return self.white + self.readings * self._spread(self.across, squared) ** 2

    def along_beam(self, squared: Array) -> Array:
        """The variance e [m^2] along them."""
        return replace(self, across=self.along).variance(squared)

    def ratio(self, longest: Array, shortest: Array) -> Array:
        """The variance l at a distance over e at another one."""
        return self.variance(longest) / self.along_beam(shortest)

    def inline(self, squared: Array) -> Array:
        """``(l - e)/(e s)`` [1/m^2]."""
        apart = self._spread(self.across - self.along, squared)
        both = self._spread(self.across + self.along, squared)
        return self.readings * apart * both / (self.along_beam(squared) * squared)

    def factors(self, limit: float, s: Array, Q: Array, near: bool) -> Array:
        """Factors (L, 4) of N, s, Q and one, whose sum is at most zero only if d is at most u.

        l is concave in s and ``k = (l - e)/(e s)`` falls and is convex, so that between the ends
        of a box the chord of l is below it and that of k above. With the least Q_0,
        ``k Q <= k_0 Q + Q_0 (chord - k_0)``; near the tracker ``Q <= s N``.

        Args:
            limit: The limit u.
            s: Squared distances (2, L), at most and at least those of each box.
            Q: Least values (L,) on each box.
            near: Whether ``Q <= s N`` is used in all of them; else where boxes are no farther.
        """
        first, last = self.variance(s)
        rise = _chord(first, last, s)
        found = np.zeros((s.shape[1], 4))
        found[:, 0] = 1.0
        found[:, 1] = -limit * rise
        found[:, 3] = limit * (rise * s[0] - first)
        size = limit * (first + rise * s[1])
        if not self.is_round:
            close = (s[1] > DISTANT * s[0]) | near
            found[close, 0] = self.ratio(s[1, close], s[0, close]) * (1 + OF_FACTORS)
            of, ends = np.maximum(Q[~close], 0.0), s[:, ~close]
            before, after = self.inline(ends)
            before = before * (1 + OF_FACTORS)
            fall = of * _chord(before, after, ends)
            found[~close, 1] += fall
            found[~close, 2] = before
            found[~close, 3] -= fall * ends[0]
            size[~close] += of * before - fall * ends[1]
        found[:, 3] += OF_FACTORS * size
        return found

    @staticmethod
    def _spread(coefficients: Array, squared: Array) -> Array:
        return np.asarray(coefficients[0] + coefficients[1] * np.sqrt(squared))


def _chord(first: Array, last: Array, ends: Array) -> Array:
    """Slopes (L,) between two values; zero between ends (2, L) that are one."""
    width = ends[1] - ends[0]
    return np.asarray(np.where(width > 0, last - first, 0.0) / np.where(width > 0, width, 1.0))


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
    degrees_of(setting.chain)


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
