"""The report of a calibration of geometry: what it says, and that a browser shows all of it."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, WIDTHS, in_browser
from geometry_sheets import STUDY, TEST_POSE, by_pose, run, truth

import edtk
from edtk.calibration.geometric_calibration import GeometricCalibration
from edtk.findings.geometric_fit import geometric_findings
from edtk.report.calibration_report import calibration_report

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> GeometricCalibration:
    """A calibration from a sheet with one wrong row, with its posterior."""
    q, x = truth(25)
    q[4, 1] += 20
    sheet = by_pose(tmp_path_factory.mktemp("day") / "day <1>.csv", q, x)
    calibration = edtk.identify(STUDY, sheet, bayes=True)
    assert isinstance(calibration, GeometricCalibration)
    return calibration


@pytest.fixture(scope="module")
def text(found: GeometricCalibration) -> str:
    """Its report, whose pictures take seconds."""
    return calibration_report(found)


def test_it_says_what_a_person_wants_to_know(found: GeometricCalibration, text: str) -> None:
    """Verdict with the error to expect, the row that is wrong, units, rank, and the file."""
    assert 'data-level="usable"' in text
    assert f"Expect errors of {found.loo_rms_mm:.2g} mm (rms)" in text
    assert "Row 5: positions are up to" in text
    assert "as if q2 were typed wrongly" in text
    assert "33 parameters can be told apart" in text
    assert "cannot be told from the base&#x27;s x" in text
    for parameter in found.fit.fitted.model.parameters:
        assert f"<td>{parameter.name}</td>" in text
    assert len(re.findall("<td>mrad</td>", text)) > 10
    assert "Laplace&#x27;s approximation, checked by" in text
    assert "day &lt;1&gt;.csv" in text
    assert text.count("<figure") == 7


@pytest.mark.usefixtures("undrawn_pages")
def test_poses_that_no_other_predicts_are_no_promise(found: GeometricCalibration) -> None:
    """Where a pose is predicted worse than by base and tool alone, no such error is promised."""
    fit = replace(found.fit, placed=1e-9)
    findings = tuple(geometric_findings(fit, found.setting))
    few = replace(found, fit=fit, findings=findings, check=None)  # its pictures take seconds
    text = calibration_report(few)
    assert few.verdict == "bad"
    assert "in poses like these" not in text
    assert "Do not use: a pose left out is" in text


@pytest.mark.usefixtures("undrawn_pages")
def test_open_directions_are_in_the_report(tmp_path: Path) -> None:
    """What the poses do not tell is named in a table, and two test poses have a row each."""
    q, x = truth(12)
    poses = [TEST_POSE, TEST_POSE | {"q_deg": [0, 40, 30, 0, 50, 0]}]
    study = STUDY.replace(parameters={"geometry": ["q1", "q2"], "tool": False}, test_pose=poses)
    q[:, 0] = 20.0
    found = edtk.identify(study, by_pose(tmp_path / "day.csv", q, x), as_is=True)
    text = calibration_report(found)
    assert "What error to expect in each test pose?" in text
    assert f"<td>{1e3 * found.tasks.error[1]:.3g}</td>" in text
    assert "These poses leave open" in text
    assert all(sentence.split(" cannot")[0] in text for sentence in found.fit.open)


@pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine")
def test_in_a_browser(text: str, tmp_path: Path) -> None:
    """Verdict and pictures are shown at desk and phone width, and nothing is wider than those."""
    seen = in_browser([text], tmp_path)
    assert seen == [f"7 7 true true true {width}" for width in WIDTHS]


@pytest.mark.usefixtures("undrawn_pages")
def test_files_are_written_again(tmp_path: Path) -> None:
    """The same command twice writes the same files; that pictures are the same is shown of springs
    in `test_calibration_report.py`, where one function draws them all.
    """
    study = tmp_path / "study.toml"
    STUDY.to_toml(study)
    q, x = truth(10)
    sheet = by_pose(tmp_path / "day.csv", q, x)
    words = ("identify", study, sheet, "--out", tmp_path / "out")
    assert run(*words)[0] == 0
    before = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    assert set(before) == {"k.json", "residuals.csv", "report.html", "poses.html"}
    assert run(*words)[0] == 0
    assert before == {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}


def test_many_points_are_thinned() -> None:
    """Of many points the largest are drawn, and some evenly."""
    from edtk.report.draw.posterior import DRAWN_POINTS, thinned

    sizes = np.arange(10 * DRAWN_POINTS)[::-1].astype(float)
    some = thinned(sizes)
    assert set(range(DRAWN_POINTS)) <= set(some.tolist())
    assert 2 * DRAWN_POINTS - 60 < len(some) <= 2 * DRAWN_POINTS
    assert len(thinned(sizes[: 2 * DRAWN_POINTS])) == 2 * DRAWN_POINTS
