"""The part of a report of geometry that shows the posterior."""

from edtk.calibration.geometry.geometric_calibration import GeometricCalibration
from edtk.inference.geometry.geometry_posterior import GeometryPosterior
from edtk.report.page import paragraph, section, table
from edtk.report.places_of import places_of


def posterior_of_geometry(found: GeometricCalibration, posterior: GeometryPosterior) -> str:
    """How it was computed, and a table."""
    rows = []
    for row in posterior.to_frame().to_dict(orient="records"):
        places = places_of(row["std_posterior"])
        rows.append(
            [
                row["parameter"],
                f"{row['mean']:+.{places}f}",
                f"{row['std_posterior']:.{places}f}",
                f"{row['std_fit']:.{places}f}",
                f"{row['ratio']:.2f}",
                f"{row['low_95']:+.{places}f} .. {row['high_95']:+.{places}f}",
                row["unit"],
            ]
        )
    header = ["parameter", "mean", "std", "std of the fit", "ratio", "95 % interval", "unit"]
    text = f"{posterior.quality[:1].upper()}{posterior.quality[1:]}."
    sizes = (
        "Errors are as large as they were fitted. The fit weights coordinates more equally than "
        "the noise says, and its standard deviations are those of that."
    )
    return section(
        "What does the posterior say?",
        paragraph(f"{text} {sizes}"),
        table(header, rows, full=True),
    )
