"""Readings that are off by more than noise and the errors of a model that the others show."""

from dataclasses import dataclass, field

import numpy as np

from criteria.linalg.inverse import eigenpairs
from edtk.fit.correlated_noise import CorrelatedNoise, RowNoise, groups_by_size
from edtk.fit.distributions import chi_square_tail
from edtk.fit.missing import MissingColumns, SizeLikelihood, SizePosterior
from edtk.fit.outliers import DETERMINED, LEVEL
from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class BesideModel:
    """Measurements whose model leaves something out, of a size that they tell themselves.

    Attributes:
        A: Regressors (m, rows, p) of the springs.
        measured: Deflections (m, rows) [m, rad].
        noise: Their noise.
        columns: What may be missing.
        usual: Share that a piece has on average.
    """

    A: Array
    measured: Array
    noise: RowNoise
    columns: MissingColumns
    usual: float
    _inverses: dict[float, list[tuple[Indices, Array]]] = field(
        default_factory=dict, init=False, repr=False
    )

    def __getitem__(self, rows: Indices) -> "BesideModel":
        """Some of the measurements."""
        some = (self.A[rows], self.measured[rows], self.noise[rows], self.columns[rows])
        return BesideModel(*some, self.usual)

    @property
    def posterior(self) -> SizePosterior | None:
        """What they say of the sizes; None where they tell no springs."""
        given = (self.A, self.measured, self.noise, self.columns, self.usual)
        return SizeLikelihood.of(*given).posterior

    def least_likely(self, posterior: SizePosterior) -> int:
        """The reading that is farthest from what all others predict, by the likeliest sizes.

        With the covariance V of noise and pieces, and
        ``P = V^-1 - V^-1 A (A' V^-1 A)^-1 A' V^-1``, these predict it with the error
        ``P_ii^-1 (P y)_i``, whose covariance is ``P_ii^-1``. Pieces of all poses are columns with a
        prior of variance one, as in Henderson's equations.
        """
        best = np.array([posterior.likeliest])
        sizes, scales = posterior.sizes[best][0], posterior.scales(best)[0]
        y = self._less_means(sizes, scales)
        own, BX, gain, By = self._weighed(sizes, scales, y.reshape(-1, 1))
        of_row = np.moveaxis(gain.reshape(-1, *y.shape), 0, 1)
        P = own - BX.reshape(*y.shape, -1) @ of_row
        Py = By[:, 0] - BX @ (gain @ y.ravel())
        return int(_chances(P, Py.reshape(y.shape), self._std).argmin())

    def chances(self, rows: Indices, posterior: SizePosterior) -> Array:
        """Probabilities (a,) of readings as far from what the rest predicts, without all of them.

        The errors of these predictions are ``P_aa^-1 (P y)_a``, with the covariance ``P_aa^-1``.
        They are averages over what a posterior leaves possible of the sizes.
        """
        chosen, weights = posterior.kept
        possible = zip(posterior.sizes[chosen], posterior.scales(chosen), strict=True)
        each = [self._chances(rows, sizes, scales) for sizes, scales in possible]
        return np.asarray(weights @ np.array(each))

    def _chances(self, aside: Indices, sizes: Array, scales: Array) -> Array:
        """The same for pieces of some sizes (3,), and those (c,) of the shared columns."""
        m, rows = self.measured.shape
        units = np.zeros((m, rows, len(aside), rows))
        units[aside, :, range(len(aside))] = self._std[aside, :, None] * np.eye(rows)
        E = units.reshape(m * rows, -1)
        _, BX, gain, BE = self._weighed(sizes, scales, E)
        measured = self._less_means(sizes, scales).ravel()
        shown = E.T @ BX
        P = E.T @ BE - shown @ (gain @ E)
        y = BE.T @ measured - shown @ (gain @ measured)
        inverse = np.linalg.pinv(P, rcond=DETERMINED, hermitian=True)
        of_row = np.einsum("aras->ars", inverse.reshape(len(aside), rows, len(aside), rows))
        own = np.linalg.pinv(of_row, rcond=DETERMINED, hermitian=True)
        off = (inverse @ y).reshape(len(aside), rows)
        return _chances(own, np.einsum("ars,as->ar", own, off), np.ones((len(aside), rows)))

    @property
    def _std(self) -> Array:
        """Standard deviations (m, rows) of the noise [m, rad]."""
        return CorrelatedNoise.of_any(self.noise, self.measured.shape).std

    def _less_means(self, sizes: Array, scales: Array) -> Array:
        """Deflections (m, rows) less what pieces of some sizes do on average [m, rad]."""
        pieces = self.columns.pieces
        return np.asarray(self.measured - pieces.shared(sizes[1]) @ (scales * pieces.mean))

    def _weighed(
        self, sizes: Array, scales: Array, others: Array
    ) -> tuple[Array, Array, Array, Array]:
        """What readings weigh where pieces are of some sizes (3,), shared columns of some (c,).

        Args:
            sizes: Those of the pieces.
            scales: Those of the shared columns.
            others: Other columns (m rows, c).

        Returns:
            Inverse covariances B (m, rows, rows) of readings; ``B X`` (m rows, w) of the columns X
            of pieces and springs; ``(X'BX)^-1 X'B`` (w, m rows), with the prior of the pieces; and
            ``B`` times other columns (m rows, c).
        """
        m, rows, p = self.A.shape
        shared = self.columns.pieces.shared(sizes[1]) * scales
        scale = np.sqrt(np.square(self.A).sum(axis=(0, 1)))
        X = np.concatenate([shared, self.columns.known, self.A / scale], axis=-1)
        X = X.reshape(m * rows, -1)
        every = np.concatenate([X, others], axis=1).reshape(m, rows, -1)
        own = np.empty((m, rows, rows))
        of_row = np.empty(every.shape)
        for members, B in self._inverse_noise(float(sizes[2])):
            g, s = members.shape
            here = B @ every[members].reshape(g, s * rows, -1)
            of_row[members] = here.reshape(g, s, rows, -1)
            own[members] = np.einsum("girit->girt", B.reshape(g, s, rows, s, rows))
        w = X.shape[1]
        BX, weighed = np.split(of_row.reshape(m * rows, -1), [w], axis=1)
        M = X.T @ BX
        of_pieces = range(w - p)
        M[of_pieces, of_pieces] += 1.0
        return own, BX, np.asarray(np.linalg.solve(M, BX.T)), weighed

    def _inverse_noise(self, turn: float) -> list[tuple[Indices, Array]]:
        """Rows (g, s) of poses, and inverse covariances (g, s rows, s rows) of these rows.

        They are of noise and of turns of one size, which many possibilities share.
        """
        if turn not in self._inverses:
            rows = self.measured.shape[1]
            noise = CorrelatedNoise.of_any(self.noise, self.measured.shape)
            found: list[tuple[Indices, Array]] = []
            for members in groups_by_size(self.columns.pose):
                g, s = members.shape
                T = turn * self.columns.pieces.turns[members].reshape(g, s * rows, -1)
                V = noise.among(members).reshape(g, s * rows, -1) + T @ np.swapaxes(T, 1, 2)
                found.append((members, np.asarray(np.linalg.inv(V))))
            self._inverses[turn] = found
        return self._inverses[turn]


def _chances(P: Array, Py: Array, std: Array) -> Array:
    """Probabilities (m,) of errors ``P^-1 P y`` (m, rows) whose covariances are ``P^-1``.

    Their squares are chi-square, with as many degrees of freedom as P (m, rows, rows) has
    eigenvalues that are not zero, in units of standard deviations (m, rows).
    """
    values, axes = eigenpairs(std[:, :, None] * P * std[:, None])
    told = values > DETERMINED
    along = np.einsum("mrs,mr->ms", axes, std * Py)
    squares = np.where(told, along**2 / np.where(told, values, 1.0), 0.0).sum(axis=1)
    count = told.sum(axis=1)
    return np.where(count > 0, chi_square_tail(squares, np.maximum(count, 1)), 1.0)


def rows_beyond_model(given: BesideModel, most: int) -> Indices:
    """Readings that stand out beyond noise and the model's errors that the others show.

    So many are set aside one after another, the least likely first, so that they neither hide each
    other nor make the model's errors large. Then those that the rest predicts enter again, the
    likeliest first: a reading stays out whose probability is below 0.01/m (Bonferroni).

    Args:
        given: The measurements.
        most: How many may be off by themselves.

    Returns:
        Their rows, counted from 0.
    """
    every = np.arange(len(given.A))
    rest = every
    for _ in range(most):
        posterior = given[rest].posterior
        if posterior is None:
            break
        rest = np.delete(rest, given[rest].least_likely(posterior))
    aside = np.setdiff1d(every, rest)
    while len(aside):
        posterior = given[np.setdiff1d(every, aside)].posterior
        if posterior is None:
            return aside[:0]
        chances = given.chances(aside, posterior)
        if chances.max() < LEVEL / len(every):
            break
        aside = np.delete(aside, chances.argmax())
    return aside
