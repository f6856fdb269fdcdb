"""Descents that the parts of a search ask for, so that those of several are done together."""

from collections.abc import Generator
from dataclasses import dataclass
from typing import NamedTuple

from edtk.design.exact.plans import Plans
from edtk.system.typing import Array


@dataclass(frozen=True)
class Effort:
    """How far a descent goes: its steps, and the soft maxima of criteria with kinks."""

    iterations: int
    sharpness: tuple[float, ...]


COARSE = Effort(15, (30.0,))  # enough to tell good starts from bad ones
FINE = Effort(60, (250.0,))


class Descent(NamedTuple):
    """A descent that is asked for: that of all these plans, with so much effort."""

    plans: Plans
    effort: Effort


Answer = tuple[Array, Plans]  # costs (b,) and plans
# It yields descents and is sent their ends; it returns its best plans, the best first.
Search = Generator[Descent, Answer, Answer]
