"""Faults of the study change its sheets, and answers are counted as right or wrong."""

from dataclasses import replace

import numpy as np
import pytest

from edtk.findings.causes.family import Cause
from edtk.fit.equilibrium import equilibrium_deflection
from edtk.robots.rotations import transform


@pytest.fixture(scope="module")
def robots(script):
    return script("fault_robots.py").robots()


@pytest.fixture(scope="module")
def faults(script):
    return script("faults.py")


@pytest.fixture(scope="module")
def scenes(script):
    return script("scene.py")


@pytest.fixture(scope="module")
def answers(script):
    return script("fault_answers.py")


@pytest.fixture(scope="module")
def good(robots, scenes):
    """Four poses of the UR10, each measured twice, without a fault."""
    study = robots["UR10, 10 kg"]
    q = np.random.default_rng(0).uniform(-1, 1, (4, 6)) * [0, 1, 1, 1, 1, 1] + [0, -1, 1, 0, 1, 0]
    wrench = np.asarray(study.space.load.wrench(np.zeros((4, 0))))
    return scenes.Scene.of(study, q, wrench, 2)


def test_robot_is_that_of_its_table(robots):
    """The chain of the UR10 is the product of the transforms of its DH parameters."""
    a = (0.0, -0.612, -0.5723, 0.0, 0.0, 0.0)
    d = (0.1273, 0.0, 0.0, 0.163941, 0.1157, 0.0922)
    alpha = np.deg2rad([90, 0, 0, 90, -90, 0])
    q = np.random.default_rng(0).uniform(-2, 2, 6)
    T = np.eye(4)
    for i in range(6):
        T = T @ transform([0, 0, d[i]], [0, 0, q[i]]) @ transform([a[i], 0, 0], [alpha[i], 0, 0])
    robot = robots["UR10, 10 kg"].robot
    # The calibration tool of the study takes the place of the flange.
    before_tool = robot.forward(q) @ np.linalg.inv(robot.tool)
    last = transform([a[5], 0, d[5]], [alpha[5], 0, 0])
    np.testing.assert_allclose(before_tool @ last, T, atol=1e-12)


def test_good_day(good):
    """Without noise the sheet holds the loaded equilibrium."""
    study = good.study
    clean = replace(good, noise=0.0).measured(np.random.default_rng(0))
    rest = equilibrium_deflection(study.model, good.q, good.wrench, good.k)
    np.testing.assert_allclose(clean, rest, atol=1e-15)


def test_every_fault_changes_the_sheet(good, faults, tmp_path):
    """With the same noise, each fault makes another sheet than a good day."""
    path = tmp_path / "sheet.csv"
    good.write(path, np.random.default_rng(1))
    right = path.read_text()
    for fault in faults.FAULTS[1:]:
        scene = fault.make(good, np.random.default_rng(0))
        if scene is not None:
            scene.write(path, np.random.default_rng(1))
            assert path.read_text() != right, fault.title


def test_noise_is_common_only_where_a_pose_is_repeated(good, faults, robots, scenes):
    """A plan without repetitions cannot have that fault."""
    once = scenes.Scene.of(robots["UR10, 10 kg"], good.q[::2], good.wrench[::2], 1)
    rng = np.random.default_rng(0)
    assert faults.common_noise(good, rng) is not None
    assert faults.common_noise(once, rng) is None


def test_judged(good, faults, answers):
    """The first cause counts; a wrong pose needs its rows, noise and outliers need no cause."""
    by_title = {fault.title: fault for fault in faults.FAULTS}

    def judge(title, *causes, scene=good, **seen):
        named = tuple(Cause(name, 1.0, "", None, 0.0, rows=rows) for name, rows in causes)
        answer = answers.Answer("usable", named, **seen)
        return answers.judged(by_title[title], scene, answer)

    assert judge("drift of 50 um", ("drift", ()), ("tool_z", ())).right
    second = judge("drift of 50 um", ("tool_z", ()), ("drift", ()))
    assert (second.right, second.among, second.wrong) == (False, True, True)
    assert not judge("drift of 50 um", ("tool_z", ())).among
    assert judge("none", ("sigma", ())).wrong
    assert not judge("load 10 % off").wrong
    pose = replace(good, rows=(2, 3))
    assert judge("wrong pose in all its repeats", ("pose", (2, 3)), scene=pose).right
    assert judge("wrong pose in all its repeats", ("pose", (0, 1)), scene=pose).wrong
    assert judge("noise common to a pose", common=True).right
    assert not judge("noise common to a pose", ("sigma", ()), common=True).right
    assert judge("one outlier of 15 sigma", scene=pose, outliers=(2, 3)).right


def test_misses(script):
    """A place misses a target only by more than chance."""
    table = script("fault_shares.py")
    good = table.Cell("robot", 0, None, 12, 1)
    shares = table.Shares(200, 3.0, float("nan"), 2.5, float("nan"), 1.0, 0.0)
    assert table.misses([(good, shares)]) == []
    (miss,) = table.misses([(good, replace(shares, wrong=6.0))])
    assert miss[-2:] == ("2 %", "6 %")
    drift = replace(good, fault=[fault.cause for fault in table.FAULTS].index("drift"))
    shares = table.Shares(200, 80.0, 60.0, 30.0, float("nan"), 1.0, 0.0)
    (miss,) = table.misses([(drift, shares)])
    assert miss[-2:] == ("80 %", "60 %")


def test_page_says_what_is_out_of_reach(script):
    """Where the best possible naming reaches less than is asked, the page says how much."""
    page = script("fault_page.py")
    Bound = script("fault_bounds.py").Bound
    share = ("named first, of detected", "80 %", "43 %")
    missed = [
        ("robot", "drift", "optimal 12, once", *share),
        ("robot", "backlash", "random 12, 3 times", *share),
        ("robot", "outlier", "optimal 12, once", *share),
        ("robot", "drift", "random 12, once", *share),
    ]
    possible = {
        ("robot", "optimal", 1): {
            "drift": Bound(5, 50, 85, 69),
            "outlier": Bound(5, 50, 99, 98),
        },
        ("robot", "random", 3): {"backlash": Bound(5, 50, 31, 35)},
    }
    assert [page._best(miss, possible) for miss in missed] == [
        "69 to 85 %",
        "31 to 35 %",
        "98 to 99 %",
        "-",
    ]
    never, unknown = page._out_of_reach(missed, possible)
    assert never.endswith("where it is right in 35 % (robot: backlash, random 12, 3 times).\n")
    assert unknown.endswith("is right in 69 % (robot: drift, optimal 12, once).\n")


def test_intervals_cover_a_nonlinear_truth(script):
    """A few calibrations of the KR 270: most intervals cover, and the verdict counts chance."""
    truth = script("nonlinear_truth.py")
    found = truth.run_robot("KR 270, 2500 N", 12, linear=False, runs=4)
    assert found.mean >= 75
    held = truth.IntervalCoverage("robot", 60, False, 500, (94.0, 96.0), 2.0)
    assert held.holds
    assert not replace(held, shares=(92.0, 92.0)).holds
    assert not replace(held, alarms=8.0).holds


def test_shares_are_kept(script, tmp_path):
    """What was counted is read again, with shares of nothing; other places are other keys."""
    store = script("fault_store.py")
    table = script("fault_shares.py")
    found = {
        store.key(table.Cell("robot", 0, None, 12, repeats)): table.Shares(
            200, 3.0, float("nan"), 2.5, float("nan"), 1.0, 10.0 * repeats
        )
        for repeats in (1, 3)
    }
    assert len(found) == 2
    path = tmp_path / "shares.json"
    store.write(found, path)
    again = store.read(path)
    assert [repr(shares) for shares in again.values()] == [repr(x) for x in found.values()]
    assert list(again) == list(found)
    assert store.read(tmp_path / "none.json") == {}


def test_optimal_plans_can_be_measured(robots, script):
    """The kept plans have twelve experiments, and are feasible."""
    table = script("fault_table.py")
    for name, study in robots.items():
        plan = study.load_plan(table.HERE / "plans" / table.OPTIMAL[name])
        assert plan.experiments == 12
