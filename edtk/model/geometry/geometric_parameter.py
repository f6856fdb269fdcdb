"""One parameter of the geometry or of the springs: its name, its words, its unit and its scale."""

from dataclasses import dataclass, field
from typing import Literal

Place = Literal["base", "joint", "tool", "compliance"]
AXES = "xyz"
SHIFTS = AXES
TURNS = ("rx", "ry", "rz")
COMPONENTS = (*SHIFTS, *TURNS)

# One unit in which a parameter is of order one: a millimetre, a milliradian, a soft joint.
MILLIMETRE = 1e-3
MILLIRADIAN = 1e-3
SOFTNESS = 1e-6  # [rad/(N m)]
SLIDING_SOFTNESS = 1e-6  # [m/N]
SPREAD = 10.0  # of what is not told, in these units, or in likely sizes of a compliance


@dataclass(frozen=True)
class GeometricParameter:
    """One parameter.

    Attributes:
        place: What it moves: the base, the frame before a joint, a tool, or a spring.
        of: Name of the joint or of the marker; empty for the base.
        component: x y z for a shift, rx ry rz for a turn; empty for a compliance.
        slides: Whether a compliance is that of a prismatic joint.
        along: Whether the component is the one along the joint's own axis: a turn of a revolute
            joint is the offset of its zero.
        likely: Size that a compliance is likely to have, in SI units; None where nobody knows.
    """

    place: Place
    of: str = ""
    component: str = ""
    slides: bool = False
    along: bool = False
    likely: float | None = field(default=None, compare=False)

    @property
    def name(self) -> str:
        """Name in files: `base.x`, `q2.rz`, `tool.A.x`, `k_q2`."""
        if self.place == "compliance":
            return f"k_{self.of}"
        if self.place == "base":
            return f"base.{self.component}"
        if self.place == "tool":
            return f"tool.{self.of}.{self.component}" if self.of else f"tool.{self.component}"
        return f"{self.of}.{self.component}"

    @property
    def kind(self) -> str:
        """Of which kind an error before a joint is: zeros, lengths or tilts; else its place."""
        if self.place != "joint":
            return self.place
        if self.along:
            return "zeros"
        return "tilts" if self.turns else "lengths"

    @property
    def groups(self) -> tuple[str, ...]:
        """Names by which lists of a study may mean it, the shortest list last."""
        own = (self.name,)
        if self.place == "joint":
            return (*own, self.of, self.kind, "geometry")
        return (*own, self.place)

    @property
    def turns(self) -> bool:
        """Whether it is an angle."""
        return self.component in TURNS

    @property
    def scale(self) -> float:
        """Size of one unit in which people read it, in SI units."""
        if self.place == "compliance":
            return SLIDING_SOFTNESS if self.slides else SOFTNESS
        return MILLIRADIAN if self.turns else MILLIMETRE

    @property
    def spread(self) -> float:
        """How far it may be from the drawing where nothing tells it, in its units: one std.

        A length of the drawing may be 10 mm off and an angle 10 mrad. A compliance may be ten times
        the likely one, whichever that is: those of a small arm's wrist are 1e-4 rad/(N m), and of a
        heavy arm's shoulder 1e-7.
        """
        return SPREAD if self.likely is None else SPREAD * self.likely / self.scale

    @property
    def unit(self) -> str:
        """That unit in words."""
        if self.place == "compliance":
            return "1e-6 m/N" if self.slides else "1e-6 rad/(N m)"
        return "mrad" if self.turns else "mm"

    @property
    def words(self) -> str:
        """What it is, for people."""
        axis = self.component[-1:]
        joint = self.of if self.of.startswith("joint") else f"joint {self.of}"
        if self.place == "compliance":
            return f"the compliance of {joint}"
        if self.place == "base":
            return f"the base's turn about {axis}" if self.turns else f"the base's {axis}"
        if self.place == "tool":
            named = self.of if self.of.startswith("marker") else f"marker {self.of}"
            tool = f"{named} on the tool" if self.of else "the tool"
            return f"the turn of {tool} about {axis}" if self.turns else f"{tool} along {axis}"
        if self.along:
            return f"the zero of {joint}"
        if self.turns:
            return f"the tilt about {axis} before {joint}"
        return f"the length along {axis} before {joint}"
