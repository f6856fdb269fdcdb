"""Rows of a sheet that are of another pose or load are named, and sound sheets have none."""

from dataclasses import replace

import numpy as np
import pytest
from readings import STUDY, measured, readings_of

from edtk.findings.causes.faults import FAULTS, cause_of
from edtk.findings.finding import Finding
from edtk.findings.fitted_data import FittedData
from edtk.fit.measurements import Measurements

KINDS = ("unloaded_rows", "other_loads", "shifted_rows")


def found_in(data: Measurements) -> Finding | None:
    """The reading that explains a sheet."""
    found = FittedData.of(STUDY, data).explanation
    return None if found is None else found.finding


def said_of(found: Finding) -> tuple[str, float, tuple[int, ...]]:
    """Name, size and rows of the cause that a program reads, in the words of the finding."""
    cause = cause_of(found)
    assert cause is not None
    assert found.words.startswith(FAULTS[cause.cause].words(cause))
    return cause.cause, cause.size, cause.rows


def under(data: Measurements, rows: list[int], factor: float) -> Measurements:
    """A sheet that says nothing of the loads of some rows."""
    wrench = data.wrench.copy()
    wrench[rows] *= factor
    return replace(readings_of(data.q, wrench), wrench=data.wrench)


@pytest.mark.parametrize("rows", [[1, 4, 5, 9, 12, 16, 21], [*range(10, 24)], [*range(5)]])
def test_rows_without_their_load_are_named(rows: list[int]) -> None:
    """Any of them, those from one on, and those up to one."""
    found = found_in(under(measured(), rows, 0.0))
    assert found is not None
    assert (found.kind, list(found.rows)) == ("unloaded_rows", rows)
    assert "as if it were not loaded there" in found.words
    assert said_of(found) == ("unloaded_rows", 0.0, tuple(rows))


@pytest.mark.parametrize(("rows", "factor"), [(range(16, 24), 0.6), (range(9), 1.4)])
def test_rows_under_another_load_are_named_with_it(rows: range, factor: float) -> None:
    """Those from one on, and those up to one."""
    found = found_in(under(measured(), [*rows], factor))
    assert found is not None
    assert (found.kind, list(found.rows)) == ("other_loads", [*rows])
    assert found.data["factor"] == pytest.approx(factor, rel=0.02)
    assert said_of(found) == ("other_loads", found.data["factor"], tuple(rows))


@pytest.mark.parametrize(("step", "which"), [(1, "before"), (-1, "after")])
def test_readings_of_the_pose_before_or_after_are_named(step: int, which: str) -> None:
    """A reading that was forgotten, or written twice, puts all that follow beside another pose."""
    data = measured(repeats=1)
    moved = data.deflection.copy()
    moved[4:] = np.roll(moved[4:], step, axis=0)
    found = found_in(replace(data, deflection=moved))
    assert found is not None
    assert found.kind == "shifted_rows"
    assert list(found.rows) == ([*range(5, 12)] if step > 0 else [*range(4, 11)])
    assert f"rows {'6 to 12' if step > 0 else '5 to 11'}: the readings look like" in found.words
    assert f"those of the pose {which}" in found.words
    assert said_of(found) == ("shifted_rows", -step, found.rows)


@pytest.mark.parametrize("seed", range(5))
def test_other_misfits_are_none(seed: int) -> None:
    """Springs that differ by row, noise of eight times its size, a drift and an outlier."""
    rng = np.random.default_rng(seed)
    data = measured(seed)
    shape = data.deflection.shape
    drift = 3e-4 * np.linspace(0, 1, len(data))[:, None] * rng.standard_normal(3)
    outlier = np.where(np.arange(len(data)) == 7, 1e-3, 0.0)[:, None]
    misfits = (
        rng.uniform(0.7, 1.5, (len(data), 1)) * data.deflection,
        data.deflection + rng.normal(0, 8 * STUDY.sigma, shape),
        data.deflection + drift,
        data.deflection + outlier,
    )
    for moved in misfits:
        found = found_in(replace(data, deflection=moved))
        assert found is None or found.kind not in KINDS
