"""Springs across joints: where they may be, and what joints say of each other."""

import numpy as np
import pytest

from edtk.fit.missing import GROUPS, SIZES, MissingColumns, Places, SizeLikelihood
from edtk.measure.missing_pieces import PieceColumns


@pytest.mark.parametrize(("n", "links"), [(1, 0), (3, 2), (6, 5), (9, 0)])
def test_each_number_of_joints_is_as_likely(n, links):
    """None, one, all joints, and all along the arm have one chance; so have choices of a number."""
    joints = np.concatenate([np.tile(np.arange(n), 2), np.full(3 * links, n)])
    places = Places.of(joints, n)
    assert places.chances.sum() == pytest.approx(1)
    assert not places.masks[0].any()
    numbers = places.masks.sum(axis=1)
    count = min(n, GROUPS)
    steps = count + 1 + (links > 0)
    assert len(places.chances) == 2**count + (links > 0)
    if n <= GROUPS:
        for number in np.unique(numbers):
            own = places.chances[numbers == number]
            assert own.sum() == pytest.approx(1 / steps)
            np.testing.assert_allclose(own, own[0])
    # Both springs across a joint are there, or none; those of a link with all others alone.
    np.testing.assert_array_equal(places.masks[:, :n], places.masks[:, n : 2 * n])
    assert places.masks[places.masks[:, 2 * n :].any(axis=1)].all()


@pytest.mark.parametrize("hidden", [(), (0,), (0, 1, 2, 3)])
def test_a_joint_that_no_reading_shows_is_open(hidden):
    """It changes nothing of the others, and its chance is by Laplace's rule of succession.

    That is 1/(2 + s) beside s joints that are sound, and a half where no joint is shown.
    """
    rng = np.random.default_rng(5)
    every = np.tile(np.arange(4), 2)
    across = rng.standard_normal((40, 3, 8)) * ~np.isin(every, hidden)
    A = rng.standard_normal((40, 3, 1))
    measured = 2.0 * A[..., 0] + 1e-4 * rng.standard_normal((40, 3))
    pieces = PieceColumns(across, np.zeros((40, 3, 4)), np.zeros((40, 4)), np.ones(4))
    shown = MissingColumns(pieces, np.arange(40), np.zeros((40, 3, 0)))
    found = SizeLikelihood.of(A, measured, np.full((40, 3), 1e-4), shown).posterior
    of_joint = found.by_size.sum(axis=(0, 1, 2)) @ found.places.masks[:, :4]
    sound = 4 - len(hidden)
    for joint in range(4):
        expected = 1 / (2 + sound) if joint in hidden else 0.0
        assert of_joint[joint] == pytest.approx(expected, abs=0.02)


def test_sound_joints_do_not_vouch_for_others():
    """Where a sheet shows five joints to be sound, and the sixth hardly, that one stays open.

    The chance that springs are across it is then what counts of it in the prior: with five of six
    absent, one of 1/7 for all absent against one of 1/7 shared by six joints, a seventh in all. A
    sheet that shows all six leaves hardly any of it.
    """
    rng = np.random.default_rng(4)
    across = rng.standard_normal((40, 3, 12))
    turns = np.zeros((40, 3, 6))
    A = rng.standard_normal((40, 3, 1))
    measured = 2.0 * A[..., 0] + 1e-4 * rng.standard_normal((40, 3))
    sigma = np.full((40, 3), 1e-4)

    def chances(hidden):
        U = across * np.where(np.arange(12) % 6 == 5, hidden, 1.0)
        pieces = PieceColumns(U, turns, np.zeros((40, 6)), np.ones(6))
        shown = MissingColumns(pieces, np.arange(40), np.zeros((40, 3, 0)))
        found = SizeLikelihood.of(A, measured, sigma, shown).posterior
        masks = found.places.masks[np.arange(len(found.weights)) % len(found.places.chances)]
        return found, found.weights @ masks[:, :6]

    found, of_joint = chances(1e-6)
    assert found.shares["across_percent"] == 0
    assert of_joint[:5].max() < 0.02
    assert of_joint[5] == pytest.approx(1 / 7, abs=0.02)
    assert chances(1.0)[1].max() < 0.02
    sizes = found.weights.reshape(-1, len(SIZES), len(found.places.chances)).sum(axis=(0, 2))
    assert sizes[1:].sum() == pytest.approx(of_joint[5], abs=0.03)
