"""Polynomials of the joints on boxes: where they are measured, their motions, and what links them.

The page "A bound over every pose" of the documentation has the theorems and their proofs.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from edtk.certificate.recompute.chain import Chain
from edtk.certificate.recompute.plain_data import number, rows, table, whole
from edtk.certificate.recompute.setting import Setting
from edtk.certificate.recompute.tasks import EPS
from edtk.system.typing import Array, Indices, Mask

U = EPS / 2  # of one operation
DEGREE = 4  # of a sensitivity in what each vector of the chain is of degree one in
TURN = 2 * np.pi
MOST_FREE_JOINTS = 6
MOST_POSES = 9**MOST_FREE_JOINTS  # of a grid, which fit in memory
SAME_END = 1e-12  # of ends of intervals [rad]; boxes overlap by more
DROPPED = 1e-13  # sum of coefficients beside all of them, that is dropped and counted as error


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion of angles that maps a box to itself, ``t -> s t + pi h``, s = 1 or -1.

    Where it leaves all polynomials as they are, what is left of an interval stands for all of it.

    Attributes:
        mirrors: Whether s = -1, for each joint (v,).
        turns: Whether h = 1 (v,).
        joint: The joint whose interval is cut.
        low: What is left of it.
        high: Its upper end.
    """

    mirrors: Mask
    turns: Mask
    joint: int
    low: float
    high: float

    @classmethod
    def from_dict(cls, content: Any, slides: Mask, where: str) -> "Motion":
        """Read a motion.

        Raises:
            ValueError: It is none.
        """
        table(content, ("mirrors", "turns", "joint", "low", "high"), where)
        v = len(slides)
        mirrors, turns = (
            np.array([whole(one, 0, 1, where) for one in rows(content[key], v, where)], dtype=bool)
            for key in ("mirrors", "turns")
        )
        if len(mirrors) < v or len(turns) < v or ((mirrors | turns) & slides).any():
            raise ValueError(f"{where}: expected motions of all angles, and of angles alone")
        low, high = number(content["low"], where), number(content["high"], where)
        return cls(mirrors, turns, whole(content["joint"], 0, v - 1, where), low, high)

    def image(self, j: int, interval: tuple[float, float]) -> tuple[float, float]:
        """What an interval of joint j is mapped to."""
        low, high = interval
        shift = np.pi if self.turns[j] else 0.0
        return (shift - high, shift - low) if self.mirrors[j] else (low + shift, high + shift)

    def left(self, box: list[tuple[float, float]], where: str) -> list[tuple[float, float]]:
        """The box (v,) with what is left of the interval that is cut.

        A place of the box is in what is left, or its image is: the motion maps the other intervals
        into themselves, and this one into itself by whole turns.

        Raises:
            ValueError: It is not so.
        """
        kept = (self.low, self.high)
        stays = all(
            _covers(self.image(j, one), [one]) for j, one in enumerate(box) if j != self.joint
        )
        # The image of a place is in what is left where the place is in the image of that: a
        # mirror, and a turn by half, is its own inverse but for whole turns.
        if not stays or not _covers(box[self.joint], [kept, self.image(self.joint, kept)]):
            raise ValueError(f"{where}: a motion that does not take what is left to the whole box")
        return [kept if j == self.joint else one for j, one in enumerate(box)]


def _covers(interval: tuple[float, float], parts: list[tuple[float, float]]) -> bool:
    """Whether parts cover an interval of angles, but for whole turns, and for rounding."""
    low, high = interval
    turns = TURN * np.arange(-4, 5)
    shifted = sorted((a + turn, b + turn) for a, b in parts for turn in turns if a <= b)
    reached = low
    for a, b in shifted:
        if a <= reached + SAME_END:
            reached = max(reached, b)
    return bool(reached >= high - SAME_END)


@dataclass(frozen=True, eq=False)
class Link:
    """The sum ``s = t_j + sign t_i`` as a variable in place of the angle t_j.

    Any two angles may be summed: a polynomial of old variables is one of the new ones.

    Attributes:
        first: The angle i.
        second: The angle j.
        sign: One, or minus one.
    """

    first: int
    second: int
    sign: int

    @classmethod
    def from_dict(cls, content: Any, slides: Mask, where: str) -> "Link":
        """Read a sum.

        Raises:
            ValueError: It is none of two angles.
        """
        v = len(slides)
        if len(rows(content, 3, where)) < 3:
            raise ValueError(f"{where}: expected two joints and a sign")
        i, j = (whole(one, 0, v - 1, where) for one in content[:2])
        sign = whole(content[2], -1, 1, where)
        if i == j or slides[i] or slides[j] or not sign:
            raise ValueError(f"{where}: expected two different joints that turn, and a sign")
        return cls(i, j, sign)

    def range(self, ends: Array) -> Array:
        """Intervals (2, v) that hold all new variables, for those of the old ones."""
        found = ends.copy()
        found[:, self.second] += np.sort(self.sign * ends[:, self.first])
        return found

    def of(self, form: "Form") -> "Form":
        """A polynomial of the old variables in the new ones.

        A product of waves ``exp(i a t_i) exp(i b t_j)`` is ``exp(i (a - sign b) t_i) exp(i b s)``.
        Every entry of `_waves` and of its inverse is exact, so that only sums of two numbers round,
        of which four follow one another, and what they sum is no more than 8 times the size.
        """
        values = np.moveaxis(form.values, (self.first, self.second), (0, 1)).astype(complex)
        n, m = values.shape[:2]
        waves = np.moveaxis(np.tensordot(_waves(n), values, 1), 1, 0)
        waves = np.tensordot(_waves(m), waves, 1)
        moved = np.zeros((m, n + m - 1, *values.shape[2:]), dtype=complex)
        for b, one in enumerate(waves, start=-(m // 2)):
            moved[b + m // 2, m // 2 - self.sign * b :][:n] = one
        found = np.moveaxis(np.tensordot(_unwaved(m), moved, 1), 1, 0)
        found = np.tensordot(_unwaved(n + m - 1), found, 1).real
        found = np.moveaxis(found, (0, 1), (self.first, self.second))
        return Form(found, form.error + 64 * U * form.size).trimmed()


def _waves(size: int) -> NDArray[np.complex128]:
    """From ``1, cos t, sin t, ...`` to ``exp(ikt)``, k ascending: its coefficients (size, size)."""
    found = np.zeros((size, size), dtype=complex)
    n = size // 2
    found[n, 0] = 1.0
    for k in range(1, n + 1):
        found[[n + k, n - k], 2 * k - 1] = 0.5
        found[[n + k, n - k], 2 * k] = -0.5j, 0.5j
    return found


def _unwaved(size: int) -> NDArray[np.complex128]:
    """The inverse of `_waves`."""
    found = 2.0 * _waves(size).conj().T
    found[0] = 0.5 * found[0]
    return found


@dataclass(frozen=True, eq=False)
class Form:
    """A polynomial by coefficients (n_1, ..., n_v), one axis a joint.

    Attributes:
        values: Coefficients by ``1, cos t, sin t, cos 2t, ...`` of an angle, by powers of
            ``(x - middle)/half`` of a length.
        error: By how much it may differ from what it stands for, anywhere.
    """

    values: Array
    error: float

    @property
    def size(self) -> float:
        """The sum of absolute coefficients, which no value is above."""
        return float(np.abs(self.values).sum()) * (1 + self.values.size * U)

    def trimmed(self) -> "Form":
        """Without the highest degrees that hardly count; what they add is error.

        So no degree is believed: that of a sensitivity is at most four, and often less.
        """
        kept = self.values
        dropped = 0.0
        least = DROPPED * self.size
        for j in range(kept.ndim):
            others = tuple(i for i in range(kept.ndim) if i != j)
            sums = np.abs(kept).sum(axis=others)
            above = np.flatnonzero(sums > least)
            n = int(above[-1]) + 1 if len(above) else 1
            n += (n + 1) % 2  # cosine and sine stay together; a length keeps one power more
            n = min(n, kept.shape[j])
            dropped += float(sums[n:].sum())
            kept = np.take(kept, np.arange(n), axis=j)
        return Form(kept, self.error + dropped * (1 + self.values.size * U))

    def padded(self, shape: tuple[int, ...]) -> Array:
        """The coefficients, with zeros for higher degrees."""
        missing = [(0, n - own) for n, own in zip(shape, self.values.shape, strict=True)]
        return np.pad(self.values, missing)

    def over(self, joints: list[int]) -> "Form":
        """The same in some of the joints.

        Raises:
            ValueError: It depends on another one.
        """
        others = [j for j in range(self.values.ndim) if j not in joints]
        if any(self.values.shape[j] > 1 for j in others):
            raise ValueError("a covering leaves out a joint that counts")
        kept = self.values.reshape([n for j, n in enumerate(self.values.shape) if j in joints])
        return replace(self, values=kept)

    def moved(self, motions: "list[Motion]") -> "Form":
        """The same, where what motions change of it counts as error."""
        error = self.error
        for motion in motions:
            signs = np.ones(())
            of_joints = zip(self.values.shape, motion.mirrors, motion.turns, strict=True)
            for n, mirror, turn in of_joints:
                k = (np.arange(n) + 1) // 2
                sine = (np.arange(n) % 2 == 0) & (k > 0)
                own = np.where(turn & (k % 2 == 1), -1, 1) * np.where(mirror & sine, -1, 1)
                signs = signs[..., None] * own
            changed = float(np.abs(self.values[signs < 0]).sum())
            error += 2 * changed * (1 + self.values.size * U)
        return replace(self, error=error)


@dataclass(frozen=True, eq=False)
class Domain:
    """The joints that a covering is about, and the intervals that it must cover.

    Attributes:
        joints: Indices (v,) of free joints.
        limits: Intervals (2, v) [rad or m], of angles at most one turn.
        slides: Which joints (v,) are prismatic.
        degrees: Degree (v,) of every vector of the chain in each: one where a joint moves alone,
            and the sum of all turns for one of its drive.
    """

    joints: list[int]
    limits: Array
    slides: Mask
    degrees: Indices

    @classmethod
    def of(cls, setting: Setting) -> "Domain":
        """All joints that are designed.

        Raises:
            ValueError: There are too many, or none, or one moves others by no whole turns.
        """
        if not setting.free:
            raise ValueError("no joint is designed")
        if len(setting.free) > MOST_FREE_JOINTS:
            raise ValueError(f"a covering of more than {MOST_FREE_JOINTS} joints is not checked")
        low, high = setting.limits[:, setting.free]
        slides = setting.chain.prismatic[setting.free]
        high = np.where(slides, high, np.minimum(high, low + TURN))
        degrees = degrees_of(setting.chain)[setting.free]
        if np.prod(DEGREE * degrees * np.where(slides, 1.0, 2.0) + 1) > MOST_POSES:
            raise ValueError(f"a grid of more than {MOST_POSES} poses is not checked")
        return cls(list(setting.free), np.stack([low, high]), slides, degrees)

    def within(self, j: int) -> Form | None:
        """Zero or more within the limits of a joint, a cosine less one; None of a whole turn."""
        low, high = self.limits[:, j]
        if high - low >= TURN:
            return None
        middle, half = (low + high) / 2, (high - low) / 2
        values = np.array([-np.cos(half), np.cos(middle), np.sin(middle)])
        shape = [3 if i == j else 1 for i in range(len(self.joints))]
        return Form(values.reshape(shape), (8 + 4 * (abs(low) + abs(high))) * U)

    def grid(self, order: int) -> list[Array]:
        """Places along each joint that determine products of so many vectors of the chain."""
        found = []
        parts = zip(self.limits.T, self.slides, (order * self.degrees).tolist(), strict=True)
        for (low, high), slides, degree in parts:
            if slides:
                x = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
                found.append((low + high) / 2 + (high - low) / 2 * x)
            else:
                # At most half a turn away from zero, where angles round less.
                places = (np.arange(2 * degree + 1) + degree) % (2 * degree + 1) - degree
                found.append(TURN * places / (2 * degree + 1))
        return found

    def form(self, values: Array, order: int, error: float) -> Form:
        """The polynomial with these values (k,) on the grid, each of which may be off by so much.

        Errors of values move it by Lebesgue's constant of each joint at most; of N angles it is
        ``sum_k 1/(N sin((2k + 1) pi/2N))``, taken between two of them (Ehlich and Zeller, 1966).
        With functions scaled so that their squares have the sum N anywhere, the analysis of N
        values is orthogonal but for ``sqrt(N)``, so that by Cauchy and Schwarz a product rounds by
        ``sqrt(N)`` times its own roundings, in the norm of all values. Along a length the inverse
        is taken as it is, norm by norm.
        """
        values = values.reshape([len(x) for x in self.grid(order)])
        norm = float(np.linalg.norm(values))
        lebesgue = gain = 1.0
        rounds = 0.0
        for j, slides in enumerate(self.slides):
            B = _analysis(order * int(self.degrees[j]), bool(slides))
            n = len(B)
            if slides:
                size = n * float(np.linalg.norm(np.abs(B), 2))
                lebesgue *= size
                gain *= size / np.sqrt(n)
                rounds += (n + 20) * U * size
            else:
                places = np.pi * (2 * np.arange(n) + 1) / (2 * n)
                lebesgue *= float((1 / np.sin(places)).sum()) / n
                rounds += (n + 20) * U * np.sqrt(n)
            values = np.moveaxis(np.tensordot(B, values, (1, j)), 0, j)
        return Form(values, 1.01 * (lebesgue * error + gain * rounds * norm)).trimmed()


def _analysis(degree: int, slides: bool) -> Array:
    """From values on the grid to coefficients (n, n)."""
    if slides:
        x = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
        return np.linalg.inv(np.vander(x, increasing=True))
    n = 2 * degree + 1
    turns = TURN / n * (np.outer(np.arange(1, degree + 1), np.arange(n)) % n)
    both = np.stack([np.cos(turns), np.sin(turns)], axis=1).reshape(-1, n)
    return np.concatenate([np.ones((1, n)), 2 * both]) / n


def degrees_of(chain: Chain) -> Indices:
    """Degree (n,) of every vector of the chain in each of its drives.

    A joint that turns r times for one turn of its drive has the cosine of ``r t``; a product of
    joints adds their degrees. Lengths are of degree one, however many slide together.

    Raises:
        ValueError: A joint turns by a ratio that is not whole, or turns where another one slides.
    """
    P = chain.ties[0]
    turning = P[~chain.slides]
    across = np.where(chain.prismatic, turning.any(axis=0), P[chain.slides].any(axis=0))
    if (turning != np.round(turning)).any() or across.any():
        raise ValueError(
            "a covering of poses is not checked here with joints that follow by another ratio than "
            "one of whole turns"
        )
    return np.where(chain.prismatic, 1, np.abs(turning).sum(axis=0)).astype(int)
