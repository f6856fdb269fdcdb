"""Noise of studies: a tracker, stated or of unknown size, in all that is asked of geometry."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from geometry_sheets import NAMES, OFFSETS, PLACE, STUDY, run
from loaded_arm import STUDY as LOADED
from small_arm import ROBOT

import edtk
from edtk.calibration.calibrate import calibrate
from edtk.calibration.result_file import geometry_of_dict
from edtk.fit.distributions import student_quantile
from edtk.fit.fit_geometry import fit_geometry
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.pose_rows import PoseRows
from edtk.measure.measured_model import MeasuredModel
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry
from edtk.system.typing import Array
from tests.support.readings import STUDY as SPRINGS
from tests.support.visits import sheet, visited

# Its readings are three times as bad at the far side of the arm as at the near one.
NEAR = {"tracker_position_mm": [1400, 600, 600], "along": [5, 30], "across": [5, 150]}
SMALL = Study(
    robot=ROBOT,
    measurement={},
    parameters={"compliance": [], "geometry": ["zeros"], "base": True, "tool": True},
    marker=[{"name": "A", "position_mm": (1e3 * OFFSETS[0]).tolist()}],
    noise=NEAR | {"given_as": "sigma"},
)


def true_day(poses: int, seed: int) -> tuple[MeasuredModel, Array, MarkerPositions]:
    """A model in its place, its parameters, and positions that the stated tracker has read."""
    rng = np.random.default_rng(seed)
    setting = StudyGeometry.of(SMALL)
    model = replace(setting.model, start=PLACE)
    theta = np.random.default_rng(5).normal(0, 0.5, model.p) * model.scales
    q = np.deg2rad(np.round(rng.uniform(-100, 100, (poses, 6)), 3))
    seen = model.see(theta, q, derivatives=False)
    L = np.linalg.cholesky(setting.noise.seen_from(PLACE).of_instrument(seen.places, 3))
    errors = 1e-3 * (L @ rng.standard_normal((poses, 3, 1))).reshape(poses, 1, 3)
    row = np.arange(poses)[:, None]
    return model, theta, MarkerPositions(q, np.zeros((poses, 6)), seen.points + errors, row, ("A",))


def sheet_of(data: MarkerPositions, path: Path) -> Path:
    """The positions as a file."""
    lines = [",".join([*NAMES, "Ax_mm", "Ay_mm", "Az_mm"])]
    for q, x in zip(np.rad2deg(data.q), 1e3 * data.measured[:, 0], strict=True):
        lines.append(",".join([*(f"{a:.3f}" for a in q), *(f"{a:.6f}" for a in x)]))
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def test_a_tracker_that_errs_alike_everywhere_is_white(tmp_path: Path) -> None:
    """With 20 um along and across the beam, at any range, all is as with sigma_mm = 0.02."""
    alike = NEAR | {"along": [20, 0], "across": [20, 0], "given_as": "sigma"}
    sheet = sheet_of(true_day(25, 0)[2], tmp_path / "day.csv")
    plan = sheet.read_text().splitlines()
    poses = tmp_path / "plan.csv"
    poses.write_text("\n".join(",".join(line.split(",")[:6]) for line in plan), encoding="utf-8")
    found = []
    for keys in ({"noise": alike}, {"measurement": {"sigma_mm": 0.02}, "noise": None}):
        study = SMALL.replace(**keys)
        fit = edtk.identify(study, sheet).fit
        found.append([fit.fitted.values, fit.fitted.covariance, fit.left_out_half])
        found[-1].append(edtk.evaluate(study, poses).covariance)
    for tracked, white in zip(*found, strict=True):
        np.testing.assert_allclose(tracked, white, rtol=1e-6, atol=1e-9)


def test_fits_err_as_a_tracker_does() -> None:
    """Poses left out are off by their covariance: chi-square a coordinate is one, of 5 days."""
    stated = StudyGeometry.of(SMALL)
    chi = []
    for seed in range(5):
        data = true_day(40, seed)[2]
        fit = fit_geometry(stated.model, data, stated.noise)
        chi.append(fit.surprise.mean() / 3)
    # Sums of 120 squares vary by the root of two over their number.
    assert np.mean(chi) == pytest.approx(1, abs=3 * np.sqrt(2 / (120 * 5)))


@pytest.mark.cell("`[noise]` of a tracker", "parameters")
def test_bands_follow_the_range(tmp_path: Path) -> None:
    """A result keeps its tracker in the frame of the sheet: bands are ``J C J' + T`` of a pose."""
    study = tmp_path / "study.toml"
    SMALL.to_toml(study)
    sheet = sheet_of(true_day(40, 1)[2], tmp_path / "day.csv")
    result = tmp_path / "result.json"
    code, out, err = run("identify", study, sheet, "--json")
    assert (code, err) == (0, "")
    result.write_text(out, encoding="utf-8")
    tracker = json.loads(out)["geometry"]["noise"]["tracker"]
    placed = PLACE[:3, :3] @ (np.array(NEAR["tracker_position_mm"]) / 1e3) + PLACE[:3, 3]
    np.testing.assert_allclose(tracker["position_m"], placed, atol=2e-2)
    fitted = edtk.identify(SMALL, sheet).fit.fitted
    q = np.deg2rad(np.random.default_rng(2).uniform(-100, 100, (6, 6)))
    seen = fitted.model.see(fitted.theta, q)
    assert seen.jacobian is not None
    J = 1e3 * seen.jacobian.reshape(18, -1) * fitted.model.scales
    beam = seen.points[:, 0] - np.array(tracker["position_m"])
    r = np.linalg.norm(beam, axis=1)
    u = beam / r[:, None]
    along, across = (5e-3 + 1e-3 * b * r for b in (30, 150))  # [mm]
    T = across[:, None] ** 2 * (1 - u**2) + along[:, None] ** 2 * u**2
    variance = np.einsum("rp,pq,rq->r", J, fitted.covariance, J).reshape(6, 3) + T
    poses = tmp_path / "poses.csv"
    np.savetxt(poses, np.rad2deg(q), delimiter=",", header=",".join(NAMES), comments="")
    predicted = edtk.predict(SMALL, result, poses)
    assert fitted.noise.model_fit is None
    half = student_quantile(0.975, np.inf) * np.sqrt(variance)
    np.testing.assert_allclose(1e3 * predicted.half, half, rtol=1e-5)


def test_a_plan_with_a_tracker_has_a_certificate_that_holds(tmp_path: Path) -> None:
    """Value, bound and efficiency are those of a second implementation, which has the tracker."""
    tracker = {"tracker_position_mm": [2500, 800, 900], "along": [50, 20], "across": [50, 200]}
    study = LOADED.replace(noise=tracker, measurement={})
    path = tmp_path / "certificate.json"
    plan = edtk.plan(study, size=4, seed=1, certificate=path)
    checked = edtk.verify(path, study)
    assert checked.valid
    near, far = (
        edtk.evaluate(LOADED.replace(noise=tracker | {"tracker_position_mm": place}), plan.plan)
        for place in ([2500, 800, 900], [6500, 800, 900])
    )
    assert far.rho0 > 1.5 * near.rho0


def test_a_study_without_any_noise_of_positions_is_refused() -> None:
    """Either sigma_mm or a tracker says how well positions are read."""
    with pytest.raises(edtk.UserError, match=r"sigma_mm: expected.* or a tracker in \[noise\]"):
        STUDY.replace(measurement={})


@pytest.mark.cell("`identify --sigma-unknown`", "parameters")
def test_noise_of_unknown_size_does_not_depend_on_what_is_stated(tmp_path: Path) -> None:
    """White noise comes out as squares over degrees of freedom, with bands of Student's t."""
    sheet = sheet_of(true_day(30, 3)[2], tmp_path / "day.csv")
    found = []
    for sigma in (0.01, 0.5):
        study = SMALL.replace(noise=None, measurement={"sigma_mm": sigma})
        fit = edtk.identify(study, sheet, sigma_unknown=True).fit
        rows = PoseRows.of(fit.fitted.model, fit.fitted.theta, fit.data.means, None)
        dof = rows.residual.size - fit.rank
        noise = fit.fitted.noise
        assert noise.reading**2 == pytest.approx((rows.residual**2).sum() / dof, rel=1e-6)
        np.testing.assert_allclose(fit.fitted.dof(rows.motion, rows.places), dof, rtol=1e-6)
        found.append([fit.fitted.values, fit.fitted.std, fit.left_out_half])
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-8)


def test_a_tracker_of_unknown_size_keeps_its_shape(tmp_path: Path) -> None:
    """A data sheet that is four times too good is found out; the result keeps what was found."""
    good = {key: (np.array(NEAR[key]) / 4).tolist() for key in ("along", "across")}
    study = SMALL.replace(noise=NEAR | good | {"given_as": "sigma"})
    ratios = []
    for seed in range(2):
        sheet = sheet_of(true_day(40, seed)[2], tmp_path / "day.csv")
        found = edtk.identify(study, sheet, sigma_unknown=True)
        tracker = found.fit.fitted.noise.tracker
        assert tracker is not None
        assert tracker.across[1] / tracker.across[0] == pytest.approx(30)
        ratios.append((tracker.across[1] / 150e-6) ** 2)
    # A mean of squares over 2 * 107 degrees of freedom.
    assert np.mean(ratios) == pytest.approx(1, abs=3 * np.sqrt(2 / 214))
    again, _ = geometry_of_dict(found.to_dict()["geometry"], StudyGeometry.of(study))
    poses = np.zeros((1, 6))
    np.testing.assert_allclose(again.predict(poses).half, found.fit.fitted.predict(poses).half)


def test_few_coordinates_do_not_tell_the_noise(tmp_path: Path) -> None:
    """Two coordinates more than parameters leave a variance of two degrees of freedom."""
    study = tmp_path / "study.toml"
    SMALL.to_toml(study)
    sheet = sheet_of(true_day(5, 1)[2], tmp_path / "few.csv")
    code, _, err = run("identify", study, sheet, "--sigma-unknown")
    assert code == 2
    assert "2 coordinates more than the 13 parameters do not tell the size of the noise" in err


JOINTS = 2e-5  # [rad]
MODEL = 3e-5  # [m]


@pytest.fixture
def springs(tmp_path: Path) -> Path:
    """Displacements of three markers in three visits of eight poses, with joints that err."""
    path = tmp_path / "springs.csv"
    sheet(path, visited(poses=8, visits=3), joints=JOINTS, discrepancy=MODEL, seed=1)
    return path


def test_a_sheet_tells_what_a_study_asks_of_it(springs: Path) -> None:
    """Joints and discrepancy come out as they are, whatever is stated for plans."""
    both = {"estimated": ["joints", "discrepancy"]}
    guess = {"repeatability_deg": 0.01, "discrepancy_mm": 0.5}
    plain, asked, guessed = (
        calibrate(SPRINGS.replace(noise=noise), springs) for noise in (None, both, both | guess)
    )
    for found in (asked, guessed):
        assert found.verdict == "good"
        assert found.fitted.common_noise
        assert found.noise is not None
        truth = np.array([np.rad2deg(JOINTS), MODEL])
        size = np.array([found.noise.joints, found.noise.discrepancy])
        assert (np.abs(size - truth) < 2.5 * found.noise.std[1:]).all()
    # Where the sheet shows it anyway, the numbers are those; but nothing surprises.
    np.testing.assert_allclose(asked.fit.std, plain.fit.std, rtol=1e-12)
    assert plain.verdict == "usable"
    np.testing.assert_allclose(guessed.fit.std, asked.fit.std, rtol=0.05)


def test_what_is_not_asked_of_a_sheet_is_as_stated(springs: Path) -> None:
    """The discrepancy is estimated beside joints of the stated size, however wrong that is."""
    noise = {"repeatability_deg": 0.002, "estimated": ["discrepancy"]}
    found = calibrate(SPRINGS.replace(noise=noise), springs).noise
    assert found is not None
    assert found.joints == pytest.approx(0.002)
    assert np.isnan(found.std[1])
    assert found.std[2] > 0


def test_a_sheet_of_single_readings_tells_no_joints(tmp_path: Path) -> None:
    """One marker, visited once: the stated size counts, and a finding says so."""
    path = tmp_path / "single.csv"
    sheet(path, visited(poses=8, visits=1, markers=1), joints=JOINTS, seed=1)
    stated = {"repeatability_deg": float(np.rad2deg(JOINTS))}
    asked, plain = (
        calibrate(SPRINGS.replace(noise=stated | more), path)
        for more in ({"estimated": ["joints"]}, {})
    )
    assert "noise_untold" in [one.kind for one in asked.findings]
    assert "noise_untold" not in [one.kind for one in plain.findings]
    np.testing.assert_array_equal(asked.fit.std, plain.fit.std)
