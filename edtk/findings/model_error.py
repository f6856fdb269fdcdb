"""The fit where the model leaves something out: how much of what, and what that leaves possible."""

from dataclasses import dataclass, replace

import numpy as np

from edtk.findings.causes.faults import FAULTS
from edtk.findings.causes.scene import AXES, Displacements
from edtk.fit.correlated_noise import CorrelatedNoise, RowNoise, groups_by_size
from edtk.fit.distributions import chi_square_tail
from edtk.fit.equilibrium import LinearisedData
from edtk.fit.identify import Identification
from edtk.fit.measurements import Measurements
from edtk.fit.missing import MissingColumns, SizeLikelihood, SizePosterior
from edtk.fit.outliers import DETERMINED, LEVEL
from edtk.measure.missing_pieces import MissingPieces, PossibleSprings
from edtk.measure.model_error import ASSUMED
from edtk.measure.springs import together
from edtk.measure.task import all_compliances
from edtk.robots.frames import load_turns
from edtk.study.study import Study
from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class ModelErrorFound:
    """What a sheet says of all that the model leaves out.

    Attributes:
        pieces: What may be missing.
        posterior: Its sizes.
        possible: What that leaves possible of the springs.
        noise: Covariance (p, p) of the springs by the noise alone.
        shown: What all readings show of the pieces.
        constant: What is left out of a coordinate in any pose, whatever loads it [m].
        beyond: Rows that stand out beyond all that; None where they were not looked for.
    """

    pieces: MissingPieces
    posterior: SizePosterior
    possible: PossibleSprings
    noise: Array
    shown: MissingColumns
    constant: float = 0.0
    beyond: tuple[int, ...] | None = None

    @property
    def counts(self) -> bool:
        """Whether the sheet speaks for something that is missing, so that estimates count it."""
        return self.posterior.is_seen

    @property
    def columns(self) -> tuple[Array, Array]:
        """What readings show of shares of variance one: of all poses (m, rows, c), of each (.., n).

        Sizes are root mean squares of those that are possible.
        """
        across, held, turn = np.sqrt(self.posterior.weights @ np.square(self.posterior.sizes))
        kinds = self.shown.kinds
        shared = self.shown.shared * np.array([across, held])[kinds]
        # Of what friction holds the mean is not zero: the columns are of its squares.
        own = np.moveaxis(shared[..., kinds == 1], -1, 0)
        shared[..., kinds == 1] = np.moveaxis(together(np.sqrt(2.0) * own), 0, -1)
        return shared, self.shown.turns * turn

    def to_dict(self) -> dict[str, float]:
        """The likeliest shares of the pieces [%]."""
        return self.posterior.shares


def find_model_error(
    study: Study,
    data: Measurements,
    seen: LinearisedData,
    fits: tuple[Identification, Identification],
    noise: RowNoise,
    rows: Indices,
    constant: float,
    most: int,
) -> ModelErrorFound | None:
    """Tell from residuals what the model leaves out.

    Args:
        study: The model, and what is uncertain of the day.
        data: The measurements.
        seen: Their linear model about the estimate.
        fits: The fit with the noise of readings alone, and with what visits share.
        noise: The noise of readings, without what visits share.
        rows: The measurements that are not off by themselves.
        constant: What is left out of a coordinate in any pose [m].
        most: How many of these rows may stand out beyond what is left out; zero where nobody looks.

    Returns:
        What was found; None where nothing bends, or the study says that its model is exact.
    """
    usual = usual_share(study)
    alone, fit = fits
    model = study.model
    k = all_compliances(model, alone.k, study.known)
    if not usual or fit.dof < 1 or not (k > 0).any() or not np.isfinite(fit.scale):
        return None
    pieces = MissingPieces.of(study.robot, k, model.torque_of(model.frames(data.q), data.wrench).T)
    columns = _columns(study, data, seen.A, alone, pieces)
    given = BesideModel(seen.A, seen.measured, noise, columns, usual)[rows]
    beyond = rows_beyond_model(given, most)
    posterior = given[np.delete(np.arange(len(rows)), beyond)].posterior
    if posterior is None:
        return None
    possible = posterior.possible(fit.unbounded)
    own = alone.covariance if posterior.is_seen else fit.covariance
    off = tuple(rows[beyond].tolist()) if most else None
    return ModelErrorFound(pieces, posterior, possible, own, columns, constant, off)


def usual_share(study: Study) -> float:
    """The share that a piece is likely to have; zero where the study says that the model is exact.

    A study that states a share, `noise.model_error_percent`, states this one.
    """
    table = study.specification.noise
    if table is None or table.model_error_percent is None:
        return ASSUMED
    return table.model_error_percent / 100


def _columns(
    study: Study, data: Measurements, A: Array, fit: Identification, pieces: MissingPieces
) -> MissingColumns:
    """What readings show of the pieces, and of what else is uncertain."""
    given = (study.model, data.q, data.wrench, lambda frames: data.motion_of(study.model, frames))
    return MissingColumns(
        shared=pieces.shared(*given),
        kinds=pieces.kinds,
        turns=pieces.turns(*given),
        pose=data.pose,
        known=_circumstances(study, data, A, np.maximum(fit.k, 0.0)),
        mean=pieces.mean,
    )


def _circumstances(study: Study, data: Measurements, A: Array, k: Array) -> Array:
    """What readings (m, rows, e) show of what else is uncertain, by one standard deviation each.

    It is the direction of the loads, the tool point, and a drift: what a sheet may tell.
    """
    scene = Displacements(study.model, data, A, k, study.known, False)
    given = study.specification.uncertainty
    tilt = np.deg2rad(given.load_direction_deg)
    found = [given.drift_mm / 1e3 * scene.shift, tilt * _tilted(study, data, k)]
    for axis in AXES:
        for family in scene.families(FAULTS[f"tool_{axis}"].models):
            found.append(given.tool_mm / 1e3 * family.derivative_at_zero(k))
    return np.concatenate(found, axis=-1)


def _tilted(study: Study, data: Measurements, k: Array) -> Array:
    """What readings (m, rows, 3) show of all loads turned about each axis of the world [1/rad]."""
    model = replace(study.model.by_wrench, unknown=(*study.model.joints, *study.known))
    every = np.append(k, list(study.known.values()))
    turned = load_turns(data.wrench)
    shown = [replace(data, wrench=wrench).regressor(model) @ every for wrench in turned]
    return np.stack(shown, axis=-1)


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
        own, BX, gain, By = self._weighed(posterior.likeliest)
        P = own - np.einsum("mrc,cms->mrs", BX, gain)
        Py = By - np.einsum("mrc,c->mr", BX, np.einsum("cmr,mr->c", gain, self.measured))
        return int(_chances(P, Py, self._std).argmin())

    def chances(self, rows: Indices, posterior: SizePosterior) -> Array:
        """Probabilities (a,) of readings as far from what the rest predicts, without all of them.

        The errors of these predictions are ``P_aa^-1 (P y)_a``, with the covariance ``P_aa^-1``.
        They are averages over what a posterior leaves possible of the sizes.
        """
        chosen, weights = posterior.kept
        each = [self._chances(rows, sizes) for sizes in posterior.sizes[chosen]]
        return np.asarray(weights @ np.array(each))

    def _chances(self, aside: Indices, sizes: Array) -> Array:
        """The same for pieces of some sizes (3,)."""
        m, rows = self.measured.shape
        units = np.zeros((m, rows, len(aside), rows))
        units[aside, :, range(len(aside))] = self._std[aside, :, None] * np.eye(rows)
        E = units.reshape(m, rows, -1)
        _, BX, gain, BE = self._weighed(sizes, E)
        P = np.einsum("mra,mrb->ab", E, BE)
        P -= np.einsum("mra,mrc->ac", E, BX) @ np.einsum("cmr,mrb->cb", gain, E)
        y = np.einsum("mra,mr->a", BE, self.measured)
        y -= np.einsum("mra,mrc->ac", E, BX) @ np.einsum("cmr,mr->c", gain, self.measured)
        inverse = np.linalg.pinv(P, rcond=DETERMINED, hermitian=True)
        of_row = np.einsum("aras->ars", inverse.reshape(len(aside), rows, len(aside), rows))
        own = np.linalg.pinv(of_row, rcond=DETERMINED, hermitian=True)
        off = (inverse @ y).reshape(len(aside), rows)
        return _chances(own, np.einsum("ars,as->ar", own, off), np.ones((len(aside), rows)))

    @property
    def _std(self) -> Array:
        """Standard deviations (m, rows) of the noise [m, rad]."""
        return CorrelatedNoise.of_any(self.noise, self.measured.shape).std

    def _weighed(
        self, sizes: Array, others: Array | None = None
    ) -> tuple[Array, Array, Array, Array]:
        """What readings weigh where noise and turns of a pose are of some sizes (3,).

        Returns:
            Inverse covariances B (m, rows, rows) of readings; ``B X`` (m, rows, w) of the columns X
            of pieces and springs; ``(X'BX)^-1 X'B`` (w, m, rows), with the prior of the pieces; and
            ``B`` times other columns (m, rows, c), or the deflections (m, rows).
        """
        m, rows, p = self.A.shape
        across = self.columns.shared * sizes[self.columns.kinds]
        scale = np.sqrt(np.square(self.A).sum(axis=(0, 1)))
        X = np.concatenate([across, self.columns.known, self.A / scale], axis=-1)
        every = np.concatenate([X, self.measured[..., None] if others is None else others], axis=-1)
        noise = CorrelatedNoise.of_any(self.noise, (m, rows))
        own = np.empty((m, rows, rows))
        weighed = np.empty(every.shape)
        for members in groups_by_size(self.columns.pose):
            g, s = members.shape
            T = sizes[2] * self.columns.turns[members].reshape(g, s * rows, -1)
            V = noise.among(members).reshape(g, s * rows, -1) + T @ np.swapaxes(T, 1, 2)
            B = np.linalg.inv(V)
            here = B @ every[members].reshape(g, s * rows, -1)
            weighed[members] = here.reshape(g, s, rows, -1)
            own[members] = np.einsum("girit->girt", B.reshape(g, s, rows, s, rows))
        w = X.shape[-1]
        M = np.einsum("mrc,mrd->cd", X, weighed[..., :w])
        of_pieces = range(w - p)
        M[of_pieces, of_pieces] += 1.0
        gain = np.linalg.solve(M, np.moveaxis(weighed[..., :w], -1, 0).reshape(w, -1))
        rest = weighed[..., w] if others is None else weighed[..., w:]
        return own, weighed[..., :w], gain.reshape(w, m, rows), rest


def _chances(P: Array, Py: Array, std: Array) -> Array:
    """Probabilities (m,) of errors ``P^-1 P y`` (m, rows) whose covariances are ``P^-1``.

    Their squares are chi-square, with as many degrees of freedom as P (m, rows, rows) has
    eigenvalues that are not zero, in units of standard deviations (m, rows).
    """
    values, axes = np.linalg.eigh(std[:, :, None] * P * std[:, None])
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
