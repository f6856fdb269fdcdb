"""Poses left out, predictions and untold joints where displacements tell springs."""

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from kr270 import REQUIRED, TEST_POSE

import edtk
from edtk.calibration.calibrated_springs import predict_displacements
from edtk.calibration.propagation import FittedSprings, propagation_of
from edtk.design.plan import Plan
from edtk.findings.fitted_data import FittedData, HowFitted
from edtk.findings.moving_joints import stated_noise
from edtk.findings.noise import left_out_findings
from edtk.fit.correlated_noise import std_of
from edtk.fit.distributions import student_quantile
from edtk.fit.equilibrium import equilibrium_deflection, linearise
from edtk.fit.least_squares import estimate
from edtk.fit.measurements import Measurements, simulate
from edtk.study.study import Study
from edtk.system.errors import UserError
from edtk.verbs.template import template

# Which of two equal columns is kept rounding decides.
TWO_OF_A_KIND = "the compliance of joint q[46] cannot be told from the compliance of joint q[46]"
MOVED = ["dx_mm", "dy_mm", "dz_mm"]
K = np.array([3e-7, 4e-7, 2.8e-6, 2.8e-6, 2.1e-6])
TRACKER = {"tracker_position_mm": [4000, -3500, 1200], "along": [10, 0.5], "across": [15, 6]}
MOVING = {"repeatability_deg": 0.003, "discrepancy_mm": 0.02}


def day(seed, poses=8, repeats=2, linear=True, **keys):
    """A study and measurements of random poses, of a robot that bends by the linear model."""
    study = Study(**REQUIRED | {"test_pose": TEST_POSE} | keys)
    rng = np.random.default_rng(seed)
    q = np.repeat(study.space.draw(rng.random((poses, 6)))[:, :6], repeats, axis=0)
    none = np.zeros((len(q), 3))
    wrench = np.tile(study.space.load.always, (len(q), 1))
    data = stated_noise(study, Measurements(q, wrench, none, none + 3e-5, none))
    moved = simulate(data.regressor(study.model), K, data.noise, rng)[0]
    return study, replace(data, deflection=moved)


@pytest.mark.cell("poses left out one by one", "springs")
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("noise", [None, TRACKER, MOVING], ids=["white", "tracker", "moving"])
def test_a_pose_left_out_is_what_a_fit_without_it_predicts(noise, known):
    """Errors and bands are those of least squares from the other poses alone."""
    study, data = day(0, noise=noise)
    fitted = FittedData.of(study, data, HowFitted(sigma_unknown=not known, linear=True))
    out = fitted.left_out
    size = 1.0 if known else fitted.fit.scale
    t = student_quantile(0.975, fitted.fit.covariance_dof)
    for pose in range(8):
        rest = np.flatnonzero(data.pose != pose)
        own = np.flatnonzero(data.pose == pose)
        A = fitted.A[own]
        other = estimate(fitted.A[rest], fitted.measured[rest], data.noise[rest], ())
        errors = fitted.measured[own] - A @ other.k
        np.testing.assert_allclose(out.errors[own], errors, atol=1e-9 * np.abs(errors).max())
        spread = np.einsum("mrp,pq,mrq->mr", A, other.covariance, A)
        half = t * size * np.sqrt(std_of(data.noise)[own] ** 2 + spread)
        np.testing.assert_allclose(out.half[own], half, rtol=1e-9)


def test_what_one_pose_alone_tells_is_not_predicted():
    """Two poses of five springs: coordinates that only their own pose tells have no error."""
    study, data = day(0, 2, 1)
    out = FittedData.of(study, data, HowFitted(linear=True)).left_out
    assert np.isnan(out.errors).any()
    assert np.isinf(out.growth()).any()


def test_readings_that_bands_do_not_hold_are_found():
    """A day on which one pose in four errs ten times as much is named, and a sound day is not."""
    for wild, kinds in ((1.0, []), (10.0, ["outside"])):
        study, data = day(3, 24, 1)
        clean = data.regressor(study.model) @ K
        often = np.where(data.pose % 4, 1.0, wild)[:, None]
        moved = clean + often * (data.deflection - clean)
        fitted = FittedData.of(study, replace(data, deflection=moved), HowFitted(linear=True))
        out = fitted.left_out
        found = left_out_findings(out.share_inside, out.independent, False, False)
        assert [one.kind for one in found] == kinds


def bent(study, seed, poses=6, repeats=1):
    """A filled-in sheet of random poses, of a robot at the loaded equilibrium."""
    rng = np.random.default_rng(seed)
    q = study.space.draw(rng.random((poses, 6)))[:, :6]
    wrench = np.tile(study.space.load.always, (poses, 1))
    sheet = template(study, Plan(q, wrench, np.full(poses, repeats)))
    shown = np.deg2rad(sheet[[f"q{i}_deg" for i in range(1, 7)]].to_numpy())
    moved = equilibrium_deflection(study.model, shown, wrench[0], np.append(0.0, K))
    sheet[MOVED] = 1e3 * (moved + 3e-5 * rng.standard_normal(moved.shape))
    return sheet


@pytest.fixture(scope="module")
def found():
    return edtk.identify(Study(**REQUIRED), bent(Study(**REQUIRED), 1, 12, 2))


def test_bands_hold_what_they_promise():
    """Of test poses on 60 days, joints that come back anew included, 95 % are inside, about."""
    study = Study(**REQUIRED, noise=MOVING)
    inside = []
    for seed in range(40):
        _, data = day(seed, 8, 2, noise=MOVING)
        fitted = FittedData.of(study, data, HowFitted(linear=True))
        springs = FittedSprings.of(fitted, propagation_of(fitted), ())
        _, tests = day(1000 + seed, 6, 1, noise=MOVING)
        sheet = Plan(tests.q, tests.wrench, np.ones(6, int)).to_frame(study.robot)
        # Days of the linear model: what bends more is no part of the question here.
        predicted = predict_displacements(study, springs, False, sheet)
        linear = tests.regressor(study.model) @ fitted.fit.unbounded
        inside.append(np.abs(tests.deflection - linear) <= predicted.half)
    share = np.mean(inside)
    assert share == pytest.approx(0.95, abs=3 * np.std(np.mean(inside, axis=(1, 2))) / 40**0.5)


def test_predictions_are_the_loaded_equilibrium(found):
    """A plan, a file of poses, and a result's file or dictionary give the same numbers."""
    study = Study(**REQUIRED)
    sheet = bent(study, 2)
    poses = sheet.drop(columns=MOVED)
    by_file = edtk.predict(study, json.loads(json.dumps(found.to_dict())), poses)
    same = edtk.predict(study, found, sheet)
    for one, other in ((by_file.values, same.values), (by_file.half, same.half)):
        np.testing.assert_allclose(one, other, rtol=1e-9)
    q = np.deg2rad(poses[[f"q{i}_deg" for i in range(1, 7)]].to_numpy())
    plan = Plan(q, np.tile(study.space.load.always, (6, 1)), np.full(6, 3))
    np.testing.assert_allclose(edtk.predict(study, found, plan).values, same.values, rtol=1e-9)
    k = np.append(0.0, found.fit.unbounded)
    moved = equilibrium_deflection(study.model, q, study.space.load.always, k)
    np.testing.assert_allclose(same.values, moved, rtol=1e-9)
    spread = found.fit.covariance
    A = linearise(study.model, same.data, k).A
    std = np.sqrt(3e-5**2 + np.einsum("mrp,pq,mrq->mr", A, spread, A))
    assert (same.half > 1.95 * std).all()
    # Errors of the model that the sheet leaves possible add little here.
    np.testing.assert_allclose(np.median(same.half / std), 1.96, rtol=0.05)


@pytest.mark.cell("`predict`, and sets of tests", "springs")
def test_measured_displacements_are_tests(found, tmp_path):
    """Errors, the share inside, JSON and text; rows that are not filled in have a prediction."""
    study = Study(**REQUIRED)
    sheet = bent(study, 3)
    sheet.loc[[1, 4], MOVED] = np.nan
    seen = edtk.predict(study, found, sheet, out=tmp_path / "out.csv")
    content = json.loads(json.dumps(seen.to_dict(), allow_nan=False))
    assert content["errors"]["count"] == 4
    apart = (sheet[MOVED] - 1e3 * seen.values).to_numpy()[[0, 2, 3, 5]]
    rms = np.sqrt((apart**2).sum(axis=1).mean())
    assert content["rms_mm"] == pytest.approx(rms)
    assert content["share_inside"] == seen.share_inside >= 10 / 12
    assert [("test" in one) for one in content["displacements"]] == [1, 0, 1, 1, 0, 1]
    assert len(pd.read_csv(tmp_path / "out.csv")) == 6
    assert "4 measured displacements: errors" in seen.summary()
    assert not seen.findings
    sheet[MOVED] *= -1
    (said,) = edtk.predict(study, found, sheet).findings
    assert said.kind == "all_far_off"
    assert "their signs right" in said.words


def test_what_other_results_say(found):
    """Compliances alone have bands of a reading; what is of another robot is refused."""
    study = Study(**REQUIRED)
    poses = bent(study, 2).drop(columns=MOVED)
    by_hand = edtk.predict(study, found.k, poses)
    np.testing.assert_allclose(by_hand.half, 1.96 * 3e-5, rtol=1e-4)
    assert [one.kind for one in by_hand.findings] == ["certain"]
    with_std = edtk.predict(study, {"k": found.k, "std": found.std}, poses)
    assert (with_std.half > by_hand.half).all()
    other = study.replace(tool={"position_mm": [0, 0, 100]})
    with pytest.raises(UserError, match="another robot or tool"):
        edtk.predict(other, found.to_dict(), poses)
    with pytest.raises(UserError, match="study with"):
        edtk.predict(study, {"geometry": {}}, poses)
    with pytest.raises(UserError, match="no part of a displacement"):
        edtk.predict(study, found, poses, tool_rows=1)
    light = poses.assign(Fz_N=-2.5e7)
    with pytest.raises(UserError, match="row 1: the load buckles the arm"):
        edtk.predict(study, found, light)


def test_each_instrument_is_predicted_in_each_pose():
    """A file of poses has a row for each marker and distance of the study."""
    keys = REQUIRED | {
        "marker": [
            {"name": "A", "position_mm": [100, 0, 0]},
            {"name": "B", "joint": "q3", "position_mm": [0, 0, 9]},
        ]
    }
    study = Study(**keys)
    q = np.tile([0, -60, 90, 45, 76, 57.0], (2, 1))
    poses = pd.DataFrame(q, columns=[f"q{i}_deg" for i in range(1, 7)])
    result = {"k": dict(zip(study.specification.joints.unknown, K.tolist(), strict=True))}
    seen = edtk.predict(study, result, poses)
    assert seen.markers == ("A", "B") * 2
    assert seen.row.tolist() == [0, 0, 1, 1]
    moved = equilibrium_deflection(
        study.model, np.deg2rad(q), study.space.load.always, np.append(0.0, K)
    )
    np.testing.assert_allclose(seen.values.reshape(2, 6), moved, rtol=1e-9)


@pytest.mark.cell("what cannot be told apart, in words", "springs")
@pytest.mark.parametrize(
    ("unknown", "still", "words", "named"),
    [
        (
            ["q2", "q3", "q4", "q5", "q6"],
            {"q5_deg": 0.0},
            TWO_OF_A_KIND,
            r"k[46] \+ k[46]",
        ),
        (["q1", "q2", "q3"], {}, "joint q1 moves no marker in these poses", None),
    ],
    ids=["parallel axes", "vertical load"],
)
def test_words_name_the_joints_that_poses_do_not_tell(unknown, still, words, named):
    """The rest is what it is with that joint left out; nothing is compensated with it."""
    study = Study(**REQUIRED | {"test_pose": TEST_POSE, "joints": {"unknown": unknown}})
    sheet = bent(study, 5, 10).assign(**still)
    q = np.deg2rad(sheet[[f"q{i}_deg" for i in range(1, 7)]].to_numpy())
    k = np.append(0.0, K)[[int(name[1:]) - 1 for name in unknown]]
    sheet[MOVED] = 1e3 * study.model.regressor(q, study.space.load.always) @ k
    seen = edtk.identify(study, sheet, linear=True)
    (said,) = [one for one in seen.findings if one.kind == "open"]
    assert re.search(words, said.words)
    (rigid,) = seen.part.rigid
    content = json.loads(json.dumps(seen.to_dict(), allow_nan=False))
    assert content["rank"] == len(unknown) - 1
    assert re.search(words, content["open"][0])
    assert re.search(named or "k2", " ".join(seen.parameters))
    assert rigid in content["not_told"]
    rest = study.replace(joints={"unknown": [name for name in unknown if name != rigid]})
    fit = edtk.identify(rest, sheet, linear=True).fit
    np.testing.assert_allclose(seen.fit.unbounded, fit.unbounded)
    with pytest.raises(UserError, match=rigid):
        edtk.compensate(study, seen)
    elsewhere = edtk.predict(study, seen, bent(study, 6).drop(columns=MOVED))
    assert (len(elsewhere.open_rows) >= 4) == bool(named)


def test_evaluate_says_what_a_plan_does_not_tell_apart():
    """The line names what cannot be told from what, as a calibration of such poses does."""
    study = Study(**REQUIRED)
    q = study.space.draw(np.random.default_rng(0).random((8, 6)))[:, :6]
    q[:, 4] = 0.0
    plan = Plan(q, np.tile(study.space.load.always, (8, 1)), np.ones(8, int))
    with pytest.raises(UserError, match=f"identify all parameters: k4, k6 .*: {TWO_OF_A_KIND}"):
        edtk.evaluate(study, plan)
