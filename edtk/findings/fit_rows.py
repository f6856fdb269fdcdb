"""Residuals and columns of the positions of a fit, and what grew or drifted over a day."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Literal

import numpy as np

from edtk.findings.causes.family import Cause, Family
from edtk.findings.causes.faults import FAULTS, USUAL_DRIFT, USUAL_GROWTH
from edtk.findings.causes.scene import JointLoads, Positions, link_length, same_in, since_first
from edtk.fit.distributions import fisher_tail, student_below
from edtk.fit.fitted_geometry import FittedGeometry, GeometricFit
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.pose_rows import PoseRows, columns_of
from edtk.fit.prior import PriorRows
from edtk.fit.same_poses import SamePoses
from edtk.measure.equilibrium import Loads
from edtk.measure.few_columns import Beside, FewColumns, summed
from edtk.measure.measured_model import Seen
from edtk.measure.parameters import Parameter, all_parameters
from edtk.measure.position_noise import PositionNoise
from edtk.measure.task import Task
from edtk.measure.whitening import Scatter
from edtk.robots.frames import MM
from edtk.system.typing import Array, Indices, Mask

TAKEN = 1e-4  # of a column, at most, that a fit leaves which takes it up
RATES = (0.0, 3.0, 8.0)  # of settling in a day: a steady drift, and warming up
FEWEST_OF_TREND = 8  # poses
UNLIKELY_SCALE = 1e-3  # as of knowledge that measurements contradict
LEAST_SCALE = 1e-4  # [m/m] below it a scale is that of the air's temperature
BUILT_TO = np.geomspace(0.02, 20.0, 13)  # [mm, mrad] errors of the drawing of a robot
SHARE_OF_SCALE = 1e-9  # of what is known, which rounding makes where the poses tell no lengths


@dataclass(frozen=True, eq=False)
class FitRows:
    """What the positions of the poses leave, in millimetres; orientations are left aside.

    Rows of what was not seen are zero. Visits of one pose share what the drawing errs by: they are
    weighed by rows that err independently, see `SamePoses`.

    Attributes:
        fit: The fit.
        residual: Residuals (m, 3k).
        design: Columns X (m, 3k, p) that span those of its parameters.
        motion: Motions (m, 3k, n) by the joints [mm/mrad].
        places: Where the markers are (m, k, 3), in the frame of the instrument [m].
        noise: The noise of positions that was fitted.
        loads: What loads the joints; None without springs.
    """

    fit: GeometricFit
    residual: Array
    design: FewColumns
    motion: Array
    places: Array
    noise: PositionNoise
    loads: JointLoads | None = None

    @classmethod
    def of(cls, fit: GeometricFit, loads: JointLoads | None = None) -> "FitRows":
        """Of a fit.

        Args:
            fit: The fit.
            loads: What loads the joints.
        """
        model = fit.fitted.model
        means = fit.data.means
        torque = fit.fitted.torque(means.q, means.wrench, loads)
        seen = model.see(fit.fitted.theta, means.q, torque)
        assert seen.by_joints is not None
        return cls(
            fit,
            MM * np.nan_to_num(fit.residual).reshape(len(means), -1),
            # Absolute positions alone need not tell all that springs, turns, wires and earlier
            # knowledge do: dependent columns would take some of the residuals at random.
            own_columns(fit, loads).independent(),
            of_all(seen.by_joints[:, :, :3], means),
            seen.places,
            replace(fit.fitted.noise, turn=None, model_turn=0.0),
            loads,
        )

    @cached_property
    def same(self) -> SamePoses:
        """Which visits are of one pose."""
        return replace(self.fit.data.means, turns=None).same_poses

    @cached_property
    def independent(self) -> PoseRows:
        """The same as rows that err independently."""
        design = self._independent(self.design)
        return PoseRows(self.apart(self.residual), design, self.motion, self.places, self.same)

    def _independent(self, design: FewColumns) -> FewColumns:
        """A design of the visits as one of such rows."""
        return replace(design, part=self.same.apart(design.part))

    def apart(self, columns: Array) -> Array:
        """Columns (m, 3k, ...) of the visits as such rows."""
        each = columns.reshape(*self.same.worth.shape, *columns.shape[2:])
        return self.same.apart(each).reshape(columns.shape)

    def left(self, columns: Array, by: Beside) -> Array:
        """What a design of such rows leaves of columns (m, 3k, c) of the visits."""
        rows = by.left(self.apart(columns))
        return self.same.back(rows.reshape(*self.same.worth.shape, -1)).reshape(columns.shape)

    @cached_property
    def scene(self) -> Positions:
        """What faults change, to first order about the fit [mm]."""
        means = self.fit.data.means

        def columns(seen: Seen, chosen: Indices) -> Array:
            return MM * of_positions(seen, means).chosen(chosen)

        return scene_of(self.fit.fitted, means.q, means.wrench, self.loads, columns)

    def without(self, added: Array) -> MarkerPositions:
        """The positions without what something adds to them (m, 3k) [mm]."""
        data = self.fit.data
        own = added.reshape(len(added), -1, 3)[data.pose] / MM
        return replace(data, measured=data.measured - own)

    def off_in(
        self, task: Task, loads: JointLoads, named: "NamedCause", cleared: FittedGeometry
    ) -> Array:
        """How far a robot with a fault is off in a task (3,), compensated by the fit [mm].

        Without the fault another fit would be found. Commands are off by the difference of both,
        less what the fault does in the task: what is wrong with the measurements alone does nothing
        there.

        Args:
            task: The task, with a tool.
            loads: What loads the joints there.
            named: The fault.
            cleared: The fit of positions that are without it.
        """
        assert task.tool is not None
        q = np.atleast_2d(task.q)
        wrench = np.tile(task.wrench, (len(q), 1))
        robot, other = (one.at_tool(task.tool) for one in (self.fit.fitted, cleared))
        there, without = (one.predict(q, wrench, loads).points for one in (robot, other))
        off = MM * (there - without)[0, 0]
        fault = FAULTS[named.family.cause]
        if not (fault.in_tasks or fault.drawn):
            return np.asarray(off)

        def columns(seen: Seen, chosen: Indices) -> Array:
            assert seen.jacobian is not None
            return MM * seen.jacobian[:, 0, :3][..., chosen]

        scene = replace(scene_of(robot, q, wrench, loads, columns), counted_by=self.scene)
        family = same_in(scene, fault.models, named.family)
        return np.asarray(off - family.derivative_at_zero(scene.k)[0] @ named.values)

    @property
    def by_scale(self) -> Array:
        """Columns (m, 3k, 1) of a scale of the instrument [mm a mm/m]; it turns nothing."""
        return of_all(self.places[..., None], self.fit.data.means)

    @property
    def frame(self) -> Array:
        """Columns (m, 3k, 6) of a motion of the frame [mm a mm, mm a mrad]."""
        return self.scene.frame / MM

    def beside(self, others: Sequence[Parameter]) -> "FitRows":
        """The same, as if other parameters were fitted too: noise and columns are beside theirs.

        Columns are orthonormal then, and as many as the parameters that the poses tell apart.

        Args:
            others: Parameters that are none of the fit; without any, nothing changes.
        """
        if not others:
            return self
        fitted = self.fit.fitted
        means = self.fit.data.means
        every = fitted.model.with_parameters((*fitted.model.parameters, *others))
        theta = np.concatenate([fitted.theta, np.zeros(len(others))])
        added = np.arange(fitted.model.p, every.p)
        columns = of_positions(every.see(theta, means.q), means).in_units(MM * every.scales)
        design = self.design.beside(columns.chosen(added)).independent()
        return replace(self, design=design, noise=self._noise_beside(design))

    def dof(self, others: int) -> int:
        """Coordinates that neither the fit nor so many other columns take."""
        return 3 * int(self.fit.data.means.seen.sum()) - self.design.rank - others

    def noise_beside(self, columns: Array) -> PositionNoise:
        """The noise, fitted beside other columns (m, 3k, c) too, that it may have hidden."""
        return self._noise_beside(self.design.beside(columns))

    def _noise_beside(self, design: FewColumns) -> PositionNoise:
        """The noise, fitted beside a design."""
        rows = replace(self.independent, columns=self._independent(design))
        return rows.with_model_error(self.noise, self.fit.fitted.model.robot.slides)

    def weighed(self, noise: PositionNoise | None) -> Beside:
        """The design by weights of a noise, as rows that err independently.

        Where there is none, all readings count alike.
        """
        V = self.independent.errors(noise or self.noise)
        if noise is None:
            variances = V.variances
            worth = self.same.worth.reshape(variances.shape)
            read = np.where(worth > 0, worth, 1.0)
            alike = np.where(worth > 0, variances.mean() / read, 1.0)
            V = Scatter(np.zeros_like(V.apart), V.together[..., :0]).with_white(alike)
        return Beside.of(self.independent.columns, V)

    def explained(self, columns: Array, by: Beside) -> "Explained":
        """What columns (m, 3k, c) explain of the residuals, beside the design."""
        both = np.concatenate([self.residual[..., None], columns], axis=-1)
        left = by.left(self.apart(both))
        squares = summed(left, by.weights.times(left))
        inverse = np.asarray(np.linalg.pinv(squares[1:, 1:], hermitian=True))
        values = inverse @ squares[1:, 0]
        fall = float(values @ squares[1:, 0])
        return Explained(values, inverse, fall, fall / max(float(squares[0, 0]), 1e-300))


def scene_of(
    fitted: FittedGeometry,
    q: Array,
    wrench: Array,
    loads: JointLoads | None,
    read: Callable[[Seen, Indices], Array],
    differs: Mask | None = None,
) -> Positions:
    """What faults change in some poses, to first order about a fit [mm].

    Args:
        fitted: The robot.
        q: Poses (m, n) [rad or m].
        wrench: Loads (m, 6) [N, N m].
        loads: What loads the joints; None without springs.
        read: Columns (m, rows, c) of some parameters, of all that is seen.
        differs: Which readings (m,) are their changes under the wrench; None for none.
    """
    model = fitted.model

    def columns(parameters: tuple[Parameter, ...], wrench: Array) -> Array:
        torque = fitted.loading(q, wrench, loads, differs)
        known = [one.name for one in model.parameters]
        others = tuple(one for one in parameters if one.name not in known)
        every = model.with_parameters((*model.parameters, *others))
        theta = np.concatenate([fitted.theta, np.zeros(len(others))])
        names = [one.name for one in every.parameters]
        chosen = np.array([names.index(one.name) for one in parameters], dtype=int)
        return read(every.see(theta, q, torque), chosen)

    seen = model.see(fitted.theta, q, fitted.loading(q, wrench, loads, differs))
    rows = read(seen, np.zeros(0, dtype=int))
    sprung = tuple(np.flatnonzero(fitted.compliances).tolist()) if loads else ()
    return Positions(
        model.robot,
        tuple(name for name, own in zip(model.markers, model.on_tool, strict=True) if own),
        columns,
        rows,
        np.zeros(0),
        q,
        wrench,
        since_first(len(q)),
        sprung,
        fitted.compliances[list(sprung)],
        loads,
    )


def own_columns(fit: GeometricFit, loads: Loads | None = None) -> FewColumns:
    """Columns X (m, 3k, p) of the positions by a fit's parameters in their units [mm].

    Args:
        fit: The fit.
        loads: What loads the joints; without it no spring moves anything.
    """
    model = fit.fitted.model
    means = fit.data.means
    torque = fit.fitted.torque(means.q, means.wrench, loads)
    seen = model.see(fit.fitted.theta, means.q, torque)
    return of_positions(seen, means).in_units(MM * model.scales)


@dataclass(frozen=True, eq=False)
class Explained:
    """What columns explain beside those of a fit.

    Attributes:
        values: Their coefficients (c,).
        covariance: Of these (c, c), where the errors have the size one.
        fall: What the squares fall by.
        share: Share of the squares that this is.
    """

    values: Array
    covariance: Array
    fall: float
    share: float

    @property
    def std(self) -> Array:
        """Standard deviations (c,) of the coefficients."""
        return np.sqrt(np.diag(self.covariance))


def log_chance(share: float, count: int, dof: float) -> float:
    """Logarithm of the probability that so many columns explain such a share by chance."""
    ratio = max(share, 0.0) / max(1 - share, 1e-12) * dof / count
    with np.errstate(divide="ignore"):
        return float(np.log(fisher_tail(ratio, count, dof)))


def of_positions(seen: Seen, means: MarkerPositions) -> FewColumns:
    """Columns X (m, 3k, p) of the positions, from those of all that is measured.

    Rows of what was not seen are zero.
    """
    assert seen.columns is not None
    positions = replace(seen.columns, part=seen.columns.part[:, :, :3])
    return positions.scaled(means.seen[..., None])


def of_all(columns: Array, means: MarkerPositions) -> Array:
    """Columns (m, rk, c) of what is measured, from those (m, k, r, c) of what may have been."""
    there = means.seen[..., None, None]
    found = np.where(there, columns, 0.0)
    return np.asarray(found.reshape(len(columns), -1, columns.shape[-1]))


@dataclass(frozen=True, eq=False)
class SizedColumns:
    """What a cause adds to the positions.

    Attributes:
        columns: Columns (m, 3k, c) [mm a unit].
        usual: Length of the coefficients that such a cause usually has.
        log_tries: Logarithm of how many of its kind were tried, of which this is the best.
    """

    columns: Array
    usual: float
    log_tries: float


@dataclass(frozen=True, eq=False)
class NamedCause(SizedColumns):
    """A fault of the registry that explains a good part of the residuals.

    Attributes:
        cause: The fault with its size.
        family: What it does.
        values: Its size (c,), in SI units.
    """

    cause: Cause
    family: Family
    values: Array

    @property
    def added(self) -> Array:
        """What it adds (m, 3k) [mm]."""
        return self.columns @ self.values


def lowered(gradient: Array, square: Array, along: Array) -> tuple[Array, Array]:
    """By how much columns Y beside those of a fit lower the squares of what it leaves, z.

    ``g' (Y'WY - A'A)^-1 g`` with ``g = Y'Wz``, for several sets of columns.

    Args:
        gradient: g (k, c).
        square: Y'WY (k, c, c).
        along: A (k, p, c), which is what the fit takes of them, see `Beside.along`.

    Returns:
        The coefficients (k, c), and how much (k,).
    """
    inner = square - np.swapaxes(along, 1, 2) @ along
    inner_inverse = np.linalg.pinv(inner, rcond=1e-8, hermitian=True)
    values = (inner_inverse @ gradient[..., None])[..., 0]
    return values, (gradient * values).sum(axis=1)


@dataclass(frozen=True, eq=False)
class DayTrend(SizedColumns):
    """Something that grows from the first pose to the last, or is there all day.

    Attributes:
        kind: "drift" of the frame, "growth" of all links, or "scale" of the instrument.
        size: In the last pose (see `since_first`): how far positions are off, root mean square [m],
            or the growth of all lengths, or how much longer all are [m/m].
        explained: Share of the weighted squares that it explains.
        std: Standard deviation of what is one number [m/m]; NaN of a drift.
    """

    kind: Literal["drift", "growth", "scale"]
    size: float
    explained: float
    std: float = np.nan


def day_trends(rows: FitRows) -> list[DayTrend]:
    """A drift of the frame, a growth of links, and a scale of lengths, as each explains most.

    At the time t, from 0 at the first pose to 1 at the last, both have the size ``t`` or, as where
    something warms up, ``(1 - exp(-c t)) / (1 - exp(-c))``. A drift has the six columns of a motion
    of the frame, and growth one: the motion by all lengths of the drawing together. A scale of the
    instrument is in all poses, and shows where not all lengths are fitted: strokes of a gantry, and
    links that count as drawn. The noise is fitted anew beside them (see `moved_frame`). Whether
    chance explains them `LikePoses` says.

    Args:
        rows: Of a sheet whose poses are in the order in which they were measured.
    """
    if len(rows.residual) < FEWEST_OF_TREND:
        return []
    lengths = {one.name: link_length(one) for one in rows.scene.robot.chain}
    grown = rows.scene.longer({name: one for name, one in lengths.items() if one > 0})
    tried = [
        _best(rows, "drift", rows.frame, 2 * USUAL_DRIFT * MM),
        _best(rows, "growth", grown(np.ones(1))[1][..., None] / MM, USUAL_GROWTH * MM),
        _best(rows, "scale", rows.by_scale, USUAL_GROWTH * MM),
    ]
    return [one for one in tried if one is not None]


def _best(
    rows: FitRows, kind: Literal["drift", "growth", "scale"], columns: Array, usual: float
) -> DayTrend | None:
    """The shape of one kind that explains most; None where too little is left to tell."""
    m, _, c = columns.shape
    if rows.dof(c) < 2 * c:
        return None
    times = since_first(m)
    shapes = [np.expm1(-r * times) / np.expm1(-r) if r else times for r in RATES]
    if kind == "scale":
        shapes = [np.ones(m)]
    steady = columns * shapes[0][:, None, None]
    by_noise = rows.weighed(rows.noise_beside(steady))
    if np.linalg.norm(rows.left(steady, by_noise)) < TAKEN * np.linalg.norm(steady):
        return None  # the fit takes it up
    tried = []
    for shape in shapes:
        grown = columns * shape[:, None, None]
        one = rows.explained(grown, by_noise)
        tried.append((one, grown))
    best, grown = max(tried, key=lambda one: one[0].share)
    share, values = best.share, best.values
    log_tries = float(np.log(len(shapes)))
    if kind != "drift":
        size, std = 1e-3 * float(values[0]), 1e-3 * float(best.std[0])
        return DayTrend(grown, usual, log_tries, kind, size, share, std)
    seen = rows.fit.data.means.seen[-1].reshape(-1)
    off = (columns[-1] @ values).reshape(-1, 3)[seen]
    size = float(np.sqrt((off**2).sum(axis=-1).mean())) / MM if len(off) else 0.0
    return DayTrend(grown, usual, log_tries, kind, size, share)


@dataclass(frozen=True)
class CommonScale:
    """A scale by which lengths that were measured are longer than they were known to be.

    Attributes:
        size: The scale less one [m/m].
        std: Its standard deviation.
        p: Probability of as large a one, of either sign, by errors of what was known.
        known: Whether knowledge of lengths tells it, and not the drawing alone.
    """

    size: float
    std: float
    p: float
    known: bool

    @property
    def is_told(self) -> bool:
        """Whether it is large, and no matter of chance."""
        return abs(self.size) > LEAST_SCALE and self.p < UNLIKELY_SCALE


def common_scale(fit: GeometricFit) -> CommonScale | None:
    """Estimate a scale of all lengths, from what was known of them or beside errors of the drawing.

    Where all geometry is fitted, lengths take up a scale s of the instrument, whose columns are
    those of the parameters, times t. Rows ``R theta = v`` of what was known before do not move with
    the instrument, and tell s: fitted together with the parameters, ``s = t'R' (R theta - v) / I``
    has the variance 1/I, ``I = t' (R'R - R'R C R'R) t``, with the covariance C of the fit.
    Beside errors of the drawing of unknown size it is estimated, too, see `_beside_drawing`: the
    one that tells more counts.

    Args:
        fit: Of a study that asks for all geometry.
    """
    model = fit.fitted.model
    means = fit.data.means
    errors = all_parameters(model.robot, model.markers, base=False, tool=False)
    every = model.with_parameters(errors)
    seen = model.see(fit.fitted.theta, means.q)
    # About the fit, as its own columns: near parallel axes they are others about the drawing.
    at = dict(zip((one.name for one in model.parameters), fit.fitted.theta, strict=True))
    theta = np.array([at.get(one.name, 0.0) for one in errors])
    jacobian = every.see(theta, means.q).jacobian
    assert jacobian is not None
    scaled = np.zeros((*jacobian.shape[:3], 1))
    scaled[:, :, :3] = seen.points[..., None]  # mm by 1 mm/m; a scale turns nothing
    moved = MM * jacobian * every.scales
    columns = of_all(np.concatenate([moved, scaled], axis=-1), means)
    # Some of the minimal set is told by orientations alone.
    taken = _coefficients(columns_of(model, means, seen), columns)
    found = []
    told = np.eye(len(taken))
    before = fit.told_before
    if before is not None:
        t = taken[:, -1]
        rows = PriorRows.near(before.prior, fit.fitted.theta).scaled(model.scales)
        square = rows.rows.T @ rows.rows
        share = fit.fitted.covariance @ square
        information = float(t @ (square - square @ share) @ t)
        told = told - share
        if information > SHARE_OF_SCALE * float(t @ square @ t):
            score = float(t @ rows.rows.T @ (rows.rows @ fit.fitted.values - rows.values))
            root = float(np.sqrt(information))
            p = 2 * float(student_below(np.array(-abs(score) / root), before.dof))
            found.append(CommonScale(1e-3 * score / information, 1e-3 / root, p, True))
    turns = np.array([one.turns for one in errors])
    found += _beside_drawing(fit, told, taken, turns)
    return min(found, key=lambda one: one.std, default=None)


def _beside_drawing(fit: GeometricFit, told: Array, taken: Array, turns: Mask) -> list[CommonScale]:
    """A scale of all lengths, beside errors of the drawing of unknown size.

    Lengths come out as ``theta = T d + s t + e``, with the errors d of the drawing, how all of them
    (T) and a scale (t) move the estimate, and the errors e of the fit, of covariance C. Robots are
    built with errors of either sign, of any size in a range of robots, one of lengths and one of
    angles: few lengths may agree by chance, so that a size fitted to them would say little. For
    each pair s is that of generalised least squares with ``C + T D T'``, and counts by its
    restricted likelihood. Base and markers are free.

    Args:
        fit: The fit.
        told: Share (p, p) of the positions in the estimate, and not of what was known before.
        taken: What errors of the drawing and a scale are in the parameters (p, d + 1) [a mm/m].
        turns: Which errors (d,) of the drawing are angles.
    """
    own = np.array([one.place == "joint" for one in fit.fitted.model.parameters])
    moved = (told @ taken)[own]
    T, t = moved[:, :-1], moved[:, -1]
    lengths, angles = (K @ K.T for K in (T[:, ~turns], T[:, turns]))
    if not (t.any() and lengths.any()):
        return []
    C = fit.fitted.covariance[np.ix_(own, own)]
    y = fit.fitted.values[own]
    each = np.array(
        [
            _scale_beside(C + a**2 * lengths + b**2 * angles, y, t)
            for a, b in product(BUILT_TO, BUILT_TO)
        ]
    )
    sizes, variances, likelihood = each.T
    weights = np.exp(likelihood - likelihood.max())
    weights = weights / weights.sum()
    size = float(weights @ sizes)
    variance = float(weights @ (variances + (sizes - size) ** 2))
    # As much on the other side of none: the sign is by chance.
    p = 2 * float(weights @ student_below(-np.sign(size) * sizes / np.sqrt(variances), np.inf))
    return [CommonScale(1e-3 * size, 1e-3 * float(np.sqrt(variance)), p, False)]


def _scale_beside(V: Array, y: Array, t: Array) -> tuple[float, float, float]:
    """The scale with errors of covariance V, its variance, and the restricted log-likelihood."""
    both = np.linalg.solve(V, np.stack([y, t], axis=1))
    information = float(t @ both[:, 1])
    size = float(t @ both[:, 0]) / information
    left = float(y @ both[:, 0]) - size**2 * information
    logarithm = float(np.linalg.slogdet(V)[1] + np.log(information))
    return size, 1 / information, -0.5 * (logarithm + left)


def _coefficients(design: FewColumns, columns: Array) -> Array:
    """How a design (m, r, p) combines to columns (m, r, c): (p, c)."""
    # Of unit columns: parameters of other sizes are no rounding.
    square = design.gram(np.eye(design.part.shape[2])[None, None])
    length = np.sqrt(np.diagonal(square))
    length = np.where(length > 0, length, 1.0)
    inverse = np.linalg.pinv(square / np.outer(length, length), hermitian=True)
    onto = design.onto(columns) / length[:, None]
    return np.asarray(inverse @ onto / length[:, None])
