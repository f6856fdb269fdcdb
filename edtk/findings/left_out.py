"""Readings as all other poses predict them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from edtk.findings.model_error import ModelErrorFound
from edtk.fit.correlated_noise import (
    CorrelatedNoise,
    RowNoise,
    groups_by_size,
    std_of,
    whiten,
    whiten_columns,
    whole_groups,
)
from edtk.fit.distributions import student_quantile
from edtk.fit.equilibrium import LinearisedData
from edtk.fit.fit_huber import huber_weights
from edtk.fit.identify import Identification
from edtk.fit.least_squares import (
    NEARLY,
    LeftOut,
    independent_coordinates,
    share_inside,
)
from edtk.fit.measurements import Measurements
from edtk.fit.noise import MOST_COORDINATES
from edtk.system.typing import Array, Indices, Mask


@dataclass(frozen=True, eq=False)
class LeftOutReadings:
    """Readings as all other poses predict them.

    Attributes:
        data: The readings.
        errors: Measured less predicted (m, rows) [m, rad]; NaN where only its own pose tells
            enough.
        half: Half the width (m, rows) of the 95 % bands of these [m, rad].
        out: The fits without each pose.
        unit: Parameters (p, p) for a unit of each of the coordinates that these are in.
        a: Regressors (m, rows, p) in these coordinates.
        own: Noise of the readings, and by how much larger it is than that.
        scaled: Whether the size of the noise was fitted to the residuals.
        model: Variances (m, rows) of the errors by what the model leaves out [m^2, rad^2]; `half`
            is without them.
    """

    data: Measurements
    errors: Array
    half: Array
    out: LeftOut
    unit: Array
    a: Array
    own: tuple[RowNoise, float]
    scaled: bool
    model: Array

    @classmethod
    def of(
        cls,
        data: Measurements,
        fit: Identification,
        rows: tuple[LinearisedData, RowNoise],
        size: float,
        own: tuple[RowNoise, float],
        raw: Array,
        scaled: bool,
        found: ModelErrorFound | None,
    ) -> "LeftOutReadings":
        """Predict each pose by a fit of all others, see `LeftOut`; a robust fit with its weights.

        Args:
            data: The readings.
            fit: Their fit.
            rows: What was fitted, and its noise.
            size: By how much larger that noise is.
            own: Noise of the readings themselves, and by how much larger it is.
            raw: Regressors (m, rows, p) of the readings themselves.
            scaled: Whether the size of the noise was fitted to the residuals.
            found: What the model leaves out; None where nothing tells it.
        """
        (A, measured), noise = (rows[0].A, rows[0].measured), rows[1]
        X = whiten_columns(A, noise)
        z = whiten(measured - A @ fit.unbounded, noise)
        weights = huber_weights(z, size) if fit.robust else np.ones_like(z)
        root = np.sqrt(weights)
        length = np.linalg.norm(X.reshape(-1, X.shape[-1]), axis=0)
        Q, R = np.linalg.qr((X * root[..., None]).reshape(-1, len(length)) / length)
        Q = Q.reshape(X.shape)
        transposed = np.swapaxes(Q, 1, 2)
        out = LeftOut.of(
            _sums(transposed @ Q, data.pose),
            _sums((transposed @ (root * z)[..., None])[..., 0], data.pose),
            size**2 * _sums(transposed @ (weights[..., None] * Q), data.pose),
        )
        unit = np.linalg.inv(R) / length[:, None]
        a = raw @ unit
        errors = fit.residual + np.einsum("mrp,mp->mr", a, out.u[data.pose])
        only = np.einsum("mrp,mpq,mrq->mr", a, out.alone[data.pose], a)
        errors[only > NEARLY * np.einsum("mrp,mrp->mr", a, a)] = np.nan
        variance = (own[1] * std_of(own[0])) ** 2
        variance = variance + np.einsum("mrp,mpq,mrq->mr", a, out.C[data.pose], a)
        half = student_quantile(0.975, fit.covariance_dof) * np.sqrt(variance)
        model = np.zeros(raw.shape[:2])
        if found is not None and found.counts:
            model = _by_model(found, data.pose, (A, raw, a), Q * root[..., None], noise, out)
        return cls(data, errors, half, out, unit, a, own, scaled, model)

    @property
    def share_inside(self) -> float:
        """Share of coordinates that, left out, are within 95 % bands of the noise alone, or NaN."""
        return share_inside(self.errors, self.half)

    @property
    def share_with_model(self) -> float:
        """The same within bands that count what the model leaves out, too."""
        of_model = student_quantile(0.975, np.inf) * np.sqrt(self.model)
        return share_inside(self.errors, np.hypot(self.half, of_model))

    @property
    def rms(self) -> float:
        """Root mean square distance of markers, or of distances [m]; NaN without any."""
        return self._size(self.data.lengths)

    @property
    def turn_rms(self) -> float:
        """Root mean square angle of rotations [rad]; NaN where none was measured."""
        return self._size(~self.data.lengths)

    def _size(self, chosen: Mask) -> float:
        """Root mean square length of the chosen coordinates (m, rows) of the readings."""
        rows = chosen.any(axis=1)
        squares = np.where(chosen, self.errors**2, 0.0).sum(axis=1)[rows]
        known = np.isfinite(squares)
        return float(np.sqrt(squares[known].mean())) if known.any() else np.nan

    def growth(self) -> Array:
        """Growth (poses, p) of each parameter's variance without a pose; inf if it is open then."""
        variances = np.einsum("ip,bpq,iq->bi", self.unit, self.out.C, self.unit)
        only = np.einsum("ip,bpq,iq->bi", self.unit, self.out.alone, self.unit)
        whole = np.einsum("ip,pq,iq->i", self.unit, self.out.S, self.unit)
        squares = (self.unit**2).sum(axis=1)
        return np.where(only > NEARLY * squares, np.inf, variances / whole)

    @property
    def _covariance(self) -> Array:
        """Covariance (m rows, m rows) of all errors; of few poses, each moves the other fits."""
        noise, factor = self.own
        count, rows = self.errors.shape
        pose, a = np.repeat(self.data.pose, rows), self.a.reshape(count * rows, -1)
        readings = CorrelatedNoise.of_any(noise, self.errors.shape).among(np.arange(count)[None])
        own = factor**2 * readings.reshape(len(a), len(a))
        spread = np.einsum("ip,ipq,jq->ij", a, self.out.C[pose], a)
        return np.where(pose[:, None] == pose, own + spread, self.out.between(a, pose))

    def independent(self) -> float:
        """Find as many independent coordinates whose share inside their bands varies as much."""
        noise, factor = self.own
        rows = self.errors.shape[1]
        noise = CorrelatedNoise.of_any(noise, self.errors.shape)
        if self.errors.size <= MOST_COORDINATES:
            seen = np.isfinite(self.errors).reshape(1, -1)
            return independent_coordinates(self._covariance[None], seen, self.scaled)
        count = squares = 0.0
        for members in groups_by_size(self.data.pose):
            some = members[:, : max(1, MOST_COORDINATES // rows)]
            G, s = some.shape
            own = factor**2 * noise.among(some).reshape(G, s * rows, s * rows)
            a = self.a[some].reshape(G, s * rows, -1)
            spread = a @ self.out.C[self.data.pose[some[:, 0]]] @ np.swapaxes(a, 1, 2)
            seen = np.isfinite(self.errors[some]).reshape(G, -1)
            number = independent_coordinates(own + spread, seen, self.scaled)
            times = members.shape[1] / s
            count += times * seen.sum()
            squares += (times * seen.sum()) ** 2 / number if number else 0.0
        return count**2 / squares if squares else 0.0


def _by_model(
    found: ModelErrorFound,
    pose: Indices,
    regressors: tuple[Array, Array, Array],
    Q: Array,
    noise: RowNoise,
    out: LeftOut,
) -> Array:
    """Variances (m, rows) of readings, left out, by what the model leaves out.

    Its columns U of a reading's own pose are in the reading, and those of all others in the fit
    without that pose: ``U_b - a_b (I - G_b)^-1 sum_(c != b) Q_c' U_c``.

    Args:
        found: What it leaves out.
        pose: Number (m,) of the pose of each.
        regressors: What was fitted, readings themselves, and these in the coordinates of Q
            (m, rows, p).
        Q: Weighted and whitened rows (m, rows, p).
        noise: Noise of what was fitted.
        out: The fits without each pose.
    """
    A, raw, a = regressors
    # Rows that were freed of what repeats share are parts of the readings.
    squares = np.einsum("mrp,mrp->mr", raw, raw)
    along = np.einsum("mrp,mrp->mr", A, raw)
    part = np.divide(along, squares, out=np.ones_like(squares), where=squares > 0)[..., None]
    blocks = list(whole_groups(pose))

    def in_fit(rows: Indices) -> Iterator[Array]:
        """``Q'U`` (poses, p, c) of the columns of both kinds, of whole poses."""
        own = pose[rows] - pose[rows].min()
        own_noise, transposed = noise[rows], np.swapaxes(Q[rows], 1, 2)
        for one in found.columns(rows):
            yield _sums(transposed @ whiten_columns(part[rows] * one, own_noise), own)

    # Columns of all poses together would take most of the memory.
    total, squares_of_turns = 0.0, []
    for rows in blocks:
        shared, turns = in_fit(rows)
        total = total + shared.sum(axis=0)
        squares_of_turns.append(turns @ np.swapaxes(turns, 1, 2))
    S = np.concatenate(squares_of_turns)
    C = out.inverse @ (S.sum(axis=0) - S) @ out.inverse
    variances = np.einsum("mrp,mpq,mrq->mr", a, C[pose], a)
    for rows in blocks:
        first = pose[rows].min()
        poses = slice(first, pose[rows].max() + 1)
        by_others = out.inverse[poses] @ (total - next(in_fit(rows)))
        shared, turns = found.columns(rows)
        together = shared - a[rows] @ by_others[pose[rows] - first]
        variances[rows] += np.square(together).sum(axis=-1) + np.square(turns).sum(axis=-1)
    return variances


def _sums(values: Array, pose: Indices) -> Array:
    """Sums (poses, ...) of the values (m, ...) of the rows of each pose."""
    count = int(pose.max()) + 1
    if count == len(pose):
        return values  # poses are numbered as they appear
    total = np.zeros((count, *values.shape[1:]))
    np.add.at(total, pose, values)
    return total
