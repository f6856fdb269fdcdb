"""Polynomials in angles and lengths: arithmetic is that of their values, errors are bounded."""

from dataclasses import replace

import numpy as np
import pytest

from edtk.design.enclosure.objective import Objective
from edtk.design.enclosure.polynomial import Axis, Polynomial, sum_of_squares
from edtk.system.typing import Array

AXES = (Axis("angle", -1.0, 2.0), Axis("length", -0.5, 3.5), Axis("angle", 0.0, 0.5))
EXACT = 1e-14  # of the size of a polynomial


def drawn(rng: np.random.Generator, *degrees: int) -> Polynomial:
    """A polynomial with random coefficients."""
    shape = [axis.size(n) for axis, n in zip(AXES, degrees, strict=True)]
    return Polynomial(AXES, rng.normal(size=shape))


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers."""
    return np.random.default_rng(4)


@pytest.fixture
def places(rng: np.random.Generator) -> Array:
    """Places (500, 3) in the box of `AXES`."""
    low = np.array([axis.low for axis in AXES])
    high = np.array([axis.high for axis in AXES])
    return rng.uniform(low, high, size=(500, 3))


def test_values_are_those_of_the_sum(rng: np.random.Generator, places: Array) -> None:
    """A polynomial is the sum that its docstring tells, function by function."""
    f = drawn(rng, 2, 3, 1)
    t, x, s = places.T
    u = (x - 1.5) / 2.0
    by_t = [np.ones_like(t), np.cos(t), np.sin(t), np.cos(2 * t), np.sin(2 * t)]
    by_s = [np.ones_like(s), np.cos(s), np.sin(s)]
    expected = sum(
        f.coefficients[i, k, j] * by_t[i] * u**k * by_s[j]
        for i in range(5)
        for k in range(4)
        for j in range(3)
    )
    assert np.abs(f(places) - expected).max() < EXACT * f.size
    assert f(np.zeros((0, 3))).shape == (0,)


def test_arithmetic_is_that_of_values(rng: np.random.Generator, places: Array) -> None:
    """Sums, differences, products and sums of squares have the values of the same of values, within
    the error that each states, which is small; degrees add.
    """
    f, g = drawn(rng, 1, 2, 3), drawn(rng, 2, 1, 0)
    a, b = f(places), g(places)
    both: dict[str, tuple[Polynomial, Array]] = {
        "sum": (f + g, a + b),
        "difference": (f - g, a - b),
        "product": (f * g, a * b),
        "affine": (1.5 - 2.0 * f + 3, 4.5 - 2.0 * a),
        "squares": (sum_of_squares([f, g]), a * a + b * b),
        "total": (sum([f, g], Polynomial.constant(AXES, 0.0)), a + b),
    }
    for name, (found, expected) in both.items():
        rounding = EXACT * max(found.size, 1.0)
        assert np.abs(found(places) - expected).max() < rounding + found.error, name
        assert found.error < 1e-10 * found.size, name
    assert (f * g).degrees == (3, 3, 3)
    assert (f + g).degrees == (2, 2, 3)


def test_variables_are_what_they_are_called(places: Array) -> None:
    """The polynomials of a single variable have its values."""
    expected = [np.cos(places[:, 0]), places[:, 1], np.sin(places[:, 2])]
    for j, (name, values) in enumerate(zip(["cos", "x", "sin"], expected, strict=True)):
        assert np.abs(Polynomial.variable(AXES, j, name)(places) - values).max() < 1e-15 * 4
    with pytest.raises(ValueError, match="'x' of an axis of the kind angle"):
        Polynomial.variable(AXES, 0)


def test_interpolation_gives_the_coefficients_back(rng: np.random.Generator) -> None:
    """A polynomial is that of its samples, to its last digits, and far within its stated error."""
    f = drawn(rng, 4, 5, 3)
    found = Polynomial.interpolated(AXES, f.degrees, f)
    off = np.abs(found.coefficients - f.coefficients)
    assert off.max() < EXACT * f.size
    assert off.sum() < found.error < 1e-9 * f.size


def test_errors_of_samples_are_counted(rng: np.random.Generator, places: Array) -> None:
    """Whatever errors samples have, up to a size, the polynomial is off by no more than it says; a
    tenth of what it says can be reached.
    """
    worst = np.zeros(1)
    for degrees in ((0, 0, 0), (1, 1, 1), (3, 2, 2)):
        shape = [axis.size(n) for axis, n in zip(AXES, degrees, strict=True)]
        stated = Polynomial.of_samples(AXES, np.zeros(shape), 1.0).error
        off = [
            np.abs(Polynomial.of_samples(AXES, rng.choice([-1.0, 1.0], shape))(places)).max()
            for _ in range(40)
        ]
        assert max(off) <= stated
        worst = np.append(worst, max(off) / stated)
    assert worst.max() > 0.1


def test_what_is_cut_off_counts_as_error(rng: np.random.Generator, places: Array) -> None:
    """Functions above a degree are dropped with a bound of what they could be, and a trim finds the
    degrees that hold more than roundings.
    """
    f, g = drawn(rng, 1, 0, 2), 1e-16 * drawn(rng, 4, 3, 3)
    high = replace(f + g, error=1e-13)
    low = high.trimmed()
    assert low.degrees == (1, 0, 2)
    assert 1e-13 < low.error < 1e-12
    assert np.abs(low(places) - high(places)).max() < low.error
    kept = f.cut((1, 0, 1))
    assert np.abs(kept(places) - f(places)).max() < kept.error
    left = low.over([AXES[0], AXES[2]], [0, 2])
    assert np.abs(left(places[:, [0, 2]]) - low(places)).max() < EXACT * low.size
    with pytest.raises(ValueError, match="to be dropped"):
        low.over([AXES[0]], [0])
    assert Polynomial.constant(AXES, 0.0).trimmed().degrees == (0, 0, 0)


def test_a_quotient_is_that_of_values(rng: np.random.Generator, places: Array) -> None:
    """An objective divides by its denominator, if it has one."""
    f, g = drawn(rng, 1, 1, 1), 2.0 + Polynomial.variable(AXES, 0, "cos")
    assert (Objective(f)(places) == f(places)).all()
    assert np.allclose(Objective(f, g)(places), f(places) / g(places))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Axis("turn", 0.0, 1.0), "'angle' or a 'length', not 'turn'"),  # type: ignore[arg-type]
        (lambda: Axis("angle", 1.0, 0.0), "from 1 to 0; expected an interval"),
        (lambda: Polynomial(AXES, np.zeros((2, 1, 1))), "expected 2n"),
        (lambda: Polynomial(AXES, np.zeros(3)), "for 3 axes"),
        (
            lambda: Polynomial.constant(AXES, 1.0) + Polynomial.constant(AXES[:2], 1.0),
            "different variables",
        ),
    ],
)
def test_what_is_no_polynomial_is_refused(make: object, message: str) -> None:
    """Axes and tensors that make no sense end in one line."""
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]
