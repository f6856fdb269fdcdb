"""What is measured and what loads the joints, as a certificate holds it."""

from typing import Any

from edtk.model.body_point import BodyPoint
from edtk.model.dead_weights import DeadWeights
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.sensors.distance import Distance
from edtk.model.sensors.marker import Marker
from edtk.model.sensors.pose_marker import PoseMarker
from edtk.model.sensors.sensor import Sensor

KINDS: dict[type[Sensor], str] = {Marker: "position", PoseMarker: "pose", Distance: "distance"}


def physics_to_dict(model: ElastostaticModel) -> dict[str, Any]:
    """Write instruments, load point and weights as plain data [m, kg].

    Returns:
        One key; none where load and measurement are at the tool point.
    """
    if model.is_plain:
        return {}
    return {
        "physics": {
            "sensors": [_sensor(sensor) for sensor in model.whole_instruments],
            "load_point": place_to_dict(model.load_point),
            "weights": [] if model.weights is None else weights_to_list(model.weights),
        }
    }


def weights_to_list(weights: DeadWeights) -> list[dict[str, Any]]:
    """Mass [kg] and centre of mass of each weight."""
    parts = zip(weights.masses, weights.centers, strict=True)
    return [{"mass": mass, **place_to_dict(center)} for mass, center in parts]


def _sensor(sensor: Sensor) -> dict[str, Any]:
    anchor = {"anchor": sensor.anchor.tolist()} if isinstance(sensor, Distance) else {}
    return {"kind": KINDS[type(sensor)], **place_to_dict(sensor.point), **anchor}


def place_to_dict(point: BodyPoint) -> dict[str, Any]:
    """Offset (3,) of a point [m], in the frame of the joint of this index, or of the tool."""
    return {"offset": point.offset.tolist(), "joint": point.joint}
