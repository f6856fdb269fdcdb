"""Text of the posterior of a calibration of geometry."""

from edtk.inference.geometry.geometry_posterior import GeometryPosterior
from edtk.report.places_of import places_of
from edtk.report.text_table import name_width


def geometry_posterior(found: GeometryPosterior) -> str:
    """How it was computed, and standard deviations beside those of the fit."""
    width = name_width(found.parameters, 8)
    lines = [
        found.quality,
        f"{'param':{width}}{'std posterior':>14}{'std of the fit':>17}{'ratio':>9}"
        f"{'95 % interval':>32}",
    ]
    table = found.to_frame()
    for row, std in zip(table.itertuples(), found.std.tolist(), strict=True):
        places = places_of(std)
        interval = f"{row.low_95:.{places}f} to {row.high_95:.{places}f} {row.unit}"
        lines.append(
            f"{row.parameter:{width}}{row.std_posterior:14.4g}{row.std_fit:17.4g}{row.ratio:9.3f}"
            f"{interval:>32}"
        )
    return "\n".join(lines)
