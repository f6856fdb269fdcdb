"""Sums of angles as variables: the same polynomial, and limits as constraints."""

import numpy as np
import pytest

from edtk.design.enclosure.polynomial import Axis, Polynomial
from edtk.design.enclosure.symmetry import Link, direction_of, within

AXES = (Axis("angle", -1.0, 2.0), Axis("length", 0.0, 3.0), Axis("angle", -0.5, 1.5))


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("first", "second"), [(0, 2), (2, 0)])
def test_a_polynomial_of_a_sum_has_the_same_values(first: int, second: int, sign: int) -> None:
    """At any place, to the rounding that it counts, and over an interval that holds all sums."""
    rng = np.random.default_rng(1)
    f = Polynomial(AXES, rng.normal(size=(5, 4, 7)))
    link = Link(first, second, sign)
    moved = link.of(f)
    low, high = np.array([(axis.low, axis.high) for axis in AXES]).T
    t = rng.uniform(low, high, size=(200, 3))
    new = t @ np.linalg.inv(link.matrix(3)).T
    assert np.abs(moved(new) - f(t)).max() < 1e-13 * f.size
    assert 0 < moved.error < 1e-13 * f.size
    low, high = np.array([(axis.low, axis.high) for axis in moved.axes]).T
    assert ((low <= new) & (new <= high)).all()
    assert np.allclose(new[:, second], t[:, second] + sign * t[:, first])


def test_what_depends_on_the_sum_alone_has_no_other_variable() -> None:
    """Degrees that a sum leaves are told: of ``sin^3(t_1 + t_3)`` none in t_1."""
    f = Polynomial.interpolated(AXES, (3, 0, 3), lambda t: np.sin(t[:, 0] + t[:, 2]) ** 3, 1e-15)
    assert f.degrees == (3, 0, 3)
    assert Link(0, 2, 1).of(f).degrees == (0, 0, 3)


def test_limits_have_the_sign_of_a_slack() -> None:
    """It is negative outside of an interval, and of a whole turn there is none."""
    slack = within(AXES, 2)
    assert slack is not None
    places = np.random.default_rng(2).uniform(-3, 3, size=(500, 3))
    inside = (places[:, 2] >= -0.5) & (places[:, 2] <= 1.5)
    assert ((slack(places) >= 0) == inside).all()
    assert within((Axis("angle", -np.pi, np.pi),), 0) is None


def test_axes_that_are_parallel_in_some_poses_only_are_not() -> None:
    """One, minus one where they point apart, and zero for any other pair."""
    up = np.zeros((3, 4))
    up[2] = 1.0
    other = up.copy()
    other[:, 3] = [1.0, 0.0, 0.0]
    half = up.copy()
    half[2, 3] = -1.0
    assert [direction_of(up, one) for one in (up, -up, other, half)] == [1, -1, 0, 0]
