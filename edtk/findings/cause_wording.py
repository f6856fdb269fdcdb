"""The sentences of causes, and of columns that look misread."""

from collections.abc import Callable
from dataclasses import replace

from edtk.findings.causes.family import Cause
from edtk.findings.finding import Data, Finding, row_names, shown_probability

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


def cause_of(finding: Finding) -> Cause | None:
    """Express a finding about units or columns as a cause.

    Returns:
        `unit` with its factor, `frame_axes` or `columns` with the number of columns that are to be
        read otherwise; None for findings about other things.
    """
    kind = finding.kind
    if kind == "several_readings":
        return cause_of(finding.data["readings"][0])
    p = float(finding.data.get("p", 0.0))
    explained = float(finding.data.get("explained", 1.0))
    if kind in ("rotation_unit", "angle_unit"):
        return Cause("unit", *RADIANS, None, p, explained)
    if kind == "marker_unit":
        return Cause("unit", *UNITS["metres"], None, p, explained)
    if kind in ("force_unit", "length_unit") and finding.data["unit"]:
        return Cause("unit", *UNITS[finding.data["unit"]], None, p, explained)
    if kind in FRAMES:
        return Cause("frame_axes", float(len(finding.columns) or 3), "axes", None, p, explained)
    if kind in COLUMNS:
        return Cause("columns", float(len(finding.columns)), "columns", None, p, explained)
    return None


def cause_wording(cause: Cause) -> str:
    """A clause that says which fault the measurements show, and how large it is."""
    return _CAUSE_CLAUSES[cause.cause](cause)


def _size(cause: Cause) -> str:
    """A fault's size with its standard deviation and unit."""
    if cause.std is None:
        return f"{cause.size:.3g} {cause.unit}"
    return f"{cause.size:.3g} +- {cause.std:.1g} {cause.unit}"


def _signed(cause: Cause, more: str, less: str) -> tuple[str, str]:
    """A fault's size without its sign, and the word for the sign."""
    return _size(replace(cause, size=abs(cause.size))), more if cause.size > 0 else less


def _load_size(cause: Cause) -> str:
    """A load that is heavier or lighter."""
    size, which = _signed(cause, "larger", "smaller")
    return f"the load looks {size} {which} than stated"


def _tool(cause: Cause) -> str:
    """A tool point that is elsewhere."""
    size, along = _signed(cause, "along", "against")
    return f"the tool point looks {size} further {along} the tool's {cause.cause[-1]} axis"


def _joint(cause: Cause) -> str:
    """The joint in which a fault is; every one where it is in none."""
    return f"joint {cause.joint}" if cause.joint else "every joint"


def _wrong_pose(cause: Cause) -> str:
    """A pose that is not the one written down."""
    rows = row_names(cause.rows)
    if not cause.joint:
        are_off = "are off together" if len(cause.rows) > 1 else "is off"
        return f"{rows} {are_off} by {_size(cause)}: is the pose the one written down?"
    return f"{rows}: joint {cause.joint} looks {_size(cause)} away from the written value"


def _frame_rotation(cause: Cause) -> str:
    """A measuring frame that is turned; or a joint whose zero is off, which does the same."""
    turned = f"the measuring frame looks turned by {_size(cause)}"
    if not cause.joint:
        return turned
    zero = "the zero of that joint is off by as much: both look the same"
    return f"{turned} about the axis of joint {cause.joint}, or {zero}"


def _joint_zero(cause: Cause) -> str:
    """A joint that is counted from a zero that is off."""
    size, which = _signed(cause, "further than", "short of")
    return f"the zero of joint {cause.joint} looks off: it is {size} {which} what is written"


def _link_length(cause: Cause) -> str:
    """Links that are longer or shorter than in the model."""
    size, which = _signed(cause, "longer", "shorter")
    links = f"the link before joint {cause.joint} looks" if cause.joint else "every link looks"
    return f"{links} {size} {which} than in the robot's model: is it another robot?"


def _compliance(cause: Cause) -> str:
    """A joint whose compliance is another one than is taken."""
    size, which = _signed(cause, "more", "less")
    cure = "identify it (joints.unknown), or correct known_rad_per_Nm"
    return f"joint {cause.joint} looks {size} {which} compliant than is taken: {cure}"


def _drift(cause: Cause) -> str:
    """Something that moves between unloaded and loaded readings: at once, or slowly."""
    if cause.grows:
        return f"the readings look as if something drifts, by {_size(cause)} from first to last row"
    return f"loaded readings look shifted by {_size(cause)} against unloaded ones"


def _friction(cause: Cause) -> str:
    """A joint, or every one, that friction holds."""
    what = "of its load" if cause.unit.startswith("N") else "of its motion"
    return f"friction in {_joint(cause)} looks to take {_size(cause)} {what}"


def _misread(cause: Cause) -> str:
    """Columns that are to be read otherwise."""
    return f"the columns look misread ({cause.cause.replace('_', ' ')})"


_CAUSE_CLAUSES: dict[str, Callable[[Cause], str]] = {
    "load_size": _load_size,
    "load_direction": lambda cause: f"the load looks tilted by {_size(cause)}",
    **{f"tool_{axis}": _tool for axis in "xyz"},
    "frame_rotation": _frame_rotation,
    "joint_zero": _joint_zero,
    "link_length": _link_length,
    "friction": _friction,
    "compliance": _compliance,
    "frame_axes": _misread,
    "columns": _misread,
    "unit": lambda cause: f"the displacements look {_size(cause)} too large: another unit?",
    "drift": _drift,
    "sigma": lambda cause: f"the noise is {_size(cause)}",
    "pose": _wrong_pose,
    "torque_sign": lambda cause: (
        f"the compliance of {_joint(cause)} depends on the sign of its torque, by +-{_size(cause)}"
    ),
    "backlash": lambda cause: f"{_joint(cause)} looks loose by +-{_size(cause)}",
}


def causes_words(data: Data) -> str:
    """A fault that explains the residuals, or two of which it is one."""
    cause = data["cause"]
    others = data["others"]
    share = f"{100 * cause.explained:.3g} % of the misfit (p {shown_probability(cause.p, 1)})"
    if not others:
        return f"{cause_wording(cause)}: that explains {share}"
    either = ", or ".join(cause_wording(one) for one in (cause, *others))
    times = others[0].times
    which = "these measurements cannot tell which"
    if times is not None and times > 1:
        which += f", measuring each experiment {times} times could"
    return f"{either}: {which}; the first explains {share}"


def no_cause_words(data: Data) -> str:
    """A misfit that no fault explains, and what would tell more."""
    tells = []
    if not data["repeated"]:
        tells.append("each pose measured twice, which tells noise from model")
    if not data["loads"]:
        tells.append("a pose under half the load and along another axis, which tells what bends")
    tells.append(
        "positions without load in many poses, which tell the geometry (docs/howto/geometry.md)"
    )
    return (
        "no cause in the list explains this: the model. Something bends, slips or is placed "
        f"otherwise than in the study; more would tell {'; '.join(tells)}"
    )
