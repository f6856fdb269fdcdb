"""What errors of the springs leave in tasks, where a study with [parameters] reads differences."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from edtk.calibration.model_left import possible_from_dict, possible_to_dict
from edtk.findings.model_error import usual_share
from edtk.fit.correlated_noise import CorrelatedNoise
from edtk.fit.distributions import NormalMixture
from edtk.fit.geometry.fitted_geometry import MM, FittedGeometry, GeometricFit, loading_of
from edtk.fit.geometry.least_squares_fit import PoseRows
from edtk.fit.missing import MissingColumns, SizeLikelihood
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.instruments.marker import Marker
from edtk.measure.missing_pieces import MissingPieces, PossibleSprings
from edtk.robots.frames import BodyPoint, load_turns
from edtk.study.study_geometry import StudyGeometry
from edtk.system.typing import Array

ROWS = 3  # of a position
MOST = 0.975


@dataclass(frozen=True, eq=False)
class PiecesLeft:
    """Parameters, and pieces that the springs lack, that readings under loads leave possible.

    Attributes:
        names: The parameters (p,).
        pieces: What may be missing.
        possible: Their sizes, and errors of the parameters in their units, true less identified.
        shares: The likeliest shares of the pieces, by name [%].
    """

    names: tuple[str, ...]
    pieces: MissingPieces
    possible: PossibleSprings
    shares: Mapping[str, float] = field(default_factory=dict)

    @property
    def counts(self) -> bool:
        """Whether the sheet speaks for a piece."""
        return any(self.shares.values())

    @classmethod
    def of(cls, setting: StudyGeometry, fit: GeometricFit) -> "PiecesLeft | None":
        """Tell them from the residuals of differences of readings, of positions alone.

        Absolute readings have a random error of the model in each pose instead, as what bends the
        arm without a load is in them, too.

        Returns:
            What is left; None where nothing is read as a difference, or other springs than those of
            the joints are among the parameters, or the study says that its model is exact.
        """
        fitted, means, loads = fit.fitted, fit.data.means, setting.loads
        differs = means.is_difference
        plain = fitted.model.row_count == ROWS and not fitted.model.is_distance.any()
        told = fit.told_before is None and not fitted.noise.unknown and not fitted.open_parameters
        k = fitted.compliances
        usual = usual_share(setting.study)
        if loads is None or setting.elastic or not usual:
            return None
        if not (differs.any() and plain and told and k.any()):
            return None
        rows = PoseRows.of(
            fitted.model, fitted.theta, means, loading_of(fitted.bending, means, loads)
        )
        noise = replace(fitted.noise, model_change=(0.0, 0.0))
        V = noise.of_pose(rows.motion, rows.places, rows.worth(fit.data), differs).dense
        model = replace(loads.by_wrench, sensors=_markers(fitted))
        torque = model.torque_of(model.frames(means.q[differs]), means.wrench[differs])
        pieces = MissingPieces.of(model.robot, k, torque.T)
        seen = (means.rows_seen & differs[:, None, None]).reshape(len(V), -1, 1)
        shared, turns = (
            MM * _in_frame(fitted, one(model, means.q, means.wrench)) * seen
            for one in (pieces.shared, pieces.turns)
        )
        own = np.arange(len(V))
        tilt = np.deg2rad(setting.study.specification.uncertainty.load_direction_deg)
        shown = _tilted(model, means.q, means.wrench) @ k
        tilted = MM * tilt * _in_frame(fitted, np.moveaxis(shown, 0, -1)) * seen
        columns = MissingColumns(shared, pieces.kinds, turns, own, tilted)
        likelihood = SizeLikelihood.of(
            rows.design, rows.residual, CorrelatedNoise.by_row(V), columns, usual
        )
        posterior = likelihood.posterior
        if posterior is None:
            return None
        possible = posterior.possible(np.zeros(fitted.model.p))
        names = tuple(one.name for one in fitted.model.parameters)
        return cls(names, pieces, possible, posterior.shares)

    def mixture(
        self, fitted: FittedGeometry, model: ElastostaticModel, q: Array, wrench: Array, J: Array
    ) -> NormalMixture:
        """Errors (t, r) of tool or markers in poses, by parameters and pieces [m].

        Args:
            fitted: The robot with that tool, or with the markers.
            model: The same drawing under wrenches.
            q: Poses (t, n) [rad or m].
            wrench: Loads (t, 6) [N, N m].
            J: Columns (t, r, p) of its parameters [mm a unit].
        """
        kept = [self.names.index(one.name) for one in fitted.model.parameters]
        c = len(self.pieces.kinds)
        some = [*range(c), *(c + i for i in kept)]
        own = replace(
            self.possible,
            mean=self.possible.mean[:, some],
            covariance=self.possible.covariance[:, some][:, :, some],
        )
        at = replace(model, sensors=_markers(fitted))
        shared = _in_frame(fitted, self.pieces.shared(at, q, wrench))
        turns = _in_frame(fitted, self.pieces.turns(at, q, wrench))
        # A root mean square over the markers.
        root = np.sqrt(len(fitted.model.markers))
        every = np.concatenate([shared, J / MM], axis=-1) / root
        mean, V = own.errors(every, turns / root)
        return NormalMixture(own.weights, mean, V)

    def in_tasks(self, setting: StudyGeometry, fitted: FittedGeometry) -> "LeftInTasks | None":
        """What is left in the study's tasks; None without one, or where markers count.

        Args:
            setting: The study.
            fitted: The identified robot.
        """
        tasks = setting.study.tasks
        if not tasks or any(task.tool is None for task in tasks):
            return None
        sizes, moved = [], []
        parts = []
        for task in tasks:
            assert task.tool is not None
            robot, loads = fitted.at_tool(task.tool), setting.every_load_of(task)
            q = np.atleast_2d(task.q)
            wrench = np.tile(task.wrench, (len(q), 1))
            _, _, J, _ = robot.moves(q, wrench, loads)
            found = self.mixture(robot, loads.by_wrench, q, wrench, J[:, :ROWS])
            own = J[:, :ROWS] @ robot.covariance @ np.swapaxes(J[:, :ROWS], 1, 2) / MM**2
            sizes.append([found.size[0] ** 2, np.einsum("trr->", own)])
            at = replace(loads.by_wrench, unknown=None)
            moved.append(np.linalg.norm(at.regressor(q, wrench) @ self.pieces.k) ** 2)
            parts.append(found)
        total, noise = np.sqrt(tasks.shares @ np.array(sizes))
        before = float(np.sqrt(tasks.shares @ np.array(moved)))
        twice = np.array([2 * total])
        chance = float(tasks.shares @ np.array([one.beyond(twice)[0] for one in parts]))
        most = max(float(one.quantiles([MOST])[0, 0]) for one in parts)
        return LeftInTasks(float(total), float(noise), before, chance, most, tasks.place)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers; parameters in their units."""
        table = possible_to_dict(self.pieces, self.possible)
        return {"names": list(self.names), **table}

    @classmethod
    def from_dict(cls, given: Mapping[str, Any], names: tuple[str, ...], n: int) -> "PiecesLeft":
        """What a file says, see `to_dict`.

        Args:
            given: Its table.
            names: Names of the parameters of the result.
            n: Number of joints.

        Raises:
            ValueError: It is not valid.
        """
        if given.get("names") != list(names):
            raise ValueError("names: expected those of the parameters")
        pieces, possible = possible_from_dict(given, len(names), n)
        return cls(names, pieces, possible)


@dataclass(frozen=True)
class LeftInTasks:
    """Errors in the tasks after a compensation [m].

    Attributes:
        total: Root mean square, by parameters and pieces.
        noise: Of it what the covariance of the parameters makes, without pieces.
        before: The displacement without compensation.
        chance: Of an error of more than twice the total.
        most: The error that is exceeded with a chance of 2.5 %, in the worst task.
        place: Where, in words.
    """

    total: float
    noise: float
    before: float
    chance: float
    most: float
    place: str

    @property
    def model(self) -> float:
        """What the model makes of the total."""
        return float(np.sqrt(max(self.total**2 - self.noise**2, 0.0)))


def _tilted(model: ElastostaticModel, q: Array, wrench: Array) -> Array:
    """Regressors (3, m, 3k, n) under loads turned about each axis of the world [1/rad]."""
    every = replace(model, unknown=None)
    return np.stack([every.regressor(q, one) for one in load_turns(wrench)])


def _markers(fitted: FittedGeometry) -> tuple[Marker, ...]:
    """The markers of a fit, on the bodies of the drawing."""
    pairs = zip(fitted.model.offsets, fitted.model.bodies, strict=True)
    return tuple(Marker(BodyPoint(np.asarray(offset), body)) for offset, body in pairs)


def _in_frame(fitted: FittedGeometry, columns: Array) -> Array:
    """Columns (m, 3k, c) in the axes of the instrument, of those in the world's."""
    R = fitted.model.start[:ROWS, :ROWS]
    m, rows, c = columns.shape
    return (R @ columns.reshape(m, rows // ROWS, ROWS, c)).reshape(m, rows, c)
