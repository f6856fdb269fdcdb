"""Markers that some poses place on the tool: errors by Monte Carlo, and closed forms of bands."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from geometry_sheets import NAMES, OFFSETS, PLACE, Array, run
from scipy.spatial.transform import Rotation
from small_arm import ROBOT

import edtk
from edtk.calibration.prediction import tool_from_rows
from edtk.fit.fitted_geometry import FittedGeometry
from edtk.fit.marker_positions import MarkerPositions
from edtk.measure.position_noise import PositionNoise
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry

STUDY = Study(
    robot=ROBOT,
    measurement={"sigma_mm": 0.02, "rows": "pose", "sigma_deg": 0.005},
    noise={"repeatability_deg": 0.01},
    parameters={"geometry": "all"},
    marker=[{"name": "A", "position_mm": [90, 10, 50]}],
)
ELSEWHERE = np.array([0.04, -0.09, 0.13])  # [m] the new place, from the old one
TURNED = Rotation.from_rotvec([0.5, -1.1, 0.8]).as_matrix()


def fitted(rows: str, seed: int = 0) -> FittedGeometry:
    """A geometry as if identified, with a covariance of a tenth of a unit and some correlation."""
    model = StudyGeometry.of(STUDY).model
    model = replace(model, start=PLACE, rows=rows)
    rng = np.random.default_rng(seed)
    theta = rng.normal(0, 0.5, model.p) * model.scales
    mixed = np.eye(model.p) + 0.3 * rng.standard_normal((model.p, model.p)) / model.p**0.5
    turn = None if rows == "position" else 0.09
    noise = PositionNoise(0.02, np.full(6, 0.1), 0.01, np.full(6, 0.2), turn=turn, model_turn=0.05)
    covariance = 0.01 * mixed @ mixed.T
    return FittedGeometry(
        model, theta, covariance, (), np.zeros((model.p, 0)), noise, model.offsets, np.zeros((1, 3))
    )


def visits(poses: int = 7, seed: int = 1) -> Array:
    """Poses [rad]; the first one is visited twice, and again as a test."""
    q = np.random.default_rng(seed).uniform(-1.7, 1.7, (poses, 6))
    return q[[0, 0, 1, 2, 0, *range(3, poses)]]


def measured(truth: FittedGeometry, q: Array, rng: np.random.Generator) -> MarkerPositions:
    """A day of the marker at its new place, with all errors that the noise has."""
    model, noise = truth.model, truth.noise
    _, pose = np.unique(q, axis=0, return_inverse=True)
    own = [rng.standard_normal((pose.max() + 1, size))[pose] for size in (6, 3, 3)]
    again = [rng.standard_normal((len(q), size)) for size in (6, 3, 3)]
    bent = q + 1e-3 * (noise.model_joints * own[0] + noise.joints * again[0])
    seen = model.see(truth.theta, bent, derivatives=False)
    x = seen.points[:, 0] + seen.turns[:, 0] @ ELSEWHERE
    x = x + 1e-3 * (noise.model_white * own[1] + noise.reading * again[1])
    turns = None
    if noise.turn is not None:
        vectors = 1e-3 * (noise.model_turn * own[2] + noise.turn * again[2])
        turns = (Rotation.from_rotvec(vectors).as_matrix() @ seen.turns[:, 0] @ TURNED)[:, None]
    row = np.arange(len(q))[:, None]
    return MarkerPositions(q, np.zeros((len(q), 6)), x[:, None], row, ("A",), turns)


def test_errors_are_as_large_as_the_bands_say() -> None:
    """The mean square of errors over their variance is one, coordinate by coordinate."""
    known = fitted("pose")
    q = visits()
    placing = np.arange(len(q))[:, None] < 4
    rng = np.random.default_rng(3)
    root = np.linalg.cholesky(known.covariance)
    squares = []
    for _ in range(120):
        theta = known.theta + known.model.scales * (root @ rng.standard_normal(known.model.p))
        day = measured(replace(known, theta=theta), q, rng)
        found = tool_from_rows(known, day, placing, None)
        errors = (day.measured - found.points) / found.std
        assert day.turns is not None
        assert found.turn_std is not None
        apart = (day.turns @ np.swapaxes(found.turns, -1, -2))[:, 0]
        turned = Rotation.from_matrix(apart).as_rotvec()[:, None]
        errors = np.concatenate([errors, turned / found.turn_std], axis=-1)
        squares.append(errors[4:, 0] ** 2)
    mean = np.mean(squares, axis=0)
    # Means of 120 squares of normal numbers: within 0.13 of one, at one standard deviation.
    assert np.abs(mean - 1).max() < 4.5 * np.sqrt(2 / 120)
    assert np.mean(mean) == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("rows", ["position", "pose"])
def test_where_the_old_marker_sat_does_not_count(rows: str) -> None:
    """Errors of the tool's parameters cancel, and any place to begin from predicts the same."""
    known = fitted(rows)
    q = visits()
    day = measured(known, q, np.random.default_rng(0))
    placing = np.arange(len(q))[:, None] < 3
    found = tool_from_rows(known, day, placing, None)
    tool = np.array([one.place == "tool" for one in known.model.parameters])
    wide = known.covariance + 100 * np.diag(tool)
    elsewhere = replace(known.model, offsets=known.model.offsets + OFFSETS[[1]])
    for other in (replace(known, covariance=wide), replace(known, model=elsewhere)):
        again = tool_from_rows(other, day, placing, None)
        np.testing.assert_allclose(again.points, found.points, atol=1e-12)
        np.testing.assert_allclose(again.turns, found.turns, atol=1e-12)
        np.testing.assert_allclose(again.std, found.std, rtol=1e-7)


def test_bands_of_white_readings_alone() -> None:
    """A mean of s readings adds ``1/s`` of a reading's variance; repeats leave the model's."""
    known = fitted("position")
    nothing = replace(known, covariance=0 * known.covariance)
    q = visits()
    day = measured(known, q, np.random.default_rng(0))
    white = 0.03
    for s, left in ((1, 1.0), (2, 1.0), (4, 6 / 16)):
        noise = PositionNoise(0.02, np.zeros(6), white, np.zeros(6))
        found = tool_from_rows(
            replace(nothing, noise=noise), day, np.arange(len(q))[:, None] < s, None
        )
        reading = 0.02**2 * (1 + 1 / s)
        expected = reading + white**2 * (1 + left)
        np.testing.assert_allclose(1e6 * found.std[5:] ** 2, expected, rtol=1e-9)
        # The pose that places the marker errs by what the model leaves out as it did.
        count = min(s, 2)
        own = (1 - count / s) ** 2 + (s - count) / s**2
        np.testing.assert_allclose(1e6 * found.std[4] ** 2, reading + white**2 * own, rtol=1e-9)


def test_rows_of_full_poses_place_a_tool(tmp_path: Path) -> None:
    """As a user does it: another tool with its own orientation, and bands that hold its tests."""
    rng = np.random.default_rng(2)
    truth = fitted("pose")
    old = replace(truth, noise=replace(truth.noise, joints=np.full(6, 0.02)))
    q = rng.uniform(-1.7, 1.7, (45, 6))
    day = measured(old, q, rng)
    assert day.turns is not None
    found = edtk.identify(STUDY, sheet(tmp_path / "day.csv", q[:30], day))
    (tmp_path / "k.json").write_text(json.dumps(found.to_dict()))
    STUDY.to_toml(tmp_path / "study.toml")
    fixed = Rotation.from_rotvec([0.2, 0.9, -0.4]).as_matrix()
    shifted = replace(
        day[np.arange(30, 45)],
        measured=(day.measured + (day.turns @ [0.01, 0.05, 0.02]))[30:],
        turns=(day.turns @ fixed)[30:],
    )
    other = sheet(tmp_path / "other.csv", q[30:], shifted)
    words = ("predict", tmp_path / "study.toml", tmp_path / "k.json", other, "--json")
    code, out, err = run(*words, "--tool-rows", 4)
    assert (code, err) == (0, "")
    told = json.loads(out)
    plain = json.loads(run(*words)[1])
    assert plain["mean_mm"] > 50
    assert plain["turn_rms_deg"] > 30
    assert told["rms_mm"] < 0.4
    assert told["turn_rms_deg"] < 0.08
    assert told["share_inside"] > 0.85
    assert [one["test"] for one in told["positions"]] == [False] * 4 + [True] * 11


def test_rows_without_orientations_place_positions_alone(tmp_path: Path) -> None:
    """Positions place the point; how the tool is turned nobody told, and no band pretends."""
    known = fitted("pose")
    q = visits()
    day = measured(known, q, np.random.default_rng(0))
    placing = np.arange(len(q))[:, None] < 3
    whole = tool_from_rows(known, day, placing, None)
    assert day.turns is not None
    alone = replace(day, turns=np.full_like(day.turns, np.nan))
    found = tool_from_rows(known, alone, placing, None)
    np.testing.assert_allclose(found.points, whole.points)
    np.testing.assert_allclose(found.std, whole.std)
    assert found.turn_half is None


def sheet(path: Path, q: Array, day: MarkerPositions) -> Path:
    """Write some visits of a day."""
    assert day.turns is not None
    some = slice(0, len(q))
    vectors = Rotation.from_matrix(day.turns[some, 0]).as_rotvec(degrees=True)
    cells = np.hstack([np.rad2deg(q), 1e3 * day.measured[some, 0], vectors])
    header = [*NAMES, "x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg"]
    np.savetxt(path, cells, delimiter=",", header=",".join(header), comments="")
    return path
