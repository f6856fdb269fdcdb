"""Whether the frame of the instrument moved between two poses, by the residuals of a fit."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from edtk.calibration.geometry.day_trend import frame_columns
from edtk.calibration.geometry.fit_rows import FitRows
from edtk.inference.geometry.geometric_fit import MM, GeometricFit
from edtk.inference.geometry.position_noise import PositionNoise
from edtk.model.geometry.geometric_parameter import GeometricParameter
from edtk.system.typing import Array

FEWEST = 2  # poses before, after and between
UNLIKELY = 1e-6
# Of the squares, at least: a drift of the floor explains less. Equal weights make more of errors
# that the coordinates of a pose have in common, which are then as if fewer poses told something.
EXPLAINS = {False: 0.2, True: 0.5}
COORDINATES = {False: 3.0, True: 6.0}  # of a pose that err together
# Probability of a motion that the noise was fitted beside: of 200 sound days none had less.
RARE = 1e-2
SIDE = 4  # poses before and after such a motion: of fewer it may be that one is a wrong one
BREAKS = 30  # poses at which a motion that is taken back is tried first


@dataclass(frozen=True, eq=False)
class MovedFrame:
    """A motion of the frame that explains a good part of the residuals.

    Attributes:
        first: The first pose (of the means, in order of the file) after it.
        end: The pose at which it was taken back; the number of poses where it was not.
        shift: How far positions are off after it, root mean square [m].
        explained: Share of the squared residuals that it explains.
    """

    first: int
    end: int
    shift: float
    explained: float

    def columns(self, fit: GeometricFit) -> Array:
        """Its columns (m, 3k, 6) [mm a mm, mm a mrad]."""
        moved = frame_columns(fit)
        pose = np.arange(len(moved))
        return moved * ((pose >= self.first) & (pose < self.end))[:, None, None]


def moved_frame(fit: GeometricFit, others: Sequence[GeometricParameter] = ()) -> MovedFrame | None:
    """Try a rigid motion of the frame between any two poses, and test the best.

    The motion has six parameters, whose columns B count from pose s to pose t. With residuals z of
    the fit and its columns X, both weighted, the squares fall by
    ``g' (B'B - B'X (X'X)^-1 X'B)^-1 g`` with ``g = B'z``; running sums give this for all s and t.
    The ratio to what is left has Fisher's distribution for one pair; the smallest probability
    counts as often as pairs are. The frame does not move back as a rule: motions to the end of the
    day are tried all, and others between some poses, and then near the best of these.

    Residuals are weighted by the noise that was fitted, and equally: a motion is part of what was
    fitted as noise, which may hide it. So the noise is fitted anew beside the motion that lowers
    the squares most, too, and then tells smaller ones.

    Args:
        fit: Of a sheet whose poses are in the order in which they were measured.
        others: Errors of the drawing that were not asked for. What they explain is no motion: they
            are fitted beside it.
    """
    day = _Day.of(fit, others)
    found = [*(_best(day, white) for white in (False, True)), _beside_noise(day)]
    told = [one for one in found if one is not None]
    return max(told, key=lambda one: one.explained, default=None)


def _best(day: "_Day", white: bool) -> MovedFrame | None:
    """The motion that lowers the squares most, where chance does not explain it."""
    m = len(day)
    dof = day.dof
    if m < 2 * FEWEST or dof < 4:
        return None
    sums = day.sums(None if white else day.rows.noise)
    total = float((sums.z**2).sum())
    ends = [(s, m) for s in range(FEWEST, m - FEWEST + 1)]
    best = max((sums.fall(s, t), s, t) for s, t in ends)
    between = max(((sums.fall(s, t), s, t) for s, t in _pairs(m)), default=best)
    between = max((sums.fall(s, t), s, t) for s, t in _near(between[1], between[2], m))
    independent = max(dof / COORDINATES[white], 1.0)
    judged = [
        (_probability(fall, total, independent) * count, fall, s, t)
        for (fall, s, t), count in ((best, m), (between, m * m))
    ]
    probability, fall, s, t = min(judged)
    if probability > UNLIKELY or fall < EXPLAINS[white] * total:
        return None
    return MovedFrame(s, t, day.size(sums.motion(s, t), s, t), fall / total)


def _beside_noise(day: "_Day") -> MovedFrame | None:
    """The motion to the end of the day, where it is large beside the noise that it leaves.

    A motion of half a millimetre amid errors of a robot of a third is fitted as noise, which then
    looks large enough to explain it. Fitted beside its columns, the noise is as without it.
    """
    m = len(day)
    if m < 2 * SIDE or day.dof < 4:
        return None
    ends = range(SIDE, m - SIDE + 1)
    before = day.sums(day.rows.noise)
    s = max(ends, key=lambda s: before.fall(s, m))
    after = day.sums(day.noise_beside(s))
    total = float((after.z**2).sum())
    fall = after.fall(s, m)
    independent = max(day.dof / COORDINATES[False], 1.0)
    if _probability(fall, total, independent) * m > RARE or fall < EXPLAINS[False] * total:
        return None
    return MovedFrame(s, m, day.size(after.motion(s, m), s, m), fall / total)


def _pairs(m: int) -> Iterator[tuple[int, int]]:
    """Some poses between which a motion is tried, the day's ends left out."""
    breaks = np.unique(np.linspace(FEWEST, m - 1, BREAKS).astype(int)).tolist()
    return ((s, t) for s in breaks for t in breaks if t - s >= FEWEST)


def _near(s: int, t: int, m: int) -> list[tuple[int, int]]:
    """Pairs near a pair, as near as the next that was tried, and itself."""
    step = max(m // BREAKS, 1) + 1
    pairs = {(s, t)}
    for a in range(max(s - step, FEWEST), min(s + step, m - FEWEST) + 1):
        for b in range(max(t - step, a + FEWEST), min(t + step, m) + 1):
            pairs.add((a, b))
    return sorted(pairs)


def _probability(fall: float, total: float, dof: float) -> float:
    """How likely chance lowers the squares as much between two given poses."""
    from scipy.stats import f

    share = fall / max(total, 1e-300)
    return float(f.sf(share / max(1 - share, 1e-12) * dof / 6, 6, dof))


@dataclass(frozen=True, eq=False)
class _Sums:
    """Running sums over the poses, each before its pose.

    Attributes:
        z: Residuals (m, r) without what the columns explain.
        gradient: Sums of B'z (m + 1, 6).
        square: Sums of B'B (m + 1, 6, 6).
        cross: Sums of X'B (m + 1, p, 6).
        inverse: (X'X)^-1 (p, p).
    """

    z: Array
    gradient: Array
    square: Array
    cross: Array
    inverse: Array

    @classmethod
    def of(cls, z: Array, X: Array, B: Array) -> "_Sums":
        """Of weighted residuals, columns and motions."""
        H = np.linalg.pinv(np.einsum("mrp,mrq->pq", X, X), hermitian=True)
        # The fit has other weights, so that something is left along its own columns.
        z = z - X @ (H @ np.einsum("mrp,mr->p", X, z))
        return cls(
            z,
            _before(np.einsum("mri,mr->mi", B, z)),
            _before(np.einsum("mri,mrj->mij", B, B)),
            _before(np.einsum("mrp,mri->mpi", X, B)),
            H,
        )

    def motion(self, s: int, t: int) -> Array:
        """The motion (6,) from pose s to pose t that lowers the squares most."""
        cross = self.cross[t] - self.cross[s]
        inner = self.square[t] - self.square[s] - cross.T @ self.inverse @ cross
        gradient = self.gradient[t] - self.gradient[s]
        return np.asarray(np.linalg.pinv(inner, rcond=1e-8, hermitian=True) @ gradient)

    def fall(self, s: int, t: int) -> float:
        """How much that lowers them."""
        return float((self.gradient[t] - self.gradient[s]) @ self.motion(s, t))


@dataclass(frozen=True, eq=False)
class _Day:
    """The poses of a day, in their order.

    Attributes:
        rows: Their residuals and columns.
        moved: Columns (m, 3k, 6) of motions of the frame [mm].
    """

    rows: FitRows
    moved: Array

    @classmethod
    def of(cls, fit: GeometricFit, others: Sequence[GeometricParameter] = ()) -> "_Day":
        """Of a fit, beside parameters that are none of it."""
        return cls(FitRows.of(fit).beside(others), frame_columns(fit))

    def __len__(self) -> int:
        return len(self.moved)

    @property
    def dof(self) -> int:
        """Coordinates that neither the fit nor a motion takes."""
        return self.rows.dof(6)

    def noise_beside(self, s: int) -> PositionNoise:
        """The noise, fitted beside a motion from pose s on."""
        return self.rows.noise_beside(self.moved * (np.arange(len(self)) >= s)[:, None, None])

    def sums(self, noise: PositionNoise | None) -> _Sums:
        """Running sums of all, weighted by a noise, or equally where there is none."""
        z, X, B = self.rows.whitened(
            noise, self.rows.residual[..., None], self.rows.design, self.moved
        )
        return _Sums.of(z[..., 0], X, B)

    def size(self, motion: Array, s: int, t: int) -> float:
        """How far a motion (6,) carries the markers of some poses, root mean square [m]."""
        seen = self.rows.fit.data.means.seen[s:t].reshape(-1)
        off = (self.moved[s:t] @ motion).reshape(-1, 3)[seen]
        return float(np.sqrt((off**2).sum(axis=-1).mean())) / MM


def _before(terms: Array) -> Array:
    """Sums (m + 1, ...) of all terms before each one, and of all."""
    return np.concatenate([np.zeros((1, *terms.shape[1:])), np.cumsum(terms, axis=0)])
