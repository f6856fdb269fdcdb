"""The sentence of each reading of the columns: how they look misread."""

from collections.abc import Callable

from edtk.calibration.finding import Finding, Kind

NAMED = 150  # characters of the readings that are named; of more, the number is said


def reading_wording(found: Finding) -> str:
    """The sentence of a reading: how much of the misfit it explains, where that is known."""
    clause = _CLAUSES[found.kind](found)
    if "explained" not in found.data:
        return clause
    which = "each explains" if found.kind is Kind.SEVERAL_READINGS else "this explains"
    # Of many measurements a reading explains all but noise: 100 % would say too much.
    share = f"{min(100 * found.data['explained'], 99.99):.4g}"
    after = f"{found.data['after']:.3g}"
    before = f"{found.data['before']:.3g}"
    rows = found.data["left_out"]
    without = f", without {rows} outlier{'s' * (rows > 1)}" if rows else ""
    return (
        f"{clause}; {which} {share} % of the misfit "
        f"(leaves {after} sigma instead of {before}{without})"
    )


def _as_given(found: Finding) -> str:
    """Columns that are not read otherwise."""
    return "the columns are as they are headed"


def _wrong_sign(found: Finding) -> str:
    """Displacements of the wrong sign."""
    return "loaded and unloaded positions look swapped, or the load has the wrong sign"


def _swapped_columns(found: Finding) -> str:
    """Two columns that were exchanged."""
    axes = found.data["positions"]
    or_else = f" (or the positions in {axes[0]} and {axes[1]})" if axes else ""
    return f"columns {' and '.join(found.columns)}{or_else} look swapped"


def _opposite_sign(found: Finding) -> str:
    """Joints, loads or rotations that were counted the other way round."""
    if len(found.columns) == 1:
        return f"column {found.columns[0]} looks measured with the opposite sign"
    return f"columns {', '.join(found.columns)} look measured with the opposite sign"


def _joint_offset(found: Finding) -> str:
    """A joint that was counted from another zero."""
    degrees = found.data["degrees"]
    size = "small" if degrees > 0 else "large"
    return f"column {found.columns[0]} looks {abs(degrees)} degrees too {size}"


def _marker_unit(found: Finding) -> str:
    """Marker offsets in metres."""
    columns = ", ".join(found.columns)
    return f"columns {columns} look as if they were in metres; expected millimetres"


def _swapped_markers(found: Finding) -> str:
    """Two markers that were exchanged in all rows."""
    return f"the markers {' and '.join(found.columns)} look swapped in all rows"


def _other_axes(found: Finding) -> str:
    """Displacements along other axes."""
    expected = ", ".join(found.data["expected"])
    return f"the measuring frame looks {found.data['turn']}: expected ({expected})"


def _several_readings(found: Finding) -> str:
    """Readings that explain the measurements equally well."""
    clauses = [_CLAUSES[reading.kind](reading) for reading in found.data["readings"]]
    short = [clause.replace(" measured with the opposite sign", " reversed") for clause in clauses]
    named = short[:1]
    for clause in short[1:]:
        if len("; or ".join([*named, clause])) <= NAMED:
            named.append(clause)
    left = len(short) - len(named)
    more = f"; or {left} other reading{'s' * (left > 1)}" if left else ""
    return "; or ".join(named) + more


_CLAUSES: dict[Kind, Callable[[Finding], str]] = {
    Kind.AS_GIVEN: _as_given,
    Kind.WRONG_SIGN: _wrong_sign,
    Kind.SWAPPED_COLUMNS: _swapped_columns,
    Kind.OPPOSITE_SIGN: _opposite_sign,
    Kind.JOINT_OFFSET: _joint_offset,
    Kind.MARKER_UNIT: _marker_unit,
    Kind.SWAPPED_MARKERS: _swapped_markers,
    Kind.OTHER_AXES: _other_axes,
    Kind.SEVERAL_READINGS: _several_readings,
}
READINGS = tuple(_CLAUSES)
