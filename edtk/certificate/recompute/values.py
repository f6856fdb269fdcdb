"""Values of the criteria from the singular values of the stacked rows, never from M itself."""

import numpy as np

from edtk.certificate.recompute.tasks import deviations
from edtk.system.typing import Array

DEGREE = {
    "A": 1.0,
    "D": 1.0,
    "E": 1.0,
    "G": 1.0,
    "O1": 0.5,
    "O2": 0.0,
    "O3": 0.5,
    "O4": 0.5,
    "O5": 0.5,
    "rho0": 0.5,
    "rho_max": 0.5,
}
OF_TARGET = ("rho0", "rho_max")
OF_COMBINATIONS = ("A", "D", "E", "G", "O1", "O3", "O5")  # monotone, and without a target
MAXIMISED = ("D", "E", "O1", "O3", "O4")


def value(name: str, stacked: Array, targets: list[Array], K: Array | None = None) -> float:
    """The criterion's value, as printed, of a design with stacked whitened rows (N, p).

    Args:
        name: One of the eleven criteria.
        stacked: Rows of ``A_i / sigma``, each times the root of its weight or of its repetitions.
        targets: Targets (r, p) of which the harm is the largest one, for rho0 and rho_max: of all
            tasks together for rho0, of each task for rho_max.
        K: Combinations (p, s) of the parameters that the criterion is about; defaults to all
            parameters.

    Raises:
        ValueError: The name is unknown, there is no target where one is needed, or the criterion
            has no meaning for combinations.
    """
    if K is not None:
        L = deviations(stacked, K)
        return _nothing_known(name) if L is None else _of_combinations(name, L)
    _, s, V = np.linalg.svd(stacked, full_matrices=False)
    if len(s) < stacked.shape[1] or s[-1] <= 0:
        return _nothing_known(name)
    if name in OF_TARGET:
        if not targets:
            raise ValueError(f"{name} needs a test pose")
        return max(float(np.linalg.norm(target @ (V.T / s))) for target in targets)
    return _of_spectrum(name, s, ((V.T / s) ** 2).sum(axis=1))


def _nothing_known(name: str) -> float:
    """The value of a design that leaves something open."""
    return 0.0 if name in MAXIMISED else float("inf")


def _of_combinations(name: str, L: Array) -> float:
    """The value for combinations of the covariance ``L L'``, L (s, r)."""
    if name not in OF_COMBINATIONS:
        raise ValueError(f"the criterion {name} has no meaning for combinations of the parameters")
    s = 1 / np.linalg.svd(L, compute_uv=False)[::-1]
    return _of_spectrum(name, s, (L**2).sum(axis=1))


def _of_spectrum(name: str, s: Array, variances: Array) -> float:
    """The value from roots s of the information's eigenvalues, descending, and the variances."""
    mean_log = np.log(s).mean()
    found = {
        "A": variances.sum(),
        "D": np.exp(2 * mean_log),
        "E": s[-1] ** 2,
        "G": variances.max(),
        "O1": np.exp(mean_log),
        "O2": s[0] / s[-1],
        "O3": s[-1],
        "O4": s[-1] ** 2 / s[0],
        "O5": (1 / s).sum(),
    }
    if name not in found:
        raise ValueError(f"no criterion {name!r} is known here")
    return float(found[name])


def cost(name: str, printed: float) -> float:
    """The cost, where smaller is better, of a printed value."""
    if name not in MAXIMISED:
        return printed
    return 1 / printed if printed > 0 else float("inf")


def printed(name: str, cost_of_it: float) -> float:
    """The printed value of a cost."""
    return cost(name, cost_of_it)
