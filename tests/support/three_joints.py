"""A study of an arm with three joints, over all of whose poses a bound is proved in a second."""

TURNING = {"axis": [0, 1, 0], "limits_deg": [-150, 150], "origin_m": [0.5, 0, 0]}
JOINTS = [
    TURNING | {"name": "q1", "axis": [0, 0, 1], "origin_m": [0, 0, 0.4]},
    TURNING | {"name": "q2", "origin_m": [0, 0, 0]},
    TURNING | {"name": "q3"},
]
THREE = {
    "title": "Three joints",
    "robot": {
        "name": "3R",
        "source": "made up",
        "joints": JOINTS,
        "tool": {"position_m": [0, 0, 0]},
    },
    "tool": {"position_mm": [300, 0, 0]},
    "load": {"F_N": [20, 0, -50]},
    "measurement": {"sigma_mm": 0.03},
    "joints": {"unknown": ["q1", "q2", "q3"]},
    "workspace": {"height_min_mm": 100},
    "candidates": 300,
}
