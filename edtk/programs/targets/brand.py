"""What a reader of programs says of its controller, and how it is found by a file's name."""

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from edtk.programs.program import Axis
from edtk.programs.targets.reading import Frames, Literal, Number, Reading
from edtk.robots.frames import MM
from edtk.robots.inverse import Posture
from edtk.robots.rotations import rotation, rotation_vector, transform
from edtk.system.typing import Array

GIMBAL = 1e-9  # cosine of the second angle below which the others are one
EDGE = 1e-6  # [rad or m] within which a joint or a wrist point is on both sides of zero
MARK = re.compile(r"edtk ([0-9a-f]{12}) ([0-9a-f]{12})")


class Brand(ABC):
    """How a controller writes targets.

    Attributes:
        title: Its language, in few words.
        suffixes: Endings of its files.
        content: What a file of it has, whatever else is in it.
        expected: The same in words.
        joint_decimals: Decimals that a joint's number gets, at least.
        decimals: The same of the numbers of a pose.
        radians: Whether joints that turn are in radians and lengths in metres.
    """

    title: ClassVar[str]
    suffixes: ClassVar[tuple[str, ...]]
    content: ClassVar[re.Pattern[str]]
    expected: ClassVar[str]
    joint_decimals: ClassVar[int] = 4
    decimals: ClassVar[tuple[int, ...]] = (3, 3, 3, 4, 4, 4)
    radians: ClassVar[bool] = False

    @abstractmethod
    def read(
        self, text: str, axes: Sequence[Axis], frames: Frames, beside: Mapping[str, str]
    ) -> Reading:
        """Find literals, motions and what is computed.

        Args:
            text: The program, a character for each byte.
            axes: The robot's axes.
            frames: Frames that the program may name.
            beside: Texts of files that belong to it, by their names.
        """

    @abstractmethod
    def place(self, numbers: Sequence[float]) -> Array:
        """The transform (4, 4) that a pose's numbers say [m]."""

    @abstractmethod
    def numbers(self, place: Array, near: Sequence[float]) -> tuple[float, ...]:
        """The numbers of a pose (4, 4), of several forms the one near some numbers."""

    def pins(self, literal: Literal) -> bool:
        """Whether the branch that a pose states leaves one solution."""
        return False

    def fits(self, literal: Literal, posture: Posture | None, shown: Array) -> bool:
        """Whether joints are on the branch that a pose states.

        Args:
            literal: The pose.
            posture: The posture of the arm; None of a chain that is no arm of six axes.
            shown: What the controller shows (n,) [rad or m].
        """
        return True

    def branch(self, literal: Literal, posture: Posture | None, shown: Array) -> dict[Number, str]:
        """New texts of what tells the branch, where joints have another one."""
        return {}

    @abstractmethod
    def marked(self, text: str, words: str, end: str) -> str:
        """The text with a comment that says it is corrected, after all lines with targets.

        Args:
            text: The program.
            words: What the comment is to hold, of 30 characters.
            end: The line end of the program.
        """


def before_last(word: str, text: str, comment: str) -> str:
    """A text with a comment before the last line that begins with a word, or else at its end.

    Args:
        word: A regular expression.
        text: The program.
        comment: A line, with its end.
    """
    lines = list(re.finditer(rf"(?im)^[ \t]*{word}\b", text))
    at = lines[-1].start() if lines else len(text)
    return text[:at] + comment + text[at:]


def signed(value: float, negative: bool, edge: float = EDGE) -> bool:
    """Whether a number is on that side of zero, or on the edge."""
    return abs(value) < edge or (value < 0) == negative


def of_rpy(position_mm: Sequence[float], rpy_deg: Sequence[float]) -> Array:
    """Transform (4, 4) of a position [mm] and roll, pitch and yaw about fixed axes [deg]."""
    return transform(np.array(position_mm) / MM, np.deg2rad(rpy_deg))


def rpy_of(place: Array, near_roll: float) -> tuple[float, float, float]:
    """Roll, pitch and yaw [deg]; where they are not unique, of that roll."""
    R = place[:3, :3]
    across = float(np.hypot(R[0, 0], R[1, 0]))
    pitch = np.arctan2(-R[2, 0], across)
    if across > GIMBAL:
        roll = np.arctan2(R[2, 1], R[2, 2])
        yaw = np.arctan2(R[1, 0], R[0, 0])
    else:
        roll = np.deg2rad(near_roll)
        straight = R @ rotation(np.array([-roll, 0.0, 0.0]))
        yaw = np.arctan2(-straight[0, 1], straight[1, 1])
    angles = np.rad2deg([roll, pitch, yaw])
    return float(angles[0]), float(angles[1]), float(angles[2])


def of_quaternion(position_mm: Sequence[float], quaternion: Sequence[float]) -> Array:
    """Transform (4, 4) of a position [mm] and a quaternion (4,), its scalar first."""
    w, x, y, z = np.array(quaternion) / np.linalg.norm(quaternion)
    T = np.eye(4)
    T[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    T[:3, 3] = np.array(position_mm) / MM
    return T


def quaternion_of(place: Array, near: Sequence[float]) -> Array:
    """The quaternion (4,) of a transform, its scalar first, of both the one near another."""
    vector = rotation_vector(place[:3, :3])
    angle = float(np.linalg.norm(vector))
    half = 0.5 * np.sinc(angle / (2 * np.pi))
    found = np.array([np.cos(angle / 2), *(half * vector)])
    return found if found @ np.array(near) >= 0 else -found


def of_vector(position: Sequence[float], vector: Sequence[float]) -> Array:
    """Transform (4, 4) of a position [m] and a rotation vector [rad]."""
    T = np.eye(4)
    T[:3, :3] = rotation(np.array(vector, dtype=float))
    T[:3, 3] = position
    return T


def vector_of(place: Array, near: Sequence[float]) -> Array:
    """The rotation vector (3,) of a transform, of those of one turn the one near another [rad]."""
    vector = rotation_vector(place[:3, :3])
    angle = float(np.linalg.norm(vector))
    if not angle:
        return vector
    others = [vector * (1 + turn * 2 * np.pi / angle) for turn in (-1, 0, 1)]
    return min(others, key=lambda one: float(np.linalg.norm(one - np.array(near))))
