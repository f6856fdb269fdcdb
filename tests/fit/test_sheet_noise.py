"""Covariances of a tracker's file, from the sheet to the compliances."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from edtk.calibration.calibrate import calibrate
from edtk.findings.finding import Severity
from edtk.findings.fitted_data import HowFitted
from edtk.fit.sheet import sheet_noise
from edtk.measure.pose_table import (
    AXIS_SIGMA_COLUMNS,
    COVARIANCE_COLUMNS,
    DEFLECTION_COLUMNS,
    PoseFileError,
    PoseTable,
)
from edtk.report.calibration_sections import facts_section
from edtk.report.spring_report import evaluated_facts, measured_facts
from edtk.verbs.template import template
from tests.support.readings import PLAN, STUDY

UPPER = np.triu_indices(3)


def sheet(covariance_mm2, seed=0):
    """A filled-in sheet whose noise has covariances (m, 3, 3) [mm^2] in its rows."""
    plan = replace(PLAN, repeats=2 * PLAN.repeats)
    table = template(STUDY, plan)
    A = STUDY.model.regressor(np.deg2rad(table.iloc[:, :6]), table.iloc[:, 6:12])
    z = np.random.default_rng(seed).standard_normal((len(A), 3, 1))
    noise = (np.linalg.cholesky(covariance_mm2) @ z)[..., 0]
    table[list(DEFLECTION_COLUMNS)] = 1e3 * (A @ STUDY.compliances) + noise
    return table


def along_a_beam(seed=1):
    """Covariances (24, 3, 3) [mm^2] of a tracker that is ten times better along its beam."""
    beam = np.random.default_rng(seed).standard_normal((24, 3, 1))
    beam /= np.linalg.norm(beam, axis=1, keepdims=True)
    return 0.05**2 * (np.eye(3) - 0.99 * beam @ np.swapaxes(beam, 1, 2))


@pytest.fixture
def fitted(tmp_path):
    def fit(table, **options):
        table.to_csv(tmp_path / "sheet.csv", index=False)
        return calibrate(STUDY, tmp_path / "sheet.csv", HowFitted(linear=True, **options))

    return fit


@pytest.mark.slow
def test_a_diagonal_covariance_is_a_sigma_for_each_axis(fitted):
    """Both ways to write independent noise give the same numbers, diagnostics and report."""
    sigma = np.array([0.02, 0.03, 0.05])
    one = sheet(np.tile(np.diag(sigma**2), (24, 1, 1)))
    other = one.copy()
    one[list(AXIS_SIGMA_COLUMNS)] = sigma
    other[list(COVARIANCE_COLUMNS)] = np.diag(sigma**2)[UPPER]
    before = fitted(one)
    after = fitted(other)
    np.testing.assert_allclose(after.fit.k, before.fit.k, rtol=1e-9)
    np.testing.assert_allclose(after.fit.covariance, before.fit.covariance, rtol=1e-8)
    assert after.fit.p_value == pytest.approx(before.fit.p_value, rel=1e-8)
    assert [one.words for one in after.findings] == [one.words for one in before.findings]
    assert "correlated within a row" in facts_section(
        after, measured_facts(after), evaluated_facts(after)
    )


@pytest.mark.slow
def test_a_covariance_by_row_is_used(fitted):
    """A tracker that measures ranges well: its covariance is Aitken's, and chi-square is right."""
    covariance = along_a_beam()
    table = sheet(covariance)
    table[list(COVARIANCE_COLUMNS)] = covariance[:, *UPPER]
    found = fitted(table)
    A = found.fitted.A
    M = np.einsum("mri,mrs,msj->ij", A, np.linalg.inv(covariance * 1e-6), A)
    np.testing.assert_allclose(found.fit.covariance @ M, np.eye(5), atol=1e-7)
    assert 0.001 < found.fit.p_value < 0.999
    ignored = fitted(table.drop(columns=list(COVARIANCE_COLUMNS)))
    assert np.all(found.fit.std < 0.8 * ignored.fit.std)
    doubts = [one.words for one in found.findings if one.severity > Severity.NOTE]
    assert all("linear model" in text for text in doubts)


@pytest.mark.parametrize("options", [{"robust": True}, {"sigma_unknown": True}])
def test_an_outlier_in_correlated_rows(fitted, options):
    """A reading that is off along a beam is an outlier, though less than the noise across it."""
    covariance = along_a_beam()
    table = sheet(covariance)
    table[list(COVARIANCE_COLUMNS)] = covariance[:, *UPPER]
    # The direction of the least noise, in which eight of its sigmas are below one of the others.
    off = 8 * 0.005 * np.linalg.eigh(covariance[7])[1][:, 0]
    table.loc[7, list(DEFLECTION_COLUMNS)] += off
    assert fitted(table, **options).fit.outliers.tolist() == [7]


@pytest.mark.slow
def test_noise_that_repetitions_share(fitted):
    """With a covariance in each row, noise common to a pose is estimated, and widens intervals."""
    covariance = np.tile(0.03**2 * (np.eye(3) + 0.5 * np.ones((3, 3))), (24, 1, 1))
    table = sheet(covariance)
    table[list(COVARIANCE_COLUMNS)] = covariance[:, *UPPER]
    before = fitted(table)
    shared = 0.06 * np.random.default_rng(3).standard_normal((12, 3))
    table[list(DEFLECTION_COLUMNS)] += np.repeat(shared, 2, axis=0)
    found = fitted(table)
    assert found.fitted.common_noise
    assert np.all(found.fit.std > 1.5 * before.fit.std)
    off = np.abs(found.fit.unbounded - STUDY.compliances) / found.fit.std
    assert off.max() < 4


@pytest.mark.parametrize("columns", [AXIS_SIGMA_COLUMNS, COVARIANCE_COLUMNS])
def test_a_distance_has_one_noise(columns):
    """Axes mean nothing to a distance: such columns are refused by name."""
    table = PoseTable(Path("sheet.csv"), {column: np.ones(2) for column in columns})
    with pytest.raises(PoseFileError, match=f"'{columns[0]}': a distance has one noise"):
        sheet_noise(table, np.array([1e-4]))


def test_one_noise_of_all_rows_is_laid_out_by_row():
    """Sums over rows keep their order, and so their last digits, wherever the noise comes from."""
    table = PoseTable(Path("sheet.csv"), {"dx_mm": np.ones(4)})
    noise, _ = sheet_noise(table, np.array([1e-4, 2e-4, 3e-4]))
    assert noise.flags.c_contiguous
    np.testing.assert_array_equal(noise, np.tile([1e-4, 2e-4, 3e-4], (4, 1)))
