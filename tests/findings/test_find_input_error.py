"""What is certainly wrong in measurements is found, and nothing where nothing is."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from readings import PLAN, STUDY, measured, readings_of

from edtk.design.plan import Plan
from edtk.findings.finding import Severity
from edtk.findings.fitted_data import FittedData, HowFitted
from edtk.findings.readings import OTHER
from edtk.findings.springs import find_input_error, spring_findings
from edtk.fit.equilibrium import equilibrium_deflection
from edtk.fit.measurements import Measurements, simulate
from edtk.measure.elastostatic_model import ElastostaticModel
from tests.support.visits import TRACKER, visited

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]


def found(data, plan=None, **options):
    return in_words(find_input_error(FittedData.of(STUDY, data, HowFitted(plan=plan, **options))))


def in_words(error):
    return None if error is None else error.words


def exchanged(x, i, j):
    order = np.arange(x.shape[1])
    order[[i, j]] = j, i
    return x[:, order]


def test_nothing_wrong():
    """Clean measurements are never refused, nor those with ten times the stated noise."""
    for seed in range(5):
        data = measured(seed)
        assert found(data, PLAN) is None
    clean = data.regressor(STUDY.model) @ STUDY.compliances
    assert found(replace(data, deflection=clean + 10 * (data.deflection - clean)), PLAN) is None


@pytest.mark.parametrize(
    ("i", "j", "options"),
    [
        (0, 2, {}),
        (0, 1, {"sigma_unknown": True}),
        (1, 2, {"robust": True}),
    ],
)
def test_swapped_displacements(i, j, options):
    """Two displacement columns that were exchanged are named, whatever the fit."""
    data = measured()
    line = found(replace(data, deflection=exchanged(data.deflection, i, j)), **options)
    assert line.startswith(f"columns d{'xyz'[i]}_mm and d{'xyz'[j]}_mm (or the positions")
    assert "look swapped; this explains 99.9" in line


def test_swapped_joints():
    """Two joint columns that were exchanged are named, of different links too."""
    data = measured()
    line = found(replace(data, q=exchanged(data.q, 1, 5)))
    assert line.startswith("columns q2_deg and q6_deg look swapped")


def test_swapped_markers():
    """Two of three markers that are exchanged in all rows are named by their places."""
    data = visited()
    moved = data.regressor(STUDY.model) @ STUDY.compliances
    noise = np.random.default_rng(0).normal(0, TRACKER, moved.shape)
    right = replace(data, deflection=moved + noise)
    assert found(right) is None
    order = np.arange(len(data)).reshape(-1, 3)[:, [1, 0, 2]].ravel()
    line = found(replace(right, deflection=right.deflection[order]))
    assert line.startswith("the markers (0, 0, 0) mm and (300, 0, 100) mm look swapped in all rows")


def test_a_joint_of_the_opposite_sign():
    """A joint that was counted the other way round is named, and so is what that explains."""
    data = measured()
    line = found(replace(data, q=data.q * [1, 1, 1, -1, 1, 1]))
    assert line.startswith("column q4_deg looks measured with the opposite sign; this exp")
    assert "lains 99.9" in line
    assert "(leaves 0.94 sigma instead of " in line


def test_a_force_of_the_opposite_sign():
    """One force of several that has the opposite sign is named."""
    wrench = np.tile([500.0, 800, -2500, 0, 0, 0], (12, 1))
    data = readings_of(PLAN.q, wrench)
    assert found(data) is None
    line = found(replace(data, wrench=wrench * [1, -1, 1, 1, 1, 1]))
    assert line.startswith("column Fy_N looks measured with the opposite sign; ")


def test_a_joint_with_another_zero():
    """A joint that is counted from another zero is named, with the angle that it lacks."""
    data = measured()
    line = found(replace(data, q=data.q - np.deg2rad([0, 90, 0, 0, 0, 0])))
    assert line.startswith("column q2_deg looks 90 degrees too small; ")


def test_a_frame_turned():
    """A turned frame is told from exchanged positions, though all compliances are negative too.

    One that is turned about z is below.
    """
    data = measured()
    line = found(replace(data, deflection=data.deflection[:, (1, 2, 0)]))
    assert line.startswith("the measuring frame looks turned by 120 degrees about a diagonal: exp")


def test_readings_that_are_equally_good_are_all_named():
    """A mirrored arm moves as in a mirrored frame: no measurement tells which it is."""
    data = measured()
    line = found(replace(data, deflection=data.deflection * [1, -1, 1]))
    assert line.startswith("columns q4_deg, q6_deg look reversed; or the measuring frame looks")
    assert "frame looks left-handed: expected (dx_mm, -dy_mm, dz_mm)" in line
    assert "each explains 99.9" in line


def test_of_readings_that_are_equally_good_the_simpler_is_named():
    """Where one joint's sign explains the residuals, that of another joint besides is no answer."""
    rows = [0, 3, 6, 9]
    data = readings_of(PLAN.q[rows], PLAN.wrench[rows])
    fitted = FittedData.of(STUDY, replace(data, q=data.q * [1, 1, 1, 1, -1, 1]))
    signs = [
        refit.reading.finding.columns
        for refit in fitted.explanation.refits
        if refit.reading.finding.kind == "opposite_sign"
    ]
    assert signs == [("q5_deg",)]


def test_no_reading_that_does_not_fit():
    """Where no reading explains the residuals nothing is refused, and no reading is named."""
    rng = np.random.default_rng(3)
    data = measured(repeats=1)
    for factor in (0.05, 1.0):
        q = data.q + factor * rng.uniform(-1, 1, data.q.shape)
        fitted = FittedData.of(STUDY, replace(data, q=q))
        assert fitted.fit.scale > 4
        assert find_input_error(fitted) is None
        assert fitted.explanation.finding is None


def test_outliers_hide_no_reading():
    """A reading explains the measurements though a few gross errors are among them, and says so."""
    data = measured()
    moved = data.deflection.copy()
    moved[[3, 17], 2] += [3e-3, -2e-3]
    assert found(replace(data, deflection=moved)) is None
    line = found(replace(data, deflection=moved, q=data.q * [1, -1, 1, 1, 1, 1]))
    assert line.startswith("column q2_deg looks measured with the opposite sign; ")
    assert line.endswith(", without 2 outliers)")


def test_a_reading_that_leaves_more_than_noise():
    """Exchanged columns whose sigma is too small are named as an alarm, and not refused."""
    data = measured()
    clean = data.regressor(STUDY.model) @ STUDY.compliances
    moved = clean + 2 * (data.deflection - clean)
    fitted = FittedData.of(STUDY, replace(data, deflection=exchanged(moved, 0, 2)))
    assert find_input_error(fitted) is None
    alarm = spring_findings(fitted)[0]
    assert alarm.severity is Severity.ALARM
    assert alarm.words.startswith("columns dx_mm and dz_mm (or the positions in x and z) look swap")


def test_the_equilibrium_of_a_heavy_load_hides_no_reading():
    """What the linear model leaves is no argument against a reading that explains the rest."""
    data = measured()
    k = np.zeros(6)
    k[STUDY.model.joints] = STUDY.compliances
    noise = 0.1 * (data.deflection - data.regressor(STUDY.model) @ STUDY.compliances)
    moved = equilibrium_deflection(STUDY.model, data.q, data.wrench, k) + noise
    data = replace(data, deflection=moved, sigma=0.1 * data.sigma)
    assert FittedData.of(STUDY, data, HowFitted(linear=True)).fit.p_value < 1e-3
    assert found(data) is None
    assert "q4_deg and q6_deg look swapped" in found(replace(data, q=exchanged(data.q, 3, 5)))


def test_swapped_forces():
    """The load in another column than its own is named."""
    data = measured()
    assert "Fx_N and Fz_N look swapped" in found(replace(data, wrench=exchanged(data.wrench, 0, 2)))


def test_turned_frame():
    """Displacements in a frame turned about z are recognised, with the axes to expect."""
    data = measured()
    x, y, z = data.deflection.T
    line = found(replace(data, deflection=np.stack([y, -x, z], axis=-1)))
    assert line.startswith(
        "the measuring frame looks turned by 90 degrees about z: expected (-dy_mm, dx_mm, dz_mm)"
    )


def _poses():
    """The study with rotations measured too, and readings of the plan."""
    model = ElastostaticModel(STUDY.robot, STUDY.model.joints, "pose")
    sigma = np.tile([3e-5] * 3 + [5e-5] * 3, (12, 1))
    moved = simulate(
        model.regressor(PLAN.q, PLAN.wrench), STUDY.compliances, sigma, np.random.default_rng(1)
    )[0]
    return model, Measurements(PLAN.q, PLAN.wrench, moved, sigma, np.zeros((12, 3)))


def _judged(model, data):
    study = STUDY.replace(measurement={"sigma_mm": 0.03, "sigma_deg": 0.01, "rows": "pose"})
    assert study.model.joints == model.joints
    return in_words(find_input_error(FittedData.of(study, data)))


def test_swapped_rotations():
    """Two rotation columns that were exchanged are named."""
    model, data = _poses()
    assert _judged(model, data) is None
    line = _judged(model, replace(data, deflection=exchanged(data.deflection, 3, 5)))
    assert line.startswith("columns drx_deg and drz_deg look swapped")


def test_rotations_of_the_opposite_sign():
    """Rotations that were measured the other way round are named."""
    model, data = _poses()
    line = _judged(model, replace(data, deflection=data.deflection * np.repeat([1, -1], 3)))
    assert line.startswith("columns drx_deg, dry_deg, drz_deg look measured with the opp")


def test_turned_frame_of_rotations():
    """Displacements and rotations in a frame turned by 90 degrees are recognised."""
    model, data = _poses()
    x, y, z, rx, ry, rz = data.deflection.T
    line = _judged(model, replace(data, deflection=np.stack([y, -x, z, ry, -rx, rz], axis=-1)))
    assert "turned by 90 degrees about z: expected (-dy_mm, dx_mm, dz_mm)" in line


def test_copied_rotations():
    """A row with copied rotations is found, however coarse its positions are."""
    model, data = _poses()
    data = data[np.repeat(np.arange(12), 2)]
    data.deflection[:, :3] = data.deflection[:, :3].round(4)
    data.deflection[:, 3:] += 5e-5 * np.random.default_rng(9).standard_normal((24, 3))
    assert _judged(model, data) is None
    data.deflection[7] = data.deflection[6]
    assert _judged(model, data).startswith("row 8 is row 7 to the last digit")


def test_markers():
    """Marker columns that were exchanged, or are in metres, are named."""
    data = measured()
    marker = np.random.default_rng(5).uniform(-0.3, 0.3, (len(data), 3))
    data = replace(data, marker=marker)
    moved = simulate(
        data.regressor(STUDY.model), STUDY.compliances, STUDY.sigma, np.random.default_rng(6)
    )[0]
    data = replace(data, deflection=moved)
    assert found(data) is None
    assert "marker_x_mm and marker_y_mm look swapped" in found(
        replace(data, marker=exchanged(marker, 0, 1))
    )
    assert "marker_z_mm look as if they were in metres" in found(replace(data, marker=marker / 1e3))


def test_many_rows_of_few_poses(monkeypatch):
    """Noise four times as large in more rows than causes are looked for in, the poses in turn, is
    not blamed on columns.
    """
    monkeypatch.setattr("edtk.findings.fitted_data.MOST_SEARCHED", 200)
    monkeypatch.setattr("edtk.findings.readings.OTHER", replace(OTHER, enough_rows=200))
    data = measured(repeats=1)
    data = data[np.tile(np.arange(12), 20)]
    clean = data.regressor(STUDY.model) @ STUDY.compliances
    noise = 4 * STUDY.sigma * np.random.default_rng(7).standard_normal(clean.shape)
    assert found(replace(data, deflection=clean + noise)) is None


def test_wrong_sign():
    """Displacements of the wrong sign are refused."""
    data = measured()
    assert "loaded and unloaded positions look swapped" in found(
        replace(data, deflection=-data.deflection)
    )


def test_copied_rows():
    """Copied rows are noticed; coarse readings that agree by chance are not."""
    data = measured()
    data.deflection[7] = data.deflection[6]
    assert found(data).startswith("row 8 is row 7 to the last digit, in all columns; ")
    data.deflection[5] = data.deflection[4]
    assert found(data).startswith("row 6 is row 5 to the last digit, in all columns, and 1 more")
    coarse = measured(repeats=30, digits=1)
    assert len(np.unique(np.hstack([coarse.q, coarse.deflection]), axis=0)) < len(coarse)
    assert found(coarse) is None


def test_poses_that_are_not_planned():
    """The first pose that is not planned is named, with the column and how far it is off."""
    data = measured(repeats=1)
    assert found(data, PLAN) is None
    other = data.q.copy()
    other[[2, 5]] += np.deg2rad([0, 0.3, 0, -1, 0, 0])
    line = found(data, Plan(other, data.wrench, np.ones(12, dtype=int)))
    assert line.startswith("row 3, column q4_deg: the pose is not in the plan; the nearest ")
    assert "away; expected 0.1 at most (plan_resolution_deg" in line
    assert "planned one, row 3, is 1 deg" in line
    assert line.endswith("; 1 more rows are not either")
