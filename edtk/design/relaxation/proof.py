"""Why no weights of candidates have a lower cost."""

from dataclasses import dataclass

import numpy as np

from criteria import Relaxable
from criteria.linalg.inverse import ROUNDING, whitener
from edtk.design.problem import Problem
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Proof:
    """A bound on the cost of all weights of the candidates.

    Attributes:
        multiplier: A multiplier Z (p, p).
        largest: The largest sensitivity ``<Z, M_i>`` of a candidate to it.
        lower_bound: The bound on the cost that both prove.
    """

    multiplier: Array
    largest: float
    lower_bound: float

    @classmethod
    def of(
        cls, problem: Problem, criterion: Relaxable, M: Array, Z: Array | None
    ) -> "tuple[Proof, Array]":
        """Find what a solver's multiplier proves near a design.

        Args:
            problem: The candidates (n).
            criterion: What is minimised.
            M: The design (p, p).
            Z: The multiplier (p, p); without one minus the gradient is one.

        Returns:
            The best proof, and the sensitivities (n,) of all candidates to its multiplier.
        """
        trials = _trial_multipliers(criterion, M, Z)
        sensitivities = problem.sensitivities(trials)
        largest = sensitivities.max(axis=-1)
        found = [
            criterion.lower_bound(trials[i : i + 1], largest[i : i + 1], M)
            for i in range(len(trials))
        ]
        # A solver's multiplier may be so far off that its bound is negative or not a number.
        bounds = np.where(np.isfinite(found), np.maximum(found, 0.0), 0.0)
        best = int(np.argmax(bounds))
        proof = cls(trials[best], float(largest[best]), float(bounds[best]))
        return proof, sensitivities[best]


def _trial_multipliers(criterion: Relaxable, M: Array, Z: Array | None) -> Array:
    """Multipliers to try (r, p, p): the solver's, and minus the gradient at M of a smooth cost.

    A gradient may be no number where M is all but singular, as the best design for a part of the
    parameters may be. Without another one the inverse is tried: any multiplier proves something.
    """
    trials = [] if Z is None else [Z]
    if Z is None or criterion.smooth:
        trials.append(-criterion.gradient(M))
    trials = [trial for trial in trials if np.isfinite(trial).all()]
    # A small difference of large parts may be symmetric only to the rounding of the parts.
    trials = [0.5 * (trial + trial.T) for trial in trials]
    T = whitener(M)
    if criterion.monotone:
        trials = [_semidefinite(trial, T) for trial in trials]
    return np.stack(trials or [T @ T.T])


def _semidefinite(Z: Array, T: Array) -> Array:
    """A multiplier (p, p) without what rounding or a solver's inaccuracy has left.

    A multiplier of a monotone criterion must be positive semidefinite. Its negative eigenvalues are
    cut off in the parameters that T whitens, where they are small beside the others. A parameter of
    which it has a rounding of zero gets zeros: other units would make that of order one.
    """
    S = np.linalg.inv(T)
    z, V = np.linalg.eigh(S @ Z @ S.T)
    if z[0] < 0:
        F = T @ V * np.sqrt(np.maximum(z, 0.0))
        Z = F @ F.T
    rounding = len(Z) * ROUNDING * z[-1] * np.square(T).sum(axis=1)
    has_some = np.diag(Z) > rounding
    return np.where(has_some[:, None] & has_some, Z, 0.0)
