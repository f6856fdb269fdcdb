"""A weight that nobody told, and a frame that moved a little, amid errors of a robot, are named."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from geometry_sheets import NAMES, OFFSETS, PLACE, STUDY, Array, by_pose

import edtk
from edtk.calibration.geometric_calibration import GeometricCalibration
from edtk.findings.causes.faults import cause_of
from edtk.findings.fit_rows import FitRows
from edtk.findings.gross_errors import WRONG
from edtk.findings.moved_frame import lost_load, moved_frame, untold_load
from edtk.fit.fit_geometry import fit_geometry
from edtk.fit.fitted_geometry import GeometricFit
from edtk.fit.marker_positions import MarkerPositions
from edtk.study.study_geometry import StudyGeometry

POSES = 36
GEARS = 3e-4  # [rad] of each of three waves a turn, in every joint
BENT = 4e-3  # [rad/m] compliance of q2 and q3 times the weight: a millimetre or two


def day(
    seed: int, bent: float = 0.0, moved: float = 0.0, loaded: Array | float = 1.0
) -> tuple[Array, Array]:
    """Joint angles and positions of a robot whose gears are not round.

    Args:
        seed: Of everything.
        bent: Compliance of q2 and q3 times a weight at the tool [rad/m].
        moved: How far the frame moves at the pose 14 [m].
        loaded: Shares of the weight (m,) that the poses are under.
    """
    rng = np.random.default_rng(seed)
    model = replace(StudyGeometry.of(STUDY).model, offsets=OFFSETS, start=PLACE)
    theta = rng.normal(0, 0.7, model.p) * model.scales
    q = np.deg2rad(np.round(rng.uniform(-100, 100, (POSES, 6)), 3))
    waves = np.arange(1, 4) * q[..., None] + rng.uniform(0, 2 * np.pi, (6, 3))
    shown = q + (rng.normal(0, GEARS, (6, 3)) * np.sin(waves)).sum(axis=-1)
    down = -model.robot.frames(q, ()).linear_of_each[:, 2].T
    shown += (bent * down * np.isin(np.arange(6), [1, 2])) * np.reshape(loaded, (-1, 1))
    x = model.see(theta, shown, derivatives=False).points + rng.normal(0, 2e-5, (POSES, 3, 3))
    x[14:] += moved * np.array([0.6, -0.64, 0.48])
    return q, x


@cache
def fit_of(seed: int, bent: float = 0.0, moved: float = 0.0) -> GeometricFit:
    """The fit of a day."""
    q, x = day(seed, bent, moved)
    row = np.arange(POSES)[:, None] * np.ones(3, dtype=int)
    data = MarkerPositions(q, np.zeros((POSES, 6)), x, row, tuple("ABC"))
    setting = StudyGeometry.of(STUDY)
    return fit_geometry(setting.model, data, setting.noise)


def test_a_weight_is_named_with_the_joints_that_it_bends() -> None:
    """It explains most of what the fit leaves, though the fit has taken some of it for geometry."""
    found = untold_load(FitRows.of(fit_of(0, bent=BENT)))
    assert found is not None
    assert found.joints == ("q2", "q3")
    assert 0.5 < found.explained < 1


def test_a_frame_that_moved_by_the_size_of_other_errors_is_named() -> None:
    """Half a millimetre is found at its pose, where the noise that was fitted had hidden it."""
    found = moved_frame(FitRows.of(fit_of(2, moved=5e-4)))
    assert found is not None
    assert (found.first, found.end) == (14, POSES)
    assert found.shift == pytest.approx(5e-4, rel=0.3)


def test_sound_days_are_not_doubted() -> None:
    """Gears that are not round are no weight and no motion."""
    assert untold_load(FitRows.of(fit_of(0))) is None
    assert moved_frame(FitRows.of(fit_of(0))) is None


def test_the_verdict_says_what_to_ask_for(tmp_path: Path) -> None:
    """A warning names the joints, and a study that asks for their springs has none."""
    q, x = day(0, bent=BENT)
    found = edtk.identify(STUDY, by_pose(tmp_path / "day.csv", np.rad2deg(q), 1e3 * x))
    named = [doubt.words for doubt in found.findings if doubt.kind == "untold_load"]
    assert len(named) == 1
    assert 'ask for compliance = ["q2", "q3"]' in named[0]
    assert found.verdict == "usable"


PARTS = {
    "first half": np.arange(POSES) < POSES // 2,
    "second half": np.arange(POSES) >= POSES // 2,
    "every other": np.arange(POSES) % 2 == 1,
    "any": np.random.default_rng(3).random(POSES) < 0.5,
}


@pytest.mark.parametrize("part", PARTS)
def test_a_weight_in_half_of_the_poses_is_named_with_their_rows(part: str, tmp_path: Path) -> None:
    """Whichever half it is; not as a frame that moved or drifts."""
    loaded = PARTS[part]
    q, x = day(1, bent=2 * BENT, loaded=loaded.astype(float))
    found = edtk.identify(STUDY, by_pose(tmp_path / "day.csv", np.rad2deg(q), 1e3 * x))
    kinds = {doubt.kind for doubt in found.findings}
    assert not kinds & {"frame_moved", "drift", "growth"}
    (named,) = [doubt for doubt in found.findings if doubt.kind == "untold_load"]
    told = np.isin(np.arange(POSES), named.rows)
    assert (told == loaded).mean() > 0.9
    assert "bent q2, q3 there alone" in named.words


SPRUNG = STUDY.replace(parameters={"compliance": ["q2", "q3"], "base": True, "tool": True})
NEWTON = 50.0  # of a load, without which each pose is visited first


def visits_of(
    bent: float,
    lost: Array,
    held: float = 0.0,
    stated: Array | float = 1.0,
    softer: float = 0.0,
) -> tuple[Array, Array, Array]:
    """Joint angles and loads of pairs of visits, and positions, of an arm that lacks some loads.

    Args:
        bent: Compliance of q2 and q3 times the load [rad/m].
        lost: Share of the load on the sheet that each of the pairs (m,) lacks.
        held: What friction holds of each joint's load [N m].
        stated: The load on the sheet (m,) over the usual one.
        softer: By how much springs are softer under the largest torque than under none.
    """
    setting = StudyGeometry.of(SPRUNG)
    assert setting.loads is not None
    rng = np.random.default_rng(4)
    model = replace(StudyGeometry.of(STUDY).model, offsets=OFFSETS, start=PLACE)
    q = np.repeat(np.round(rng.uniform(-100, 100, (len(lost), 6)), 3), 2, axis=0)
    wrench = np.zeros((len(q), 6))
    wrench[1::2, 2] = -NEWTON * stated
    acts = wrench * (1.0 - np.repeat(lost, 2))[:, None]
    sprung = bent / NEWTON * np.isin(np.arange(6), [1, 2])
    torque = setting.loads(np.deg2rad(q), acts)
    torque = np.sign(torque) * np.maximum(np.abs(torque) - held, 0.0)
    torque = torque * (1 + softer * (torque / np.abs(torque[:, 1:3]).max()) ** 2)
    shown = np.deg2rad(q) + sprung * torque
    x = model.see(np.zeros(model.p), shown, derivatives=False).points
    return q, wrench, 1e3 * x + rng.normal(0, 0.02, x.shape)


def sheet_of(q: Array, wrench: Array, x: Array) -> pd.DataFrame:
    """The sheet of some visits."""
    names = [*NAMES, "Fx_N", "Fy_N", "Fz_N", *(f"{m}{a}_mm" for m in "ABC" for a in "xyz")]
    return pd.DataFrame(np.hstack([q, wrench[:, :3], x.reshape(len(q), -1)]), columns=names)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bent", "pairs"), [(2e-2, []), (3e-3, [*range(7, 14)]), (2e-2, [0, 3, 4, 8, 11, 13])]
)
def test_a_load_that_visits_lack_is_named_with_their_rows(bent: float, pairs: list[int]) -> None:
    """Whether it moves the arm by parts of a millimetre or by as much as a wrong pose."""
    lost = np.isin(np.arange(14), pairs)
    q, wrench, x = visits_of(bent, lost)
    found = edtk.identify(SPRUNG, sheet_of(q, wrench, x))
    named = [one for one in found.findings if one.kind == "unloaded_rows"]
    if not lost.any():
        assert (named, found.verdict, found.causes) == ([], "good", ())
        return
    assert [one.rows for one in named] == [tuple((2 * np.flatnonzero(lost) + 1).tolist())]
    assert "the robot moves as if it were not loaded there" in named[0].words
    assert not {one.kind for one in found.findings} & {"gross", "typed", "outliers"}
    assert [(one.cause, one.size, one.rows) for one in found.causes] == [
        ("unloaded_rows", 0.0, named[0].rows)
    ]
    assert named[0].data["factor"] == 0.0
    assert cause_of(named[0]) == found.causes[0]
    assert found.verdict == "bad"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bent", "lost"),
    [
        (5e-3, np.where(np.arange(14) < 7, 0.0, 0.3)),
        (2e-2, np.where(np.arange(14) < 7, 0.0, 0.1)),
        (5e-3, np.where(np.arange(14) < 7, 0.0, -0.5)),
        (2e-2, np.where(np.isin(np.arange(14), [1, 4, 6, 9, 12]), -1.0, 0.0)),
    ],
)
def test_a_load_of_another_size_is_not_said_to_be_lacking(bent: float, lost: Array) -> None:
    """Neither of these rows nor of all others, beside which more load looks like less."""
    found = edtk.identify(SPRUNG, sheet_of(*visits_of(bent, lost)))
    assert "unloaded_rows" not in {one.kind for one in found.findings}
    assert "unloaded_rows" not in {one.cause for one in found.causes}


@pytest.mark.slow
@pytest.mark.parametrize("softer", [1.0, -0.5])
def test_springs_of_another_law_lack_no_load(softer: float) -> None:
    """They move the arm more, or less, under the larger load than others tell."""
    stated = np.where(np.arange(14) % 2, 2.0, 0.4)
    found = edtk.identify(
        SPRUNG, sheet_of(*visits_of(1e-2, np.zeros(14), stated=stated, softer=softer))
    )
    assert "unloaded_rows" not in {one.kind for one in found.findings}


def test_a_lacking_load_is_as_likely_whatever_its_size() -> None:
    """Of a load a hundred times as large, springs that bend as much are as much stiffer."""
    lost = (np.arange(14) >= 7).astype(float)
    usual = []
    for times in (0.1, 10.0):
        found = edtk.identify(SPRUNG, sheet_of(*visits_of(8e-4 / times, lost, stated=times)))
        assert isinstance(found, GeometricCalibration)
        lacking = lost_load(FitRows.of(found.fit, StudyGeometry.of(SPRUNG).loads))
        assert lacking is not None
        assert np.flatnonzero(lacking.loaded).tolist() == list(range(15, 28, 2))
        usual.append(times * lacking.usual)
    assert usual[0] == pytest.approx(usual[1])


@pytest.mark.slow
def test_wrong_poses_under_loads_that_agree_excuse_nothing() -> None:
    """Two with the same error of a joint draw a fit with them: it is far from all others then."""
    q, wrench, x = visits_of(2e-3, np.zeros(8))
    q[[3, 9], 0] += 7
    found = edtk.identify(SPRUNG, sheet_of(q, wrench, x))
    assert found.left_out == (3, 9)
    assert found.verdict == "usable"


@pytest.mark.slow
def test_a_pose_that_its_load_moves_far_is_not_typed_wrongly() -> None:
    """Friction holds a part of small loads: others then tell springs that move the arm too little.

    A pose that was written wrongly is named as before.
    """
    q, wrench, x = visits_of(5e-2, np.zeros(12, dtype=bool), held=3.0)
    assert edtk.identify(SPRUNG, sheet_of(q, wrench, x)).left_out == ()
    q[5, 3] += 7
    found = edtk.identify(SPRUNG, sheet_of(q, wrench, x))
    (named,) = (one for one in found.findings if one.rows)
    assert named.kind in WRONG
    assert named.rows == (5,)
