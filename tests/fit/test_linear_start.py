"""Robot and markers are placed from positions alone, however many markers there are."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from edtk.fit.place_robot import linear_misfits, linear_start


def scene(poses: int, markers: int, seed: int = 0) -> tuple[np.ndarray, ...]:
    """Transforms of the tool, positions without errors, places of markers, and the base."""
    rng = np.random.default_rng(seed)
    flange = np.tile(np.eye(4), (poses, 1, 1))
    flange[:, :3, :3] = Rotation.random(poses, rng).as_matrix()
    flange[:, :3, 3] = rng.normal(size=(poses, 3))
    tools = 0.3 * rng.normal(size=(markers, 3))
    base = np.eye(4)
    base[:3, :3] = Rotation.random(rng=rng).as_matrix()
    base[:3, 3] = rng.normal(size=3)
    points = flange[:, None, :3, 3] + np.einsum("mij,kj->mki", flange[:, :3, :3], tools)
    return flange, points @ base[:3, :3].T + base[:3, 3], tools, base


@pytest.mark.parametrize("markers", [1, 2, 400])
def test_places_are_found(markers: int) -> None:
    """Of positions without errors, some unseen, base and markers come out to the last digits.

    A dense solution of 400 markers took a second, and a sheet needs some dozens.
    """
    flange, x, tools, base = scene(30, markers)
    seen = np.random.default_rng(1).random((30, markers)) < 0.8
    x = np.where(seen[..., None], x, np.nan)
    found = linear_start(flange, x, seen)
    assert found.whole
    assert found.base == pytest.approx(base, abs=1e-9)
    assert found.tools == pytest.approx(tools, abs=1e-9)
    assert found.scale == pytest.approx(1.0)
    assert found.rms < 1e-12


def test_what_is_open_is_nearest_to_the_guess() -> None:
    """Along upright axes a marker's height and the base's are open together: the guess tells it.

    A marker that no pose has seen is where the guess has it.
    """
    flange, _, tools, base = scene(12, 3)
    angles = np.random.default_rng(2).uniform(-3, 3, 12)
    flange[:, :3, :3] = Rotation.from_rotvec(angles[:, None] * [0, 0, 1]).as_matrix()
    local = flange[:, None, :3, 3] + np.einsum("mij,kj->mki", flange[:, :3, :3], tools)
    seen = np.ones((12, 3), dtype=bool)
    seen[:, 2] = False
    x = local @ base[:3, :3].T + base[:3, 3]
    guess = tools + np.array([0.0, 0.0, 0.02])
    found = linear_start(flange, np.where(seen[..., None], x, np.nan), seen, guess)
    assert found.whole
    assert found.tools == pytest.approx(guess, abs=1e-9)
    moved = found.base[:3, 3] - base[:3, 3]
    assert moved == pytest.approx(-0.02 * base[:3, 2], abs=1e-9)


def test_too_few_poses_tell_no_place() -> None:
    """Three poses of one marker have nine coordinates for fifteen unknowns."""
    flange, x, _, _ = scene(3, 1)
    assert not linear_start(flange, x, np.ones((3, 1), dtype=bool)).whole


def test_misfits_of_many_chains_are_those_of_each() -> None:
    """With a marker that nobody saw, axes that are all upright, and too few poses too."""
    for poses in (3, 30):
        chains = np.stack([scene(poses, 3, seed)[0] for seed in range(6)])
        turn = np.random.default_rng(1).uniform(-3, 3, (2, poses, 1)) * [0, 0, 1]
        for chain, turns in zip(chains[:2], turn, strict=True):
            chain[:, :3, :3] = Rotation.from_rotvec(turns).as_matrix()
        seen = np.random.default_rng(2).random((poses, 3)) < 0.8
        seen[:, 2] = False
        x = np.where(seen[..., None], scene(poses, 3)[1], np.nan)
        each = [linear_start(chain, x, seen).rms for chain in chains]
        np.testing.assert_allclose(linear_misfits(chains, x, seen), each, atol=1e-7)
