"""What the instruments of a study see: built from its keys, and checked."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from edtk.cell.beams import Beams
from edtk.cell.cell import standing_at
from edtk.cell.sight import Eye, Reflector, Sight
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.instruments.distance import Distance
from edtk.robots.frames import BodyPoint
from edtk.study.asked import Asked
from edtk.study.study_model import is_reference, on_robot
from edtk.study.tables_of_cell import ACCEPTANCE, SightTable
from edtk.study.tables_of_measurement import MarkerTable
from edtk.system.typing import Array

LOOKED_AT = 4096  # poses within the limits, in one of which a marker must be seen
EXPLAINED_POSES = 256  # of these, of which reasons are told
TRACKER = "tracker"
BEAM_RADIUS = 5.0  # [mm]
OWN_BODY = 100.0  # [mm]
UNNAMED = ""  # the tool point, where a study has no marker
NEITHER = (
    "expected to know where the instrument stands: noise.tracker_position_mm with along and "
    "across, or [[sight.camera]]"
)


def says_sight(study: Asked) -> bool:
    """Whether a study says anything of what its instrument sees."""
    given = study.specification
    looks = any(one.normal is not None or one.acceptance_deg is not None for one in given.marker)
    return given.sight is not None or looks


def study_sight(study: Asked, model: ElastostaticModel) -> Sight | None:
    """What is read in which poses; None where a study says nothing of that.

    Args:
        study: Its keys and its robot.
        model: Its model, whose instruments are markers on the robot and distances.
    """
    if not says_sight(study):
        return None
    tables = {name: one for one, name in on_robot(study)}
    reflectors = tuple(
        None
        if isinstance(sensor, Distance)
        else _reflector(sensor.name, sensor.point, tables.get(sensor.name))
        for sensor in model.whole_instruments
    )
    widths = tuple(sensor.rows for sensor in model.whole_instruments)
    return Sight(study.robot, tuple(_eyes(study)), reflectors, widths, _beams(study))


def _beams(study: Asked) -> Beams | None:
    """What may hide a marker: the bodies of the cell; None without one."""
    if study.cell is None:
        return None
    table = study.specification.sight or SightTable()
    radius = BEAM_RADIUS if table.beam_radius_mm is None else table.beam_radius_mm
    own = OWN_BODY if table.own_body_mm is None else table.own_body_mm
    return Beams(study.cell, radius / 1e3, own / 1e3)


def sight_by_name(sight: Sight, names: tuple[str, ...], rows: int) -> Sight:
    """The same for instruments in another order, each of which has so many rows.

    Where a study names no marker, those of a sheet are all at the tool point.

    Args:
        sight: Of the study.
        names: The instruments.
        rows: Measured rows of each.
    """
    own = {one.name: one for one in sight.seeable}
    alone = own.get(UNNAMED)
    found = tuple(own.get(name, alone) for name in names)
    return replace(sight, reflectors=found, widths=(rows,) * len(names))


def _reflector(name: str, point: BodyPoint, table: MarkerTable | None) -> Reflector:
    """A marker; without a table of its own it is the tool point, seen from all sides."""
    if table is None or table.normal is None:
        return Reflector(name, point)
    normal = np.array(table.normal) / np.linalg.norm(table.normal)
    angle = ACCEPTANCE if table.acceptance_deg is None else table.acceptance_deg
    return Reflector(name, point, normal, float(np.deg2rad(angle)))


def _eyes(study: Asked) -> Iterator[Eye]:
    """The tracker of [noise], then cameras."""
    base = study.robot.base[:3, 3]
    given = study.specification
    table = given.sight or SightTable()
    if given.noise is not None and given.noise.tracker_position_mm is not None:
        yield table.eye(TRACKER, np.array(given.noise.tracker_position_mm) / 1e3, base)
    for i, camera in enumerate(table.camera):
        name = camera.name or f"camera {i + 1}"
        yield camera.eye(name, np.array(camera.position_mm) / 1e3, base)


def check_sight(study: Asked, sight: Sight | None) -> None:
    """Check that the keys of a line of sight are whole, and that each marker is seen somewhere.

    Raises:
        UserError: One line that names the study, the key and what was expected.
    """
    for i, one in enumerate(study.specification.marker):
        if one.acceptance_deg is not None and one.normal is None:
            raise study.error(
                f"marker.{i}.normal", "expected, as acceptance_deg is given: where the marker looks"
            )
        if one.normal is not None and is_reference(study, one):
            raise study.error(
                f"marker.{i}.normal",
                "the marker stands on the base, and is no part of plans; leave it out",
            )
    if sight is None:
        return
    _check_eyes(study, sight)
    _check_beams(study, sight)
    _check_seen(study, sight)


def _check_eyes(study: Asked, sight: Sight) -> None:
    """There is an eye, and what is said of a tracker is said of one."""
    table = study.specification.sight or SightTable()
    noise = study.specification.noise
    tracked = noise is not None and noise.has_tracker
    if not sight.eyes:
        marked = [i for i, one in enumerate(study.specification.marker) if one.normal is not None]
        key = "sight" if study.specification.sight is not None else f"marker.{marked[0]}.normal"
        raise study.error(key, NEITHER)
    if not tracked and table.of_tracker:
        raise study.error(f"sight.{table.of_tracker[0]}", f"is said of a tracker; {NEITHER}")


def _check_beams(study: Asked, sight: Sight) -> None:
    """Keys of beams go with a cell, in none of whose bodies an eye stands."""
    table = study.specification.sight or SightTable()
    if sight.beams is None:
        for key in ("beam_radius_mm", "own_body_mm"):
            if getattr(table, key) is not None:
                raise study.error(f"sight.{key}", "goes with [scene], which has what hides markers")
        return
    for eye in sight.eyes:
        within = standing_at(sight.beams.cell.bodies, eye.position)
        if within is not None:
            key = "noise.tracker_position_mm" if eye.name == TRACKER else "sight.camera"
            raise study.error(key, f"the {eye.name} stands inside {within[0]!r}")


def _check_seen(study: Asked, sight: Sight) -> None:
    """Each marker is seen in some pose within the joint limits, as far as a sample can tell."""
    q = sample_poses(study, LOOKED_AT)
    for i in sight.always_hidden(q):
        one = sight.reflectors[i]
        assert one is not None
        whys = [why for pose in sight.hidden(q[:EXPLAINED_POSES]) if (why := pose[i]) is not None]
        usual = Counter(why.reason for why in whys).most_common(1)[0][0]
        example = next(why for why in whys if why.reason == usual)
        name = repr(one.name) if one.name else "the tool point"
        raise study.error(
            "marker" if study.specification.marker else "sight",
            f"no pose shows {name} to the {sight.eyes[0].name}; most often it is so: {example}",
        )


def sample_poses(study: Asked, count: int) -> Array:
    """Poses (count, n) within the joint limits, fixed joints where they stay."""
    lower, upper = study.robot.limits
    q = lower + (upper - lower) * np.random.default_rng(0).random((count, study.robot.n))
    for joint, value in study.fixed.items():
        q[:, joint] = value
    return q
