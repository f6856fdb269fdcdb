"""Robots that were measured by others, and the studies of their geometry."""

from pathlib import Path
from typing import Any

from edtk import Study

IRB_120 = (
    "ABB IRB 120",
    [(0, 0, 0.29), (0, 0, 0), (0, 0, 0.27), (0, 0, 0.07), (0.302, 0, 0), (0, 0, 0)],
    "zyyxyx",
)
FANUC = (
    "FANUC R-2000iC/165F",
    [(0, 0, 0.67), (0, 0.312, 0), (0, 0, 1.075), (0, 0, 0.225), (0, 1.28, 0), (0, 0, 0)],
    "zxxyxy",
)
AXES = {"x": [1, 0, 0], "y": [0, 1, 0], "z": [0, 0, 1]}
FILES = (
    "abb_irb120_calibration.csv",
    "abb_irb120_test.csv",
    "fanuc_r2000ic_165f.csv",
    "abb_irb120_tracker.csv",
)
SIGMA_MM = 0.05  # of a reading, as stated before anything is measured


def robot(drawing: tuple[str, list[tuple[float, float, float]], str]) -> dict[str, Any]:
    """The keys of a robot file, for origins [m] along parallel frames and axes by letter."""
    name, origins, axes = drawing
    joints = [
        {
            "name": f"q{i}",
            "origin_m": list(map(float, origin)),
            "axis": AXES[axis],
            "limits_deg": [-360, 360],
        }
        for i, (origin, axis) in enumerate(zip(origins, axes, strict=True), start=1)
    ]
    return {"name": name, "source": "the drawing of its data sheet", "joints": joints}


def study_of(
    drawing: tuple[str, list[tuple[float, float, float]], str], references: tuple[str, ...] = ()
) -> Study:
    """A study of all geometry, base and tools, with three markers and points on the base."""
    markers: list[dict[str, Any]] = [{"name": name} for name in "ABC"]
    markers += [{"name": name, "joint": "base"} for name in references]
    return Study(
        robot=robot(drawing),
        measurement={"sigma_mm": SIGMA_MM},
        parameters={"compliance": [], "geometry": "all", "base": True, "tool": True},
        marker=markers,
    )


def paths(data: Path) -> list[Path]:
    """The files of the measured sets.

    Raises:
        FileNotFoundError: One is not there.
    """
    found = [data / name for name in FILES]
    for path in found:
        if not path.is_file():
            raise FileNotFoundError(path)
    return found
