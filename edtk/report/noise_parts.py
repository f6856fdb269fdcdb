"""The parts of the noise that visits and markers tell, as a piece of a calibration's report."""

import numpy as np

from edtk.calibration.calibration import Calibration
from edtk.inference.estimate_noise import NoiseEstimate
from edtk.report.page import paragraph, table
from edtk.report.shown_probability import shown_probability

HEADER = ("part of the noise", "estimate", "std", "unit", "root mean square of a coordinate [mm]")


def noise_parts(found: Calibration) -> list[str]:
    """A sentence on what moves together and a table of three errors; nothing if none is told."""
    noise = found.noise
    if noise is None:
        return []
    return [paragraph(_together(noise)), table(list(HEADER), _rows(found, noise), full=True)]


def _together(noise: NoiseEstimate) -> str:
    """Whether markers of a visit move together."""
    strata = noise.strata
    moved = strata.visits if noise.revisited else strata.poses
    numbers = (
        f"F = {noise.F:.3g} for {moved.dof} degrees of freedom, p {shown_probability(noise.p)}"
    )
    if noise.moves:
        return f"Measurements of a visit are off together, as if joints had moved ({numbers})."
    return f"Measurements of a visit are not off together by more than chance ({numbers})."


def _rows(found: Calibration, noise: NoiseEstimate) -> list[list[str]]:
    """Tracker, repeatability, and what remains."""
    sigma = 1e3 * float(np.sqrt(np.mean(found.data.own_sigma[found.data.lengths] ** 2)))
    unit = "deg" if any(one.kind == "revolute" for one in found.study.robot.joints) else "mm"
    sizes = (noise.tracker, noise.by_joints, noise.by_model)
    coordinate = [f"{sigma * size:.2g}" for size in sizes]
    cells = [
        ["tracker, as a share of the stated", *_number(noise, 0, noise.tracker, 1.0), "1"],
        ["repeatability of each joint", *_number(noise, 1, noise.joints, 1.0), unit],
        ["discrepancy of the model", *_number(noise, 2, noise.discrepancy, 1e3), "mm"],
    ]
    told = zip(cells, coordinate, noise.told, strict=True)
    return [[*row, size if known else "-"] for row, size, known in told]


def _number(noise: NoiseEstimate, i: int, value: float, factor: float) -> tuple[str, str]:
    """An estimate and its standard deviation; dashes where nothing tells them."""
    if not noise.told[i]:
        return "not told apart", "-"
    std = noise.std[i]
    return f"{factor * value:.3g}", f"{factor * std:.1g}" if np.isfinite(std) else "-"
