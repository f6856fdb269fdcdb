"""How a controller counts the joints: sign, zero and coupling."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.system.typing import Array


@dataclass(frozen=True)
class Follows:
    """A joint whose value the controller counts against another joint.

    Attributes:
        joint: Index of the joint that follows.
        leader: Index of the joint that it follows.
        factor: Motion of the follower's joint for one unit that the leader is jogged, while the
            follower's own number stays.
    """

    joint: int
    leader: int
    factor: float


@dataclass(frozen=True, eq=False)
class Controller:
    """An affine map between the controller's joint values c and the model's joint variables q.

    ``q_j = s_j (c_j - z_j + f_j (c_m - z_m))``, where the last term is there for a joint j that
    follows a joint m only: its controller counts it against something that m does not turn, as with
    a forearm whose angle to the horizon is shown. Both are in SI units; at q = 0 the controller
    shows its zeros z.

    Args:
        sign: 1 or -1 (n,) for each joint.
        zero: What the controller shows in the model's zero pose (n,) [deg or mm]; degrees, for they
            are typed, and a file shall give the same digits back.
        units: SI units in one unit of `zero` (n,).
        follows: The joints that follow others.

    Raises:
        ValueError: Joints follow each other in a circle.
    """

    sign: Array
    zero: Array
    units: Array
    follows: tuple[Follows, ...] = ()

    def __post_init__(self) -> None:
        # Without a circle the coupling is nilpotent: no product of n couplings is left.
        if np.linalg.matrix_power(self._coupling != 0, len(self.sign)).any():
            raise ValueError("joints follow each other in a circle")

    @cached_property
    def _coupling(self) -> Array:
        """Factors f (n, n): row j has that of the joint which j follows."""
        coupling = np.zeros((len(self.sign), len(self.sign)))
        for one in self.follows:
            coupling[one.joint, one.leader] = one.factor
        return coupling

    @cached_property
    def _zero(self) -> Array:
        """Zeros (n,) [rad or m]."""
        return np.asarray(self.zero * self.units)

    @cached_property
    def _uncoupled(self) -> Array:
        """Inverse (n, n) of the coupling: controller's values from joints less their signs."""
        return np.asarray(np.linalg.inv(np.eye(len(self.sign)) + self._coupling), dtype=float)

    def leaders(self, joint: int) -> tuple[int, ...]:
        """The joint that a joint follows, the one that this follows, and so on."""
        direct = [one.leader for one in self.follows if one.joint == joint]
        return (*direct, *(further for leader in direct for further in self.leaders(leader)))

    def model_of(self, shown: Array) -> Array:
        """Joint variables of the model (..., n) for the controller's values (..., n) [rad or m]."""
        from_zero = shown - self._zero
        if self.follows:
            from_zero = from_zero + from_zero @ self._coupling.T
        return np.asarray(self.sign * from_zero)

    def shown_of(self, q: Array) -> Array:
        """The controller's values (..., n) for joint variables of the model (..., n) [rad or m]."""
        return self.shown_change(q) + self._zero

    def shown_change(self, change: Array) -> Array:
        """Change (..., n) of the controller's values for a change (..., n) of the model's."""
        from_zero: Array = self.sign * change
        return from_zero @ self._uncoupled.T if self.follows else from_zero
