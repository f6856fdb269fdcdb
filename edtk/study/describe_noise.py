"""The noise of a study in words."""

from edtk.study.schema import Specification


def describe_noise(specification: Specification) -> str:
    """White noise, then the errors of [noise]; commas between them."""
    measurement = specification.measurement
    sizes = []
    if measurement.sigma_mm is not None:
        sizes.append(f"{measurement.sigma_mm:g} mm")
    if measurement.sigma_deg is not None and measurement.rows == "pose":
        sizes.append(f"{measurement.sigma_deg:g} deg")
    white = f"sigma = {' and '.join(sizes)}" if sizes else ""
    other = "" if specification.noise is None else specification.noise.describe()
    return ", ".join(filter(None, (white, other)))
