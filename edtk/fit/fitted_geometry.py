"""Geometry and springs that were identified, what they predict, and their residuals."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.fit.distributions import student_quantile
from edtk.fit.least_squares import share_inside
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.prior import Prior
from edtk.fit.restricted_likelihood import fitted_kinds
from edtk.measure.equilibrium import Loads, loading_in, no_rest, resting_load
from edtk.measure.expected_error import AssumedJoint
from edtk.measure.measured_model import Load, MeasuredModel, Seen, Torque
from edtk.measure.parameters import Parameter
from edtk.measure.position_noise import PositionNoise
from edtk.measure.springs import Bending
from edtk.robots.frames import MM
from edtk.system.typing import Array, Indices, Mask

RIGID = "rigid_joints"
UNTOLD = ("load", "tool", "drift", RIGID)
LEAST_DOF = 3.0  # of a band: below it a quantile of Student's t says nothing


@dataclass(frozen=True, eq=False)
class Circumstances:
    """Errors of parameters, and of what is taken as it is, by what causes them.

    A circumstance u that is off by a standard deviation s changes readings by ``D s``, and the
    parameters by ``A+ D s`` with the weighted least-squares inverse A+. One that is in the tasks,
    too, as the spring of a joint that counts as rigid, is off there by s itself: of each cause
    there is a root ``E = (A+ D s; -s)``, taken less true, and an error in a pose is ``(J J_o) E``.

    Attributes:
        joints: The joints (a,) that are not identified.
        others: Parameters (o,) that are taken as they are: the springs of these joints, and places
            of markers that count as known.
        roots: Errors (p + o, c) by cause, in the parameters' units; causes are the parts of an
            `ErrorBudget`. That of joints that count as rigid has a column for each of these.
        loads: What loads the joints, whether or not the study asks for springs.
        untold: What of it bends joints that count as rigid, and no reading tells.
    """

    joints: tuple[AssumedJoint, ...]
    others: tuple[Parameter, ...]
    roots: Mapping[str, Array]
    loads: Loads
    untold: Loads

    @property
    def rigid(self) -> tuple[AssumedJoint, ...]:
        """The joints that count as rigid, in the order of their columns."""
        return tuple(one for one in self.joints if one.rigid)

    def among(self, own: Indices, of: tuple[str, ...] = ()) -> "Circumstances":
        """The same of some of the parameters, and of the places of some markers.

        Args:
            own: Which parameters (p,).
            of: The markers; none by default.
        """
        p = next(iter(self.roots.values())).shape[0] - len(self.others)
        kept = [i for i, one in enumerate(self.others) if one.place != "tool" or one.of in of]
        rows = np.array([*own, *(p + i for i in kept)], dtype=int)
        return replace(
            self,
            others=tuple(self.others[i] for i in kept),
            roots={name: E[rows] for name, E in self.roots.items()},
        )


@dataclass(frozen=True, eq=False)
class Predicted:
    """Positions that a fitted model predicts, in the frame of the instrument.

    Attributes:
        points: Positions (m, k, 3) [m].
        std: Standard deviation (m, k, 3) of a measured coordinate about them [m].
        half: Half the width (m, k, 3) of the 95 % band [m].
        open: How far (m, k) what the calibration left open may move each marker, at one standard
            deviation [m].
        turns: Orientations (m, k, 3, 3).
        turn_std: Standard deviation (m, k, 3) of a measured orientation about them, as a turn in
            the axes of the instrument [rad]; None where none is measured.
        turn_half: Half the width (m, k, 3) of its 95 % band [rad]; None likewise.
    """

    points: Array
    std: Array
    half: Array
    open: Array
    turns: Array
    turn_std: Array | None = None
    turn_half: Array | None = None

    def inside(self, measured: Array) -> Mask:
        """Which measured coordinates (m, k, 3) are within the bands; NaN are not."""
        return np.abs(measured - self.points) <= self.half


@dataclass(frozen=True, eq=False)
class ErrorParts:
    """What the coordinates of some poses err by.

    Attributes:
        columns: How they move with the identified parameters (m, r, p) [mm or mrad a unit].
        open: How far what is open moves them (m, r, o), and joints that count as rigid behind that,
            each by one standard deviation [mm or mrad].
        own: Variances (m, r) of a reading and of what the model leaves out [mm^2 or mrad^2].
        slopes: Derivatives (m, r, c) of these by the fitted variances; None where none is fitted.
    """

    columns: Array
    open: Array
    own: Array
    slopes: Array | None


@dataclass(frozen=True, eq=False)
class FittedGeometry:
    """What a prediction needs: a model, its parameters, and how well they are known.

    Attributes:
        model: With the parameters that were identified.
        theta: Their values (p,) in SI units.
        covariance: Of the parameters in their own units (p, p).
        open_parameters: Parameters that the drawing has besides, and that the poses left open.
        shares: How the open ones hang on the identified ones (p, open), in units.
        noise: The errors of a pose.
        placed: Markers (k, 3) in the tool frame, where the geometry of the drawing has them [m]:
            that of the model's start and these is the robot that commands are made for.
        placed_turns: Their orientations (k, 3) there, as rotation vectors [rad]; None where
            positions alone are measured.
        circumstances: What no reading tells; None where nothing is known of that.
    """

    model: MeasuredModel
    theta: Array
    covariance: Array
    open_parameters: tuple[Parameter, ...]
    shares: Array
    noise: PositionNoise
    placed: Array
    placed_turns: Array | None = None
    circumstances: Circumstances | None = None

    def of_markers(self, chosen: Indices) -> "FittedGeometry":
        """The same, of some of the instruments."""
        model = self.model.of_markers(chosen)
        own = [self.model.parameters.index(one) for one in model.parameters]
        names = model.markers
        kept = [
            i
            for i, one in enumerate(self.open_parameters)
            if one.place != "tool" or one.of in names
        ]
        turns = self.placed_turns if model.row_count == 6 else None
        beside = self.circumstances
        return replace(
            self,
            model=model,
            circumstances=None if beside is None else beside.among(np.array(own), names),
            theta=self.theta[own],
            covariance=self.covariance[np.ix_(own, own)],
            open_parameters=tuple(self.open_parameters[i] for i in kept),
            shares=self.shares[np.ix_(own, kept)],
            noise=self.noise.of_markers(chosen),
            placed=self.placed[chosen],
            placed_turns=None if turns is None else turns[chosen],
        )

    @cached_property
    def std(self) -> Array:
        """Standard deviations (p,) in the parameters' units."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def values(self) -> Array:
        """Values (p,) in the parameters' units."""
        return self.theta / self.model.scales

    @cached_property
    def compliances(self) -> Array:
        """Compliances (n,) of all free joints [rad/(N m)]; zero where they are not parameters."""
        return self.model.compliances(self.theta)

    def going_with(self, names: Iterable[str]) -> dict[str, tuple[float, Array]]:
        """Errors of all parameters that go with one of a joint's compliance.

        Of normal errors with the covariance C those that are expected beside one of ``sqrt(C_jj)``
        of the j-th are ``C e_j / sqrt(C_jj)``.

        Args:
            names: Some joints; those whose compliance is no parameter, or exact, are left out.

        Returns:
            By joint, the standard deviation of its compliance [rad/(N m)], and the errors (p,) in
            the parameters' units.
        """
        every = self.model.parameters
        row = {one.of: j for j, one in enumerate(every) if one.place == "compliance"}
        told = [(name, row[name]) for name in names if name in row and self.std[row[name]]]
        return {
            name: (float(self.std[j] * every[j].scale), self.covariance[:, j] / self.std[j])
            for name, j in told
        }

    def under(self, loads: Loads, untold: Loads) -> "FittedGeometry":
        """The same robot, where other loads bend it, see `Circumstances`."""
        found = self.circumstances
        if found is None:
            return self
        return replace(self, circumstances=replace(found, loads=loads, untold=untold))

    @cached_property
    def bending(self) -> Bending:
        """What loads turn all joints by."""
        return self.model.bending(self.theta)

    def at_tool(self, tool: Array) -> "FittedGeometry":
        """The same robot with a tool frame in place of the markers, see `MeasuredModel.at_tool`.

        Of the errors of a reading those of the joints, and of what the model leaves out, are those
        of a marker.

        Args:
            tool: Transform (4, 4) after the last joint [m].
        """
        kept, left = (
            np.array([one.place != "tool" for one in every], dtype=bool)
            for every in (self.model.parameters, self.open_parameters)
        )
        still = np.zeros((1, 3))
        beside = self.circumstances
        return FittedGeometry(
            self.model.at_tool(tool),
            self.theta[kept],
            self.covariance[np.ix_(kept, kept)],
            tuple(one for one in self.open_parameters if one.place != "tool"),
            self.shares[np.ix_(kept, left)],
            replace(
                self.noise, turn=self.noise.turn or 0.0, model_fit=None, tracked=None, ratios=None
            ),
            placed=still,
            placed_turns=still,
            circumstances=None if beside is None else beside.among(np.flatnonzero(kept)),
        )

    def torque(self, q: Array, wrench: Array, loads: Loads | None) -> Load | None:
        """Loads (m, s) of the joints where the springs bring them to rest."""
        return resting_load(self.bending, q, wrench, loads, bool(self.model.robot.compensators))

    def snaps(self, q: Array, wrench: Array, loads: Loads | None) -> Mask:
        """Poses (m,) in which the arm does not come to rest, see `no_rest`."""
        return no_rest(self.bending, q, wrench, loads)

    def columns(self, q: Array, wrench: Array, loads: Loads | None = None) -> Array:
        """How the positions move with the parameters (m, 3k, p) [mm per unit].

        Args:
            q: Joint variables (m, n) [rad or m].
            wrench: Forces and torques (m, 6).
            loads: What they load the joints with.
        """
        seen = self.model.see(self.theta, q, self.torque(q, wrench, loads))
        assert seen.jacobian is not None
        return np.asarray(
            MM * (seen.jacobian * self.model.scales).reshape(len(q), -1, self.model.p)
        )

    def predict(
        self,
        q: Array,
        wrench: Array | None = None,
        loads: Loads | None = None,
        differs: Mask | None = None,
    ) -> Predicted:
        """Positions of all markers in some poses, with 95 % bands.

        The covariance of a pose's coordinates is ``J C J' + R + D``, of the parameters, of a
        reading and of what the model leaves out, under a load of that change besides; and that of
        open parameters where they move the markers.

        Args:
            q: Joint variables (m, n) [rad or m].
            wrench: Forces and torques (m, 6); None for none.
            loads: What they load the joints with.
            differs: Which readings (m,) are their changes under the wrench; None for none.
        """
        seen, motion, columns, apart = self.moves(q, wrench, loads, differs)
        every = motion, seen.places, wrench, differs
        parts = ErrorParts(columns, apart, self.own_variances(*every), self.slopes(*every))
        return self.banded(seen, parts)

    def moves(
        self,
        q: Array,
        wrench: Array | None = None,
        loads: Loads | None = None,
        differs: Mask | None = None,
    ) -> tuple[Seen, Array, Array, Array]:
        """What moves the coordinates of some poses.

        Args:
            q: Joint variables (m, n) [rad or m].
            wrench: Forces and torques (m, 6); None for none.
            loads: What they load the joints with.
            differs: Which readings (m,) are their changes under the wrench; None for none.

        Returns:
            What is seen there, the motions (m, r, n) of the coordinates by the joints, their
            columns (m, r, p), and what is open moves them by (m, r, o), see `ErrorParts`.
        """
        wrench = np.zeros((len(q), 6)) if wrench is None else wrench
        torque = self.loading(q, wrench, loads, differs)
        seen = self.model.see(self.theta, q, torque)
        assert seen.jacobian is not None
        assert seen.by_joints is not None
        m, k = seen.points.shape[:2]
        J = MM * (seen.jacobian * self.model.scales).reshape(m, self.model.row_count * k, -1)
        left = [self._left(q, torque, J)]
        by_cause = self.by_circumstances(q, wrench, differs)
        left += [by_cause[RIGID]] if RIGID in by_cause else []
        motion = seen.by_joints.reshape(*J.shape[:2], -1)
        return seen, motion, J, np.concatenate(left, axis=-1)

    def loading(
        self, q: Array, wrench: Array, loads: Loads | None, differs: Mask | None = None
    ) -> Torque:
        """What loads the joints in poses, and what did before in those that are differences."""
        if differs is not None and differs.any():
            return loading_in(self.bending, q, wrench, loads, differs)
        return self.torque(q, wrench, loads)

    def by_circumstances(
        self, q: Array, wrench: Array, differs: Mask | None = None
    ) -> dict[str, Array]:
        """Errors (m, r, c) of the coordinates in some poses, by what no reading tells [mm, mrad].

        Args:
            q: Joint variables (m, n) [rad or m].
            wrench: Forces and torques (m, 6).
            differs: Which readings (m,) are their changes under the wrench; None for none.

        Returns:
            A column for each standard deviation, by cause; see `Circumstances`.
        """
        found = self.circumstances
        if found is None:
            return {}
        own = self._wide((), q, self.loading(q, wrench, found.loads, differs))
        beside = self._besides(q, wrench, differs)
        wide = np.concatenate([own, beside], axis=-1)
        return {name: wide @ E for name, E in found.roots.items()}

    def _besides(self, q: Array, wrench: Array, differs: Mask | None = None) -> Array:
        """Columns (m, r, o) of what is taken as it is [mm or mrad a unit]."""
        found = self.circumstances
        assert found is not None
        torque = self.loading(q, wrench, found.untold, differs)
        return self._wide(found.others, q, torque)[..., self.model.p :]

    def banded(self, seen: Seen, parts: ErrorParts) -> Predicted:
        """Positions with the bands of some errors."""
        m, k = seen.points.shape[:2]
        J = parts.columns
        known = np.einsum("mrp,pq,mrq->mr", J, self.covariance, J)
        squares = parts.open**2
        left = squares[..., : len(self.open_parameters)].sum(axis=-1)
        # Rounding may leave less than nothing of a variance that is none.
        there = self.model.present.reshape(-1)
        var = np.maximum(known + parts.own + squares.sum(axis=-1), 0.0) * there
        rows = self.model.row_count
        shape = (m, k, rows)
        quantile = student_quantile(0.975, self._dof(parts.slopes, parts.own))
        half = (np.sqrt(var) * quantile).reshape(shape) / MM
        std = np.sqrt(var).reshape(shape) / MM
        return Predicted(
            points=seen.points,
            std=std[..., :3],
            half=half[..., :3],
            open=np.sqrt(left.reshape(shape)[..., :3].sum(axis=-1)) / MM,
            turns=seen.turns,
            turn_std=std[..., 3:] if rows > 3 else None,
            turn_half=half[..., 3:] if rows > 3 else None,
        )

    def lasting(self, q: Array, wrench: Array, loads: Loads | None) -> tuple[Array, Array]:
        """How far off markers really are in some poses, without the errors of readings.

        Where the noise is unknown, readings and model are not told apart, and both count.

        Returns:
            Covariances (m, 3k, 3k) of the coordinates [m^2], and their degrees of freedom (m,),
            those of the variances that were fitted.
        """
        moved = self.moves(q, wrench, loads)
        seen, motion, columns, _ = moved
        C = columns @ self.covariance @ np.swapaxes(columns, 1, 2) + self.beside(q, wrench, moved)
        kept = self.lengths
        C = C[:, kept[:, None], kept]
        fit = self.noise.model_fit
        dof = np.full(len(q), np.inf)
        if fit is not None:
            slopes = self.slopes(motion, seen.places, wrench)
            assert slopes is not None
            slopes = slopes[:, kept].sum(axis=1)
            # Only the part that was fitted is uncertain.
            own = np.einsum("mrr->mr", self.anew(motion, seen.places, wrench))
            own = own[:, kept].sum(axis=1)
            fitted = np.minimum(slopes @ fit.variances, own)
            share = fitted / np.einsum("mrr->m", C)
            dof = np.maximum(fit.relative_dof(slopes) / np.maximum(share, 1e-6) ** 2, LEAST_DOF)
        return C / MM**2, dof

    def bent_besides(self, q: Array, wrench: Array) -> Array:
        """How far joints that count as rigid bend (m, r, a), each by a standard deviation [mm]."""
        found = self.circumstances
        if found is None:
            return np.zeros((len(q), self.model.row_count * len(self.model.markers), 0))
        return np.asarray(self._besides(q, wrench) @ found.roots[RIGID][self.model.p :])

    @property
    def lengths(self) -> Indices:
        """Which rows (3k,) of a pose are of positions."""
        rows = self.model.row_count
        return np.arange(rows * len(self.model.markers)).reshape(-1, rows)[:, :3].ravel()

    def beside(self, q: Array, wrench: Array, moved: tuple[Seen, Array, Array, Array]) -> Array:
        """Covariances (m, r, r) of all that markers are off by but errors of parameters [mm^2].

        Args:
            q: Joint variables (m, n) [rad or m].
            wrench: Forces and torques (m, 6).
            moved: What `moves` says there.
        """
        seen, motion, _, apart = moved
        V = self.anew(motion, seen.places, wrench)
        by_cause = self.by_circumstances(q, wrench)
        for E in (apart, *(E for name, E in by_cause.items() if name != RIGID)):
            V = V + E @ np.swapaxes(E, 1, 2)
        return V

    def anew(self, motion: Array, places: Array, wrench: Array) -> Array:
        """Covariances (m, r, r) of what comes anew in each pose, whatever is known [mm^2, mrad^2].

        It is what the model leaves out, and the joints that do not come back. Where the noise is
        unknown, readings and model are not told apart, and both count.
        """
        noise = self.noise
        left = noise.of_model(motion, loaded=np.asarray(wrench.any(axis=1)))
        if noise.unknown:
            return np.asarray(left + noise.of_reading(motion, places))
        of_joints = motion * np.square(np.asarray(noise.joints)) @ np.swapaxes(motion, 1, 2)
        return np.asarray(left + of_joints)

    def _left(self, q: Array, torque: Torque, J: Array) -> Array:
        """What open parameters that are a standard deviation off move (m, r, o) [mm or mrad].

        It is less by what the others take of them.
        """
        if not self.open_parameters:
            return np.zeros((*J.shape[:2], 0))
        own = self._wide(self.open_parameters, q, torque)[..., self.model.p :]
        spread = np.array([one.spread for one in self.open_parameters])
        return np.asarray((own - J @ self.shares) * spread)

    def _wide(self, others: tuple[Parameter, ...], q: Array, torque: Torque) -> Array:
        """Columns (m, r, p + o) of the parameters, and of others that are as drawn [mm, mrad]."""
        every = self.model.with_parameters((*self.model.parameters, *others))
        theta = np.concatenate([self.theta, np.zeros(len(others))])
        columns = every.see(theta, q, torque).jacobian
        assert columns is not None
        return np.asarray(MM * (columns * every.scales).reshape(len(q), -1, every.p))

    def own_variances(
        self,
        motion: Array,
        places: Array,
        wrench: Array | None = None,
        differs: Mask | None = None,
    ) -> Array:
        """Variances (m, r) of a reading, and of what the model leaves out [mm^2 or mrad^2].

        Args:
            motion: Motions (m, r, n) of the coordinates by the joints [mm/mrad].
            places: Where the markers are (m, k, 3), in the frame of the instrument [m].
            wrench: Forces and torques (m, 6), of which it is but known whether there are any; None
                for none.
            differs: Which readings (m,) are their changes under the wrench; None for none.
        """
        loaded = None if wrench is None else np.asarray(wrench.any(axis=1))
        left = self.noise.of_model(motion, loaded=loaded)
        own = np.einsum("mrr->mr", self.noise.of_reading(motion, places) + left)
        if differs is not None and differs.any():
            changes = self.noise.of_change(motion[differs], places[differs])
            own[differs] = np.einsum("mrr->mr", changes)
        return own

    def dof(
        self,
        motion: Array,
        places: Array,
        wrench: Array | None = None,
        differs: Mask | None = None,
    ) -> Array:
        """Degrees of freedom (m, r) of bands, which fitted variances have; see `own_variances`."""
        every = motion, places, wrench, differs
        return self._dof(self.slopes(*every), self.own_variances(*every))

    def slopes(
        self,
        motion: Array,
        places: Array,
        wrench: Array | None = None,
        differs: Mask | None = None,
    ) -> Array | None:
        """Derivatives (m, r, c) of `own_variances` by the fitted ones; None where none is."""
        noise = self.noise
        if noise.model_fit is None:
            return None
        shape = motion.shape[:2]
        differs = np.zeros(shape[0], dtype=bool) if differs is None else differs
        changed = differs if wrench is None else differs | wrench.any(axis=1)
        # A difference has the errors of two readings, and those of the drawing in neither.
        read = np.where(differs, 2.0 * noise.unknown, 1.0)[:, None]
        parts = [
            *(read * np.einsum("mrr->mr", white) for white in noise.by_whites(places, shape[1])),
            *(
                (motion[..., mask] ** 2).sum(axis=-1) * ~differs[:, None]
                for mask in self.joint_masks(shape[1])
            ),
            *(np.outer(changed, kind) for kind in noise.white_kinds(shape[1])[: noise.changes]),
        ]
        return np.stack(parts, axis=-1)

    def joint_masks(self, width: int) -> list[Mask]:
        """Joints (n,) that share each of the fitted sizes; none where none was fitted."""
        fit = self.noise.model_fit
        if fit is None:
            return []
        drawn = len(fit.variances) - self.noise.changes
        return fitted_kinds(self.model.robot.slides, drawn, len(self.noise.white_kinds(width)))

    def _dof(self, slopes: Array | None, own: Array) -> Array:
        """Degrees of freedom (m, r) of bands with some variances."""
        fit = self.noise.model_fit
        if fit is None or slopes is None:
            return np.full(own.shape, np.inf)
        dof = fit.relative_dof(slopes)
        # Only the part that was fitted is uncertain.
        share = np.divide(slopes @ fit.variances, own, out=np.ones_like(own), where=own > 0)
        return np.maximum(dof / np.maximum(share, 1e-6) ** 2, LEAST_DOF)


def loading_of(
    bending: Bending, data: MarkerPositions, loads: Loads | None, derivatives: bool = True
) -> Torque:
    """What loads the joints at rest in each visit, and what did before, see `loading_in`."""
    return loading_in(bending, data.q, data.wrench, loads, data.is_difference, derivatives)


@dataclass(frozen=True, eq=False)
class TurnResiduals:
    """Residuals of orientations, as turns in the axes of the instrument [rad].

    Attributes:
        residual: Of the fit (m, k, 3); NaN where a marker was not seen.
        left_out: Of each pose predicted without it (m, k, 3).
        left_out_half: Half the widths of the 95 % bands of those (m, k, 3).
    """

    residual: Array
    left_out: Array
    left_out_half: Array


@dataclass(frozen=True, eq=False)
class ToldBefore:
    """What was known of the parameters before the poses, beside what all else says of the same.

    Attributes:
        prior: The knowledge, of the identified parameters.
        mean: Estimates (p,) without what was known of a parameter by itself, in SI units; NaN where
            nothing was, or where nothing else says anything.
        std: Their standard deviations (p,).
        square: Squared distance of an earlier calibration from what all else says of it, over its
            covariance.
        rank: Degrees of freedom of that.
        dof: Degrees of freedom of the noise.
        count: As many parameters it tells: the trace of its share in all of them.
    """

    prior: Prior
    mean: Array
    std: Array
    square: float
    rank: int
    dof: float
    count: float


@dataclass(frozen=True, eq=False)
class GeometricFit:
    """A fit of one sheet, with what tells how good it is.

    Attributes:
        fitted: Parameters and noise.
        data: The positions.
        structural: Rank that enough poses would have.
        redundant: Sentences on parameters that no pose could tell from others.
        open: Sentences on those that these poses do not.
        placed: Root mean square distance [m] with base and tools fitted alone.
        residual: Measured less fitted positions of the poses' means (m, k, 3) [m]; NaN where a
            marker was not seen.
        left_out: The same for each pose predicted without it (m, k, 3), with all its visits.
        left_out_half: Half the widths of the 95 % bands of those (m, k, 3) [m].
        surprise: Squared size (m,) of each pose's error left out, over its covariance: chi-square
            with as many degrees of freedom as coordinates. Of visits of one pose the larger of
            the visit's own, and of its own where the others are known, see `surprise_of`.
        independent: As many independent coordinates tell as much by how many are inside their
            bands, see `independent_coordinates`.
        weights: Weights (m,) of the poses' rows: one, or less where a robust loss trusts them less;
            of visits of one pose, those of their mean and of differences, see `SamePoses`.
        turns: The residuals of orientations; None where these were not measured.
        told_before: What was known before the poses, beside what these say; None where nothing was.
        rescued: Identified parameters that these poses alone do not tell, though others would.
        beyond: Identified parameters that no poses alone would tell from others.
        placed_apart: The same as `placed`, of poses that are left out [m]; zero where poses left
            out are nearer than `placed`.
    """

    fitted: FittedGeometry
    data: MarkerPositions
    structural: int
    redundant: tuple[str, ...]
    open: tuple[str, ...]
    placed: float
    residual: Array
    left_out: Array
    left_out_half: Array
    surprise: Array
    independent: float
    weights: Array
    turns: TurnResiduals | None = None
    told_before: ToldBefore | None = None
    rescued: tuple[Parameter, ...] = ()
    beyond: tuple[Parameter, ...] = ()
    placed_apart: float = 0.0

    @property
    def rank(self) -> int:
        """Number of parameters that were identified."""
        return self.fitted.model.p

    @cached_property
    def of_positions(self) -> "GeometricFit":
        """The same fit, seen from the positions that were read absolutely."""
        absolute = self.absolute
        own = np.flatnonzero(~self.fitted.model.is_distance)
        if len(own) == len(self.data.markers):
            return absolute
        turns = absolute.turns
        if turns is not None:
            parts = (turns.residual, turns.left_out, turns.left_out_half)
            turns = TurnResiduals(*(part[:, own] for part in parts))
        return replace(
            absolute,
            fitted=self.fitted.of_markers(own),
            data=absolute.data.of_markers(own),
            residual=absolute.residual[:, own],
            left_out=absolute.left_out[:, own],
            left_out_half=absolute.left_out_half[:, own],
            turns=turns,
        )

    @cached_property
    def absolute(self) -> "GeometricFit":
        """The same fit, seen from the poses that were read absolutely."""
        own = ~self.data.means.is_difference
        if own.all():
            return self
        names = ("residual", "left_out", "left_out_half", "surprise", "weights")
        turns = self.turns
        if turns is not None:
            parts = (turns.residual, turns.left_out, turns.left_out_half)
            turns = TurnResiduals(*(part[own] for part in parts))
        of_poses = {name: getattr(self, name)[own] for name in names}
        return replace(self, data=self.data.absolute, turns=turns, **of_poses)

    @property
    def reading(self) -> float:
        """Root mean square error of a coordinate by a reading of these positions [mm]."""
        return self.typical(self.fitted.noise)

    def typical(self, noise: PositionNoise) -> float:
        """The same of another noise, whose tracker is in the frame of the instrument."""
        model = self.fitted.model
        return noise.typical(model.see(self.fitted.theta, self.data.means.q, None, False).places)

    @property
    def rms(self) -> float:
        """Root mean square distance of the fit [m]."""
        return root_mean_square(self.residual)

    @property
    def loo_rms(self) -> float:
        """Root mean square distance of poses that were left out one by one [m]."""
        return root_mean_square(self.left_out)

    @property
    def placed_left_out(self) -> float:
        """The same with base and tools fitted alone [m]; NaN where nothing is placed."""
        return max(self.placed, self.placed_apart)

    @property
    def worse_than_placed(self) -> bool:
        """Whether a pose left out is predicted worse than with base and tool alone.

        Where nothing else is fitted, there is nothing to compare.
        """
        fitted = self.fitted.model.parameters
        more = any(one.place in ("joint", "compliance") for one in fitted)
        return more and self.loo_rms > self.placed_left_out

    @cached_property
    def share_inside(self) -> float:
        """Share of coordinates that, left out, are within their 95 % bands."""
        pairs = [(self.left_out, self.left_out_half)]
        if self.turns is not None:
            pairs.append((self.turns.left_out, self.turns.left_out_half))
        errors, halves = (np.concatenate(part, axis=-1) for part in zip(*pairs, strict=True))
        return share_inside(errors, halves)


def lengths(distances: Array) -> Array:
    """Lengths (m, k) of vectors (m, k, 3), and of what distances are off; NaN where nothing was."""
    known = np.isfinite(distances[..., 0])
    return np.where(known, np.sqrt(np.nan_to_num(distances**2).sum(axis=-1)), np.nan)


def root_mean_square(distances: Array) -> float:
    """Root mean square length of vectors (m, k, 3) [m], of which some are NaN."""
    squares = lengths(distances) ** 2
    known = np.isfinite(squares)
    return float(np.sqrt(squares[known].mean())) if known.any() else float("nan")


def root_mean_squares(distances: Array) -> Array:
    """The same of each visit (m,)."""
    return np.array([root_mean_square(one[None]) for one in distances])
