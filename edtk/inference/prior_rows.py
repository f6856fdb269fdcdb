"""A prior as further rows of a least-squares problem."""

from dataclasses import dataclass
from math import log

import numpy as np

from edtk.inference.correlated_noise import CorrelatedNoise, NoiseBlocks
from edtk.inference.prior import HalfNormal, LogNormal, Prior
from edtk.inference.whiten import RowNoise
from edtk.system.typing import Array

NEAR = 4.0  # standard deviations of a logarithm, within which it is linearised about an estimate


@dataclass(frozen=True, eq=False)
class PriorRows:
    """Knowledge of compliances beside measurements: ``rows k = values``, with noise of size one.

    They are appended to the rows of measurements, in measurements of their own, whose other
    coordinates say nothing.

    Attributes:
        rows: Regressors (r, p) [1/(rad/(N m))].
        values: Their right-hand sides (r,).
    """

    rows: Array
    values: Array

    @classmethod
    def near(cls, prior: Prior, k: Array) -> "PriorRows":
        """Linearise a prior about compliances.

        Of a compliance that is known to a factor the logarithm is normal: ``log k`` is
        ``log k0 + (k - k0) / k0`` near k0.

        Args:
            prior: Knowledge of the compliances; flat and half-normal densities are left out, as
                these say nothing of a compliance's size but that it is not large.
            k: The compliances (p,) about which it is linearised [rad/(N m)].
        """
        p = len(k)
        rows = []
        values = []
        for i, marginal in enumerate(prior.marginals):
            if isinstance(marginal, LogNormal):
                std = log(marginal.factor)
                near = k[i] > 0 and abs(log(k[i] / marginal.median)) < NEAR * std
                about = k[i] if near else marginal.median
                rows.append(np.eye(p)[i] / (about * std))
                values.append((log(marginal.median / about) + 1) / std)
        if prior.earlier is not None:
            whitener = np.linalg.inv(np.linalg.cholesky(prior.earlier.covariance))
            rows += list(whitener)
            values += list(whitener @ prior.earlier.mean)
        return cls(np.array(rows).reshape(-1, p), np.array(values))

    def with_weak(self, prior: Prior) -> "PriorRows":
        """The same with the half-normal densities, where measurements alone do not tell all."""
        weak = [
            (i, one.scale) for i, one in enumerate(prior.marginals) if isinstance(one, HalfNormal)
        ]
        rows = [np.eye(len(prior.marginals))[i] / scale for i, scale in weak]
        return PriorRows(
            np.concatenate([self.rows, np.array(rows).reshape(-1, self.rows.shape[1])]),
            np.append(self.values, np.zeros(len(rows))),
        )

    def __len__(self) -> int:
        return len(self.values)

    def below(self, A: Array) -> Array:
        """Regressors (m, rows, p) of measurements, with those of the prior below them."""
        coordinates = A.shape[1]
        own = np.zeros((self._count(coordinates) * coordinates, A.shape[-1]))
        own[: len(self)] = self.rows
        return np.concatenate([A, own.reshape(-1, coordinates, A.shape[-1])])

    def measured_below(self, measured: Array) -> Array:
        """Deflections (m, rows), with the values of the prior below them."""
        coordinates = measured.shape[1]
        own = np.zeros(self._count(coordinates) * coordinates)
        own[: len(self)] = self.values
        return np.concatenate([measured, own.reshape(-1, coordinates)])

    def zeros_below(self, change: Array) -> Array:
        """Changes (..., m, rows) of measurements, which leave the prior as it is."""
        extra = self._count(change.shape[-1])
        return np.concatenate([change, np.zeros((*change.shape[:-2], extra, change.shape[-1]))], -2)

    def noise_below(self, noise: RowNoise, coordinates: int) -> RowNoise:
        """The noise of measurements, with that of size one below it."""
        extra = self._count(coordinates)
        if not isinstance(noise, CorrelatedNoise):
            return np.concatenate([noise, np.ones((extra, coordinates))])
        m = noise.shape[0]
        own = NoiseBlocks(
            m + np.arange(extra)[:, None], np.tile(np.eye(coordinates), (extra, 1, 1))
        )
        return CorrelatedNoise.of([*noise.blocks, own], (m + extra, coordinates))

    def _count(self, coordinates: int) -> int:
        """Measurements of so many coordinates that hold all rows."""
        return -(-len(self) // coordinates)
