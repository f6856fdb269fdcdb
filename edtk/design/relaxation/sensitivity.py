"""The sensitivity of a design to experiments anywhere in the design space, with its derivatives."""

from dataclasses import dataclass

import numpy as np

from edtk.design.interior_point.neighbourhood import Neighbourhood
from edtk.design.interior_point.objective import Local, Objective
from edtk.design.packed import sensitivity_rows
from edtk.design.space import Points
from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class Sensitivity(Objective):
    """Minus the sensitivity of one experiment, as an objective to be minimised.

    Attributes:
        Z: The multiplier of each start (n, p, p).
        per_trace: See `sensitivity_and_slope`.
    """

    Z: Array
    per_trace: bool

    def value(self, here: Points, start: Indices) -> Array:
        """Minus the sensitivities (b,) of experiments (b, 1)."""
        return -sensitivity_and_slope(here, self.Z[start], self.per_trace)[0][:, 0]

    def local(self, near: Neighbourhood, start: Indices) -> Local:
        """Minus the sensitivities with slopes and curvature; one experiment has no partners."""
        value, slope = sensitivity_and_slope(near.experiments, self.Z[start], self.per_trace)
        slope = -near.first(slope)
        own = near.second(slope)
        together = np.zeros_like(own[:, 0])
        return Local(-value[0, :, 0], slope[0], own, together)


def sensitivity_and_slope(here: Points, Z: Array, per_trace: bool = False) -> tuple[Array, Array]:
    """Sensitivities ``<Z, M(x)>`` of experiments x, and their derivatives.

    With ``M(x) = M0 + A' A`` of whitened rows A the differential is ``d<Z, M> = 2 <A Z, dA>``. Per
    trace the sensitivity is ``<Z, M>/trace(M)``, with the quotient rule.

    Args:
        here: Points (..., b, k).
        Z: Multipliers (b, p, p), one for each row of experiments.
        per_trace: Whether to divide by ``trace M(x)``: for criteria of degree zero.

    Returns:
        Sensitivities (..., b, k) and slopes (..., b, k, v) by the design variables.
    """
    M = here.packed
    A = here.regressor
    prior = here.space.prior
    value = np.einsum("bt,t...bk->...bk", sensitivity_rows(Z), M)
    if prior is not None:
        value = value + np.tensordot(Z, prior, 2)[:, None]
    slope = here.slope(2 * A @ Z[:, None])
    if not per_trace:
        return value, slope
    trace = np.tensordot(sensitivity_rows(np.eye(Z.shape[-1])), M, 1)
    if prior is not None:
        trace = trace + np.trace(prior)
    trace_slope = here.slope(2 * A)
    # An experiment that tells nothing has no direction either; its sensitivity counts as zero.
    trace = np.where(trace > 0, trace, 1.0)
    value = value / trace
    return value, (slope - value[..., None] * trace_slope) / trace[..., None]
