"""Words on visits whose positions cannot be those of the markers."""

from edtk.calibration.diagnostics.diagnostic import Severity
from edtk.calibration.geometry.explain_visits import WrongVisit
from edtk.calibration.geometry.geometric_doubt import GeometricDoubt, rows_in_words
from edtk.calibration.geometry.gross_errors import GrossErrors
from edtk.inference.geometry.marker_positions import MarkerPositions

FEW = 0.6  # share of the visits that count, below which these may be the wrong ones


def gross_doubts(data: MarkerPositions, found: GrossErrors) -> list[GeometricDoubt]:
    """A doubt for each set of markers that were swapped or apart, and for each other cause.

    Args:
        data: All visits.
        found: Those that were not fitted.
    """
    doubts = []
    many = len(found.visits) > (1 - FEW) * len(data)
    severity = Severity.ALARM if many else Severity.WARNING
    for markers in dict.fromkeys(markers for _, markers in found.swapped):
        rows = _rows(data, [visit for visit, own in found.swapped if own == markers])
        text = (
            f"{rows_in_words(rows)}: markers {' and '.join(markers)} are swapped; these rows do "
            "not count"
        )
        doubts.append(GeometricDoubt(severity, "swapped", text, rows))
    for names in dict.fromkeys(markers for _, markers, _ in found.apart):
        doubts.append(_apart(data, found, names))
    for cause in dict.fromkeys((one.kind, one.words) for one in found.wrong):
        own = [one for one in found.wrong if (one.kind, one.words) == cause]
        doubts.append(_wrong(data, own, severity))
    return doubts


def _apart(data: MarkerPositions, found: GrossErrors, names: tuple[str, ...]) -> GeometricDoubt:
    """The visits in which one marker is elsewhere on the tool."""
    own = [(visit, size) for visit, markers, size in found.apart if markers == names]
    columns = [data.markers.index(name) for name in names]
    rows = tuple(sorted({int(row) for visit, _ in own for row in data.row[visit, columns]}))
    text = (
        f"{rows_in_words(rows)}: marker {' or '.join(names)} is up to "
        f"{1e3 * max(size for _, size in own):.3g} mm from its usual distance to the other "
        "markers; a slip, or a false reading? These positions do not count"
    )
    return GeometricDoubt(Severity.WARNING, "apart", text, rows)


def _wrong(data: MarkerPositions, visits: list[WrongVisit], severity: Severity) -> GeometricDoubt:
    """The visits with one cause."""
    rows = _rows(data, [one.visit for one in visits])
    size = 1e3 * max(one.distance for one in visits)
    kind, words = visits[0].kind, visits[0].words
    why = f", {words}; these" if words else "; is the pose another one? These"
    text = (
        f"{rows_in_words(rows)}: positions are up to {size:.3g} mm from where all others say{why} "
        "rows do not count"
    )
    return GeometricDoubt(Severity.ALARM if kind == "frame_moved" else severity, kind, text, rows)


def _rows(data: MarkerPositions, visits: list[int]) -> tuple[int, ...]:
    """Rows of the file that some visits are in."""
    rows = {int(row) for visit in visits for row in data.row[visit] if row >= 0}
    return tuple(sorted(rows))
