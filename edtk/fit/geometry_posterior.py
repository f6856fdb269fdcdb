"""The posterior of geometry and springs, sampled or by Laplace's approximation with a check."""

from dataclasses import dataclass

import numpy as np

from edtk.fit.fit_geometry import NU, fit_beside
from edtk.fit.fitted_geometry import GeometricFit, loading_of
from edtk.fit.judge_geometry import PoseErrors
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.pose_rows import PoseRows, known_before, measured_less_seen
from edtk.fit.posterior import (
    WALKERS_PER_PARAMETER,
    Posterior,
    SamplingOptions,
    posterior_of,
    sample_chain,
    weighted_draws,
)
from edtk.fit.prior import Prior
from edtk.fit.same_poses import blocks_of
from edtk.measure.equilibrium import Loads
from edtk.measure.measured_model import Load, LoadsOfReadings, MeasuredModel, Seen, Torque
from edtk.measure.position_noise import PositionNoise
from edtk.measure.whitening import Scatter
from edtk.robots.elastic_robot import widened
from edtk.robots.frames import MM
from edtk.robots.rotations import rotation
from edtk.system.typing import Array, Indices

COORDINATES_AT_ONCE = 3_000_000  # coordinates that are computed at once
MOST_SAMPLED = 12  # parameters, up to which a chain converges in minutes


def many_seen(model: MeasuredModel, theta: Array, q: Array, torque: Torque = None) -> Seen:
    """What `MeasuredModel.see` predicts, for each of many sets of parameters.

    Args:
        model: The model.
        theta: Parameters (w, p) in SI units.
        q: Joint variables (m, n) [rad or m].
        torque: Loads (m, n) of the free joints [N m or N], with those before where readings are
            differences; None for none.

    Returns:
        Positions (w, m, k, 3) in the frame of the instrument [m], and orientations
        (w, m, k, 3, 3), none (0,) where positions alone are measured. No derivatives.
    """
    if not isinstance(torque, LoadsOfReadings):
        load = Load(torque) if isinstance(torque, np.ndarray) else torque
        return _many_seen(model, theta, q, load)
    own = torque.differs
    after = _many_seen(model, theta, q, torque.after)
    before = _many_seen(model, theta, q[own], torque.before)
    after.points[:, own] -= before.points
    if after.turns.size:
        turned = after.turns[:, own] @ np.swapaxes(before.turns, -1, -2)
        after.turns[:, own] = turned
    return after


def _many_seen(model: MeasuredModel, theta: Array, q: Array, load: Load | None) -> Seen:
    """The same, all readings by themselves."""
    base, errors, tools = model.motions_of_many(theta)
    bodies = _bodies_of_many(model, errors, _bent_by_many(model, theta, q, load))
    axes, origins = (
        np.stack([bodies[joint][part] for joint in model.carriers], axis=2) for part in (0, 1)
    )
    points = origins + np.einsum("wmkij,wkj->wmki", axes, model.offsets + tools[..., :3])
    B = model.start[:3, :3] @ rotation(base[:, 3:])
    origin = model.start[:3, 3] + base[:, :3] @ model.start[:3, :3].T
    turns = np.zeros(0)
    if model.row_count == 6:
        turns = B[:, None, None] @ axes @ rotation(tools[..., 3:])[:, None]
    seen = origin[:, None, None] + np.einsum("wij,wmkj->wmki", B, points)
    if model.is_distance.any():
        assert model.anchors is not None
        own = model.is_distance
        seen[:, :, own] = 0.0
        seen[:, :, own, 0] = np.linalg.norm(points[:, :, own] - model.anchors[own], axis=-1)
    return Seen(seen, turns)


def _bent_by_many(model: MeasuredModel, theta: Array, q: Array, load: Load | None) -> Array:
    """Angles (w, m, N) of all joints in poses q (m, n) that a load bends, by many parameters."""
    n = model.chain.robot.n
    bent = np.broadcast_to(widened(q, n), (len(theta), len(q), n))
    if load is not None:
        torque = load.torque
        # Turns are linear in the sizes of the springs, and nearly in numbers of compensators.
        turns = model.springs.out[:, None] * model.springs.amplitudes(torque.T)[..., None]
        bent = bent + model.bending(np.zeros(model.p)).turn(torque)
        bent = bent + np.tensordot(theta[:, model.springs.of], turns, 1)
        bent = bent + load.turned(model.numbers, theta[:, model.numbers.of])
    return model.chain.variables(bent.reshape(-1, n)).reshape(len(theta), len(q), -1)


def _bodies_of_many(
    model: MeasuredModel, errors: Array, variables: Array
) -> dict[int | None, tuple[Array, Array]]:
    """Rotation (w, m, 3, 3) and origin (w, m, 3) [m] behind each joint, and of the tool at None.

    Args:
        model: The chain.
        errors: Errors (w, N, 6) of the links before the joints [m, rad].
        variables: Angles (w, m, N) of all joints [rad or m].
    """
    robot = model.chain.robot
    batch = variables.shape[:2]
    R = np.broadcast_to(robot.base[:3, :3], (*batch, 3, 3))
    p = np.broadcast_to(robot.base[:3, 3], (*batch, 3))
    bodies: dict[int | None, tuple[Array, Array]] = {}
    # All joints at once: their number of calls is what takes time.
    bends = rotation(errors[:, :, 3:])
    axes_of_joints = np.array([joint.axis for joint in robot.chain])
    joint_turns = rotation(variables[..., None] * axes_of_joints)
    for j, joint in enumerate(robot.chain):
        p = p + R @ joint.origin[:3, 3]
        R = R @ joint.origin[:3, :3]
        p = p + (R @ errors[:, None, j, :3, None])[..., 0]
        R = R @ bends[:, None, j]
        if robot.chain_slides[j]:
            p = p + variables[..., j, None] * (R @ joint.axis)
        else:
            R = R @ joint_turns[:, :, j]
        bodies[j] = R, p
    bodies[None] = R @ robot.tool[:3, :3], p + R @ robot.tool[:3, 3]
    return bodies


@dataclass(frozen=True, eq=False)
class GeometryDensity:
    """What is known before, times the likelihood of the sheet by the nonlinear model.

    Errors of a pose have the covariance that was fitted, with normal errors or, where the fit was
    robust, with multivariate t ones. Coordinates are those of the normal approximation about the
    largest density: ``theta = mode + root x``, so that x is near a standard normal.

    Attributes:
        model: The identified parameters.
        mode: Where the density is largest (p,), in the parameters' units.
        root: Factor (p, p) of the covariance of the normal approximation, in these units.
        means: The measured poses.
        torque: Loads of the joints (m, n), with those before where readings are differences.
        whitening: Matrices (m, k r, k r) that make errors of a pose independent, of size one
            [1/mm, 1/mrad], with the r = 3 coordinates of a marker, or 6 with its orientation.
        apart: Visits (G, s) of a pose, with matrices (G, s k r, s k r) that take from each of their
            rows what those before tell of it: rows share the error of a change by the load.
        std: Standard deviations (m, k r) of what was measured [mm, mrad].
        nu: Degrees of freedom of t errors; None for normal ones.
        prior: What is known of the parameters before, in SI units; None where nothing is.
    """

    model: MeasuredModel
    mode: Array
    root: Array
    means: MarkerPositions
    torque: Torque
    whitening: Array
    std: Array
    nu: float | None
    prior: Prior | None = None
    apart: tuple[tuple[Indices, Array], ...] = ()

    @classmethod
    def of(cls, fit: GeometricFit, loads: Loads | None, robust: bool) -> "GeometryDensity":
        """The density of a fit's positions, about its own largest value.

        The fit itself has weights between those of the noise and equal ones; the density has those
        of the noise.
        """
        fitted = fit.fitted
        model = fitted.model
        means = fit.data.means
        torque = loading_of(fitted.bending, means, loads)
        rows = PoseRows.of(model, fitted.theta, means, torque)
        V = rows.errors(fitted.noise)
        there = (rows.worth > 0).reshape(len(means), -1)[:, :, None]
        whitening, apart = _whitened(rows, fitted.noise, V)
        whitening = whitening * there
        weights = np.sqrt(fit.weights)[:, None, None]
        prior = None if fit.told_before is None else fit.told_before.prior
        known = prior or Prior.flat(model.p, False)
        theta = fit_beside(
            model, fitted.theta, means, torque, known, weights=V.over(fit.weights).inverse
        )
        before = known_before(known, model, theta)
        rows = PoseRows.of(model, theta, means, torque)
        design = _freed(apart, rows.design[None])[0]
        X = (whitening * weights @ design).reshape(-1, model.p)
        R = np.linalg.qr(np.concatenate([X, before.rows]), mode="r")
        root = np.linalg.inv(R)
        nu = NU if robust else None
        still = rows.errors(fitted.noise.without_changes).variances
        changes = np.outer(means.same_poses.changed, fitted.noise.of_changes(still.shape[1]))
        each = means.same_poses.variances(still.reshape(means.rows_seen.shape))
        each = np.where(means.rows_seen, each + changes.reshape(each.shape), 1.0)
        std = np.sqrt(each).reshape(len(means), -1)
        return cls(
            model, theta / model.scales, root, means, torque, whitening, std, nu, prior, apart
        )

    @property
    def content(self) -> tuple[list[Array], str]:
        """What tells the density from others: numbers, and words."""
        means = self.means
        numbers = [means.q, means.measured, means.wrench, self.whitening, self.mode, self.root]
        numbers += [each for _, each in self.apart]
        if means.turns is not None:
            numbers.append(means.turns)
        if self.prior is not None:
            numbers += self.prior.gaussian()
        words = [one.name for one in self.model.parameters]
        return numbers, repr((words, means.markers, self.nu, self.prior))

    def start(self, rng: np.random.Generator, walkers: int) -> Array:
        """Where walkers start (walkers, p): normal draws, nearer the mode where a prior has none.

        Args:
            rng: Source of randomness.
            walkers: How many.
        """
        x = rng.standard_normal((walkers, self.model.p))
        out = ~np.isfinite(self.log_density(x))
        while out.any() and x[out].any():
            x[out] /= 2  # down to the mode itself
            out = ~np.isfinite(self.log_density(x))
        return x

    def parameters(self, x: Array) -> Array:
        """Parameters (..., p) in their units."""
        return np.asarray(self.mode + x @ self.root.T)

    def log_density(self, x: Array) -> Array:
        """Logarithm (n,) of the density of coordinates (n, p), up to a constant."""
        m, k = self.means.seen.shape
        step = max(1, COORDINATES_AT_ONCE // (self.means.rows * m * k))
        parts = [self._squares(x[first : first + step]) for first in range(0, len(x), step)]
        squares = np.concatenate(parts)
        before = np.zeros(len(x))
        if self.prior is not None:
            before = self.prior.log_density(self.parameters(x) * self.model.scales)
        if self.nu is None:
            return np.asarray(before - 0.5 * squares.sum(axis=1))
        d = (self.means.same_poses.worth > 0).sum(axis=(1, 2))
        return np.asarray(before - 0.5 * ((self.nu + d) * np.log1p(squares / self.nu)).sum(axis=1))

    def _squares(self, x: Array) -> Array:
        """Squared sizes (n, m) of the errors of the poses."""
        theta = self.parameters(x) * self.model.scales
        seen = many_seen(self.model, theta, self.means.q, self.torque)
        apart = np.moveaxis(MM * measured_less_seen(self.means, seen), 0, -1)
        apart = np.moveaxis(self.means.same_poses.apart(apart), -1, 0)
        rows = apart.reshape(len(x), len(self.means), -1, 1)
        z = np.einsum("mrs,nms->nmr", self.whitening, _freed(self.apart, rows)[..., 0])
        return np.asarray((z**2).sum(axis=-1))


def _whitened(
    rows: PoseRows, noise: PositionNoise, V: Scatter
) -> tuple[Array, tuple[tuple[Indices, Array], ...]]:
    """`GeometryDensity.whitening` of visits with covariances V, and `GeometryDensity.apart`."""
    errors = PoseErrors.of(rows, noise, np.ones(len(rows.residual)))
    whitening = np.empty((*rows.residual.shape, rows.residual.shape[1]))
    alone = np.ones(len(whitening), dtype=bool)
    found = []
    for group in rows.same.groups if len(errors.change) else ():
        alone[group.members] = False
        L = np.linalg.inv(np.linalg.cholesky(errors.dense(group)))
        G, s = group.members.shape
        own = np.einsum("gasat->gast", L.reshape(G, s, L.shape[1] // s, s, -1))
        whitening[group.members] = own
        found.append((group.members, blocks_of(np.linalg.inv(own)) @ L))
    whitening[alone] = np.linalg.inv(np.linalg.cholesky(V[np.flatnonzero(alone)].dense))
    return whitening, tuple(found)


def _freed(apart: tuple[tuple[Indices, Array], ...], rows: Array) -> Array:
    """Rows (n, m, r, c) of visits, of which each is freed of what those before tell of it."""
    found = rows.copy() if apart else rows
    for members, each in apart:
        some = rows[:, members]
        together = some.reshape(len(rows), len(members), -1, rows.shape[-1])
        found[:, members] = (each @ together).reshape(some.shape)
    return found


def geometry_posterior(
    density: GeometryDensity, rng: np.random.Generator, options: SamplingOptions
) -> Posterior:
    """Sample the density by emcee, or where it has many parameters by Laplace's approximation.

    Where a chain is to be kept it is made, however many parameters there are: it can be taken up.

    Args:
        density: What is known.
        rng: Source of randomness.
        options: How accurately a chain is sampled, and where it is kept.

    Raises:
        UnconvergedError: The chain does not converge.
        ChainFileError: The file is no chain, or of another problem.
        OSError: The file cannot be written.
    """
    parameters = density.model.parameters
    names = tuple(one.name for one in parameters)
    units = tuple(one.unit for one in parameters)
    p = len(parameters)
    seed = int(rng.integers(2**31))
    if p > MOST_SAMPLED and options.chain is None:
        return weighted_draws(density, rng, names, units)
    walkers = max(options.walkers, WALKERS_PER_PARAMETER * p)
    start = density.start(rng, walkers)
    return posterior_of(sample_chain(density, start, seed, options), names, units)
