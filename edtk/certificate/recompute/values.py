"""Values of the criteria from the singular values of the stacked rows, never from M itself."""

import numpy as np

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
MAXIMISED = ("D", "E", "O1", "O3", "O4")


def value(name: str, stacked: Array, targets: list[Array]) -> float:
    """The criterion's value, as printed, of a design with stacked whitened rows (N, p).

    Args:
        name: One of the eleven criteria.
        stacked: Rows of ``A_i / sigma``, each times the root of its weight or of its repetitions.
        targets: Targets (r, p) of which the harm is the largest one, for rho0 and rho_max: of all
            tasks together for rho0, of each task for rho_max.

    Raises:
        ValueError: The name is unknown, or there is no target where one is needed.
    """
    _, s, V = np.linalg.svd(stacked, full_matrices=False)
    if len(s) < stacked.shape[1] or s[-1] <= 0:
        return 0.0 if name in MAXIMISED else float("inf")
    if name in ("rho0", "rho_max"):
        if not targets:
            raise ValueError(f"{name} needs a test pose")
        return max(float(np.linalg.norm(target @ (V.T / s))) for target in targets)
    variances = ((V.T / s) ** 2).sum(axis=1)
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
