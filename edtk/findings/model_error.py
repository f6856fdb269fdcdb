"""The fit where the model leaves something out: how much of what, and what that leaves possible."""

from dataclasses import dataclass, replace

import numpy as np

from edtk.findings.causes.faults import FAULTS
from edtk.findings.causes.scene import AXES, Displacements
from edtk.fit.beside_model import BesideModel, rows_beyond_model
from edtk.fit.correlated_noise import RowNoise, whole_groups
from edtk.fit.equilibrium import LinearisedData
from edtk.fit.identify import Identification
from edtk.fit.measurements import Measurements
from edtk.fit.missing import MissingColumns, SizePosterior
from edtk.measure.friction import SPREAD_OF_SHARES, scatter, together
from edtk.measure.missing_pieces import SPREAD_ACROSS, MissingPieces, PieceColumns, PossibleSprings
from edtk.measure.model_error import ASSUMED
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

    def columns(self, rows: Indices) -> tuple[Array, Array]:
        """What some readings show of shares of variance one: of all poses (.., c), of each (.., n).

        Sizes are root mean squares of those that are possible.
        """
        scales, turn = self.posterior.spread
        pieces = self.shown.pieces[rows]
        shared = pieces.shared(scales[-1]) * scales
        # Means are not zero: the columns are of their squares, too.
        for kind, spread in enumerate((SPREAD_ACROSS, SPREAD_OF_SHARES)):
            own = pieces.kinds == kind
            whole = np.moveaxis(shared[..., own], -1, 0) / scatter(spread)
            shared[..., own] = np.moveaxis(together(whole, spread), 0, -1)
        return shared, pieces.turns * turn

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
    given = BesideModel(seen.A, seen.measured, noise, columns, usual)
    if len(rows) < len(data):
        given = given[rows]
    beyond = rows_beyond_model(given, most)
    if len(beyond):
        given = given[np.delete(np.arange(len(rows)), beyond)]
    posterior = given.posterior
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
    blocks = list(whole_groups(data.pose))
    if len(blocks) == 1:
        return _some_columns(study, data, A, fit, pieces)
    every: dict[str, Array] = {}
    for rows in blocks:
        some = _some_columns(study, data[rows], A[rows], fit, pieces)
        parts = {name: getattr(some.pieces, name) for name in ("across", "turns", "torque")}
        for name, part in {**parts, "known": some.known}.items():
            every.setdefault(name, np.empty((len(data), *part.shape[1:])))[rows] = part
    return MissingColumns(
        PieceColumns(every["across"], every["turns"], every["torque"], pieces.load),
        data.pose,
        every["known"],
    )


def _some_columns(
    study: Study, data: Measurements, A: Array, fit: Identification, pieces: MissingPieces
) -> MissingColumns:
    """The same of some readings."""
    given = (study.model, data.q, data.wrench, lambda frames: data.motion_of(study.model, frames))
    known = _circumstances(study, data, A, np.maximum(fit.k, 0.0))
    return MissingColumns(pieces.columns(*given), data.pose, known)


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
