"""The headers of the joint variables, in every file with a pose a row."""

from collections.abc import Sequence

from edtk.model.joint import Joint
from edtk.model.robot import Robot
from edtk.tables.sheet_columns import MEASURED_TOGETHER, RESERVED

MARK = "joint:"  # before a header that would otherwise mean something else
FORMULA = ("=", "+", "-", "@")  # a spreadsheet runs a cell that begins with one of these
UNITS = {"revolute": "deg", "prismatic": "mm"}


def pose_columns(robot: Robot) -> tuple[str, ...]:
    """Column headers of the joint variables: NAME_deg, or NAME_mm for a prismatic joint.

    Where that is the header of another column, such as `x_mm`, or where a spreadsheet would take it
    for a formula, it is `joint:NAME_mm`. No two joints share a header.
    """
    return tuple(_header(joint) for joint in robot.joints)


def with_own_headers(
    header: Sequence[str], robot: Robot, others: Sequence[str] = ()
) -> tuple[str, ...]:
    """A file's header, in which each joint has the header of `pose_columns`.

    A file may have NAME_mm where the joint's own header is `joint:NAME_mm`. It is the joint's,
    unless the file has all the columns that are measured together with that one.

    Args:
        header: The headers of the file.
        robot: Names the joints.
        others: Headers that the file may have besides those of joints.
    """
    own = pose_columns(robot)
    renamed = {}
    for joint, column in zip(robot.joints, own, strict=True):
        plain = _plain(joint)
        if column not in header and plain not in own and not _measured(plain, header, others):
            renamed[plain] = column
    return tuple(renamed.get(column, column) for column in header)


def _measured(column: str, header: Sequence[str], others: Sequence[str]) -> bool:
    """Whether a header can be that of a measurement: all that belongs to it is there."""
    groups = (group for group in MEASURED_TOGETHER if column in group and column in others)
    return any(set(group) <= set(header) for group in groups)


def _header(joint: Joint) -> str:
    """The header of one joint."""
    plain = _plain(joint)
    # A name that itself begins with the mark gets a second one, so that headers stay different.
    marked = plain in RESERVED or plain.startswith((MARK, *FORMULA))
    return MARK + plain if marked else plain


def _plain(joint: Joint) -> str:
    """Name and unit of one joint."""
    return f"{joint.name}_{UNITS[joint.kind]}"
