"""The cause that a finding about units or columns names."""

from edtk.calibration.causes.cause import Cause
from edtk.calibration.finding import Finding, Kind

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
FRAMES = (Kind.OTHER_AXES, Kind.WRONG_SIGN)
COLUMNS = (Kind.SWAPPED_COLUMNS, Kind.OPPOSITE_SIGN, Kind.JOINT_OFFSET, Kind.SWAPPED_MARKERS)


def cause_of(finding: Finding) -> Cause | None:
    """Express a finding about units or columns as a cause.

    Returns:
        `unit` with its factor, `frame_axes` or `columns` with the number of columns that are to be
        read otherwise; None for findings about other things.
    """
    kind = finding.kind
    if kind is Kind.SEVERAL_READINGS:
        return cause_of(finding.data["readings"][0])
    p = float(finding.data.get("p", 0.0))
    explained = float(finding.data.get("explained", 1.0))
    if kind in (Kind.ROTATION_UNIT, Kind.ANGLE_UNIT):
        return Cause("unit", *RADIANS, None, p, explained)
    if kind is Kind.MARKER_UNIT:
        return Cause("unit", *UNITS["metres"], None, p, explained)
    if kind in (Kind.FORCE_UNIT, Kind.LENGTH_UNIT) and finding.data["unit"]:
        return Cause("unit", *UNITS[finding.data["unit"]], None, p, explained)
    if kind in FRAMES:
        return Cause("frame_axes", float(len(finding.columns) or 3), "axes", None, p, explained)
    if kind in COLUMNS:
        return Cause("columns", float(len(finding.columns)), "columns", None, p, explained)
    return None
