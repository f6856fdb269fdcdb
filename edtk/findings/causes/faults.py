"""All faults that explain residuals, and that a plan is to notice: one registry, one entry a fault.

A new cause is one `Fault` at the end of this file. Causes of sheets, `--detect` of plans, what is
told apart, and the error budget take from it what they need, for displacements and for positions.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from edtk.findings.causes.family import NOISE, POSE, Cause, Family, Predict
from edtk.findings.causes.scene import (
    AXES,
    Models,
    Pull,
    Scene,
    added,
    grown,
    link_length,
    play,
    turned_by,
)
from edtk.findings.finding import Data, Finding, leading_digit, row_names, rows_in_words
from edtk.measure.parameters import ALONG
from edtk.robots.frames import MM, shared_load
from edtk.robots.joint import Joint
from edtk.system.typing import Array, Mask

PERCENT = 100.0
MICRO = 1e6
DEGREES = 180 / np.pi
# Share of a fault's squared length that others leave, below which it is rounding.
LEFT_BY_OTHERS = 1e-6
SHORT_LINK = 0.01  # below it two joints count as being in one place [m]
# Sizes that faults usually have, within a factor of a few.
USUAL_SIZE = 0.1  # of a load that nobody weighed
USUAL_TILT = np.deg2rad(3.0)  # of a load that hangs or pushes askew
# Errors of a tool point that was measured by hand: flanges centre tools, whose lengths differ [m].
USUAL_TOOL = (2e-3, 2e-3, 10e-3)
USUAL_TURN = np.deg2rad(2.0)  # of a frame that was not aligned
USUAL_MOVE = 0.5e-3  # by which a tripod is pushed [m]
MID_DAY = 0.5  # of the day: when something slips or moves, as plans are asked to notice it
USUAL_DRIFT = 0.05e-3  # motion of a tracker or a foundation within a few minutes [m]
# Three of four drifts are a step that all readings share; the others grow, see `since_first`.
DRIFTS_ALIKE = 4 / 3
DRIFTS_GROWING = 4.0
USUAL_GROWTH = 1e-4  # of lengths, where an arm of steel warms up by eight degrees
USUAL_BY_SIGN = 0.15  # of a compliance, by which the sign of its torque changes it to either side
# To a side: robots' gears have a lost motion of about one arc-minute in all [rad, m].
USUAL_PLAY = {"revolute": np.deg2rad(1 / 120), "prismatic": 0.05e-3}
# A spring across a joint's axis, over the joint's own: bearings and links are stiffer than gears.
USUAL_ACROSS = 0.2
USUAL_BALANCE = 0.5  # torque of a compensator, over the largest that the load makes there
LEVERS = 0.25  # the levers of its anchors, the shorter over the longer one
USUAL_LAW = 0.2  # of a compliance, by which it differs between no load and the largest one
USUAL_VARIES = 0.1  # of a compliance, by which it changes to either side as the joint turns
VARYING_RARELY = 4.0  # gears are as stiff in all positions: it takes so many times the evidence
USUAL_LOSS = 0.1  # of a joint's load, which friction holds: gears lose so much
# Of the zero of a joint: a mark that was not met, a mastering by another convention [rad, m].
USUAL_ZERO = {"revolute": np.deg2rad(1.0), "prismatic": 1e-3}
# The same, in the middle of a day: a belt or an encoder that slips, a joint that is mastered anew.
USUAL_SLIP = {"revolute": np.deg2rad(0.3), "prismatic": 0.5e-3}
USUAL_LINK = 0.1  # by which links of robots of one family differ [m]
# SI units per unit of the sizes that plans are asked for.
UNITS_OF_SIZES = {"mm": 1e-3, "deg": np.pi / 180, "%": 1e-2, "Nm": 1.0, "um/m": 1e-6}
OF_KIND = {"revolute": ("deg", DEGREES), "prismatic": ("mm", MM)}


def _none(scene: Scene) -> Iterator[Family]:
    """No models: the fault is found in other ways."""
    yield from ()


@dataclass(frozen=True)
class Fault:
    """A fault: a cause of residuals that has a size.

    Attributes:
        name: Its name, for people and programs.
        words: A clause that says which fault measurements show, and how large it is.
        models: What it does in a scene, a family for each joint or shape that it may have.
        unit: Unit of the sizes that a plan is asked for; of joints that turn. Empty where no plan
            is asked for it.
        by_springs: Whether it shows only in what springs give way.
        by_compliances: Whether compliances say how much of it shows.
        in_positions: Whether it shows only in positions in the frame of the instrument.
        in_tasks: Whether the robot itself is another one, so that it errs where it works, too.
        drawn: Whether its drawing is another one: its positions err where it works, too.
    """

    name: str
    words: Callable[[Cause], str]
    models: Models = _none
    unit: str = ""
    by_springs: bool = False
    by_compliances: bool = False
    in_positions: bool = False
    in_tasks: bool = False
    drawn: bool = False


def units_in_words() -> str:
    """The units of the sizes that plans are asked for, each with its faults."""
    names: dict[str, list[str]] = {unit: [] for unit in UNITS_OF_SIZES}
    for one in FAULTS.values():
        if one.unit:
            names[one.unit].append(one.name)
    return "; ".join(f"{unit} of {', '.join(some)}" for unit, some in names.items())


def families(scene: Scene) -> Iterator[Family]:
    """The models of all faults in a scene."""
    for fault in FAULTS.values():
        yield from scene.families(fault.models)


def cause_wording(cause: Cause) -> str:
    """A clause that says which fault the measurements show, and how large it is."""
    return FAULTS[cause.cause].words(cause)


def _size(cause: Cause) -> str:
    """A fault's size with its standard deviation and unit."""
    if cause.std is None:
        return f"{cause.size:.3g} {cause.unit}"
    return f"{cause.size:.3g} +- {leading_digit(cause.std)} {cause.unit}"


def _signed(cause: Cause, more: str, less: str) -> tuple[str, str]:
    """A fault's size without its sign, and the word for the sign."""
    return _size(replace(cause, size=abs(cause.size))), more if cause.size > 0 else less


def _joint(cause: Cause) -> str:
    """The joint in which a fault is; every one where it is in none."""
    return f"joint {cause.joint}" if cause.joint else "every joint"


# The load.


def _load_size(scene: Scene) -> Iterator[Family]:
    """The load is larger or smaller than stated, by a share; weights of links are not."""
    if scene.shows_load:
        predict = scene.under(lambda c: shared_load(scene.wrench, 1 + c[0]))
        yield Family("load_size", "%", PERCENT, 1, USUAL_SIZE, predict)


def _load_size_words(cause: Cause) -> str:
    size, which = _signed(cause, "larger", "smaller")
    return f"the load looks {size} {which} than stated"


def _load_direction(scene: Scene) -> Iterator[Family]:
    """The load is turned about the world's axes that are not its own."""
    wrench = scene.wrench
    mean = wrench[:, :3].mean(axis=0)
    turns = np.linalg.svd(mean[None])[2][1:] if mean.any() else np.eye(3)

    def turned(c: Array) -> Array:
        turn = c @ turns
        forces, torques = (turned_by(turn, part) for part in (wrench[:, :3], wrench[:, 3:6]))
        return np.hstack([forces, torques, wrench[:, 6:]])

    yield Family("load_direction", "deg", DEGREES, len(turns), USUAL_TILT, scene.under(turned))


# The tool and the frame.


def _tool(axis: int) -> Models:
    """The tool point is elsewhere, along one axis of the tool."""

    def models(scene: Scene) -> Iterator[Family]:
        name = f"tool_{AXES[axis]}"
        yield Family(name, "mm", MM, 1, USUAL_TOOL[axis], scene.tool(axis))

    return models


def _tool_words(cause: Cause) -> str:
    size, along = _signed(cause, "along", "against")
    return f"the tool point looks {size} further {along} the tool's {cause.cause[-1]} axis"


def _frame_rotation(scene: Scene) -> Iterator[Family]:
    """The measuring frame is turned; or a joint whose zero is off, which does the same."""
    yield Family("frame_rotation", "deg", DEGREES, 3, USUAL_TURN, scene.turned())


def _frame_rotation_words(cause: Cause) -> str:
    turned = f"the measuring frame looks turned by {_size(cause)}"
    if not cause.joint:
        return turned
    zero = "the zero of that joint is off by as much: both look the same"
    return f"{turned} about the axis of joint {cause.joint}, or {zero}"


def _frame_moved(scene: Scene) -> Iterator[Family]:
    """The measuring frame moves in the middle of the day."""
    if scene.in_frame:
        late = (scene.time > MID_DAY)[:, None, None]
        yield Family("frame_moved", "mm", MM, 3, USUAL_MOVE, added(scene, late * scene.shift))


def _drift(scene: Scene) -> Iterator[Family]:
    """Readings move away from what they are measured from: always, or more and more.

    Its size is how far the reading of the last row is off. What moves more and more is off by half
    of it in the mean of all rows. In the frame of the instrument the first reading is what all are
    measured from, and nothing is off always.
    """
    shift = scene.shift
    if not scene.in_frame:
        yield Family("drift", "mm", MM, 3, USUAL_DRIFT, added(scene, shift), DRIFTS_ALIKE)
    slowly = added(scene, scene.time[:, None, None] * shift)
    tries = 1.0 if scene.in_frame else DRIFTS_GROWING
    yield Family("drift", "mm", MM, 3, 2 * USUAL_DRIFT, slowly, tries, grows=True)


def _drift_words(cause: Cause) -> str:
    if cause.grows:
        return f"the readings look as if something drifts, by {_size(cause)} from first to last row"
    return f"loaded readings look shifted by {_size(cause)} against unloaded ones"


# Springs and gears.


def _chosen_by_sign(scene: Scene) -> Iterator[tuple[Mask, str, float]]:
    """Masks (s,) of one joint that has torques of both signs, or of all joints alike.

    Arms are built of equal gears. With the name, and how many such faults there are: all joints are
    as likely as a single one.
    """
    torque = scene.sheet.torque
    both: Mask = np.any(torque > 0, axis=0) & np.any(torque < 0, axis=0)
    every: Mask = np.ones(torque.shape[1], dtype=bool)
    single = np.flatnonzero(both)
    for j in single:
        name = scene.robot.joint_names[scene.sprung[j]]
        yield np.arange(len(every)) == j, name, 2 * len(single)
    if len(single):
        yield every, "", 2


def _torque_sign(scene: Scene) -> Iterator[Family]:
    """A joint, or every one, whose compliance depends on the sign of its load."""
    sign = np.sign(scene.torque)[:, None]  # (m, 1, s)
    for chosen, name, tries in _chosen_by_sign(scene):

        def factor(c: Array, by: Array = sign * chosen) -> Array:
            return np.asarray(1 + c[0] * by)

        predict = scene.stretched(factor)
        yield Family("torque_sign", "%", PERCENT, 1, USUAL_BY_SIGN, predict, tries, name)


def _torque_sign_words(cause: Cause) -> str:
    depends = "depends on the sign of its torque"
    return f"the compliance of {_joint(cause)} {depends}, by {_size(cause)} to either side"


def _kinds(scene: Scene) -> list[str]:
    """The kinds (s,) of the sprung joints."""
    return [scene.robot.joints[j].kind for j in scene.sprung]


def _backlash(scene: Scene) -> Iterator[Family]:
    """A joint, or every one, that gives way to the side of its load."""
    sign = np.sign(scene.torque)[:, None]
    by_joint = play(scene)
    for chosen, name, tries in _chosen_by_sign(scene):
        kinds = {kind for kind, one in zip(_kinds(scene), chosen, strict=True) if one}
        if len(kinds) == 1:  # the sizes of turning and of sliding joints are no one number
            kind = kinds.pop()
            loose = added(scene, (by_joint * sign * chosen).sum(axis=-1)[..., None])
            usual = USUAL_PLAY[kind]
            yield Family(
                "backlash", *OF_KIND[kind], 1, usual, loose, tries, name, only_positive=True
            )


def _friction(scene: Scene) -> Iterator[Family]:
    """A joint, or every one, that friction holds: a part of its load does not reach the spring.

    Of the load tau the spring sees ``max(|tau| - f, 0)``, so that column j of the regressor is
    ``A_j max(1 - f / |tau_j|, 0)``. Of all joints alike it is the load f that is the same, or the
    angle ``k_j f_j``, as stiffer gears are larger and have more friction.
    """
    torque = np.abs(scene.torque)
    kinds = _kinds(scene)
    often = np.abs(scene.sheet.torque)
    loaded = np.flatnonzero(often.max(axis=0, initial=0.0) > 0)
    units = {"revolute": ("N m", 1.0), "prismatic": ("N", 1.0)}
    tries = 2 * len(loaded)  # all joints are as likely as a single one
    for j in loaded:
        usual = USUAL_LOSS * float(often[:, j].mean())
        held = _held(scene, torque, np.eye(len(kinds))[j])
        name = scene.robot.joint_names[scene.sprung[j]]
        yield Family("friction", *units[kinds[j]], 1, usual, held, tries, name, only_positive=True)
    if len(set(kinds)) > 1 or not len(loaded):
        return
    usual = USUAL_LOSS * float(often.mean())
    held = _held(scene, torque, np.ones(len(kinds)))
    yield Family("friction", *units[kinds[0]], 1, usual, held, 4, only_positive=True)
    if (scene.soft > 0).all():
        held = _held(scene, torque, 1 / scene.soft)
        usual = USUAL_PLAY[kinds[0]]
        yield Family("friction", *OF_KIND[kinds[0]], 1, usual, held, 4, only_positive=True)


def _held(scene: Scene, torque: Array, share: Array) -> Predict:
    """Joints that lose the shares (s,) of a load, of their loads (m, s) without sign."""
    lost = np.divide(share, torque, out=np.zeros_like(torque), where=torque > 0)[:, None]
    return scene.stretched(lambda c: np.maximum(1 - c[0] * lost, 0.0))


def _friction_words(cause: Cause) -> str:
    what = "of its load" if cause.unit.startswith("N") else "of its motion"
    return f"friction in {_joint(cause)} looks to take {_size(cause)} {what}"


def _lateral(scene: Scene) -> Iterator[Family]:
    """A spring across a joint's axis: a bearing, or the link before it, that bends.

    It is one about an axis of the frame before the joint, both alike, or those of all joints. Its
    size is a share of the joint's own compliance, or of the mean one where the joint has none. What
    is along the axis of another sprung joint, as in a wrist, is that joint's own spring.
    """
    joints = scene.robot.joints
    if not (scene.soft > 0).any():
        return
    every = np.zeros(scene.A.shape[:2])
    for j, joint in enumerate(joints):
        across = lateral_axes(joint)
        own = own_compliance(scene, j)
        each = {i: own * scene.across(j, i) for i in across}
        columns = {i: one for i, one in each.items() if not is_sprung(scene.sheet, j, i)}
        if not columns:
            continue
        total = np.sum(list(columns.values()), axis=0)
        every = every + total
        for i, column in columns.items():
            name = f"{joint.name}.r{AXES[i]}"
            predict = added(scene, column[..., None])
            tries = 3 * len(across) * len(joints)
            yield _across(predict, tries, name)
        if len(columns) > 1:
            yield _across(added(scene, total[..., None]), 3 * len(joints), joint.name)
    yield _across(added(scene, every[..., None]), 3)


def lateral_axes(joint: Joint) -> list[int]:
    """Axes of the frame before a joint about which the joint itself does not turn."""
    slides = joint.kind == "prismatic"
    return [i for i in range(len(AXES)) if slides or abs(joint.axis[i]) <= ALONG]


def is_sprung(sheet: Scene, joint: int, axis: int) -> bool:
    """Whether a spring across a joint does what springs of joints can do."""
    return is_one_of(sheet.springs, sheet.across(joint, axis)[..., None])


def _across(predict: Predict, tries: float, name: str = "") -> Family:
    """A lateral spring, or several alike."""
    return Family(
        "lateral", "%", PERCENT, 1, USUAL_ACROSS, predict, tries, name, only_positive=True
    )


def own_compliance(scene: Scene, joint: int) -> float:
    """The compliance of a joint; the mean one of those that turn where it has none of its own."""
    soft = np.maximum(scene.soft, 0.0)
    turns = np.array([kind == "revolute" for kind in _kinds(scene)])
    if joint in scene.sprung and turns[scene.sprung.index(joint)]:
        own = float(soft[scene.sprung.index(joint)])
        if own > 0:
            return own
    return float(soft[turns].mean()) if turns.any() else 0.0


def _lateral_words(cause: Cause) -> str:
    name, _, about = cause.joint.partition(".r")
    where = f"joint {name}" if name else "every joint"
    axis = f" about {about} (spring {cause.joint})" if about else " about both axes across it"
    springs = [cause.joint] if about else [f"{name}.rx", "..."] if name else ["lateral"]
    size = f"{_size(cause)} of its own compliance"
    return f"{where} looks to bend across its axis too,{axis}, by {size}: {model_it(springs)}"


def model_it(springs: Sequence[str]) -> str:
    """What to do about a missing spring."""
    asked = ", ".join(f'"{one}"' for one in springs)
    return f"ask for springs = [{asked}] in [parameters], as --extend does"


def _compensator(scene: Scene) -> Iterator[Family]:
    """A spring or a gas cylinder that pulls at a joint against the weight of the arm.

    Its anchors are at distances a and L from the axis, with the ratio r, so that their distance is
    ``s = L sqrt(1 + r^2 + 2 r cos x)`` with ``x = q + phi``. With the force F the torque is

        ``T = -F ds/dq = C f(x)``,  ``f = sin x / (s / L)^n``:

    n is zero for a coil that is unloaded at no length, whose force grows with s, and one for a gas
    or a coil with much preload, whose force is the same. A joint's stiffness changes by ``-T'``.
    """
    kinds = _kinds(scene)
    turning = [i for i, kind in enumerate(kinds) if kind == "revolute"]
    for i in turning:
        usual = USUAL_BALANCE * float(np.abs(scene.sheet.torque[:, i]).max(initial=0.0))
        if usual == 0:
            continue
        name = scene.robot.joint_names[scene.sprung[i]]
        ratios = (0.0, LEVERS) if scene.absolute else (0.0,)
        for shape, ratio in enumerate(ratios):
            predict = scene.pulled(i, _pull(scene.q[:, scene.sprung[i]], ratio))
            tries = len(ratios) * len(turning)
            yield Family("compensator", "N m", 1.0, 2, usual, predict, tries, name, shape=shape)


def _pull(q: Array, r: float) -> Pull:
    """The torque (m,) of a compensator at angles q (m,), and its slope, see `_compensator`."""

    def pull(c: Array) -> tuple[Array, Array]:
        C, x = float(np.linalg.norm(c)), q + np.arctan2(c[0], c[1])
        sine, cosine = np.sin(x), np.cos(x)
        length = np.sqrt(1 + r**2 + 2 * r * cosine) if r else np.ones_like(q)
        return C * sine / length, C * (cosine / length + r * sine**2 / length**3)

    return pull


def _compensator_words(cause: Cause) -> str:
    pull = f"something pulls at joint {cause.joint} by up to {_size(cause)} as it turns"
    cure = "state it as [[robot.compensator]], as --extend does of displacements"
    return f"{pull}, like a gravity compensator: {cure}"


def _stiffening(scene: Scene) -> Iterator[Family]:
    """A spring that is stiffer, or softer, under a large load than under a small one.

    It gives way by ``k tau (1 + c |tau| / t)`` or ``k tau (1 + c (tau / t)^2)`` with the largest
    load t of the sheet.
    """
    torque = np.abs(scene.sheet.torque)
    loaded = np.flatnonzero(torque.max(axis=0, initial=0.0) > 0)
    for i in loaded:
        most = float(torque[:, i].max())
        name = scene.robot.joint_names[scene.sprung[i]]
        for shape, power in enumerate((1, 2)):

            def law(tau: Array, power: int = power, most: float = most) -> Array:
                return np.asarray(tau * np.abs(tau / most) ** power)

            predict = scene.with_law(int(i), scene.law(int(i), law))
            tries = 2 * len(loaded)
            yield Family(
                "stiffening", "%", PERCENT, 1, USUAL_LAW, predict, tries, name, shape=shape
            )


def _stiffening_words(cause: Cause) -> str:
    size, which = _signed(cause, "softer", "stiffer")
    springs = [f"{cause.joint}", f"{cause.joint}.cubic"]
    at = "under the largest load than under small ones"
    return f"joint {cause.joint} looks {size} {which} {at}: {model_it(springs)}"


def _varying(scene: Scene) -> Iterator[Family]:
    """A joint whose compliance changes as it turns: ``k (1 + c cos q + s sin q)``."""
    kinds = _kinds(scene)
    turning = [i for i, kind in enumerate(kinds) if kind == "revolute"]
    for i in turning:
        q = scene.q[:, scene.sprung[i]]
        wave = np.stack([np.cos(q), np.sin(q)], axis=-1)
        chosen = np.arange(len(kinds)) == i

        def factor(c: Array, wave: Array = wave, chosen: Mask = chosen) -> Array:
            return np.asarray(1 + (wave @ c)[:, None, None] * chosen)

        name = scene.robot.joint_names[scene.sprung[i]]
        predict = scene.stretched(factor)
        tries = VARYING_RARELY * len(turning)
        yield Family("varying", "%", PERCENT, 2, USUAL_VARIES, predict, tries, name)


def _varying_words(cause: Cause) -> str:
    by = f"changes as it turns, by {_size(cause)} to either side"
    cure = "measure where it shall be accurate, as no table of a study has it"
    return f"the compliance of joint {cause.joint} {by}: {cure}"


def _compliance(scene: Scene) -> Iterator[Family]:
    """A joint whose compliance is another one than is assumed.

    A joint that has c more than is taken adds ``A_j c`` with its column A_j of Eq. (4). Its usual
    size is the standard deviation of what is assumed; one that counts as rigid bends, and has no
    negative compliance.
    """
    uncertain = [one for one in scene.assumed if one.std > 0]
    for one in uncertain:
        turns = scene.robot.joints[one.index].kind == "revolute"
        yield Family(
            "compliance",
            "rad/(N m)" if turns else "m/N",
            1.0,
            1,
            one.std,
            added(scene, scene.compliant(one.index)[..., None]),
            len(uncertain),
            one.name,
            only_positive=one.rigid,
        )


def _compliance_words(cause: Cause) -> str:
    size, which = _signed(cause, "more", "less")
    cure = "identify it (joints.unknown), or correct known_rad_per_Nm"
    return f"joint {cause.joint} looks {size} {which} compliant than is taken: {cure}"


# The chain.


def _joint_zero(scene: Scene) -> Iterator[Family]:
    """A joint is counted from a zero that is off; of all joints one.

    Where that does what a turned measuring frame does, as of a vertical axis at the base under a
    vertical load, it is that fault, about this axis.
    """
    robot = scene.robot
    frame = Family("", "", 1.0, 3, 1.0, scene.turned()).derivative_at_zero(scene.k)
    for j, joint in enumerate(robot.joints):
        usual = USUAL_ZERO[joint.kind]
        scale = OF_KIND[joint.kind]
        family = Family("joint_zero", *scale, 1, usual, scene.counted(j), robot.n, joint.name)
        if is_one_of(frame, family.derivative_at_zero(scene.k)):
            family = replace(family, cause="frame_rotation", tries=1, usual=USUAL_TURN)
        yield family


def _joint_zero_words(cause: Cause) -> str:
    size, which = _signed(cause, "further than", "short of")
    return f"the zero of joint {cause.joint} looks off: it is {size} {which} what is written"


def _joint_slipped(scene: Scene) -> Iterator[Family]:
    """The zero of one joint is another one from the middle of the day on."""
    if scene.in_frame:
        late = scene.time > MID_DAY
        for j in range(scene.robot.n):
            yield slipped_at(scene, j, late)


def slipped_at(scene: Scene, j: int, late: Mask) -> Family:
    """The zero of a joint is another one in some readings (m,), those after it slipped."""
    joint = scene.robot.joints[j]
    predict = grown(scene, scene.counted(j), late.astype(float))
    scale = OF_KIND[joint.kind]
    return Family(
        "joint_slipped", *scale, 1, USUAL_SLIP[joint.kind], predict, scene.robot.n, joint.name
    )


def _joint_slipped_words(cause: Cause) -> str:
    size, which = _signed(cause, "further than", "short of")
    if not cause.rows:
        return f"the zero of joint {cause.joint} looks slipped by {size} in mid-day"
    return (
        f"the zero of joint {cause.joint} looks slipped: from row {cause.rows[0] + 1} on it is "
        f"{size} {which} what is written"
    )


def is_one_of(columns: Array, column: Array) -> bool:
    """Whether some changes (m, rows, c) of the measurements can make another one (m, rows, 1)."""
    other = column.ravel()
    made = columns.reshape(len(other), -1)
    left = other - made @ np.linalg.lstsq(made, other, rcond=None)[0]
    return bool(left @ left < LEFT_BY_OTHERS * (other @ other))


def _link_length(scene: Scene) -> Iterator[Family]:
    """A link is longer or shorter than in the model, or all are by the same length.

    Where the first joint is, no displacement shows.
    """
    joints = scene.robot.joints if scene.absolute else scene.robot.joints[1:]
    long = [joint.name for joint in joints if link_length(joint) > SHORT_LINK]
    # One link, which the joint at its end names, or all of them.
    for name in [*long, ""] if long else []:
        lengths = {one: 1.0 for one in long if name in ("", one)}
        tries = 2 * len(long) if name else 2
        predict = scene.longer(lengths)
        yield Family("link_length", "mm", MM, 1, USUAL_LINK, predict, tries, name)


def _link_length_words(cause: Cause) -> str:
    size, which = _signed(cause, "longer", "shorter")
    links = f"the link before joint {cause.joint} looks" if cause.joint else "every link looks"
    return f"{links} {size} {which} than in the robot's model: is it another robot?"


def _growth(scene: Scene) -> Iterator[Family]:
    """All links grow by the same share from the first visit to the last."""
    if scene.in_frame:
        lengths = {joint.name: link_length(joint) for joint in scene.robot.chain}
        long = {name: length for name, length in lengths.items() if length > 0}
        predict = grown(scene, scene.longer(long), scene.time)
        yield Family("growth", "um/m", MICRO, 1, USUAL_GROWTH, predict)


# Columns, units, poses and noise: they are found in other ways, and only named here.


# One of each unit, in the unit that a sheet is to have.
UNITS = {
    "metres": (1000.0, "mm/m"),
    "centimetres": (10.0, "mm/cm"),
    "inches": (25.4, "mm/inch"),
    "micrometres": (0.001, "mm/um"),
    "kilonewtons": (1000.0, "N/kN"),
    "millinewtons": (0.001, "N/mN"),
    "kilograms": (9.81, "N/kg"),
    "pounds": (4.448, "N/lbf"),
}
RADIANS = (57.29577951308232, "deg/rad")


FRAMES = ("other_axes", "wrong_sign")
COLUMNS = ("swapped_columns", "opposite_sign", "joint_offset", "swapped_markers")
OTHER_ROWS = ("shifted_rows", "unloaded_rows", "other_loads")


def cause_of(finding: Finding) -> Cause | None:
    """Express a finding about units, columns, or rows of another pose or load, as a cause.

    Returns:
        `unit` with its factor, `frame_axes` or `columns` with the number of columns that are to be
        read otherwise; `shifted_rows` with the step to the row of their pose, and `unloaded_rows`
        and `other_loads` with the load over the written one. None for findings about other things.
    """
    kind = finding.kind
    if kind == "several_readings":
        return cause_of(finding.data["readings"][0])
    p = float(finding.data.get("p", 0.0))
    explained = float(finding.data.get("explained", 1.0))
    if kind in ("rotation_unit", "angle_unit") or finding.data.get("unit") == "radians":
        return Cause("unit", *RADIANS, None, p, explained)
    if kind == "marker_unit":
        return Cause("unit", *UNITS["metres"], None, p, explained)
    if kind in ("force_unit", "length_unit", "part_unit") and finding.data["unit"] in UNITS:
        return Cause("unit", *UNITS[finding.data["unit"]], None, p, explained)
    if kind in FRAMES:
        return Cause("frame_axes", float(len(finding.columns) or 3), "axes", None, p, explained)
    if kind in COLUMNS:
        return Cause("columns", float(len(finding.columns)), "columns", None, p, explained)
    return cause_of_rows(kind, finding.data) if kind in OTHER_ROWS else None


def cause_of_rows(kind: str, data: Data) -> Cause:
    """What a finding about rows of another pose or load says, as a cause."""
    size, unit = ("step", "rows") if kind == "shifted_rows" else ("factor", "times")
    told = float(data.get("p", 0.0)), float(data.get("explained", 1.0))
    return Cause(kind, float(data[size]), unit, None, *told, rows=tuple(data["rows"]))


def _misread(cause: Cause) -> str:
    """Columns that are to be read otherwise."""
    return f"the columns look misread ({cause.cause.replace('_', ' ')})"


def _other_rows(cause: Cause) -> str:
    """Rows that are of another pose or load."""
    rows = rows_in_words(cause.rows)
    if cause.cause == "shifted_rows":
        which = "before" if cause.size < 0 else "after"
        return f"{rows}: the readings look like those of the pose {which}"
    if not cause.size:
        return f"{rows}: the robot moves as if it were not loaded there"
    return f"{rows}: the load looks {cause.size:.3g} times as large as written, beside other rows"


def _wrong_pose(cause: Cause) -> str:
    """A pose that is not the one written down."""
    rows = row_names(cause.rows)
    if not cause.joint:
        are_off = "are off together" if len(cause.rows) > 1 else "is off"
        return f"{rows} {are_off} by {_size(cause)}: is the pose the one written down?"
    return f"{rows}: joint {cause.joint} looks {_size(cause)} away from the written value"


def _by_name(*faults: Fault) -> dict[str, Fault]:
    return {fault.name: fault for fault in faults}


FAULTS = _by_name(
    Fault("load_size", _load_size_words, _load_size, "%", True, True),
    Fault(
        "load_direction",
        lambda cause: f"the load looks tilted by {_size(cause)}",
        _load_direction,
        "deg",
        True,
        True,
    ),
    *(Fault(f"tool_{AXES[i]}", _tool_words, _tool(i), "mm") for i in range(3)),
    Fault("frame_rotation", _frame_rotation_words, _frame_rotation, "deg"),
    Fault(
        "frame_moved",
        lambda cause: f"the measuring frame looks moved by {_size(cause)}",
        _frame_moved,
        "mm",
        in_positions=True,
    ),
    Fault("drift", _drift_words, _drift, "mm"),
    Fault(
        "growth",
        lambda cause: f"all links look grown by {_size(cause)} from first to last row",
        _growth,
        "um/m",
        in_positions=True,
    ),
    Fault("joint_slipped", _joint_slipped_words, _joint_slipped, "deg", in_positions=True),
    Fault("torque_sign", _torque_sign_words, _torque_sign, "%", True, True, in_tasks=True),
    Fault(
        "backlash",
        lambda cause: f"{_joint(cause)} looks loose by {_size(cause)} to either side",
        _backlash,
        "deg",
        True,
        in_tasks=True,
    ),
    Fault("friction", _friction_words, _friction, "Nm", True, True, in_tasks=True),
    Fault("lateral", _lateral_words, _lateral, "%", True, True, in_tasks=True),
    Fault("compensator", _compensator_words, _compensator, "Nm", True, True, in_tasks=True),
    Fault("stiffening", _stiffening_words, _stiffening, "%", True, True, in_tasks=True),
    Fault("varying", _varying_words, _varying, "%", True, True, in_tasks=True),
    Fault("joint_zero", _joint_zero_words, _joint_zero, "deg", drawn=True),
    Fault("link_length", _link_length_words, _link_length, "mm", drawn=True),
    Fault("compliance", _compliance_words, _compliance),
    Fault(POSE, _wrong_pose),
    Fault(NOISE, lambda cause: f"the noise is {_size(cause)}"),
    Fault(
        "unit",
        lambda cause: f"the displacements look {_size(cause)} too large: another unit?",
    ),
    Fault("frame_axes", _misread),
    Fault("columns", _misread),
    *(Fault(name, _other_rows) for name in OTHER_ROWS),
)
