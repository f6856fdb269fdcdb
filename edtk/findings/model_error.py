"""The fit where the model leaves something out: how much of what, and what that leaves possible."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from edtk.findings.causes.faults import FAULTS
from edtk.findings.causes.find_causes import most_outliers
from edtk.findings.causes.scene import AXES, Displacements
from edtk.findings.moving_joints import constant_error, readings_alone
from edtk.fit.missing import USUAL, MissingColumns, SizeLikelihood, SizePosterior
from edtk.measure.missing_pieces import MissingPieces, PossibleSprings
from edtk.measure.task import all_compliances
from edtk.study.study import Study
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    from edtk.findings.fitted_data import FittedData


@dataclass(frozen=True, eq=False)
class ModelErrorFound:
    """What a sheet says of all that the model leaves out.

    Attributes:
        pieces: What may be missing.
        posterior: Its sizes.
        possible: What that leaves possible of the springs.
        noise: Covariance (p, p) of the springs by the noise alone.
        constant: What is left out of a coordinate in any pose, whatever loads it [m].
    """

    pieces: MissingPieces
    posterior: SizePosterior
    possible: PossibleSprings
    noise: Array
    constant: float = 0.0

    @property
    def counts(self) -> bool:
        """Whether the sheet speaks for something that is missing, so that estimates count it."""
        return self.posterior.is_seen

    def to_dict(self) -> dict[str, float]:
        """The likeliest shares of the pieces [%]."""
        across, held, turn = (100 * self.posterior.likeliest).tolist()
        return {"across_percent": across, "held_percent": held, "turn_percent": turn}


def with_model_error(plain: "FittedData", fitted: "FittedData") -> "FittedData":
    """The same with what the sheet says of all that the model leaves out.

    The estimate stays that of least squares: a spring that takes up a part of what is missing
    serves a task better than its true compliance would. Where the sheet speaks for something that
    is missing, the covariance is that of the true compliances about it.

    Args:
        plain: The fit with the noise of the readings alone.
        fitted: The same with the noise that visits share.
    """
    usual = usual_share(plain.study)
    if not usual or plain.untold or plain.how.linear or fitted.fit.dof < 1:
        return fitted  # what bends is no error of a linear model that was asked for
    found = _found(plain, fitted, usual)
    if found is None:
        return fitted
    fit = fitted.fit
    noise = fit.covariance
    possible = found.posterior.possible(fit.unbounded)
    if found.posterior.is_seen:
        noise = plain.fit.covariance
        dof = np.inf if fit.known else fit.covariance_dof
        fit = replace(fit, covariance=possible.spread(len(fit.k)), covariance_dof=dof)
    constant = constant_error(fitted)
    error = ModelErrorFound(found.pieces, found.posterior, possible, noise, constant)
    same = replace(fitted, fit=fit, model_error=error)
    # What was found of the residuals before took its time, and stays.
    kept = ("found_causes", "noise_estimate", "lack_of_fit", "explanation")
    vars(same).update({name: value for name, value in vars(fitted).items() if name in kept})
    return same


@dataclass(frozen=True, eq=False)
class _Found:
    """Pieces, and their sizes."""

    pieces: MissingPieces
    posterior: SizePosterior


def _found(plain: "FittedData", fitted: "FittedData", usual: float) -> _Found | None:
    """Sizes of what the model leaves out; None where nothing bends, or rows hang together."""
    study = plain.study
    data = plain.data
    model = study.model
    k = all_compliances(model, plain.fit.k, study.known)
    if not (k > 0).any() or not np.isfinite(fitted.fit.scale):
        return None
    pieces = MissingPieces.of(study.robot, k, model.torque_of(model.frames(data.q), data.wrench).T)
    rows = _sound_rows(fitted)
    noise = readings_alone(fitted)
    columns = _columns(plain, pieces)[rows]
    seen = SizeLikelihood.of(plain.A[rows], plain.measured[rows], noise[rows], columns, usual)
    try:
        posterior = seen.posterior
    except np.linalg.LinAlgError:
        return None
    if not np.isfinite(posterior.weights).all():
        return None
    return _Found(pieces, posterior)


def usual_share(study: Study) -> float:
    """The share that a piece is likely to have; zero where the study says that the model is exact.

    A study that states a share, `noise.model_error_percent`, states this one.
    """
    table = study.specification.noise
    if table is None or "model_error_percent" not in table.model_fields_set:
        return USUAL
    return float(table.model_error_percent) / 100


def _sound_rows(fitted: "FittedData") -> Indices:
    """The measurements that are not off by themselves."""
    every = np.arange(len(fitted.data))
    off = {*fitted.found_causes.outliers, *fitted.fit.outliers.tolist()}
    return every if len(off) > most_outliers(len(every)) else np.delete(every, list(off))


def _columns(plain: "FittedData", pieces: MissingPieces) -> MissingColumns:
    """What readings show of the pieces, and of what else is uncertain."""
    study, data = plain.study, plain.data
    given = (study.model, data.q, data.wrench, lambda frames: data.motion_of(study.model, frames))
    return MissingColumns(
        shared=pieces.shared(*given),
        kinds=pieces.kinds,
        turns=pieces.turns(*given),
        pose=data.pose,
        known=_circumstances(plain),
    )


def _circumstances(plain: "FittedData") -> Array:
    """What readings (m, rows, e) show of what else is uncertain, by one standard deviation each.

    It is the direction of the loads, the tool point, and a drift: what a sheet may tell.
    """
    study, data = plain.study, plain.data
    k = np.maximum(plain.fit.k, 0.0)
    scene = Displacements(study.model, data, plain.A, k, study.known, False)
    given = study.specification.uncertainty
    tilt = np.deg2rad(given.load_direction_deg)
    found = [given.drift_mm / 1e3 * scene.shift, tilt * _tilted(plain, k)]
    for axis in AXES:
        for family in scene.families(FAULTS[f"tool_{axis}"].models):
            found.append(given.tool_mm / 1e3 * family.derivative_at_zero(k))
    return np.concatenate(found, axis=-1)


def _tilted(plain: "FittedData", k: Array) -> Array:
    """What readings (m, rows, 3) show of all loads turned about each axis of the world [1/rad]."""
    study, data = plain.study, plain.data
    model = replace(study.model.by_wrench, unknown=(*study.model.joints, *study.known))
    every = np.append(k, list(study.known.values()))
    force, torque = data.wrench[:, :3], data.wrench[:, 3:]
    turned = (np.hstack([np.cross(axis, force), np.cross(axis, torque)]) for axis in np.eye(3))
    shown = [replace(data, wrench=wrench).regressor(model) @ every for wrench in turned]
    return np.stack(shown, axis=-1)
