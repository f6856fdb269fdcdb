"""What is said to have happened in the course of a day shows in the order of its poses alone."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

import edtk
from edtk.robots.rotations import transform
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry

Array = NDArray[np.float64]
OFFSETS = np.array([[0.09, 0.01, 0.05], [-0.03, 0.07, 0.04], [0.0, -0.06, 0.1]])
AXES = {"x": [1, 0, 0], "y": [0, 1, 0], "z": [0, 0, 1]}
# An arm of 2.7 m of the size of a FANUC R-2000iC, by its data sheet.
LINKS = ([0, 0, 0.67], [0, 0.312, 0], [0, 0, 1.075], [0, 0, 0.225], [0, 1.28, 0], [0, 0, 0])
JOINTS = [
    {"name": f"q{i}", "origin_m": origin, "axis": AXES[axis], "limits_deg": [-360, 360]}
    for i, (origin, axis) in enumerate(zip(LINKS, "zxxyxy", strict=True), 1)
]
WAVES = np.array([1, 2, 3])


@cache
def study() -> Study:
    """All geometry of the arm, read by three markers."""
    return Study(
        robot={"name": "arm", "source": "a data sheet", "joints": JOINTS},
        measurement={"sigma_mm": 0.05},
        parameters={"compliance": [], "geometry": "all", "base": True, "tool": True},
        marker=[{"name": name} for name in "ABC"],
    )


def said_of(
    rng: np.random.Generator, q: Array, gears: float, drift: Array | float = 0.0
) -> set[str]:
    """Kinds of what is said of a day.

    Args:
        rng: Of the robot and of the readings.
        q: The poses (m, 6) [rad].
        gears: Size of each of three waves a turn, in every joint [rad].
        drift: How far the frame is off in each pose (m,) [m].
    """
    model = StudyGeometry.of(study()).model
    model = replace(model, offsets=OFFSETS, start=transform(rng.uniform(-1, 1, 3)))
    theta = rng.normal(0, 0.7, model.p) * model.scales
    waves = WAVES * q[..., None] + rng.uniform(0, 2 * np.pi, (6, 3))
    there = q + (gears * rng.normal(size=(6, 3)) * np.sin(waves)).sum(axis=-1)
    x = model.see(theta, there, derivatives=False).points
    x = x + np.reshape(drift, (-1, 1, 1)) * np.array([0.6, -0.64, 0.48])
    x = x + rng.normal(0, 2e-5, (len(q), 1, 3)) + rng.normal(0, 5e-6, x.shape)
    names = [f"{marker}{axis}_mm" for marker in "ABC" for axis in "xyz"]
    columns = [*(f"q{i}_deg" for i in range(1, 7)), *names]
    numbers = np.hstack([np.rad2deg(q), 1e3 * x.reshape(len(q), -1)])
    found = edtk.identify(study(), pd.DataFrame(numbers, columns=columns)).findings
    return {one.kind for one in found}


def groups(rng: np.random.Generator) -> Array:
    """Poses (24, 6) of two groups that differ little, and four others [rad]."""
    q = np.empty((24, 6))
    near = rng.random((24, 1)) < 0.6
    q[:, 0] = 45
    q[:, 1:3] = np.where(near, [26, 15], [-53, -67]) + rng.normal(0, [4, 8], (24, 2))
    q[:, 3:] = rng.uniform([-300, -40, -250], [300, 40, 250], (24, 3))
    q[rng.choice(24, 4, replace=False)] = rng.uniform(-60, 60, (4, 6))
    return np.deg2rad(q)


def regions(rng: np.random.Generator) -> Array:
    """Poses (36, 6) in six regions of the arm, visited one region after the other [rad]."""
    q = np.repeat(rng.uniform(-1.5, 1.5, (6, 6)), 6, axis=0)
    q[:, :3] += rng.normal(0, 0.12, (36, 3))
    q[:, 3:] = rng.uniform(-1.7, 1.7, (36, 3))
    return q


@pytest.mark.parametrize(
    ("poses", "gears", "seed"),
    [(groups, 5e-5, 6), (regions, 2e-4, 0)],
)
def test_groups_of_poses_are_no_frame_that_moved(
    poses: Callable[[np.random.Generator], Array], gears: float, seed: int
) -> None:
    """What a robot leaves is alike in like poses, whenever they are visited."""
    rng = np.random.default_rng(seed)
    said = said_of(rng, poses(rng), gears)
    assert not {"frame_moved", "drift", "growth", "untold_load", "cause"} & said


def test_a_drift_is_told_apart_from_the_regions_of_a_day() -> None:
    """It goes on within them."""
    rng = np.random.default_rng(0)
    said = said_of(rng, regions(rng), 2e-4, np.linspace(0, 1e-3, 36))
    assert said & {"frame_moved", "drift", "growth"} == {"drift"}


def test_a_drift_amid_larger_errors_is_no_step() -> None:
    """A step and what grows are compared, and the likelier is named."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-2, 2, (36, 6))
    said = said_of(rng, q, 2e-4, np.linspace(0, 1e-3, 36))
    assert said & {"frame_moved", "drift", "growth"} == {"drift"}
