"""Names of what an experiment measures."""

import pytest
from arm import arm

from edtk.calibration.template import measured_names

PLATE = {"name": "plate", "position_mm": [0, 0, 100]}
FOREARM = {"name": "forearm", "position_mm": [300, 0, 0], "joint": "q1"}
WIRE = {"name": "wire", "anchor_mm": [3000, 0, 0]}
TURNS = ("rotation x", "rotation y", "rotation z")


@pytest.mark.parametrize(
    ("keys", "names"),
    [
        ({}, ("x", "y", "z")),
        ({"marker": [PLATE | {"rows": "pose"}]}, ("x", "y", "z", *TURNS)),
        ({"distance": [WIRE]}, ("change",)),
        ({"distance": [WIRE, WIRE | {"name": "bar"}]}, ("wire", "bar")),
        (
            {"marker": [PLATE, FOREARM]},
            ("plate x", "plate y", "plate z", "forearm x", "forearm y", "forearm z"),
        ),
        (
            {"marker": [PLATE], "distance": [WIRE]},
            ("plate x", "plate y", "plate z", "wire"),
        ),
    ],
)
def test_names_say_which_instrument(keys, names):
    """One instrument has its coordinates; several have their names before them, each once."""
    sigmas = {"measurement": {"sigma_mm": 0.1, "sigma_deg": 0.01}}
    study = arm(**sigmas, **keys)
    assert measured_names(study.model) == names
    assert len(names) == study.model.row_count
