"""Markers that move together, as joints do not return exactly: found, sized, and accounted for."""

from dataclasses import replace

import numpy as np
import pytest

from edtk.calibration.calibrate import calibrate
from edtk.findings.finding import Severity
from edtk.findings.fitted_data import FittedData, HowFitted
from edtk.fit.measurements import joint_motion, simulate
from edtk.fit.noise import visit_covariance
from edtk.report.spring_report import noise_parts
from edtk.report.views.calibration import spring_calibration_text as in_text
from edtk.study.study import load_study
from tests.support.readings import STUDY
from tests.support.visits import sheet, visited

pytestmark = pytest.mark.slow

JOINTS = 2e-5  # [rad], which moves markers by 50 um
DEGREES = np.rad2deg(JOINTS)


@pytest.fixture
def fitted(tmp_path):
    def fit(data, drop=(), **errors):
        path = tmp_path / "sheet.csv"
        sheet(path, data, **errors).drop(columns=list(drop)).to_csv(path, index=False)
        return calibrate(STUDY, path)

    return fit


def kinds(found):
    return [one.kind for one in found.findings if one.severity > Severity.NOTE]


def test_good_data_of_three_markers(fitted):
    """Tracker noise alone is good, and its parts are told as such."""
    found = fitted(visited(poses=8, visits=2))
    assert found.verdict == "good"
    assert not found.fitted.common_noise
    assert found.noise.tracker == pytest.approx(1.0, abs=0.2)
    assert found.noise.joints < 0.2 * DEGREES
    assert "noise by visits and markers: tracker" in in_text(found)


@pytest.mark.cell("the same joints, estimated", "springs")
@pytest.mark.parametrize("drop", [(), ("visit",)], ids=["visits", "by order"])
def test_joints_that_do_not_return(fitted, drop):
    """Fitted with white noise, the common motion is flagged, with the number for the study."""
    found = fitted(visited(poses=8, visits=3), drop, joints=JOINTS)
    assert kinds(found) == ["moving_joints"]
    text = found.findings[0].words
    assert "all markers of a visit move together by 0.0" in text
    assert "repeatability_deg = 0.0011" in text or "repeatability_deg = 0.0012" in text
    assert found.noise.joints == pytest.approx(DEGREES, rel=0.2)
    assert found.noise.tracker == pytest.approx(1.0, rel=0.15)
    assert found.causes == ()
    assert "Measurements of a visit are off together" in noise_parts(found)[0]
    truth = np.abs(found.fit.unbounded - STUDY.compliances) / found.fit.std
    assert truth.max() < 3.5


def test_one_visit_of_each_pose(fitted):
    """Without a second visit the model may be to blame as well, which the sentence says."""
    found = fitted(visited(poses=8, visits=1), joints=JOINTS)
    assert kinds(found) == ["moving_joints"]
    assert "or the model does not fit" in found.findings[0].words
    assert found.noise.told == (True, True, False)
    assert found.to_dict()["noise"]["discrepancy_mm"] is None


@pytest.mark.cell("the model's error, estimated", "springs")
def test_discrepancy_that_visits_share(fitted):
    """What all visits of a pose share and joints do not explain is the model's, and sized."""
    found = fitted(visited(poses=8, visits=3), joints=JOINTS, discrepancy=1e-4)
    assert set(kinds(found)) == {"moving_joints", "lack_of_fit"}
    assert found.noise.discrepancy == pytest.approx(1e-4, rel=0.3)
    assert found.to_dict()["noise"]["together"]["revisited"]


def test_readings_within_a_visit(fitted):
    """One marker read three times in each of two visits tells the tracker from the joints."""
    found = fitted(visited(poses=8, visits=2, markers=1, readings=3), joints=JOINTS)
    assert "moving_joints" in kinds(found)
    assert found.noise.joints == pytest.approx(DEGREES, rel=0.5)
    assert found.noise.tracker == pytest.approx(1.0, rel=0.25)


def test_poses_with_rotations(tmp_path):
    """Where rotations are measured too, joints that move are found by both."""
    text = STUDY.path.read_text(encoding="utf-8")
    text = text[: text.index("published = [")] + text[text.index("[tool]") :]
    path = tmp_path / "study.toml"
    path.write_text(text.replace('rows = "position"', 'rows = "pose"\nsigma_deg = 0.0005'))
    study = load_study(path)
    data = visited(poses=8, visits=2, markers=2)
    rotations = np.full((len(data), 3), study.sigma[3])
    data = replace(
        data,
        deflection=np.zeros((len(data), 6)),
        sigma=np.hstack([data.sigma, rotations]),
    )
    motion = joint_motion(study.model, data) * np.sqrt(2) * JOINTS
    noise = visit_covariance(data, data.sigma, motion, np.zeros((len(data), 6)))
    A = data.regressor(study.model)
    moved = simulate(A, study.compliances, noise, np.random.default_rng(0))[0]
    found = FittedData.of(study, replace(data, deflection=moved), HowFitted(linear=True))
    assert found.common_noise
    assert found.noise_estimate.joints == pytest.approx(DEGREES, rel=0.3)
    assert found.noise_estimate.tracker == pytest.approx(1.0, rel=0.25)


@pytest.mark.parametrize("off", [0.3, 1.0])
def test_an_outlier_has_no_part_in_the_noise(tmp_path, off):
    """Beside joints that do not return it is the one row that is named, and noise is as without."""
    path = tmp_path / "sheet.csv"
    table = sheet(path, visited(poses=8, visits=2), joints=JOINTS)
    table.loc[5, "dy_mm"] += off
    table.to_csv(path, index=False)
    found = calibrate(STUDY, path)
    assert found.fit.outliers.tolist() == [5]
    assert found.fitted.common_noise
    assert found.noise.joints == pytest.approx(DEGREES, rel=0.3)
    assert found.noise.tracker == pytest.approx(1.0, rel=0.2)
    assert "noise_above_sigma" not in kinds(found)


@pytest.mark.parametrize("wild", [1e3, 1e9])
def test_one_wild_number(tmp_path, wild):
    """With a reading that is far off there is an answer all the same, and the verdict is bad."""
    path = tmp_path / "sheet.csv"
    table = sheet(path, visited(poses=8, visits=2), joints=JOINTS)
    table.loc[5, "dx_mm"] = wild
    table.to_csv(path, index=False)
    found = calibrate(STUDY, path, HowFitted(as_is=True, sigma_unknown=wild <= 1e6))
    assert found.verdict == "bad"
    assert found.to_dict()["covariance_dof"] is None or found.fit.covariance_dof >= 1
