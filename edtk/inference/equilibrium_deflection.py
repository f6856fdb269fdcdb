"""The measurement without noise: the motion of a loaded robot that is at rest."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.equilibrium import equilibrium
from edtk.model.rest import Rest
from edtk.system.typing import Array


def equilibrium_deflection(
    model: ElastostaticModel,
    q: ArrayLike,
    wrench: ArrayLike,
    k: ArrayLike,
    marker: ArrayLike = (0.0, 0.0, 0.0),
) -> Array:
    """Motion of the tool, or of a marker on it, from the unloaded pose to the loaded equilibrium.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        q: Joint variables (..., n) [rad or m].
        wrench: Forces and torques (..., 6) or (6,) at the tool point [N, N m].
        k: Compliances (..., n) or (n,) of all joints [rad/(N m)].
        marker: Offsets (..., 3) or (3,) from the tool point, in the tool frame [m]; of a model
            without instruments of its own.

    Returns:
        Deflections (..., rows) [m, rad], one instrument after another.

    Raises:
        NoEquilibriumError: A pose buckles under the load.
    """
    if not model.is_plain or model.own_weights is not None:
        rest = Rest.of(model, q, wrench, k)
        before = model.frames(rest.start)
        after = model.frames(rest.end)
        rows = [sensor.change(before, after) for sensor in model.whole_instruments]
        return np.moveaxis(np.concatenate(rows), 0, -1)
    return marker_motion(model, q, equilibrium(model.robot, q, wrench, k).displacement, marker)


def marker_motion(model: ElastostaticModel, q: ArrayLike, moved: Array, marker: ArrayLike) -> Array:
    """Motion of markers on a tool that moves by a displacement d and a rotation R.

    A marker at an offset o from the tool point, in world axes, moves by ``d + (R - I) o``.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        q: Joint variables (..., n) without load [rad or m].
        moved: Displacements and rotation vectors of the tool (..., 6), in world axes [m, rad].
        marker: Offsets (..., 3) or (3,) from the tool point, in the tool frame [m].

    Returns:
        Motions (..., rows) [m, rad].
    """
    marker = np.asarray(marker, dtype=float)
    if marker.any():
        from scipy.spatial.transform import Rotation

        orientation = model.robot.forward(q)[..., :3, :3]
        orientation = np.broadcast_to(orientation, (*moved.shape[:-1], 3, 3))
        offset = (orientation @ marker[..., None])[..., 0].reshape(-1, 3)
        # Not offset x rotation: the equilibrium is exact, and so is the turn of the tool.
        swing = Rotation.from_rotvec(moved[..., 3:].reshape(-1, 3)).apply(offset) - offset
        added = np.concatenate([swing, np.zeros_like(swing)], axis=-1)
        moved = moved + added.reshape(moved.shape)
    return moved[..., :3] if model.rows == "position" else moved
