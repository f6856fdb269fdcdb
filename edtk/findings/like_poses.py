"""How likely causes are beside errors of a robot that are alike in like poses."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import solve_triangular

from criteria.linalg.inverse import eigenpairs
from edtk.findings.causes.evidence import FACTORS, WEIGHTS
from edtk.findings.fit_rows import FitRows, SizedColumns
from edtk.measure.few_columns import spanning
from edtk.measure.whitening import Scatter
from edtk.system.typing import Array, Indices

# Sizes of errors that are alike, over those of joints that would make all residuals.
SIZES = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0)
# Shares of the errors that were fitted as if each pose had its own: some of these are alike.
OWN = (1.0, 0.5, 0.25, 0.125)
TURN = 0.5  # [rad] of its own within which a joint errs alike: gears have a few waves a turn
NEAR_BODIES = 0.35  # of the spread of the arm's bodies: within it they bend alike
MOST_WEIGHED = 80  # that are weighed together
RIGID = 1e-6  # of the longest motion of the tool, below which it is none


@dataclass(frozen=True, eq=False)
class LikePoses:
    """Motions of the tool in the poses, with errors that like poses have in common.

    A robot errs in each pose, and in like poses alike: gears that are not round by the angle of a
    joint, links that bend by the shape of the arm. Where a day visits one region after another,
    such errors change with the regions, and what changes with them looks like something that
    happened in the day. With the motions J_j by the joints, errors of a pose have the covariance

        V = R + f^2 D + sum_j J_j J_j' (a^2 A_j + b^2 B)

    with the noise R of readings, the errors D that were fitted as each pose's own, which visits of
    one pose share but for what a load changes, and correlations of poses A_j by the angle of joint
    j and B by the places of the arm's bodies, each ``exp(-d^2 / 2)``. The sizes f, a and b are not
    known: the restricted likelihood is averaged over them (Patterson and Thompson 1971), with a
    cause and without.

    Attributes:
        z: Residuals (N,): of each pose along the motions of its tool.
        X: Orthonormal columns (N, p) that span those of the fit.
        reading: R (N, N).
        model: D (N, N).
        alike: ``sum_j J_j J_j' A_j``, and the same with B (2, N, N).
        unit: Size of errors of the joints that would make all residuals [mrad].
        basis: The motions of the tool (m, r, 6), of length one, along which all is taken.
        poses: Which of the day's poses (m,) these are.
    """

    z: Array
    X: Array
    reading: Array
    model: Array
    alike: Array
    unit: float
    basis: Array
    poses: Indices

    @classmethod
    def of(cls, rows: FitRows) -> "LikePoses":
        """Of the residuals of a fit; of very many poses, some evenly over the day."""
        m = len(rows.residual)
        poses = np.unique(np.linspace(0, m - 1, MOST_WEIGHED).round().astype(int))
        motion, places = rows.motion[poses], rows.places[poses]
        basis = _motions(np.concatenate([motion, rows.frame[poses]], axis=-1))
        J = np.swapaxes(basis, 1, 2) @ motion
        counts = rows.fit.data.counts[poses]
        own = rows.noise.of_drawing(0.0)
        R = _blocks(basis, own.of_pose(motion, places, counts))
        z = _along(basis, rows.residual[poses, :, None])[:, 0]
        squares = float((J**2).sum())
        unit = float(np.sqrt((z**2).sum() / squares)) if squares else 0.0
        alike = np.stack([_shared(J, one) for one in _correlations(rows, poses)])
        columns = spanning(rows.design[poses].seen_by(basis).reshape(len(z), -1))
        X = columns[:, columns.any(axis=0)]
        # Where a tool moves in fewer ways, the others are of size one and hold nothing.
        still = (np.square(basis).sum(axis=1) == 0)[:, :, None] * np.eye(basis.shape[2])
        model = _left_out(rows, poses, basis)
        return cls(z, X, _apart(R + still), model, alike, unit, basis, poses)

    def likelier(self, causes: Sequence[SizedColumns]) -> Array:
        """Logarithms (c,) of how much likelier the residuals are with each cause than without any.

        Sizes of a cause are averaged over Student's distribution of the usual width, see `rarity`;
        the best of several of its kind is as likely as their mean at most.
        """
        columns = [_along(self.basis, one.columns[self.poses]) for one in causes]
        ends = np.cumsum([0, *(one.shape[1] for one in columns)])
        without, M, r = self._nodes(np.concatenate(columns, axis=1))
        gained = []
        for one, first, end in zip(causes, ends[:-1], ends[1:], strict=True):
            own = slice(first, end)
            gains = _gains(M[:, own, own], r[:, own], one.usual)
            gained.append(np.logaddexp.reduce(without + gains) - one.log_tries)
        return np.array(gained) - np.logaddexp.reduce(without)

    def _nodes(self, C: Array) -> tuple[Array, Array, Array]:
        """At sizes s of the errors: log-likelihoods (s,) without a cause, ``C'PC`` and ``C'Pz``.

        With orthonormal Q that the fit leaves, ``P = Q (Q'VQ)^-1 Q'`` and
        ``|V| |X' V^-1 X| = |Q'VQ|`` (Harville 1974).
        """
        Q = np.linalg.qr(self.X, mode="complete")[0][:, self.X.shape[1] :]
        kinds = np.stack([self.reading, self.model, *self.alike])
        of_left = (Q.T @ kinds @ Q).reshape(len(kinds), -1)
        left = Q.T @ np.concatenate([C, self.z[:, None]], axis=1)
        # Where a fit has left no errors to poses of their own, all shares of them are the same.
        own = OWN if self.model.any() else OWN[:1]
        sizes = [(1.0, f, a * self.unit, b * self.unit) for f, a, b in product(own, SIZES, SIZES)]
        squares = np.empty((len(sizes), left.shape[1], left.shape[1]))
        logs = np.empty(len(sizes))
        for i, weights in enumerate(np.square(sizes)):
            L = np.linalg.cholesky((weights @ of_left).reshape(len(left), len(left)))
            white = solve_triangular(L, left, lower=True, check_finite=False)
            squares[i] = white.T @ white
            logs[i] = np.log(np.diag(L)).sum()
        return -logs - squares[:, -1, -1] / 2, squares[:, :-1, :-1], squares[:, :-1, -1]


def _gains(M: Array, r: Array, usual: float) -> Array:
    """Logarithms (s,) of the mean likelihood over sizes of a cause, over that without it.

    Args:
        M: ``C'PC`` (s, c, c).
        r: ``C'Pz`` (s, c).
        usual: Length of the coefficients that such a cause usually has.
    """
    values, vectors = eigenpairs(M)
    squares = np.square(usual * FACTORS)[:, None, None] / r.shape[1]
    grown = 1 + squares * np.maximum(values, 0.0)
    along = squares * np.square(r[:, None] @ vectors)[:, 0] / grown
    each = np.log(WEIGHTS)[:, None] + (along - np.log(grown)).sum(axis=-1) / 2
    return np.asarray(np.logaddexp.reduce(each, axis=0))


def _motions(columns: Array) -> Array:
    """Orthonormal directions (m, r, 6) of all motions (m, r, c) of a tool, the others zero."""
    U, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    seen = sizes > RIGID * sizes.max()
    return np.asarray((U * seen[:, None])[..., :6])


def _along(basis: Array, columns: Array) -> Array:
    """Columns (m, r, c) of poses along the motions of their tools (6 m, c)."""
    return np.asarray((np.swapaxes(basis, 1, 2) @ columns).reshape(-1, columns.shape[-1]))


def _blocks(basis: Array, V: Scatter) -> Array:
    """Covariances (m, 6, 6) of single poses along the motions of their tools."""
    return np.asarray(np.swapaxes(basis, 1, 2) @ V.times(basis))


def _apart(blocks: Array) -> Array:
    """The matrix (6 m, 6 m) of blocks (m, 6, 6) of poses that err each by itself."""
    m, k, _ = blocks.shape
    whole = np.zeros((m, k, m, k))
    whole[np.arange(m), :, np.arange(m)] = blocks
    return np.asarray(whole.reshape(m * k, m * k))


def _left_out(rows: FitRows, poses: Indices, basis: Array) -> Array:
    """D (6 m, 6 m): errors of poses, alike in all visits of one, and of changes by a load."""
    there = np.repeat(rows.fit.data.means.seen[poses], 3, axis=1)
    seen = np.swapaxes(basis * there[..., None], 1, 2)
    noise, pose = rows.noise, rows.same.pose[poses]
    joints = seen @ rows.motion[poses] * np.asarray(noise.model_joints)
    of_poses = np.concatenate([noise.model_white * seen, joints], axis=-1)
    alike = (pose[:, None] == pose).astype(float)
    changed = noise.model_change[0] * seen * rows.same.changed[poses][:, None, None]
    shared = _shared(of_poses, np.broadcast_to(alike, (of_poses.shape[2], *alike.shape)))
    return shared + _apart(changed @ np.swapaxes(changed, 1, 2))


def _correlations(rows: FitRows, poses: Indices) -> Iterator[Array]:
    """How alike joints (n, m, m) err in poses: by their own angle, and by the shape of the arm."""
    robot = rows.scene.robot
    q = rows.scene.q[poses]
    apart = q[:, None] - q[None]
    turns = ~robot.slides
    spread = np.where(turns, 1.0, np.maximum(np.ptp(q, axis=0), RIGID))
    chord = np.where(turns, 2 * np.sin(apart / 2), apart / spread)
    yield np.moveaxis(np.exp(-np.square(chord / TURN) / 2), -1, 0)
    frames = robot.frames(q, ())
    points = np.concatenate([frames.origins, frames.position[None]])
    places = np.moveaxis(points, -1, 0).reshape(len(q), -1)
    off = np.square(places - places.mean(axis=0)).sum(axis=1).mean()
    squares = np.square(places[:, None] - places[None]).sum(axis=-1)
    near = np.exp(-squares / max(off, RIGID**2) / NEAR_BODIES**2 / 2)
    yield np.broadcast_to(near, (robot.n, *near.shape))


def _shared(J: Array, alike: Array) -> Array:
    """``sum_j J_j J_j' A_j`` (6 m, 6 m) of motions J (m, 6, n) and correlations A (n, m, m)."""
    m, k, _ = J.shape
    return np.asarray(
        np.einsum("arj,jab,bsj->arbs", J, alike, J, optimize=True).reshape(m * k, m * k)
    )
