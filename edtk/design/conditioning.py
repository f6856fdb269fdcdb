"""How well candidates tell their parameters apart, and parameters in which they tell all alike."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from criteria.linalg.estimable import directions_in_words
from criteria.linalg.inverse import EPS, ROUNDING, eigenpairs, unit_scale
from criteria.linalg.models import Models
from criteria.linalg.spectrum import orthogonal_columns
from edtk.system.typing import Array, Mask

AT_ONCE = 2**18  # doubles per part: some megabytes beside millions of rows
# Condition number up to which squares of rows are good enough: they lose its square in roundings.
WELL = 1e3
# The same of information that is given: what it has lost is lost, and copies of it are large.
WELL_OF_SQUARES = 1e4
# Rows are known to rounding, and so are singular values beside the largest. From this multiple of
# ``p eps`` on, a result has three digits at least.
LOST = 1e3
# A singular value above this is no part of a decline into rounding: what is below is exactly zero.
# Squares decline twice as fast.
CLEAR = 1e-8
CLEAR_OF_SQUARES = 1e-4


def triangular_factor(parts: Iterable[Array], scale: Array) -> Array:
    """R (p, p), upper triangular, with ``R'R = sum of B'B``, where B are rows over `scale`.

    Squares of rows never occur, so that R has all digits of rows whose condition number is up to
    the inverse of a rounding; of ``B'B`` that is true up to its root only. Householder reflections
    are stable column by column, whatever their units.

    Args:
        parts: Rows (k, p), part by part.
        scale: Size (p,) of each column.
    """
    p = len(scale)
    R = np.zeros((0, p))
    step = max(AT_ONCE // p, 2 * p)
    for rows in parts:
        for start in range(0, len(rows), step):
            part = np.vstack([R, rows[start : start + step] / scale])
            R = np.asarray(np.linalg.qr(part, mode="r"))
    found = np.zeros((p, p))
    found[: len(R)] = R
    return found


@dataclass(frozen=True, eq=False)
class Conditioning:
    """Singular values of the candidates' rows, each column scaled to length one.

    Attributes:
        scale: Length (p,) of each column in the mean of all candidates, see `unit_scale`.
        s: Singular values (p,), ascending.
        V: Their right singular vectors (p, p), as columns.
        least: A singular value up to this one is lost in rounding.
        clear: One above this is no part of a decline into rounding.
        of_squares: Whether they are roots of eigenvalues of the information.
    """

    scale: Array
    s: Array
    V: Array
    least: float
    clear: float
    of_squares: bool = False

    @classmethod
    def of_information(cls, mean: Array) -> "Conditioning":
        """From the mean information (p, p), which has the squares of the singular values."""
        scale = unit_scale(np.diag(mean))
        r, V = eigenpairs(mean / np.outer(scale, scale))
        least = np.sqrt(len(mean) * ROUNDING * max(float(r[-1]), 1.0))
        return cls(scale, np.sqrt(np.maximum(r, 0.0)), V, float(least), CLEAR_OF_SQUARES, True)

    @classmethod
    def of_rows(cls, parts: Iterable[Array], mean: Array) -> "Conditioning":
        """From the rows (k, p) themselves, part by part, whose mean information is given."""
        scale = unit_scale(np.diag(mean))
        R = triangular_factor(parts, scale)
        _, s, rows = np.linalg.svd(R)
        least = len(mean) * LOST * EPS * max(float(s[0]), 1.0)
        return cls(scale, s[::-1], rows[::-1].T, least, CLEAR)

    @property
    def keeps_digits(self) -> bool:
        """Whether squares of the rows, and sums that round each column, keep enough digits."""
        return bool(self.s[0] * WELL > self.s[-1])

    @property
    def is_open(self) -> Mask:
        """Which directions (p,) no candidate tells, or none to working precision."""
        return np.asarray(self.s <= self.least)

    @property
    def open_columns(self) -> Mask:
        """Which columns (p,) of `whitener` are open directions."""
        return self.is_open

    @property
    def number(self) -> float:
        """The condition number; inf where a direction is exactly open."""
        return float(self.s[-1] / self.s[0]) if self.s[0] > 0 else float("inf")

    @property
    def is_well(self) -> bool:
        """Whether squares of the rows have enough digits, apart from directions that are open."""
        kept = self.s[~self.is_open]
        limit = WELL_OF_SQUARES if self.of_squares else WELL
        return bool(not len(kept) or self.s[-1] <= limit * kept[0])

    @property
    def fades(self) -> bool:
        """Whether the singular values decline into rounding, instead of ending at zero."""
        kept = self.s[~self.is_open]
        exact = len(self.s) * ROUNDING * self.s[-1]
        are_zero = self.s[self.is_open] <= max(exact, self.least if self.of_squares else 0.0)
        declines = len(kept) and kept[0] < self.clear * self.s[-1]
        return bool(self.is_open.any() and (declines or not are_zero.all()))

    @property
    def whitener(self) -> Array:
        """T (p, p) with ``k = T k'``, where candidates tell each k' as well as any other.

        The last digits of T do not matter: whatever T is, the parameters k' are those of T. Its
        columns are orthogonal, as criteria of eigenvalues need it. Open directions keep a column of
        length one at the columns' scale.
        """
        s = np.where(self.is_open, 1.0, self.s)
        T = self.V / s / self.scale[:, None]
        return T if self.is_open.any() else orthogonal_columns(T)

    def directions(self, parameters: tuple[str, ...]) -> tuple[str, ...]:
        """Words for each open direction, such as "k4" or "k2 - 0.5 k3"."""
        return directions_in_words(self.V[:, self.is_open], self.scale, parameters)

    def information(self) -> Array:
        """Information (p, p) that leaves the same directions open, exactly, and no other nearly."""
        kept = self.V[:, ~self.is_open] * self.scale[:, None]
        return np.asarray(kept @ kept.T)


@dataclass(frozen=True, eq=False)
class ConditioningOfModels(Conditioning):
    """That of several models, whose singular values are those of each.

    Attributes:
        models: Where the models stand.
        each: The conditioning of each.
    """

    models: Models = field(kw_only=True)
    each: tuple[Conditioning, ...] = field(kw_only=True)

    @classmethod
    def joined(cls, models: Models, each: Sequence[Conditioning]) -> "ConditioningOfModels":
        """Join those of all models, in order of the singular values."""
        s = np.concatenate([one.s for one in each])
        order = np.argsort(s, kind="stable")
        V = models.diagonal([one.V for one in each])
        scale = np.concatenate([one.scale for one in each])
        return cls(
            scale,
            s[order],
            V[:, order],
            max(one.least for one in each),
            max(one.clear for one in each),
            any(one.of_squares for one in each),
            models=models,
            each=tuple(each),
        )

    @property
    def keeps_digits(self) -> bool:
        """Whether squares of each model's rows do."""
        return all(one.keeps_digits for one in self.each)

    @property
    def is_well(self) -> bool:
        """Whether squares of each model's rows are."""
        return all(one.is_well for one in self.each)

    @property
    def fades(self) -> bool:
        """Whether the singular values of any model do."""
        return any(one.fades for one in self.each)

    @property
    def open_columns(self) -> Mask:
        """Those of each model."""
        return np.concatenate([one.is_open for one in self.each])

    @property
    def is_open(self) -> Mask:
        """Those of each model, in the order of the singular values."""
        order = np.argsort(np.concatenate([one.s for one in self.each]), kind="stable")
        return np.asarray(self.open_columns[order])

    @property
    def whitener(self) -> Array:
        """T (p, p), which mixes no models."""
        return self.models.diagonal([one.whitener for one in self.each])
