"""Numbers of a compensator that are unknown: rows, slopes, certificate, and what finds them."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import edtk
from edtk.calibration.calibrate_geometry import calibrate_geometry
from edtk.calibration.geometry_question import GeometryQuestion, geometry_setting
from edtk.certificate.recompute.setting import Setting
from edtk.fit.fitted_geometry import loading_in
from edtk.measure.equilibrium import Rest
from edtk.measure.parameters import numbers_asked
from edtk.robots.load_robot import load_robot
from edtk.study.study_geometry import StudyGeometry

ROBOT = load_robot("kuka_kr270_compensator")
JOINTS = ("q2", "q3", "q4", "q5", "q6")
K = np.array([0, 3e-7, 4e-7, 2.8e-6, 2.8e-6, 2.1e-6])
LOAD = [300.0, -200.0, -2500.0]
WRENCH = np.array([*LOAD, 0, 0, 0])
TOOL = {"position_mm": [611.5, 0, -460]}
NUMBERS = {"compensator.q2.stiffness": 20.0, "compensator.q2.preload": -7.0}


def study(reference="nominal", compensators=("q2",), **more):
    """Springs alone, by displacements, with a compensator of which some numbers are unknown."""
    given = {
        "robot": "kuka_kr270_compensator",
        "tool": TOOL,
        "load": {"F_N": LOAD},
        "measurement": {"sigma_mm": 0.03, "reference": reference},
        "joints": {"fixed_deg": {"q1": 0}},
        "parameters": {
            "compliance": list(JOINTS),
            "geometry": [],
            "base": False,
            "tool": False,
            "compensators": list(compensators),
        },
        "simulation": {"compliance_rad_per_Nm": dict(zip(JOINTS, K[1:].tolist(), strict=True))},
    }
    return edtk.Study(**given | more)


def poses(count, seed=0):
    q = np.random.default_rng(seed).uniform(*ROBOT.limits, (count, 6))
    q[:, 0] = 0.0
    return q


@pytest.mark.parametrize("reference", ["nominal", "unloaded"])
def test_columns_are_derivatives_of_what_is_read(reference):
    """At rest, with any size of springs and of the compensator's numbers, by differences."""
    asked = StudyGeometry.of(study(reference, ["q2.all"]))
    model = asked.model
    rng = np.random.default_rng(1)
    theta = model.scales * np.where(
        [one.is_spring for one in model.parameters],
        [1e6 * K[int(one.of[1]) - 1] if one.is_spring else 0 for one in model.parameters],
        rng.normal(size=model.p),
    )
    q = poses(3)
    wrench = np.tile(WRENCH, (3, 1))
    differs = np.full(3, reference == "unloaded")

    def seen(theta, derivatives=False):
        loading = loading_in(model.bending(theta), q, wrench, asked.loads, differs, derivatives)
        return model.see(theta, q, loading, derivatives)

    exact = seen(theta, True).jacobian * model.scales
    for i, step in enumerate(1e-2 * model.scales * np.eye(model.p)):
        expected = (seen(theta + step).points - seen(theta - step).points) / 2e-2
        size = np.abs(exact[..., i]).max()
        np.testing.assert_allclose(exact[:, :, :3, i], expected, rtol=0, atol=2e-5 * size + 1e-13)


@pytest.mark.parametrize("reference", ["nominal", "unloaded"])
def test_rows_of_plans_are_those_of_the_certificate_and_have_slopes(reference):
    """Rows by two codes, and derivatives by joints and load by differences."""
    question = GeometryQuestion.of(
        study(reference, ["q2.all"], load={"F_max_N": 2500, "direction": [0.1, -0.1, -1]})
    )
    names = [one.name for one in question.model.parameters]
    assert sum(name.startswith("compensator.q2.") for name in names) >= 4
    setting = Setting.from_dict(json.loads(json.dumps(geometry_setting(question))))
    q = poses(4)
    wrench = np.tile(WRENCH, (4, 1))
    rows = question.space._rows
    own = rows(q, wrench)
    apart = np.abs(own - setting.whitened_rows(q, wrench)).max(axis=(0, 1))
    assert (apart <= 1e-7 * np.abs(own).max(axis=(0, 1))).all()
    B = np.random.default_rng(2).normal(size=own.shape) / np.abs(own).max(axis=(0, 1))
    changes = np.tile(np.eye(6)[2][:, None], (4, 1, 1))
    slopes = rows.slopes(q, wrench, B, changes)
    for j, h in enumerate(1e-6 * np.eye(6)):
        expected = (B * (rows(q + h, wrench) - rows(q - h, wrench))).sum(axis=(1, 2)) / 2e-6
        np.testing.assert_allclose(slopes[:, j], expected, atol=1e-6 * np.abs(slopes).max())
    h = 0.1 * np.eye(6)[2]
    expected = (B * (rows(q, wrench + h) - rows(q, wrench - h))).sum(axis=(1, 2)) / 0.2
    np.testing.assert_allclose(slopes[:, 6], expected, atol=1e-6 * np.abs(slopes[:, 6]).max())


def day(asked, seed, m=20):
    """Displacements of a robot whose compensator is another one, from the nominal robot."""
    rng = np.random.default_rng(seed)
    numbers = np.array(ROBOT.compensators[0].numbers())
    numbers[6:] += 1e3 * np.array(list(NUMBERS.values()))
    truth = replace(ROBOT, compensators=(ROBOT.compensators[0].with_numbers(numbers),))
    model = edtk.Study(
        **study().to_dict()
        | {"robot": truth, "parameters": None, "joints": {"unknown": list(JOINTS)}}
    ).model
    q = poses(m, seed)
    rest = Rest.of(model, q, WRENCH, K)
    moved = model.robot.forward(rest.end)[:, :3, 3] - model.robot.forward(q)[:, :3, 3]
    moved = moved + 3e-5 * rng.normal(size=moved.shape)
    table = pd.DataFrame(np.rad2deg(q), columns=[f"{name}_deg" for name in ROBOT.joint_names])
    table[["Fx_N", "Fy_N", "Fz_N"]] = LOAD
    return table.assign(**{f"d{axis}_mm": 1e3 * moved[:, i] for i, axis in enumerate("xyz")})


@pytest.mark.cell("`[parameters] compensators`", "parameters")
def test_unknown_numbers_are_found_with_the_springs():
    """A compensator that is 20 N/mm and 7 kN off: within errors that it states, of several days."""
    asked = study()
    true = dict(zip((f"k_{name}" for name in JOINTS), 1e6 * K[1:], strict=True)) | NUMBERS
    away = []
    for seed in range(1):
        fitted = calibrate_geometry(asked, day(asked, seed)).fit.fitted
        names = [one.name for one in fitted.model.parameters]
        assert names == list(true)
        apart = fitted.values - [true[name] for name in names]
        away.append(apart @ np.linalg.solve(fitted.covariance, apart))
        assert fitted.std[0] < 0.01 * true["k_q2"]
        assert fitted.std[-1] < 0.5
    assert 0.6 < sum(away) < 24.3  # chi-square of 7: 0.1 % are outside either end


def test_another_day_is_predicted(tmp_path):
    """Displacements from the nominal robot, by a result that was written and read again."""
    asked = study()
    found = edtk.identify(asked, day(asked, 0))
    (tmp_path / "k.json").write_text(json.dumps(found.to_dict()))
    seen = edtk.predict(asked, tmp_path / "k.json", day(asked, 5, m=10))
    errors = np.linalg.norm(seen.apart, axis=1)
    assert errors.max() < 2e-4
    assert (np.abs(seen.apart) <= seen.half).mean() > 0.85


@pytest.mark.cell("`[parameters] compensators`", "springs")
def test_springs_by_displacements_have_the_compensator_as_it_is_stated():
    """Its numbers are unknown with [parameters] alone, which may be springs alone."""
    asked = study()
    plain = edtk.Study(
        **asked.to_dict() | {"parameters": None, "joints": {"unknown": list(JOINTS)}}
    )
    assert plain.robot.digest == asked.robot.digest
    assert "compensator" not in " ".join(plain.model.parameters)


def test_names_units_and_words_of_numbers():
    """A compensator by its joint, a group of its numbers, and a single one."""
    twice = replace(ROBOT, compensators=ROBOT.compensators * 2)
    found = numbers_asked(twice, ["q2:2.anchor2.z", "q2", "q2.anchor1"])
    assert [one.name for one in found] == [
        *(f"compensator.q2.anchor1.{axis}" for axis in "xyz"),
        "compensator.q2.stiffness",
        "compensator.q2.preload",
        "compensator.q2:2.anchor2.z",
    ]
    assert [one.unit for one in found] == ["mm"] * 3 + ["N/mm", "kN", "mm"]
    assert found[0].words == "the first anchor along x of the compensator at joint q2"
    assert found[3].spread == pytest.approx(150)


WRONG = {
    "joint": (("q3",), "no number 'q3' of a compensator; this robot has compensators at: q2"),
    "number": (("q2.spring",), "no number 'q2.spring'"),
    "twice": (("q2", "q2.preload"), "compensator.q2.preload is listed twice"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_numbers_are_one_line(case):
    """What is asked for has to be there, once, and its joint has to give way."""
    asked, expected = WRONG[case]
    with pytest.raises(edtk.UserError) as error:
        study(compensators=asked)
    assert str(error.value).startswith(f"Study: parameters.compensators: {expected}")


def test_compensator_of_a_rigid_joint_is_one_line():
    """Nothing shows what loads a joint that does not give way."""
    table = study().to_dict()["parameters"] | {"compliance": ["q3"]}
    with pytest.raises(edtk.UserError, match="joint q2 counts as rigid"):
        study(parameters=table, simulation=None)


@pytest.mark.slow
def test_a_plan_says_what_a_wrong_guess_of_the_compensator_costs(monkeypatch):
    """What it pulls is off by a half, and bounds are those of then."""
    monkeypatch.setattr("edtk.design.relaxation.search_continuum.SCREEN", 200)
    monkeypatch.setattr("edtk.design.relaxation.search_continuum.STARTS", 4)
    monkeypatch.setattr("edtk.study.plan_study.STARTS", 1)
    table = {
        "compliance": ["q2"],
        "geometry": [],
        "base": False,
        "tool": False,
        "compensators": ["q2.stiffness"],
    }
    held = {"fixed_deg": {"q1": 0, "q4": 30, "q5": 40, "q6": 0}}
    joints = study(candidates=60, parameters=table, joints=held, simulation=None)
    found = edtk.plan(joints, 4, "D", seed=1, workers=1)
    guesses = [(one.of, one.factor) for one in found.off_guess]
    assert guesses == [("compensators", 0.5), ("compensators", 1.5)]
    weaker = joints.with_guess_times(0.5, "compensators")
    (own,), (weak,) = joints.robot.compensators, weaker.robot.compensators
    assert (weak.stiffness, weak.preload) == (own.stiffness / 2, own.preload / 2)
    question = GeometryQuestion.of(weaker)
    cost = question.criterion("D").cost(question.information(found.plan))
    bound = edtk.relax(weaker, "D", continuous=True).best_bound.scaled(4)
    assert found.off_guess[0].efficiency == pytest.approx(bound.cost / cost, rel=1e-3)
    assert "of the compensators, in the robot; the plan's efficiency is" in found.summary()


def test_a_guess_that_is_off_may_be_of_no_robot():
    """A plan is given all the same, and says why."""
    upside = {
        "joint": "q2",
        "anchors_mm": [[0, 200, 650], [-180, 200, 0]],
        "stiffness_N_per_mm": 150,
        "preload_N": 70000,
    }
    keys = {"robot": {"file": "kuka_kr270", "compensator": [upside]}, "compensators": []}
    asked = None
    for size in np.geomspace(1e-8, 1e-3, 60):  # up to where the guess itself would snap
        try:
            asked = study("unloaded", simulation={"compliance_rad_per_Nm": {"q2": size}}, **keys)
        except edtk.UserError:
            break
    assert asked is not None
    with pytest.raises(edtk.UserError, match="the arm would snap"):
        asked.with_guess_times(1.5)
