"""How often experiments would have to be measured until they tell two faults apart."""

import math

import numpy as np

from edtk.calibration.causes.plain_fit import PlainFit
from edtk.calibration.causes.tried import Tried
from edtk.system.typing import Array

LIKELY = 1.2816  # a standard normal variable is below it with 90 %
MOST = 100  # times that anybody would measure


def times_to_tell(first: Tried, second: Tried, plain: PlainFit) -> int | None:
    """Repetitions after which the first fault, if it is the true one, is told from the second.

    Of what the first fault makes, ``D_1 c``, the second leaves a part of squared length d^2 in
    units of the noise, once compliances and its own size are fitted. Between two predictions that
    are d apart the likelier one is right with the probability Phi(d/2) (Fisher's linear
    discriminant); each repetition of all experiments adds as much to d^2.

    Args:
        first: The fault that is taken for the true one.
        second: The other one.
        plain: The measurements without any fault.

    Returns:
        How often each experiment is measured until that is 90 %, at least once; None for the same
        fault or one of single rows, and where `MOST` times do not.
    """
    size = first.size
    if first is second or size is None or second.family is None:
        return None
    made = _shown(first, plain) @ size
    other = _shown(second, plain)
    imitated, *_ = np.linalg.lstsq(other, made, rcond=None)
    apart = float(((made - other @ imitated) ** 2).sum())
    if apart * MOST < (2 * LIKELY) ** 2:
        return None
    return math.ceil((2 * LIKELY) ** 2 / apart)


def _shown(one: Tried, plain: PlainFit) -> Array:
    """What residuals (n, dims) show of a unit of each of a fault's parameters."""
    assert one.family is not None
    columns = np.moveaxis(one.family.derivative_at_zero(plain.k), -1, 0)
    return np.stack([plain.whitened.residual(column).ravel() for column in columns], axis=-1)
