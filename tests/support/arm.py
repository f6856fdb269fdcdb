"""A plane arm of two joints: the smallest study, whose relaxations take a tenth of a second."""

from typing import Any

from edtk.study.study import Study

ROBOT: dict[str, Any] = {
    "name": "arm",
    "source": "made up",
    "joints": [
        {"name": "q1", "origin_m": [0, 0, 1.0], "axis": [0, 1, 0], "limits_deg": [-150, 150]},
        {"name": "q2", "origin_m": [0.7, 0, 0], "axis": [0, 1, 0], "limits_deg": [-120, 120]},
    ],
}
KEYS: dict[str, Any] = {
    "title": "Arm",
    "robot": ROBOT,
    "tool": {"position_mm": [500, 0, 0]},
    "load": {"F_N": [0, 0, -100]},
    "measurement": {"sigma_mm": 0.1},
    "joints": {"unknown": ["q1", "q2"]},
    "candidates": 100,
    "starts": 1,
    "sizes": [2],
}


def arm(**keys: Any) -> Study:
    """The study, some of whose keys have other values; None for a key that is not given."""
    return Study(**(KEYS | keys))
