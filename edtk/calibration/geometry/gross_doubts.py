"""Words on visits whose positions cannot be those of the markers."""

from edtk.calibration.diagnostics.diagnostic import Severity
from edtk.calibration.geometry.geometric_doubt import GeometricDoubt, rows_in_words
from edtk.calibration.geometry.gross_errors import GrossErrors
from edtk.inference.geometry.marker_positions import MarkerPositions


def gross_doubts(data: MarkerPositions, found: GrossErrors) -> list[GeometricDoubt]:
    """A doubt for each set of markers that were swapped, and one for all other visits.

    Args:
        data: All visits.
        found: Those that were not fitted.
    """
    doubts = []
    for markers in dict.fromkeys(markers for _, markers in found.swapped):
        rows = _rows(data, [visit for visit, own in found.swapped if own == markers])
        text = (
            f"{rows_in_words(rows)}: markers {' and '.join(markers)} are swapped; these rows do "
            "not count"
        )
        doubts.append(GeometricDoubt(Severity.WARNING, "swapped", text, rows))
    if found.wrong:
        rows = _rows(data, [visit for visit, _ in found.wrong])
        size = 1e3 * max(distance for _, distance in found.wrong)
        text = (
            f"{rows_in_words(rows)}: positions are up to {size:.3g} mm from where all others say; "
            "is the pose another one? These rows do not count"
        )
        doubts.append(GeometricDoubt(Severity.WARNING, "gross", text, rows))
    return doubts


def _rows(data: MarkerPositions, visits: list[int]) -> tuple[int, ...]:
    """Rows of the file that some visits are in."""
    rows = {int(row) for visit in visits for row in data.row[visit] if row >= 0}
    return tuple(sorted(rows))
