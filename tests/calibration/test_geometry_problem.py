"""Designs for geometry: what candidates tell is what calibrations find."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from small_arm import ROBOT

import criteria
import edtk
from edtk.calibration.geometry_plan import geometry_problem
from edtk.fit import pose_rows as module
from edtk.fit.fit_geometry import fit_geometry
from edtk.fit.marker_positions import MarkerPositions
from edtk.measure.position_noise import PositionNoise
from edtk.study.study import Study

Array = NDArray[np.float64]

PLACES = {"A": [90, 10, 50], "B": [-30, 70, 40], "C": [0, -60, 100]}
STUDY = Study(
    robot=ROBOT,
    measurement={"sigma_mm": 0.05},
    parameters={"geometry": "all"},
    marker=[{"name": name, "position_mm": place} for name, place in PLACES.items()],
)
WITH_SPRINGS = STUDY.replace(
    parameters={"geometry": "all", "compliance": ["q1", "q2", "q3"]}, load={"F_N": [0, 0, -100]}
)
LOAD = np.array([0.0, 0.0, -100.0, 0.0, 0.0, 0.0])


def poses(number: int, seed: int = 0) -> Array:
    """Poses anywhere between the limits."""
    return np.random.default_rng(seed).uniform(-2.2, 2.2, (number, 6))


def test_candidates_tell_what_fits_find(monkeypatch: pytest.MonkeyPatch) -> None:
    """The inverse information of some poses is the covariance of a fit of them."""
    q = poses(20)
    found = geometry_problem(STUDY, q)
    assert found.problem.p == 33
    model = replace(found.model, start=np.eye(4))
    x = model.see(np.zeros(33), q, derivatives=False).points
    data = MarkerPositions(q, np.zeros((20, 6)), x, np.zeros((20, 3), dtype=int), tuple("ABC"))
    monkeypatch.setattr(module, "fit_model_error", lambda noise, *_, **__: noise)
    fit = fit_geometry(model, data, PositionNoise(0.05, np.zeros(6)))
    M = found.problem.information(np.ones(20))
    there = poses(5, seed=3)
    rows = found.rows(there).reshape(-1, 33)
    planned = np.einsum("rp,pq,rq->r", rows, np.linalg.inv(M), rows)
    seen = fit.fitted.model.see(fit.fitted.theta, there).jacobian
    own = 1e3 * (seen * fit.fitted.model.scales).reshape(-1, 33)
    told = np.einsum("rp,pq,rq->r", own, fit.fitted.covariance, own)
    np.testing.assert_allclose(told, planned, rtol=1e-6)


def test_rho0_is_the_error_of_tasks() -> None:
    """Its value is the root mean square distance that the covariance gives in the tasks."""
    found = geometry_problem(STUDY, poses(30))
    tasks = poses(7, seed=4)
    M = found.problem.information(np.ones(30))
    rows = found.rows(tasks).reshape(-1, 33)
    squares = np.einsum("rp,pq,rq->r", rows, np.linalg.inv(M), rows)
    assert found.rho0(tasks).value(M) == pytest.approx(np.sqrt(squares.sum() / 21), rel=1e-9)


def test_loaded_and_unloaded_visits_are_different_candidates() -> None:
    """Springs are told by loaded visits, geometry by both; without a load springs are open."""
    q = poses(40)
    both = np.concatenate([q, q])
    wrench = np.concatenate([np.zeros((40, 6)), np.tile(LOAD, (40, 1))])
    found = geometry_problem(WITH_SPRINGS, both, wrench)
    assert found.problem.p == 33 + 3 - 1  # the weight turns the first joint, upright, nowhere
    springs = [i for i, name in enumerate(found.problem.parameters) if name.startswith("k_")]
    assert [found.problem.parameters[i] for i in springs] == ["k_q2", "k_q3"]
    unloaded = found.problem.information(np.r_[np.ones(40), np.zeros(40)])
    loaded = found.problem.information(np.r_[np.zeros(40), np.ones(40)])
    assert not unloaded[springs].any()
    assert np.linalg.cond(loaded) < 1e12
    none = geometry_problem(WITH_SPRINGS, q)
    assert none.problem.p == 33


def test_plans_and_bounds_of_geometry() -> None:
    """Relaxation and exact plans are those of any problem, and the bound is below the plan."""
    found = geometry_problem(STUDY, poses(40))
    criterion = found.rho0(poses(20, seed=9))
    relaxed = edtk.relax(found.problem, criterion)
    plan = edtk.plan(found.problem, 14, criterion, most=1, starts=1)
    assert plan.counts.sum() == 14
    assert plan.headline().startswith(f"rho0 = {plan.value:.4g} mm")
    assert plan.counts.max() == 1
    rng = np.random.default_rng(0)
    random = [
        criterion.value(found.problem[rng.choice(40, 14, replace=False)].information(np.ones(14)))
        for _ in range(50)
    ]
    assert plan.value < min(random)
    assert plan.value >= relaxed.value / np.sqrt(14) * (1 - 1e-6)


def test_nuisances_are_eliminated_by_interest() -> None:
    """Geometry alone is of interest: base, tools and springs are eliminated, not left out."""
    found = geometry_problem(STUDY, poses(30))
    M = found.problem.information(np.ones(30))
    geometry = [i for i, name in enumerate(found.problem.parameters) if name.startswith("q")]
    K = np.eye(33)[:, geometry]
    criterion = criteria.Interest(criteria.create("A"), K)
    direct = np.trace(np.linalg.inv(M)[np.ix_(geometry, geometry)])
    whole = criteria.create("A").value(M)
    assert criterion.value(M) == pytest.approx(direct, rel=1e-9)
    assert criterion.value(M) < whole


def test_wrong_poses_and_studies_are_named() -> None:
    """A study without [parameters], and poses of another robot, are refused."""
    plain = Study(
        robot=ROBOT,
        tool={"position_mm": [100, 0, 0]},
        load={"F_N": [0, 0, -100]},
        measurement={"sigma_mm": 0.05},
        joints={"unknown": ["q2"]},
    )
    with pytest.raises(edtk.UserError, match=r"\[parameters\]"):
        geometry_problem(plain, poses(3))
    with pytest.raises(ValueError, match=r"expected \(n, 6\)"):
        geometry_problem(STUDY, poses(3)[:, :5])
