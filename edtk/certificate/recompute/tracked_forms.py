"""Sensitivities to readings of a tracker, whose errors grow with the distance, on each box.

With variances l across the beam b, e along it, ``s = b'b``, ``N = <Z, A'A>`` and
``Q = <Z, A'b b'A>`` the sensitivity is ``(N + (l - e)/(e s) Q)/l``. The page "A bound over every
pose" of the documentation has the theorem that bounds it on a box, and its proof.
"""

from dataclasses import dataclass, replace

import numpy as np

from edtk.certificate.recompute.physics import Noise
from edtk.certificate.recompute.tasks import EPS
from edtk.system.typing import Array

OF_FACTORS = 50 * EPS  # of a factor, beside the sizes of what it is made of
DISTANT = 4.0  # of a box: its largest squared distance over its least one is no more


@dataclass(frozen=True, eq=False)
class Growth:
    """Variances of a reading, a white part and so many times ``(a + b r)^2`` at a distance r.

    Attributes:
        white: The white part [m^2].
        readings: Readings of which a row is made.
        along: a [m] and b [m/m] along the beam (2,), at most those across it.
        across: a and b across it (2,).
        nearest: No squared distance is less [m^2].
    """

    white: float
    readings: int
    along: Array
    across: Array
    nearest: float

    @classmethod
    def of(cls, noise: Noise, white: float, reach: float) -> "Growth":
        """That of a tracker; along the beam errors count as no larger than across it.

        Args:
            noise: The noise.
            white: The white part [m^2].
            reach: The largest distance of its marker from the origin [m].
        """
        assert noise.tracker is not None
        position, along, across = noise.tracker
        away = float(np.linalg.norm(position))
        apart = max(0.0, away - reach - OF_FACTORS * (away + reach))
        return cls(white, noise.readings, np.minimum(along, across), across, apart**2)

    @property
    def vanishes(self) -> bool:
        """Whether there may be no error at the least distance."""
        return not float(self.along_beam(np.array(self.nearest))) > 0

    @property
    def is_round(self) -> bool:
        """Whether errors are alike in all directions."""
        return bool((self.along == self.across).all())

    def variance(self, squared: Array) -> Array:
        """The variance l [m^2] across beams of squared lengths (L,)."""
        return self.white + self.readings * self._spread(self.across, squared) ** 2

    def along_beam(self, squared: Array) -> Array:
        """The variance e [m^2] along them."""
        return replace(self, across=self.along).variance(squared)

    def ratio(self, longest: Array, shortest: Array) -> Array:
        """The variance l at a distance over e at another one."""
        return self.variance(longest) / self.along_beam(shortest)

    def inline(self, squared: Array) -> Array:
        """``(l - e)/(e s)`` [1/m^2]."""
        apart = self._spread(self.across - self.along, squared)
        both = self._spread(self.across + self.along, squared)
        return self.readings * apart * both / (self.along_beam(squared) * squared)

    def factors(self, limit: float, s: Array, Q: Array, near: bool) -> Array:
        """Factors (L, 4) of N, s, Q and one, whose sum is at most zero only if d is at most u.

        l is concave in s and ``k = (l - e)/(e s)`` falls and is convex, so that between the ends
        of a box the chord of l is below it and that of k above. With the least Q_0,
        ``k Q <= k_0 Q + Q_0 (chord - k_0)``; near the tracker ``Q <= s N``.

        Args:
            limit: The limit u.
            s: Squared distances (2, L), at most and at least those of each box.
            Q: Least values (L,) on each box.
            near: Whether ``Q <= s N`` is used in all of them; else where boxes are no farther.
        """
        first, last = self.variance(s)
        rise = _chord(first, last, s)
        found = np.zeros((s.shape[1], 4))
        found[:, 0] = 1.0
        found[:, 1] = -limit * rise
        found[:, 3] = limit * (rise * s[0] - first)
        size = limit * (first + rise * s[1])
        if not self.is_round:
            close = (s[1] > DISTANT * s[0]) | near
            found[close, 0] = self.ratio(s[1, close], s[0, close]) * (1 + OF_FACTORS)
            of, ends = np.maximum(Q[~close], 0.0), s[:, ~close]
            before, after = self.inline(ends)
            before = before * (1 + OF_FACTORS)
            fall = of * _chord(before, after, ends)
            found[~close, 1] += fall
            found[~close, 2] = before
            found[~close, 3] -= fall * ends[0]
            size[~close] += of * before - fall * ends[1]
        found[:, 3] += OF_FACTORS * size
        return found

    @staticmethod
    def _spread(coefficients: Array, squared: Array) -> Array:
        return np.asarray(coefficients[0] + coefficients[1] * np.sqrt(squared))


def _chord(first: Array, last: Array, ends: Array) -> Array:
    """Slopes (L,) between two values; zero between ends (2, L) that are one."""
    width = ends[1] - ends[0]
    return np.asarray(np.where(width > 0, last - first, 0.0) / np.where(width > 0, width, 1.0))
