"""What an instrument sees: angles and lengths by hand, and slopes by differences."""

from dataclasses import replace

import numpy as np
import pytest

from edtk.cell.sight import AllSeen, Eye, Reflector, Sight, facing
from edtk.robots.frames import BodyPoint
from edtk.robots.load_robot import load_robot
from edtk.system.typing import Array

ROBOT = load_robot("kuka_kr270")
HOME = np.zeros((1, 6))
TIP = ROBOT.frames(HOME[0]).position
AXES = ROBOT.frames(HOME[0]).rotation  # its k-th row is the tool's k-th unit vector


def sight_of(eye: Eye, normal: Array | None = None, acceptance: float = np.pi) -> Sight:
    """A marker at the tool point, and an eye."""
    return Sight(ROBOT, (eye,), (Reflector("m", BodyPoint(), normal, acceptance),), (3,))


@pytest.mark.parametrize("angle", [0.0, 29.9, 30.1, 90.0, 179.0])
def test_a_reflector_is_read_within_its_acceptance(angle: float) -> None:
    """An eye so many degrees beside the normal reads a reflector of 30 deg, or the words say by
    how much it looks away.
    """
    turn = np.deg2rad(angle)
    way = np.cos(turn) * AXES[2] + np.sin(turn) * AXES[0]
    sight = sight_of(Eye("tracker", TIP + 3 * way), np.eye(3)[2], np.deg2rad(30))
    assert sight.seen(HOME)[0, 0] == (angle < 30)
    why = sight.hidden(HOME)[0][0]
    assert str(why) == ("None" if angle < 30 else f"looks away by {angle:g} deg")


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"distance": (0.0, 2.9)}, "beyond range, at 3000 mm"),
        ({"distance": (3.1, 9.0)}, "nearer than range, at 3000 mm"),
        ({"azimuth": (-0.3, 0.3)}, "beyond azimuth, at 30 deg"),
        ({"elevation": (0.1, 1.0)}, "beyond elevation, at 0 deg"),
        ({"cone": np.deg2rad(29)}, "out of the field of view, 30 deg off its axis"),
        ({"distance": (2.9, 3.1), "azimuth": (0.5, 0.6), "elevation": (-0.1, 0.1)}, "None"),
        ({"azimuth": (np.deg2rad(350) - 0.6, np.deg2rad(390.1))}, "None"),
    ],
)
def test_an_eye_sees_within_its_limits(limits: dict[str, object], words: str) -> None:
    """A marker three metres away and 30 deg to the left is told to be out of what is not wide
    enough; an azimuth may run beyond half a turn.
    """
    ahead = np.array([1.0, 0, 0])
    way = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0])
    eye = Eye("tracker", TIP - 3 * way, facing(ahead), **limits)  # type: ignore[arg-type]
    assert str(sight_of(eye).hidden(HOME)[0][0]) == words


def test_each_eye_has_to_see_a_marker() -> None:
    """Of two eyes the one that does not see is named; what needs no sight is always read."""
    x = np.eye(3)[0]
    near, far = Eye("left", TIP + x), Eye("right", TIP + 9 * x, distance=(0, 5))
    both = replace(sight_of(near), eyes=(near, far), reflectors=(Reflector("m", BodyPoint()), None))
    both = replace(both, widths=(3, 1))
    assert both.seen(HOME).tolist() == [[False, True]]
    assert both.rows(HOME).tolist() == [[False, False, False, True]]
    assert str(both.hidden(HOME)[0][0]) == "beyond range, at 9000 mm (right)"
    assert both.always_hidden(HOME) == [0]
    wires = replace(both, reflectors=(None, None), widths=(1, 1))
    assert wires.seen(HOME).all()
    assert wires.hidden(HOME) == [[None, None]]


@pytest.mark.parametrize("joint", [None, 3])
def test_slacks_have_their_slopes(joint: int | None) -> None:
    """Derivatives of all bounds are their differences, for markers on the tool and on a link."""
    rng = np.random.default_rng(1)
    normal = rng.standard_normal(3)
    marker = Reflector("m", BodyPoint(np.array([0.1, 0.2, -0.1]), joint), normal, 0.5)
    marker = replace(marker, normal=normal / np.linalg.norm(normal))
    limits = {"distance": (0.5, 9.0), "azimuth": (-1.0, 0.7), "elevation": (-0.4, 0.6)}
    eye = Eye("tracker", np.array([4.0, 2, 1]), facing(np.array([-1, -0.3, 0.1])), **limits, cone=1)
    constraint = AllSeen(Sight(ROBOT, (eye,), (marker,), (3,)))
    q = rng.uniform(-1, 1, (20, 6))
    found = constraint.gradient(ROBOT.frames(q))
    h = 1e-6
    for j, step in enumerate(h * np.eye(6)):
        up, down = (constraint.slack(ROBOT.frames(q + sign * step)) for sign in (1, -1))
        np.testing.assert_allclose(found[:, j], (up - down) / (2 * h), atol=1e-7)
    assert len(constraint.labels(ROBOT)) == len(found) == 7
