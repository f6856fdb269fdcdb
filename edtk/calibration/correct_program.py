"""Robot programs whose targets make up for what a calibration has found."""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.compensate import Compensation
from edtk.calibration.tasks_in_use import NoRowError, loaded_poses
from edtk.design.plan import Plan
from edtk.findings.finding import Finding
from edtk.measure.cells import csv_text
from edtk.measure.pose_table import pose_columns, pose_factors
from edtk.programs.program import Axis, axes_of
from edtk.programs.targets.brand import MARK, Brand
from edtk.programs.targets.fanuc_ls_targets import FanucTargets
from edtk.programs.targets.krl_targets import KrlTargets
from edtk.programs.targets.rapid_targets import RapidTargets
from edtk.programs.targets.reading import (
    Frames,
    Left,
    Literal,
    Number,
    Target,
    targets_of,
    written,
)
from edtk.programs.targets.urscript_targets import UrTargets
from edtk.robots.frames import MM
from edtk.robots.inverse import Posture, is_nearest, solutions, solve
from edtk.robots.joint import AT_LIMIT
from edtk.robots.robot import Robot
from edtk.robots.rotations import rotation_vectors
from edtk.study.study import HASH_DIGITS, Study
from edtk.system.errors import UserError
from edtk.system.files import read_bytes, write_text
from edtk.system.presented import Presented
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd

ENCODING = "latin-1"  # a character for each byte: what is no number stays as it is
BYTE_ORDER_MARK = "\xef\xbb\xbf"  # of UTF-8, in these characters
NO_TEXT = "\0"  # in a program that is no text of one byte a character
OTHER_BRANCH = "its corrected joints are on another branch than it states"
OTHER_SIDES = "no joints within the limits are on the branch that it states"

BRANDS: tuple[Brand, ...] = (KrlTargets(), RapidTargets(), UrTargets(), FanucTargets())

Commands = Callable[[Plan], Compensation]


def brand_of(name: str) -> Brand | None:
    """The reader of programs in files of such a name; None of a table of poses."""
    suffix = PurePath(name).suffix.lower()
    return next((brand for brand in BRANDS if suffix in brand.suffixes), None)


@dataclass(frozen=True, eq=False)
class ProgramFile:
    """A robot program that exists.

    Attributes:
        path: Its file.
        brand: How it is written.
        text: Its bytes, a character each.
        beside: Texts of files that belong to it, by name.
    """

    path: Path
    brand: Brand
    text: str
    beside: Mapping[str, str]

    @classmethod
    def read(cls, path: Path) -> "ProgramFile":
        """Read a program; of KRL also the other one of its two files, where it is beside it.

        Raises:
            UserError: The file cannot be read, or is no such program.
        """
        brand = brand_of(path.name)
        assert brand is not None
        text = read_bytes(path).decode(ENCODING)
        if NO_TEXT in text or not brand.content.search(text.removeprefix(BYTE_ORDER_MARK)):
            message = f"is no program in {brand.title}; expected text with {brand.expected}"
            raise UserError(message, where=path)
        return cls(path, brand, text, dict(_beside(path, brand)))

    @property
    def line_end(self) -> str:
        """How its first line ends."""
        return next((end for end in ("\r\n", "\n", "\r") if end in self.text), "\n")


def _beside(path: Path, brand: Brand) -> Iterator[tuple[str, str]]:
    """The steps of a file of poses, and the other way round."""
    if ".dat" not in brand.suffixes or not path.parent.is_dir():
        return
    for other in sorted(path.parent.iterdir()):
        same = other.stem.lower() == path.stem.lower() and other.suffix.lower() in brand.suffixes
        if same and other.suffix.lower() != path.suffix.lower() and other.is_file():
            yield other.name, read_bytes(other).decode(ENCODING)


@dataclass(frozen=True, eq=False)
class Placed:
    """A target with the joints that the controller goes to.

    Attributes:
        target: The target.
        q: Joint variables (n,) [rad or m].
        robot: The chain, with the tool of the target where it is a pose.
    """

    target: Target
    q: Array
    robot: Robot


@dataclass(frozen=True, eq=False)
class CorrectedProgram(Presented):
    """A program with corrected targets, and what moved by how much.

    Attributes:
        path: File of the program.
        language: What it is written in.
        text: The corrected program, a character for each byte.
        robot: The chain.
        targets: The t targets that are corrected.
        command: Joint variables (t, n) that the corrected targets have [rad or m].
        moved: How far the tool point of each goes (t,) [m]: that of the program of a pose, and of
            the task of joints.
        turned: How far the tool turns (t,) [rad].
        rounded: How far the numbers, as they are written, are from that (t,) [m].
        left: What is left as it is.
        before: Errors (t,) of the targets as they were [m], see `Compensation`.
        remaining: Root mean square (t,) of the errors that are left [m]; None if it is not known.
        verdict: "good", "usable" or "bad", as the identification rated the result; None if it is
            not known.
        findings: What looks like another unit.
        already: Whether the program was corrected before, and is as it was.
    """

    path: Path
    language: str
    text: str
    robot: Robot
    targets: tuple[Placed, ...]
    command: Array
    moved: Array
    turned: Array
    rounded: Array
    left: tuple[Left, ...]
    before: Array
    remaining: Array | None = None
    verdict: str | None = None
    findings: tuple[Finding, ...] = ()
    already: bool = False

    def headline(self) -> str:
        """Numbers of targets, and the largest motion."""
        if self.already:
            return f"{self.language}: is corrected by this result already; nothing moves"
        t = len(self.targets)
        left = f", {len(self.left)} left as they are" if self.left else ""
        most = f"{MM * self.moved.max():.3g} mm"
        return f"{self.language}: {t} target{'s' * (t != 1)} corrected by up to {most}{left}"

    def to_frame(self) -> "pd.DataFrame":
        """A row for each target: degrees and millimetres."""
        import pandas as pd

        kinds = ["joints" if one.target.literal.joints else "pose" for one in self.targets]
        table = pd.DataFrame(
            {
                "line": [one.target.literal.line for one in self.targets],
                "target": [one.target.literal.name for one in self.targets],
                "kind": kinds,
            }
        )
        table["moved_mm"] = MM * self.moved
        table["turned_deg"] = np.rad2deg(self.turned)
        table["rounded_mm"] = MM * self.rounded
        table["error_before_mm"] = MM * self.before
        if self.remaining is not None:
            table["error_remaining_mm"] = MM * self.remaining
        desired = np.array([one.q for one in self.targets]).reshape(-1, self.robot.n)
        for before, q in (("", desired), ("corrected_", self.command)):
            columns = [f"{before}{name}" for name in pose_columns(self.robot)]
            table[columns] = self.robot.shown(q) / pose_factors(self.robot)
        return table

    def to_csv(self, path: Path | str) -> None:
        """Write the table to a file, whole or not at all, or to standard output (`-`)."""
        write_text(path, csv_text(self.to_frame()))

    @property
    def content(self) -> bytes:
        """The corrected program."""
        return self.text.encode(ENCODING)

    def to_dict(self) -> dict[str, Any]:
        """SI units; `q` as the controller shows it."""
        return {
            "program": str(self.path),
            "language": self.language,
            "already_corrected": self.already,
            "joints": list(self.robot.joint_names),
            "targets": [
                {
                    "line": one.target.literal.line,
                    "name": one.target.literal.name or None,
                    "kind": "joints" if one.target.literal.joints else "pose",
                    "q": self.robot.shown(one.q).tolist(),
                    "corrected_q": self.robot.shown(q).tolist(),
                    "moved": float(moved),
                    "turned": float(turned),
                    "rounded": float(rounded),
                }
                for one, q, moved, turned, rounded in zip(
                    self.targets, self.command, self.moved, self.turned, self.rounded, strict=True
                )
            ],
            "uncompensated": self.before.tolist(),
            "remaining_rms": None if self.remaining is None else self.remaining.tolist(),
            "verdict": self.verdict,
            "left": [
                {"line": one.line, "name": one.name or None, "reason": one.reason}
                for one in self.left
            ],
        }


def correct_program(
    study: Study, program: ProgramFile, commands: Commands, result: str, every: bool = False
) -> CorrectedProgram:
    """Correct the targets of a program, and leave all else as it is.

    The joints q of a target are those that the controller goes to: as stated, or by its kinematics,
    which are the drawing's, at ``world base pose = forward(q) tool``. The calibration's command for
    q takes their place. A pose is written as the place to which the controller's kinematics carry
    the tool at that command, so that the controller finds it again.

    The correction c is no projection: correcting twice would move by 2 c, up to terms of the second
    order. So a corrected program says so in a comment, with which nothing moves the second time.

    Args:
        study: Robot, task and the frames that programs name.
        program: The program.
        commands: Gives commands for poses, with their errors.
        result: A text that differs where the calibration does.
        every: Whether to correct literals in conditionals and loops, too.

    Raises:
        UserError: The program is corrected by another result, or no target of it can be corrected.
    """
    robot = study.robot
    axes = axes_of(robot.joint_names, [joint.kind for joint in robot.joints])
    frames = study.specification.frames.build()
    reading = program.brand.read(program.text, axes, frames, program.beside)
    targets, left = targets_of(reading, every)
    own = _digest(f"{study.digest} {every} {result}")
    mark = MARK.search(program.text)
    if mark is not None:
        _require_same(program, reading.literals, mark[1], mark[2], own)
        return _as_it_is(study, program, left)
    placed, unreached = _placed(study, program.brand, targets, axes, frames)
    left += unreached
    found = _commands(study, program, commands, placed, left)
    writer = _Writer(program.brand, robot, axes, frames)
    chosen = [placed[row] for row in found.rows]
    edits = [writer.edits(one, q) for one, q in zip(chosen, found.command, strict=True)]
    good = [i for i, edit in enumerate(edits) if edit is not None]
    left += [_left(one, OTHER_BRANCH) for one, e in zip(chosen, edits, strict=True) if e is None]
    if not good:
        raise _nothing(program, left)
    text = _edited(program.text, [edits[i] or {} for i in good])
    numbers = program.brand.read(text, axes, frames, program.beside).literals
    words = f"edtk {own} {_of_numbers(numbers)}"
    moves = [writer.moved(chosen[i], found.command[i], found.robot, edits[i] or {}) for i in good]
    moved, turned, rounded = np.array(moves).T
    return CorrectedProgram(
        path=program.path,
        language=program.brand.title,
        text=program.brand.marked(text, words, program.line_end),
        robot=robot,
        targets=tuple(chosen[i] for i in good),
        command=found.command[good],
        moved=moved,
        turned=turned,
        rounded=rounded,
        left=tuple(sorted(left, key=lambda one: one.line)),
        before=found.uncompensated[good],
        remaining=None if found.remaining is None else found.remaining[good],
        verdict=found.verdict,
        findings=found.findings,
    )


def _commands(
    study: Study,
    program: ProgramFile,
    commands: Commands,
    placed: Sequence[Placed],
    left: list[Left],
) -> Compensation:
    """The commands of targets; those that have none are added to what is left.

    Raises:
        UserError: No target has one.
    """
    if not placed:
        raise _nothing(program, left)
    try:
        found = commands(loaded_poses(study, np.array([one.q for one in placed])))
    except NoRowError as error:
        left += [_left(placed[one.row], one.reason) for one in error.rows]
        raise _nothing(program, left) from error
    left += [_left(placed[one.row], one.reason) for one in found.refused]
    return found


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:HASH_DIGITS]


def _of_numbers(literals: Sequence[Literal]) -> str:
    """A name of all numbers of targets, which differs where one does."""
    each = sorted(literals, key=lambda one: one.start)
    texts = [[one.text.strip() for one in (*a.joints.values(), *a.pose)] for a in each]
    return _digest(str(texts))


def _require_same(
    program: ProgramFile, literals: Sequence[Literal], result: str, numbers: str, own: str
) -> None:
    """Check that a corrected program is as it was written, and by the same calibration.

    Raises:
        UserError: It is not.
    """
    why = ""
    if result != own:
        why = "was corrected already, by another result, study or option"
    elif numbers != _of_numbers(literals):
        why = "was corrected already, and its targets were edited since"
    if why:
        message = f"{why}; expected the program as it was before"
        raise UserError(message, where=program.path)


def _as_it_is(study: Study, program: ProgramFile, left: list[Left]) -> CorrectedProgram:
    """A program that is corrected already."""
    none = np.zeros(0)
    return CorrectedProgram(
        path=program.path,
        language=program.brand.title,
        text=program.text,
        robot=study.robot,
        targets=(),
        command=np.zeros((0, study.robot.n)),
        moved=none,
        turned=none,
        rounded=none,
        left=tuple(left),
        before=none,
        already=True,
    )


def _left(placed: Placed, reason: str) -> Left:
    literal = placed.target.literal
    return Left(literal.line, reason, literal.name)


def _nothing(program: ProgramFile, left: Sequence[Left]) -> UserError:
    """The error of a program of which nothing can be corrected."""
    if not left:
        return UserError("has no targets", where=program.path)
    first = min(left, key=lambda one: one.line)
    more = f" (and {len(left) - 1} more)" if len(left) > 1 else ""
    return UserError(f"no target can be corrected: {first.text}{more}", where=program.path)


def _placed(
    study: Study,
    brand: Brand,
    targets: Sequence[Target],
    axes: Sequence[Axis],
    frames: Frames,
) -> tuple[list[Placed], list[Left]]:
    """Find the joints of targets: of poses on the stated branch, or near the one before."""
    found: list[Placed] = []
    left: list[Left] = []
    before = study.tasks[0].q if study.tasks else study.robot.limits.mean(axis=0)
    robots: dict[bytes, Robot] = {}
    for target in targets:
        literal = target.literal
        robot = study.robot
        if literal.joints:
            q: Array | str = _joints(robot, brand, literal, axes)
        else:
            key = target.tool.tobytes()
            robot = robots.setdefault(key, robot.with_tool(frames.flange @ target.tool))
            numbers = [one.value for one in literal.pose]
            goal = frames.world @ target.base @ brand.place(numbers)
            q = _inverse(robot, brand, literal, goal, before, axes)
        if isinstance(q, str):
            left.append(Left(literal.line, q, literal.name))
        else:
            found.append(Placed(target, q, robot))
            before = q
    return found, left


def _joints(robot: Robot, brand: Brand, literal: Literal, axes: Sequence[Axis]) -> Array:
    """Joint variables (n,) of a target of joints."""
    values = np.array([literal.joints[axis.place].value for axis in axes])
    return np.asarray(robot.of_shown(values * _units(robot, brand)))


def _units(robot: Robot, brand: Brand) -> Array:
    """SI units (n,) in the numbers of joints."""
    return np.ones(robot.n) if brand.radians else robot.units


def _inverse(
    robot: Robot,
    brand: Brand,
    literal: Literal,
    goal: Array,
    before: Array,
    axes: Sequence[Axis],
) -> Array | str:
    """Joint variables (n,) of a pose, or why there are none."""
    if any(axis.external for axis in axes):
        return "is a pose of a robot with axes beside it; expected joints"

    def fits(q: Array) -> bool:
        return brand.fits(literal, Posture.of(robot, q), robot.shown(q))

    q, good = solve(robot, goal[None], before[None])
    within = robot.bounds.excess(q[0]).max() <= AT_LIMIT
    alone = brand.pins(literal) or is_nearest(robot, q[0], before)
    if good[0] and within and alone and fits(q[0]):
        return np.asarray(q[0])
    found = solutions(robot, goal, before)
    if not len(found.q):
        return "is out of the joints' limits" if found.beyond else "is out of reach"
    fitting = replace(found, q=np.array([one for one in found.q if fits(one)]))
    nearest = fitting.nearest(before)
    return OTHER_SIDES if nearest is None else nearest


@dataclass(frozen=True, eq=False)
class _Writer:
    """How corrected joints are written."""

    brand: Brand
    robot: Robot
    axes: Sequence[Axis]
    frames: Frames

    def edits(self, placed: Placed, q: Array) -> dict[Number, str] | None:
        """New texts of the numbers of a target; None where its branch cannot be written."""
        literal = placed.target.literal
        if literal.joints:
            values = self.robot.shown(q) / _units(self.robot, self.brand)
            least = self.brand.joint_decimals
            each = zip(self.axes, values, strict=True)
            return {
                literal.joints[axis.place]: written(literal.joints[axis.place], float(x), least)
                for axis, x in each
            }
        posture, shown = Posture.of(placed.robot, q), placed.robot.shown(q)
        told = self.brand.fits(literal, posture, shown)
        if not told and not self.brand.branch(literal, posture, shown):
            return None
        near = [one.value for one in literal.pose]
        numbers = self.brand.numbers(self._in_base(placed, q), near)
        each_number = zip(literal.pose, numbers, self.brand.decimals, strict=True)
        edits = {one: written(one, x, least) for one, x, least in each_number}
        # The sign of a joint near zero is that of the digits, by which the controller goes.
        at = self._place(placed, edits)
        settled, _ = solve(placed.robot, at[None], q[None])
        posture = Posture.of(placed.robot, settled[0])
        return edits | self.brand.branch(literal, posture, placed.robot.shown(settled[0]))

    def _place(self, placed: Placed, edits: Mapping[Number, str]) -> Array:
        """Where the tool of a pose is in the world (4, 4), by its digits."""
        values = [float(edits[one]) for one in placed.target.literal.pose]
        base = self.frames.world @ placed.target.base
        return np.asarray(base @ self.brand.place(values))

    def _in_base(self, placed: Placed, q: Array) -> Array:
        """The place (4, 4) of the program's tool in its base."""
        base = self.frames.world @ placed.target.base
        return np.asarray(np.linalg.inv(base) @ placed.robot.forward(q))

    def moved(
        self, placed: Placed, q: Array, task: Robot, edits: Mapping[Number, str]
    ) -> tuple[float, float, float]:
        """How far a target moves [m] and turns [rad], and how far its digits are off [m]."""
        literal = placed.target.literal
        robot = task if literal.joints else placed.robot
        before, after = robot.forward(np.stack([placed.q, q]))
        turn = rotation_vectors((after[:3, :3] @ before[:3, :3].T)[None])[0]
        if literal.joints:
            texts = [edits[literal.joints[axis.place]] for axis in self.axes]
            shown = np.array(list(map(float, texts))) * _units(self.robot, self.brand)
            at = robot.forward(self.robot.of_shown(shown))
        else:
            at = self._place(placed, edits)
        off = float(np.linalg.norm(at[:3, 3] - after[:3, 3]))
        moved = float(np.linalg.norm(after[:3, 3] - before[:3, 3]))
        return moved, float(np.linalg.norm(turn)), off


def _edited(text: str, edits: Sequence[Mapping[Number, str]]) -> str:
    """A text with other numbers."""
    parts = []
    place = 0
    every = [one for edit in edits for one in edit.items()]
    for number, new in sorted(every, key=lambda one: one[0].start):
        parts += [text[place : number.start], new]
        place = number.end
    return "".join([*parts, text[place:]])
