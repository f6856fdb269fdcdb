"""Sheets of all that a study of geometry can read: simulated visits of an erring small arm."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from small_arm import ROBOT

from edtk.fit.fitted_geometry import loading_of
from edtk.fit.marker_positions import MarkerPositions
from edtk.robots.rotations import rotation, rotation_vectors
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry

Array = NDArray[np.float64]
JOINTS = [f"q{i}_deg" for i in range(1, 7)]
LOADS = ["Fx_N", "Fy_N", "Fz_N"]
TOOL = {"position_mm": [10, 20, 100]}
LOAD = [300.0, -200.0, -800.0]
K = {"q2": 4e-6, "q3": 8e-6, "q5": 3e-5}
SIGMA = 0.02
SPRINGS = {"compliance": list(K), "geometry": [], "base": False, "tool": False}
ALL = {"compliance": list(K), "geometry": "all", "base": True, "tool": True}
MARKERS = [
    {"name": "A", "position_mm": [90, 10, 50]},
    {"name": "B", "position_mm": [-30, 70, 40]},
    {"name": "C", "position_mm": [0, -60, 100]},
]
ON_LINK = {"name": "elbow", "joint": "q3", "position_mm": [40, 30, 200]}


# A pose, a position, a marker on a link, and two wires: one ends at a marker, one on a link.
MIXED = {
    "markers": [MARKERS[0] | {"rows": "pose"}, MARKERS[1], ON_LINK],
    "measurement": {"sigma_deg": 0.01},
    "distance": [
        {"name": "wire", "anchor_mm": [1500, 200, -100], "marker": "B", "sigma_mm": 0.1},
        {"name": "other", "anchor_mm": [-300, 900, 50], "joint": "q4", "position_mm": [20, 0, 60]},
    ],
}


def study_of(
    parameters: dict[str, Any], markers: Sequence[dict[str, Any]] = MARKERS, **keys: object
) -> Study:
    """A study of the small arm under a load."""
    measurement = {"sigma_mm": SIGMA} | keys.pop("measurement", {})
    return Study(
        robot=ROBOT,
        tool=TOOL,
        parameters=parameters,
        measurement=measurement,
        load={"F_N": LOAD},
        marker=list(markers),
        **keys,
    )


def readings(
    study: Study,
    theta: Array,
    visits: int,
    differs: Array,
    loaded: Array,
    sigma_mm: float = 0.0,
    seed: int = 0,
) -> MarkerPositions:
    """What is read of an arm with these parameters in some visits; errors of each reading alike."""
    setting = StudyGeometry.of(study)
    model = setting.model
    rng = np.random.default_rng(seed)
    q = np.deg2rad(np.round(rng.uniform(-100, 100, (visits, 6)), 3))
    wrench = np.zeros((visits, 6))
    wrench[loaded, :3] = LOAD
    shape = (visits, len(model.markers))
    row = np.arange(visits * shape[1]).reshape(shape)
    empty = MarkerPositions(q, wrench, np.zeros((*shape, 3)), row, model.markers, differs=differs)
    torque = loading_of(model.bending(theta), empty, setting.loads)
    seen = model.see(theta, q, torque, derivatives=False)
    size = sigma_mm * 1e-3 * np.where(differs, np.sqrt(2), 1.0)[:, None, None]
    ratios = setting.noise.ratios
    size = size if ratios is None else size * ratios[:, None]
    x = seen.points + size * rng.normal(size=seen.points.shape)
    x = np.where(model.present[:, :3], x, np.nan)
    turns = None
    if setting.full_poses:
        turned = rng.normal(0, np.deg2rad(0.01) * (sigma_mm > 0), seen.points.shape)
        turns = rotation(turned * np.where(differs, np.sqrt(2), 1.0)[:, None, None]) @ seen.turns
    kinds = model.kinds if setting.distances else ()
    return MarkerPositions(q, wrench, x, row, model.markers, turns, differs, kinds)


def sheet(data: MarkerPositions, unloaded: Array | None = None) -> pd.DataFrame:
    """A sheet with a marker a row; differences as such, or beside positions without load (m, 3)."""
    lines = []
    for visit, marker in np.ndindex(data.measured.shape[:2]):
        x = 1e3 * data.measured[visit, marker]
        line = dict(zip(JOINTS, np.rad2deg(data.q[visit]), strict=True))
        line |= dict(zip(LOADS, data.wrench[visit, :3], strict=True))
        line |= {"marker": data.markers[marker], "visit": visit + 1}
        absolute = ["x_mm", "y_mm", "z_mm"]
        rows = data.present[marker].sum()
        if rows == 6:
            names = [f"{'d' * int(data.is_difference[visit])}r{axis}_deg" for axis in "xyz"]
            vector = np.rad2deg(rotation_vectors(data.turns[visit, marker]))
            line |= dict(zip(names, vector, strict=True))
        if rows == 1:
            line |= {"change_mm" if data.is_difference[visit] else "distance_mm": x[0]}
        elif not data.is_difference[visit]:
            line |= dict(zip(absolute, x, strict=True))
        elif unloaded is not None:
            before = 1e3 * unloaded[visit]
            line |= dict(zip(["x0_mm", "y0_mm", "z0_mm"], before, strict=True))
            line |= dict(zip(absolute, x + before, strict=True))
        else:
            line |= dict(zip(["dx_mm", "dy_mm", "dz_mm"], x, strict=True))
        lines.append(line)
    return pd.DataFrame(lines)


def truth_of(study: Study, size: float, seed: int = 5) -> Array:
    """Errors of a drawing of some size, and the compliances of the arm."""
    model = StudyGeometry.of(study).model
    theta = np.random.default_rng(seed).normal(0, size, model.p) * model.scales
    return np.array(
        [
            K[one.of] if one.place == "compliance" else value
            for one, value in zip(model.parameters, theta, strict=True)
        ]
    )
