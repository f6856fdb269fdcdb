"""Writers of robot programs: what each says of its controller, and how they are found by name."""

import importlib
import math
import pkgutil
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cache
from textwrap import wrap
from typing import ClassVar, TypeVar

import numpy as np

from edtk.programs.program import Axis, Dwell, Program, ProgramError, Wait
from edtk.system.typing import Array

LINE = 90  # characters of a comment, or of a message
GROUP = "edtk.programs"  # of entry points, by which packages add writers
DECIMALS = 3  # of a degree or a millimetre


class Writer(ABC):
    """How a brand writes programs.

    Attributes:
        name: Name by which it is asked for: "krl".
        title: What it writes, in few words.
        suffixes: Endings of its files, the main one first: (".src", ".dat").
        longest_name: Characters that the name of a program may have.
        robot_axes: Numbers of robot axes that the controller may have: (6, 6) for six and no less.
        external_axes: Most axes beside the robot.
        keywords: Names, in small letters, that a program must not have.
        signal: What the name of a digital signal matches; None where there are no signals.
        signal_words: The same in words, for messages.
        longest_dwell: Longest time that a dwell can have [s].
    """

    name: ClassVar[str]
    title: ClassVar[str]
    suffixes: ClassVar[tuple[str, ...]]
    longest_name: ClassVar[int]
    robot_axes: ClassVar[tuple[int, int]] = (1, 6)
    external_axes: ClassVar[int] = 6
    keywords: ClassVar[frozenset[str]] = frozenset()
    signal: ClassVar[str | None] = r"[1-9]\d{0,3}"
    signal_words: ClassVar[str] = "a number from 1 to 9999"
    longest_dwell: ClassVar[float] = math.inf

    def taken(self, shown: Array, axes: Sequence[Axis]) -> Array:
        """What the controller takes (..., n) [deg or mm], nearest to what it is to show (..., n).

        Args:
            shown: Values of the axes [deg or mm].
            axes: The axes (n,).
        """
        return np.round(shown, DECIMALS) + 0.0

    @abstractmethod
    def write(self, program: Program) -> Mapping[str, str]:
        """The text of each file, by its ending.

        Args:
            program: A program that `require` has let pass.
        """

    def files(self, program: Program) -> Mapping[str, str]:
        """The text of each file, by its ending.

        Raises:
            ProgramError: The controller does not take such a program.
        """
        self.require(program)
        return self.write(program)

    def require(self, program: Program) -> None:
        """Check that the controller takes a program: its name, axes, signals and times.

        Raises:
            ProgramError: It does not; one line says why.
        """
        self.require_name(program.name)
        self._require_axes(program.axes)
        for step in program.steps:
            if isinstance(step, Wait) and step.signals is not None:
                self._require_signals(step.signals)
            if isinstance(step, Dwell) and step.seconds > self.longest_dwell:
                most = f"{self.longest_dwell:g} s at most"
                raise ProgramError(f"a dwell of {step.seconds:g} s; {self.name} has {most}")

    def require_name(self, name: str) -> None:
        """Check that a program may have a name.

        Raises:
            ProgramError: It may not.
        """
        expected = f"expected letters, digits and _, a letter first, at most {self.longest_name}"
        plain = re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name)
        if not plain or len(name) > self.longest_name:
            raise ProgramError(f"program name {name!r}: {expected}, for {self.name}")
        if name.lower() in self.keywords:
            raise ProgramError(f"program name {name!r} is a word of {self.name}; expected another")

    def _require_axes(self, axes: Sequence[Axis]) -> None:
        own = [axis.number for axis in axes if not axis.external]
        beside = [axis.number for axis in axes if axis.external]
        fewest, most = self.robot_axes
        if not (fewest <= len(own) and max(own, default=0) <= most):
            wanted = f"{most}" if fewest == most else f"{fewest} to {most}"
            raise ProgramError(
                f"the robot has {len(own)} axes, up to number {max(own, default=0)}; "
                f"{self.name} takes {wanted}"
            )
        if max(beside, default=0) > self.external_axes:
            has = f"{self.external_axes or 'none'}"
            raise ProgramError(f"axis E{max(beside)} beside the robot; {self.name} has {has}")

    def _require_signals(self, signals: tuple[str, str]) -> None:
        if self.signal is None:
            raise ProgramError(f"{self.name} has no signals; leave the handshake out")
        for name in signals:
            if not re.fullmatch(self.signal, name):
                raise ProgramError(
                    f"signal {name!r}: expected {self.signal_words}, for {self.name}"
                )


def plain(text: str, most: int) -> str:
    """A text as controllers take it: signs of ASCII without quotes, at most so many of them."""
    signs = (sign if sign.isascii() and sign.isprintable() else "?" for sign in text)
    return "".join("'" if sign in '"`' else sign for sign in signs)[:most]


def folded(text: str, most: int) -> list[str]:
    """A text as lines of at most so many signs, as controllers take them."""
    return wrap(plain(text, len(text)), most) or [""]


_registered: dict[str, type[Writer]] = {}
W = TypeVar("W", bound=type[Writer])


def register(cls: W) -> W:
    """Class decorator that makes a writer known under its `name`.

    Raises:
        ProgramError: Another class holds that name, or a method is missing.
    """
    missing = sorted(getattr(cls, "__abstractmethods__", ()))
    if missing:
        raise ProgramError(f"writer {cls.name!r} does not define {' and '.join(missing)}")
    holder = _registered.setdefault(cls.name, cls)
    if holder is not cls:
        places = [f"{one.__module__}.{one.__qualname__}" for one in (cls, holder)]
        raise ProgramError(f"writer name {cls.name!r} of {places[0]} is taken by {places[1]}")
    return cls


def available() -> tuple[str, ...]:
    """Names of all writers, those of this package first."""
    _load_builtins()
    from importlib.metadata import entry_points

    others = {point.name for point in entry_points(group=GROUP)} - set(_registered)
    return (*_registered, *sorted(others))


def get(name: str) -> Writer:
    """The writer of that name; no plug-in of another name is imported.

    Raises:
        ProgramError: There is none, which lists all that there are; or a plug-in does not load.
    """
    _load_builtins()
    if name not in _registered:
        _load_plugin(name)
    return _registered[name]()


@cache
def _load_builtins() -> None:
    """Import every module of this package: a writer is added by adding its file."""
    package = importlib.import_module("edtk.programs")
    for module in sorted(m.name for m in pkgutil.iter_modules(package.__path__)):
        importlib.import_module(f"edtk.programs.{module}")


def _load_plugin(name: str) -> None:
    """Import the class that an entry point of this name names, and register it.

    Raises:
        ProgramError: There is none, or it does not load, or is no writer of this name.
    """
    from importlib.metadata import entry_points

    points = {point.value: point for point in entry_points(group=GROUP, name=name)}
    if not points:
        raise ProgramError(f"unknown writer {name!r}; available: {', '.join(available())}")
    if len(points) > 1:
        raise ProgramError(f"writer name {name!r} is claimed by {' and '.join(points)}")
    ((value, point),) = points.items()
    try:
        cls = point.load()
    except Exception as error:  # a third party's module may raise anything
        message = f"writer {name!r}: plug-in {value!r} does not load: {error}"
        raise ProgramError(message) from error
    if not (isinstance(cls, type) and issubclass(cls, Writer) and cls.name == name):
        raise ProgramError(f"writer {name!r}: plug-in {value!r} is no Writer class of that name")
    register(cls)
