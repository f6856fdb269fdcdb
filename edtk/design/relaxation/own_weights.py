"""The restricted master problem by methods of our own, where the criterion has a suitable form."""

import numpy as np

from criteria import Relaxable
from edtk.design.relaxation.active_information import ActiveInformation
from edtk.design.relaxation.loss_weights import loss_weights
from edtk.design.relaxation.newton_weights import NewtonError, newton_weights, suits_newton
from edtk.design.relaxation.spectral_weights import spectral_weights
from edtk.design.relaxation.variance_weights import variance_weights
from edtk.system.typing import Array


def has_own_method(criterion: Relaxable, p: int) -> bool:
    """Whether a criterion of p parameters needs no program of cvxpy's."""
    forms = (criterion.spectral_band(p), criterion.variance_rows(p), criterion.largest_of(p))
    return suits_newton(criterion, p) or any(form is not None for form in forms)


def own_weights(
    criterion: Relaxable,
    active: ActiveInformation,
    start: Array,
    accuracy: float,
    near: Array | None = None,
) -> tuple[Array, Array | None]:
    """Find the best weights of a few candidates.

    Args:
        criterion: What is minimised.
        active: Information of the candidates (k).
        start: Weights (k,) to start from; those of zero are new.
        accuracy: Relative gap at which to end.
        near: The multiplier (p, p) that the weights to start from had, if it is known.

    Returns:
        Weights (k,), positive, of sum one, and a multiplier (p, p); None where minus the gradient
        is one.

    Raises:
        NewtonError: The criterion has no suitable form, or the method has broken down.
        LinAlgError: A matrix is singular.
    """
    p = len(active.information(start))
    band = criterion.spectral_band(p)
    if band is not None:
        return spectral_weights(band, active, start, accuracy, near)
    rows = criterion.variance_rows(p)
    if rows is not None:
        return variance_weights(rows, active, start, accuracy, near)
    losses = criterion.largest_of(p)
    if losses is not None:
        return loss_weights(losses, active, start, accuracy)
    if not suits_newton(criterion, p):
        raise NewtonError(f"criterion {criterion.name} is not smooth")
    weights = newton_weights(criterion, active, start, accuracy)
    if criterion.needs_all:
        return weights, None
    # Where a design without light candidates is singular, its gradient need not be a multiplier.
    return weights, np.asarray(-criterion.gradient(active.information(weights)))
