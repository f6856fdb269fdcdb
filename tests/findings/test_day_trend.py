"""A frame that drifts and links that grow are told from a frame that moved once."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from geometry_sheets import OFFSETS, PLACE, STUDY, Array, by_pose

import edtk
from edtk.study.study_geometry import StudyGeometry

POSES = 36
GEARS = 5e-5  # [rad] of each of three waves a turn, in every joint
TIME = np.linspace(0, 1, POSES)
MOVED = np.array([0.6, -0.64, 0.48])


def kinds_of(path: Path, seed: int, drift: Array, growth: Array) -> dict[str, str]:
    """What is said of a day, by kind.

    Args:
        path: Where the sheet is written.
        seed: Of everything.
        drift: How far the frame is off in each pose (m,) [m].
        growth: Of all lengths in each pose (m,) [m/m].
    """
    rng = np.random.default_rng(seed)
    setting = StudyGeometry.of(STUDY)
    model = replace(setting.model, offsets=OFFSETS, start=PLACE)
    theta = rng.normal(0, 0.5, model.p) * model.scales
    q = rng.uniform(-1.7, 1.7, (POSES, 6))
    waves = np.arange(1, 4) * q[..., None] + rng.uniform(0, 2 * np.pi, (6, 3))
    there = q + (rng.normal(0, GEARS, (6, 3)) * np.sin(waves)).sum(axis=-1)
    # All frames of the arm are parallel: lengths grow along the components of its origins.
    origins = {joint.name: joint.origin[:3, 3] for joint in model.robot.chain}
    long = [
        origins[one.of]["xyz".index(one.component)] if one.place == "joint" and not one.turns else 0
        for one in model.parameters
    ]
    x = np.concatenate(
        [
            model.see(theta + grown * np.array(long), there[[i]], derivatives=False).points
            for i, grown in enumerate(growth)
        ]
    )
    x += drift[:, None, None] * MOVED + rng.normal(0, 1e-5, x.shape)
    found = edtk.identify(STUDY, by_pose(path / "day.csv", np.rad2deg(q), 1e3 * x))
    return {doubt.kind: doubt.words for doubt in found.findings}


@pytest.mark.parametrize(
    ("seed", "shape"), [(0, TIME), (1, 1 - np.exp(-3 * TIME))], ids=["steady", "warms up"]
)
def test_a_drift_is_no_step(seed: int, shape: Array, tmp_path: Path) -> None:
    """0.3 mm from the first row to the last, steadily or as where something warms up."""
    said = kinds_of(tmp_path, seed, 3e-4 * shape, 0 * TIME)
    assert "frame_moved" not in said
    size = float(said["drift"].split("positions drift by ")[1].split(" mm")[0])
    assert size == pytest.approx(0.3, rel=0.2)  # how far the last row is off


def test_links_that_grow_are_said_with_by_how_much(tmp_path: Path) -> None:
    """200 um/m, and not as a frame that moved or drifts."""
    said = kinds_of(tmp_path, 0, 0 * TIME, 2e-4 * TIME)
    assert not {"frame_moved", "drift"} & set(said)
    size = float(said["growth"].split("grown by ")[1].split(" um/m")[0])
    assert size == pytest.approx(200, rel=0.3)


def test_a_cause_of_little_does_not_claim_the_rest(tmp_path: Path) -> None:
    """70 um/m are told from errors of gears, and explain some of what these leave, no more."""
    said = kinds_of(tmp_path, 0, 0 * TIME, 7e-5 * TIME)["growth"]
    share, rest = said.split("that explains ")[1].split(" % of the residuals; ")
    assert 0 < float(share) < 50
    assert rest.startswith("the rest is noise, or the model's. Did the")


def test_a_step_is_no_trend(tmp_path: Path) -> None:
    """The frame moved once."""
    stepped = kinds_of(tmp_path, 0, 3e-4 * (TIME > 0.4), 0 * TIME)
    assert "frame_moved" in stepped
    assert not {"drift", "growth"} & set(stepped)


def test_a_sound_day_has_no_trend(tmp_path: Path) -> None:
    """Nothing moved, and nothing grew."""
    sound = kinds_of(tmp_path, 1, 0 * TIME, 0 * TIME)
    assert not {"frame_moved", "drift", "growth", "untold_load"} & set(sound)
