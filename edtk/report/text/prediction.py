"""Text of a prediction."""

from edtk.calibration.geometry.prediction import Prediction

MOST_LINES = 60


def prediction(found: Prediction) -> str:
    """A line for each position, and the comparison."""
    positions = found.to_dict()["positions"]
    width = max([len(one["marker"]) for one in positions] + [6])
    lines = [f"  row  {'marker':{width}}  x, y, z and half the 95 % band [mm]"]
    for one in positions[:MOST_LINES]:
        values = "".join(
            f"{one[f'{axis}_mm']:12.3f} +-{one[f'band_{axis}_mm']:.3f}" for axis in "xyz"
        )
        error = f"  error {one['error_mm']:.3f}" if "error_mm" in one else ""
        note = "" if one.get("test", True) else " (places the tool)"
        lines.append(f"{one['row']:5d}  {one['marker']:{width}}{values}{error}{note}")
    more = len(positions) - MOST_LINES
    if more > 0:
        lines.append(f"  ... and {more} more, in --json or --out")
    if found.tests.any():
        lines.append(
            f"{int(found.tests.sum())} measured positions: errors {found.mean_mm:.4g} mm mean, "
            f"{found.rms_mm:.4g} mm rms, {found.max_mm:.4g} mm largest; "
            f"{100 * found.share_inside:.1f} % of the coordinates inside their 95 % bands"
        )
    if found.turn_rms_deg is not None:
        lines.append(f"orientations: {found.turn_rms_deg:.3g} deg rms off")
    return "\n".join(lines)
