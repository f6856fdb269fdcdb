"""The study's [noise] in identification: what sheets, plans and designs say of it is the same."""

import numpy as np
import pytest

from edtk.calibration.calibrate import calibrate
from edtk.calibration.planned import SpringDesigns, plan_noise, planned_measurements, visits_noise
from edtk.calibration.template import is_filled
from edtk.findings.finding import Severity
from edtk.findings.fitted_data import HowFitted
from edtk.findings.moving_joints import stated_noise
from edtk.fit.correlated_noise import std_of
from edtk.fit.least_squares import estimate
from edtk.fit.measurements import simulate
from edtk.measure.pose_table import (
    COVARIANCE_COLUMNS,
    DEFLECTION_COLUMNS,
    MARKER_COLUMNS,
    MARKER_NAME_COLUMN,
    SIGMA_COLUMN,
    VISIT_COLUMN,
)
from edtk.study.study import load_study
from edtk.system.errors import UserError
from edtk.verbs.template import template
from tests.support.readings import PLAN, STUDY
from tests.support.visits import sheet, visited

pytestmark = pytest.mark.slow

MARKERS = """
[[marker]]
name = "a"
position_mm = [0, 0, 0]
[[marker]]
name = "b"
position_mm = [300, 0, 100]
"""
NOISE = """
[noise]
tracker_position_mm = [4000, 1000, 800]
along = [10, 5]
across = [15, 6]
repeatability_deg = {repeatability}
discrepancy_mm = {discrepancy}
"""
DEGREES = 1e-3


@pytest.fixture
def study_of(tmp_path):
    """The milling study with a [noise], and markers if asked for."""

    def make(markers=True, repeatability=DEGREES, discrepancy=0.03, noise=NOISE):
        text = (STUDY.path).read_text(encoding="utf-8")
        text = text[: text.index("published = [")] + text[text.index("[tool]") :]
        added = noise.format(repeatability=repeatability, discrepancy=discrepancy)
        path = tmp_path / "study.toml"
        path.write_text(text + MARKERS * markers + added, encoding="utf-8")
        return load_study(path)

    return make


def covariance_of(data, model):
    A = data.regressor(model)
    return estimate(A, data.deflection, data.noise, model.parameters).covariance


@pytest.mark.cell("`[noise]` of a tracker", "springs")
@pytest.mark.cell("`[noise] model_error_percent`, of what springs do", "springs")
@pytest.mark.parametrize("share", [0, 10], ids=["ideal springs", "springs that err"])
@pytest.mark.parametrize("markers", [False, True], ids=["tool point", "two markers"])
def test_plans_are_worth_what_their_design_says(study_of, markers, share):
    """The fit to a plan has the inverse of the design's information, by whichever way."""
    study = study_of(markers, noise=f"{NOISE}model_error_percent = {share}\n")
    plan = PLAN.repeated(3)
    expected = np.linalg.inv(study.information(plan))
    model = study.model
    planned = covariance_of(planned_measurements(study, plan), model)
    np.testing.assert_allclose(planned, expected, rtol=1e-8, atol=1e-10 * expected.max())
    A = model.regressor(plan.q, plan.wrench)
    mean = estimate(A, 0 * A[..., 0], plan_noise(study, plan), model.parameters)
    np.testing.assert_allclose(mean.covariance, expected, rtol=1e-8, atol=1e-10 * expected.max())
    A = np.repeat(A, plan.repeats, axis=0)
    each = estimate(A, 0 * A[..., 0], visits_noise(study, plan), model.parameters)
    np.testing.assert_allclose(each.covariance, expected, rtol=1e-7, atol=1e-9 * expected.max())


def test_a_sheet_tells_itself_what_springs_leave_out(study_of):
    """A share of what springs do is for plans: readings have the noise that they have without."""
    plan = PLAN.repeated(2)
    of_share = study_of(False, noise="[noise]\nmodel_error_percent = 10\n")
    of_both = study_of(False, noise=f"{NOISE}model_error_percent = 10\n")
    data = planned_measurements(STUDY, plan)
    assert stated_noise(of_share, data) is data
    assert planned_measurements(of_share, plan).covariance is not None
    expected = stated_noise(study_of(False), data)
    np.testing.assert_array_equal(std_of(stated_noise(of_both, data).noise), std_of(expected.noise))


def filled(study, plan, path, seed=0):
    """The sheet of a plan, with readings by the linear model and the stated noise."""
    table = template(study, plan)
    table[list(DEFLECTION_COLUMNS)] = 0.001
    table.to_csv(path, index=False)
    data = calibrate(study, path, HowFitted(linear=True, as_is=True)).data
    A = data.regressor(study.model)
    moved = simulate(A, study.compliances, data.noise, np.random.default_rng(seed))[0]
    table[list(DEFLECTION_COLUMNS)] = 1e3 * moved
    table.to_csv(path, index=False)
    return path


@pytest.mark.cell("`[noise]` of joints that do not come back, stated", "springs")
def test_from_the_template_to_the_result(study_of, tmp_path):
    """A sheet that numbers its visits is identified with the stated noise, and is good."""
    study = study_of()
    plan = PLAN.repeated(2)
    table = template(study, plan)
    assert table[MARKER_NAME_COLUMN].tolist()[:4] == ["a", "b", "a", "b"]
    assert table[VISIT_COLUMN].tolist()[:5] == [1, 1, 2, 2, 3]
    found = calibrate(study, filled(study, plan, tmp_path / "sheet.csv"), HowFitted(linear=True))
    expected = np.linalg.inv(study.information(plan))
    np.testing.assert_allclose(found.fit.std, np.sqrt(np.diag(expected)), rtol=1e-5)
    assert found.fit.p_value > 0.01
    assert not [one for one in found.findings if one.severity > Severity.NOTE]


@pytest.mark.cell("`[noise] discrepancy_mm`, the model's error, stated", "springs")
def test_a_stated_discrepancy_is_no_error_of_the_tracker(study_of, tmp_path):
    """Where poses are visited once, the discrepancy cannot be told, and the stated one is taken."""
    study = study_of(markers=True)
    found = calibrate(study, filled(study, PLAN, tmp_path / "sheet.csv"), HowFitted(linear=True))
    assert found.noise.told == (True, True, False)
    assert found.noise.tracker == pytest.approx(1.0, abs=0.5)


def test_an_empty_sheet_is_written_again(study_of, tmp_path):
    """Visits, names and places of markers are no measurements."""
    path = tmp_path / "sheet.csv"
    template(study_of(), PLAN).to_csv(path, index=False)
    assert is_filled(path) is False


def test_a_sheet_speaks_for_its_tracker(study_of, tmp_path):
    """Noise that a sheet states takes the place of the tracker; joints and model are added."""
    study = study_of(markers=False)
    path = tmp_path / "sheet.csv"
    table = template(study, PLAN)
    table[list(DEFLECTION_COLUMNS)] = 0.001
    for columns, numbers in (
        ((SIGMA_COLUMN,), (0.02,)),
        (COVARIANCE_COLUMNS, (4e-4, 0, 0, 4e-4, 0, 4e-4)),
    ):
        stated = table.copy()
        stated[list(columns)] = numbers
        stated.to_csv(path, index=False)
        data = calibrate(study, path, HowFitted(linear=True, as_is=True)).data
        np.testing.assert_allclose(std_of(data.own_noise), 2e-5, rtol=1e-9)
        assert np.all(data.sigma > np.hypot(2e-5, 3e-5))


def test_a_budget_and_a_tracker(study_of):
    """The error budget of a plan knows the noise; a tracker errs less along its beam."""
    study = study_of(markers=False, repeatability=0, discrepancy=0)
    assert SpringDesigns(study).error_budget(PLAN).noise > 0
    data = planned_measurements(study, PLAN)
    own = data.tracker.blocks[0].covariance
    beam = study.robot.forward(PLAN.q)[:, :3, 3] - [4.0, 1.0, 0.8]
    r = np.linalg.norm(beam, axis=1)
    u = beam / r[:, None]
    along = np.sqrt(np.einsum("mi,mij,mj->m", u, own, u))
    expected = np.hypot(np.sqrt(2 / 3) * (10e-6 + 5e-6 * r), STUDY.sigma[0])
    np.testing.assert_allclose(along, expected, rtol=1e-9)


def test_repeats_without_a_discrepancy_are_independent(study_of):
    """Thousands of repeats are no trouble where they share nothing, and refused where they do."""
    many = PLAN.repeated(1000)
    assert visits_noise(study_of(False, discrepancy=0), many).shape == (12000, 3)
    with pytest.raises(
        UserError, match=r"1000 repeats of a pose share an error of the model; expected 200"
    ):
        visits_noise(study_of(False), many)


def test_white_noise_is_left_alone():
    """Without [noise] the measurements are the same object."""
    data = visited(poses=2)
    assert stated_noise(STUDY, data) is data


def test_joints_that_return_worse_than_stated(study_of, tmp_path):
    """The estimate from visits contradicts a stated repeatability, and says what to write."""
    noise = "\n[noise]\nrepeatability_deg = {repeatability}\ndiscrepancy_mm = {discrepancy}\n"
    path = tmp_path / "sheet.csv"
    sheet(path, visited(poses=8, visits=3), joints=np.deg2rad(1e-3))
    right = calibrate(study_of(False, 1e-3, 0, noise), path)
    assert not [one for one in right.findings if one.severity > Severity.NOTE]
    wrong = calibrate(study_of(False, 4e-4, 0, noise), path)
    kinds = {one.kind: one.words for one in wrong.findings}
    assert "repeatability" in kinds
    assert "stated 0.0004 deg" in kinds["repeatability"]


def test_columns_of_a_template(study_of):
    """Visits are numbered where they have several rows or errors of their own."""
    assert VISIT_COLUMN not in template(STUDY, PLAN)
    assert VISIT_COLUMN in template(STUDY, PLAN, markers=2)
    assert MARKER_COLUMNS[0] in template(STUDY, PLAN, markers=2)
    assert VISIT_COLUMN in template(study_of(False), PLAN)
