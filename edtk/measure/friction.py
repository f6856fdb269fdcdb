"""What friction of the joints holds of their loads."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from edtk.system.typing import Array

# Of a joint's usual load: friction holds most of a load that is smaller than that.
GIVES = 0.1
# Standard deviation of a joint's share, over the mean of all, as a sheet takes it. Gears of a robot
# are of one make, and lose shares alike; none pushes, and of normal shares with a larger spread
# some would.
SPREAD_OF_SHARES = 0.5
# The same of a plan, which is to tell joints apart: it trusts less that they are alike.
PLANNED = 1.0


@dataclass(frozen=True, eq=False)
class Friction:
    """Friction of joints, each of which holds a share of its usual load.

    The spring of joint j turns by ``k_j tau_j``. Friction that holds the load ``u_j m_j``, a share
    of the usual load m_j, takes ``k_j m_j sign(tau_j)`` times that share from it. A load of far
    less than a tenth of m_j is held in proportion, so that the shares have the columns

        U_j = y_j k_j h(tau_j),   h(t) = m_j t / sqrt(t^2 + (m_j / 10)^2),

    with the motion y_j of what is measured: that of the spring, times a factor of its load. Loads
    of one size leave both one and the same; those of several sizes tell them apart. The way from
    one to the other is smooth, as that of gears is, and so that ascents do not stop at a bend: the
    best poses have loads of this size.

    Where a load is put on, friction holds back in every joint, so that shares go together: any two
    of them are correlated by a half, see `correlated`.

    Attributes:
        k: Compliances (p,) of the joints [rad/(N m)].
        load: Their usual loads (p,), each above zero where the compliance is [N m or N].
        share: Standard deviation of each share.
    """

    k: Array
    load: Array
    share: float

    def __len__(self) -> int:
        return len(self.k)

    def factors(self, torque: Array) -> Array:
        """``k_j h(tau_j) / tau_j`` (p, ...), of loads tau (p, ...)."""
        return self._lifted(self.k, torque) * held(torque, self._lifted(self.load, torque))

    def slopes(self, torque: Array) -> Array:
        """The derivatives (p, ...) of these factors by the loads."""
        small = _small(self._lifted(self.load, torque))
        return -self.factors(torque) * torque / (torque**2 + small**2)

    @staticmethod
    def _lifted(values: Array, torque: Array) -> Array:
        """Values (p, 1, ...) of the joints, to go with loads (p, ...)."""
        return values.reshape(-1, *[1] * (torque.ndim - 1))

    @property
    def information(self) -> Array:
        """What is known of the shares before they are measured (p, p)."""
        return np.asarray(np.linalg.inv(correlated(len(self.k), PLANNED)) / self.share**2)

    def names(self, joints: Sequence[str]) -> tuple[str, ...]:
        """Names of the shares."""
        return tuple(f"friction of {name}" for name in joints)


def held(torque: Array, load: Array) -> Array:
    """``h(tau) / tau`` of loads tau: the part that friction holds by a share of one.

    Args:
        torque: The loads (n, ...) [N m or N].
        load: Usual loads (n, 1, ...); friction holds nothing where they are zero.
    """
    return np.asarray(load / np.hypot(torque, _small(load)))


def held_by(share: float, torque: Array, load: Array) -> Array:
    """The same (..., n) of friction that holds just this share of usual loads.

    It holds ``min(|tau|, share m)``, the whole of a small load; for a share of one that is
    ``h(tau) = min(|tau| / share, m) sign(tau)``. Nothing is held by no share.

    Args:
        share: The share.
        torque: Loads tau (..., n) [N m or N].
        load: Usual loads m (n,).
    """
    if not share:
        return np.zeros_like(torque)
    size = np.abs(torque)
    whole = size <= share * load
    return np.where(whole, 1 / share, load / np.where(whole, 1.0, size))


def _small(load: Array) -> Array:
    """The loads below which friction holds in proportion; not zero where usual loads are."""
    return GIVES * np.where(load > 0, load, 1.0)


def scatter(spread: float) -> float:
    """The standard deviation of shares of mean square one, of which that over their mean is r."""
    return float(spread / np.hypot(1.0, spread))


def correlated(n: int, spread: float) -> Array:
    """Mean products (n, n) of shares ``v_j`` of mean square one that hold back in every joint.

    With ``v_j = (1 + r z_j) / sqrt(1 + r^2)`` of independent z and the spread r they are
    ``(11' + r^2 I) / (1 + r^2)``.
    """
    return np.asarray((np.ones((n, n)) + spread**2 * np.eye(n)) / (1 + spread**2))


def together(columns: Array, spread: float) -> Array:
    """Columns (n, ...) of uncorrelated shares, of those whose shares go together.

    With the symmetric root R of `correlated`, shares ``R u`` have these mean products for u of
    covariance I. Its squares have the eigenvalues ``(n + r^2) / (1 + r^2)`` along the vector of
    ones and ``r^2 / (1 + r^2)`` across it.
    """
    n = len(columns)
    own = scatter(spread)
    common = (np.sqrt((n + spread**2) / (1 + spread**2)) - own) / n
    return np.asarray(own * columns + common * columns.sum(axis=0))
