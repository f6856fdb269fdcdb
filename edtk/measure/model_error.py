"""What a model of springs leaves out: an error of each pose, which its repeats share."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.measure.instruments.sensor import Sensor
from edtk.system.typing import Array, Indices

# Share of what springs do that a model of them is likely to leave out. On simulated arms it was
# 0.04 to 0.16: by springs across the joints of a tenth to a third of their own, links that bend,
# stiffness that varies by 15 % with the pose, friction that takes a part of the load.
ASSUMED = 0.1


@dataclass(frozen=True, eq=False)
class ModelError:
    """Errors of a pose's rows by what six ideal springs are not, as shares of what springs do.

    Spring i turns by ``k_i tau_i`` under a load, which moves the rows by ``b_i = k_i tau_i y_i``
    with their motion ``y_i = dy/dq_i``. What the model leaves out of that is random, and another
    one in each pose. Two shares say how large it is. By `turn` each spring turns further or less
    than its model says, each for itself, as where it is stiffer in some positions, or friction
    holds a part of its load:

        C = sum_i b_i b_i',   E_turn = turn^2 C.

    By `anywhere` the rows move in all directions alike, as where links and bearings bend across
    the axes. Rows of a group are the coordinates that an instrument reads alike: those of a
    position, those of an orientation, or a distance by itself. With the mean P C of C's diagonal
    over each group,

        E_anywhere = anywhere^2 diag(P C),

    so that a position is off by ``anywhere sqrt(sum_i |b_i|^2)``, root mean square. Both add up
    to the covariance ``E = E_turn + E_anywhere`` of the rows. Squares of springs add up, and not
    what they do together: where two springs happen to move a marker against each other, no pose is
    free of errors.

    Visits of one pose under one load share this error, so that repeats do not average it out, see
    `VisitNoise`. A task has an error of its own, E of its own rows.

    Arrays are component first, as in `Frames`.

    Attributes:
        k: Compliances (n,) of all free joints, as they are guessed or known [rad/(N m)].
        turn: Standard deviation of a spring's turn, as a share of it.
        anywhere: That of a position in any direction, as a share of what the springs move it.
    """

    k: Array
    turn: float = 0.0
    anywhere: float = 0.0

    @classmethod
    def of_share(cls, k: Array, share: float) -> "ModelError":
        """Half of the variance in the springs' turns, and half of it in any direction.

        A position is off by ``share sqrt(sum_i |b_i|^2)`` in all, root mean square.
        """
        half = share / np.sqrt(2.0)
        return cls(k, half, half)

    @property
    def share(self) -> float:
        """What is left out of a position in all, as a share of what the springs move it."""
        return float(np.hypot(self.turn, self.anywhere))

    def to_dict(self, unit: float = 1.0) -> dict[str, Any]:
        """Plain data [rad/(N m), shares], where compliances are in units of so many a radian."""
        return {"k": (self.k / unit).tolist(), "turn": self.turn, "anywhere": self.anywhere}

    def bends(self, motion: Array, torque: Array) -> Array:
        """What each spring does to the rows, ``b_i`` (n, rows, ...) [m, rad].

        Args:
            motion: Derivatives dy/dq (n, rows, ...) of the rows by all free joints.
            torque: Loads tau (n, ...) of these joints, or their change [N m, N].
        """
        turned = self.k.reshape(-1, *[1] * (torque.ndim - 1)) * torque
        return np.asarray(motion * turned[:, None])

    def turns(self, bends: Array) -> Array:
        """A root B (n, rows, ...) of the springs' part: ``E_turn = sum_i B_i B_i'``.

        Where visits of several instruments share an error, so do these, spring by spring.
        """
        return np.asarray(self.turn * bends)

    def sizes(self, bends: Array, groups: Indices) -> Array:
        """Standard deviations (rows, ...) of the part that is the same in any direction."""
        squares = np.einsum("ir...,ir...->r...", bends, bends)
        return np.asarray(self.anywhere * np.sqrt(_means(squares, groups)))

    def covariance(self, bends: Array, groups: Indices) -> Array:
        """The covariance E (rows, rows, ...) of rows that springs move by ``b_i``.

        Args:
            bends: What each spring does to them (n, rows, ...) [m, rad], see `bends`.
            groups: Which group (rows,) each row is in, see `groups_of`.
        """
        B = self.turns(bends)
        E = np.einsum("ir...,is...->rs...", B, B)
        for row, size in enumerate(self.sizes(bends, groups)):
            E[row, row] += size**2
        return E

    def remaining(self, columns: Array) -> float:
        """Root mean square of what is left out of rows that count alike, as in a task [m].

        Args:
            columns: Their columns (rows, n), of all free joints: ``y_i tau_i`` [m/(rad/(N m))].
        """
        return self.share * float(np.linalg.norm(columns * self.k))

    def slope_weights(
        self, motion: Array, torque: Array, S: Array, groups: Indices
    ) -> tuple[Array, Array]:
        """Weights with which ``d<S, E>`` follows motion and loads, S held fixed and symmetric.

        ``<S, E> = sum_i b_i' T b_i`` with ``T = turn^2 S + anywhere^2 diag(P S)``, as P is its own
        adjoint, so that

            d<S, E> = sum_i <B_i, dy_i> + sum_i s_i dtau_i,
            B_i = 2 k_i tau_i T b_i,   s_i = 2 k_i y_i' T b_i.

        Args:
            motion: Derivatives dy/dq (n, rows, ...).
            torque: Loads tau (n, ...).
            S: Weights (rows, rows, ...).
            groups: Which group (rows,) each row is in.

        Returns:
            B (n, rows, ...) and s (n, ...).
        """
        T = self.turn**2 * S
        diagonal = _means(np.einsum("rr...->r...", S), groups)
        for row, own in enumerate(diagonal):
            T[row, row] += self.anywhere**2 * own
        k = self.k.reshape(-1, *[1] * (torque.ndim - 1))
        Tb = 2 * np.einsum("rs...,is...->ir...", T, self.bends(motion, torque))
        return (k * torque)[:, None] * Tb, k * np.einsum("ir...,ir...->i...", motion, Tb)


def _means(rows: Array, groups: Indices) -> Array:
    """The mean (rows, ...) of each row's group."""
    found = np.empty_like(rows, dtype=float)
    for group in np.unique(groups):
        own = groups == group
        found[own] = rows[own].mean(axis=0)
    return found


def groups_of(instruments: Sequence[Sensor]) -> Indices:
    """Groups (rows,) of the rows of whole instruments: lengths, and angles, of each of them."""
    found: list[int] = []
    for place, one in enumerate(instruments):
        found += (2 * place + ~one.lengths).tolist()
    return np.array(found, dtype=int)
