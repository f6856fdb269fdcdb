"""How measurements scatter about the model, independently or together."""

import math
from dataclasses import dataclass

import numpy as np

from edtk.fit.correlated_noise import (
    CorrelatedNoise,
    NoiseBlocks,
    RowNoise,
    groups_by_size,
    occurrence,
    row_numbers,
)
from edtk.fit.measurements import Measurements
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.instruments.distance import Distance
from edtk.measure.instruments.one_row import OneRow
from edtk.measure.instruments.pose_marker import COORDINATES
from edtk.measure.noise import Tracker
from edtk.system.typing import Array, Indices

# Gamma prior of the degrees of freedom of Student's t, of Juarez and Steel (2010): its mean is 20,
# and little of its mass is near normal errors, which nu could not be told from anyway.
NU_SHAPE = 2.0
NU_RATE = 0.1
# Where walkers start: log nu about the logarithm of ten. Within two of these standard deviations
# nu is 3.7 to 27, from heavy tails to nearly normal errors.
NU_START = 10.0
NU_START_WIDTH = 0.5
# s^2 of a fit without residuals: its logarithm must be finite.
LEAST_SPREAD = 1e-12
# Logarithm of the least s that is told from smaller ones: its square is 1e-130.
LEAST_LOG_S = -150.0
# Logarithms of nu beyond this are as improbable as it is.
MOST_LOG_NU = 300.0
# Coordinates of one group. Its matrix is factored some dozen times in a calibration, each in a time
# that grows with the cube: on one core 0.04 s for these, 0.5 s for 1500.
MOST_COORDINATES = 600


# Words for degrees of freedom, as a study and the command line spell them.
NU_IN_WORDS = {"normal": math.inf, "sampled": None}


@dataclass(frozen=True)
class Noise:
    """Independent errors ``s sigma_row t`` with t standard normal or Student-t.

    What is unknown of the noise is sampled along with the compliances, as logarithms: first log s,
    then log nu.

    Attributes:
        sigma_factor: How well sigma is known: 1 for exactly (s = 1), inf for not at all (Jeffreys'
            prior 1/s), a number f between for log s normal with standard deviation log f.
        nu: Degrees of freedom of Student's t, inf for normal errors; None to sample it,
            gamma(2, 0.1) a priori.
    """

    sigma_factor: float = 1.0
    nu: float | None = math.inf

    @property
    def names(self) -> tuple[str, ...]:
        """Names of what is sampled of the noise, without the logarithm."""
        return ("sigma_ratio",) * (self.sigma_factor > 1) + ("nu",) * (self.nu is None)

    def log_prior(self, extra: Array) -> Array:
        """Logarithm (...) of the prior of the logarithms `extra` (..., e), up to a constant."""
        total = np.zeros(extra.shape[:-1])
        if 1 < self.sigma_factor < math.inf:
            total = total - 0.5 * (extra[..., 0] / math.log(self.sigma_factor)) ** 2
        if self.nu is None:
            # The density of log nu is that of nu, times nu.
            total = total + NU_SHAPE * extra[..., -1] - NU_RATE * _bounded_exp(extra[..., -1])
        return total

    @property
    def normal(self) -> bool:
        """Whether errors are normal, so that the sum of squared residuals says all."""
        return self.nu == math.inf

    def log_likelihood(
        self, residuals: Array, extra: Array, hidden: int = 0, squares: float = 0.0
    ) -> Array:
        """Logarithm (...) of the density of all measurements, up to a constant.

        Args:
            residuals: Measured less modelled, in units of each row's sigma (..., N).
            extra: Logarithms of s and nu, as far as they are sampled (..., e).
            hidden: Number of further residuals, if errors are normal.
            squares: The sum of their squares.
        """
        N = residuals.shape[-1] + hidden
        log_s = extra[..., 0] if self.sigma_factor > 1 else np.zeros(residuals.shape[:-1])
        # A walker that wanders off to a noise of nothing: its density is next to nothing all the
        # same, and the squares of residuals over it are still numbers.
        log_s = np.maximum(log_s, LEAST_LOG_S)
        if self.normal:
            total = np.einsum("...i,...i->...", residuals, residuals) + squares
            return -N * log_s - 0.5 * np.exp(-2 * log_s) * total
        from scipy.special import gammaln

        nu = _bounded_exp(extra[..., -1]) if self.nu is None else np.full(log_s.shape, self.nu)
        norm = gammaln((nu + 1) / 2) - gammaln(nu / 2) - 0.5 * np.log(nu)
        tails = np.log1p(residuals**2 * (np.exp(-2 * log_s) / nu)[..., None]).sum(axis=-1)
        return N * (norm - log_s) - 0.5 * (nu + 1) * tails

    def start(self, squares: float, freedom: int, rng: np.random.Generator, n: int) -> Array:
        """Draw where n walkers start (n, e): log s about the residuals' size, log nu about ten.

        Args:
            squares: Sum of the squared residuals of the least-squares fit, in units of sigma.
            freedom: Number of measured rows less that of the compliances.
            rng: Source of randomness.
            n: Number of walkers.
        """
        centres: list[float] = []
        widths: list[float] = []
        if self.sigma_factor > 1:
            centres.append(0.5 * math.log(self.spread(squares, freedom)))
            # Standard deviation of log s given so many squares, or of its prior where that is less.
            widths.append(min(1 / math.sqrt(2 * max(freedom, 1)), math.log(self.sigma_factor)))
        if self.nu is None:
            centres.append(math.log(NU_START))
            widths.append(NU_START_WIDTH)
        return np.array(centres) + np.array(widths) * rng.standard_normal((n, len(centres)))

    def spread(self, squares: float, freedom: int) -> float:
        """A first guess of s^2, from the sum of squared residuals in units of sigma."""
        if self.sigma_factor < math.inf:
            return 1.0
        return max(squares / max(freedom, 1), LEAST_SPREAD)


def _bounded_exp(log_nu: Array) -> Array:
    """Degrees of freedom (...) of walkers that may wander far, still as numbers."""
    return np.asarray(np.exp(np.clip(log_nu, -MOST_LOG_NU, MOST_LOG_NU)))


def tracker_noise(
    model: ElastostaticModel, data: Measurements, tracker: Tracker, readings: int | Array
) -> CorrelatedNoise:
    """Add the errors of a tracker to the white noise of measurements.

    The three coordinates of a marker hang together. Where each is a row of its own, those of one
    visit are a group; a coordinate that is there twice belongs to another reading of the marker.

    Args:
        model: Says what is measured; a tracker sees no distances, and its rotations are white.
        data: Poses, markers, visits and white noise.
        tracker: The tracker.
        readings: Readings whose difference or value a displacement is.

    Raises:
        NotPositiveDefiniteError: A measurement has no noise in some direction.
    """
    frames = model.frames(data.q)
    T = np.zeros((len(data), COORDINATES, COORDINATES))
    row = np.full(len(data), -1)  # of a single coordinate, in its marker's position
    marker = -1 - np.arange(len(data))  # rows that no tracker sees have errors of their own
    for members, sensor in data.instruments(model):
        instrument = sensor.whole if isinstance(sensor, OneRow) else sensor
        if isinstance(instrument, Distance) or not sensor.lengths.any():
            continue
        points = instrument.place(frames[members])
        T[members] = readings * tracker.covariance(points[None])[0].transpose(2, 0, 1)
        if isinstance(sensor, OneRow):
            row[members] = sensor.row
            assert data.sensor is not None
            marker[members] = data.sensor[members] - sensor.row  # index of its first row
    if data.sigma.shape[1] > 1:
        return _of_rows(CorrelatedNoise.of_any(data.noise, data.sigma.shape), T)
    return _of_coordinates(data, T, row, marker)


def _of_rows(white: CorrelatedNoise, T: Array) -> CorrelatedNoise:
    """Each row is a position, or a pose whose first coordinates are one."""
    own = white.among(np.arange(len(T))[:, None])[:, 0, :, 0]
    own[:, :COORDINATES, :COORDINATES] += T
    return CorrelatedNoise.by_row(own)


def _of_coordinates(data: Measurements, T: Array, row: Indices, marker: Indices) -> CorrelatedNoise:
    """Each row is a single coordinate, beside the others of its marker in a visit."""
    visit = data.visits[:, None]
    reading = occurrence(row_numbers(visit, marker[:, None], row[:, None]))
    group = row_numbers(visit, marker[:, None], reading[:, None])
    blocks = []
    for members in groups_by_size(group):
        at = row[members]
        shared = T[members[:, :1, None], at[:, :, None], at[:, None]]
        white = data.sigma[members] ** 2 * np.eye(at.shape[1])
        blocks.append(NoiseBlocks(members, shared + white))
    m, rows = data.sigma.shape
    return CorrelatedNoise.of(blocks, (m, rows))


class TooManyVisitsError(ValueError):
    """A group of measurements that hang together is too large."""


def visit_covariance(
    data: Measurements,
    tracker: RowNoise,
    motion: Array,
    discrepancy: Array,
    turns: Array | None = None,
) -> CorrelatedNoise:
    """Covariances ``T + M M'`` within a visit, and ``d d' + B B'`` among all visits of a pose.

    Each measurement has tracker noise T of its own, or shares it with the other coordinates that
    its instrument shows in a visit. The motions M, of joints with their standard
    deviations, are common to all measurements of a visit; the discrepancy d of a marker in a pose,
    under a load, is common to all visits, each coordinate by itself; springs that turn further or
    less than their model says move all of them together, by B.

    Args:
        data: Poses, loads, markers and visits; measured values are not used.
        tracker: Noise of each measurement by itself, or of those of a visit that one instrument
            makes.
        motion: Motions (m, rows, c) by independent errors of size one [m, rad].
        discrepancy: Standard deviations (m, rows) of the model's errors [m, rad].
        turns: A root B (m, rows, n) of its errors in the springs [m, rad]; None without such.

    Raises:
        NotPositiveDefiniteError: Without tracker noise in some direction.
        TooManyVisitsError: A pose is visited more often than a computer likes.
    """
    m, rows = data.sigma.shape
    own = CorrelatedNoise.of_any(tracker, (m, rows))
    shares = turns is not None or discrepancy.any()
    group = data.pose if shares else data.visits
    blocks = []
    for members in groups_by_size(group):
        G, s = members.shape
        if s * rows > MOST_COORDINATES:
            raise TooManyVisitsError(
                f"row {members[0, 0] + 1}: {s} measurements share an error; "
                f"expected {MOST_COORDINATES // rows} at most"
            )
        whole = own.among(members)
        M = motion[members]
        together = data.visits[members][:, :, None] == data.visits[members][:, None]
        moved = np.einsum("gsrc,gtqc->gsrtq", M, M)
        whole += moved * together[:, :, None, :, None]
        d = discrepancy[members]
        shared = data.places[members][:, :, None] == data.places[members][:, None]
        common = np.einsum("gsr,gtr,gst->gstr", d, d, shared)
        axis = np.arange(rows)
        whole[:, :, axis, :, axis] += np.moveaxis(common, -1, 0)
        if turns is not None:
            whole += np.einsum("gsrc,gtqc->gsrtq", turns[members], turns[members])
        blocks.append(NoiseBlocks(members, whole.reshape(G, s * rows, s * rows)))
    return CorrelatedNoise.of(blocks, (m, rows))


def own_covariance(noise: RowNoise, shape: tuple[int, int]) -> Array:
    """Covariances (m, rows, rows) of measurements by themselves [m, rad]^2."""
    m, rows = shape
    if not isinstance(noise, CorrelatedNoise):
        return noise[:, :, None] ** 2 * np.eye(rows)
    found = np.empty((m, rows, rows))
    for block in noise.blocks:
        G, s = block.members.shape
        by_row = block.covariance.reshape(G, s, rows, s, rows)
        found[block.members] = np.moveaxis(np.diagonal(by_row, axis1=1, axis2=3), -1, 1)
    return found
