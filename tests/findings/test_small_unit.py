"""Centimetres and inches are told from millimetres, and from each other."""

from dataclasses import replace

import pytest
from readings import STUDY, measured

from edtk.findings.fitted_data import FittedData
from edtk.findings.units import small_unit


@pytest.mark.parametrize(
    ("factor", "name"), [(1, None), (0.1, "centimetres"), (1 / 25.4, "inches")]
)
def test_unit(factor, name):
    """With and without predicted sizes; a sigma that is too large is none where sizes are known."""
    data = measured()
    fitted = FittedData.of(STUDY, replace(data, deflection=data.deflection * factor))
    assert small_unit(fitted, factor) == name
    assert small_unit(fitted, None) == name
    assert small_unit(fitted, 1.0) is None
