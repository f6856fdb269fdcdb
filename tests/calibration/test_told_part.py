"""Sheets that leave compliances open which are not of interest."""

import json

import numpy as np
import pandas as pd
import pytest
from kr270 import REQUIRED, TEST_POSE

import edtk
from edtk.calibration.calibrate import calibrate
from edtk.design.plan import Plan
from edtk.findings.fitted_data import HowFitted
from edtk.report.calibration_report import calibration_report
from edtk.report.views.calibration import spring_calibration_text as text
from edtk.study.study import Study
from edtk.system.errors import UserError
from edtk.verbs.template import template

K = np.array([0.2, 0.3, 0.4, 2.8, 2.9, 2.1]) * 1e-6
NAMES = [f"q{i}" for i in range(1, 7)]
# A vertical load never turns joint 1.
OPEN = REQUIRED | {"joints": {"unknown": NAMES}, "optimise": ["D"]}
INTEREST = {"joints": ["q2"], "combinations": [{"q3": 1, "q4": -2}]}


def measured(study, path, q, noise=3e-5):
    """A filled-in sheet of poses, of a robot that bends by the linear model."""
    wrench = np.tile(study.space.load.always, (len(q), 1))
    sheet = template(study, Plan(q, wrench, np.ones(len(q), dtype=int)))
    shown = np.deg2rad(sheet[[f"{name}_deg" for name in NAMES]].to_numpy())
    moved = study.model.regressor(shown, wrench) @ K
    moved = moved + noise * np.random.default_rng(1).standard_normal(moved.shape)
    sheet[["dx_mm", "dy_mm", "dz_mm"]] = 1e3 * moved
    sheet.to_csv(path, index=False, float_format="%.12g")
    return path


def poses(seed=0, count=6):
    study = Study(**OPEN)
    return study.space.draw(np.random.default_rng(seed).random((count, 6)))[:, :6].round(4)


@pytest.mark.slow
def test_a_joint_that_no_load_turns_is_left_open(tmp_path):
    """The rest is what it is where that joint counts as rigid; the file and the text say so."""
    study = Study(**OPEN, interest=INTEREST)
    path = measured(study, tmp_path / "sheet.csv", poses())
    found = calibrate(study, path, HowFitted(linear=True))
    rest = calibrate(
        Study(**OPEN | {"joints": {"unknown": NAMES[1:]}}), path, HowFitted(linear=True)
    )
    assert found.k == rest.k
    np.testing.assert_array_equal(found.fit.covariance, rest.fit.covariance)
    assert found.part.open == found.part.rigid == ("q1",)
    combined = np.array([0, 1, -2, 0, 0])
    value, std = found.interest["k3 - 2 k4"]
    assert value == pytest.approx(combined @ rest.fit.k)
    assert std == pytest.approx(np.sqrt(combined @ rest.fit.covariance @ combined))
    assert found.interest["k2"] == pytest.approx((rest.k["q2"], rest.std["q2"]))
    content = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert content["not_told"] == ["q1"]
    assert content["interest"]["k3 - 2 k4"] == {"value": value, "std": std}
    shown = text(found)
    assert "not told by the measurements, and taken as rigid: q1" in shown
    assert "k3 - 2 k4" in shown
    page = calibration_report(found)
    assert "do not tell q1 by themselves" in page
    assert f"begins with {study.digest}" in page


def test_combinations_that_hang_together(tmp_path):
    """One pose tells three combinations: one of interest has the estimate that its row has."""
    study = Study(**OPEN)
    path = measured(study, tmp_path / "sheet.csv", poses(3, 1))
    sheet = pd.read_csv(path)
    q = np.deg2rad(sheet[[f"{name}_deg" for name in NAMES]].to_numpy())
    A = study.model.regressor(q, study.space.load.always)[0]
    told = A[0] / np.abs(A[0]).max()
    factors = {name: float(f) for name, f in zip(NAMES, told, strict=True) if f}
    study = Study(**OPEN, interest={"combinations": [factors]})
    found = calibrate(study, path, HowFitted(linear=True))
    ((value, std),) = found.interest.values()
    size = np.abs(A[0]).max()
    # Three rows for as many combinations: the one of interest is the first row itself.
    assert value == pytest.approx(sheet["dx_mm"][0] / 1e3 / size, rel=1e-9)
    assert std == pytest.approx(3e-5 / size, rel=1e-9)
    assert len(found.part.rigid) == 3
    assert set(found.part.open) == set(NAMES)
    content = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert set(content["k"].values()) == {None}
    assert all(("k" in name and "+" in name) or "-" in name for name in found.parameters)
    assert "NaN" not in text(found)


def test_what_is_of_interest_must_be_told(tmp_path):
    """Otherwise one line names it; and without a table what is open is a warning."""
    path = measured(Study(**OPEN), tmp_path / "sheet.csv", poses())
    with pytest.raises(UserError, match="identify k1, which is of interest"):
        calibrate(Study(**OPEN, interest={"joints": ["q1"]}), path)
    found = calibrate(Study(**OPEN), path, HowFitted(linear=True))
    (said,) = [one for one in found.findings if one.kind == "open"]
    assert "the compliance of joint q1 moves no marker in these poses" in said.words
    content = found.to_dict()
    assert (content["rank"], content["not_told"]) == (5, ["q1"])


@pytest.mark.slow
def test_what_is_of_interest_is_told_beside_the_rest(tmp_path):
    """Where all compliances are told, combinations of interest have lines of their own."""
    keys = OPEN | {"joints": {"unknown": NAMES[1:]}}
    study = Study(**keys, interest=INTEREST)
    found = calibrate(study, measured(Study(**OPEN), tmp_path / "sheet.csv", poses()))
    assert found.part is None
    assert found.to_dict()["not_told"] == []
    assert "of interest" in text(found)
    assert list(found.interest) == ["k2", "k3 - 2 k4"]


def test_an_open_joint_cannot_be_compensated_by_such_a_file(tmp_path):
    """A compliance that is not told is null, and a file with it is one line."""
    study = Study(**OPEN, interest=INTEREST, test_pose=TEST_POSE)
    found = calibrate(
        study, measured(study, tmp_path / "sheet.csv", poses()), HowFitted(linear=True)
    )
    path = tmp_path / "k.json"
    path.write_text(json.dumps(found.to_dict()))
    with pytest.raises(UserError, match="q1"):
        edtk.compensate(study, path)
