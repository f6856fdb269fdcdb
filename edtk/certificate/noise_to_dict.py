"""The errors of a visit, as a certificate holds them."""

from typing import Any

from edtk.model.noise.visit_noise import VisitNoise


def noise_to_dict(noise: VisitNoise | None) -> dict[str, Any]:
    """Write a tracker, the joints' repeatability and the discrepancy as plain data [m, rad].

    Returns:
        Two keys: the white part, and the rest; none where all noise is white.
    """
    if noise is None:
        return {}
    tracker = noise.tracker
    return {
        "sigma": noise.white.tolist(),
        "noise": {
            "tracker": None
            if tracker is None
            else {
                "position": tracker.position.tolist(),
                "along": list(tracker.along),
                "across": list(tracker.across),
            },
            "repeatability": noise.repeatability.tolist(),
            "discrepancy": noise.discrepancy.tolist(),
            "within": noise.within,
            "readings": noise.readings,
        },
    }
