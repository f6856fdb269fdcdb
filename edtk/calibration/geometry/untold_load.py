"""Whether a weight that the study does not know bends the robot, always or in some of the poses."""

from dataclasses import dataclass

import numpy as np

from edtk.calibration.geometry.fit_rows import FitRows, explained_by, log_chance
from edtk.inference.geometry.geometric_fit import GeometricFit
from edtk.system.typing import Array, Indices, Mask

UNLIKELY = 1e-4
EXPLAINS = 0.5  # of the squares, at least: gears that are not round explain less
COORDINATES = 3.0  # of a pose that err together
SURE = 2.0  # standard deviations by which a joint gives way
FEWEST = 4  # poses with the weight, and without it
STARTS = 6  # random ones of the search for poses with a weight
ROUNDS = 12  # of telling the weight and the poses, in turn
SAME = 1e-6  # [m] a load that changes less from pose to pose tells nothing


@dataclass(frozen=True, eq=False)
class UntoldLoad:
    """A weight that explains a good part of the residuals.

    Attributes:
        joints: Names of the joints that give way.
        explained: Share of the squared residuals that this explains.
        loaded: Mask (m,) of the poses that are under it.
        columns: Its columns (m, 3k, c).
        log_chance: Logarithm of the probability that chance explains as much.
    """

    joints: tuple[str, ...]
    explained: float
    loaded: Mask
    columns: Array
    log_chance: float


def untold_load(fit: GeometricFit) -> UntoldLoad | None:
    """Try springs of all joints under a weight at the tool, and test those that give way.

    A weight W turns joint j by ``k_j W t_j(q)``, with t_j the torque of a unit force down at the
    tool: the columns are the motions by the joints times t_j, and ``k_j W`` is not negative. The
    noise is fitted anew beside them (see `moved_frame`), and the fall of the squares has to be
    improbable, and half of them with equal weights. The weight of the links bends joints much the
    same way, so that both are meant.

    The weight may hang there in all poses, from one on or up to it, in every other one, or in any
    that the residuals tell. The probability counts as often as there are ways to choose them.

    Args:
        fit: Of positions without springs among its parameters.
    """
    rows = FitRows.of(fit)
    robot = fit.fitted.model.robot
    frames = robot.frames(fit.data.means.q, ())
    torque = -frames.folded(frames.linear_of_each)[:, 2].T
    turned = np.flatnonzero(np.ptp(torque, axis=0) > SAME)
    if not len(turned) or rows.dof(len(turned)) < len(turned):
        return None
    bent = rows.motion * torque[:, None]
    every = np.ones(len(bent), dtype=bool)
    found = _judged(rows, bent, turned, every, 0.0)
    parts = [_judged(rows, bent, turned, *one) for one in _parts_of_day(rows, bent[..., turned])]
    told = [one for one in (found, *parts) if one is not None]
    return min(told, key=lambda one: one.log_chance, default=None)


def _judged(
    rows: FitRows, bent: Array, turned: Indices, loaded: Mask, log_tries: float
) -> UntoldLoad | None:
    """A weight in some poses, where chance does not explain what it does."""
    bent = bent * loaded[:, None, None]
    noise = rows.noise_beside(bent[..., turned])
    parts = (rows.residual[..., None], rows.design)
    every = explained_by(*rows.whitened(noise, *parts, bent[..., turned]))
    giving = turned[every.values > SURE * every.std]
    if not len(giving):
        return None
    columns = bent[..., giving]
    found = explained_by(*rows.whitened(noise, *parts, columns)).share
    explained = explained_by(*rows.whitened(None, *parts, columns)).share
    independent = max(rows.dof(len(giving)) / COORDINATES, 1.0)
    chance = log_chance(found, len(giving), independent) + log_tries
    if explained < EXPLAINS or chance > np.log(UNLIKELY):
        return None
    names = tuple(rows.fit.fitted.model.robot.joint_names[j] for j in giving)
    return UntoldLoad(names, explained, loaded, columns, chance)


def _parts_of_day(rows: FitRows, bent: Array) -> list[tuple[Mask, float]]:
    """Masks (m,) of poses that a weight may load, and logarithms of how many such there are."""
    m = len(bent)
    if m < 2 * FEWEST:
        return []
    each = np.arange(m)
    turns = [each % 2 == 0, each % 2 == 1]
    breaks = range(FEWEST, m - FEWEST + 1)
    halves = [mask for s in breaks for mask in (each >= s, each < s)]
    z, X, C = rows.whitened(None, rows.residual[..., None], rows.design, bent)
    day = _LoadedPoses.of(z, X, C)
    half = min(halves, key=day.left)
    turn = min(turns, key=day.left)
    rng = np.random.default_rng(0)
    starts = [half, turn, *(rng.random((STARTS, m)) < 0.5)]
    free = min((day.settled(start) for start in starts), key=day.left)
    found = [(half, float(np.log(len(halves)))), (turn, float(np.log(len(turns))))]
    if FEWEST <= free.sum() <= m - FEWEST:
        found.append((free, m * float(np.log(2.0))))
    return found


@dataclass(frozen=True, eq=False)
class _LoadedPoses:
    """Residuals, and what a weight in some poses leaves of them.

    Attributes:
        z: Residuals (m, r).
        X: Columns (m, r, p) of the fit.
        C: Columns (m, r, c) of a weight.
        Q: An orthonormal basis (m r, p) of the columns of the fit.
    """

    z: Array
    X: Array
    C: Array
    Q: Array

    @classmethod
    def of(cls, z: Array, X: Array, C: Array) -> "_LoadedPoses":
        """Of rows that all count alike."""
        Q = np.linalg.qr(X.reshape(-1, X.shape[-1]))[0]
        return cls(z[..., 0], X, C, Q)

    def _apart(self, loaded: Mask) -> tuple[Array, Array]:
        """Residuals (m, r) with a weight in some poses, and its size (c,), none below zero."""
        from scipy.optimize import nnls

        C = (self.C * loaded[:, None, None]).reshape(-1, self.C.shape[-1])
        z = self.z.reshape(-1)
        C, z = C - self.Q @ (self.Q.T @ C), z - self.Q @ (self.Q.T @ z)
        # Of as many rows as columns: the squares fall by as much.
        q, r = np.linalg.qr(C)
        size = nnls(r, q.T @ z)[0]
        return (z - C @ size).reshape(self.z.shape), size

    def left(self, loaded: Mask) -> float:
        """Sum of squares."""
        return float((self._apart(loaded)[0] ** 2).sum())

    def settled(self, loaded: Mask) -> Mask:
        """The poses (m,) that fit better under the weight, told in turn with its size."""
        for _ in range(ROUNDS):
            apart, size = self._apart(loaded)
            bend = self.C @ size
            without = apart + bend * loaded[:, None]
            after = ((without - bend) ** 2).sum(axis=1) < (without**2).sum(axis=1)
            if (after == loaded).all():
                break
            loaded = after
        return loaded
