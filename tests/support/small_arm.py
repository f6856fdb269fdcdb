"""The keys of a small arm of six joints, for studies of geometry."""

from typing import Any

ORIGINS = [(0, 0, 0.29), (0, 0, 0), (0, 0, 0.27), (0, 0, 0.07), (0.302, 0, 0), (0, 0, 0)]
AXES = {"x": [1, 0, 0], "y": [0, 1, 0], "z": [0, 0, 1]}
ROBOT: dict[str, Any] = {
    "name": "a small arm",
    "source": "tests",
    "joints": [
        {"name": f"q{i}", "origin_m": list(o), "axis": AXES[a], "limits_deg": [-130, 130]}
        for i, (o, a) in enumerate(zip(ORIGINS, "zyyxyx", strict=True), start=1)
    ],
}
