"""A part of a sheet in another unit than the rest is named, with its rows or its column."""

from dataclasses import replace

import numpy as np
import pytest
from pairs import some_pairs
from readings import STUDY, measured

from edtk.findings.causes.faults import UNITS
from edtk.findings.finding import Finding
from edtk.findings.fitted_data import FittedData
from edtk.fit.measurements import Measurements

UNIT_NAMES = ("metres", "centimetres", "inches", "micrometres")
PARTS = {"late": range(14, 24), "early": range(9), "any": [1, 4, 5, 9, 12, 16, 21]}


def found_in(data: Measurements) -> Finding | None:
    """The reading that explains a sheet."""
    found = FittedData.of(STUDY, data).explanation
    return None if found is None else found.finding


def scaled(data: Measurements, rows: object, factor: float) -> Measurements:
    """The same, of which some rows were written in another unit."""
    moved = data.deflection.copy()
    moved[rows] /= factor
    return replace(data, deflection=moved)


@pytest.mark.parametrize(("unit", "part"), some_pairs(UNIT_NAMES, list(PARTS)))
def test_rows_in_another_unit_are_named(unit: str, part: str) -> None:
    """Those from one on, those up to one, and any."""
    data = measured()
    rows = list(PARTS[part])
    found = found_in(scaled(data, rows, UNITS[unit][0]))
    assert found is not None
    assert (found.kind, found.rows) == ("part_unit", tuple(rows))
    assert f"the displacements look as if they were in {unit}; expected mill" in found.words


def test_a_column_in_another_unit_is_named() -> None:
    """Of all rows; each unit is named of rows above."""
    found = found_in(scaled(measured(), np.s_[:, 2], UNITS["metres"][0]))
    assert found is not None
    assert (found.kind, found.columns) == ("part_unit", ("dz_mm",))


@pytest.mark.parametrize(("unit", "factor"), [("kilonewtons", 1e3), ("kilograms", 9.81)])
def test_loads_of_some_rows_in_another_unit_are_named(unit: str, factor: float) -> None:
    """They are as much smaller than the others."""
    data = measured()
    wrench = data.wrench.copy()
    wrench[10:] /= factor
    found = found_in(replace(data, wrench=wrench))
    assert found is not None
    assert (found.kind, found.rows) == ("part_unit", tuple(range(10, 24)))
    assert f"the forces look as if they were in {unit}; expected newtons" in found.words


def test_angles_of_some_rows_in_radians_are_named() -> None:
    """Others are beyond a turn in radians."""
    data = measured()
    q = data.q.copy()
    q[15:] = np.deg2rad(q[15:])
    found = found_in(replace(data, q=q))
    assert found is not None
    assert (found.kind, found.rows) == ("part_unit", tuple(range(15, 24)))
    assert "the angles look as if they were in radians; expected degrees" in found.words


@pytest.mark.parametrize("seed", range(2))
def test_other_misfits_are_no_unit(seed: int) -> None:
    """Springs that differ from row to row by a third, and noise of eight times its size."""
    rng = np.random.default_rng(seed)
    data = measured(seed)
    softer = rng.uniform(0.7, 1.5, (len(data), 1)) * data.deflection
    noisy = data.deflection + rng.normal(0, 8 * STUDY.sigma, data.deflection.shape)
    for moved in (softer, noisy):
        found = found_in(replace(data, deflection=moved))
        assert found is None or found.kind != "part_unit"
