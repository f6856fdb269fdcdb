"""What a fit's own numbers say: bands that hold too few of the poses that were left out."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from geometry_sheets import OFFSETS, PLACE, STUDY, Array, by_pose

import edtk
from edtk.findings.finding import Severity
from edtk.findings.geometric_fit import geometric_findings
from edtk.fit.fit_geometry import fit_geometry
from edtk.fit.fitted_geometry import GeometricFit
from edtk.fit.marker_positions import MarkerPositions
from edtk.study.study_geometry import StudyGeometry


def day(seed: int, slack: float) -> tuple[Array, Array]:
    """Joint angles [rad] and positions [m] of an arm whose q2 and q3 rest elsewhere at times.

    Args:
        seed: Of everything.
        slack: By which they are off in a quarter of the poses [rad].
    """
    rng = np.random.default_rng(seed)
    model = replace(StudyGeometry.of(STUDY).model, offsets=OFFSETS, start=PLACE)
    theta = rng.normal(0, 0.5, model.p) * model.scales
    q = rng.uniform(-1.7, 1.7, (40, 6))
    there = q + rng.normal(0, 1e-4, q.shape)
    there[:, 1:3] += slack * (rng.random((40, 1)) < 0.25)
    x = model.see(theta, there, derivatives=False).points
    return q, x + rng.normal(0, 5e-5, x.shape)


@cache
def sound_fit(seed: int) -> GeometricFit:
    """The fit of a day without slack."""
    q, x = day(seed, 0.0)
    row = np.arange(len(q))[:, None] * np.ones(3, dtype=int)
    data = MarkerPositions(q, np.zeros((len(q), 6)), x, row, tuple("ABC"))
    setting = StudyGeometry.of(STUDY)
    return fit_geometry(setting.model, data, setting.noise)


def test_bands_that_hold_too_few_enter_the_verdict(tmp_path: Path) -> None:
    """A joint with slack leaves millimetres in some poses: no one size explains all of them."""
    q, x = day(0, 4e-3)
    found = edtk.identify(STUDY, by_pose(tmp_path / "day.csv", np.rad2deg(q), 1e3 * x))
    said = [doubt.words for doubt in found.findings if doubt.kind == "outside"]
    assert found.fit.share_inside < 0.91
    assert len(said) == 1
    assert "of the coordinates left out are inside their 95 % bands" in said[0]
    assert found.verdict == "usable"


def test_sound_days_have_no_doubt() -> None:
    """Nor where the size of the errors is fitted, as it is here."""
    fit = sound_fit(0)
    assert fit.fitted.noise.model_fit is not None
    assert not [
        one for one in geometric_findings(fit, StudyGeometry.of(STUDY)) if one.kind == "outside"
    ]


def test_bands_without_most_coordinates_are_an_alarm() -> None:
    """What is told of accuracy is worth nothing then."""
    fit = sound_fit(0)
    narrow = replace(fit, left_out_half=0.4 * fit.left_out_half)
    doubts = [
        one for one in geometric_findings(narrow, StudyGeometry.of(STUDY)) if one.kind == "outside"
    ]
    assert [one.severity for one in doubts] == [Severity.ALARM]


def kinds_of(fit: GeometricFit) -> dict[str, Severity]:
    """Kinds of doubts of a fit, with their severities."""
    return {one.kind: one.severity for one in geometric_findings(fit, StudyGeometry.of(STUDY))}


def test_a_fit_that_is_worse_than_base_and_tool_alone_is_bad() -> None:
    """So few poses of a robot whose gears are not round predict no other pose."""
    rng = np.random.default_rng(1)
    model = replace(StudyGeometry.of(STUDY).model, offsets=OFFSETS, start=PLACE)
    q = rng.uniform(-1.7, 1.7, (12, 6))
    x = model.see(np.zeros(model.p), q + rng.normal(0, 2e-3, q.shape), derivatives=False).points
    row = np.arange(len(q))[:, None] * np.ones(3, dtype=int)
    data = MarkerPositions(q, np.zeros((len(q), 6)), x, row, tuple("ABC"))
    fit = fit_geometry(model, data, StudyGeometry.of(STUDY).noise)
    assert fit.loo_rms > fit.placed
    assert kinds_of(fit)["worse_than_placed"] == Severity.ALARM
    # What is compared is what is said.
    for times in (20, 2):
        few = replace(fit, structural=99, placed=fit.loo_rms / 30, placed_apart=fit.loo_rms / times)
        said = {one.kind: one for one in geometric_findings(few, StudyGeometry.of(STUDY))}
        assert said["worse_than_placed"].data["placed"] == few.placed_apart
        assert said["few_poses"].data.get("placed") == (few.placed_apart if times > 10 else None)
    assert "worse_than_placed" not in kinds_of(sound_fit(0))


@pytest.mark.parametrize(("step", "severity"), [(1.0, Severity.ALARM), (0.1, Severity.WARNING)])
def test_rounded_angles_are_named_by_their_step(
    tmp_path: Path, step: float, severity: Severity
) -> None:
    """Whole degrees leave 5 mrad a joint; the same commands without rounding leave nothing."""
    q, _ = day(0, 0.0)
    coarse = np.round(np.rad2deg(q) / step) * step
    model = replace(StudyGeometry.of(STUDY).model, offsets=OFFSETS, start=PLACE)
    for there, named in ((q, True), (np.deg2rad(coarse), False)):
        x = model.see(np.zeros(model.p), there, derivatives=False).points
        x = x + np.random.default_rng(0).normal(0, 2e-5, x.shape)
        found = edtk.identify(STUDY, by_pose(tmp_path / "day.csv", coarse, 1e3 * x))
        said = [one for one in found.findings if one.kind == "rounded"]
        assert [one.severity for one in said] == [severity] * named
        assert all(f"multiples of {step:g} deg" in one.words for one in said)
        # What rounding leaves is not the model's besides.
        assert not any("No cause in the list" in one.words for one in found.findings)


@pytest.mark.parametrize("rows", [(4, 17), (10, 11)])
def test_two_wrong_poses_neither_hide_each_other_nor_look_like_a_moved_frame(
    tmp_path: Path, rows: tuple[int, int]
) -> None:
    """Two poses that are off by ten times what a robot errs by are named, and nothing else is."""
    q, x = day(0, 0.0)
    rng = np.random.default_rng(1)
    x = x + rng.normal(0, 7e-5, (len(x), 1, 3))
    for row in rows:
        off = rng.normal(0, 1, 3)
        x[row] += 1e-3 * off / np.linalg.norm(off)
    found = edtk.identify(STUDY, by_pose(tmp_path / "day.csv", np.rad2deg(q), 1e3 * x))
    harmful = [one for one in found.findings if one.severity > Severity.NOTE]
    assert [(one.kind, one.rows) for one in harmful] == [("outliers", rows)]
