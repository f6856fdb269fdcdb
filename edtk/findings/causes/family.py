"""Faults of one kind and any size, as models of the measurements with parameters of their own."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from edtk.findings.nonlinear_part import whole_rows
from edtk.fit.correlated_noise import RowNoise, whiten
from edtk.fit.least_squares import SingularPlanError, Whitened
from edtk.fit.measurements import Measurements, measured_points, translations
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.expected_error import AssumedJoint
from edtk.system.typing import Array, Indices

NOISE = "sigma"  # the cause that is no fault: a noise of another size
OUTLIER = "outlier"  # a reading that is off; it has findings of its own, and is never named
POSE = "pose"  # readings of another pose than the one written down
PRIOR = "prior"  # what was known before is wrong; it has findings of its own, too
ITERATIONS = 8  # Gauss-Newton steps; two or three are the rule
CONVERGED = 1e-2  # step of a fault's size, in standard deviations, that changes nothing
# Fall of the sum of squares, after one step, that is too small for a fault to be named.
UNREMARKABLE = 8.0
STEP = 1e-6  # of numerical derivatives [rad, m or 1]; predictions are smooth over a thousand such
MM = 1e3
PERCENT = 100.0
AXES = "xyz"
# Errors of a tool point that was measured by hand: flanges centre tools, whose lengths differ [m].
USUAL_TOOL = (2e-3, 2e-3, 10e-3)
USUAL_DRIFT = 0.05e-3  # motion of a tracker or a foundation within a few minutes [m]
# Three of four drifts are a step that all readings share; the others grow, see `since_first`.
DRIFTS_ALIKE = 4 / 3
DRIFTS_GROWING = 4.0
USUAL_SHARE = 0.15  # of a compliance, by which the sign of its torque changes it to either side
USUAL_LOSS = 0.1  # of a joint's load, which friction holds: gears lose so much
USUAL_LINK = 0.1  # by which links of robots of one family differ [m]
SHORT_LINK = 0.01  # below it two joints count as being in one place [m]
SAME = 1e-6  # share of a fault's squared length that others leave, below which it is rounding
USUAL_SIZE = 0.1  # of a load that nobody weighed


@dataclass(frozen=True)
class Cause:
    """One fault that explains the residuals better than noise does.

    Attributes:
        cause: Name of the fault.
        size: Its size, in `unit`; the length where it is a vector.
        unit: Unit of the size.
        std: Standard deviation of the size; None where it is one of a list of possibilities.
        p: Probability that good data of the stated noise look so much like this fault, after
            looking at all others as well.
        explained: Share of the misfit (chi-square beyond its expectation) that the fault explains.
        joint: The joint that it is in; empty if it is in none.
        rows: Rows that it is in, counted from 0; empty for all.
        times: Of a second cause: how often each experiment would have to be measured until the
            first one is told from it; None if that is not known, or a hundred times do not.
        grows: Whether it grows from row to row, up to its size.
    """

    cause: str
    size: float
    unit: str
    std: float | None
    p: float
    explained: float = 1.0
    joint: str = ""
    rows: tuple[int, ...] = ()
    times: int | None = None
    grows: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON; rows are counted from 1."""
        return {
            "cause": self.cause,
            "size": self.size,
            "unit": self.unit,
            "std": self.std,
            "p": self.p,
            "explained": self.explained,
            "joint": self.joint or None,
            "rows": [row + 1 for row in self.rows],
            "times": self.times,
            "grows": self.grows,
        }


@dataclass(frozen=True, eq=False)
class Family:
    """Predictions ``A(c) k + b(c)`` of the measurements, where a fault has the size c.

    Attributes:
        cause: Name of the fault.
        unit: Unit of its size for people.
        per_unit: Units per SI unit.
        dims: Number of its parameters.
        usual: Length of the size that such a fault usually has, in SI units; much larger and much
            smaller ones are less likely beforehand.
        predict: Regressors A (m, rows, p) and constants b (m, rows) of a size c (dims,), in SI
            units; A(0) and b(0) = 0 are the model itself.
        tries: How many families of the same kind there are: one a joint, one a pose; less
            where this one is likelier than the others.
        joint: Name of the joint that the fault is in; empty if it is in none.
        rows: Rows of the measurements that the fault is in, counted from 0; empty for all.
        only_positive: Whether there is no such fault of a negative size.
        grows: Whether the fault grows from row to row, up to its size.
    """

    cause: str
    unit: str
    per_unit: float
    dims: int
    usual: float
    predict: Callable[[Array], tuple[Array, Array]]
    tries: float = 1
    joint: str = ""
    rows: tuple[int, ...] = ()
    only_positive: bool = False
    grows: bool = False

    def derivative(self, c: Array, k: Array) -> Array:
        """Derivatives (m, rows, dims) of the predictions by the size of the fault."""
        columns = []
        for step in STEP * np.eye(self.dims):
            ahead = self.predict(c + step)
            behind = self.predict(c - step)
            change = (ahead[0] - behind[0]) @ k + ahead[1] - behind[1]
            columns.append(change / (2 * STEP))
        return np.stack(columns, axis=-1)

    def derivative_at_zero(self, k: Array) -> Array:
        """Derivatives (m, rows, dims) of the predictions where there is no fault yet."""
        return self.derivative(np.zeros(self.dims), k)


@dataclass(frozen=True, eq=False)
class FamilyFit:
    """Compliances and the size of a fault, fitted together.

    Attributes:
        k: Compliances (p,) [rad/(N m)].
        c: Size of the fault (dims,), SI.
        covariance: Of the size (dims, dims), for the stated noise.
        chi2: Sum of squares of the residuals over sigma.
    """

    k: Array
    c: Array
    covariance: Array
    chi2: float


def fit_family(family: Family, measured: Array, sigma: RowNoise, k: Array) -> FamilyFit | None:
    """Fit compliances and the size of a fault to measurements (m, rows).

    Gauss-Newton from no fault: each step solves the least-squares problem of the compliances and of
    the change of size together.

    Args:
        family: The fault.
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise (m, rows) [m, rad], or correlated noise.
        k: Compliances (p,) of the fit without the fault.

    Returns:
        The fit; None where the measurements cannot tell the fault from the compliances, or the
        steps do not settle.
    """
    c = np.zeros(family.dims)
    p = len(k)
    names = tuple(map(str, range(p + family.dims)))
    A, b = family.predict(c)
    without = float((whiten(measured - b - A @ k, sigma) ** 2).sum())
    for _ in range(ITERATIONS):
        columns = np.concatenate([A, family.derivative(c, k)], axis=-1)
        try:
            whitened = Whitened.of(columns, sigma, names)
        except SingularPlanError:
            return None
        solution = whitened.solve(measured - b)
        k = solution[:p]
        c = c + solution[p:]
        covariance = whitened.covariance[p:, p:]
        if not np.isfinite(solution).all():
            return None
        if np.abs(solution[p:] / np.sqrt(np.diag(covariance))).max() < CONVERGED:
            break
        left = float((whiten(measured - b - columns @ solution, sigma) ** 2).sum())
        if without - left < UNREMARKABLE:
            return FamilyFit(k, c, covariance, left)
        A, b = family.predict(c)
    z = whiten(measured - b - A @ k, sigma)
    return FamilyFit(k, c, covariance, float((z**2).sum()))


@dataclass(frozen=True, eq=False)
class Tried:
    """A fault that was tried: its deviance, and what is to be said of it.

    Attributes:
        cause: The fault with its size; p is that of its own test.
        deviance: Twice the negative logarithm of the likelihood: the sum of squares that is left.
        dims: Number of its parameters.
        tries: How many faults of the same kind there are: one a joint, one a pose; less
            where this one is likelier than the others.
        rarity: What the parameters cost where their usual size is known, see `rarity`.
        family: The family that it is one of; None for faults of single rows and of noise.
        size: Size of the fault (dims,) in that family, SI; None without one.
    """

    cause: Cause
    deviance: float
    dims: int
    tries: float
    rarity: float | None = None
    family: Family | None = None
    size: Array | None = None

    def score(self, coordinates: int) -> float:
        """Deviance, with what the parameters and the alternatives of the same kind cost.

        Parameters without a usual size cost as in Bayes' information criterion.
        """
        rarity = self.dims * math.log(coordinates) if self.rarity is None else self.rarity
        return self.deviance + rarity + 2 * math.log(self.tries)


DEGREES = 180 / np.pi

# Sizes that faults usually have, within a factor of a few.
USUAL_TILT = np.deg2rad(3.0)  # of a load that hangs or pushes askew
USUAL_TURN = np.deg2rad(2.0)  # of a frame that was not aligned
# To a side: robots' gears have a lost motion of about one arc-minute in all [rad, m].
USUAL_PLAY = {"revolute": np.deg2rad(1 / 120), "prismatic": 0.05e-3}
# Of the zero of a joint: a mark that was not met, a mastering by another convention [rad, m].
USUAL_ZERO = {"revolute": np.deg2rad(1.0), "prismatic": 1e-3}


def families(model: ElastostaticModel, data: Measurements, A: Array, k: Array) -> Iterator[Family]:
    """List faults of the whole experiment; those of single poses are another matter.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        A: Their regressors (m, rows, p) in this model.
        k: Fitted compliances (p,) [rad/(N m)].
    """
    yield _load_direction(model, data)
    yield from _tool(model, data)
    yield frame_rotation(model, data, A)
    yield from _drifts(model, data, A)
    yield from _by_sign(model, data, A)
    yield from _frictions(model, data, A, k)
    yield from _zeros(model, data, A, k)
    yield from _links(model, data)


def _load_direction(model: ElastostaticModel, data: Measurements) -> Family:
    """The load is turned about the world's axes that are not its own."""
    mean = data.wrench[:, :3].mean(axis=0)
    turns = np.linalg.svd(mean[None])[2][1:] if mean.any() else np.eye(3)

    def predict(c: Array) -> tuple[Array, Array]:
        turn = c @ turns
        wrench = data.wrench.copy()
        wrench[:, :3] = _turned(turn, wrench[:, :3])
        wrench[:, 3:] = _turned(turn, wrench[:, 3:])
        return replace(data, wrench=wrench).regressor(model), np.zeros(data.deflection.shape)

    return Family("load_direction", "deg", DEGREES, len(turns), USUAL_TILT, predict)


def _tool(model: ElastostaticModel, data: Measurements) -> Iterator[Family]:
    """The tool point is elsewhere, along one axis of the tool.

    Positions that are counted from the rigid robot see that at once.
    """
    shown = _shown_by_tool(model, data) if data.absolute else np.zeros((*data.deflection.shape, 3))
    for i in range(3):

        def predict(c: Array, axis: int = i) -> tuple[Array, Array]:
            tool = model.robot.tool.copy()
            tool[:3, 3] += c[0] * tool[:3, axis]
            other = replace(model, robot=replace(model.robot, tool=tool))
            return data.regressor(other), c[0] * shown[..., axis]

        yield Family(f"tool_{AXES[i]}", "mm", MM, 1, USUAL_TOOL[i], predict)


def _shown_by_tool(model: ElastostaticModel, data: Measurements) -> Array:
    """By how much readings grow (m, rows, 3) where the tool point moves along the tool's axes."""
    axes = np.moveaxis(model.frames(data.q).rotation, -1, 0)  # (m, axis of the tool, 3)
    found = np.einsum("mrc,mac->mra", translations(model, data), axes)
    for rows, sensor in data.instruments(model):
        if sensor.point.joint is not None:
            found[rows] = 0.0
    return found


def frame_rotation(model: ElastostaticModel, data: Measurements, A: Array) -> Family:
    """The measuring frame is turned about the world's axes.

    So are displacements and rotations; and positions, where they are counted from the rigid robot.
    Distances do not see it.
    """
    whole, own = whole_rows(model, data, A)
    m, rows = A.shape[:2]
    places = (
        measured_points(model, data)[:, None, :, None] if data.absolute else np.zeros((m, 1, 3, 1))
    )

    def predict(c: Array) -> tuple[Array, Array]:
        turned = np.moveaxis(_turned(c, np.moveaxis(whole, 2, -1)), -1, 2)
        moved = np.moveaxis(_turned(c, np.moveaxis(places, 2, -1)), -1, 2) - places
        offset = np.zeros((m, rows))
        if own is None:
            offset[:, :3] = moved[:, 0, :, 0]
            return turned.reshape(A.shape), offset
        seen = np.flatnonzero(own >= 0)
        found = A.copy()
        found[seen, 0] = turned[seen, 0, own[seen]]
        lengths = seen[data.lengths[seen, 0]]
        offset[lengths, 0] = moved[lengths, 0, own[lengths], 0]
        return found, offset

    return Family("frame_rotation", "deg", DEGREES, 3, USUAL_TURN, predict)


def since_first(count: int) -> Array:
    """How far (count,) a drift has come by each row: nothing in the first, its size in the last.

    It means that wherever something drifts: in sheets of displacements and of positions, and in
    faults that a plan is to notice. The size is how far readings of the last row are off.
    """
    return np.linspace(0.0, 1.0, count)


def _drifts(model: ElastostaticModel, data: Measurements, A: Array) -> Iterator[Family]:
    """Something moves between the unloaded and the loaded reading: always, or more and more.

    What moves more and more is off by half of its size in the mean of all rows.
    """
    shift = translations(model, data)
    slowly = since_first(len(A))[:, None, None] * shift

    def step(c: Array) -> tuple[Array, Array]:
        return A, shift @ c

    def growing(c: Array) -> tuple[Array, Array]:
        return A, slowly @ c

    yield Family("drift", "mm", MM, 3, USUAL_DRIFT, step, DRIFTS_ALIKE)
    yield Family("drift", "mm", MM, 3, 2 * USUAL_DRIFT, growing, DRIFTS_GROWING, grows=True)


def _by_sign(model: ElastostaticModel, data: Measurements, A: Array) -> Iterator[Family]:
    """A joint, or every one, whose compliance or position depends on the sign of its load."""
    torque = _torque(model, data)
    sign = np.sign(torque)[:, None]  # (m, 1, p)
    # The motion of the marker by a unit of each joint, from the motion by a unit of its torque.
    unit = np.divide(A, torque[:, None], out=np.zeros_like(A), where=torque[:, None] != 0)
    names = [model.robot.joint_names[index] for index in model.joints]
    kinds_of = [model.robot.joints[index].kind for index in model.joints]
    both = (torque > 0).any(axis=0) & (torque < 0).any(axis=0)
    every = np.ones(model.p, dtype=bool)
    # One joint that has torques of both signs, or all joints alike: arms are built of equal gears.
    single = [(every & (np.arange(model.p) == j), names[j]) for j in np.flatnonzero(both)]
    for chosen, name in [*single, (every, "")] if both.any() else single:
        tries = 2 * len(single) if name else 2  # all joints are as likely as a single one
        predict = _stiffer(A, sign * chosen)
        yield Family("torque_sign", "%", PERCENT, 1, USUAL_SHARE, predict, tries, name)
        kinds = {kind for kind, one in zip(kinds_of, chosen, strict=True) if one}
        if len(kinds) == 1:  # the sizes of turning and of sliding joints are no one number
            kind = kinds.pop()
            scale = ("deg", DEGREES) if kind == "revolute" else ("mm", MM)
            predict = _loose(A, (unit * sign * chosen).sum(axis=-1))
            usual = USUAL_PLAY[kind]
            yield Family("backlash", *scale, 1, usual, predict, tries, name, only_positive=True)


def _frictions(
    model: ElastostaticModel, data: Measurements, A: Array, k: Array
) -> Iterator[Family]:
    """A joint, or every one, that friction holds: a part of its load does not reach the spring.

    Of the load tau the spring sees ``max(|tau| - f, 0)``, so that column j of the regressor is
    ``A_j max(1 - f / |tau_j|, 0)``. Of all joints alike it is the load f that is the same, or the
    angle ``k_j f_j``, as stiffer gears are larger and have more friction.
    """
    torque = np.abs(_torque(model, data))
    kinds = [model.robot.joints[index].kind for index in model.joints]
    loaded = torque.max(axis=0) > 0
    units = {"revolute": ("N m", 1.0), "prismatic": ("N", 1.0)}
    tries = 2 * int(loaded.sum())  # all joints are as likely as a single one
    for j in np.flatnonzero(loaded):
        usual = USUAL_LOSS * float(torque[:, j].mean())
        held = _held(A, torque, np.eye(model.p)[j])
        name = model.robot.joint_names[model.joints[j]]
        yield Family("friction", *units[kinds[j]], 1, usual, held, tries, name, only_positive=True)
    if len(set(kinds)) > 1 or not loaded.any():
        return
    usual = USUAL_LOSS * float(torque.mean())
    held = _held(A, torque, np.ones(model.p))
    yield Family("friction", *units[kinds[0]], 1, usual, held, 4, only_positive=True)
    if (k > 0).all():
        scale = ("deg", DEGREES) if kinds[0] == "revolute" else ("mm", MM)
        held = _held(A, torque, 1 / k)
        usual = USUAL_PLAY[kinds[0]]
        yield Family("friction", *scale, 1, usual, held, 4, only_positive=True)


def _zeros(model: ElastostaticModel, data: Measurements, A: Array, k: Array) -> Iterator[Family]:
    """A joint is counted from a zero that is off; of all joints one.

    Where that does what a turned measuring frame does, as of a vertical axis at the base under a
    vertical load, it is that fault, about this axis.
    """
    robot = model.robot
    turned = frame_rotation(model, data, A).derivative_at_zero(k)
    for j, joint in enumerate(robot.joints):
        name = joint.name
        scale = ("deg", DEGREES) if joint.kind == "revolute" else ("mm", MM)
        predict = counted_from(model, data, j)
        usual = USUAL_ZERO[joint.kind]
        family = Family("joint_zero", *scale, 1, usual, predict, robot.n, name)
        if _is_one_of(turned, family.derivative_at_zero(k)):
            family = replace(family, cause="frame_rotation", tries=1, usual=USUAL_TURN)
        yield family


def _links(model: ElastostaticModel, data: Measurements) -> Iterator[Family]:
    """A link is longer or shorter than in the model, or all are by the same length."""
    robot = model.robot
    length = np.array([np.linalg.norm(joint.origin[:3, 3]) for joint in robot.joints])
    long = np.flatnonzero(length > SHORT_LINK)
    if not data.absolute:
        long = long[long > 0]  # where the first joint is, no displacement shows
    # One link, which the joint at its end names, or all of them.
    single = [(np.array([j]), robot.joint_names[j]) for j in long]
    for chosen, name in [*single, (long, "")] if single else []:
        tries = 2 * len(long) if name else 2
        predict = _longer(model, data, chosen, length)
        yield Family("link_length", "mm", MM, 1, USUAL_LINK, predict, tries, name)


def _torque(model: ElastostaticModel, data: Measurements) -> Array:
    """Loads (m, p) of the unknown joints [N m, or N if prismatic]."""
    if not model.is_plain:
        return model.torque_of(model.frames(data.q), data.wrench)[model.joints].T
    J = np.swapaxes(model.robot.jacobian(data.q)[..., model.joints], 1, 2)
    return np.asarray((J @ data.wrench[..., None])[..., 0])


def _stiffer(A: Array, sign: Array) -> Callable[[Array], tuple[Array, Array]]:
    """Compliances that are larger by a share where the sign (m, 1, p) is positive."""
    return lambda c: (A * (1 + c[0] * sign), np.zeros(A.shape[:2]))


def _loose(A: Array, moved: Array) -> Callable[[Array], tuple[Array, Array]]:
    """Joints that give way by an angle or a compliance, which moves markers (m, rows) a unit."""
    return lambda c: (A, c[0] * moved)


def _held(A: Array, torque: Array, share: Array) -> Callable[[Array], tuple[Array, Array]]:
    """Joints that lose the shares (p,) of a load, of their loads (m, p) without sign."""
    lost = np.divide(share, torque, out=np.zeros_like(torque), where=torque > 0)[:, None]
    return lambda c: (A * np.maximum(1 - c[0] * lost, 0.0), np.zeros(A.shape[:2]))


def counted_from(
    model: ElastostaticModel, data: Measurements, j: int
) -> Callable[[Array], tuple[Array, Array]]:
    """Poses in which joint j is further than written."""

    def predict(c: Array) -> tuple[Array, Array]:
        shown = model.robot.shown(data.q).copy()
        shown[:, j] += c[0]
        other = replace(data, q=model.robot.of_shown(shown))
        return other.regressor(model), _shift(data, other.rigid(model) - data.rigid(model))

    return predict


def _longer(
    model: ElastostaticModel, data: Measurements, chosen: Indices, length: Array
) -> Callable[[Array], tuple[Array, Array]]:
    """A robot with links that are longer, all by the same."""

    def predict(c: Array) -> tuple[Array, Array]:
        joints = list(model.robot.joints)
        for j in chosen:
            origin = joints[j].origin.copy()
            origin[:3, 3] *= 1 + c[0] / length[j]
            joints[j] = replace(joints[j], origin=origin)
        other = replace(model, robot=replace(model.robot, joints=tuple(joints)))
        return data.regressor(other), _shift(data, data.rigid(other) - data.rigid(model))

    return predict


def _shift(data: Measurements, moved: Array) -> Array:
    """What readings (m, rows) show of a motion of the rigid robot (m, c): nothing, or all."""
    found = np.zeros(data.deflection.shape)
    if data.absolute:
        found[:, : moved.shape[1]] = moved
    return found


def _is_one_of(columns: Array, column: Array) -> bool:
    """Whether some changes (m, rows, c) of the measurements can make another one (m, rows, 1)."""
    other = column.ravel()
    made = columns.reshape(len(other), -1)
    left = other - made @ np.linalg.lstsq(made, other, rcond=None)[0]
    return bool(left @ left < SAME * (other @ other))


def _turned(turn: Array, vectors: Array) -> Array:
    """Vectors (..., 3) turned by a rotation vector (3,) [rad]."""
    from scipy.spatial.transform import Rotation

    return vectors @ Rotation.from_rotvec(turn).as_matrix().T


def families_with_known(
    model: ElastostaticModel,
    data: Measurements,
    A: Array,
    k: Array,
    known: Mapping[int, float],
    told: bool = False,
) -> Iterator[Family]:
    """List faults of the whole experiment, which change what known joints do, too.

    Unknown compliances take up a load of another size in full. Only where the compliance of some
    joint is known, or something is known of the unknown ones, or weights load the joints besides,
    such a load is seen.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        A: Their regressors (m, rows, p) in this model.
        k: Fitted compliances (p,) [rad/(N m)].
        known: Compliances of further joints, by their index [rad/(N m)].
        told: Whether something is known of the size of the unknown compliances.
    """
    if not known:
        yield from families(model, data, A, k)
        if told or model.weights is not None:
            yield _load_size(model, data)
        return
    every = replace(model, unknown=(*model.joints, *known))
    whole = data.regressor(every)
    values = np.array(list(known.values()))
    for family in (*families(every, data, whole, np.append(k, values)), _load_size(every, data)):
        yield _of_unknown(family, whole, values)


def assumed_families(
    model: ElastostaticModel, data: Measurements, A: Array, assumed: Sequence[AssumedJoint]
) -> Iterator[Family]:
    """List the joints whose compliance is assumed, as faults: it is another one.

    A joint that has c more than is taken adds ``A_j c`` with its column A_j of Eq. (4). Its usual
    size is the standard deviation of what is assumed; one that counts as rigid bends, and has no
    negative compliance.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        A: Their regressors (m, rows, p) in this model.
        assumed: The joints that are not identified.
    """
    uncertain = [one for one in assumed if one.std > 0]
    for one in uncertain:
        column = data.regressor(replace(model, unknown=(one.index,)))[..., 0]
        turns = model.robot.joints[one.index].kind == "revolute"
        yield Family(
            "compliance",
            "rad/(N m)" if turns else "m/N",
            1.0,
            1,
            one.std,
            _loose(A, column),
            len(uncertain),
            one.name,
            only_positive=one.rigid,
        )


def _load_size(model: ElastostaticModel, data: Measurements) -> Family:
    """The load is larger or smaller than stated, by a share; weights of links are not."""

    def predict(c: Array) -> tuple[Array, Array]:
        other = replace(data, wrench=data.wrench * (1 + c[0]))
        return other.regressor(model), np.zeros(data.deflection.shape)

    return Family("load_size", "%", PERCENT, 1, USUAL_SIZE, predict)


def _of_unknown(family: Family, whole: Array, values: Array) -> Family:
    """A fault of all joints as one of the unknown ones, beside what known joints do without it.

    Args:
        family: The fault, with the known joints behind the unknown ones.
        whole: Regressors (m, rows, p + n) of all of them without the fault.
        values: The known compliances (n,) [rad/(N m)].
    """
    p = whole.shape[-1] - len(values)

    def predict(c: Array) -> tuple[Array, Array]:
        A, b = family.predict(c)
        return A[..., :p], b + (A[..., p:] - whole[..., p:]) @ values

    return replace(family, predict=predict)
