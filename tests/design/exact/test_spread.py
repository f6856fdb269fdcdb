"""Repeats that become poses of their own, far enough apart to have errors of their own."""

from dataclasses import replace

import numpy as np
import pytest
from arm import arm
from noisy import NOISY

import criteria
from edtk.design.candidate_source import sample_feasible
from edtk.design.exact.spread import divided, spread
from edtk.robots.robot import joint_distance
from edtk.study.plan_study import plan_study

CRITERION = criteria.create("D")


@pytest.fixture(autouse=True)
def few_passes(monkeypatch):
    """Starts here are far from optima, to which many passes would lead."""
    monkeypatch.setattr("edtk.design.exact.spread.SPREADING_PASSES", 2)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["kr270", "odd"])
def test_spread(name):
    """Poses are feasible and keep the distance, and the plan is worth more than with repeats."""
    space = NOISY[name]
    x = sample_feasible(space, 3, 1)
    repeats = np.array([3.0, 1.0, 2.0])
    many, once = divided(x, repeats)
    kept = space.plan(x[1:2], np.ones(1, dtype=int))
    apart = spread(space, CRITERION, many, once, kept)
    assert len(apart) == 6
    np.testing.assert_array_equal(once, 1.0)
    assert space.at(apart).feasible.all()
    q = apart[:, : len(space.fixed)]
    kinds = np.array([joint.kind == "prismatic" for joint in space.model.robot.joints])
    away = np.array([joint_distance(q, own, kinds) for own in q]) + 9 * np.eye(6)
    assert away.min() >= space.noise.within
    assert joint_distance(q, kept.q, kinds).min() >= space.noise.within
    plan = space.plan(apart, once.astype(int))
    before = CRITERION.cost(space.information(space.plan(x, repeats.astype(int))))
    after = CRITERION.cost(space.information(plan))
    assert after < before
    np.testing.assert_allclose(CRITERION.cost(space.alone.information(plan)), after, rtol=1e-12)


def test_no_room():
    """Where no pose is far enough away repeats stay together."""
    space = NOISY["kr270"]
    crowded = replace(space, noise=replace(space.noise, within=50.0))
    x = sample_feasible(space, 2, 3)
    many, once = divided(x, np.array([2.0, 1.0]))
    np.testing.assert_array_equal(many, x[[0, 0, 1]])
    np.testing.assert_array_equal(spread(crowded, CRITERION, many, once), many)


def test_divided_many():
    """Beyond a number of poses visits stay repeats, evenly, and none is lost."""
    x = np.arange(6.0).reshape(3, 2)
    many, times = divided(x, np.array([1000.0, 0.0, 3001.0]))
    assert len(many) == 400
    assert times.sum() == 4001
    assert set(times) <= {10.0, 11.0, 9.0}
    np.testing.assert_array_equal(np.unique(many, axis=0), x[[0, 2]])


@pytest.mark.slow
def test_limited_poses():
    """Three poses for four visits are three poses: two that would come out equal keep apart."""
    noise = {
        "tracker_position_mm": [4000, -3000, 1200],
        "along": [10, 5],
        "across": [15, 6],
        "discrepancy_mm": 0.1,
    }
    found = plan_study(arm(measurement={}, noise=noise), 4, "D", distinct=3)
    assert sorted(found.plan.repeats) == [1, 1, 2]
    q = found.plan.q
    away = [joint_distance(q, own, np.zeros(2, dtype=bool)) for own in q]
    assert (np.array(away) + 9 * np.eye(3)).min() >= np.deg2rad(5)
