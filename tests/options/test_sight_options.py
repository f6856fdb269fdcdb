"""Markers that are read in some poses only, in all that is asked of either kind of study."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import edtk
from edtk import Study
from edtk.calibration.geometry_question import GeometryQuestion
from edtk.calibration.planned import plan_noise, planned_measurements
from edtk.design.candidate_source import CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.design.enclosure.robot_polynomials import polynomials_of
from edtk.design.plan import Plan
from edtk.fit.least_squares import estimate
from edtk.system.errors import UserError
from edtk.system.typing import Array
from edtk.verbs.template import template

MARKERS = [
    {"name": "a", "position_mm": [0, 100, 0], "normal": [0, 1, 0], "acceptance_deg": 60},
    {"name": "b", "position_mm": [0, -100, 0], "normal": [1, 0, 0], "acceptance_deg": 60},
    {"name": "c", "position_mm": [50, 0, 100]},
]
TRACKER = {"tracker_position_mm": [4500, 2500, 1200], "along": [10, 0.4], "across": [15, 6]}
CAMERA = {"position_mm": [4500, 2500, 1200], "field_of_view_deg": 40}
KEYS: dict[str, Any] = {
    "robot": "kuka_kr270",
    "tool": {"position_mm": [611.5, 0, -460]},
    "measurement": {"sigma_mm": 0.01},
    "noise": {**TRACKER, "repeatability_deg": 0.002},
    "marker": MARKERS,
    "sight": {"range_mm": [500, 15000]},
    "candidates": 60,
    "sizes": [6],
}
SPRINGS = Study(
    **KEYS,
    load={"F_N": [0, 0, -2500]},
    joints={"unknown": ["q2", "q3", "q4", "q5", "q6"], "fixed_deg": {"q1": 0}},
    simulation={"compliance_rad_per_Nm": {f"q{j}": 1e-6 for j in range(2, 7)}},
)
GEOMETRY = Study(**KEYS, parameters={"geometry": ["zeros"], "base": True, "tool": True})
WRENCH = np.array([0, 0, -2500.0, 0, 0, 0])


def space_of(study: Study) -> DesignSpace:
    """The design space of either kind of study."""
    return study.space if study is SPRINGS else GeometryQuestion.of(study).space


def poses(space: DesignSpace, count: int) -> Plan:
    """Random feasible poses, a visit each."""
    x = CandidateSource(space, 0, workers=1).take(count).x
    return space.plan(x, np.ones(len(x), dtype=int))


def dense(study: Study, space: DesignSpace, plan: Plan) -> tuple[Array, Array]:
    """Rows (m, r, p) and covariances (m, r, r) with all markers, whether or not they are read."""
    if study is SPRINGS:
        frames = study.model.frames(plan.q)
        assert study.noise is not None
        V = study.noise.covariance_of(study.model, frames, WRENCH)
        return study.model.regressor(plan.q, WRENCH), np.moveaxis(V, -1, 0)
    rows = space._rows  # type: ignore[attr-defined]
    every = type(rows)(rows.model, rows.loads, rows.noise)
    plain = type(rows)(rows.model, rows.loads)
    return plain(plan.q, plan.wrench), every.covariance(plan.q, plan.wrench)


@pytest.mark.cell("`[sight]`, and `normal` of a `[[marker]]`", "springs", "parameters")
@pytest.mark.parametrize("study", [SPRINGS, GEOMETRY], ids=["springs", "parameters"])
def test_rows_are_struck_out_before_they_are_whitened(study: Study) -> None:
    """Information is that of the rows that are read, with their own part of the covariance; what
    is left of whitened rows of all would be more.
    """
    space = space_of(study)
    plan = poses(space, 40)
    assert space.sight is not None
    read = space.sight.rows(plan.q)
    assert 0 < read.mean() < 1
    A, V = dense(study, space, plan)
    expected = np.zeros((space.p, space.p))
    for own, cov, there in zip(A, V, read, strict=True):
        some = own[there]
        expected += some.T @ np.linalg.solve(cov[np.ix_(there, there)], some)
    np.testing.assert_allclose(space.information(plan), expected, rtol=1e-9, atol=1e-9)
    x = CandidateSource(space, 0, workers=1).take(40).x
    rows = space.at(x).regressor
    np.testing.assert_allclose(np.einsum("krp,krq->pq", rows, rows), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("study", [SPRINGS, GEOMETRY], ids=["springs", "parameters"])
def test_rows_that_are_read_have_their_slopes(study: Study) -> None:
    """Slopes of information are its differences, where the same markers are read."""
    space = space_of(study)
    x = CandidateSource(space, 0, workers=1).take(12).x
    G = np.random.default_rng(0).standard_normal((space.p, space.p))
    G = G + G.T
    found = space.at(x).slope(space.at(x).regressor @ G)

    def value(x: Array) -> Array:
        A = space.at(x).regressor
        return np.asarray(np.einsum("krp,pq,krq->k", A, G, A) / 2)

    for j in space.movable:
        step = 1e-6 * np.eye(space.size)[j]
        by_difference = (value(x + step) - value(x - step)) / 2e-6
        size = np.abs(found).max()
        np.testing.assert_allclose(found[:, j] / size, by_difference / size, atol=1e-6)


def test_what_a_plan_promises_knows_what_is_read() -> None:
    """The readings of a plan tell as much by themselves as its information says."""
    plan = poses(SPRINGS.space, 12)
    M = SPRINGS.information(plan)
    data = planned_measurements(SPRINGS, plan)
    noises = [(data.regressor(SPRINGS.model), data.noise)]
    noises.append((SPRINGS.model.regressor(plan.q, plan.wrench), plan_noise(SPRINGS, plan)))
    for A, noise in noises:
        fit = estimate(A, np.zeros(A.shape[:2]), noise, SPRINGS.model.parameters)
        np.testing.assert_allclose(fit.covariance @ M, np.eye(5), atol=1e-9)


def test_sheets_have_rows_of_what_is_read(tmp_path: Path) -> None:
    """Markers that are hidden have no row, and the filled sheet is identified."""
    plan = poses(SPRINGS.space, 12)
    table = template(SPRINGS, plan)
    q = np.array(SPRINGS.robot.within_one_turn(plan.q))
    assert SPRINGS.sight is not None
    assert len(table) == SPRINGS.sight.seen(q).sum() < 36
    k = SPRINGS.compliances
    data = pd.DataFrame(table)
    measured = _filled(data, k)
    path = tmp_path / "sheet.csv"
    measured.to_csv(path, index=False)
    fit = edtk.identify(SPRINGS.replace(noise=TRACKER), path).fit
    std = np.sqrt(np.diag(fit.covariance))
    assert (np.abs(fit.k - k) < 4 * std).all()
    assert (std < 0.2 * k).all()


def _filled(table: pd.DataFrame, k: Array) -> pd.DataFrame:
    """A sheet with what an arm of compliances k shows, and small errors."""
    names = [f"q{j}_deg" for j in range(1, 7)]
    q = np.deg2rad(table[names].to_numpy())
    d = 1e3 * SPRINGS.model.regressor(q, WRENCH) @ k
    d += 0.01 * np.random.default_rng(0).standard_normal(d.shape)
    first = 3 * table["marker"].map({"a": 0, "b": 1, "c": 2}).to_numpy()
    for axis, name in enumerate(("dx_mm", "dy_mm", "dz_mm")):
        table[name] = d[np.arange(len(table)), first + axis]
    return table


def test_sheets_of_positions_have_rows_of_what_is_read() -> None:
    """So they have where geometry is asked for."""
    space = space_of(GEOMETRY)
    plan = poses(space, 12)
    assert space.sight is not None
    assert len(template(GEOMETRY, plan)) == space.sight.seen(plan.q).sum() < 36


@pytest.mark.parametrize("study", [SPRINGS, GEOMETRY], ids=["springs", "parameters"])
def test_a_second_implementation_recomputes_what_is_read(study: Study, tmp_path: Path) -> None:
    """A certificate has eyes and markers, and no longer holds where one of them looks away."""
    path = tmp_path / "certificate.json"
    edtk.relax(study, certificate=path)
    assert edtk.verify(path).valid
    content = json.loads(path.read_text())
    content["setting"]["sight"]["markers"][2] |= {"normal": [0, 0, 1], "acceptance": 0.5}
    path.write_text(json.dumps(content))
    assert not edtk.verify(path).valid


@pytest.mark.cell("`[sight] all_markers`", "springs", "parameters")
@pytest.mark.parametrize("study", [SPRINGS, GEOMETRY], ids=["springs", "parameters"])
def test_a_study_may_ask_for_all_markers(study: Study) -> None:
    """Then every pose of a design shows all of them."""
    markers = [MARKERS[0] | {"acceptance_deg": 90}, MARKERS[1] | {"acceptance_deg": 90}]
    every = study.replace(marker=markers, sight={"all_markers": True})
    space = every.space if study is SPRINGS else GeometryQuestion.of(every).space
    x = CandidateSource(space, 0, workers=1).take(20).x
    assert space.sight is not None
    assert space.sight.seen(x[:, :6]).all()
    relaxed = edtk.relax(every)
    assert space.sight.seen(relaxed.x[:, :6]).all()


@pytest.mark.cell(
    "`[sight]` beside a `[scene]`, whose bodies hide markers", "springs", "parameters"
)
@pytest.mark.parametrize("study", [SPRINGS, GEOMETRY], ids=["springs", "parameters"])
def test_what_a_body_hides_has_no_rows(study: Study, tmp_path: Path) -> None:
    """A wall hides markers, which then tell nothing; a certificate with it holds."""
    box = {"name": "wall", "size_mm": [400, 400, 3000], "position_mm": [2900, 1500, 1500]}
    behind = study.replace(scene={"box": [box]})
    space = behind.space if study is SPRINGS else GeometryQuestion.of(behind).space
    plan = poses(space_of(study), 60)
    whole = space_of(study).sight
    assert whole is not None
    assert space.sight is not None
    less = whole.seen(plan.q) & ~space.sight.seen(plan.q)
    assert less.any()
    words = [
        str(row[k])
        for row, own in zip(space.sight.hidden(plan.q), less, strict=True)
        for k in np.flatnonzero(own)
    ]
    assert all(one.startswith("hidden by ") for one in words)
    path = tmp_path / "certificate.json"
    edtk.relax(behind, certificate=path)
    assert edtk.verify(path).valid


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"noise": None}, "sight: expected to know where the instrument stands: noise.tracker_pos"),
        (
            {"noise": None, "sight": {"range_mm": [1, 9], "camera": [CAMERA]}},
            "sight.range_mm: is said of a tracker; expected to know where the instrument stands",
        ),
        ({"noise": None, "sight": None}, "marker.0.normal: expected to know where the instrument"),
        (
            {"marker": [{"position_mm": [0, 0, 0], "acceptance_deg": 30}]},
            "marker.0.normal: expected",
        ),
        ({"marker": [MARKERS[0] | {"normal": [0, 0, 0]}]}, "marker.0.normal: expected a direction"),
        ({"sight": {"range_mm": [9000, 500]}}, "sight.range_mm: expected the least one first"),
        ({"sight": {"facing": [0, 0, 0]}}, "sight.facing: expected a direction"),
        (
            {"sight": {"range_mm": [0, 1000]}},
            "marker: no pose shows 'a' to the tracker; most often",
        ),
    ],
)
def test_what_cannot_be_seen_is_said_in_one_line(keys: dict[str, Any], message: str) -> None:
    """Sights without an instrument, halves of a reflector, and markers that nothing sees."""
    with pytest.raises(UserError) as error:
        SPRINGS.replace(**keys)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_a_camera_sees_without_a_tracker() -> None:
    """A camera has a place of its own; white noise is enough then."""
    study = SPRINGS.replace(noise=None, sight={"camera": [CAMERA]})
    assert study.sight is not None
    assert [eye.name for eye in study.sight.eyes] == ["camera 1"]
    plan = poses(study.space, 20)
    A = study.model.regressor(plan.q, WRENCH) * study.sight.rows(plan.q)[..., None] / 1e-5
    np.testing.assert_allclose(study.information(plan), np.einsum("krp,krq->pq", A, A))


@pytest.mark.parametrize("study", [SPRINGS, GEOMETRY], ids=["springs", "parameters"])
def test_a_bound_over_all_poses_counts_every_marker(study: Study) -> None:
    """Its polynomials tell at least as much as what is read, and are not taken for equal to it."""
    plain = study.replace(noise=None, measurement={"sigma_mm": 0.02}, sight={"camera": [CAMERA]})
    space = plain.space if study is SPRINGS else GeometryQuestion.of(plain).space
    polynomials = polynomials_of(space)
    assert not polynomials.is_exact
    every = polynomials_of(replace(space, sight=None))
    assert every.is_exact
    assert every.kept == polynomials.kept
