"""The two matrices A0 that reproducing print needs side by side."""

import numpy as np

from edtk.system.typing import Array


def clipped(target: Array) -> Array:
    """``max(A0, 0)``, entry by entry: only with this do Table 6 and Fig. 7 agree with print.

    Why is unknown. It serves to reproduce print and nothing else: `edtk` computes Eq. (20) with A0
    itself.

    Args:
        target: A0 (3, p), Eq. (23) [m/(rad/(N m))].
    """
    return np.maximum(target, 0.0)


def both(target: Array) -> dict[str, Array]:
    """The variants by the name that the outputs give them: "clipped" and "true"."""
    return {"clipped": clipped(target), "true": target}
