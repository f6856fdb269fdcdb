"""The power of a plan of visits to notice faults and to tell them apart."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from edtk.calibration.detect import (
    FAULTS,
    HELPS,
    SizedFamily,
    SizedFault,
    right_share,
    sized_faults,
    times_to_tell,
)
from edtk.calibration.detect import UNITS as SI
from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.calibration.geometry_design.geometry_space import PositionRows
from edtk.calibration.template import visit_order
from edtk.design.candidate_source import sample_feasible
from edtk.design.detection import LEVEL, Detection, Separation
from edtk.design.plan import Plan
from edtk.findings.causes.family import (
    SHORT_LINK,
    USUAL_DRIFT,
    USUAL_LINK,
    USUAL_LOSS,
    USUAL_PLAY,
    USUAL_SHARE,
    USUAL_TILT,
    USUAL_TOOL,
    USUAL_TURN,
    USUAL_ZERO,
    Family,
    since_first,
)
from edtk.fit.distributions import chi_square_quantile, noncentral_chi_square_tail
from edtk.measure.noise import PositionNoise
from edtk.measure.parameters import SHIFTS, SOFTNESS, GeometricParameter, all_parameters
from edtk.robots.joint import Joint
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array, Indices

USUAL_MOVE = 0.5e-3  # by which a tripod is pushed [m]
STEP = 1e-6  # of a numerical derivative [rad]
MILLI = 1e-3
BY_LOADS = ("load_size", "load_direction", "torque_sign", "backlash", "friction")
# Of these the sizes of the springs say how much a load shows; play needs none.
BY_SPRINGS = ("load_size", "load_direction", "torque_sign", "friction")
CANDIDATES = 100  # visits among which one more is looked for
DEPENDENT = 1e-9  # singular value of scaled columns, beside the largest, that is rounding


# Units of the faults' sizes; those of a joint mean the joint in which it is hardest to see.
UNITS = {**FAULTS, "frame_moved": "mm"}


@dataclass(frozen=True, eq=False)
class VisitFault:
    """A fault, and what one SI unit of its size adds to visits.

    Attributes:
        name: Its name.
        D: What it adds (m, rows, dims), in units of the noise.
        usual: The size that such faults usually have, in SI units.
        joint: The joint that it is in; empty for none.
        tries: How many faults of the kind there are.
        only_positive: Whether there is none of a negative size.
    """

    name: str
    D: Array
    usual: float
    joint: str = ""
    tries: float = 1
    only_positive: bool = False

    @property
    def dims(self) -> int:
        """Number of its parameters."""
        return int(self.D.shape[-1])


@dataclass(frozen=True, eq=False)
class Visits:
    """Visits in the order of a day.

    Attributes:
        question: The question of the study.
        q: Poses (m, n) [rad or m].
        wrench: Their loads (m, 6) [N, N m].
        time: When each is made (m,), from 0 at the beginning of the day to 1 at its end, as a drift
            counts it (`since_first`).
    """

    question: GeometryQuestion
    q: Array
    wrench: Array
    time: Array

    def faults(self, name: str, k: Array | None) -> Iterator[VisitFault]:
        """The faults of a name, to first order about the drawing; one for each joint, or one.

        Args:
            name: One of `UNITS`.
            k: Compliances (n,) of the unknown joints [rad/(N m)]; None where nobody told them.
        """
        base = self._columns("base")
        if name.startswith("tool_"):
            axis = "xyz".index(name[-1])
            markers = self._columns("tool").reshape(*base.shape[:2], -1, len(SHIFTS))
            yield VisitFault(name, markers.sum(axis=2)[..., [axis]], USUAL_TOOL[axis])
        elif name == "frame_rotation":
            yield VisitFault(name, base[..., 3:], USUAL_TURN)
        elif name == "frame_moved":
            late = (self.time > 0.5)[:, None, None]
            yield VisitFault(name, base[..., :3] * late, USUAL_MOVE)
        elif name == "drift":
            yield VisitFault(name, base[..., :3] * self.time[:, None, None], USUAL_DRIFT)
        elif name == "load_size":
            assert k is not None
            yield VisitFault(name, self._bent(2 * self.wrench, k) - self._bent(self.wrench, k), 0.1)
        elif name == "load_direction":
            assert k is not None
            yield self._askew(k)
        elif name == "joint_zero":
            yield from self._zeros()
        elif name == "link_length":
            yield from self._links()
        else:
            yield from self._by_sign(name, k)

    def _columns(self, place: str) -> Array:
        """Rows (m, rows, columns) of shifts and turns of the base, or of shifts of the markers.

        They are for a metre or a radian.
        """
        model = self.question.model
        unknown = all_parameters(
            model.robot, model.markers, (), base=place == "base", tool=place == "tool"
        )
        return self._moved(unknown)

    def _moved(self, unknown: tuple[GeometricParameter, ...]) -> Array:
        """Rows (m, rows, columns) of lengths and angles, for a metre or a radian."""
        model = replace(self.question.model, parameters=unknown)
        rows = PositionRows(model, self.question.setting.loads, self._noise)
        return rows(self.q, self.wrench) / MILLI

    def _before(self, joint: Joint) -> Array:
        """Rows (m, rows, 6) of shifts and turns of the frame before a joint."""
        robot = self.question.model.robot
        return self._moved(all_parameters(robot, (), [joint.name], base=False, tool=False))

    def _zeros(self) -> Iterator[VisitFault]:
        """A joint that is counted from a zero that is off."""
        joints = self.question.model.robot.joints
        for joint in joints:
            if joint.kind == "revolute":
                D = self._before(joint)[..., 3:] @ joint.axis[:, None]
                usual = USUAL_ZERO["revolute"]
                yield VisitFault("joint_zero", D, usual, joint.name, len(joints))

    def _links(self) -> Iterator[VisitFault]:
        """A link that is longer than drawn, which the joint at its end names."""
        found = []
        for joint in self.question.model.robot.joints:
            link = joint.origin[:3, 3]
            length = float(np.linalg.norm(link))
            if length > SHORT_LINK:
                along = joint.origin[:3, :3].T @ link / length
                found.append((joint.name, self._before(joint)[..., :3] @ along[:, None]))
        for name, D in found:
            yield VisitFault("link_length", D, USUAL_LINK, name, len(found))

    @property
    def _noise(self) -> PositionNoise:
        """The errors by which all is whitened."""
        return self.question.setting.noise

    def _springs(self, wrench: Array) -> Array:
        """Rows (m, rows, springs) of the unknown springs under other wrenches, for 1 rad/(N m)."""
        model = self.question.model
        names = self.question.study.specification.joints.unknown
        unknown = all_parameters(model.robot, (), (), names, base=False, tool=False)
        loads = self.question.setting.loads
        rows = PositionRows(replace(model, parameters=unknown), loads, self._noise)
        return rows(self.q, wrench) / SOFTNESS

    def _bent(self, wrench: Array, k: Array) -> Array:
        """What wrenches bend (m, rows, 1)."""
        return (self._springs(wrench) @ k)[..., None]

    def _askew(self, k: Array) -> VisitFault:
        """The load is turned about the axes of the world that are not its own."""
        mean = self.wrench[:, :3].mean(axis=0)
        axes = np.linalg.svd(mean[None])[2][1:] if mean.any() else np.eye(3)
        columns = []
        for axis in axes:
            turned = [np.cross(axis, part) for part in (self.wrench[:, :3], self.wrench[:, 3:])]
            nudge = STEP * np.hstack(turned)
            ahead = self._bent(self.wrench + nudge, k) - self._bent(self.wrench - nudge, k)
            columns.append(ahead / (2 * STEP))
        return VisitFault("load_direction", np.concatenate(columns, axis=-1), USUAL_TILT)

    def _by_sign(self, name: str, k: Array | None) -> Iterator[VisitFault]:
        """A joint whose spring or position depends on the sign of its load, or that friction holds.

        Friction f takes ``f sign(tau)`` from the load tau of a spring.
        """
        study = self.question.study
        loads = self.question.setting.loads
        assert loads is not None
        unknown = list(study.unknown)
        torque = loads(self.q, self.wrench)[:, unknown]
        sign = np.sign(torque)[:, None]
        springs = self._springs(self.wrench)
        # A spring moves the marker by the torque: what is left is its sign.
        size = np.abs(torque)[:, None]
        play = np.divide(springs, size, out=np.zeros_like(springs), where=size > 0)
        both = (torque > 0).any(axis=0) & (torque < 0).any(axis=0)
        held = name == "friction"
        chosen = np.flatnonzero(torque.any(axis=0) if held else both)
        for i in chosen:
            joint = study.robot.joints[unknown[i]]
            if name == "torque_sign":
                assert k is not None
                D = k[i] * sign[..., [i]] * springs[..., [i]]
                usual = USUAL_SHARE
            elif joint.kind != "revolute":
                continue
            elif held:
                assert k is not None
                D = -k[i] * play[..., [i]]
                usual = USUAL_LOSS * float(size[..., i].mean())
            else:
                D = play[..., [i]]
                usual = USUAL_PLAY["revolute"]
            yield VisitFault(name, D, usual, joint.name, 2 * len(chosen), name != "torque_sign")


def sized_visit_faults(study: Study, given: Mapping[str, str]) -> tuple[SizedFault, ...]:
    """Read sizes of faults, like "5mm" or "3%", by the name of the fault.

    Args:
        study: The study, with [parameters].
        given: The sizes; "load" is short for "load_size".

    Raises:
        UserError: A fault or a unit is not known; nothing loads the springs; or the fault needs
            compliances, and the study has no [simulation].
    """
    faults = sized_faults(study, given, UNITS, BY_SPRINGS)
    for fault in faults:
        if fault.name in BY_LOADS and not study.unknown:
            message = f"{fault.name} shows in springs, and this study has none that is unknown"
            raise ArgumentError(message, argument="detect")
    return faults


def detect_in_visits(
    question: GeometryQuestion, plan: Plan, faults: Sequence[SizedFault]
) -> tuple[tuple[Detection, ...], tuple[Separation, ...]]:
    """Find how likely faults of a day would be noticed in the visits of a plan, and told apart.

    A fault of size c adds ``D c`` to the whitened positions. Of that the residuals show what no
    parameter takes up, ``(I - QQ') D c``; its squared length is the noncentrality of the chi-square
    statistic that tests for the fault. All is to first order about the drawing, and the visits are
    in the order of the sheet that `edtk template` writes.

    Args:
        question: The question of the study.
        plan: All visits.
        faults: Faults with their sizes.

    Returns:
        Detections in the order of the faults, and separations of each two that are ever noticed.
    """
    if not faults:
        return (), ()
    visits, count = _visits(question, plan)
    k = None
    if any(fault.name in BY_SPRINGS for fault in faults):
        k = question.study.compliances
    every = [list(visits.faults(fault.name, k)) for fault in faults]
    shown = _Shown.of(visits, count, [one for ones in every for one in ones])
    found = []
    hardest: list[VisitFault] = []
    for fault, ones in zip(faults, every, strict=True):
        if not ones:  # a fault by the sign of a load, where no load changes its sign
            found.append(Detection(fault.name, fault.size, fault.unit, LEVEL, None, LEVEL))
            continue
        powers = [shown.power(shown.planned, one, fault) for one in ones]
        one = ones[int(np.argmin(powers))]
        hardest.append(one)
        found.append(shown.detection(fault, one))
    seen = [detection for detection in found if not detection.never]
    of = {one.name: one for one in hardest}
    pairs = combinations([(detection, of[detection.fault]) for detection in seen], 2)
    return tuple(found), tuple(shown.separation(*pair) for pair in pairs)


def _visits(question: GeometryQuestion, plan: Plan) -> tuple[Visits, int]:
    """The visits in their order, and behind them feasible ones; and how many there are."""
    study = question.study
    order = visit_order(study, plan)
    x = sample_feasible(question.space, CANDIDATES, study.specification.seed)
    more = question.space.plan(x, np.ones(len(x), dtype=int))
    q = np.concatenate([plan.q[order], more.q])
    wrench = np.concatenate([plan.wrench[order], more.wrench])
    time = np.append(since_first(len(order)), np.ones(len(x)))
    return Visits(question, q, wrench, time), len(order)


@dataclass(frozen=True, eq=False)
class _Shown:
    """What residuals show of faults, for a plan and with each of some further visits.

    Attributes:
        visits: The visits of the plan, then the further ones.
        faults: The faults.
        planned: ``D'(I - QQ')D`` (dims, dims) of all faults together, for SI sizes of one.
        with_one: The same with each further visit (c, dims, dims).
        count: Number of visits of the plan.
    """

    visits: Visits
    faults: list[VisitFault]
    planned: Array
    with_one: Array
    count: int

    @classmethod
    def of(cls, visits: Visits, count: int, faults: list[VisitFault]) -> "_Shown":
        """Project what faults add on what the parameters do not."""
        question = visits.question
        rows = PositionRows(question.model, question.setting.loads, question.setting.noise)
        A = rows(visits.q, visits.wrench)
        A = A / np.linalg.norm(A.reshape(-1, A.shape[-1]), axis=0)
        D = np.concatenate([np.empty((*A.shape[:2], 0)), *(one.D for one in faults)], axis=-1)
        planned = np.arange(count)
        more = range(count, len(visits.q))
        grams = [_left(A, D, planned), *(_left(A, D, np.append(planned, i)) for i in more)]
        return cls(visits, faults, grams[0], np.array(grams[1:]), count)

    def _part(self, one: VisitFault) -> slice:
        """Where a fault is among the dimensions of all."""
        first = sum(other.dims for other in self.faults[: self.faults.index(one)])
        return slice(first, first + one.dims)

    def power(self, gram: Array, one: VisitFault, fault: SizedFault) -> float:
        """The probability that a fault is noticed."""
        part = self._part(one)
        c = np.full(one.dims, fault.size * SI[fault.unit] / one.dims**0.5)
        noncentrality = max(float(c @ gram[part, part] @ c), 0.0)
        threshold = float(chi_square_quantile(1 - LEVEL, one.dims))
        return noncentral_chi_square_tail(threshold, one.dims, noncentrality)

    def detection(self, fault: SizedFault, one: VisitFault) -> Detection:
        """The power of the plan, and of the visit that adds most to it."""
        power = self.power(self.planned, one, fault)
        with_one = [self.power(gram, one, fault) for gram in self.with_one]
        best = int(np.argmax(with_one))
        helps = with_one[best] > power
        return Detection(
            fault.name,
            fault.size,
            fault.unit,
            power,
            self.visits.q[self.count + best] if helps else None,
            max(with_one[best], power),
            one.joint,
        )

    def separation(
        self, first: tuple[Detection, VisitFault], second: tuple[Detection, VisitFault]
    ) -> Separation:
        """The chance that of two faults the right one is named."""
        pair = (_sized(*first), _sized(*second))
        places = np.concatenate(
            [np.arange(part.start, part.stop) for part in map(self._part, (first[1], second[1]))]
        )
        sizes = np.repeat([one.size for one in pair], [one.family.dims for one in pair])

        def of_pair(gram: Array) -> Array:
            return gram[np.ix_(places, places)] * sizes[:, None] * sizes

        own = of_pair(self.planned)
        right = right_share(own, pair)
        with_one = [right_share(of_pair(gram), pair) for gram in self.with_one]
        best = int(np.argmax(with_one))
        helps = with_one[best] > right + HELPS
        return Separation(
            (first[0], second[0]),
            right,
            self.visits.q[self.count + best] if helps else None,
            max(with_one[best], right),
            times_to_tell(own, pair),
        )


def _left(A: Array, D: Array, rows: Indices) -> Array:
    """``D'(I - UU')D`` for the column space U of some rows of A."""
    U, s, _ = np.linalg.svd(A[rows].reshape(-1, A.shape[-1]), full_matrices=False)
    U = U[:, s > DEPENDENT * s[0]]
    flat = D[rows].reshape(-1, D.shape[-1])
    left = flat - U @ (U.T @ flat)
    left = left - U @ (U.T @ left)  # once more: a fault may be taken up but for a millionth
    return np.asarray(left.T @ left)


def _sized(detection: Detection, one: VisitFault) -> SizedFamily:
    """A fault of a size, as the room of causes has it; its residuals are known already."""

    def predict(c: Array) -> tuple[Array, Array]:
        raise NotImplementedError

    size = detection.size * SI[detection.unit]
    family = Family(
        one.name,
        detection.unit,
        1 / SI[detection.unit],
        one.dims,
        one.usual,
        predict,
        one.tries,
        one.joint,
        only_positive=one.only_positive,
    )
    return SizedFamily(detection, family, size, one.D)
