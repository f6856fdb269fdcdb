"""A laser tracker: errors along and across its beam, which grow with the range."""

from dataclasses import dataclass

import numpy as np

from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Tracker:
    """Standard deviations ``a + b r`` of one reading, along and across the beam of length r.

    With the beam's direction u from the tracker to a point, a reading of the point has the
    covariance

        T = c^2 I + (e^2 - c^2) u u',   e = along[0] + along[1] r,   c = across[0] + across[1] r.

    Attributes:
        position: Where the tracker stands (3,), in the world frame [m].
        along: Coefficients a [m] and b [m/m] of the standard deviation along the beam.
        across: Coefficients of the one across the beam, in each of both directions.
    """

    position: Array
    along: tuple[float, float]
    across: tuple[float, float]

    def covariance(self, points: Array) -> Array:
        """Covariances T (markers, 3, 3, ...) [m^2] of readings of points (markers, 3, ...) [m]."""
        r, u = self._beam(points)
        c = _error(self.across, r)
        e = _error(self.along, r)
        # The product of both directions comes first: rounding then keeps the matrix symmetric.
        T = (e**2 - c**2)[:, None, None] * (u[:, :, None] * u[:, None])
        for axis in range(3):
            T[:, axis, axis] += c**2
        return T

    def slope(self, points: Array, S: Array) -> Array:
        """Derivatives of ``<S, T>`` by the points, S held fixed.

        With ``s = u' S u``, ``f = c^2`` and ``g = e^2 - c^2``, whose derivatives by r are f' and
        g', and with ``dr = u.dp`` and ``du = (I - u u') dp / r``,

            d<S, T>/dp = (f' trace S + g' s) u + 2 g (S u - s u) / r.

        Args:
            points: Points (markers, 3, ...) [m].
            S: Symmetric weights (markers, 3, 3, ...).

        Returns:
            Array (markers, 3, ...).
        """
        r, u = self._beam(points)
        c = _error(self.across, r)
        e = _error(self.along, r)
        f_slope = 2 * c * self.across[1]
        g = e**2 - c**2
        g_slope = 2 * e * self.along[1] - f_slope
        Su = np.einsum("mij...,mj...->mi...", S, u)
        s = np.einsum("mi...,mi...->m...", u, Su)
        radial = f_slope * np.einsum("mii...->m...", S) + g_slope * s
        return np.asarray(radial[:, None] * u + (2 * g / r)[:, None] * (Su - s[:, None] * u))

    def _beam(self, points: Array) -> tuple[Array, Array]:
        """Ranges r (markers, ...) [m] and directions u (markers, 3, ...) from the tracker."""
        lift = (slice(None),) + (None,) * (points.ndim - 2)
        beam = points - self.position[lift]
        r = np.sqrt(np.einsum("mi...,mi...->m...", beam, beam))
        return r, beam / r[:, None]


def _error(coefficients: tuple[float, float], r: Array) -> Array:
    """``a + b r`` [m]."""
    a, b = coefficients
    return a + b * r
