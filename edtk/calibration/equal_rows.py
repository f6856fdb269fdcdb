"""Rows of a measurement file that are the same to the last digit."""

from dataclasses import dataclass

import numpy as np

from edtk.inference.distributions import poisson_tail
from edtk.inference.measurements import Measurements
from edtk.inference.row_numbers import row_numbers
from edtk.system.typing import Array, Indices

MOST_DIGITS = 9  # decimals of a millimetre or a degree that a reading is looked at to
SAME_DIGIT = 1e-4  # of a decimal step: below that a number is a multiple of it, but for rounding


@dataclass(frozen=True)
class EqualRows:
    """Rows that are the same in all columns.

    Attributes:
        later: The first row, counted from 0, that repeats an earlier one.
        earlier: The row that it repeats.
        others: Number of further rows that repeat earlier ones.
        chance: Probability of so many, by the resolution of the readings.
    """

    later: int
    earlier: int
    others: int
    chance: float


def equal_rows(data: Measurements) -> EqualRows | None:
    """Find rows that are the same to the last digit; None where all are different.

    Two repetitions agree in a coordinate of resolution d with probability
    ``d / (2 sqrt(pi) sigma)`` at most, and the number of agreeing pairs is about Poisson's.
    """
    pose = data.places
    row = row_numbers(pose[:, None].astype(float), data.deflection)
    copies = np.ones(len(row), dtype=bool)
    copies[np.unique(row, return_index=True)[1]] = False
    if not copies.any():
        return None
    later = int(np.flatnonzero(copies)[0])
    earlier = int(np.flatnonzero(row == row[later])[0])
    turn = np.zeros(len(data), dtype=bool) if data.turn is None else data.turn
    kinds = [np.flatnonzero(~turn), np.flatnonzero(turn)]
    expected = sum(_agreeing(data[kind], pose[kind]) for kind in kinds if len(kind))
    chance = float(poisson_tail(_pairs(row) - 1, expected))
    return EqualRows(later, earlier, int(copies.sum()) - 1, chance)


def _agreeing(data: Measurements, place: Indices) -> float:
    """Expected number of pairs of repetitions of a place that agree, of at most."""
    agree = _steps(data) / (2 * np.sqrt(np.pi) * data.sigma.mean(axis=0))
    return float(_pairs(place) * np.minimum(agree, 1.0).prod())


def _pairs(number: np.ndarray) -> float:
    """How many pairs have the same number."""
    counts = np.bincount(number)
    return float((counts * (counts - 1) / 2).sum())


def _steps(data: Measurements) -> Array:
    """Resolution (rows,) of the readings [m, rad]."""
    if data.turn is not None and data.turn.all():
        turned = resolution(data.deflection * 180 / np.pi) * np.pi / 180
        return np.full(1, turned)
    lengths = data.deflection[:, :3]
    steps = [np.full(lengths.shape[1], resolution(lengths * 1e3) / 1e3)]
    if data.deflection.shape[1] == 6:
        per_radian = 180 / np.pi
        turned = resolution(data.deflection[:, 3:] * per_radian) / per_radian
        steps.append(np.full(3, turned))
    return np.concatenate(steps)


def resolution(values: Array) -> float:
    """The decimal step 10^-d, d <= 9, that all values are multiples of."""
    for digits in range(MOST_DIGITS):
        scaled = values * 10.0**digits
        if np.abs(scaled - np.rint(scaled)).max() < SAME_DIGIT:
            return float(10.0**-digits)
    return 10.0**-MOST_DIGITS
