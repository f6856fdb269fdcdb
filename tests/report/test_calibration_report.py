"""The report of a calibration: what its verdict says, and that a real browser shows all of it."""

import hashlib
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, WIDTHS, in_browser
from matplotlib.figure import Figure
from scipy.stats import probplot

from edtk.calibration.calibration import Origin
from edtk.calibration.propagation import calibration_budget
from edtk.calibration.spring_calibration import SpringCalibration
from edtk.findings.finding import Finding, Severity
from edtk.findings.fitted_data import FittedData, HowFitted
from edtk.findings.springs import spring_findings
from edtk.fit.measurements import Measurements, simulate
from edtk.fit.posterior import SamplingOptions
from edtk.fit.run_chain import Demand
from edtk.measure.expected_error import ErrorBudget
from edtk.report.calibration_report import calibration_report
from edtk.report.calibration_sections import facts_section
from edtk.report.draw.bars import error_budget, intervals
from edtk.report.draw.residuals import drawn_rows, quantiles
from edtk.report.shown import digits
from edtk.report.spring_report import (
    evaluated_facts,
    measured_facts,
    residual_causes,
    spring_verdict,
)
from edtk.study.study import load_study
from edtk.version import __version__

pytestmark = pytest.mark.slow

STUDY = load_study(Path(__file__).parents[2] / "studies" / "kr270_milling.toml")
PLAN = STUDY.published_plans()["table_4_12"]
A = np.repeat(STUDY.model.regressor(PLAN.q, PLAN.wrench), PLAN.repeats, axis=0)


def calibrated(spoil=lambda y: y, k=STUDY.compliances, known=True, seed=3, study=STUDY):
    """A calibration from simulated measurements of the plan of twelve, which may be spoiled."""
    y = spoil(simulate(A, k, STUDY.sigma, np.random.default_rng(seed))[0])
    data = Measurements(
        np.repeat(PLAN.q, PLAN.repeats, axis=0),
        np.repeat(PLAN.wrench, PLAN.repeats, axis=0),
        y,
        np.tile(STUDY.sigma, (len(y), 1)),
        np.zeros((len(y), 3)),
    )
    fitted = FittedData.of(study, data, HowFitted(sigma_unknown=not known))
    budget = calibration_budget(fitted, None)
    found = spring_findings(fitted, budget=budget)
    return SpringCalibration(fitted, findings=found, path=Path("day <1>.csv"), budget=budget)


@pytest.fixture(scope="module")
def good():
    """A calibration with data as the study says, and its page."""
    found = calibrated()
    return found, calibration_report(found)


def level_of(text):
    return re.search(r'data-level="(\w+)"', text)[1]


def test_a_good_calibration(good):
    """Data as the study says give a good verdict with rho0, and every standard deviation."""
    found, text = good
    assert level_of(text) == "good"
    assert f"Expect a total error of {1e3 * found.budget.total:.2g} mm" in text
    value = found.fit.accuracy(STUDY.target)[0]
    assert f"The noise alone makes {1e3 * value:.2g} mm" in text
    assert "The residuals fit the noise" in text
    assert "Nothing is wrong" not in text  # a line below says that joint 1 counts as rigid
    for name, k, std in zip(STUDY.model.parameters, found.fit.k, found.fit.std, strict=True):
        assert f"<td>{name}</td><td>{digits(k, std)}</td><td>{std:.1e}</td>" in text


def test_an_interval_where_sigma_is_estimated():
    """Where sigma is estimated, the accuracy to expect comes with its interval."""
    found = calibrated(known=False)
    low, high = found.fit.accuracy(STUDY.target)[1]
    interval = f"(95 %: {1e3 * low:.2g} to {1e3 * high:.2g} mm)"
    assert interval in spring_verdict(found)


def test_one_bad_measurement():
    """A measurement that is off by 0.4 mm spoils the verdict, and its row is named."""

    def spoil(y):
        y = y.copy()
        y[4] += 4e-4
        return y

    found = calibrated(spoil)
    text = spring_verdict(found)
    assert level_of(text) == "bad"
    assert "Row 5: outlier" in text
    assert "None of the faults" not in " ".join(residual_causes(found))
    assert f"{found.fit.scale:.3g} times what the stated noise allows" in text
    assert "Expect an error" not in text


def test_nothing_is_wrong_if_nothing_is_noted():
    """Without a joint that counts as rigid nothing is noted, and only then nothing is wrong."""
    joints = STUDY.specification.joints.model_dump()
    study = STUDY.replace(joints=joints | {"known_rad_per_Nm": {"q1": 1e-7}})
    box = spring_verdict(calibrated(study=study))
    assert "Nothing is wrong: the residuals fit the noise" in box
    assert "mm by q1, which counts as known: " in box
    assert box.count("<p>") == 4


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        ({}, "<p>Joint q2 counts as rigid, and the loads turn it: "),
        ({"q2": 2 * STUDY.compliances[0]}, "less compliant than is taken: identify it"),
    ],
    ids=["rigid", "known"],
)
def test_a_joint_that_the_loads_turn_is_named_where_the_sheet_does_not_fit(known, expected):
    """A joint that counts as rigid or known, and bends otherwise, is named: it is to be fitted."""
    joints = STUDY.to_dict()["joints"] | {"unknown": ["q3", "q4", "q5", "q6"]}
    kept = dict(list(STUDY.specification.simulation.compliance_rad_per_Nm.items())[1:])
    study = STUDY.replace(
        joints=joints | {"known_rad_per_Nm": known}, simulation={"compliance_rad_per_Nm": kept}
    )
    found = calibrated(study=study)
    assert found.verdict == "bad"
    assert expected in spring_verdict(found)


def test_a_headline_is_not_greener_than_a_warning(good):
    """What is hard to believe in the study stands in the box, and takes its green away."""
    study = STUDY.replace()
    doubt = Finding(Severity.WARNING, "test_pose", "test_pose.q_deg: are they in radians?", {})
    object.__setattr__(study, "warnings", (doubt,))
    found = replace(good[0], fitted=replace(good[0].fitted, study=study))
    box = spring_verdict(found)
    assert level_of(box) == found.to_dict()["verdict"] == "usable"
    assert found.to_dict()["study_warnings"] == [one.words for one in study.warnings]
    assert "<p>The study: test_pose.q_deg: are they in radians?</p>" in box


@pytest.mark.usefixtures("undrawn_pages")
def test_a_compensation_that_does_harm():
    """Where doing nothing is better, the headline says so, and nothing promises accuracy."""
    study = STUDY.replace(uncertainty={"load_percent": 150.0})
    found = calibrated(study=study)
    box = spring_verdict(found)
    assert level_of(box) == "bad"
    assert "<p>Do not compensate with this: the expected error is" in box
    assert box.count("<p>") == 1
    assert "If nothing else was wrong" in calibration_report(found)


@pytest.mark.usefixtures("undrawn_pages")
def test_a_cause_is_shown():
    """A shift of all loaded readings is named in the box, and its size is in a table."""
    found = calibrated(lambda y: y + np.array([1e-4, 0, -1.2e-4]))
    text = calibration_report(found)
    assert "<p>Loaded readings look shifted by 0.193 \N{PLUS-MINUS SIGN} 0.03 mm" in text
    assert "<td>drift</td><td>0.193</td><td>0.03</td><td>mm</td><td>-</td><td>all</td>" in text


@pytest.mark.parametrize("largest", [0.0, 1e-3])
def test_the_picture_of_a_budget(largest):
    """Every part has its number, the largest first; a budget of nothing can be drawn too."""
    budget = ErrorBudget(1e-6 * largest, 0, largest, largest / 10, 0, 0, 0, 0, 2 * largest)
    ax = Figure().add_subplot()
    error_budget(budget, ax)
    texts = [text.get_text() for text in ax.texts]
    assert texts == [f"{1e3 * part:.2g}" for part in sorted(budget.parts.values(), reverse=True)]
    widths = [bar.get_width() for bar in ax.patches]
    assert [width > 0 for width in widths] == [largest > 0] * 2 + [False] * 6
    assert all(low < high for low, high in (ax.get_xlim(),))


def test_negative_compliance():
    """Data of a joint that yields the wrong way are called wrong, and the parameter is named."""
    text = spring_verdict(calibrated(k=STUDY.compliances * [1, 1, 1, 1, -1]))
    assert level_of(text) == "bad"
    assert "<p>k6 comes out as -" in text


def test_what_the_result_rests_on(tmp_path):
    """The page names file, hash, noise, load, tool, model and options; again, it is the same."""
    found = calibrated()
    sheet = tmp_path / "day.csv"
    sheet.write_text("rows\n")
    os.utime(sheet, (1e9, 1e9))
    origin = Origin.of(sheet)
    assert origin == Origin.of(sheet)
    asked = replace(found.fitted, how=HowFitted(linear=True, as_is=True))
    found = replace(found, path=sheet, origin=origin, fitted=asked)
    text = facts_section(found, measured_facts(found), evaluated_facts(found))
    said = dict(re.findall("<dt>(.*?)</dt><dd>(.*?)</dd>", text))
    assert said["File"] == "day.csv"
    assert said["SHA-256"] == hashlib.sha256(b"rows\n").hexdigest()
    assert said["Last changed"] == "2001-09-09 01:46:40 UTC"
    assert said["Stated noise"] == "0.03 mm for each coordinate"
    assert said["Estimated noise"].startswith(f"{1e3 * found.sigma_hat:.3g} mm, ")
    assert said["Load"] == "F = (0, 0, -2500) N"
    assert said["Tool"] == "(611.5, 0, -460) mm from the last joint"
    assert said["Model"].startswith("the loaded equilibrium, as it moves")
    assert said["Sheet"].startswith("taken as it is")
    assert said["Program"] == f"edtk {__version__}"
    linear = replace(found, fitted=replace(asked, nonlinear=False))
    assert "<dd>linear, as asked for</dd>" in facts_section(
        linear, measured_facts(linear), evaluated_facts(linear)
    )


@pytest.mark.unix
def test_a_pipe_has_no_hash(tmp_path):
    """What cannot be read twice is not read again."""
    os.mkfifo(tmp_path / "pipe")
    assert Origin.of(tmp_path / "pipe") == Origin()


def test_nothing_from_outside(good):
    """It names no other file but the page of poses beside it: no scripts, no addresses."""
    text = good[1]
    assert re.findall(r'(?:src|href)="(?!data:|#|poses\.html")', text) == []
    assert "<script" not in text
    assert "://" not in re.sub(r"base64,[A-Za-z0-9+/=\s]+", "", text)
    assert "day <1>" not in text
    assert calibration_report(good[0]) == text


def test_every_column_has_a_header(good):
    """No table has a column without a name, and colours have a scale with a name."""
    assert "<th></th>" not in good[1]
    assert re.search("<text[^>]*>correlation</text>", good[1])


@pytest.mark.parametrize("zero", [(), (3,), range(5)])
def test_the_picture_has_the_intervals_of_the_table(good, zero):
    """Drawn or written is the interval of the table; one to zero does not stretch others."""
    k = good[0].fit.k.copy()
    k[list(zero)] = 0.0
    unbounded = np.where(k > 0, k, -good[0].fit.std)
    fit = replace(good[0].fit, k=k, unbounded=unbounded)
    ax = Figure().add_subplot()
    intervals(fit, STUDY.model.parameters, STUDY.model.units, ax)
    low, high = fit.interval
    drawn = np.array([line[:, 0] for line in ax.collections[0].get_segments()]).reshape(-1, 2)
    shown = k > 0
    assert drawn == pytest.approx(100 * (np.stack([low, high], axis=1)[shown].T / k[shown] - 1).T)
    assert [text.get_text() for text in ax.texts] == [
        f"0 to {h:.2g} rad/(N m)" for h in high[~shown]
    ]
    assert np.abs(ax.get_xlim()).max() <= 100


def test_of_many_residuals_the_worst_are_drawn():
    """A picture of very many measurements has some of them, and every one that fits badly."""
    residual = np.random.default_rng(0).normal(size=(20_000, 3))
    worst = np.argsort(-np.abs(residual).max(axis=1))[:1000]
    shown = drawn_rows(residual)
    assert len(shown) < 10_000
    assert np.isin(worst, shown).all()
    assert drawn_rows(residual[:50]).tolist() == list(range(50))


@pytest.mark.parametrize("count", [2, 12, 9000])
def test_quantiles_are_those_of_scipy(good, count):
    """The plot is scipy's, of which some points in the middle of very many are left out."""
    z = np.random.default_rng(0).normal(size=(count, 1))
    ax = Figure().add_subplot()
    quantiles(replace(good[0].fit, standardised=z), ax)
    points = ax.lines[0].get_xydata()
    expected = np.stack(probplot(z[:, 0], fit=False), axis=1)
    assert points[0] == pytest.approx(expected[0])
    assert points[-1] == pytest.approx(expected[-1])
    assert np.isin(points[:, 1], expected[:, 1]).all()
    assert len(points) == min(count, 6000)
    assert points[:, 0] == pytest.approx(expected[np.isin(expected[:, 1], points[:, 1]), 0])


@pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine")
def test_in_a_browser(tmp_path, good):
    """A headless browser shows verdict and pictures, at desk and phone width, without an error.

    All pages are frames of one, since a browser takes a second to start. The outer page's script
    writes down what the browser made of each; nothing is wider than its screen, and no letter of a
    picture smaller than nine pixels.
    """
    options = SamplingOptions(Demand(0.3, length=10.0))
    sampled = calibration_report(good[0].sampled(np.random.default_rng(3), options))
    seen = in_browser((good[1], sampled), tmp_path)
    assert seen == [f"{n} {n} true true true {width}" for n in (6, 9) for width in WIDTHS]
    assert all("Good calibration." in text for text in (good[1], sampled))
